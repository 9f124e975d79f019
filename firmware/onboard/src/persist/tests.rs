//! Items that outlive a power-on, with both sides together.

use std::collections::BTreeSet;

use hums_core::parameters::{Param, TABLE};
use hums_core::status::{LinkReading, RecorderStatus};
use hums_store::sim::SimFlash;

use super::store_writer::{SaveStep, StoreWriter};
use super::{EraseMoment, Handover, Mailbox, StoreStatus};
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::lifetime::{ItemKey, Room};
use hums_core::observation::{
    Battery, Esc, EscGroup, Heartbeat, LandedState, Observation, Source, VehicleKind, VtolState,
};
use hums_core::parameters::Params;
use hums_core::units::{Amperes, Celsius, Rpm, Volts};
use hums_core::usage::UsageCounter;
use hums_store::{Key, Store, param_value};

type Flash = SimFlash<16384>;

fn session(flash: &mut Flash, act: impl FnOnce(&mut Monitor, &mut Handover, &mut StoreWriter<&mut Flash>)) {
    let (mut mailbox, status) = (Mailbox::new(), StoreStatus::default());
    let (items_in, items_out) = mailbox.split();
    let mut monitor = Box::new(Monitor::new(Params::defaults()));
    let mut store_writer = StoreWriter::mount(flash, items_out, &status);
    store_writer.turn_ahead();
    store_writer.load(&mut monitor);
    monitor.tick(Instant::ZERO.into(), &LinkReading::default(), &RecorderStatus::default(), &mut |_| ());
    let mut handover = Handover::new(items_in, &status, &mut monitor);
    act(&mut monitor, &mut handover, &mut store_writer);
}

fn end(monitor: &mut Monitor, handover: &mut Handover, store_writer: &mut StoreWriter<&mut Flash>) {
    for _ in 0..TABLE.len() + 100 {
        if handover.finish(Instant::from_millis(60_000), monitor) {
            return;
        }
        while store_writer.service(true) == SaveStep::Took {}
    }
    panic!("it never ends");
}

#[test]
fn counters_and_parameters_go_on_where_the_last_power_on_left_them() {
    let mut flash = Flash::blank();
    for boot in 1..=50 {
        session(&mut flash, |monitor, handover, store_writer| {
            assert_eq!(monitor.lifetime().boots, boot);
            assert_eq!(
                monitor.params().get(Param::CellVoltWarn).to_bits(),
                if boot == 1 {
                    Params::defaults().get(Param::CellVoltWarn).to_bits()
                } else {
                    (3.0_f32 + (boot - 1) as f32 / 100.0).to_bits()
                }
            );
            monitor.params_mut().set("CELL_VOLT_WARN", 3.0 + boot as f32 / 100.0).expect("in range");
            end(monitor, handover, store_writer);
        });
    }
}

#[test]
fn what_is_due_reaches_the_flash_without_the_end_of_a_session() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, store_writer| {
        handover.step(Instant::from_millis(9_000), monitor, 0);
        assert_eq!(store_writer.service(false), SaveStep::Idle, "nothing is due yet");
        for second in 10..20 {
            handover.step(Instant::from_millis(second * 1_000), monitor, 0);
            while store_writer.service(false) == SaveStep::Took {}
        }
    });
    session(&mut flash, |monitor, _, _| assert_eq!(monitor.lifetime().boots, 2));
}

#[test]
fn more_than_the_mailbox_holds_stays_with_its_owner_and_follows() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, store_writer| {
        for spec in TABLE {
            monitor.params_mut().set(spec.name, spec.max).expect("its own limit");
        }
        handover.step(Instant::ZERO, monitor, 0);
        let mut taken = 0;
        while store_writer.service(false) == SaveStep::Took {
            taken += 1;
        }
        assert_eq!(taken, 1);
        end(monitor, handover, store_writer);
    });
    session(&mut flash, |monitor, _, _| {
        assert!(monitor.params().iter().all(|(spec, value)| value.to_bits() == spec.max.to_bits()));
    });
}

#[test]
fn a_save_that_needs_an_erase_waits_is_told_once_and_is_done_when_it_may() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, store_writer| {
        assert_eq!(handover.news().map(|news| news.severity), Some(6), "the store is new");
        let mut value: f32 = 0.0;
        let mut waits = false;
        while !waits {
            value += 0.001;
            assert!(value < 4.0, "the sector is never full");
            monitor.params_mut().set("CELL_VOLT_WARN", value).expect("in range");
            handover.step(Instant::ZERO, monitor, 1);
            waits = store_writer.service(false) == SaveStep::Waits;
        }
        assert_eq!(
            (store_writer.service(false), store_writer.service(false)),
            (SaveStep::Waits, SaveStep::Waits)
        );
        assert_eq!(store_writer.status.read().refused, 1);
        assert!(handover.news().is_some_and(|news| news.text.contains("nearly full")));
        assert!(handover.news().is_some_and(|news| news.text.contains("waits")));
        assert_eq!(handover.news(), None);
        assert_eq!(
            (store_writer.service(true), store_writer.service(true)),
            (SaveStep::Took, SaveStep::Idle)
        );
        monitor.params_mut().set("CELL_VOLT_WARN", 4.25).expect("in range");
        end(monitor, handover, store_writer);
    });
    session(&mut flash, |monitor, _, _| {
        assert!((monitor.params().get(Param::CellVoltWarn) - 4.25).abs() < 1e-6);
    });
}

