use super::*;
use crate::packet::Fields;

#[derive(Default)]
struct Script {
    autopilot: Autopilot,
    streams: Vec<(u32, u32)>,
    /// Unsupported messages.
    unknown: Vec<u32>,
    empty: Vec<u32>,
    deaf: bool,
    /// Answers every `SET_MESSAGE_INTERVAL` with this `MAV_RESULT`.
    refuses: Option<u8>,
    /// Does not know `REQUEST_MESSAGE`.
    no_single: bool,
    reboots: u32,
    identified: bool,
    baud: u32,
    parameters: Vec<&'static str>,
    parameters_asked: Vec<(u64, String)>,
    /// Time in ms, command (or stream with the highest bit), first parameter.
    asked: Vec<(u64, u16, u32)>,
}

impl Script {
    fn new(autopilot: Autopilot) -> Self {
        Self { autopilot, baud: 921_600, ..Self::default() }
    }

    fn run(&mut self, asking: &mut Asking, from_s: u64, to_s: u64) {
        for now_ms in (from_s * 1_000..to_s * 1_000).step_by(50) {
            for (id, hz) in &self.streams {
                let count = |ms: u64| ms * u64::from(*hz) / 1_000;
                (count(now_ms)..count(now_ms + 50)).for_each(|_| asking.seen(*id));
            }
            let known = KnownVehicle {
                source: Source { system: 1, component: 1 },
                autopilot: self.autopilot,
                reboots: self.reboots,
                identified: self.identified,
                baud: self.baud,
            };
            let mut sent = Vec::new();
            asking.tick(Instant::from_millis(now_ms), Some(&known), &mut |packet| {
                sent.push(packet.clone());
                true
            });
            assert!(sent.len() <= 1, "one at a time");
            for packet in &sent {
                self.take(now_ms, packet, asking);
            }
        }
    }

    fn take(&mut self, now_ms: u64, packet: &Packet, asking: &mut Asking) {
        let fields = Fields(packet.payload());
        if packet.id() == 66 {
            let (stream, rate) = (fields.u8(4), u32::from(fields.u16(0)));
            self.asked.push((now_ms, 0x8000 | u16::from(stream), rate));
            if stream == 10 {
                self.streams.push((30, rate));
            }
            return;
        }
        if packet.id() == 20 {
            let name = fields.text(4, 16).expect("a name");
            assert_eq!((fields.u16(0), fields.u8(2), fields.u8(3)), (u16::MAX, 1, 1));
            self.parameters_asked.push((now_ms, name.to_owned()));
            if self.parameters.contains(&name) {
                asking.told(name);
            }
            return;
        }
        let (command, id, interval_us) = (fields.u16(28), fields.f32(0) as u32, fields.f32(4));
        self.asked.push((now_ms, command, id));
        if self.deaf {
            return;
        }
        let result = match self.refuses.filter(|_| command == SET_MESSAGE_INTERVAL) {
            Some(result) => result,
            None if self.no_single && command == REQUEST_MESSAGE => 3,
            None if self.unknown.contains(&id) => 4,
            None => 0,
        };
        if result == 0 && command == SET_MESSAGE_INTERVAL && !self.empty.contains(&id) {
            self.streams.retain(|(stream, _)| *stream != id);
            self.streams.push((id, (1e6 / interval_us).round() as u32));
        }
        self.identified |= result == 0 && (command, id) == (REQUEST_MESSAGE, ids::AUTOPILOT_VERSION);
        asking.answered(command, result);
    }

    fn count(&self, command: u16, id: u32) -> usize {
        self.asked.iter().filter(|(_, asked, of)| (*asked, *of) == (command, id)).count()
    }

    fn rate(&self, id: u32) -> Option<u32> {
        self.streams.iter().find(|(stream, _)| *stream == id).map(|(_, hz)| *hz)
    }
}

#[test]
fn a_px4_is_asked_for_what_is_missing_and_left_alone_with_the_rest() {
    let mut px4 = Script { streams: vec![(30, 50), (105, 50), (1, 1)], ..Script::new(Autopilot::Px4) };
    px4.empty = vec![290, 291];
    let mut asking = Asking::new();
    px4.run(&mut asking, 0, 5);
    assert_eq!(px4.asked, [], "first it listens");
    px4.run(&mut asking, 5, 60);
    assert_eq!((px4.rate(30), px4.rate(105)), (Some(50), Some(50)), "never made slower");
    assert_eq!((px4.rate(1), px4.rate(230), px4.rate(33)), (Some(5), Some(5), Some(5)));
    assert!(px4.identified);
    assert_eq!(px4.count(SET_MESSAGE_INTERVAL, 193), 0, "that is ArduPilot's");
    assert_eq!(px4.count(SET_MESSAGE_INTERVAL, 33), 1, "what comes is not asked for again");
    px4.run(&mut asking, 60, 3_600);
    let promised = px4.count(SET_MESSAGE_INTERVAL, 291);
    assert!((5..20).contains(&promised), "{promised} times asked for what never comes, in an hour");
}

