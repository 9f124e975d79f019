//! Vehicles on the link, by system id.

use std::collections::BTreeMap;

use hums_core::clock::{Instant, Span};
use hums_core::component::{COMPONENTS_MAX, Component};
use hums_core::health::{Finding, Subsystem};
use hums_core::observation::Observation;
use hums_link::{Check, Frame, observe};
use hums_onboard::monitoring::TICK;

use super::craft::Craft;
use super::native::Entry;
use super::told::{Limits, MonitorRecord, parameter, place_of};
use crate::check::SETTLE;
use crate::mavlink::ids::PARAM_VALUE;
use crate::page::history::History;
use crate::page::note::Note;
use crate::source::told::Finding as BoxFinding;

/// Further ones are counted.
pub const VEHICLES_MAX: usize = 8;
/// Longer silences are stepped through only at both ends.
const SILENCE_MAX: Span = Span::from_secs(600);
/// Time for debounce and age at a silence's beginning.
const SILENCE_HEAD: Span = Span::from_secs(60);

/// A session's start is recorded at once.
const BEGINNING: Instant = Instant::from_millis(10_000);

/// Histories by system id.
pub type Histories = BTreeMap<u8, History>;

/// All vehicles and frames.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// By system id.
    pub crafts: BTreeMap<u8, Craft>,
    /// Number of frames received, from any sender.
    pub frames: u64,
    /// Frames of vehicles beyond [`VEHICLES_MAX`].
    pub refused: u64,
    /// Findings since last cleared, at most `FOUND_MAX`.
    pub found: Vec<(Instant, u8, Finding)>,
    limits: Limits,
    /// See [`Craft::on_the_wire`].
    on_the_wire: bool,
    /// The log's first vehicle.
    owner: Option<u8>,
    /// Parameters before their first heartbeat: system and frame.
    early: Vec<(u8, Vec<u8>)>,
    /// The log's parts before that.
    parts: [Option<Component>; COMPONENTS_MAX],
    next_tick: Instant,
}

/// Parameters of all systems, until a heartbeat.
const EARLY_MAX: usize = 2_048;

/// More than all checks could change in a step.
const FOUND_MAX: usize = 4_096;

impl World {
    /// Empty.
    pub fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Frames from the autopilot's own wire.
    #[must_use]
    pub fn on_the_wire(self, on_the_wire: bool) -> Self {
        Self { on_the_wire, ..self }
    }

    /// A HUMS log's first frame may come long after power-on.
    pub fn begin(&mut self, at: Instant) {
        self.next_tick = at;
    }

