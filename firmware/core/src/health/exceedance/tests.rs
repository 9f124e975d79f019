use super::*;
use crate::health::{Orders, Subsystem};
use crate::observation::Feeds;

/// Any check's number.
const TILT: u16 = 3;

fn at(seconds: f32) -> BootMs {
    BootMs::from_millis((seconds * 1_000.0) as u64)
}

/// Plays `"10 warning 50, 10.5 note 55, 12 critical 62"` of an instance: a finding's second, level and value, or a value that is noted.
fn play_of(exceedances: &mut Exceedances, check: u16, instance: u8, script: &str) {
    let mut previous = Level::Ok;
    for step in script.split(", ") {
        let [second, what, value] = step.split(' ').collect::<Vec<_>>()[..] else { panic!("{step}") };
        let value: f32 = value.parse().expect(step);
        if what == "note" {
            exceedances.note(check, instance, Side::Above, value);
            continue;
        }
        let level = Level::ALL.into_iter().find(|level| level.name() == what).expect(step);
        let finding = Finding {
            at: at(second.parse().expect(step)),
            subsystem: Subsystem::Attitude,
            check: "tilt",
            instance,
            level,
            previous: core::mem::replace(&mut previous, level),
            value,
            limit: 45.0,
            unit: "deg",
            feeds: Feeds::Vehicle,
            because: "",
            orders: Orders::Own,
        };
        exceedances.change(check, Side::Above, &finding);
    }
}

fn play(exceedances: &mut Exceedances, script: &str) {
    play_of(exceedances, TILT, 0, script);
}

fn played(script: &str) -> Exceedances {
    let mut exceedances = Exceedances::default();
    play(&mut exceedances, script);
    exceedances
}

fn first(exceedances: &Exceedances, second: f32) -> Exceedance {
    exceedances.iter(at(second)).next().expect("exceeded")
}

fn stored(exceedances: &Exceedances) -> Vec<u8> {
    let mut stored = [0xFF; Exceedances::BYTES];
    let length = exceedances.encode(at(90.0), &mut stored);
    stored[..length].to_vec()
}

#[test]
fn a_crossing_is_counted_with_its_peak_and_its_time() {
    let exceedances = played(
        "10 warning 50, 11 note 55, 12 critical 62, 13 note 70, 13 note NaN, 13.5 warning 50, 14.5 ok 20, 20 warning 46",
    );
    let expected =
        Crossings { warnings: 2, criticals: 1, warning_tenths: 40, critical_tenths: 15, peak: 70.0 };
    assert_eq!(first(&exceedances, 21.0).session, expected);
}

#[test]
fn what_is_exceeded_ends_with_its_vehicle_in_the_session_and_in_the_life() {
    for level in ["warning", "critical"] {
        let mut exceedances = played(&format!("10 {level} 50"));
        exceedances.end(at(14.0));
        let tilt = first(&exceedances, 90.0);
        for crossings in [tilt.session, tilt.lifetime] {
            assert_eq!(crossings.warning_tenths + crossings.critical_tenths, 40, "{level}");
        }
        assert!(!exceedances.lasting());
    }
}

#[test]
fn what_neither_began_nor_lasted_nor_ended_since_has_not_changed() {
    let changed = |script: &str, since_s| played(script).changed(at(60.0), at(since_s)).count();
    assert_eq!(changed("10 warning 50", 50.0), 1, "it lasts");
    assert_eq!(changed("10 warning 50, 30 ok 20", 30.0), 1, "it ended");
    assert_eq!(changed("10 warning 50, 30 ok 20", 30.1), 0);
    assert_eq!(played("10 warning 50, 30 ok 20").iter(at(60.0)).count(), 1);
}

#[test]
fn not_knowing_is_neither_a_crossing_nor_a_time() {
    assert_eq!(played("1 stale NaN").iter(at(2.0)).count(), 0);
    let tilt = first(&played("1 stale NaN, 3 warning 50, 4 stale NaN"), 99.0);
    assert_eq!((tilt.session.warnings, tilt.session.warning_tenths), (1, 10));
}

#[test]
fn a_life_adds_up_over_sessions() {
    let mut stored = [0; Exceedances::BYTES];
    let mut length = 0;
    for session in 1..=3_u8 {
        let mut exceedances = Exceedances::decode(&stored[..length]).unwrap_or_default();
        play(&mut exceedances, &format!("0 warning {}", 4 - session));
        let tilt = first(&exceedances, 2.0);
        assert_eq!((tilt.session.warnings, tilt.lifetime.warnings), (1, u16::from(session)));
        assert_eq!((tilt.lifetime.warning_tenths, tilt.lifetime.peak), (20 * u32::from(session), 3.0));
        length = exceedances.encode(at(2.0), &mut stored);
    }
}

