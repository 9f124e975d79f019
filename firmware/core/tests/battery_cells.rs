//! Cells of batteries, from the autopilot's messages to an alarm. Unknown cells raise no alarm, and are reported.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::{Run, Script, params};
use hums_core::Monitor;
use hums_core::figures::Quantity;
use hums_core::happening::Happening;
use hums_core::health::Level::{self, Critical, Stale};
use hums_core::lifetime::{ITEM_BYTES_MAX, Item as _, ItemKey, Lifetime};
use hums_core::observation::{Battery, Feeds, Observation};
use hums_core::units::{Amperes, Volts};
use hums_core::usage::UsageCounter;

fn monitor(settings: &[(&str, f32)]) -> Monitor {
    Monitor::new(params(&[&[("PROT_ACTION", 2.0)], settings].concat()))
}

/// A flight of 100 s. Words besides the vehicle's: `amp` of its pack; `second`, the voltage of another one, and `payload`, that of a
/// payload's; `calls`, its charge state; `system`, volts and amperes of the autopilot alone; parameters of the autopilot.
fn fly(monitor: &Monitor, script: &str) -> Run {
    let (mut run, script) = (Run::of(monitor), Script::new(&format!("* amp=20; {script}")));
    run.flies(0..100_000, |now_ms, quad, more| {
        script.play(now_ms as i64, |said| match said.name() {
            _ if quad.take(said) => {}
            "amp" => quad.battery.current = Some(Amperes(said.number())),
            "calls" => quad.battery.charge = said.number() as u8,
            "second" => {
                let voltage = Some(Volts(said.number()));
                more.push(Observation::Battery(Battery { id: 1, voltage, ..Battery::default() }));
            }
            "payload" => {
                let (voltage, feeds) = (Some(Volts(said.number())), Feeds::Payload);
                more.push(Observation::Battery(Battery { id: 3, voltage, feeds, ..Battery::default() }));
            }
            "system" => {
                let [volts, amperes] = said.list();
                (quad.system.voltage, quad.system.current) = (Some(Volts(volts)), Some(Amperes(amperes)));
            }
            name => {
                let place = hums_core::battery_cells::known(name).unwrap();
                more.push(Observation::Parameter(place, said.number()));
            }
        });
    });
    run
}

fn levels(run: &Run) -> Vec<Level> {
    run.of_check("cell_voltage").map(|finding| finding.level).collect()
}

fn told_ms(run: &Run) -> Vec<u64> {
    let told = run.happenings.iter().filter(|(_, happening)| *happening == Happening::CellsUnknown);
    told.map(|(at_ms, _)| *at_ms).collect()
}

/// The next power-on.
fn restarted(run: &Run) -> Monitor {
    let mut item = [0; ITEM_BYTES_MAX];
    let length = run.monitor.encode_item(ItemKey::Lifetime, &mut item);
    let mut next = monitor(&[]);
    next.restore(ItemKey::Lifetime, &item[..length]).unwrap();
    next
}

#[test]
fn a_pack_whose_cells_are_not_known_gives_no_alarm_and_no_action_and_is_told_once() {
    let run = fly(&monitor(&[]), "0-60 volt=25.2; 60 volt=18");
    assert!(levels(&run).is_empty() && run.requests.is_empty(), "6 or 7: {:?}", run.findings);
    assert!(matches!(told_ms(&run)[..], [45_000..47_000]), "{:?}", told_ms(&run));
    let mut asked = monitor(&[]);
    asked.parameters_asked();
    let run = fly(&asked, "0-60 volt=25.2; 60 volt=24");
    assert!(matches!(told_ms(&run)[..], [0..1_000]), "at once: {:?}", told_ms(&run));
}

#[test]
fn what_the_autopilot_the_setting_or_an_earlier_flight_tells_makes_it_known() {
    let empties = "0-60 volt=25.2; 60 volt=18; *";
    let mut flown = monitor(&[]);
    let mut stored = [0; Lifetime::BYTES];
    Lifetime { cells: [6, 0, 0, 0], ..Lifetime::default() }.encode(&mut stored);
    flown.restore(ItemKey::Lifetime, &stored).unwrap();
    let cases = [
        (Box::new(monitor(&[])), "BAT1_N_CELLS=6"),
        (Box::new(monitor(&[])), "MOT_BAT_VOLT_MAX=25.2"),
        (Box::new(monitor(&[])), "BATT_LOW_VOLT=21.6 BATT_CRT_VOLT=20.4"),
        (Box::new(monitor(&[])), "MOT_BAT_VOLT_MIN=19.8 BATT_LOW_VOLT=21.6"),
        (Box::new(monitor(&[("BAT_CELLS", 6.0)])), ""),
        (Box::new(flown), ""),
    ];
    for (monitor, parameters) in cases {
        let run = fly(&monitor, &format!("{empties} {parameters}"));
        assert_eq!(levels(&run), [Critical], "{parameters}");
        assert!(told_ms(&run).is_empty() && !run.requests.is_empty(), "{parameters}");
    }
}