#[test]
fn both_autopilots_are_asked_for_the_landed_state_and_their_parameters_are_known_as_asked() {
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        let mut script = Script::new(autopilot);
        let mut asking = Asking::new();
        let known = KnownVehicle {
            source: Source { system: 1, component: 1 },
            autopilot,
            reboots: 0,
            identified: true,
            baud: 921_600,
        };
        script.run(&mut asking, 0, 6);
        assert!(!asking.has_parameters(&known), "{autopilot:?}");
        script.run(&mut asking, 6, 40);
        assert_eq!(script.count(SET_MESSAGE_INTERVAL, 245), 1, "{autopilot:?}");
        assert_eq!(script.rate(245), Some(2));
        assert!(asking.has_parameters(&known), "none of them was answered: {autopilot:?}");
        let other = Source { system: 7, component: 1 };
        assert!(!asking.has_parameters(&KnownVehicle { source: other, ..known }));
    }
}

#[test]
fn a_reboot_and_a_stream_that_falls_silent_are_asked_again() {
    let mut px4 = Script::new(Autopilot::Px4);
    let mut asking = Asking::new();
    px4.run(&mut asking, 0, 60);
    assert_eq!(px4.rate(33), Some(5));
    px4.streams.clear();
    px4.reboots = 1;
    px4.run(&mut asking, 60, 100);
    assert_eq!(px4.rate(33), Some(5), "after a reboot");
    px4.streams.retain(|(id, _)| *id != 33);
    px4.run(&mut asking, 100, 140);
    assert_eq!(px4.rate(33), Some(5), "after silence");
}

#[test]
fn what_is_refused_is_not_asked_for_again_until_a_reboot() {
    let mut px4 = Script { unknown: vec![129, 143], ..Script::new(Autopilot::Px4) };
    let mut asking = Asking::new();
    px4.run(&mut asking, 0, 1_000);
    assert_eq!((px4.count(SET_MESSAGE_INTERVAL, 129), px4.count(SET_MESSAGE_INTERVAL, 143)), (1, 1));
    assert_eq!(px4.count(REQUEST_MESSAGE, 129), 0, "PX4 refuses in silence");
    assert_eq!(px4.rate(230), Some(5));
    px4.reboots = 1;
    px4.run(&mut asking, 1_000, 1_100);
    assert_eq!(px4.count(SET_MESSAGE_INTERVAL, 129), 2);
}

#[test]
fn an_ardupilot_is_asked_for_no_interval_of_what_it_does_not_have() {
    let mut copter = Script { unknown: vec![225, 11_039], ..Script::new(Autopilot::ArduPilot) };
    let mut asking = Asking::new();
    copter.run(&mut asking, 0, 1_000);
    for id in [225, 11_039] {
        assert_eq!(
            (copter.count(REQUEST_MESSAGE, id), copter.count(SET_MESSAGE_INTERVAL, id)),
            (1, 0),
            "{id}"
        );
    }
    for (id, by, rate, _) in WANTED.into_iter().filter(|wanted| ![225, 11_039].contains(&wanted.0)) {
        let asked = by != Senders::Px4;
        assert_eq!(copter.rate(id), asked.then_some(u32::from(rate)), "{id}");
        assert_eq!(copter.count(REQUEST_MESSAGE, id), usize::from(asked), "{id}");
    }
    copter.reboots = 1;
    copter.run(&mut asking, 1_000, 1_100);
    assert_eq!((copter.count(REQUEST_MESSAGE, 225), copter.count(SET_MESSAGE_INTERVAL, 225)), (2, 0));
}

#[test]
fn an_ardupilot_that_knows_no_single_messages_is_asked_for_intervals() {
    let mut copter = Script { no_single: true, ..Script::new(Autopilot::ArduPilot) };
    copter.run(&mut Asking::new(), 0, 120);
    assert_eq!((copter.rate(30), copter.rate(193)), (Some(10), Some(5)));
}

