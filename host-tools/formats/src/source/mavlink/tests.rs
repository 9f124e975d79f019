//! Recordings of a ground station.

use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::Packet;

use super::*;
use crate::mavlink::frame::tests::HEARTBEAT;

const SECOND: u64 = 1_000_000;

fn record(tenth: &u64) -> Vec<u8> {
    [&(1_700_000_000 * SECOND + tenth * SECOND / 10).to_be_bytes()[..], &HEARTBEAT].concat()
}

/// Times in tenths of seconds: gaps, restarts, last time.
fn told(tenths: &[u64]) -> (Vec<(Cause, Option<u64>)>, usize, u64) {
    told_of(tenths.iter().flat_map(record).collect())
}

fn told_of(bytes: Vec<u8>) -> (Vec<(Cause, Option<u64>)>, usize, u64) {
    let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
    let (mut gaps, mut restarts, mut last) = (Vec::new(), 0, Instant::ZERO);
    let summary = reader.read(Needs { frames: true, ..Needs::default() }, &mut |at, item| {
        match item {
            Item::Gap(gap) => gaps.push((gap.cause, gap.place)),
            Item::Restart => restarts += 1,
            _ => {}
        }
        last = at;
        Ok(())
    });
    assert!(summary.is_ok());
    (gaps, restarts, last.as_millis() / 100)
}

#[test]
fn one_wrong_time_is_damage_and_changes_no_other_time() {
    let usual: Vec<u64> = (1_000..1_200).collect();
    assert_eq!(told(&usual), (vec![], 0, 199));
    for (at, wrong) in [(100, 1_130), (100, 1_400), (100, 9_000), (100, 100), (0, 1_500)] {
        let mut times = usual.clone();
        times[at] = wrong;
        let end = if at == 0 { 198 } else { 199 };
        assert_eq!(told(&times), (vec![(Cause::Damaged, Some(at as u64 * 29))], 0, end), "{wrong}");
    }
}

#[test]
fn records_that_are_far_apart_have_right_times_and_a_wrong_one_at_the_end_is_seen() {
    for apart in [610, 30_000, 400_000] {
        for number in [2, 3, 60] {
            let times: Vec<u64> = (0..number).map(|record| 1_000 + record * apart).collect();
            assert_eq!(told(&times), (vec![], 0, (number - 1) * apart), "{apart} {number}");
        }
        let times: Vec<u64> = (0..60).map(|record| 1_000 + record * apart).collect();
        let end = 59 * apart;
        let twos: Vec<u64> = times.iter().flat_map(|time| [*time, time + 1]).collect();
        assert_eq!(told(&twos), (vec![], 0, end + 1), "{apart}");
        for wrong in [1_000 + end + 3 * apart, 100] {
            let times = [&times[..], &[wrong]].concat();
            assert_eq!(told(&times), (vec![(Cause::Damaged, Some(60 * 29))], 0, end), "{apart} {wrong}");
        }
    }
}

#[test]
fn a_wrong_time_at_either_end_moves_no_other_time() {
    for count in [1, 2, 8] {
        for (at, wrong) in [(200 - count, 170_000), (200 - count, 100), (0, 10_000), (0, 80_900)] {
            let mut times: Vec<u64> = (80_000..80_200).collect();
            times[at..at + count].fill(wrong);
            let end = 199 - count as u64;
            let told = told(&times);
            assert_eq!(told, (vec![(Cause::Damaged, Some(at as u64 * 29))], 0, end), "{at} {wrong} {count}");
        }
    }
    let late: Vec<u64> = (80_000..80_200).chain([80_250, 80_251]).collect();
    assert_eq!(told(&late), (vec![], 0, 251));
}

#[test]
fn a_wrong_time_before_a_damaged_stretch_and_before_zeros_moves_no_other_time() {
    for (at, damage, end) in [(100, vec![0xFF; 60_000], 199), (199, vec![0; 20_000], 198)] {
        let mut times: Vec<u64> = (1_000..1_200).collect();
        times[at] += 336;
        let (before, after) = times.split_at(at + 1);
        let bytes =
            [before.iter().flat_map(record).collect(), damage, after.iter().flat_map(record).collect()];
        let (gaps, restarts, last) = told_of(bytes.concat());
        assert!(gaps.contains(&(Cause::Damaged, Some(at as u64 * 29))), "{gaps:?}");
        assert_eq!((restarts, last), (0, end));
    }
}

