//! Flights, recorded by the image that is flashed.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;

use hums::card::{Faults, SimCard};
use hums::run::sim::both_ports::{BoardSetup, Side, run};
use hums::source::Chunk;
use hums_core::parameters::Params;
use hums_sdcard::Medium;
use hums_tests::chip::{self, record};
use hums_tests::fat;
use hums_tests::flights::{self, Manifest, assert_found, own, stream};
use hums_tests::frames::{self, Frame, Seeds};
use hums_tests::oracle;
use hums_tests::program::{Machine, Recording, hums_with, records};
use serde_json::Value;
use stm32f405_model::machine::Board;
use stm32f405_model::time::SECOND;

use super::ready;

const BUSY_PERCENT_MAX: f64 = 40.0;
/// Prefetch, both caches, five wait states.
const ACR: u32 = 0x705;
/// The watchdog stops in a debugger's halt.
const FREEZES_IWDG: u32 = 1 << 12;

/// Exit code 3: the end of a record that power cut in the air cannot be proved.
#[track_caller]
pub(crate) fn assert_verifies(card: &Path) {
    let said = hums_with("info --verify -v {}", &[&card]).expect_code(&[0, 3]).text();
    let checks: Vec<_> = said.lines().filter(|line| line.contains(" checked, ")).collect();
    assert!(checks.len() > 10, "{said}");
    for check in checks {
        assert!(check.contains(" 0 failed") || check.contains(" end  "), "{said}");
    }
}

/// A card of usual size: on a small one the first segment alone takes 0.6 s, which is a finding.
const CARD_MIB: [&str; 2] = ["--card-size", "4096"];
const TICK_US: u64 = 50_000;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Against {
    /// The records, by kind and texts; of a part of a recording.
    Kinds,
    /// Their times and numbers too, and the output to the ground station.
    Numbers,
}

#[track_caller]
fn the_record_is_the_one_of_this_pc(path: &Path, manifest: &Manifest, against: Against) {
    let data = fs::read(path).unwrap();
    let input = manifest.frames_of(path, &data);
    let found = manifest.found(path);
    let chip = Recording::make(Machine::Chip, path, &CARD_MIB);
    let log = chip.decode(&[0, 3]);
    let recorded = log.frames(&manifest.seeds);
    frames::assert_same(&input, &recorded, &stream(found.is_tlog, &data, &input));
    if against == Against::Numbers {
        assert_found(found, &recorded);
    }
    assert_eq!((chip.number("frames_lost"), chip.number("frames_logged")), (0, recorded.len() as u64));
    fat::assert_clean(&chip.image());
    assert_verifies(&chip.image());
    if found.is_tlog {
        assert_times(&input, &recorded);
    }

    let of_chip = records(&chip.image(), &[0, 3]);
    let dir = tempfile::tempdir().unwrap();
    let (of_pc, gs) = on_this_pc(&chip.image(), phase_us(&of_chip), &dir.path().join("card.img"));
    assert_same_records(&of_chip, &of_pc, against);
    if against == Against::Numbers {
        assert_same_stream(&fs::read(chip.gs()).unwrap(), &gs, &manifest.seeds);
    }

    let ground = oracle::ground_station(&chip.gs());
    assert_eq!(ground["frames"].as_u64(), Some(chip.number("gs_frames")));
    let heartbeats = ground["heartbeats"].as_object().unwrap();
    assert!(heartbeats.keys().any(|key| key.contains("/191/")), "our heartbeat: {ground}");
}

#[track_caller]
fn assert_times(input: &[Frame<'_>], recorded: &[Frame<'_>]) {
    let since =
        |frame: &Frame<'_>, first: &Frame<'_>| frame.time_us.unwrap().saturating_sub(first.time_us.unwrap());
    let offs = input
        .iter()
        .zip(recorded)
        .map(|(sent, got)| since(sent, &input[0]).abs_diff(since(got, &recorded[0])));
    let off = offs.max().unwrap();
    println!("times are off by {off} us at the most");
    assert!(off < 20_000, "{off} us");
}

/// Offset of the chip's steps in each 50 ms: records have that time, cut off to a millisecond.
#[track_caller]
fn phase_us(records: &[Value]) -> u64 {
    let stats = records.iter().find(|record| record["record"] == "HUMS_STATS").expect("figures");
    (stats["time_boot"].as_f64().unwrap() * 1e3).round() as u64 * 1_000 % TICK_US
}

