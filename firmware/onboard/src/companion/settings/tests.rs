//! With a vehicle of known and unknown state.

use hums_blackbox::Writer;
use hums_blackbox::record::Boot;
use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::component::{Component, ComponentFigures, ComponentKind, Label};
use hums_core::parameters::{Param, Params};
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::frame::Frame;
use hums_link::packet::Packet;
use hums_link::request::Port;
use hums_recorder::{CardState, CardStatus};

use crate::monitoring::TICK;
use crate::queues::Queues;
use crate::{Monitoring, PortStatus, ResetCause};

#[derive(Clone, Copy, Debug)]
enum Comes {
    Heartbeat { armed: bool },
    Baud(f32),
    Card,
    OtherCard,
    NoCard,
}
use Comes::{Baud, Card, Heartbeat, NoCard, OtherCard};

const ARMED: Comes = Heartbeat { armed: true };
const DISARMED: Comes = Heartbeat { armed: false };

fn text() -> String {
    let comment = "# of this airframe\n".repeat(40);
    format!("BAT_REM_WARN 31\n{comment}PROT_ACTION 1\nAP_BAUD 57600\n")
}

/// Runs a start with events at seconds since it. Returns the port's rate, and whether the file's first and last lines
/// are in force, 10 s after the last event.
fn run(cause: ResetCause, comes: &[(u64, Comes)]) -> ([bool; 2], f32) {
    run_slowly(cause, 1, comes)
}

fn run_slowly(cause: ResetCause, ticks_an_answer: u64, comes: &[(u64, Comes)]) -> ([bool; 2], f32) {
    run_with(&text(), cause, ticks_an_answer, comes)
}

fn run_with(text: &str, cause: ResetCause, ticks_an_answer: u64, comes: &[(u64, Comes)]) -> ([bool; 2], f32) {
    let is = |params: &Params, param, value: f32| params.get(param).to_bits() == value.to_bits();
    let monitor = Monitor::new(Params::defaults());
    after(&monitor, text, cause, ticks_an_answer, comes, |monitor| {
        let params = monitor.params();
        let set = [is(params, Param::BatRemWarn, 31.0), is(params, Param::ProtAction, 1.0)];
        (set, params.get(Param::ApBaud))
    })
}

fn after<T>(
    monitor: &Monitor,
    text: &str,
    cause: ResetCause,
    ticks_an_answer: u64,
    comes: &[(u64, Comes)],
    known: impl FnOnce(&Monitor) -> T,
) -> T {
    let (card, port) = (CardStatus::new(), PortStatus::default());
    let (mut monitor, mut writer) = (Box::new(*monitor), Box::new(Writer::new()));
    let mut queues = Box::new(Queues::new());
    let (out, mut ends) = queues.split();
    let mut body = Monitoring::new(&mut monitor, &mut writer, Boot::default(), cause, &card, &port, out);
    body.start(Instant::ZERO);
    let mut encoder = Encoder::of(1, 1);
    let mut station = Encoder::of(255, 190);
    let last_s = comes.last().map_or(0, |(at_s, _)| *at_s);
    let mut comes = comes.iter().peekable();
    for tick in 1..(last_s + 10) * 20 {
        let now = Instant::ZERO + Span::from_micros(TICK.as_micros() * tick);
        let mut out = [0; FRAME_BYTES_MAX];
        while let Some((_, come)) = comes.next_if(|(at_s, _)| at_s * 20 < tick) {
            match *come {
                Heartbeat { armed } => {
                    let mode = if armed { 0x80 } else { 0 };
                    let packet = Packet::new(0).u8(4, 2).u8(5, 3).u8(6, mode).u8(7, 4).u8(8, 3);
                    let frame = Frame::parse(encoder.frame(&mut out, &packet)).expect("a frame");
                    ends.frames_in.put(now.as_micros(), &frame);
                }
                Baud(value) => {
                    let packet = Packet::new(23).f32(0, value).u8(4, 1).u8(5, 191).text(6, 16, "AP_BAUD");
                    let frame = Frame::parse(station.frame(&mut out, &packet.u8(22, 9))).expect("a frame");
                    ends.uplink_in.put(Port::Gs as u64, &frame);
                }
                Card | OtherCard => {
                    card.set_volume(if matches!(come, Card) { 0x1234 } else { 0x5678 });
                    card.set_state(CardState::Recording);
                }
                NoCard => card.set_state(CardState::Absent),
            }
        }
        while body.drain(&mut ends.frames_out) {}
        while body.uplink(now, &mut ends.uplink_out) {}
        body.tick(now, &mut |_| {});
        if tick % ticks_an_answer == 0 {
            ends.shelf.serve_text(text.as_bytes());
        }
        while ends.gs_out.take(&mut out).is_some() {}
        while ends.autopilot_out.take(&mut out).is_some() {}
        ends.sectors_out.abandon();
    }
    known(body.monitor())
}

