//! Logs as they should be, and as they should not.

pub(super) mod writer;

use writer::{Writer, read, try_read};

use super::message::MESSAGE_BYTES_MAX;
use super::times;
use super::topics::Subscriptions;
use crate::source::item::Cause;

const SECOND: u64 = 1_000_000;
const POSITION: &str = "position:uint64_t timestamp;float x;uint8_t n;uint8_t[3] _padding0;";

fn position(x: f32, n: u8) -> Vec<u8> {
    [&x.to_le_bytes()[..], &[n]].concat()
}

fn small() -> Writer {
    let mut writer = Writer::new(SECOND)
        .flags(0, [0; 3])
        .information("char[3] sys_name", b"PX4")
        .information("uint32_t ver_sw_release", &0x010e_03ff_u32.to_le_bytes())
        .format(POSITION)
        .parameter("A_GAIN", 0.5)
        .integer_parameter("MAV_SYS_ID", 7)
        .default_parameter(1, "A_GAIN", 0.25)
        .subscribe(0, 0, "position")
        .subscribe(1, 1, "position");
    for number in 0..10 {
        let time = 2 * SECOND + u64::from(number) * 100_000;
        writer =
            writer.data(0, time, &position(f32::from(number), number)).data(1, time, &position(-1.0, number));
        if number % 4 == 0 {
            writer = writer.sync();
        }
    }
    writer
}

#[test]
fn a_log_gives_its_definitions_its_data_and_no_damage() {
    let read =
        read(&small().text(b'4', 3 * SECOND, "low battery\n").tagged(b'6', 3, 3 * SECOND, "tagged").bytes);
    assert_eq!(read.of("fact"), ["Firmware PX4 v1.14.3"]);
    assert_eq!(read.of("parameter"), ["A_GAIN 0.5", "MAV_SYS_ID 7"]);
    assert_eq!(read.of("row default_parameters"), ["A_GAIN,0.25,true,false"]);
    assert_eq!(read.of("row parameters"), ["A_GAIN,0.5", "MAV_SYS_ID,7"]);
    assert_eq!(read.of("row logged_messages"), ["3000000,4,,low battery\n", "3000000,6,3,tagged"]);
    assert_eq!(read.of("row information"), ["sys_name,PX4,", "ver_sw_release,,17695743"]);
    let rows = read.of("row position");
    assert_eq!(rows.len(), 20);
    assert_eq!(rows[..2], ["0,2000000,0,0", "1,2000000,-1,0"]);
    assert_eq!(read.of("text"), ["4 low battery", "6 tagged"]);
    assert_eq!(read.of("gap"), [""; 0]);
    let counts: Vec<(&str, u64)> =
        read.summary.messages.iter().map(|message| (message.name.as_str(), message.amount.count)).collect();
    assert_eq!(counts, [("position", 20)]);
}

#[test]
fn a_parameter_that_changes_in_flight_is_told_when_it_changes() {
    let read = read(&small().parameter("A_GAIN", 0.75).data(0, 4 * SECOND, &position(0.0, 0)).bytes);
    let changed: Vec<&(u64, String)> =
        read.items.iter().filter(|(_, item)| item.starts_with("parameter A_GAIN")).collect();
    assert_eq!(changed.len(), 2);
    assert_eq!(*changed[1], (2 * SECOND + 900_000, "parameter A_GAIN 0.75".to_owned()));
}