#[test]
fn a_clock_that_is_set_back_by_a_second_again_and_again_is_no_damage() {
    let mut times = Vec::new();
    let mut from = 80_000;
    for fall in [11, 14, 12, 13, 0] {
        times.extend((0..200).map(|record| from + record / 2));
        from += 99 - fall;
    }
    let (gaps, restarts, _) = told(&times);
    assert_eq!((gaps, restarts), (vec![], 4));
}

fn clock_of(times: &[(u64, u64)]) -> String {
    let tenths: Vec<(u64, u64)> = times.iter().map(|(recorded, boot)| (recorded * 10, boot * 10)).collect();
    clock_of_tenths(&tenths).0
}

fn clock_of_tenths(times: &[(u64, u64)]) -> (String, u64) {
    let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
    let record = |(recorded, boot): &(u64, u64)| {
        let time = (1_700_000_000 * SECOND + recorded * SECOND / 10).to_be_bytes();
        let packet = Packet::new(30).u32(0, *boot as u32 * 100);
        [&time[..], encoder.frame(&mut buffer, &packet)].concat()
    };
    let bytes: Vec<u8> = times.iter().flat_map(record).collect();
    let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
    let (mut told, mut last) = (String::new(), Instant::ZERO);
    let read = reader.read(Needs { frames: true, ..Needs::default() }, &mut |at, item| {
        last = at;
        match item {
            Item::Gap(_) => told += "gap ",
            Item::Restart => told += "restart ",
            Item::Joint => told += "joint ",
            _ => {}
        }
        Ok(())
    });
    assert!(read.is_ok());
    (told, last.as_millis() / 100)
}

#[test]
fn two_recordings_that_were_joined_are_told_from_a_clock_that_was_set_and_from_a_long_silence() {
    let part = |recorded: u64, boot: u64| (0..50).map(move |second| (recorded + second, boot + second));
    let joined =
        |recorded, boot| clock_of(&part(90_000, 100).chain(part(recorded, boot)).collect::<Vec<_>>());
    assert_eq!(joined(90_000, 100), "joint ", "the same twice");
    assert_eq!(joined(93_700, 100), "joint ", "an hour later, after another power-on");
    assert_eq!(joined(50_000, 700), "joint ", "an earlier one, longer after its power-on");
    assert_eq!(joined(50_000, 150), "restart ", "the clock was set");
    assert_eq!(joined(93_700, 100 + 3_700), "", "an hour without a word");
    assert_eq!(joined(90_200, 5), "", "a restart of the autopilot");
}

#[test]
fn what_passed_is_told_by_the_autopilot_where_the_ground_stations_clock_is_set() {
    let part = |recorded: u64, from: u64, to: u64| (from..to).map(move |boot| (recorded + boot, boot));
    for (set, forward_told) in [(15, false), (50, false), (150, true), (6_000, true), (400_000, true)] {
        let forward: Vec<_> = part(9_000, 1_000, 1_500).chain(part(9_000 + set, 1_500, 2_000)).collect();
        let told = if forward_told { ("restart ", 999) } else { ("", 999 + set) };
        assert_eq!(clock_of_tenths(&forward), (told.0.to_owned(), told.1), "{set}");
        let back: Vec<_> = part(900_000 + set, 1_000, 1_500).chain(part(900_000, 1_500, 2_000)).collect();
        assert_eq!(clock_of_tenths(&back), ("restart ".to_owned(), 999), "{set}");
    }
    // Silent, then the held-back frames.
    let held = (1_500..1_560).map(|boot| (9_000 + 1_560, boot));
    let silent: Vec<_> = part(9_000, 1_000, 1_500).chain(held).chain(part(9_000, 1_560, 2_000)).collect();
    assert_eq!(clock_of_tenths(&silent), (String::new(), 999));
}

#[test]
fn a_frame_with_a_wrong_checksum_is_damage_and_one_of_an_unknown_message_cannot_be_checked() {
    let mut bytes: Vec<u8> = (1_000..1_040).flat_map(|tenth| record(&tenth)).collect();
    bytes[10 * 29 + 20] ^= 4;
    bytes[12 * 29 + 22] ^= 1;
    for at in [20, 21, 22] {
        bytes[at * 29 + 8 + 9] = 200;
    }
    let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
    let mut said = Vec::new();
    let read = reader.read(Needs::default(), &mut |_, item| {
        match item {
            Item::Gap(gap) => said.push(format!("{:?} {:?} {}", gap.cause, gap.place, gap.words)),
            Item::Fact(fact) => said.push(format!("{:?} {}", fact.about, fact.words)),
            _ => {}
        }
        Ok(())
    });
    assert!(read.is_ok());
    assert_eq!(
        said,
        [
            "Damaged Some(298) 2 frames with a wrong checksum, which are not read",
            "Unchecked 3 frames of messages that this program has no definition of: whether they are damaged is not known",
        ]
    );
}

