//! Damaged times beside pauses and restarts, which are as far off and right.

use super::*;

fn set_time(log: &mut Writer, message: usize, seconds: f64) {
    log.bytes[message + 3..message + 11].copy_from_slice(&((seconds * 1e6) as u64).to_le_bytes());
}

fn begun() -> Writer {
    let mut log = Writer::new();
    log.format(151, "IMU", "QB", "TimeUS,I");
    log.attitudes(1..1);
    log
}

/// Ten messages a second.
fn tenths(log: &mut Writer, tenths: std::ops::Range<u64>) {
    for tenth in tenths {
        log.raw(151, &[&(tenth * 100_000).to_le_bytes(), &[0]]);
        if tenth % 10 == 0 {
            log.attitudes(tenth / 10..tenth / 10 + 1);
        }
    }
}

/// Gaps, restarts, last time.
fn told(log: &[u8]) -> (Vec<(Cause, String)>, usize, u64) {
    let seen = seen(log);
    let gaps = seen.gaps.into_iter().map(|(cause, _, _, words)| (cause, words)).collect();
    (gaps, seen.restarts, seen.last.as_millis())
}

const WRONG: &str = "1 message with a wrong time, far from the times around it";

#[test]
fn one_wrong_time_is_damage_and_neither_a_restart_nor_a_gap_nor_later_times() {
    for wrong in [1.3, 2.1, 3.0, 8.0, 29.0, 60.0, 1e9, -3.0, -9.0] {
        let mut log = begun();
        tenths(&mut log, 10..200);
        let message = log.bytes.len();
        log.attitudes(20..21);
        tenths(&mut log, 201..300);
        set_time(&mut log, message, 20.0 + wrong);
        assert_eq!(told(&log.bytes), (vec![(Cause::Damaged, WRONG.to_owned())], 0, 29_900), "{wrong}");
        let place = seen(&log.bytes).gaps[0].1;
        assert_eq!(place, message as u64);
    }
}

#[test]
fn a_wrong_time_before_definitions_of_what_follows_and_before_damage_moves_no_other_time() {
    for (definitions, damage) in [(200, 0), (0, 40_000), (100, 3)] {
        let mut log = begun();
        tenths(&mut log, 10..200);
        let message = log.bytes.len();
        log.attitudes(20..21);
        log.bytes.extend(vec![0xFF; damage]);
        for number in 0..definitions {
            log.format(1 + (number % 100) as u8, "NONE", "QB", "TimeUS,I");
        }
        log.format(152, "NEW", "QB", "TimeUS,I");
        for tenth in 201..300_u64 {
            log.raw(152, &[&(tenth * 100_000).to_le_bytes(), &[0]]);
        }
        set_time(&mut log, message, 53.6);
        let (gaps, restarts, end) = told(&log.bytes);
        assert_eq!((restarts, end), (0, 29_900), "{definitions} {damage}");
        assert!(gaps.iter().any(|gap| gap.1 == WRONG), "{gaps:?}");
    }
}

#[test]
fn a_wrong_time_of_the_first_message_is_no_restart() {
    let mut log = begun();
    let message = log.bytes.len();
    log.attitudes(1..2);
    tenths(&mut log, 11..100);
    set_time(&mut log, message, 40.0);
    assert_eq!(told(&log.bytes), (vec![(Cause::Damaged, WRONG.to_owned())], 0, 9_900));
}

#[test]
fn wrong_times_of_the_first_messages_move_no_other_time() {
    for count in 1..=8_usize {
        for seconds in [40.0, 700.0, 1e7] {
            let mut log = begun();
            let first = log.bytes.len();
            tenths(&mut log, 11..100);
            for message in 0..count {
                set_time(&mut log, first + message * 12, seconds);
            }
            let (gaps, restarts, end) = told(&log.bytes);
            assert_eq!((gaps.len(), restarts, end), (1, 0, 9_900), "{count} {seconds}");
            assert!(gaps[0].1.starts_with(&format!("{count} message")), "{gaps:?}");
            assert_eq!(seen(&log.bytes).gaps[0].1, first as u64);
        }
    }
}

#[test]
fn a_wrong_time_of_the_last_messages_is_told_and_a_saved_parameter_after_half_a_minute_is_not_wrong() {
    for (count, shift) in [(1, 8.4), (1, 700.0), (1, -2.0), (2, 3.0), (5, 60.0), (8, -9.0)] {
        let mut log = begun();
        tenths(&mut log, 11..300 - count);
        let last = log.bytes.len();
        tenths(&mut log, 300 - count..300);
        for message in 0..count {
            let tenth = (300 - count + message) as f64 / 10.0;
            set_time(&mut log, last + message as usize * 12, tenth + shift);
        }
        let (gaps, restarts, end) = told(&log.bytes);
        assert_eq!((gaps.len(), restarts, end), (1, 0, 29_900 - count * 100), "{count} {shift} {gaps:?}");
        assert_eq!(seen(&log.bytes).gaps[0].1, last as u64);
    }
    let mut log = begun();
    log.format(152, "PARM", "QNf", "TimeUS,Name,Value");
    tenths(&mut log, 10..300);
    for seconds in [61_u64, 92] {
        log.raw(152, &[&(seconds * 1_000_000).to_le_bytes(), &[b'A'; 16], &1_f32.to_le_bytes()]);
    }
    let (gaps, restarts, end) = told(&log.bytes);
    assert!(gaps.iter().all(|gap| gap.0 == Cause::NotKept) && gaps.len() == 2, "{gaps:?}");
    assert_eq!((restarts, end), (0, 92_000));
}