#[test]
fn one_wrong_time_is_damage_and_changes_no_other_time() {
    let log = |times: &[u64]| {
        let mut writer =
            Writer::new(SECOND).format(POSITION).subscribe(0, 0, "position").subscribe(1, 1, "position");
        for &time in times {
            writer = writer.data(0, time, &position(1.0, 1)).data(1, time - 50_000, &position(2.0, 2));
        }
        let read = read(&writer.bytes);
        let last = read.items.iter().map(|(at, _)| *at).max().unwrap_or(0);
        (read.of("gap").len(), read.of("gap").first().map(|gap| (*gap).to_owned()), last)
    };
    let usual: Vec<u64> = (0..600).map(|number| 2 * SECOND + number * 20_000).collect();
    let end = usual[599];
    for wrong in [1_300_000, 3 * SECOND, 8 * SECOND, 30 * SECOND, 1 << 50] {
        let mut times = usual.clone();
        times[500] += wrong;
        let told = log(&times).1.unwrap_or_default();
        assert_eq!(told, "Damaged 2 messages with a wrong time, far from the times around it", "{wrong}");
        assert_eq!(log(&times).2, end, "{wrong}");
    }
    let after: Vec<u64> =
        usual.iter().map(|time| if *time > 12 * SECOND { time + 5 * SECOND } else { *time }).collect();
    assert_eq!(log(&after), (0, None, end + 5 * SECOND));
}

/// A log from 60 s on: old values of every third topic, then all every 20 ms.
fn beginning(wrong: impl Fn(usize, u64) -> u64) -> Vec<u8> {
    let mut writer = Writer::new(60 * SECOND).format(POSITION);
    for id in 0..20 {
        writer = writer.subscribe(id, id as u8, "position");
    }
    let mut index = 0;
    for round in 0..20_u64 {
        for id in 0..20_u16 {
            let is_old = round == 0 && id % 3 == 1;
            let time = if is_old { u64::from(id) * SECOND } else { 60 * SECOND + round * 20_000 };
            writer = writer.data(id, wrong(index, time), &position(1.0, 1));
            index += 1;
        }
    }
    writer.bytes
}

#[test]
fn a_wrong_time_among_the_old_values_that_a_log_begins_with_moves_no_other_time() {
    let end = |log: &[u8]| read(log).items.iter().map(|(at, _)| *at).max();
    let clean = beginning(|_, time| time);
    assert_eq!((read(&clean).gaps.len(), end(&clean)), (0, Some(60 * SECOND + 380_000)));
    for at in [0, 1, 2, 7, 19, 30, 200] {
        for shift in [2 * SECOND, 5 * SECOND, 9 * SECOND, 700 * SECOND] {
            for count in [1, 3, 8] {
                let wrong =
                    |index, time| if (at..at + count).contains(&index) { 60 * SECOND + shift } else { time };
                let log = beginning(wrong);
                let read = read(&log);
                assert_eq!(end(&log), end(&clean), "{at} {shift} {count}");
                assert_eq!((read.of("restart").len(), read.gaps.len()), (0, 1), "{at} {shift} {count}");
                assert!(read.gaps[0].words.starts_with(&format!("{count} message")), "{:?}", read.gaps);
            }
        }
    }
}

#[test]
fn a_wrong_time_in_the_header_moves_no_other_time() {
    let end = |log: &[u8]| read(log).items.iter().map(|(at, _)| *at).max();
    let clean = beginning(|_, time| time);
    for shift in [8, 700, 1 << 30] {
        let mut log = clean.clone();
        log[8..16].copy_from_slice(&((60 + shift) * SECOND).to_le_bytes());
        assert_eq!((end(&log), read(&log).gaps.len()), (end(&clean), 1), "{shift}");
    }
}

#[test]
fn a_wrong_time_right_before_a_damaged_place_moves_no_other_time() {
    let clean = beginning(|_, time| time);
    let end = |log: &[u8]| read(log).items.iter().map(|(at, _)| *at).max();
    for shift in [12, 33, 1 << 40] {
        let log = beginning(|index, time| if index == 200 { time + shift * SECOND } else { time });
        // Each data message has 18 bytes.
        let next = log.len() - (400 - 201) * 18;
        for (from, bytes) in [(next, 3), (next - 4, 1_536), (next, 6_000)] {
            let mut log = log.clone();
            let to = log.len().min(from + bytes);
            log[from..to].fill(0xFF);
            let read = read(&log);
            let restarts = read.of("restart").len();
            let right = if to == log.len() { 60 * SECOND + 180_000 } else { 60 * SECOND + 380_000 };
            assert_eq!((restarts, end(&log)), (0, Some(right)), "{shift} {bytes}");
            assert!(read.of("gap").iter().any(|gap| gap.contains("wrong time")), "{:?}", read.gaps);
        }
    }
    assert_eq!(end(&clean), Some(60 * SECOND + 380_000));
}