fn live(second: u64, flies: bool, monitor: &mut Monitor, handover: &mut Handover, frames: u64) {
    let now = Instant::from_millis(second * 1_000);
    let source = Source { system: 1, component: 1 };
    let heartbeat = Heartbeat { armed: flies, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
    monitor.observe(now.into(), source, &Observation::Heartbeat(heartbeat));
    let landed = if flies { LandedState::InAir } else { LandedState::OnGround };
    monitor.observe(now.into(), source, &Observation::Landed(landed, VtolState::Unknown));
    let current = Some(Amperes(if flies { 20.0 } else { 0.5 }));
    let temperature = Some(Celsius(30.0 + (second / 60 % 60) as f32));
    let battery = Battery { voltage: Some(Volts(15.0)), current, temperature, ..Battery::default() };
    monitor.observe(now.into(), source, &Observation::Battery(battery));
    let esc =
        Esc { rpm: Some(Rpm(if flies { 6_000.0 } else { 0.0 })), current, temperature, ..Esc::default() };
    monitor.observe(now.into(), source, &Observation::Escs(EscGroup { first: 0, escs: [Some(esc); 4] }));
    monitor.tick(now.into(), &LinkReading::default(), &RecorderStatus::default(), &mut |_| ());
    handover.step(now, monitor, frames);
}

fn fly(flash: &mut Flash, seconds: u64) -> Vec<u64> {
    let mut kept = Vec::new();
    let mut copies = Vec::new();
    session(flash, |monitor, handover, store_writer| {
        let before = monitor.lifetime().totals.raw(UsageCounter::Flight);
        for second in 0..seconds {
            live(second, (20..seconds - 5).contains(&second), monitor, handover, second);
            while store_writer.service(false) == SaveStep::Took {}
            assert_eq!(store_writer.status.read().refused, 0, "nothing waits for an erase");
            copies.push((second, before, store_writer.status.read().saved));
        }
        let count = |counter| monitor.lifetime().totals.raw(counter) as u32;
        assert_eq!(count(UsageCounter::Landings), count(UsageCounter::Flights));
    });
    kept.extend(copies.windows(2).filter(|pair| pair[0].2 != pair[1].2).map(|pair| pair[1].0));
    kept
}

#[test]
fn flights_of_an_hour_are_saved_every_two_minutes_and_whole_ones_at_landing_without_an_erase() {
    let mut flash = Flash::blank();
    for flight in 1..=5 {
        let saves = fly(&mut flash, 3_600);
        assert!(saves.windows(2).all(|pair| pair[1] - pair[0] <= 121), "{saves:?}");
        session(&mut flash, |monitor, _, _| {
            let life = monitor.lifetime().totals;
            assert_eq!(life.raw(UsageCounter::Landings) as u32, flight);
            let flown_s = life.raw(UsageCounter::Flight);
            assert!((flown_s - 3_575.0 * f64::from(flight)).abs() < 5.0, "{flown_s}");
        });
    }
}

#[test]
fn a_flight_of_many_hours_uses_what_there_is_and_its_landing_is_saved_all_the_same() {
    let mut flash = Flash::blank();
    for flight in 1..=3 {
        let saves = fly(&mut flash, 10 * 3_600);
        let first_gap = saves.windows(2).find(|pair| pair[1] - pair[0] > 121.max(pair[1] / 30 + 1));
        let until_s = first_gap.map_or(saves[saves.len() - 2], |pair| pair[0]);
        assert!(until_s > 6_000, "flight {flight}: every two minutes until {until_s} s only: {saves:?}");
        session(&mut flash, |monitor, _, _| {
            assert_eq!(monitor.lifetime().totals.raw(UsageCounter::Landings) as u32, flight);
        });
    }
}

#[test]
fn between_two_flights_room_is_made_for_the_next_one() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, store_writer| {
        let mut second = 0;
        for flight in 0..6 {
            for _ in 0..3_600 {
                live(second, true, monitor, handover, second);
                while store_writer.service(false) == SaveStep::Took {}
                second += 1;
            }
            assert_eq!(store_writer.status.read().refused, 0, "flight {flight}");
            for _ in 0..20 {
                live(second, false, monitor, handover, u64::MAX);
                while store_writer.service(false) == SaveStep::Took {}
                second += 1;
            }
            assert_eq!(store_writer.status.read().room, Room::Enough, "flight {flight}");
        }
    });
}