/// Steps at whole 50 ms: the chip's are `phase_us` later.
fn on_this_pc(image: &Path, phase_us: u64, to: &Path) -> (Vec<Value>, Vec<u8>) {
    const MIB: u64 = 1 << 20;
    let medium = Medium::load(&File::open(image).unwrap()).unwrap();
    let session = record::read(&medium).pop().unwrap();
    // Cut off to a millisecond: a frame in a step's millisecond came after it.
    let chunks = session
        .frames
        .into_iter()
        .map(|(ms, bytes)| Chunk { at_us: (ms * 1_000 + 500).saturating_sub(phase_us), bytes })
        .map(|chunk| (Side::Autopilot, chunk));
    let file = File::options().read(true).write(true).create_new(true).open(to).unwrap();
    file.set_len(4_096 * MIB).unwrap();
    let card = SimCard::new(file, Faults::default()).unwrap();
    assert!(hums_recorder::format::format(&card, 1).is_ok());
    let mut gs = Vec::new();
    let board = BoardSetup { card: &card, params: &Params::defaults(), key: None, boots: 1 };
    run(&board, chunks, |side, _, frame| {
        if side == Side::Ground {
            gs.extend(frame);
        }
    })
    .unwrap();
    drop(card);
    (records(to, &[0, 3]), gs)
}

/// Records about the machine itself, and their fields of that kind.
const OF_THE_MACHINE: [(&str, &[&str]); 4] = [
    // HUMS_STATS has another number of bytes in the log, which moves the ends of sectors.
    ("HUMS_MARK", &["sector"]),
    ("HUMS_BOOT", &["board", "uid", "reset", "reset_name", "git"]),
    ("HUMS_CHECKED", &["git"]),
    (
        "HUMS_STATS",
        &[
            "bytes_logged",
            "blocks_written",
            "queue_bytes_max",
            "sd_stall_ms_max",
            "frame_queue_bytes_max",
            "gs_queue_bytes_max",
            "gs_frames",
            "gs_bytes",
            "cpu_permille",
            "cpu_permille_max",
            "stack_bytes_max",
            "stack_bytes_capacity",
        ],
    ),
];
/// A frame within a millisecond of a step falls into this one or the next.
const TIME_MAX_S: f64 = 0.101;
/// Relative to the number or to one: the effect of a frame within a millisecond of a step.
const PART_MAX: f64 = 0.02;
/// This part of all records may differ by more.
const ODD_PART_MAX: f64 = 0.02;

const STORE_IS_NEW: &str = "HUMS: the store is new, all counters begin";

#[track_caller]
fn assert_same_records(of_chip: &[Value], of_pc: &[Value], against: Against) {
    assert!(of_chip.len() > 50, "{} records", of_chip.len());
    let key = |record: &Value| {
        let fields = record["fields"].as_object().unwrap();
        let skipped = of_the_machine(record);
        let texts =
            fields.iter().filter(|(name, value)| value.is_string() && !skipped.contains(&name.as_str()));
        let texts: Vec<_> = texts.map(|(name, value)| format!("{name}={value}")).collect();
        format!("{} {}", record["record"], texts.join(" "))
    };
    let last_s = quiet_before_the_end_s(of_chip);
    let by_key = |records: &[Value]| {
        let mut rows = BTreeMap::<String, Vec<Value>>::new();
        let before = records.iter().filter(|record| record["time_boot"].as_f64().unwrap() < last_s);
        for record in before.filter(|record| record["fields"]["text"] != STORE_IS_NEW) {
            rows.entry(key(record)).or_default().push(record.clone());
        }
        rows
    };
    let (chip, pc) = (by_key(of_chip), by_key(of_pc));
    let counts = |rows: &BTreeMap<String, Vec<Value>>| -> Vec<(String, usize)> {
        rows.iter().map(|(key, rows)| (key.clone(), rows.len())).collect()
    };
    let (chip_counts, pc_counts) = (counts(&chip), counts(&pc));
    let differ: Vec<_> = chip_counts.iter().filter(|row| !pc_counts.contains(row)).collect();
    let other: Vec<_> = pc_counts.iter().filter(|row| !chip_counts.contains(row)).collect();
    assert!(
        differ.is_empty() && other.is_empty(),
        "only on the chip: {differ:#?}, only on this PC: {other:#?}"
    );
    if against == Against::Kinds {
        return;
    }
    let (mut all, mut odd) = (0, Vec::new());
    for (a, b) in chip.values().flatten().zip(pc.values().flatten()) {
        all += 1;
        if let Some(what) = difference(a, b) {
            odd.push(what);
        }
    }
    println!("{} of {all} records differ by more than {PART_MAX}: {odd:#?}", odd.len());
    assert!(odd.len() as f64 <= ODD_PART_MAX * f64::from(all), "{} of {all} differ", odd.len());
}