#[test]
fn a_clock_that_falls_by_a_little_more_than_a_second_is_a_restart() {
    for fall in [1_050_000, 1_500_000, 5_000_000] {
        let log = beginning(|index, time| if index < 200 { time } else { time - fall });
        let read = read(&log);
        assert_eq!((read.of("restart").len(), read.gaps.len()), (1, 0), "{fall}");
    }
}

#[test]
fn a_topic_that_is_kept_over_a_boot_is_no_damage() {
    let log = small().format("mission:uint64_t timestamp;float x;").subscribe(9, 0, "mission");
    let log = (0..30_u64).fold(log.data(9, 1_194 * SECOND, &[0; 4]), |log, number| {
        log.data(0, 3 * SECOND + number * 20_000, &position(1.0, 1))
    });
    let read = read(&log.bytes);
    assert_eq!((read.gaps.len(), read.of("restart").len()), (0, 0), "{:?}", read.gaps);
}

#[test]
fn a_dropout_is_a_gap_with_its_length_and_no_damage() {
    let read = read(&small().dropout(73).data(0, 4 * SECOND, &position(0.0, 0)).bytes);
    assert_eq!(read.gaps.len(), 1);
    let gap = &read.gaps[0];
    assert_eq!(
        (gap.cause, gap.to.zip(gap.from).map(|(to, from)| to.since(from).as_millis())),
        (Cause::Lost, Some(73))
    );
    assert!(!gap.cause.is_damage());
}

#[test]
fn data_that_was_appended_to_a_log_that_ends_in_the_middle_of_a_message_is_read() {
    let mut log = small().bytes;
    log.extend([40, 0, b'D', 0, 0, 1, 2, 3]);
    let offset = log.len() as u64;
    let head = Writer::new(SECOND).flags(1, [offset, 0, 0]).bytes;
    log[..head.len()].copy_from_slice(&head);
    let more =
        Writer { bytes: log }.text(b'2', 4 * SECOND, "crash dump").data(0, 4 * SECOND, &position(9.0, 9));
    let read = read(&more.bytes);
    assert_eq!(read.of("text"), ["2 crash dump"]);
    assert_eq!(read.of("row position").len(), 21);
    assert_eq!(read.of("gap"), ["Cut a message that the end cuts off"]);
}

#[test]
fn a_log_that_is_cut_near_any_multiple_of_64_kib_says_so_unless_it_is_cut_between_two_messages() {
    const SEAM: usize = 64 * 1024;
    let (mut writer, mut ends) = (small(), Vec::new());
    for number in 0..16_u64 {
        // Across a seam or two.
        let words = "x".repeat([20, 3_000, 40_000, 65_526][number as usize % 4]);
        writer = writer.data(0, (4 + number) * SECOND, &position(1.0, 1)).text(
            b'6',
            (4 + number) * SECOND,
            &words,
        );
        let text_bytes = words.len() + 12;
        ends.extend([writer.bytes.len() - text_bytes, writer.bytes.len()]);
    }
    let log = writer.bytes;
    let seams = (SEAM..log.len()).step_by(SEAM);
    let near = ends.iter().filter(|end| **end < log.len()).copied();
    for place in seams.chain(near) {
        for cut in (place - 4..=place + 4).filter(|cut| *cut < log.len()) {
            let told = read(&log[..cut]).gaps.len();
            assert_eq!(told, usize::from(!ends.contains(&cut)), "cut at {cut}");
        }
    }
}