/// Attitudes and, every third, a heartbeat, ten a second.
fn records_of_two_lengths(records: u32) -> Vec<Vec<u8>> {
    let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
    let each = |at: u32| {
        if at.is_multiple_of(3) {
            return record(&u64::from(at));
        }
        let time = (1_700_000_000 * SECOND + u64::from(at) * SECOND / 10).to_be_bytes();
        let packet = Packet::new(30).u32(0, 60_000 + at * 100).u32(24, 1);
        [&time[..], encoder.frame(&mut buffer, &packet)].concat()
    };
    (0..records).map(each).collect()
}

fn frames_and_gaps(bytes: Vec<u8>) -> (usize, Vec<(Cause, Option<u64>)>) {
    let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
    let (mut frames, mut gaps) = (0, Vec::new());
    let read = reader.read(Needs { frames: true, ..Needs::default() }, &mut |_, item| {
        match item {
            Item::Frame(_) => frames += 1,
            Item::Gap(gap) => gaps.push((gap.cause, gap.place)),
            _ => {}
        }
        Ok(())
    });
    assert!(read.is_ok());
    (frames, gaps)
}

#[test]
fn a_record_whose_length_is_that_of_several_or_whose_end_is_missing_is_damage_and_those_in_it_are_found() {
    let records = records_of_two_lengths(60);
    let place_of = |records: &[Vec<u8>], at: usize| records[..at].concat().len() as u64;
    let place = |at: usize| place_of(&records, at);
    assert_eq!(frames_and_gaps(records.concat()), (60, vec![]));
    let (mut swallow, at_length) = (0, TIME_BYTES + 1);
    for at in [20, 21, 22, 57] {
        for length in 0..=u8::MAX {
            let mut bytes = records.concat();
            let byte = &mut bytes[place(at) as usize + at_length];
            if std::mem::replace(byte, length) == length {
                continue;
            }
            let longer = usize::from(length).wrapping_sub(usize::from(records[at][at_length]));
            let ends = (at + 1..60).any(|next| place(next + 1) - place(at + 1) == longer as u64);
            swallow += usize::from(ends);
            let (frames, gaps) = frames_and_gaps(bytes);
            // The record's place, or its frame's.
            let is_told =
                gaps.iter().any(|gap| [place(at), place(at) + TIME_BYTES as u64].map(Some).contains(&gap.1));
            assert!(frames == 59 && is_told, "{at} {length}: {frames} {gaps:?}");
        }
    }
    assert!(swallow >= 12, "{swallow}");
    let mut cut = records;
    let (keep, start) = (cut[22].len() - record(&23).len(), place_of(&cut, 22));
    cut[22].truncate(keep);
    cut[23] = record(&23);
    assert_eq!(frames_and_gaps(cut.concat()), (59, vec![(Cause::Damaged, Some(start))]));
}

#[test]
fn a_clock_that_was_set_and_a_silence_are_none() {
    let set: Vec<u64> = (1_000..1_100).chain(500..600).collect();
    assert_eq!(told(&set), (vec![], 1, 99 + 99));
    let silent: Vec<u64> = (1_000..1_100).chain(1_500..1_600).collect();
    assert_eq!(told(&silent), (vec![], 0, 599));
}

/// Milliseconds of attitudes by time since boot, and the number of restarts.
fn read(component: u8, boot_ms: &[u32]) -> (Vec<u64>, usize) {
    let (mut encoder, mut buffer) = (Encoder::of(1, component), [0; FRAME_BYTES_MAX]);
    let frame = |boot_ms: &u32| encoder.frame(&mut buffer, &Packet::new(30).u32(0, *boot_ms)).to_vec();
    let bytes: Vec<u8> = boot_ms.iter().flat_map(frame).collect();
    let mut reader = RawReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"), 115_200);
    let (mut times, mut restarts) = (Vec::new(), 0);
    let want = Needs { frames: true, ..Needs::default() };
    let mut take = |at: Instant, item: Item<'_>| {
        times.extend(matches!(item, Item::Frame(_)).then(|| at.as_millis()));
        restarts += usize::from(matches!(item, Item::Restart));
        Ok(())
    };
    reader.read(want, &mut take).expect("memory");
    (times, restarts)
}

