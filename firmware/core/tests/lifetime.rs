//! Lifetime: sessions that end at any instant, and their sum.
#![expect(clippy::float_cmp, clippy::unwrap_used, reason = "that is how a test fails")]

use std::collections::BTreeMap;

use crate::common::params;
use hums_core::Monitor;
use hums_core::component::{ComponentKind, Label, Status};
use hums_core::exposure::BINS;
use hums_core::lifetime::{EVERY, EVERY_ARMED, ITEM_BYTES_MAX, ItemKey, Room};
use hums_core::observation::{
    AutopilotIdentity, Battery, Esc, EscGroup, GlobalPosition, Heartbeat, Observation, Source, VehicleKind,
};
use hums_core::parameters::Params;
use hums_core::status::{LinkReading, RecorderStatus};
use hums_core::time::BootMs;
use hums_core::units::{Amperes, Metres, MetresPerSecond, Rpm, Volts};
use hums_core::usage::{EXPOSURE_FIRST, FIGURE_FIRST, UsageCounter};

#[derive(Default)]
struct Store(BTreeMap<u8, Vec<u8>>);

impl Store {
    fn start(&self, params: &Params) -> Monitor {
        let mut monitor = Monitor::new(*params);
        for (number, bytes) in &self.0 {
            monitor.restore(ItemKey::from_number(*number).unwrap(), bytes).unwrap();
        }
        monitor
    }

    fn save(&mut self, monitor: &mut Monitor, now: BootMs) -> Vec<ItemKey> {
        let mut keys = Vec::new();
        while let Some(key) = self.save_one(monitor, now) {
            keys.push(key);
        }
        keys
    }

    fn save_one(&mut self, monitor: &mut Monitor, now: BootMs) -> Option<ItemKey> {
        let key = monitor.save_due(now, Room::Enough)?;
        let mut item = [0; ITEM_BYTES_MAX];
        let length = monitor.encode_item(key, &mut item);
        self.0.insert(key.number(), item[..length].to_vec());
        monitor.saved(key);
        Some(key)
    }
}