#[test]
fn offsets_of_appended_data_behind_the_end_or_backwards_are_said_and_do_no_harm() {
    for (offsets, words) in [
        ([u64::MAX, 0, 0], "Damaged no appended data at 18446744073709551615"),
        ([3, 0, 0], "Damaged an offset of appended data that leads back, to 3"),
    ] {
        let mut log = small().bytes;
        let head = Writer::new(SECOND).flags(1, offsets).bytes;
        log[..head.len()].copy_from_slice(&head);
        let read = read(&log);
        assert_eq!(read.of("row position").len(), 20, "{offsets:?}");
        assert!(read.of("gap").iter().any(|gap| gap.starts_with(words)), "{:?}", read.of("gap"));
    }
}

#[test]
fn flags_that_nobody_knows_are_refused_with_their_number() {
    let error = try_read(&Writer::new(0).flags(0x82, [0; 3]).bytes).expect_err("refused").to_string();
    assert!(error.contains("8200000000000000"), "{error}");
}

#[test]
fn what_is_no_ulog_is_refused() {
    assert!(try_read(b"").is_err());
    assert!(try_read(&Writer::new(0).bytes[..15]).is_err());
    assert!(try_read(&[0xfd; 4_000]).is_err());
}

#[test]
fn an_empty_line_of_a_console_is_no_damage() {
    let empty = |log: Writer| log.message(b'M', &[&[1, 17], b"char[0] perf_top_"]);
    let read = read(&empty(small()).data(0, 4 * SECOND, &position(0.0, 0)).bytes);
    assert_eq!((read.of("row position").len(), read.gaps.len()), (21, 0), "{:?}", read.gaps);
}

#[test]
fn a_severe_line_of_a_console_is_an_alert_though_nobody_knows_what_it_means() {
    let read =
        read(&small().text(b'3', 4 * SECOND, "[flux] capacitor drained").text(b'4', 4 * SECOND, "x").bytes);
    assert_eq!(read.of("text"), ["3 [flux] capacitor drained", "4 x"]);
    let alerts: Vec<_> = read.of("observation").into_iter().filter(|told| told.contains("Alert")).collect();
    assert!(matches!(alerts[..], [alert] if alert.contains("Other")), "{alerts:?}");
}

#[test]
fn kinds_of_messages_that_are_newer_than_this_reader_are_skipped() {
    let read = read(&small().message(b'Z', &[b"something new"]).data(0, 4 * SECOND, &position(0.0, 0)).bytes);
    assert_eq!((read.of("row position").len(), read.gaps.len()), (21, 0));
}

#[test]
fn a_message_of_data_that_is_shorter_than_its_number_is_damage() {
    let read = read(&small().dropout(20).message(b'D', &[&[0]]).sync().bytes);
    assert_eq!((read.of("row position").len(), read.gaps.len()), (20, 1), "{:?}", read.gaps);
    assert_eq!(read.gaps[0].cause, Cause::Damaged);
}

#[test]
fn a_subscription_that_is_removed_frees_its_number() {
    let log = small().message(b'R', &[&0_u16.to_le_bytes()]).subscribe(0, 2, "position");
    let read = read(&log.data(0, 4 * SECOND, &position(5.0, 5)).bytes);
    assert_eq!(read.of("row position").last(), Some(&"2,4000000,5,5"));
    assert_eq!(read.gaps.len(), 0);
}

#[test]
fn a_subscription_to_what_was_never_defined_is_said_and_the_rest_is_read() {
    let log = small().subscribe(5, 0, "nothing").data(5, 4 * SECOND, &[1; 30]).data(
        0,
        4 * SECOND,
        &position(0.0, 0),
    );
    let read = read(&log.bytes);
    assert_eq!(read.of("row position").len(), 21);
    assert_eq!(
        read.of("gap"),
        [
            "Damaged a subscription to nothing: no format definition of nothing",
            "Damaged 1 messages of data without a subscription"
        ]
    );
}

