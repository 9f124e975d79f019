//! The framer on real and damaged lines. The counts were made independently, with pymavlink's definitions.

use crate::common;

use common::{Random, crc32, excerpt, flight};
use hums_link::{Check, Frame, Framer};
use std::collections::HashSet;

fn frames_in_pieces(bytes: &[u8], piece: usize) -> (Vec<(Vec<u8>, Check)>, Framer) {
    let mut framer = Framer::new();
    let mut frames = Vec::new();
    let mut sink = |frame: Frame<'_>| frames.push((frame.bytes().to_vec(), frame.check()));
    for part in bytes.chunks(piece) {
        framer.push(part, &mut sink);
    }
    framer.idle(&mut sink);
    let counts = framer.counts();
    assert_eq!(framer.held(), 0, "nothing is held after silence");
    assert_eq!(counts.bytes, bytes.len() as u64);
    assert_eq!(counts.bytes, counts.bytes_in_frames + counts.bytes_not_frames);
    assert_eq!(counts.frames, frames.len() as u64);
    (frames, framer)
}

fn digest(frames: &[(Vec<u8>, Check)]) -> u32 {
    frames.iter().fold(0, |crc, (bytes, _)| crc32(crc, bytes))
}

fn unverified(frames: &[(Vec<u8>, Check)]) -> usize {
    frames.iter().filter(|(_, check)| *check == Check::Unverified).count()
}

#[test]
fn excerpts_come_through_whole_however_the_bytes_are_cut() {
    for (name, count, crc) in [
        ("ap_quad_600_frames.tlog", 600, 0xf053_6dad),
        ("px4_quad_600_frames.tlog", 600, 0xc7a3_e9e5),
        ("ap_quad_boot_text_signed.raw", 372, 0xe856_55d5),
    ] {
        let bytes = excerpt(name).bytes;
        for piece in [1, 2, 7, 61, 280, 281, 560, 561, 4_096, usize::MAX] {
            let (frames, _) = frames_in_pieces(&bytes, piece);
            assert_eq!((frames.len(), digest(&frames)), (count, crc), "{name} in pieces of {piece}");
            assert_eq!(unverified(&frames), 0, "{name} in pieces of {piece}");
        }
    }
}

/// File, frames of our definitions, of others, crc32 of all; as pymavlink.
const FLIGHTS: [(&str, usize, usize, u32); 9] = [
    ("ap_quad_faults.tlog", 77_633, 0, 0x4159_f976),
    ("ap_quad_guided.tlog", 57_874, 0, 0xe20a_0b8e),
    ("ap_quad_signed.raw", 35_028, 0, 0xd654_ccc3),
    ("px4_hil_quad_low.tlog", 16_645, 0, 0x2ca6_1a93),
    // Four more frames have a checksum that no definition explains: something on their way altered them.
    ("clyde_rov_dive.tlog", 35_912, 0, 0xab53_68e4),
    ("dronekit_flight.tlog", 75_477, 1_314, 0xd920_8867),
    ("eagle_ac740ecf.tlog", 26_136, 0, 0x86ef_2f63),
    ("mavometer_px4.tlog", 2_116, 0, 0x23e6_1820),
    ("thayer_px4_rural.tlog", 33_261, 0, 0xb1be_0af9),
];

#[test]
fn whole_flights_come_through_bit_for_bit() {
    for (name, verified, other, crc) in FLIGHTS {
        let Some(recording) = flight(name) else { continue };
        let (frames, framer) = frames_in_pieces(&recording.bytes, 97);
        println!("{name}: {:?}", framer.counts());
        assert_eq!(frames.len() - unverified(&frames), verified, "{name}");
        assert_eq!(unverified(&frames), other, "{name}");
        assert_eq!(digest(&frames), crc, "{name}");
    }
}

/// Probability `1 / one_in`; returns the damaged ones.
fn with_noise(bytes: &[u8], one_in: u64, random: &mut Random) -> (Vec<u8>, Vec<bool>) {
    bytes
        .iter()
        .map(|&byte| {
            let hit = random.below(one_in) == 0;
            (if hit { byte ^ (1 + random.below(255) as u8) } else { byte }, hit)
        })
        .unzip()
}