    /// Growing data go to `histories`, if given.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, mut histories: Option<&mut Histories>) {
        self.advance(at, histories.as_deref_mut());
        self.frames += 1;
        if frame.check() != Check::Verified {
            return;
        }
        let system = frame.system();
        let known = self.crafts.contains_key(&system);
        // An autopilot's heartbeat makes a vehicle.
        let told = if known { None } else { observe(frame) };
        match told {
            Some((_, Observation::Heartbeat(_))) => self.meet(at, system),
            // A radio is a system of its own.
            Some((source, radio @ Observation::TelemetryRadio(_))) => {
                for (system, craft) in &mut self.crafts {
                    craft.observe(at, source, &radio, &mut history_of(&mut histories, *system));
                }
            }
            _ if !known && frame.id() == PARAM_VALUE && self.early.len() < EARLY_MAX => {
                self.early.push((system, frame.bytes().to_vec()));
            }
            _ => {}
        }
        if let Some(craft) = self.crafts.get_mut(&system) {
            let mut history = history_of(&mut histories, system);
            craft.frame(at, frame, &mut history);
            if !known {
                let told = self.early.extract_if(.., |(of, _)| *of == system);
                let told: Vec<_> = told.collect();
                told.iter()
                    .filter_map(|(_, bytes)| Frame::again(bytes, Check::Verified))
                    .for_each(|frame| craft.parameter(at, &frame, &mut history));
            }
            if let Some((name, value)) = parameter(frame) {
                self.limits.take(craft.monitor.params_mut(), &name, value);
            }
        }
    }

    fn meet(&mut self, at: Instant, system: u8) {
        if self.crafts.len() >= VEHICLES_MAX {
            self.refused += 1;
            return;
        }
        let mut craft = Craft::new(at, self.limits.params(), self.on_the_wire);
        if self.owner.is_none() {
            self.owner = Some(system);
            for (place, part) in self.parts.iter().enumerate() {
                if let Some(part) = part {
                    craft.learn_part(place, *part);
                }
            }
        }
        self.crafts.insert(system, craft);
    }

    /// An entry of a log without frames.
    pub fn entry(&mut self, at: Instant, entry: &Entry, mut histories: Option<&mut Histories>) {
        let system = match entry {
            Entry::Observation(source, _) => source.system,
            Entry::Text(text) => text.source.system,
            Entry::Parameter(..) | Entry::More(_) => {
                // Parameters come before the vehicle is known.
                let only = self.crafts.keys().next().copied().unwrap_or(1);
                return match (history_of(&mut histories, only), entry) {
                    (Some(history), Entry::Parameter(name, value)) => history.parameter(at, name, *value),
                    (Some(history), Entry::More(more)) => history.more(at, more),
                    _ => {}
                };
            }
            Entry::Gap(from, to) => return self.pass(*from, *to, histories),
        };
        self.advance(at, histories.as_deref_mut());
        self.frames += 1;
        if let Entry::Observation(_, observation) = entry
            && matches!(**observation, Observation::Heartbeat(_))
            && !self.crafts.contains_key(&system)
        {
            self.meet(at, system);
        }
        let Some(craft) = self.crafts.get_mut(&system) else { return };
        let mut history = history_of(&mut histories, system);
        match entry {
            Entry::Observation(source, observation) => craft.observe(at, *source, observation, &mut history),
            Entry::Text(text) => craft.text(text.clone(), &mut history),
            Entry::Parameter(..) | Entry::More(_) | Entry::Gap(..) => {}
        }
    }

    /// A gap in an autopilot's log is no silence: no steps over it, nor until the first values ([`SETTLE`]).
    fn pass(&mut self, from: Instant, to: Instant, histories: Option<&mut Histories>) {
        // A gap from before the last item is a count over the log.
        if self.next_tick <= to && from + SETTLE + TICK >= self.next_tick {
            self.advance(from, histories);
            let settle = if to.since(from) >= SETTLE { SETTLE } else { TICK };
            self.next_tick = self.next_tick.max(to + settle);
        }
    }

    /// Another report of a log.
    pub fn told(&mut self, at: Instant, told: &MonitorRecord, mut histories: Option<&mut Histories>) {
        if let MonitorRecord::Missing { from, to, frames } = told {
            return self.miss(*from, *to, *frames, histories);
        }
        self.advance(at, histories.as_deref_mut());
        match told {
            MonitorRecord::Parameter { name, value, start } => {
                self.limits.learn(name, *value);
                // Each file repeats the table. At the start it comes before parts with hours: others have run
                // zero.
                let new = |place: &usize| matches!(self.parts.get(*place), Some(None));
                if let Some(place) = place_of(name).filter(|_| *start && at < BEGINNING).filter(new) {
                    self.part(place, Component::default());
                }
                for craft in self.crafts.values_mut() {
                    self.limits.take(craft.monitor.params_mut(), name, *value);
                }
            }
            MonitorRecord::Part { place, component } => self.part(*place, *component),
            MonitorRecord::Finding(finding) => self.found_on_board(finding, histories),
            MonitorRecord::CellsUnknown => {
                let owner = self.owner.and_then(|owner| Some((owner, self.crafts.get_mut(&owner)?)));
                if let Some((owner, craft)) = owner {
                    craft.say_cells_unknown(at, &mut history_of(&mut histories, owner));
                }
            }
            MonitorRecord::Checked
            | MonitorRecord::StoreNew
            | MonitorRecord::Peak { .. }
            | MonitorRecord::Missing { .. } => {}
        }
    }

    /// A gap is no silence.
    fn miss(&mut self, from: Instant, to: Instant, frames: u64, mut histories: Option<&mut Histories>) {
        self.pass(from, to, histories.as_deref_mut());
        for (system, craft) in &mut self.crafts {
            craft.miss(if self.owner == Some(*system) { frames } else { 0 });
            if let Some(history) = history_of(&mut histories, *system) {
                history.gap(Some((from, to)));
            }
        }
    }

    /// The monitor here finds the same from frames, except for findings about the box.
    fn found_on_board(&mut self, finding: &BoxFinding, mut histories: Option<&mut Histories>) {
        let Some(owner) = self.owner else { return };
        let is_new = finding.subsystem == Subsystem::Recorder
            || self.crafts.get_mut(&owner).is_some_and(|craft| craft.found_on_board(finding));
        if is_new && let Some(history) = history_of(&mut histories, owner) {
            history.note(finding.at, Note::told(finding));
        }
    }

    fn part(&mut self, place: usize, component: Component) {
        if let Some(part) = self.parts.get_mut(place) {
            *part = Some(component);
        }
        if let Some(craft) = self.owner.and_then(|owner| self.crafts.get_mut(&owner)) {
            craft.learn_part(place, component);
        }
    }

    /// Steps every check until `now`.
    pub fn advance(&mut self, now: Instant, mut histories: Option<&mut Histories>) {
        if now.since(self.next_tick) > SILENCE_MAX {
            let head = self.next_tick + SILENCE_HEAD;
            self.step_until(head, histories.as_deref_mut());
            let tail = now.as_micros().saturating_sub(SILENCE_HEAD.as_micros());
            self.next_tick = Instant::from_micros(tail);
        }
        self.step_until(now, histories);
    }

    fn step_until(&mut self, now: Instant, mut histories: Option<&mut Histories>) {
        while self.next_tick <= now {
            for (system, craft) in &mut self.crafts {
                let found = &mut self.found;
                craft.tick(self.next_tick, &mut history_of(&mut histories, *system), &mut |finding| {
                    if found.len() < FOUND_MAX {
                        found.push((self.next_tick, *system, *finding));
                    }
                });
            }
            self.next_tick = self.next_tick + TICK;
        }
    }
}