/// In the 1.5 s before the last 1.5 s: no record is before it on one machine and after it on the other.
#[track_caller]
fn quiet_before_the_end_s(records: &[Value]) -> f64 {
    let mut times: Vec<_> = records.iter().filter_map(|record| record["time_boot"].as_f64()).collect();
    times.sort_by(f64::total_cmp);
    let end = times.last().unwrap() - 1.5;
    let near = times.iter().filter(|time| (end - 1.5..=end).contains(*time)).chain([&end]);
    let near: Vec<_> = [end - 1.5].iter().chain(near).copied().collect();
    let pauses = near.windows(2).map(|pair| (pair[1] - pair[0], f64::midpoint(pair[0], pair[1])));
    let (pause, middle) = pauses.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    assert!(pause > 2.0 * TIME_MAX_S, "no quiet moment near the end: {near:?}");
    middle
}

fn of_the_machine(record: &Value) -> &'static [&'static str] {
    OF_THE_MACHINE.iter().find(|(name, _)| record["record"] == *name).map_or(&[], |(_, fields)| fields)
}

fn difference(a: &Value, b: &Value) -> Option<String> {
    let far = |a: &Value, b: &Value, most: f64| match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => (a - b).abs() > most.max(PART_MAX * a.abs().max(b.abs()).max(1.0)),
        _ => a != b,
    };
    if (a["time_boot"].as_f64()? - b["time_boot"].as_f64()?).abs() > TIME_MAX_S {
        return Some(format!("{a} {b}"));
    }
    let skipped = of_the_machine(a);
    for (name, value) in a["fields"].as_object()? {
        let most = if name.ends_with("[s]") { TIME_MAX_S } else { 0.0 };
        if !skipped.contains(&name.as_str()) && far(value, &b["fields"][name], most) {
            return Some(format!("{name} {a} {b}"));
        }
    }
    None
}

#[track_caller]
fn assert_same_stream(of_chip: &[u8], of_pc: &[u8], seeds: &Seeds) {
    const STATUSTEXT: u32 = 253;
    let (chip, pc) = (frames::of_raw(of_chip, seeds), frames::of_raw(of_pc, seeds));
    let bytes: usize = chip.iter().map(|frame| frame.bytes.len()).sum();
    assert_eq!(bytes, of_chip.len(), "bytes that are no frame");
    let texts = |frames: &[Frame<'_>]| -> Vec<String> {
        let texts = frames.iter().filter(|frame| frame.id == STATUSTEXT);
        texts
            .map(|frame| String::from_utf8_lossy(&frame.bytes[10..frame.bytes.len() - 2]).into_owned())
            .collect()
    };
    let (a, b) = (texts(&chip), texts(&pc));
    let same = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    assert!(same == a.len().min(b.len()) && a.len().abs_diff(b.len()) <= 1, "texts: {a:#?} {b:#?}");
    let mut counts = BTreeMap::<u32, [usize; 2]>::new();
    for (which, frames) in [&chip, &pc].into_iter().enumerate() {
        for frame in frames {
            counts.entry(frame.id).or_default()[which] += 1;
        }
    }
    println!("to the ground station: {counts:?}");
    for (id, [chip, pc]) in counts {
        assert!(chip.abs_diff(pc) <= 3 + chip.max(pc) / 50, "message {id}: {chip} and {pc}");
    }
}

