//! What outlives a power-on, both sides together.

use std::collections::BTreeSet;

use hums_core::params::{Param, TABLE};
use hums_core::status::{LinkReading, RecorderStatus};
use hums_store::sim::SimFlash;

use super::keeper::{Keeper, Kept};
use super::{Handover, Mailbox, StoreStatus};
use hums_core::Monitor;
use hums_core::lifetime::ItemKey;
use hums_core::params::Params;
use hums_core::time::Instant;
use hums_store::{Key, Store, param_value};

type Flash = SimFlash<16384>;

/// One power-on, with nothing heard, and then power is gone.
fn session(flash: &mut Flash, act: impl FnOnce(&mut Monitor, &mut Handover, &mut Keeper<&mut Flash>)) {
    let (mailbox, status) = (Mailbox::new(), StoreStatus::new());
    let (items_in, items_out) = mailbox.split();
    let mut monitor = Box::new(Monitor::new(Params::defaults()));
    let mut keeper = Keeper::mount(Some(flash), items_out, &status);
    keeper.turn_ahead();
    keeper.load(&mut monitor);
    monitor.tick(Instant::ZERO, &LinkReading::default(), &RecorderStatus::default(), &mut |_| ());
    let mut handover = Handover::new(items_in, &status, monitor.params());
    act(&mut monitor, &mut handover, &mut keeper);
}

fn end(monitor: &mut Monitor, handover: &mut Handover, keeper: &mut Keeper<&mut Flash>) {
    for _ in 0..100 {
        let all = handover.finish(Instant::from_millis(60_000), monitor);
        while keeper.service(true) == Kept::Took {}
        if all {
            return;
        }
    }
    panic!("it never ends");
}

#[test]
fn counters_and_parameters_go_on_where_the_last_power_on_left_them() {
    let mut flash = Flash::blank();
    for boot in 1..=50 {
        session(&mut flash, |monitor, handover, keeper| {
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
            end(monitor, handover, keeper);
        });
    }
}

#[test]
fn what_is_due_reaches_the_flash_without_the_end_of_a_session() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, keeper| {
        handover.step(Instant::from_millis(9_000), monitor, 0);
        assert_eq!(keeper.service(false), Kept::Idle, "nothing is due yet");
        for second in 10..20 {
            handover.step(Instant::from_millis(second * 1_000), monitor, 0);
            while keeper.service(false) == Kept::Took {}
        }
    });
    session(&mut flash, |monitor, _, _| assert_eq!(monitor.lifetime().boots, 2));
}

#[test]
fn more_than_the_mailbox_holds_stays_with_its_owner_and_follows() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, keeper| {
        for spec in TABLE {
            monitor.params_mut().set(spec.name, spec.max).expect("its own limit");
        }
        handover.step(Instant::ZERO, monitor, 0);
        let mut taken = 0;
        while keeper.service(false) == Kept::Took {
            taken += 1;
        }
        assert!(taken > 10 && taken < TABLE.len(), "{taken}");
        end(monitor, handover, keeper);
    });
    session(&mut flash, |monitor, _, _| {
        assert!(monitor.params().iter().all(|(spec, value)| value.to_bits() == spec.max.to_bits()));
    });
}

#[test]
fn a_save_that_needs_an_erase_waits_is_told_once_and_is_done_when_it_may() {
    let mut flash = Flash::blank();
    session(&mut flash, |monitor, handover, keeper| {
        assert_eq!(handover.news().map(|news| news.severity), Some(6), "the store is new");
        let mut value: f32 = 0.0;
        let mut waits = false;
        while !waits {
            value += 0.001;
            assert!(value < 4.0, "the sector is never full");
            monitor.params_mut().set("CELL_VOLT_WARN", value).expect("in range");
            handover.step(Instant::ZERO, monitor, 1);
            waits = keeper.service(false) == Kept::Waits;
        }
        assert_eq!((keeper.service(false), keeper.service(false)), (Kept::Waits, Kept::Waits));
        assert_eq!(keeper.status.read().refused, 1);
        assert!(handover.news().is_some_and(|news| news.text.contains("waits")));
        assert_eq!(handover.news(), None);
        assert_eq!((keeper.service(true), keeper.service(true)), (Kept::Took, Kept::Idle));
        monitor.params_mut().set("CELL_VOLT_WARN", 4.25).expect("in range");
        end(monitor, handover, keeper);
    });
    session(&mut flash, |monitor, _, _| {
        assert!((monitor.params().get(Param::CellVoltWarn) - 4.25).abs() < 1e-6);
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
    session(&mut flash, |monitor, handover, keeper| {
        assert!((monitor.params().get(Param::CellVoltCrit) - 3.25).abs() < 1e-6);
        assert_eq!(monitor.params().get(Param::CellVoltWarn).to_bits(), 3.6_f32.to_bits());
        assert_eq!(keeper.status.read().unreadable, 2);
        assert!(handover.news().is_some_and(|news| news.text.contains("unreadable")));
    });
}

#[test]
fn without_a_store_all_goes_on_and_it_is_told() {
    let (mailbox, status) = (Mailbox::new(), StoreStatus::new());
    let (items_in, items_out) = mailbox.split();
    let mut monitor = Box::new(Monitor::new(Params::defaults()));
    let mut keeper = Keeper::<Flash>::mount(None, items_out, &status);
    keeper.load(&mut monitor);
    let mut handover = Handover::new(items_in, &status, monitor.params());
    assert!(handover.news().is_some_and(|news| news.text.contains("no store")));
    for second in 0..100 {
        handover.step(Instant::from_millis(second * 1_000), &mut monitor, 0);
        while keeper.service(false) == Kept::Took {}
    }
    assert!(handover.finish(Instant::from_millis(100_000), &mut monitor));
}

#[test]
fn no_two_parameters_share_a_key() {
    let keys: BTreeSet<Key> = TABLE.iter().map(|spec| Key::param(spec.name)).collect();
    assert_eq!(keys.len(), TABLE.len());
}