#[test]
fn packs_of_1_to_14_cells_are_critical_when_they_are_empty_and_not_before() {
    for count in [1_u8, 2, 3, 4, 6, 7, 8, 10, 12, 14] {
        for (cell_v, expected) in [(3.0, &[Critical][..]), (3.7, &[])] {
            let n = f32::from(count);
            let script = format!("* BAT1_N_CELLS={n}; 0-60 volt={}; 60 volt={}", 4.2 * n, cell_v * n);
            let run = fly(&monitor(&[]), &script);
            assert_eq!(
                (&levels(&run)[..], run.requests.is_empty()),
                (expected, expected.is_empty()),
                "{script}"
            );
            assert!(told_ms(&run).is_empty(), "{script}");
        }
    }
}

#[test]
fn a_setting_is_no_count_of_a_pack_that_it_does_not_fit() {
    let set = monitor(&[("BAT_CELLS", 6.0)]);
    let run = fly(&set, "* second=12.5; 0-60 volt=25; 60 volt=23");
    assert!(run.findings.is_empty() && run.requests.is_empty(), "{:?}", run.findings);
    assert_eq!(told_ms(&run).len(), 1, "the second pack's cells are not known");
    assert_eq!(levels(&fly(&set, "* second=12.5; 0-60 volt=25; 60 volt=18")), [Critical]);
}

#[test]
fn a_full_5s_after_a_flight_with_a_6s_is_no_empty_6s_on_the_ground_or_after_a_restart_in_the_air() {
    let six = fly(&monitor(&[]), "* MOT_BAT_VOLT_MAX=25.2; 0-60 volt=25.2; 60 volt=24");
    let run = fly(&restarted(&six), "0-60 volt=21.1; 60 volt=20.3");
    assert!(levels(&run).into_iter().all(|level| level == Stale), "{:?}", run.findings);
    assert!(run.requests.is_empty() && told_ms(&run).len() == 1, "not known, and told");
    let in_air = fly(&restarted(&run), "* start=30 h=30 volt=20");
    assert!(in_air.findings.is_empty() && in_air.requests.is_empty(), "{:?}", in_air.findings);
}

#[test]
fn a_count_is_kept_for_the_next_power_on_and_only_confirms() {
    let six = fly(&monitor(&[]), "* BAT1_N_CELLS=6; 0-60 volt=25.2; 60 volt=22");
    let run = fly(&restarted(&six), "0-60 volt=16.8; 60 volt=15.6");
    assert!(run.findings.is_empty() && told_ms(&run).is_empty(), "{:?}", run.findings);
}

#[test]
fn a_payloads_pack_of_unknown_cells_is_no_news_and_two_packs_are_judged_each_by_its_own() {
    let flown = |more: &str| fly(&monitor(&[]), &format!("0-60 volt=16.8; 60 volt=15.6; * {more}"));
    let run = flown("payload=25.2");
    assert!(told_ms(&run).is_empty() && run.findings.is_empty(), "{:?}", run.findings);
    assert_eq!(levels(&flown("second=10.2")), []);
    assert_eq!(levels(&flown("second=10.2 BATT2_LOW_VOLT=10.8")), [Critical]);
}

#[test]
fn what_the_autopilot_calls_low_is_low_without_any_count() {
    let run = fly(&monitor(&[]), "0-60 volt=25.2; 60 volt=21; * calls=2");
    let found: Vec<_> = run.findings.iter().map(|finding| (finding.check, finding.level)).collect();
    assert_eq!(found, [("batt_state", Level::Warning)]);
}

#[test]
fn a_pack_that_sags_under_its_load_is_not_empty_until_its_cells_are() {
    for (what, script, expected) in [
        ("it sags", "0-10 volt=16.1 amp=0.4; 10-60 volt=14.3 amp=14; 60 volt=13.7 amp=14", &[][..]),
        (
            "its cells are empty",
            "0-10 volt=16.1 amp=0.4; 10-60 volt=14.3 amp=14; 60 volt=12.4 amp=14",
            &[Critical],
        ),
        ("a cell fails", "0-60 volt=15.6 amp=14; 60 volt=13.7 amp=15", &[Critical]),
        (
            "by the autopilot alone",
            "* mute; 0-10 system=16.1,0.4; 10-60 system=14.3,14; 60 system=13.7,14",
            &[],
        ),
    ] {
        let run = fly(&monitor(&[]), script);
        assert_eq!((&levels(&run)[..], run.findings.len()), (expected, expected.len()), "{what}");
    }
}

#[test]
fn cycles_count_by_the_capacity_that_the_autopilot_knows_and_a_setting_comes_first() {
    for (settings, expected) in [(&[][..], 0.55), (&[("BAT_CAPACITY", 10.0)], 0.055)] {
        let run = fly(&monitor(settings), "* volt=15.6 BATT_CAPACITY=1000");
        let cycles = run.monitor.usage().value(UsageCounter::BatteryCycles).unwrap_or(0.0);
        assert!((cycles / expected - 1.0).abs() < 0.04, "{cycles}");
    }
}

#[test]
fn a_battery_whose_resistance_rises_is_found() {
    let run = fly(
        &monitor(&[]),
        "* volt=15.8 amp=30; 0%2:0-1 volt=16.2 amp=10; 50 volt=15.05; 50%2:0-1 volt=15.95",
    );
    let found = run.of_check("batt_resistance").find(|finding| finding.level == Critical).unwrap();
    assert!((60_000..=75_000).contains(&found.at.as_millis()), "{found:?}");
    assert!((100.0..=130.0).contains(&found.value), "{found:?}");
    let figure = run.monitor.figures().get(Quantity::Resistance(0)).unwrap();
    assert!((0.03..0.05).contains(&figure), "{figure}");
}