/// One tick of a flight from `from_s` to `to_s`, at 10 m/s, armed a second before, that draws 20 A and has one ESC.
fn step(monitor: &mut Monitor, now_ms: u64, from_s: u64, to_s: u64, vehicle: (u8, u64)) {
    let now = BootMs::from_millis(now_ms);
    let source = Source { system: vehicle.0, component: 1 };
    let flies = (from_s * 1_000..to_s * 1_000).contains(&now_ms);
    let armed = (from_s * 1_000 - 1_000..to_s * 1_000 + 1_000).contains(&now_ms);
    let heartbeat = Heartbeat { armed, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
    let position = GlobalPosition {
        relative_altitude: Metres(if flies { 20.0 } else { 0.0 }),
        velocity: [if flies { 10.0 } else { 0.0 }, 0.0, 0.0].map(MetresPerSecond),
        ..GlobalPosition::default()
    };
    let current = Some(Amperes(if flies { 20.0 } else { 0.5 }));
    let esc = Esc { rpm: Some(Rpm(if flies { 6_000.0 } else { 0.0 })), current, ..Esc::default() };
    for observation in [
        Observation::Heartbeat(heartbeat),
        Observation::Identity(AutopilotIdentity { uid: vehicle.1, firmware: 0 }),
        Observation::GlobalPosition(position),
        Observation::Battery(Battery { voltage: Some(Volts(15.0)), current, ..Battery::default() }),
        Observation::Escs(EscGroup { first: 0, escs: [Some(esc), None, None, None] }),
    ] {
        monitor.observe(now, source, &observation);
    }
    monitor.tick(now, &LinkReading::default(), &RecorderStatus::default(), &mut |_| {});
}

fn run(
    monitor: &mut Monitor,
    store: &mut Store,
    seconds: u64,
    from_s: u64,
    to_s: u64,
    vehicle: (u8, u64),
) -> Vec<(u64, ItemKey)> {
    let mut saves = Vec::new();
    for now_ms in (0..seconds * 1_000).step_by(50) {
        let now = BootMs::from_millis(now_ms);
        step(monitor, now_ms, from_s, to_s, vehicle);
        saves.extend(store.save(monitor, now).into_iter().map(|key| (now_ms / 1_000, key)));
    }
    saves
}

fn total(monitor: &Monitor, counter: UsageCounter) -> f64 {
    monitor.lifetime().totals.value(counter).unwrap()
}

#[test]
fn sessions_add_up_and_the_greatest_stays() {
    let mut store = Store::default();
    for session in 1..=5_u32 {
        let mut monitor = store.start(&Params::defaults());
        assert_eq!(monitor.lifetime().boots, session);
        run(&mut monitor, &mut store, 100, 20, 80, (1, 7));
        assert_eq!(total(&monitor, UsageCounter::Flights), f64::from(session));
        let flight_s = total(&monitor, UsageCounter::Flight);
        assert!((flight_s - 60.0 * f64::from(session)).abs() < 0.5, "{flight_s} s");
        assert_eq!(total(&monitor, UsageCounter::HeightMax), 20.0);
        assert_eq!(monitor.usage().value(UsageCounter::Flights), Some(1.0), "the session's own");
        assert_eq!(monitor.lifetime().sessions, session);
    }
}

fn sums(monitor: &Monitor) -> Vec<f64> {
    let life = monitor.lifetime();
    let counters = [
        UsageCounter::Powered,
        UsageCounter::Armed,
        UsageCounter::Flight,
        UsageCounter::Flights,
        UsageCounter::Landings,
        UsageCounter::Distance,
        UsageCounter::Energy,
        UsageCounter::BatteryCycles,
        UsageCounter::Cruise,
    ];
    let mut sums: Vec<f64> = counters.into_iter().map(|counter| life.totals.raw(counter)).collect();
    sums.extend([life.totals.motors[0].seconds, life.totals.motors[0].revolutions / 100.0]);
    life.totals.for_each(|number, seconds| {
        if (EXPOSURE_FIRST..FIGURE_FIRST).contains(&number)
            && usize::from(number - EXPOSURE_FIRST) % BINS == 4
        {
            sums.push(seconds);
        }
    });
    for place in 0..3 {
        let (figures, _) = monitor.component_figures(place).unwrap();
        sums.extend([figures.powered_s, figures.flight_s, figures.flights, figures.cycles, figures.motor_s]);
    }
    sums
}

fn with_components() -> Params {
    let parts = [("CMP1_KIND", 1.0), ("CMP2_KIND", 2.0), ("CMP2_NUMBER", 1.0), ("CMP3_KIND", 3.0)];
    params(&[&parts[..], &[("BAT_CAPACITY", 5.0)]].concat())
}

#[test]
fn power_that_goes_at_any_moment_costs_two_minutes_at_most_and_counts_nothing_twice() {
    const CRUISE_M_S: f64 = 10.0;
    let params = with_components();
    let mut store = Store::default();
    // A first flight, whole, then a second one of 20 minutes that is cut at every fifth second, and at each item.
    run(&mut store.start(&params), &mut store, 100, 20, 80, (1, 7));
    let mut monitor = store.start(&params);
    let mut before = sums(&monitor);
    let mut saved_at_ms = 0;
    let mut cuts = 0;
    for now_ms in (0..1_300_000).step_by(50) {
        step(&mut monitor, now_ms, 30, 1_230, (1, 7));
        let live = sums(&monitor);
        let mut saved = 0;
        loop {
            let key = store.save_one(&mut monitor, BootMs::from_millis(now_ms));
            if key.is_some() || now_ms.is_multiple_of(5_000) {
                let again = sums(&store.start(&params));
                assert_eq!(again.len(), live.len());
                cuts += 1;
                for (index, ((again, live), before)) in again.iter().zip(&live).zip(&before).enumerate() {
                    // Tenths of a second are rounded once a session, and no sum falls.
                    assert!(*again <= live + 0.2, "{now_ms} ms, {key:?}: sum {index} is {again} of {live}");
                    assert!(
                        *again >= before - 0.2,
                        "{now_ms} ms, {key:?}: sum {index} was {before}, is {again}"
                    );
                    let armed = (29_000..1_231_000).contains(&now_ms);
                    let cost =
                        if armed { EVERY_ARMED } else { EVERY }.as_millis() as f64 / 1_000.0 * CRUISE_M_S;
                    assert!(live - again <= cost + 1.0, "{now_ms} ms: sum {index} is {again} of {live}");
                }
                before = again;
            }
            let Some(key) = key else { break };
            saved += 1;
            saved_at_ms = now_ms;
            assert!(now_ms < 1_232_500 || key != ItemKey::Lifetime, "it is saved once a session");
        }
        assert!(saved <= 7, "{saved} items at once");
    }
    assert!(cuts > 250, "{cuts}");
    assert!((1_230_000..1_240_000).contains(&saved_at_ms), "the last at disarming: {saved_at_ms}");
}

#[test]
fn a_flight_saves_little_until_it_lands() {
    let mut store = Store::default();
    let mut monitor = store.start(&Params::defaults());
    let saves = run(&mut monitor, &mut store, 2_100, 20, 1_820, (1, 7));
    let times = |wanted: ItemKey| -> Vec<u64> {
        saves.iter().filter(|(_, key)| *key == wanted).map(|(at_s, _)| *at_s).collect()
    };
    let session = times(ItemKey::Session);
    assert_eq!(session[0], 10, "the boot itself");
    let armed = session.windows(2).filter(|pair| pair[1] <= 1_820);
    assert!(armed.into_iter().all(|pair| pair[1] - pair[0] <= 121), "{session:?}");
    assert!(session.iter().any(|at_s| (1_820..=1_822).contains(at_s)), "{session:?}");
    assert!(session.len() <= 20, "{session:?}");
    assert!(times(ItemKey::Lifetime).len() <= 2, "its owner, and as of this session");
    let bytes = store.0[&ItemKey::Session.number()].len();
    assert!(bytes <= 160, "{bytes} bytes");
    let again = store.start(&Params::defaults());
    assert_eq!(total(&again, UsageCounter::Landings), 1.0);
}

#[test]
fn another_airframe_begins_its_own_life() {
    let mut store = Store::default();
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (1, 7));
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (1, 8));
    assert_eq!(total(&monitor, UsageCounter::Flights), 1.0, "the second one's");
    assert_eq!(monitor.lifetime().airframe.uid, 8);
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (3, 8));
    assert_eq!(total(&monitor, UsageCounter::Flights), 2.0, "a system id can be set; the unique id decides");
}