/// Of a vehicle; a new one is empty.
fn history_of<'a>(histories: &'a mut Option<&mut Histories>, system: u8) -> Option<&'a mut History> {
    histories.as_deref_mut().map(|histories| histories.entry(system).or_default())
}

#[cfg(test)]
mod tests {
    use hums_core::component::{ComponentFigures, ComponentKind, Status};
    use hums_core::health::Level;
    use hums_core::observation::{Battery, Heartbeat, LandedState, Source, VtolState};
    use hums_core::units::Volts;
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::messages;
    use hums_link::packet::Packet;

    use super::*;
    use crate::live::board::HealthBoard;
    use crate::mavlink::ids::HEARTBEAT;
    use crate::page::history::Cursor;

    fn heartbeat(system: u8) -> Vec<u8> {
        let mut buffer = [0; FRAME_BYTES_MAX];
        let packet = Packet::new(HEARTBEAT).u8(4, 2).u8(5, 3).u8(7, 3).u8(8, 3);
        Encoder::of(system, 1).frame(&mut buffer, &packet).to_vec()
    }

    fn hear(world: &mut World, histories: &mut Histories, at: Instant, bytes: &[u8]) {
        world.frame(at, &Frame::parse(bytes).expect("a frame"), Some(histories));
    }

    #[test]
    fn vehicles_on_one_link_are_told_apart_and_bounded() {
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        for system in 1..=20 {
            hear(&mut world, &mut histories, Instant::from_millis(u64::from(system)), &heartbeat(system));
        }
        assert_eq!(world.crafts.keys().copied().collect::<Vec<_>>(), (1..=8).collect::<Vec<u8>>());
        assert_eq!((world.refused, world.frames), (12, 20));
        assert!(world.crafts.iter().all(|(system, craft)| {
            craft.monitor.vehicle().source.is_some_and(|source| source.system == *system)
        }));
    }