fn survives_noise(name: &str, bytes: &[u8], bounds: &[(usize, usize)], seed: u64) -> (usize, usize) {
    let mut random = Random(seed);
    let (noisy, hits) = with_noise(bytes, 1_000, &mut random);
    let (found, framer) = frames_in_pieces(&noisy, 64);
    let mut found = found.iter();
    let (mut damaged, mut besides) = (0, 0);
    for &(start, len) in bounds {
        if hits[start..start + len].contains(&true) {
            damaged += 1;
            continue;
        }
        let frame = &bytes[start..start + len];
        loop {
            let (bytes, check) = found
                .next()
                .unwrap_or_else(|| panic!("{name}, seed {seed}: the undamaged frame at {start} is lost"));
            if bytes == frame {
                break;
            }
            // A frame with a damaged signature has a correct checksum, so it is not noise.
            besides += usize::from(*check == Check::Unverified);
        }
    }
    assert!(framer.counts().damaged > 0);
    (damaged, besides)
}

#[test]
fn under_noise_every_undamaged_frame_of_the_excerpts_survives() {
    for name in ["ap_quad_600_frames.tlog", "px4_quad_600_frames.tlog"] {
        let recording = excerpt(name);
        let bounds: Vec<_> = recording.frames.iter().map(|&(start, len, _)| (start, len)).collect();
        for seed in 0..200 {
            let (damaged, besides) = survives_noise(name, &recording.bytes, &bounds, seed);
            assert!(damaged > 0, "{name}, seed {seed}");
            assert!(besides <= 1, "{name}, seed {seed}: noise came through as {besides} frames");
        }
    }
}

#[test]
fn under_noise_every_undamaged_frame_of_whole_flights_survives() {
    for (name, _, other, _) in FLIGHTS {
        let Some(recording) = flight(name) else { continue };
        let bounds: Vec<_> = if recording.frames.is_empty() {
            bounds_of_raw(&recording.bytes)
        } else {
            let whole = |&(start, len, _): &(usize, usize, u64)| {
                let frame = Frame::parse(&recording.bytes[start..start + len]);
                let good = other > 0 || frame.is_some_and(|frame| frame.check() == Check::Verified);
                good.then_some((start, len))
            };
            recording.frames.iter().filter_map(whole).collect()
        };
        for seed in 0..10 {
            let (damaged, besides) = survives_noise(name, &recording.bytes, &bounds, seed);
            println!("{name}, seed {seed}: {damaged} frames damaged, {besides} frames of noise");
            assert!(besides <= 4, "{name}, seed {seed}: noise came through as {besides} frames");
        }
    }
}

fn bounds_of_raw(bytes: &[u8]) -> Vec<(usize, usize)> {
    let (frames, _) = frames_in_pieces(bytes, 4_096);
    let mut at = 0;
    frames
        .iter()
        .map(|(frame, _)| {
            at += bytes[at..].windows(frame.len()).position(|window| window == frame).unwrap();
            let bound = (at, frame.len());
            at += frame.len();
            bound
        })
        .collect()
}

/// Checked with `extra`.
fn frame_v2(id: u32, sequence: u8, payload: &[u8], extra: u8) -> Vec<u8> {
    let [id0, id1, id2, _] = id.to_le_bytes();
    let mut frame = vec![0xfd, payload.len() as u8, 0, 0, sequence, 1, 1, id0, id1, id2];
    frame.extend_from_slice(payload);
    let crc = mcrf4xx(frame[1..].iter().copied().chain([extra]));
    frame.extend_from_slice(&crc.to_le_bytes());
    frame
}

/// Bit by bit.
fn mcrf4xx(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0xffff_u16, |mut crc, byte| {
        crc ^= u16::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0x8408 } else { crc >> 1 };
        }
        crc
    })
}

const UNKNOWN_ID: u32 = 54_321;

#[test]
fn a_lone_frame_of_an_unknown_id_comes_through_when_the_line_falls_silent() {
    let frame = frame_v2(UNKNOWN_ID, 0, b"private", 77);
    let mut framer = Framer::new();
    let mut seen = Vec::new();
    framer.push(&frame, &mut |frame| seen.push(frame.check()));
    assert_eq!(framer.held(), frame.len(), "undecided until something follows");
    framer.idle(&mut |frame| seen.push(frame.check()));
    assert_eq!(seen, [Check::Unverified]);
}