#[test]
fn a_component_wears_over_sessions_and_is_replaced_at_once() {
    let params = params(&[("CMP3_KIND", f32::from(ComponentKind::Airframe as u8)), ("CMP3_FLIGHTS", 2.0)]);
    let mut store = Store::default();
    for status in [Status::Green, Status::Red] {
        let mut monitor = store.start(&params);
        run(&mut monitor, &mut store, 60, 20, 40, (1, 7));
        assert_eq!(monitor.component_figures(2).unwrap().1, status);
    }
    let mut monitor = store.start(&params);
    assert_eq!(monitor.replace_component(0, Label::new("S1")), None, "there is none");
    let old = monitor.replace_component(2, Label::new("S2")).unwrap();
    assert_eq!(old.ran.flights, 2.0);
    assert_eq!(store.save(&mut monitor, BootMs::from_millis(50)), [ItemKey::Component(2)]);
    let again = store.start(&params);
    let component = again.components()[2];
    assert_eq!((component.serial.as_str(), component.replaced, component.ran.flights), ("S2", 1, 0.0));
}

#[test]
fn an_item_that_cannot_be_read_is_as_if_there_were_none() {
    let mut monitor = Monitor::new(Params::defaults());
    for key in ItemKey::all() {
        assert!(monitor.restore(key, &[]).is_err());
        assert!(monitor.restore(key, &[0; ITEM_BYTES_MAX]).is_err());
    }
    assert_eq!(monitor.lifetime().boots, 1);
}