#[test]
fn raw_frames_come_when_the_autopilots_messages_say_and_where_none_does_when_a_line_brings_them() {
    let (times, restarts) = read(1, &[60_000, 61_000, 75_500, 75_400, 900, 1_900]);
    let since_first: Vec<u64> = times.iter().map(|at| at - times[0]).collect();
    assert_eq!((since_first, restarts), (vec![0, 1_000, 15_500, 15_500, 15_500, 16_500], 1));
    let (times, restarts) = read(100, &[60_000, 61_000, 75_500]);
    assert!(times.len() == 3 && times[2] < 20 && restarts == 0, "no autopilot says so: {times:?}");
}

/// Gaps, also power-ons and recordings that begin there.
fn told_raw(bytes: Vec<u8>) -> Vec<String> {
    let mut reader = RawReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"), 115_200);
    let mut told = Vec::new();
    let read = reader.read(Needs::default(), &mut |_, item| {
        match item {
            Item::Gap(gap) => told.push(format!("{:?} {:?} {}", gap.cause, gap.place, gap.words)),
            Item::Restart => told.push("restart".to_owned()),
            Item::Joint => told.push("joint".to_owned()),
            _ => {}
        }
        Ok(())
    });
    assert!(read.is_ok());
    told
}

fn attitudes(seconds: std::ops::Range<u32>) -> Vec<u8> {
    let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
    let frame = |second| encoder.frame(&mut buffer, &Packet::new(30).u32(0, second * 1_000)).to_vec();
    seconds.flat_map(frame).collect()
}

#[test]
fn raw_bytes_that_are_cut_or_were_never_written_are_damaged() {
    let whole = attitudes(60..100);
    assert_eq!(told_raw(whole.clone()), Vec::<String>::new());
    let cut = told_raw(whole[..whole.len() - 5].to_vec());
    let [words] = &cut[..] else { panic!("{cut:?}") };
    assert!(words.starts_with("Cut Some(") && words.contains("a frame that the end cuts off"), "{words}");
    for value in [0x00, 0xff] {
        let told = told_raw([&whole[..], &vec![value; 20_000], &attitudes(100..140)].concat());
        let place = whole.len();
        let expected = format!("Damaged Some({place}) of nothing but 0x00 or 0xff: 20000 bytes");
        assert_eq!(told, [expected]);
    }
}

#[test]
fn another_raw_recording_that_was_joined_on_is_told_from_a_restart() {
    assert_eq!(told_raw([attitudes(60..100), attitudes(50..90)].concat()), ["joint"]);
    assert_eq!(told_raw([attitudes(60..100), attitudes(3..40)].concat()), ["restart"]);
}

fn ten_a_second(recorded: impl Fn(f64) -> u64) -> Vec<u8> {
    let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
    let record = |tenth: u64| {
        let packet = Packet::new(30).u32(0, tenth as u32 * 100);
        let time = recorded((tenth - 600) as f64 / 10.0).to_be_bytes();
        [&time[..], encoder.frame(&mut buffer, &packet)].concat()
    };
    (600..2_600).flat_map(record).collect()
}

