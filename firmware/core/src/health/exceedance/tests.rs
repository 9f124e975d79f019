//! Crossings: their counts, their peaks and their stored form.

use super::*;
use crate::health::{Orders, Subsystem};
use crate::observation::Feeds;

const TILT: u16 = 3;

fn finding(at_ms: u64, previous: Level, level: Level, value: f32) -> Finding {
    Finding {
        at: BootMs::from_millis(at_ms),
        subsystem: Subsystem::Attitude,
        check: "tilt",
        instance: 0,
        level,
        previous,
        value,
        limit: 45.0,
        unit: "deg",
        feeds: Feeds::Vehicle,
        because: "",
        orders: Orders::Own,
    }
}

#[test]
fn a_crossing_is_counted_with_its_peak_and_its_time() {
    let mut exceedances = Exceedances::default();
    exceedances.change(TILT, Side::Above, &finding(10_000, Level::Ok, Level::Warning, 50.0));
    exceedances.note(TILT, 0, Side::Above, 55.0);
    exceedances.change(TILT, Side::Above, &finding(12_000, Level::Warning, Level::Critical, 62.0));
    exceedances.note(TILT, 0, Side::Above, 70.0);
    exceedances.note(TILT, 0, Side::Above, f32::NAN);
    exceedances.change(TILT, Side::Above, &finding(13_500, Level::Critical, Level::Warning, 50.0));
    exceedances.change(TILT, Side::Above, &finding(14_500, Level::Warning, Level::Ok, 20.0));
    exceedances.change(TILT, Side::Above, &finding(20_000, Level::Ok, Level::Warning, 46.0));
    let tilt = exceedances.iter(BootMs::from_millis(21_000)).next().expect("exceeded");
    let expected =
        Crossings { warnings: 2, criticals: 1, warning_tenths: 40, critical_tenths: 15, peak: 70.0 };
    assert_eq!(tilt.session, expected);
}

#[test]
fn what_is_exceeded_ends_with_its_vehicle_in_the_session_and_in_the_life() {
    for level in [Level::Warning, Level::Critical] {
        let mut exceedances = Exceedances::default();
        exceedances.change(TILT, Side::Above, &finding(10_000, Level::Ok, level, 50.0));
        exceedances.end(BootMs::from_millis(14_000));
        let tilt = exceedances.iter(BootMs::from_millis(90_000)).next().expect("exceeded");
        for crossings in [tilt.session, tilt.lifetime] {
            assert_eq!(crossings.warning_tenths + crossings.critical_tenths, 40, "{level:?}");
        }
        assert!(!exceedances.lasting());
    }
}

#[test]
fn what_neither_began_nor_lasted_nor_ended_since_has_not_changed() {
    let mut exceedances = Exceedances::default();
    exceedances.change(TILT, Side::Above, &finding(10_000, Level::Ok, Level::Warning, 50.0));
    let changed = |exceedances: &Exceedances, since_ms| {
        let now = BootMs::from_millis(60_000);
        exceedances.changed(now, BootMs::from_millis(since_ms)).count()
    };
    assert_eq!(changed(&exceedances, 50_000), 1, "it lasts");
    exceedances.change(TILT, Side::Above, &finding(30_000, Level::Warning, Level::Ok, 20.0));
    assert_eq!(changed(&exceedances, 30_000), 1, "it ended");
    assert_eq!(changed(&exceedances, 30_100), 0);
    assert_eq!(exceedances.iter(BootMs::from_millis(60_000)).count(), 1);
}

#[test]
fn not_knowing_is_neither_a_crossing_nor_a_time() {
    let mut exceedances = Exceedances::default();
    exceedances.change(TILT, Side::Above, &finding(1_000, Level::Ok, Level::Stale, f32::NAN));
    assert_eq!(exceedances.iter(BootMs::from_millis(2_000)).count(), 0);
    exceedances.change(TILT, Side::Above, &finding(3_000, Level::Stale, Level::Warning, 50.0));
    exceedances.change(TILT, Side::Above, &finding(4_000, Level::Warning, Level::Stale, f32::NAN));
    let tilt = exceedances.iter(BootMs::from_millis(99_000)).next().expect("exceeded");
    assert_eq!((tilt.session.warnings, tilt.session.warning_tenths), (1, 10));
}