#[test]
fn zeros_at_the_end_are_a_cut_and_no_search() {
    let mut log = small().bytes;
    log.extend([0; 3_000]);
    let read = read(&log);
    assert_eq!(read.of("row position").len(), 20);
    assert_eq!(read.of("gap"), ["Cut 3000 zero bytes to the end, where messages should be"]);
}

#[test]
fn damage_costs_what_it_hit_and_says_where() {
    let mut log = small().bytes;
    let middle = log.len() - 200;
    let noise: Vec<u8> =
        (0..100_000_u32).map(|number| (number.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    log.splice(middle..middle, noise);
    let read = read(&log);
    assert!(read.of("row position").len() >= 18, "{:?}", read.of("row position"));
    let gap = &read.gaps[0];
    assert_eq!(gap.cause, Cause::Damaged);
    let place = gap.place.expect("a place");
    assert!(place.abs_diff(middle as u64) < 30, "{gap:?}");
    assert!((99_900..100_100).contains(&gap.bytes), "{gap:?}");
}

#[test]
fn a_log_that_was_joined_to_another_is_another_recording_with_its_own_definitions() {
    let mut log = small().bytes;
    let other = Writer::new(SECOND)
        .format("position:uint64_t timestamp;double x;")
        .subscribe(0, 0, "position")
        .data(0, 2 * SECOND, &1.25_f64.to_le_bytes());
    let cut = [&log[..log.len() - 5], &other.bytes].concat();
    let told = read(&cut);
    assert_eq!((told.of("joint").len(), told.of("row position_2")), (1, vec!["0,2000000,1.25"]));
    assert_eq!(told.of("gap"), ["Damaged 13 bytes that are no messages"]);
    log.extend(other.bytes);
    let read = read(&log);
    assert_eq!((read.of("joint").len(), read.of("restart").len(), read.gaps.len()), (1, 0, 0));
    assert_eq!(read.of("row position_2"), ["0,2000000,1.25"]);
    assert_eq!(read.items.last().map(|(at, _)| *at), Some(3 * SECOND + 900_001));
}

#[test]
fn a_version_that_is_not_known_is_told_and_what_can_be_read_is() {
    let of_version = |version| {
        let mut log = small().bytes;
        log[7] = version;
        log
    };
    for version in [0, 1] {
        assert_eq!(read(&of_version(version)).gaps.len(), 0, "{version}");
    }
    let told = read(&of_version(9));
    assert_eq!(told.of("row position").len(), 20);
    let gap = &told.gaps[0];
    assert_eq!((gap.cause, gap.place, told.gaps.len()), (Cause::Damaged, Some(7), 1));
    assert!(gap.words.contains("version 9") && gap.words.contains("read as version 1"), "{gap:?}");
    let first = small().bytes;
    let told = read(&[&first[..], &of_version(2)].concat());
    assert_eq!(told.gaps.iter().map(|gap| gap.place).collect::<Vec<_>>(), [Some(first.len() as u64 + 7)]);
}

#[test]
fn two_topics_whose_names_become_one_name_of_a_file_have_a_table_each() {
    let fields = "uint64_t timestamp;float x;";
    let log = ["a/b", "a_b"].into_iter().zip(0..).fold(Writer::new(SECOND), |log, (name, id)| {
        let log = log.format(&format!("{name}:{fields}")).subscribe(id, 0, name);
        log.data(id, 2 * SECOND, &f32::from(id).to_le_bytes())
    });
    let told = read(&log.bytes);
    let rows = ["row a_b ", "row a_b_2 "].map(|table| told.of(table));
    assert_eq!(rows, [["0,2000000,0"], ["0,2000000,1"]]);
}

#[test]
fn truncation_at_every_byte_gives_what_came_before() {
    let log = small().bytes;
    let mut ends = Vec::new();
    let mut at = 16;
    while at < log.len() {
        let bytes = 3 + usize::from(u16::from_le_bytes([log[at], log[at + 1]]));
        if log[at + 2] == b'D' {
            ends.push(at + bytes);
        }
        at += bytes;
    }
    assert_eq!(ends.len(), 20);
    for end in 16..log.len() {
        let read = read(&log[..end]);
        let rows = read.of("row position").len();
        assert_eq!(rows, ends.iter().filter(|whole| **whole <= end).count(), "{end}");
        assert!(
            read.gaps.len() <= 1 && read.gaps.iter().all(|gap| gap.cause == Cause::Cut),
            "{end}: {:?}",
            read.gaps
        );
    }
}

#[test]
fn no_flipped_bit_costs_more_than_its_neighbours() {
    let log = small().bytes;
    let data = log.len() - 20 * 18 - 3 * 11;
    for bit in data * 8..log.len() * 8 {
        let mut flipped = log.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        let rows = read(&flipped).of("row position").len();
        assert!(rows >= 18, "bit {bit}: {rows} rows");
    }
}

#[test]
fn what_looks_like_a_message_at_every_byte_is_searched_in_time() {
    for pattern in
        [&b"F"[..], b"L0", b"D", b"P\0", b"I1", b"Q", &[0x2f, 0x73, 0x13, 0x20], b"ULog\x01\x12\x35"]
    {
        let mut log = small().bytes;
        log.extend(pattern.iter().cycle().take(6 * MESSAGE_BYTES_MAX));
        let read = read(&log);
        assert_eq!(read.of("row position").len(), 20, "{pattern:?}");
    }
}

#[test]
fn a_clock_that_does_not_run_from_some_place_on_is_told() {
    let of = |time: &dyn Fn(u64) -> u64| {
        let mut writer = Writer::new(SECOND).format(POSITION).subscribe(0, 0, "position");
        for tick in 0..20_000 {
            writer = writer.data(0, time(tick), &position(0.0, 0));
        }
        read(&writer.bytes).gaps.iter().any(|gap| gap.cause == Cause::NoTimes)
    };
    let sound = |tick: u64| 2 * SECOND + tick * 1_000;
    assert!(!of(&sound));
    assert!(of(&|tick| sound(tick.min(4_000))), "it stands");
    assert!(of(&|tick| if tick < 4_000 { sound(tick) } else { 0 }), "zeros");
    assert!(of(&|tick| if tick < 4_000 { sound(tick) } else { u64::MAX }), "ones");
    assert!(of(&|tick| if tick < 4_000 { sound(tick) } else { sound(tick) / 1_000 }), "milliseconds");
}

#[test]
fn what_is_looked_at_for_jumps_of_the_time_has_an_end() {
    let log = [0x08, 0, b'S', 0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12].repeat(20);
    let (subscriptions, mut left) = (Subscriptions::default(), 150);
    let mut ahead = || (times::ahead(&subscriptions, &log, &mut left, &|_| true).is_end, left);
    assert_eq!(ahead(), (true, 0), "a log of 220 bytes");
    assert_eq!(ahead(), (false, 0), "nobody looks any more");
}

#[test]
fn a_clock_that_stands_or_runs_backwards_is_told_in_a_log_of_any_size() {
    let gaps = |time: &dyn Fn(u64) -> u64| {
        let mut writer = Writer::new(SECOND).format(POSITION).subscribe(0, 0, "position");
        for number in 0..400 {
            writer = writer.data(0, time(number), &position(0.0, 0));
        }
        read(&writer.bytes).gaps.iter().map(|gap| gap.cause).collect::<Vec<_>>()
    };
    assert_eq!(gaps(&|_| 2 * SECOND), [Cause::NoTimes]);
    assert_eq!(gaps(&|number| 900 * SECOND - number * 100_000), [Cause::NoTimes]);
    assert_eq!(gaps(&|number| 2 * SECOND + number.min(250) * 10_000), [Cause::NoTimes]);
    // Less than a second: no jump.
    let set = |number: u64| 2 * SECOND + number * 2_500 - if number < 100 { 0 } else { 900_000 };
    assert_eq!(gaps(&set), []);
}