#[test]
fn a_board_that_stays_on_beside_an_autopilot_that_never_falls_silent_keeps_its_counters() {
    let mut flash = Flash::blank();
    let mut flown = 0.0;
    let mut erases = 0;
    session(&mut flash, |monitor, handover, store_writer| {
        for second in 0..12 * 3_600_u64 {
            let flies = (600..1_200).contains(&(second % 3_600));
            live(second, flies, monitor, handover, second);
            if second % 120 == 0 {
                handover.put(Key::item(33), &second.to_le_bytes().repeat(3));
            }
            let before = store_writer.status.read().erased;
            while store_writer.service(false) == SaveStep::Took {}
            let now = store_writer.status.read();
            assert!(now.erased == before || !flies, "erased in flight");
            assert_eq!(now.refused, 0, "after {second} s something waits");
            let told = std::iter::from_fn(|| handover.news()).any(|news| news.text.contains("not recorded"));
            assert_eq!(told, now.erased != before, "what an erase loses is told");
        }
        flown = monitor.lifetime().totals.raw(UsageCounter::Flight);
        erases = store_writer.status.read().erased;
    });
    assert!((2..=6).contains(&erases), "{erases}");
    session(&mut flash, |monitor, _, _| {
        let life = monitor.lifetime().totals;
        assert_eq!(life.raw(UsageCounter::Landings) as u32, 12);
        assert!((life.raw(UsageCounter::Flight) - flown).abs() < 1.0 && flown > 7_000.0, "{flown}");
    });
}

#[test]
fn on_the_ground_nothing_is_erased_while_there_is_room_or_the_vehicle_was_just_disarmed() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, store_writer| {
        for second in 0..3_600 {
            live(second, false, monitor, handover, second);
            while store_writer.service(false) == SaveStep::Took {}
        }
        assert_eq!(
            (store_writer.status.read().erased, store_writer.status.read().calm),
            (0, EraseMoment::Grounded)
        );
        for (second, calm) in
            [(3_600, EraseMoment::None), (3_601, EraseMoment::None), (3_620, EraseMoment::Grounded)]
        {
            live(second, second == 3_600, monitor, handover, second);
            assert_eq!(store_writer.status.read().calm, calm, "at {second} s");
        }
        live(3_626, false, monitor, handover, 3_620);
        assert_eq!(store_writer.status.read().calm, EraseMoment::Silent);
    });
}

#[test]
fn flash_with_something_else_in_it_is_told_and_the_counters_begin() {
    let mut flash = Flash::with(&vec![0x55; 32_768]);
    session(&mut flash, |monitor, handover, _| {
        assert_eq!(monitor.lifetime().boots, 1);
        assert!(handover.news().is_some_and(|news| news.severity == 3 && news.text.contains("anew")));
        assert_eq!(handover.news(), None);
    });
}

#[test]
fn an_item_that_makes_no_sense_is_told_and_the_others_are_read() {
    let mut flash = Flash::blank();
    let (mut store, _) = Store::mount(&mut flash).expect("it works");
    let (bytes, length) = param_value("CELL_VOLT_CRIT", 3.25).expect("short");
    store.save(Key::param("CELL_VOLT_CRIT"), &bytes[..length]).expect("room");
    let (bytes, length) = param_value("CELL_VOLT_WARN", 99.0).expect("short");
    store.save(Key::param("CELL_VOLT_WARN"), &bytes[..length]).expect("room");
    let (bytes, length) = param_value("OF_A_LATER_TIME", 99.0).expect("short");
    store.save(Key::param("OF_A_LATER_TIME"), &bytes[..length]).expect("room");
    store.save(Key::item(ItemKey::Lifetime.number()), &[1, 2, 3]).expect("room");
    store.save(Key::item(250), b"of a later time").expect("room");
    session(&mut flash, |monitor, handover, store_writer| {
        assert!((monitor.params().get(Param::CellVoltCrit) - 3.25).abs() < 1e-6);
        assert_eq!(monitor.params().get(Param::CellVoltWarn).to_bits(), 3.6_f32.to_bits());
        assert_eq!(store_writer.status.read().unreadable, 2);
        assert!(handover.news().is_some_and(|news| news.text.contains("saved value was lost")));
    });
}

#[test]
fn without_a_store_all_goes_on_and_it_is_told() {
    let (mut mailbox, status) = (Mailbox::new(), StoreStatus::default());
    let (items_in, items_out) = mailbox.split();
    let mut monitor = Box::new(Monitor::new(Params::defaults()));
    let mut flash = Flash::blank();
    flash.cut_after(1, 1);
    let mut store_writer = StoreWriter::mount(flash, items_out, &status);
    store_writer.load(&mut monitor);
    let mut handover = Handover::new(items_in, &status, &mut monitor);
    assert!(handover.news().is_some_and(|news| news.text.contains("store broken")));
    for second in 0..100 {
        handover.step(Instant::from_millis(second * 1_000), &mut monitor, 0);
        while store_writer.service(false) == SaveStep::Took {}
    }
    assert!(handover.finish(Instant::from_millis(100_000), &mut monitor));
}

#[test]
fn no_two_parameters_share_a_key() {
    let keys: BTreeSet<Key> = TABLE.iter().map(|spec| Key::param(spec.name)).collect();
    assert_eq!(keys.len(), TABLE.len());
}