#[test]
fn a_pause_and_a_restart_are_seen_with_their_first_message() {
    let mut log = begun();
    tenths(&mut log, 10..200);
    tenths(&mut log, 230..300);
    tenths(&mut log, 10..50);
    let gaps = vec![(Cause::NotKept, "nothing was written".to_owned())];
    assert_eq!(told(&log.bytes), (gaps, 1, 29_900 + 3_900));
}

#[test]
fn a_wrong_time_in_a_text_log_is_told_too() {
    let mut log = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
                   FMT, 150, 13, ATT, Qc, TimeUS,Roll\n"
        .to_owned();
    log.extend((10..300_u64).map(|tenth| {
        let time = tenth * 100_000 + if tenth == 150 { 8_000_000 } else { 0 };
        format!("ATT, {time}, 1.5\n")
    }));
    assert_eq!(told(log.as_bytes()), (vec![(Cause::Damaged, WRONG.to_owned())], 0, 29_900));
}

#[test]
fn a_line_with_too_many_values_is_told_once_and_its_columns_are_read() {
    let mut log = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
                   FMT, 150, 13, ATT, Qc, TimeUS,Roll\nFMT, 151, 75, MSG, QZ, TimeUS,Message\n"
        .to_owned();
    let lines = |tenth| format!("ATT, {tenth}00000, 1.5, 7\nMSG, {tenth}00000, one, two\n");
    log.extend((10..30).map(lines));
    let seen = seen(log.as_bytes());
    let [gap] = seen.gaps.as_slice() else { panic!("{:?}", seen.gaps) };
    assert_eq!((gap.0, gap.3.contains("3 values for 2 columns")), (Cause::Damaged, true), "{}", gap.3);
    assert!(seen.rows.contains(&"ATT 1000000 1.5".to_owned()), "{:?}", seen.rows);
}

#[test]
fn columns_without_names_are_damage_where_messages_of_them_come() {
    let mut log = Writer::new();
    log.format(151, "IMU", "QBB", "TimeUS,I");
    log.format(152, "NONE", "QBB", "TimeUS");
    log.raw(151, &[&1_000_000_u64.to_le_bytes(), &[0, 1]]);
    log.raw(151, &[&2_000_000_u64.to_le_bytes(), &[0, 1]]);
    let (gaps, ..) = told(&log.bytes);
    let words = "FMT names 2 of the 3 columns of IMU: those without a name are not read";
    assert_eq!(gaps, [(Cause::Damaged, words.to_owned())]);
}

#[test]
fn a_clock_that_does_not_run_from_some_place_on_is_told() {
    let of = |time: &dyn Fn(u64) -> u64| {
        let mut log = begun();
        for tick in 0..32_000_u64 {
            log.raw(150, &[&time(tick).to_le_bytes(), &[0; 6]]);
        }
        told(&log.bytes).0.iter().any(|(cause, _)| *cause == Cause::NoTimes)
    };
    let sound = |tick: u64| 1_000_000 + tick * 8_000;
    assert!(!of(&sound));
    assert!(of(&|tick| sound(tick.min(16_000))), "it stands");
    assert!(of(&|_| 1_000_000), "from the beginning");
    assert!(of(&|tick| if tick < 16_000 { sound(tick) } else { 0 }), "zeros");
    assert!(of(&|tick| if tick < 16_000 { sound(tick) } else { u64::MAX }), "ones");
    assert!(of(&|tick| sound(32_000 - tick)), "backwards");
}

#[test]
fn milliseconds_are_told_by_the_receivers_time() {
    let of = |divisor: u64| {
        let mut log = begun();
        log.format(154, "GPS", "QBIHBB", "TimeUS,Status,GMS,GWk,NSats,I");
        for tick in 0..200_u64 {
            let (us, ms) = ((1_000_000 + tick * 200_000) / divisor, 300_000 + tick as u32 * 200);
            log.raw(154, &[&us.to_le_bytes(), &[3], &ms.to_le_bytes(), &2_300_u16.to_le_bytes(), &[9, 0]]);
        }
        told(&log.bytes).0.iter().any(|(cause, _)| *cause == Cause::NoTimes)
    };
    assert_eq!((of(1), of(50), of(1_000)), (false, false, true));
}

#[test]
fn a_clock_that_stands_is_told_in_a_log_of_any_size() {
    for (us, count, stands) in
        [(0, 150, true), (2_000_000, 150, true), (u64::MAX, 150, true), (2_000_000, 90, false)]
    {
        let mut log = begun();
        log.format(160, "MSG", "QZ", "TimeUS,Message");
        (0..2).for_each(|_| log.message(1.0, "Ready"));
        (0..count).for_each(|_: u32| log.raw(150, &[&u64::to_le_bytes(us), &[0; 6]]));
        let causes: Vec<Cause> = told(&log.bytes).0.into_iter().map(|(cause, _)| cause).collect();
        assert_eq!(causes, vec![Cause::NoTimes; usize::from(stands)], "{us}");
    }
    let mut log = begun();
    log.format(161, "PARM", "QNf", "TimeUS,Name,Value");
    tenths(&mut log, 10..20);
    (0..300).for_each(|_| log.raw(161, &[&1_900_000_u64.to_le_bytes(), &[b'A'; 16], &[0; 4]]));
    tenths(&mut log, 20..30);
    assert_eq!(told(&log.bytes).0, [], "parameters come all at once");
}