/// Take-off at 15 s and the landing at 246 s; between them most of the cruise is cut out.
#[test]
fn a_flight_leaves_the_record_that_this_pc_makes_of_it() {
    const FLIGHT: &str = "px4_hil_quad_low.tlog";
    const CUT_US: std::ops::Range<u64> = 40_000_000..216_000_000;
    let (dir, data) = (tempfile::tempdir().unwrap(), fs::read(own(FLIGHT)).unwrap());
    let frames = chip::frames(&data);
    let begin = frames[0].0;
    let kept = frames.iter().filter(|(us, _)| !CUT_US.contains(&(us - begin)));
    let at = |us: u64| if us - begin < CUT_US.start { us } else { us + CUT_US.start - CUT_US.end };
    let short: Vec<u8> = kept.flat_map(|(us, frame)| [&at(*us).to_be_bytes()[..], frame].concat()).collect();
    let path = dir.path().join(FLIGHT);
    fs::write(&path, short).unwrap();
    the_record_is_the_one_of_this_pc(&path, Manifest::own(), Against::Kinds);
}

#[test]
fn a_signed_flight_is_recorded_bit_for_bit() {
    const BYTES: usize = 300_000;
    let dir = tempfile::tempdir().unwrap();
    let (flight, part) = (own("ap_quad_signed.raw"), dir.path().join("part.raw"));
    let data = fs::read(&flight).unwrap();
    fs::write(&part, &data[..BYTES]).unwrap();
    let manifest = Manifest::own();
    let input = manifest.frames_of(&flight, &data);
    // In a first start one frame may be damaged, and counts as lost.
    let chip = Recording::attempt(Machine::Chip, &part, &CARD_MIB).expect_code(&[0, 3]);
    let lost = chip.number("frames_lost");
    assert!(lost <= 1, "{lost}");
    let log = chip.decode(&[0, 3]);
    let recorded = log.frames(&manifest.seeds);
    assert!(recorded.len() > 3_000, "{} frames", recorded.len());
    let same = input.iter().zip(&recorded).take_while(|(said, heard)| said.bytes == heard.bytes).count();
    let after = same + lost as usize;
    frames::assert_same(&input[after..after + recorded.len() - same], &recorded[same..], &[]);
}

#[test]
#[ignore = "further recordings on the model of the chip (cargo xtask prove chip)"]
fn every_further_recording_leaves_the_record_that_this_pc_makes_of_it() {
    let own = ["ap_quad_faults.tlog", "ap_quad_guided.tlog", "px4_hil_quad_low.tlog"].map(own);
    for file in &own {
        the_record_is_the_one_of_this_pc(file, Manifest::own(), Against::Numbers);
    }
    let files = flights::further();
    let manifest = oracle::manifest(&files);
    for file in files {
        eprintln!("{}", file.display());
        the_record_is_the_one_of_this_pc(&file, &manifest, Against::Numbers);
    }
}

#[test]
fn the_full_line_rate_is_recorded_without_loss() {
    let (mut rig, begin) = ready(Board::default());
    let mut worst = 0.0_f64;
    for second in 1..=4 {
        let before = (rig.machine.core.cycles(), rig.machine.core.slept());
        rig.run(begin + second * SECOND, true).unwrap();
        let slept = (rig.machine.core.slept() - before.1) as f64;
        worst = worst.max(100.0 - 100.0 * slept / (rig.machine.core.cycles() - before.0) as f64);
    }
    rig.run(begin + 8 * SECOND, false).unwrap();
    println!("{worst:.1} % busy in the worst second, modelled");
    assert!(worst < BUSY_PERCENT_MAX, "{worst:.1} % busy");
    assert_eq!(rig.machine.chip.flash.acr(), ACR);
    assert_eq!(rig.machine.chip.dbgmcu[1] & FREEZES_IWDG, FREEZES_IWDG, "APB1_FZ");
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());

    let session = rig.sessions().pop().unwrap();
    assert!(
        session.frames.len() > 7_000 && session.losses.is_empty() && session.gaps == 0,
        "{:?}",
        session.losses
    );
    assert!(session.frames.iter().map(|(_, frame)| frame).eq(rig.sent.iter().map(|(_, frame)| frame)));
    let dir = tempfile::tempdir().unwrap();
    let card = dir.path().join("card.img");
    chip::save(&rig.medium, &card).unwrap();
    assert_verifies(&card);
}