#[test]
fn frames_of_an_unknown_id_come_through_between_others_and_then_need_no_neighbour() {
    let mut line = frame_v2(UNKNOWN_ID, 0, b"first", 77);
    line.extend(frame_v2(0, 1, &[4; 9], 50));
    line.extend(frame_v2(UNKNOWN_ID, 2, b"second", 77));
    line.extend(frame_v2(0, 3, &[4; 9], 50));
    line.extend(frame_v2(UNKNOWN_ID, 4, b"third, then noise", 77));
    line.extend([0x55; 40]);
    let (frames, _) = frames_in_pieces(&line, 5);
    assert_eq!(frames.len(), 5);
    assert_eq!(unverified(&frames), 3);
}

#[test]
fn an_unknown_id_after_noise_is_believed_at_its_second_sight() {
    let mut line = vec![0x55; 3];
    line.extend(frame_v2(UNKNOWN_ID, 0, b"first", 77));
    line.extend(frame_v2(0, 1, &[4; 9], 50));
    line.extend([0x55; 3]);
    line.extend(frame_v2(UNKNOWN_ID, 2, b"second", 77));
    line.extend(frame_v2(0, 3, &[4; 9], 50));
    let (frames, _) = frames_in_pieces(&line, 5);
    assert_eq!((frames.len(), unverified(&frames)), (3, 1));
}

#[test]
fn an_unknown_id_that_no_frame_follows_is_noise_at_first_sight() {
    let mut line = frame_v2(UNKNOWN_ID, 0, b"first", 77);
    line.extend([0x55; 3]);
    line.extend(frame_v2(0, 1, &[4; 9], 50));
    let (frames, _) = frames_in_pieces(&line, 5);
    assert_eq!((frames.len(), unverified(&frames)), (1, 0));
}

#[test]
fn an_unknown_id_after_noise_is_not_believed_when_its_second_sight_has_another_extra() {
    let mut line = Vec::new();
    for extra in [77, 78] {
        line.extend([0x55; 3]);
        line.extend(frame_v2(UNKNOWN_ID, 0, b"perhaps", extra));
        line.extend(frame_v2(0, 1, &[4; 9], 50));
    }
    let (frames, _) = frames_in_pieces(&line, 5);
    assert_eq!((frames.len(), unverified(&frames)), (2, 0));
}

#[test]
fn an_unknown_id_around_a_whole_known_frame_gives_way_to_it_but_not_to_a_damaged_one() {
    let inside = frame_v2(0, 7, &[4; 9], 50);
    let after = frame_v2(0, 8, &[4; 9], 50);
    for (inside, good) in [(inside.clone(), true), (frame_v2(0, 7, &[4; 9], 51), false)] {
        let around = frame_v2(UNKNOWN_ID, 0, &[b"left", &inside[..], b"right"].concat(), 77);
        let expected = if good { (inside, Check::Verified) } else { (around.clone(), Check::Unverified) };
        let (frames, _) = frames_in_pieces(&[around, after.clone()].concat(), 5);
        assert_eq!(frames, [expected, (after.clone(), Check::Verified)]);
    }
}

#[test]
fn an_unknown_id_with_another_extra_than_before_is_damage() {
    let mut line = frame_v2(UNKNOWN_ID, 0, b"first", 77);
    line.extend(frame_v2(UNKNOWN_ID, 1, b"second", 77));
    line.extend(frame_v2(UNKNOWN_ID, 2, b"third", 78));
    let (frames, framer) = frames_in_pieces(&line, 1);
    assert_eq!(frames.len(), 2);
    assert_eq!(framer.counts().damaged, 1);
}

#[test]
fn a_known_id_that_was_verified_never_comes_through_unverified() {
    let mut line = frame_v2(0, 0, &[4; 9], 50);
    line.extend(frame_v2(0, 1, &[4; 9], 51));
    line.extend(frame_v2(0, 2, &[4; 9], 50));
    let (frames, framer) = frames_in_pieces(&line, 1);
    assert_eq!(frames.len(), 2);
    assert_eq!(unverified(&frames), 0);
    assert_eq!(framer.counts().damaged, 1);
}

#[test]
fn a_payload_longer_than_our_definition_is_verified_as_a_newer_one() {
    let frame = frame_v2(0, 0, &[7; 30], 50);
    let (frames, _) = frames_in_pieces(&frame, 1);
    assert_eq!(frames, [(frame, Check::Verified)]);
}