    #[test]
    fn a_page_is_told_how_many_frames_came_in_each_second() {
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        let (mut cursor, mut told) = (Cursor::default(), Vec::new());
        for turn in 0..500_u64 {
            let now = Instant::from_micros(13_000 + turn * 11_700);
            if turn % 10 == 0 {
                hear(&mut world, &mut histories, now, &heartbeat(1));
            }
            world.advance(now, Some(&mut histories));
            let part = histories.get(&1).and_then(|history| history.since(1, &mut cursor, now));
            let part = serde_json::to_value(part).expect("JSON");
            told.extend(part["series"]["Frames:0"][1].as_array().into_iter().flatten().cloned());
        }
        // Twice: lowest and highest of its moment.
        assert_eq!(told, [9.0, 9.0, 8.0, 8.0, 9.0, 9.0, 9.0, 9.0, 8.0, 8.0]);
    }

    #[test]
    fn a_gap_of_an_autopilots_own_log_is_no_silence_of_the_vehicle() {
        let source = Source { system: 1, component: 1 };
        let beat = Heartbeat { armed: true, ..Heartbeat::default() };
        let beat = Entry::Observation(source, Box::new(Observation::Heartbeat(beat)));
        let found = |gap: bool| {
            let mut world = World::new(Limits::default()).on_the_wire(true);
            world.begin(Instant::ZERO);
            for second in (0..20).chain(40..60) {
                if gap && second == 40 {
                    let (from, to) = (Instant::from_millis(19_000), Instant::from_millis(40_000));
                    world.entry(to, &Entry::Gap(from, to), None);
                }
                world.entry(Instant::from_millis(second * 1_000), &beat, None);
            }
            world.found.iter().filter(|(.., finding)| finding.level != Level::Ok).count()
        };
        assert!(found(false) > 0, "a silence is found");
        assert_eq!(found(true), 0);
    }

    #[test]
    fn what_a_box_lost_is_counted_and_is_a_gap_of_the_page() {
        let (mut world, mut histories) = (World::new(Limits::default()).on_the_wire(true), Histories::new());
        world.begin(Instant::ZERO);
        let at = Instant::from_millis;
        for second in 0..20 {
            hear(&mut world, &mut histories, at(second * 1_000), &heartbeat(1));
        }
        let lost = MonitorRecord::Missing { from: at(19_100), to: at(39_900), frames: 3_591 };
        world.told(at(39_950), &lost, Some(&mut histories));
        for second in 40..60 {
            hear(&mut world, &mut histories, at(second * 1_000), &heartbeat(1));
        }
        assert_eq!(world.crafts[&1].missing, 3_591);
        assert!(world.found.iter().all(|(.., finding)| finding.level == Level::Ok), "{:?}", world.found);
        let part = |until_s: u64| {
            let part = histories[&1].since(1, &mut Cursor::default(), at(until_s * 1_000)).expect("a part");
            serde_json::to_value(part).expect("JSON")["gaps"].clone()
        };
        assert_eq!((part(19), part(60)), (serde_json::json!([]), serde_json::json!([[19.1, 39.9]])));
    }

    #[test]
    fn a_vehicle_that_is_first_heard_in_the_air_has_not_just_taken_off() {
        let mut encoder = Encoder::of(1, 1);
        let mut frame = |packet: &Packet| {
            let mut buffer = [0; FRAME_BYTES_MAX];
            encoder.frame(&mut buffer, packet).to_vec()
        };
        let armed = frame(&Packet::new(HEARTBEAT).u8(4, 2).u8(5, 3).u8(6, 128).u8(7, 4).u8(8, 3));
        let position = frame(&Packet::new(33).u32(16, 25_000));
        let hud = frame(&Packet::new(74).f32(8, 25.0).u8(18, 40));
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        for second in 0..8 {
            for bytes in [&armed, &position, &hud] {
                hear(&mut world, &mut histories, Instant::from_millis(second * 1_000), bytes);
            }
        }
        world.advance(Instant::from_millis(7_500), Some(&mut histories));
        assert!(world.crafts[&1].monitor.flight().airborne());
        let part = histories[&1].since(1, &mut Cursor::default(), Instant::from_millis(8_000));
        let part = serde_json::to_value(part).expect("JSON");
        let words: Vec<_> =
            part["notes"].as_array().into_iter().flatten().map(|note| &note["words"]).collect();
        assert_eq!(words, ["armed when it was first heard", "in the air when it was first heard"]);
    }