#[test]
fn only_a_warning_or_worse_that_is_there_now_lasts() {
    assert!(!Exceedances::default().lasting());
    let mut script = "1 ok 0".to_owned();
    for level in ["warning", "critical", "stale", "warning", "ok", "advisory"] {
        script = format!("{script}, 1 {level} 50");
        assert_eq!(played(&script).lasting(), matches!(level, "warning" | "critical"), "{script}");
    }
}

#[test]
fn what_is_no_longer_exceeded_or_was_only_before_has_no_peak_now() {
    let mut exceedances = Exceedances::decode(&ROLL).expect("readable");
    play_of(&mut exceedances, place("roll"), 0, "1 ok 20");
    let roll = first(&exceedances, 1.0);
    assert!(!roll.session.happened() && roll.session.peak.is_nan(), "{roll:?}");
    assert_eq!(roll.lifetime.peak.to_bits(), 70.5_f32.to_bits());
}

fn kept(exceedances: &Exceedances) -> Vec<u8> {
    exceedances.iter(BootMs::ZERO).map(|exceedance| exceedance.instance).collect()
}

#[test]
fn one_too_many_is_left_out_and_a_critical_one_makes_room_unless_all_are_or_were() {
    let mut exceedances = Exceedances::default();
    (0..30).for_each(|instance| play_of(&mut exceedances, TILT, instance, "0 warning 50"));
    let first_kept: Vec<u8> = (0..24).collect();
    assert_eq!(kept(&exceedances), first_kept, "first come, first kept");
    play_of(&mut exceedances, TILT, 31, "0 critical 70");
    assert_eq!(kept(&exceedances)[0], 31);

    let mut now = Exceedances::default();
    (0..EXCEEDANCES_MAX as u8).for_each(|instance| play_of(&mut now, TILT, instance, "0 critical 70"));
    for mut exceedances in [now, Exceedances::decode(&full()).expect("readable")] {
        let before = kept(&exceedances);
        play_of(&mut exceedances, TILT, 31, "0 critical 70");
        assert_eq!(kept(&exceedances), before);
    }
}

#[test]
fn another_airframe_keeps_what_this_session_exceeded_and_nothing_from_before() {
    let mut exceedances = Exceedances::decode(&full()).expect("readable");
    for (only_before_again_or_worse, script) in [(0, "0 ok 20"), (1, "0 warning 3.3"), (2, "0 critical 0.4")]
    {
        play_of(&mut exceedances, only_before_again_or_worse, 0, script);
    }
    exceedances.forget_life();
    let left: Vec<_> = exceedances.iter(at(1.0)).collect();
    let names: Vec<_> = left.iter().map(|exceedance| exceedance.check.name).collect();
    assert_eq!(names, ["cell_voltage", "cell_deviation"]);
    assert!(left.iter().all(|exceedance| exceedance.lifetime == exceedance.session), "{left:?}");
}

#[rustfmt::skip]
const ROLL: [u8; 22] = [
    1, // version
    0x1E, 0x3D, 0xFF, 0x16, 0, // FNV-1a of "roll", instance
    2, 0, 1, 0, // warnings, criticals
    0x2C, 0x01, 0, 0, 0x0F, 0, 0, 0, // warning for 30 s, critical for 1.5 s
    0, 0, 0x8D, 0x42, // 70.5
];

fn place(name: &str) -> u16 {
    checks().position(|check| check.name == name).expect(name) as u16
}

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
fn a_crossing_is_stored_as_it_always_was_and_read_back_up_to_the_last_place() {
    let mut exceedances = Exceedances::default();
    let script = "1 warning 50, 21 critical 70.5, 22.5 ok 10, 30 warning 46, 40 stale NaN";
    play_of(&mut exceedances, place("roll"), 0, script);
    assert_eq!(stored(&exceedances), ROLL);
    for before in [vec![VERSION], ROLL.to_vec(), full()] {
        assert_eq!(stored(&Exceedances::decode(&before).expect("readable")), before);
    }
    assert_eq!(full().len(), Exceedances::BYTES, "no more is set aside than there is");
}

#[test]
fn a_later_version_is_read_as_far_as_it_is_known_and_a_cut_or_none_is_unreadable() {
    let mut later = full();
    later[0] = VERSION + 1;
    later.extend([0xAB; 7]);
    let exceedances = Exceedances::decode(&later).expect("readable");
    assert_eq!(exceedances.iter(BootMs::ZERO).count(), EXCEEDANCES_MAX);
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