#[test]
fn a_life_adds_up_over_sessions() {
    let mut stored = [0; Exceedances::BYTES];
    let mut length = 0;
    for session in 1..=3_u8 {
        let mut exceedances = Exceedances::decode(&stored[..length]).unwrap_or_default();
        exceedances.change(
            TILT,
            Side::Above,
            &finding(0, Level::Ok, Level::Warning, f32::from(4 - session.min(3))),
        );
        let now = BootMs::from_millis(2_000);
        let tilt = exceedances.iter(now).next().expect("exceeded");
        assert_eq!((tilt.session.warnings, tilt.lifetime.warnings), (1, u16::from(session)));
        assert_eq!((tilt.lifetime.warning_tenths, tilt.lifetime.peak), (20 * u32::from(session), 3.0));
        length = exceedances.encode(now, &mut stored);
    }
}

#[test]
fn only_a_warning_or_worse_that_is_there_now_lasts() {
    let mut exceedances = Exceedances::default();
    assert!(!exceedances.lasting());
    let levels = [Level::Warning, Level::Critical, Level::Stale, Level::Warning, Level::Ok, Level::Advisory];
    let mut previous = Level::Ok;
    for level in levels {
        exceedances.change(TILT, Side::Above, &finding(1_000, previous, level, 50.0));
        assert_eq!(exceedances.lasting(), matches!(level, Level::Warning | Level::Critical), "{level:?}");
        previous = level;
    }
}

#[test]
fn what_is_no_longer_exceeded_or_was_only_before_has_no_peak_now() {
    let mut exceedances = Exceedances::decode(&ROLL).expect("readable");
    exceedances.change(place("roll"), Side::Above, &finding(1_000, Level::Stale, Level::Ok, 20.0));
    let roll = exceedances.iter(BootMs::from_millis(1_000)).next().expect("there was one before");
    assert!(!roll.session.happened() && roll.session.peak.is_nan(), "{roll:?}");
    assert_eq!(roll.lifetime.peak.to_bits(), 70.5_f32.to_bits());
}

fn kept(exceedances: &Exceedances) -> Vec<u8> {
    exceedances.iter(BootMs::ZERO).map(|exceedance| exceedance.instance).collect()
}

#[test]
fn one_too_many_is_counted_and_a_critical_one_makes_room() {
    let mut exceedances = Exceedances::default();
    for instance in 0..30 {
        let warning = Finding { instance, ..finding(0, Level::Ok, Level::Warning, 50.0) };
        exceedances.change(TILT, Side::Above, &warning);
    }
    assert_eq!(
        (kept(&exceedances), exceedances.left_out()),
        ((0..24).collect(), 6),
        "first come, first kept"
    );
    let critical = Finding { instance: 31, ..finding(0, Level::Ok, Level::Critical, 70.0) };
    exceedances.change(TILT, Side::Above, &critical);
    assert_eq!((kept(&exceedances)[0], exceedances.left_out()), (31, 7));
}

#[test]
fn what_was_critical_now_or_ever_before_makes_no_room() {
    let mut now = Exceedances::default();
    for instance in 0..EXCEEDANCES_MAX as u8 {
        let critical = Finding { instance, ..finding(0, Level::Ok, Level::Critical, 70.0) };
        now.change(TILT, Side::Above, &critical);
    }
    for mut exceedances in [now, Exceedances::decode(&full()).expect("readable")] {
        let before = kept(&exceedances);
        let critical = Finding { instance: 31, ..finding(0, Level::Ok, Level::Critical, 70.0) };
        exceedances.change(TILT, Side::Above, &critical);
        assert_eq!((kept(&exceedances), exceedances.left_out()), (before, 1));
    }
}

#[test]
fn another_airframe_keeps_what_this_session_exceeded_and_nothing_from_before() {
    let mut exceedances = Exceedances::decode(&full()).expect("readable");
    let [only_before, again, worse] = [0, 1, 2];
    exceedances.change(only_before, Side::Below, &finding(0, Level::Stale, Level::Ok, 20.0));
    exceedances.change(again, Side::Below, &finding(0, Level::Ok, Level::Warning, 3.3));
    exceedances.change(worse, Side::Above, &finding(0, Level::Ok, Level::Critical, 0.4));
    exceedances.forget_life();
    let left: Vec<_> = exceedances.iter(BootMs::from_millis(1_000)).collect();
    let names: Vec<_> = left.iter().map(|exceedance| exceedance.check.name).collect();
    assert_eq!(names, ["cell_voltage", "cell_deviation"]);
    assert!(left.iter().all(|exceedance| exceedance.lifetime == exceedance.session), "{left:?}");
}

