//! What outlives power: sessions that end at any instant, and the sum that they make.
#![allow(clippy::float_cmp, clippy::panic, clippy::unwrap_used)]

use std::collections::BTreeMap;

use hums_core::Monitor;
use hums_core::baseline::{Baselines, Quantity};
use hums_core::component::{Kind, Label, Status};
use hums_core::lifetime::{EVERY, ITEM_BYTES_MAX, ItemKey};
use hums_core::observation::{
    AutopilotIdentity, GlobalPosition, Heartbeat, Observation, Source, VehicleKind,
};
use hums_core::params::Params;
use hums_core::status::{LinkReading, RecorderStatus};
use hums_core::time::{Instant, Span};
use hums_core::units::{Metres, MetresPerSecond};
use hums_core::usage::UsageCounter;

/// A store that keeps what it is given.
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

    /// Saves what is due; gives the keys.
    fn save(&mut self, monitor: &mut Monitor, now: Instant) -> Vec<ItemKey> {
        let mut keys = Vec::new();
        while let Some(key) = monitor.save_due(now) {
            let mut item = [0; ITEM_BYTES_MAX];
            let length = monitor.encode_item(key, &mut item);
            self.0.insert(key.number(), item[..length].to_vec());
            monitor.saved(key);
            keys.push(key);
        }
        keys
    }
}

/// Flies from `from_s` to `to_s`, at 10 m/s, armed a second before.
fn run(
    monitor: &mut Monitor,
    store: &mut Store,
    seconds: u64,
    from_s: u64,
    to_s: u64,
    vehicle: (u8, u64),
) -> Vec<(u64, ItemKey)> {
    let source = Source { system: vehicle.0, component: 1 };
    let mut saves = Vec::new();
    for now_ms in (0..seconds * 1_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let flies = (from_s * 1_000..to_s * 1_000).contains(&now_ms);
        let armed = (from_s * 1_000 - 1_000..to_s * 1_000 + 1_000).contains(&now_ms);
        let heartbeat = Heartbeat { armed, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
        monitor.observe(now, source, &Observation::Heartbeat(heartbeat));
        let identity = AutopilotIdentity { uid: vehicle.1, firmware: 0 };
        monitor.observe(now, source, &Observation::Identity(identity));
        let position = GlobalPosition {
            relative_altitude: Metres(if flies { 20.0 } else { 0.0 }),
            velocity: [if flies { 10.0 } else { 0.0 }, 0.0, 0.0].map(MetresPerSecond),
            ..GlobalPosition::default()
        };
        monitor.observe(now, source, &Observation::GlobalPosition(position));
        monitor.tick(now, &LinkReading::default(), &RecorderStatus::default(), &mut |_| {});
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
        assert!((flight_s - 61.0 * f64::from(session)).abs() < 1.0, "{flight_s} s");
        assert_eq!(total(&monitor, UsageCounter::HeightMax), 20.0);
        assert_eq!(monitor.usage().value(UsageCounter::Flights), Some(1.0), "the session's own");
        assert_eq!(monitor.lifetime().sessions, session);
    }
}

#[test]
fn a_cut_costs_what_it_may_and_nothing_after_a_landing() {
    let mut store = Store::default();
    let mut monitor = store.start(&Params::defaults());
    let saves = run(&mut monitor, &mut store, 2_100, 20, 200, (1, 7));
    let lifetime: Vec<u64> =
        saves.iter().filter(|(_, key)| *key == ItemKey::Lifetime).map(|(at_s, _)| *at_s).collect();
    assert_eq!(lifetime[0], 10, "the boot itself");
    assert!(lifetime.windows(2).all(|pair| Span::from_secs(pair[1] - pair[0]) <= EVERY), "{lifetime:?}");
    // Landed (seen within 2 s of it, or at disarming).
    assert!(lifetime.iter().any(|at_s| (200..=202).contains(at_s)), "{lifetime:?}");
    assert!(lifetime.len() < 10, "{lifetime:?}");
    let again = store.start(&Params::defaults());
    assert_eq!(total(&again, UsageCounter::Landings), 1.0);
}

#[test]
fn another_airframe_begins_its_own_life() {
    let mut store = Store::default();
    let mut baselines = Baselines::new();
    (0..5).for_each(|_| baselines.learn(Quantity::HoverThrottle, 0.4));
    let mut item = [0; Baselines::BYTES];
    baselines.encode(&mut item);
    store.0.insert(ItemKey::Baselines.number(), item.to_vec());
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (1, 7));
    assert_eq!(*monitor.baselines(), baselines);
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (1, 8));
    assert_eq!(total(&monitor, UsageCounter::Flights), 1.0, "the second one's");
    assert_eq!(monitor.lifetime().airframe.uid, 8);
    assert_eq!(*monitor.baselines(), Baselines::new());
    let mut monitor = store.start(&Params::defaults());
    run(&mut monitor, &mut store, 60, 20, 40, (3, 8));
    assert_eq!(total(&monitor, UsageCounter::Flights), 2.0, "a system id can be set; the unique id decides");
}

#[test]
fn a_component_wears_over_sessions_and_is_replaced_at_once() {
    let mut params = Params::defaults();
    params.set("CMP3_KIND", f32::from(Kind::Airframe as u8)).unwrap();
    params.set("CMP3_FLIGHTS", 2.0).unwrap();
    let mut store = Store::default();
    for status in [Status::Green, Status::Red] {
        let mut monitor = store.start(&params);
        run(&mut monitor, &mut store, 60, 20, 40, (1, 7));
        assert_eq!(monitor.component_figures(2).unwrap().1, status);
    }
    let mut monitor = store.start(&params);
    assert_eq!(monitor.replace_component(0, Label::new("S1")), None, "there is none");
    let old = monitor.replace_component(2, Label::new("S2")).unwrap();
    assert_eq!(old.ran().flights, 2.0);
    assert_eq!(
        store.save(&mut monitor, Instant::from_millis(50)),
        [ItemKey::Baselines, ItemKey::Component(2)]
    );
    let again = store.start(&params);
    let component = again.components()[2];
    assert_eq!((component.serial.as_str(), component.replaced, component.ran().flights), ("S2", 1, 0.0));
}

#[test]
fn an_item_that_cannot_be_read_is_as_if_there_were_none() {
    let mut monitor = Monitor::new(Params::defaults());
    for key in ItemKey::ALL {
        assert!(monitor.restore(key, &[]).is_err());
        assert!(monitor.restore(key, &[0; ITEM_BYTES_MAX]).is_err());
    }
    assert_eq!(monitor.lifetime().boots, 1);
}