#[test]
fn an_old_ardupilot_is_asked_for_groups() {
    for (deaf, refuses) in [(true, None), (false, Some(3))] {
        let mut old = Script { deaf, refuses, ..Script::new(Autopilot::ArduPilot) };
        let mut asking = Asking::new();
        old.run(&mut asking, 0, 120);
        for (stream, _) in GROUPS {
            let asked = old.asked.iter().filter(|(_, what, _)| *what == 0x8000 | u16::from(stream)).count();
            assert!(asked > 0, "group {stream}, deaf: {deaf}");
        }
        assert_eq!(old.rate(30), Some(8));
        let commands = old.asked.iter().filter(|(_, what, _)| *what == SET_MESSAGE_INTERVAL).count();
        assert!(commands <= 9, "{commands} commands that it does not know");
    }
}

#[test]
fn what_decides_comes_five_times_a_second_on_a_line_of_115_200_baud() {
    for (autopilot, estimator) in [(Autopilot::Px4, 230), (Autopilot::ArduPilot, 193)] {
        let mut script = Script { baud: 115_200, ..Script::new(autopilot) };
        script.run(&mut Asking::new(), 0, 120);
        for id in [1, 24, 241, estimator] {
            assert_eq!(script.rate(id), Some(5), "{id} of {autopilot:?}");
        }
    }
}

#[test]
fn a_slow_line_is_not_asked_for_more_than_it_carries() {
    let mut px4 = Script { baud: 19_200, ..Script::new(Autopilot::Px4) };
    let mut asking = Asking::new();
    px4.run(&mut asking, 0, 120);
    let bytes = |id: u32| WANTED.iter().find(|wanted| wanted.0 == id).map_or(0, |wanted| u32::from(wanted.3));
    let all: u32 = px4.streams.iter().map(|(id, hz)| hz * bytes(*id)).sum();
    assert!(px4.streams.len() > 10 && all <= 19_200 / 10, "{all} bytes a second: {:?}", px4.streams);
}

#[test]
fn parameters_of_batteries_are_asked_for_after_the_messages_by_name_once_or_twice() {
    for (autopilot, has, foreign) in [
        (Autopilot::ArduPilot, "BATT_LOW_VOLT", "BAT1_N_CELLS"),
        (Autopilot::Px4, "BAT1_N_CELLS", "BATT_LOW_VOLT"),
    ] {
        let mut script = Script { parameters: vec![has], ..Script::new(autopilot) };
        let mut asking = Asking::new();
        script.run(&mut asking, 0, 600);
        let count = |name: &str| script.parameters_asked.iter().filter(|(_, asked)| asked == name).count();
        assert_eq!((count(has), count(foreign)), (1, 0), "{autopilot:?}");
        for (_, name, ..) in
            KNOWN.iter().filter(|(px4, name, ..)| (autopilot == Autopilot::Px4) == *px4 && *name != has)
        {
            assert_eq!(count(name), 2, "{name}: it does not have it");
        }
        let last_message =
            script.asked.iter().filter(|(at_ms, ..)| *at_ms < 60_000).map(|(at_ms, ..)| *at_ms).max();
        assert!(
            script.parameters_asked[0].0 > last_message.expect("asked") - 1_000,
            "{:?}",
            script.parameters_asked
        );
        script.parameters_asked.clear();
        script.reboots = 1;
        script.run(&mut asking, 600, 700);
        assert!(!script.parameters_asked.is_empty(), "it may have been set anew");
    }
    let mut other = Script::new(Autopilot::Other);
    other.run(&mut Asking::new(), 0, 120);
    assert!(other.parameters_asked.is_empty());
}

#[test]
fn parameters_that_somebody_else_asked_for_are_not_asked_for_and_old_autopilots_are() {
    let mut asking = Asking::new();
    let mut copter = Script::new(Autopilot::ArduPilot);
    copter.run(&mut asking, 0, 1);
    for (_, name, ..) in KNOWN {
        asking.told(name);
    }
    asking.told("SOMETHING_ELSE");
    copter.run(&mut asking, 1, 120);
    assert!(copter.parameters_asked.is_empty(), "{:?}", copter.parameters_asked);
    let mut old =
        Script { deaf: true, parameters: vec!["BATT_LOW_VOLT"], ..Script::new(Autopilot::ArduPilot) };
    old.run(&mut Asking::new(), 0, 120);
    assert!(old.parameters_asked.iter().any(|(_, name)| name == "BATT_LOW_VOLT"));
}

#[test]
fn without_a_vehicle_nothing_is_asked() {
    let mut asking = Asking::new();
    asking.tick(Instant::from_millis(60_000), None, &mut |_| panic!("nobody is there"));
}