const DEFAULT: f32 = 921_600.0;
const NOTHING: ([bool; 2], f32) = ([false, false], DEFAULT);
const ALL: ([bool; 2], f32) = ([true, true], 57_600.0);
const IN_FLIGHT: [ResetCause; 3] = [ResetCause::BrownOut, ResetCause::Software, ResetCause::Watchdog];
const BY_HAND: [ResetCause; 3] = [ResetCause::PowerOn, ResetCause::Pin, ResetCause::Eject];

#[test]
fn a_box_on_the_ground_reads_its_parameters_whichever_comes_first_card_or_heartbeat() {
    for cause in BY_HAND {
        assert_eq!(run(cause, &[(0, Card), (5, DISARMED)]), ALL, "{cause:?}");
        assert_eq!(run(cause, &[(1, DISARMED), (2, DISARMED), (3, Card)]), ALL, "{cause:?}");
        assert_eq!(run(cause, &[(1, DISARMED), (60, Card), (65, DISARMED)]), ALL, "{cause:?}");
    }
}

#[test]
fn a_box_that_restarts_in_the_air_reads_no_parameters() {
    for cause in IN_FLIGHT {
        for heartbeat in [ARMED, DISARMED] {
            let comes = [(0, Card), (1, heartbeat), (2, heartbeat), (3, DISARMED), (4, DISARMED)];
            assert_eq!(run(cause, &comes), NOTHING, "{cause:?}, {heartbeat:?}");
        }
    }
    for cause in BY_HAND {
        assert_eq!(run(cause, &[(0, Card), (1, ARMED), (2, ARMED)]), NOTHING, "{cause:?}");
    }
}

#[test]
fn a_box_that_was_armed_before_reads_no_parameters_until_another_card_is_put_in() {
    let flown = [(0, Card), (1, ARMED), (2, ARMED), (3, DISARMED), (4, DISARMED)];
    assert_eq!(run(ResetCause::PowerOn, &flown), NOTHING);
    let exchanged = [&flown[..], &[(5, NoCard), (7, DISARMED), (7, OtherCard), (8, DISARMED)]].concat();
    assert_eq!(run(ResetCause::PowerOn, &exchanged), ALL);
    let back = [&flown[..], &[(5, NoCard), (7, DISARMED), (7, Card), (8, DISARMED)]].concat();
    assert_eq!(run(ResetCause::PowerOn, &back), NOTHING);
    let lost = [&flown[..2], &[(2, NoCard), (3, Card), (4, ARMED)]].concat();
    assert_eq!(run(ResetCause::PowerOn, &lost), NOTHING);
}

#[test]
fn a_setting_by_hand_stays_when_the_card_comes_back() {
    let baud = Baud(115_200.0);
    let begin = [(0, Card), (1, DISARMED), (2, DISARMED), (3, baud), (4, NoCard)];
    for (card, expected) in [(Card, 115_200.0_f32), (OtherCard, 57_600.0)] {
        let comes = [&begin[..], &[(6, card), (7, DISARMED), (8, DISARMED)]].concat();
        assert_eq!(run(ResetCause::PowerOn, &comes).1.to_bits(), expected.to_bits(), "{card:?}");
    }
}

#[test]
fn without_a_heartbeat_no_parameters_are_read_nor_long_after_the_last_one() {
    assert_eq!(run(ResetCause::PowerOn, &[(0, Card), (60, Card)]), NOTHING);
    assert_eq!(run(ResetCause::PowerOn, &[(1, DISARMED), (10, Card)]), NOTHING);
    assert_eq!(run(ResetCause::PowerOn, &[(1, ARMED), (10, Card), (60, Card)]), NOTHING);
}

