//! Everything on the link: each vehicle apart, by its system id.

use std::collections::BTreeMap;

use hums_core::health::Finding;
use hums_core::monitor::TICK;
use hums_core::observation::Observation;
use hums_core::params::Params;
use hums_core::time::{Instant, Span};
use hums_link::{Check, Frame, observe};

use super::craft::Craft;
use super::history::History;

/// Vehicles that are told apart; later ones are counted.
pub const VEHICLES_MAX: usize = 8;
/// A silence that is longer than this is stepped through only at its beginning and end.
const SILENCE_MAX: Span = Span::from_secs(600);
/// What a check's debounce and age need at its beginning.
const SILENCE_HEAD: Span = Span::from_secs(60);

/// Histories by system id.
pub type Histories = BTreeMap<u8, History>;

/// All vehicles, and what was heard in all.
#[derive(Clone, Debug)]
pub struct World {
    /// By system id.
    pub crafts: BTreeMap<u8, Craft>,
    /// Frames heard, whoever sent them.
    pub frames: u64,
    /// Those of them that fit no definition of ours.
    pub unverified: u64,
    /// Frames of vehicles beyond [`VEHICLES_MAX`].
    pub refused: u64,
    /// Findings since this was cleared, with whose they are; what nobody clears stops at [`FOUND_MAX`].
    pub found: Vec<(u8, Finding)>,
    params: Params,
    next_tick: Instant,
}

/// More in one step than all checks together could change is not possible.
const FOUND_MAX: usize = 4_096;

impl World {
    /// Nothing heard yet; `params` are the limits.
    pub fn new(params: Params) -> Self {
        Self {
            crafts: BTreeMap::new(),
            frames: 0,
            unverified: 0,
            refused: 0,
            found: Vec::new(),
            params,
            next_tick: Instant::ZERO,
        }
    }

    /// Time begins here: a HUMS log's first frame may come long after power-on.
    pub fn begin(&mut self, at: Instant) {
        self.next_tick = at;
    }

    /// Takes a frame. What is kept goes to `histories`, where there are any.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, mut histories: Option<&mut Histories>) {
        self.advance(at, histories.as_deref_mut());
        self.frames += 1;
        if frame.check() != Check::Verified {
            self.unverified += 1;
            return;
        }
        let system = frame.system();
        let known = self.crafts.contains_key(&system);
        // Only an autopilot's heartbeat makes a system a vehicle.
        let told = if known { None } else { observe(frame) };
        match told {
            Some((_, Observation::Heartbeat(_))) if self.crafts.len() < VEHICLES_MAX => {
                self.crafts.insert(system, Craft::new(at, &self.params));
            }
            Some((_, Observation::Heartbeat(_))) => self.refused += 1,
            // A radio is a system of its own, and everybody's.
            Some((source, radio @ Observation::TelemetryRadio(_))) => {
                for (system, craft) in &mut self.crafts {
                    let mut history =
                        histories.as_deref_mut().map(|histories| histories.entry(*system).or_default());
                    craft.observe(at, source, &radio, &mut history);
                }
            }
            _ => {}
        }
        if let Some(craft) = self.crafts.get_mut(&system) {
            let mut history = histories.map(|histories| histories.entry(system).or_default());
            craft.frame(at, frame, &mut history);
        }
    }

    /// Time passes: every check is stepped until `now`.
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
                let mut history =
                    histories.as_deref_mut().map(|histories| histories.entry(*system).or_default());
                let found = &mut self.found;
                craft.tick(self.next_tick, &mut history, &mut |finding| {
                    if found.len() < FOUND_MAX {
                        found.push((*system, *finding));
                    }
                });
            }
            self.next_tick = self.next_tick + TICK;
        }
    }
}

#[cfg(test)]
mod tests {
    use hums_link::encode::{Encoder, GS_FRAME_BYTES_MAX};
    use hums_link::packet::Packet;

    use super::*;

    /// HEARTBEAT of an `ArduPilot` quadrotor, disarmed.
    fn heartbeat(system: u8) -> Vec<u8> {
        let mut buffer = [0; GS_FRAME_BYTES_MAX];
        let packet = Packet::new(0).u8(4, 2).u8(5, 3).u8(7, 3).u8(8, 3);
        Encoder::of(system, 1).frame(&mut buffer, &packet).to_vec()
    }

    fn hear(world: &mut World, histories: &mut Histories, at: Instant, bytes: &[u8]) {
        world.frame(at, &Frame::parse(bytes).expect("a frame"), Some(histories));
    }

    #[test]
    fn vehicles_on_one_link_are_told_apart_and_bounded() {
        let (mut world, mut histories) = (World::new(Params::defaults()), Histories::new());
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
    fn a_silence_of_hours_is_stepped_over_and_found() {
        let (mut world, mut histories) = (World::new(Params::defaults()), Histories::new());
        for second in 0..30 {
            hear(&mut world, &mut histories, Instant::from_millis(second * 1000), &heartbeat(1));
        }
        let start = std::time::Instant::now();
        world.advance(Instant::from_millis(100 * 3600 * 1000), Some(&mut histories));
        assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
        let link = world.crafts[&1].monitor.health().subsystem(hums_core::health::Subsystem::Link);
        assert_ne!(link, hums_core::health::Level::Ok, "nobody has been heard for hours");
    }
}