    /// 20.4 V: five cells or six.
    #[test]
    fn cells_that_are_not_known_are_said_at_once_in_the_air_and_a_box_that_knew_them_has_its_word() {
        let source = Source { system: 1, component: 1 };
        let flying = [
            Observation::Heartbeat(Heartbeat { armed: true, ..Heartbeat::default() }),
            Observation::Landed(LandedState::InAir, VtolState::Unknown),
            Observation::Battery(Battery { voltage: Some(Volts(20.4)), ..Battery::default() }),
        ];
        let entries = flying.map(|seen| Entry::Observation(source, Box::new(seen)));
        let told = |on_the_wire: bool| {
            let (mut world, mut histories) =
                (World::new(Limits::default()).on_the_wire(on_the_wire), Histories::new());
            for tenth in 0..50 {
                for entry in &entries {
                    world.entry(Instant::from_millis(tenth * 100), entry, Some(&mut histories));
                }
                if on_the_wire && tenth == 30 {
                    let at = Instant::from_millis(2_950);
                    let finding = BoxFinding {
                        at,
                        subsystem: Subsystem::Power,
                        check: "cell_voltage".to_owned(),
                        instance: 0,
                        level: Level::Critical,
                        previous: Level::Ok,
                        value: 3.4,
                        worst: None,
                        limit: 3.5,
                        unit: "V".to_owned(),
                    };
                    world.told(at, &MonitorRecord::Finding(Box::new(finding)), Some(&mut histories));
                }
            }
            let now = Instant::from_millis(5_000);
            let part = histories[&1].since(1, &mut Cursor::default(), now).expect("a part");
            let notes = serde_json::to_value(part).expect("JSON")["notes"].clone();
            let notes: Vec<String> = notes
                .as_array()
                .into_iter()
                .flatten()
                .map(|note| format!("{} {}", note["from"], note["words"]))
                .collect();
            let board =
                serde_json::to_value(&HealthBoard::of(&world.crafts[&1], now).parts[0]).expect("JSON");
            (notes.join("; "), format!("{}: {}", board["level"], board["reason"]))
        };
        let (notes, power) = told(false);
        assert!(
            notes.contains("cells not known: ") && power.contains("cells not known: "),
            "{notes}, {power}"
        );
        let (notes, power) = told(true);
        assert!(!notes.contains("cells not known"), "the box may know them: {notes}");
        assert!(notes.contains("\"on board\" \"battery 1 cell low"), "{notes}");
        assert!(power.contains("critical") && power.contains("battery 1 cell low: 3.40 V"), "{power}");
    }

    #[test]
    fn parameters_that_come_before_the_first_heartbeat_are_told() {
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        let mut encoder = Encoder::of(1, 1);
        for name in ["RTL_ALT", "PILOT_SPEED_UP"] {
            let mut buffer = [0; FRAME_BYTES_MAX];
            let frame = encoder.frame(&mut buffer, &messages::param_value(name, 15.0, 0, 2)).to_vec();
            hear(&mut world, &mut histories, Instant::from_millis(1), &frame);
        }
        hear(&mut world, &mut histories, Instant::from_millis(900), &heartbeat(1));
        let told: Vec<_> = histories[&1].last_parameters().map(|(name, _)| name.to_owned()).collect();
        assert_eq!(told, ["PILOT_SPEED_UP", "RTL_ALT"]);
        assert!(world.early.is_empty());
    }

    #[test]
    fn a_silence_of_hours_is_stepped_over_and_found() {
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        for second in 0..30 {
            hear(&mut world, &mut histories, Instant::from_millis(second * 1000), &heartbeat(1));
        }
        let start = std::time::Instant::now();
        world.advance(Instant::from_millis(100 * 3600 * 1000), Some(&mut histories));
        assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
        let link = world.crafts[&1].monitor.health().subsystem(hums_core::health::Subsystem::Link);
        assert_ne!(link, hums_core::health::Level::Ok, "nobody has been heard for hours");
    }