#[test]
fn a_line_replaces_the_part_that_it_names_once() {
    let text = "CMP2_KIND 3\nCMP2_NUMBER 3\nCMP2_SERIAL A-4711<\nCMP2_SERIAL B<other\nCMP9_SERIAL 1<\nCMP2_SERIAL C\n";
    let once = [(0, Card), (1, DISARMED), (2, DISARMED)];
    let twice = [&once[..], &[(4, NoCard), (6, OtherCard), (7, DISARMED), (8, DISARMED)]].concat();
    for comes in [&once[..], &twice[..]] {
        let monitor = Monitor::new(Params::defaults());
        let part = after(&monitor, text, ResetCause::PowerOn, 1, comes, |monitor| monitor.components()[1]);
        assert_eq!((part.serial.as_str(), part.replaced), ("A-4711", 1));
    }
}

#[test]
fn a_part_that_is_due_is_reported_only_if_the_card_does_not_replace_it() {
    let mut params = Params::defaults();
    params.set("CMP1_FLIGHTS", 2.0).expect("a parameter");
    params.set("CMP1_KIND", 1.0).expect("a parameter");
    let mut part = Component::default();
    (part.kind, part.serial) = (ComponentKind::Airframe, Label::new("old"));
    let mut monitor = Monitor::new(params);
    part.ran = ComponentFigures { flights: 5.0, ..ComponentFigures::default() };
    monitor.learn_component(0, part);
    let is_due = |text, comes: &[(u64, Comes)]| {
        after(&monitor, text, ResetCause::PowerOn, 1, comes, |monitor| {
            let mut exceeded = monitor.exceedances().changed(Instant::ZERO.into(), Instant::ZERO.into());
            exceeded.any(|exceedance| exceedance.check.name == "airframe_due")
        })
    };
    // The autopilot starts after the box.
    let comes = [(0, Card), (20, DISARMED), (21, DISARMED), (22, DISARMED), (23, DISARMED)];
    assert!(!is_due("CMP1_SERIAL new<old\n", &comes));
    assert!(is_due("CMP1_SERIAL new<other\n", &comes));
    assert!(is_due("", &[(20, DISARMED)]), "no card is there");
    assert!(is_due("", &[(0, Card), (1, ARMED)]), "no file is read in flight");
}

#[test]
fn a_line_whose_end_is_not_read_is_refused() {
    let comes = [(0, Card), (1, DISARMED), (3, DISARMED), (5, DISARMED), (7, DISARMED), (9, DISARMED)];
    let end = 16_384_usize.next_multiple_of(240);
    for (number, set) in [("31", [true, true]), ("31.0", [true, false])] {
        let begin = "PROT_ACTION 1\n# ";
        let line = format!("\nBAT_REM_WARN {number}");
        let filler = "#".repeat(end - begin.len() - "\nBAT_REM_WARN 31".len());
        let (found, _) = run_with(&format!("{begin}{filler}{line}"), ResetCause::PowerOn, 1, &comes);
        assert_eq!([found[1], found[0]], set, "{number}");
    }
}

#[test]
fn reading_stops_where_the_vehicle_is_armed_and_begins_anew_after_silence() {
    let ([first, last], baud) = run_slowly(ResetCause::PowerOn, 15, &[(0, Card), (1, DISARMED), (2, ARMED)]);
    assert!(first && !last, "{first}, {last}");
    assert_eq!(baud.to_bits(), DEFAULT.to_bits());
    let silence = [(0, Card), (1, DISARMED), (20, DISARMED), (21, DISARMED), (22, DISARMED), (23, DISARMED)];
    assert_eq!(run_slowly(ResetCause::PowerOn, 30, &silence[..2]).0, [true, false]);
    assert_eq!(run_slowly(ResetCause::PowerOn, 15, &silence), ALL);
}

#[test]
fn the_port_s_rate_is_set_over_a_link_unless_the_vehicle_may_be_in_flight() {
    let set = |cause, comes: &[(u64, Comes)]| run(cause, comes).1.to_bits() == 115_200.0_f32.to_bits();
    let baud = Baud(115_200.0);
    for cause in BY_HAND {
        assert!(set(cause, &[(2, baud)]), "{cause:?}");
        assert!(set(cause, &[(1, DISARMED), (2, baud)]), "{cause:?}");
        assert!(!set(cause, &[(1, ARMED), (2, baud)]), "{cause:?}");
        assert!(!set(cause, &[(1, ARMED), (60, baud)]), "{cause:?}: whose link fell silent flies on");
    }
    for cause in IN_FLIGHT {
        assert!(!set(cause, &[(0, baud)]), "{cause:?}");
        assert!(!set(cause, &[(1, ARMED), (2, baud)]), "{cause:?}");
        assert!(set(cause, &[(1, DISARMED), (2, baud)]), "{cause:?}");
    }
}