#[test]
fn where_the_recorded_times_stand_still_the_autopilots_count_and_it_is_damage() {
    const BEGAN: u64 = 1_700_000_000 * SECOND;
    let sound = |passed_s: f64| BEGAN + (passed_s * 1e6) as u64;
    let of = |recorded: &dyn Fn(f64) -> u64| {
        let (gaps, restarts, tenths) = told_of(ten_a_second(recorded));
        (gaps.into_iter().map(|(cause, _)| cause).collect::<Vec<_>>(), restarts, tenths)
    };
    assert_eq!(of(&sound), (vec![], 0, 1_999));
    let is_mended = |(causes, restarts, tenths): (Vec<Cause>, usize, u64)| {
        causes == [Cause::Damaged] && restarts <= 2 && (1_960..=2_010).contains(&tenths)
    };
    // They stop, are zero, are milliseconds.
    for from_s in [0.0, 20.0, 100.0, 180.0] {
        let stops = of(&|passed_s| sound(passed_s.min(from_s)));
        assert!(is_mended(stops.clone()), "{from_s}: {stops:?}");
        let zero = of(&|passed_s| if passed_s < from_s { sound(passed_s) } else { 0 });
        assert!(is_mended(zero.clone()), "{from_s}: {zero:?}");
        let milliseconds =
            of(&|passed_s| if passed_s < from_s { sound(passed_s) } else { sound(passed_s) / 1_000 });
        assert!(is_mended(milliseconds.clone()), "{from_s}: {milliseconds:?}");
    }
    // Half a minute of standing still.
    let stretch = of(&|passed_s| sound(if (50.0..80.0).contains(&passed_s) { 50.0 } else { passed_s }));
    assert!(is_mended(stretch.clone()), "{stretch:?}");
    let burst = of(&|passed_s| sound((passed_s - 8.0).max(0.0)));
    assert!(burst.0.is_empty() && (1_960..=2_010).contains(&burst.2), "{burst:?}");
    let held = of(&|passed_s| sound((passed_s / 5.0).ceil() * 5.0));
    assert_eq!((held.0, held.1), (vec![], 0));
    assert_eq!(of(&|passed_s| sound(passed_s / 20.0)), (vec![], 0, 99));
}

#[test]
fn a_clock_that_runs_backwards_is_damage() {
    let backwards = ten_a_second(|passed_s| (1_700_000_000 - passed_s as u64) * SECOND);
    assert!(told_of(backwards).0.iter().any(|(cause, _)| *cause == Cause::NoTimes));
}

#[test]
fn nine_times_that_are_hours_ahead_move_no_other_time() {
    let sound = ten_a_second(|passed_s| 1_700_000_000 * SECOND + (passed_s * 1e6) as u64);
    let (before, after) = sound.split_at(sound.len() / 2);
    let time = u64::from_be_bytes(after[..8].try_into().expect("a time"));
    // Without an autopilot's time.
    let ahead: Vec<u8> = (0..9)
        .flat_map(|record| {
            [&(time + 10_800 * SECOND + record * 1_000).to_be_bytes()[..], &HEARTBEAT].concat()
        })
        .collect();
    let (gaps, _, tenths) = told_of([before, &ahead, after].concat());
    assert!((1_990..2_020).contains(&tenths), "{gaps:?} {tenths}");
}

#[test]
fn times_that_stand_still_without_an_autopilots_are_none() {
    let (gaps, ..) = told(&[1_000; 200]);
    assert_eq!(gaps, [(Cause::NoTimes, None)]);
}

#[test]
fn of_several_vehicles_one_is_read_where_it_is_asked_for_and_who_is_no_autopilot_is_always_heard() {
    let heard = |system: Option<u8>| {
        let mut bytes = Vec::new();
        for tenth in 0..20 {
            for (system, component) in [(1, 1), (2, 1), (255, 190)] {
                let (mut encoder, mut buffer) = (Encoder::of(system, component), [0; FRAME_BYTES_MAX]);
                let packet = Packet::new(30).u32(0, tenth * 100).f32(4, 0.1);
                bytes.extend((1_700_000_000 * SECOND + u64::from(tenth) * SECOND / 10).to_be_bytes());
                bytes.extend(encoder.frame(&mut buffer, &packet));
            }
        }
        let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
        let mut heard = [0; 256];
        let want = Needs { frames: true, observations: true, system, ..Needs::default() };
        let read = reader.read(want, &mut |_, item| {
            match item {
                Item::Frame(frame) => heard[usize::from(frame.system())] += 1,
                Item::Observation(source, _) => heard[usize::from(source.system)] += 1,
                _ => {}
            }
            Ok(())
        });
        assert!(read.is_ok());
        [heard[1], heard[2], heard[255]]
    };
    assert_eq!(heard(None), [40, 40, 40]);
    assert_eq!(heard(Some(2)), [0, 40, 40]);
}

#[test]
fn frames_behind_times_that_can_be_none_have_no_times_and_are_one_place() {
    let bytes: Vec<u8> = (0..5_000).flat_map(|_| [&[0xff; 8][..], &HEARTBEAT].concat()).collect();
    let (gaps, _, last) = told_of(bytes);
    assert_eq!((gaps, last), (vec![(Cause::Damaged, Some(0)), (Cause::NoTimes, None)], 0));
}