#[test]
fn a_mavlink_1_frame_of_a_length_that_no_encoder_makes_waits_for_a_frame_after_it() {
    let frame = |payload: &[u8]| {
        let mut frame = vec![0xfe, payload.len() as u8, 0, 1, 1, 0];
        frame.extend_from_slice(payload);
        let crc = mcrf4xx(frame[1..].iter().copied().chain([50]));
        frame.extend_from_slice(&crc.to_le_bytes());
        frame
    };
    let mut framer = Framer::new();
    let mut seen = Vec::new();
    let mut sink = |frame: Frame<'_>| seen.push((frame.payload().len(), frame.check()));
    framer.push(&frame(&[4; 9]), &mut sink);
    assert_eq!(framer.held(), 0, "as our definition has it");
    let short = frame(&[4; 8]);
    framer.push(&short, &mut sink);
    assert_eq!(framer.held(), short.len(), "perhaps by chance");
    framer.push(&[0xfe], &mut sink);
    assert_eq!(framer.held(), 1);
    assert_eq!(seen, [(9, Check::Verified), (8, Check::Verified)]);
}

#[test]
fn a_frame_with_unknown_flags_is_no_frame_and_hides_none() {
    let mut line = frame_v2(0, 0, &[4; 9], 50);
    line[2] = 2;
    let good = frame_v2(0, 1, &[4; 9], 50);
    line.extend(&good);
    let (frames, framer) = frames_in_pieces(&line, 1);
    assert_eq!(frames, [(good, Check::Verified)]);
    assert_eq!(framer.counts().bytes_not_frames, 21);
}

#[test]
fn a_false_start_before_a_frame_hides_nothing_once_the_line_is_idle() {
    let good = frame_v2(0, 1, &[4; 9], 50);
    for false_start in
        [&[0xfd_u8][..], &[0xfe], &[0xfd, 255, 0], &[0xfe, 255, 1, 1, 1, 200], &[0xfd, 255, 1, 0]]
    {
        let line = [false_start, &good].concat();
        let (frames, _) = frames_in_pieces(&line, 1);
        assert_eq!(frames, [(good.clone(), Check::Verified)], "after {false_start:x?}");
    }
}

#[test]
fn an_idle_line_gives_up_a_candidate_and_takes_the_frames_that_come_next() {
    let good = frame_v2(0, 1, &[4; 9], 50);
    let mut framer = Framer::new();
    let mut count = 0;
    framer.push(&good[..12], &mut |_| count += 1);
    framer.idle(&mut |_| count += 1);
    assert_eq!((count, framer.held(), framer.counts().bytes_not_frames), (0, 0, 12));
    framer.push(&good, &mut |_| count += 1);
    assert_eq!(count, 1);
}

#[test]
fn noise_and_constant_bytes_are_no_frames() {
    let mut random = Random(1);
    let noise: Vec<u8> = (0..1_000_000).map(|_| random.next() as u8).collect();
    let lines =
        [vec![0xfd; 100_000], vec![0xfe; 100_000], vec![0; 10_000], [0xfe, 0xfd].repeat(50_000), noise];
    for line in lines {
        let (frames, _) = frames_in_pieces(&line, 333);
        assert!(frames.len() <= 1, "{} frames of {:x?}...", frames.len(), &line[..8]);
    }
}

#[test]
fn empty_input_is_nothing() {
    let (frames, framer) = frames_in_pieces(&[], 1);
    assert!(frames.is_empty());
    assert_eq!(framer.counts(), hums_link::FramerCounts::default());
}

#[test]
fn how_the_bytes_are_cut_changes_nothing_under_heavy_noise() {
    let bytes = excerpt("ap_quad_600_frames.tlog").bytes;
    let (noisy, _) = with_noise(&bytes, 50, &mut Random(5));
    let whole = frames_in_pieces(&noisy, usize::MAX).0;
    let distinct: HashSet<_> = whole.iter().map(|(bytes, _)| bytes).collect();
    assert!(distinct.len() > 100, "heavy, but not hopeless");
    for piece in [1, 3, 17, 281, 1_000] {
        assert!(frames_in_pieces(&noisy, piece).0 == whole, "pieces of {piece}");
    }
}