    /// Ten hours, as in a log's parameters.
    fn tell_limits(world: &mut World) {
        for (name, value) in [("CMP1_KIND", 3.0), ("CMP1_NUMBER", 2.0), ("CMP1_MOT_HOURS", 10.0)] {
            let told = MonitorRecord::Parameter { name: name.to_owned(), value, start: true };
            world.told(Instant::from_millis(1), &told, None);
        }
    }

    /// Has turned nine and a half of them.
    fn motor() -> MonitorRecord {
        let mut component = Component::default();
        (component.kind, component.number) = (ComponentKind::Motor, 2);
        component.ran = ComponentFigures { motor_s: 9.5 * 3_600.0, ..ComponentFigures::default() };
        MonitorRecord::Part { place: 0, component }
    }

    #[test]
    fn a_part_of_a_log_is_due_by_all_that_it_has_run_whether_told_before_the_vehicle_or_after() {
        for before in [true, false] {
            let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
            tell_limits(&mut world);
            if before {
                world.told(Instant::from_millis(2), &motor(), None);
            }
            hear(&mut world, &mut histories, Instant::from_millis(10), &heartbeat(1));
            if !before {
                world.told(Instant::from_millis(500), &motor(), None);
            }
            world.advance(Instant::from_millis(3_000), Some(&mut histories));
            let craft = &world.crafts[&1];
            let (figures, status) = craft.monitor.component_figures(0).expect("a part");
            assert_eq!((figures.motor_s, status), (9.5 * 3_600.0, Status::Yellow), "before: {before}");
            assert_eq!(craft.monitor.component_used_percent(0), Some(95.0));
            assert!(craft.knows_life(0) && !craft.knows_life(1), "before: {before}");
        }
    }

    #[test]
    fn a_part_that_a_logs_start_describes_and_that_ran_nothing_begins_with_the_session() {
        let (mut world, mut histories) = (World::new(Limits::default()), Histories::new());
        tell_limits(&mut world);
        hear(&mut world, &mut histories, Instant::from_millis(10), &heartbeat(1));
        world.advance(Instant::from_millis(3_000), Some(&mut histories));
        assert!(world.crafts[&1].knows_life(0));
        assert_eq!(world.crafts[&1].monitor.component_used_percent(0), Some(0.0));

        world.told(Instant::from_millis(3_500), &motor(), None);
        tell_limits(&mut world);
        world.advance(Instant::from_millis(4_000), Some(&mut histories));
        assert_eq!(world.crafts[&1].monitor.component_used_percent(0), Some(95.0));
    }

    #[test]
    fn the_boxs_parameters_on_the_link_are_its_vehicles_but_those_that_the_user_gave_stay() {
        let spec =
            hums_core::parameters::TABLE.iter().find(|spec| spec.name == "CMP1_FLIGHTS").expect("it is");
        let (mut world, mut histories) = (World::new(Limits::new(&[(spec, 7.0)])), Histories::new());
        for system in [1, 2] {
            hear(&mut world, &mut histories, Instant::from_millis(1), &heartbeat(system));
        }
        let mut encoder = Encoder::new();
        encoder.set_system(1);
        for (name, value) in [("CMP1_KIND", 1.0), ("CMP1_FLIGHTS", 50.0), ("CMP1_HOURS", 25.0)] {
            let mut buffer = [0; FRAME_BYTES_MAX];
            let frame = encoder.frame(&mut buffer, &messages::param_value(name, value, 0, 100)).to_vec();
            hear(&mut world, &mut histories, Instant::from_millis(5), &frame);
        }
        world.advance(Instant::from_millis(3_000), Some(&mut histories));
        let params = world.crafts[&1].monitor.params();
        let value = |name| params.iter().find(|(spec, _)| spec.name == name).map(|(_, value)| value);
        assert_eq!([value("CMP1_FLIGHTS"), value("CMP1_HOURS")], [Some(7.0), Some(25.0)]);
        assert!(world.crafts[&1].monitor.component_figures(0).is_some());
        assert!(!world.crafts[&1].knows_life(0), "no link tells what it ran before");
        assert!(world.crafts[&2].monitor.component_figures(0).is_none(), "another vehicle");
    }
}