/// The first version's stored form of one check, byte by byte: it is in flash chips and never changes.
const ROLL: [u8; 22] = [
    1, // version
    0x1E, 0x3D, 0xFF, 0x16, // FNV-1a of "roll"
    0,    // instance
    2, 0, // warnings
    1, 0, // criticals
    0x2C, 0x01, 0, 0, // warning for 30 s
    0x0F, 0, 0, 0, // critical for 1.5 s
    0, 0, 0x8D, 0x42, // 70.5
];

fn place(name: &str) -> u16 {
    checks().position(|check| check.name == name).expect(name) as u16
}

/// The stored form with no place left: checks that were critical once, from the first check on.
fn full() -> Vec<u8> {
    let mut stored = vec![VERSION];
    let instances = checks().flat_map(|check| (0..check.instances).map(move |instance| (check, instance)));
    for (check, instance) in instances.take(EXCEEDANCES_MAX) {
        stored.extend(fnv1a(check.name).to_le_bytes());
        stored.push(instance);
        stored.extend(&ROLL[6..]);
    }
    stored
}

#[test]
fn a_crossing_is_stored_as_it_always_was() {
    let mut exceedances = Exceedances::default();
    let roll = place("roll");
    for (at_ms, previous, level, value) in [
        (1_000, Level::Ok, Level::Warning, 50.0),
        (21_000, Level::Warning, Level::Critical, 70.5),
        (22_500, Level::Critical, Level::Ok, 10.0),
        (30_000, Level::Ok, Level::Warning, 46.0),
        (40_000, Level::Warning, Level::Stale, f32::NAN),
    ] {
        exceedances.change(roll, Side::Above, &finding(at_ms, previous, level, value));
    }
    let mut stored = [0xFF; Exceedances::BYTES];
    let length = exceedances.encode(BootMs::from_millis(90_000), &mut stored);
    assert_eq!(stored[..length], ROLL);
}

#[test]
fn what_was_stored_is_read_back_and_stored_again_alike_up_to_the_last_place() {
    for before in [vec![VERSION], ROLL.to_vec(), full()] {
        let exceedances = Exceedances::decode(&before).expect("readable");
        let mut stored = [0xFF; Exceedances::BYTES];
        let length = exceedances.encode(BootMs::from_millis(90_000), &mut stored);
        assert_eq!(stored[..length], before);
    }
    assert_eq!(full().len(), Exceedances::BYTES, "no more is set aside than there is");
}

#[test]
fn a_later_version_is_read_as_far_as_it_is_known() {
    let mut later = full();
    later[0] = VERSION + 1;
    later.extend([0xAB; 7]);
    let exceedances = Exceedances::decode(&later).expect("readable");
    assert_eq!(exceedances.iter(BootMs::ZERO).count(), EXCEEDANCES_MAX);
}

#[test]
fn what_is_cut_short_or_of_no_version_is_unreadable() {
    for length in (0..ROLL.len()).filter(|length| *length != 1) {
        assert!(Exceedances::decode(&ROLL[..length]).is_err(), "{length} bytes");
    }
    assert!(Exceedances::decode(&[0]).is_err());
}

#[test]
fn a_check_or_an_instance_that_there_is_no_longer_is_left_out() {
    let (mut no_check, mut no_instance) = (ROLL, ROLL);
    no_check[1] ^= 1;
    no_instance[5] = 1;
    for gone in [no_check, no_instance] {
        let with_one_that_is_there = [&gone[..], &ROLL[1..]].concat();
        let exceedances = Exceedances::decode(&with_one_that_is_there).expect("readable");
        let left: Vec<_> = exceedances.iter(BootMs::ZERO).collect();
        assert_eq!(left.len(), 1, "{left:?}");
        assert_eq!((left[0].check.name, left[0].instance, left[0].lifetime.warnings), ("roll", 0, 2));
    }
}

#[test]
fn no_two_checks_have_the_same_hash() {
    let mut hashes: Vec<u32> = checks().map(|check| fnv1a(check.name)).collect();
    hashes.sort_unstable();
    assert!(hashes.windows(2).all(|pair| pair[0] != pair[1]) && hashes[0] != 0);
}
