//! Recorded flights, on both machines.

use std::fs;
use std::path::Path;

use hums_tests::fat;
use hums_tests::flights::{self, Manifest, assert_found, own, stream};
use hums_tests::frames;
use hums_tests::oracle;
use hums_tests::program::{Machine, Recording};
use serde_json::Value;

/// Records that tell the machine itself, and which of their fields do: who it is, how busy it is, and how far its card has come.
/// Each other field, and each other record, is the same on both machines.
const OF_THE_MACHINE: [(&str, &[&str]); 3] = [
    // How many bytes the figures of HUMS_STATS take in the log differs, and with it where a sector ends.
    ("HUMS_MARK", &["sector"]),
    ("HUMS_BOOT", &["board", "uid", "reset", "reset_name", "git"]),
    (
        "HUMS_STATS",
        &[
            "bytes_logged",
            "blocks_written",
            "queue_bytes_max",
            "sd_stall_ms_max",
            "frame_queue_bytes_max",
            "gs_queue_bytes_max",
            "cpu_permille",
            "cpu_permille_max",
            "stack_bytes_max",
            "stack_bytes_capacity",
        ],
    ),
];
/// Values to the ground station that tell the same.
const VALUES_OF_THE_MACHINE: [&str; 3] = ["STACK_PCT", "SD_STALL_S", "CPU_PCT"];
const NAMED_VALUE_FLOAT: u32 = 251;

/// Records one flight on both machines and compares them with the recording and with each other.
#[track_caller]
fn both_machines_agree(path: &Path, manifest: &Manifest) {
    let data = fs::read(path).unwrap();
    let input = manifest.frames_of(path, &data);
    let found = manifest.found(path);

    let emulated = Recording::make(Machine::Emulated, path, &[]);
    let emulated_log = emulated.decode(&[0]);
    let of_emulated = emulated_log.frames(&manifest.seeds);
    frames::assert_same(&input, &of_emulated, &stream(found.is_tlog, &data, &input));
    assert_found(found, &of_emulated);
    assert_eq!(emulated.number("frames_lost"), 0);
    assert_eq!(emulated.number("frames_logged"), of_emulated.len() as u64);
    fat::assert_clean(&emulated.image());

    let sim = Recording::make(Machine::Sim, path, &[]);
    let sim_log = sim.decode(&[0]);
    let of_sim = sim_log.frames(&manifest.seeds);
    assert_eq!(of_emulated.len(), of_sim.len());
    for (index, (a, b)) in of_emulated.iter().zip(&of_sim).enumerate() {
        assert_eq!(a.bytes, b.bytes, "frame {index} differs between the machines");
        assert_eq!(a.time_us, b.time_us, "the time of frame {index} differs between the machines");
    }
    assert_same_records(&emulated.records(), &sim.records());
    assert_same_stream(&fs::read(emulated.gs()).unwrap(), &fs::read(sim.gs()).unwrap(), &manifest.seeds);

    let ground = oracle::ground_station(&emulated.gs());
    assert_eq!(ground["frames"].as_u64(), Some(emulated.number("gs_frames")));
    let heartbeats = ground["heartbeats"].as_object().unwrap();
    assert!(heartbeats.keys().any(|key| key.contains("/191/")), "our heartbeat: {ground}");
}

/// The records of both machines are the same ones, at the same times, but for what tells the machine itself.
#[track_caller]
fn assert_same_records(emulated: &[Value], sim: &[Value]) {
    let without = |record: &Value| {
        let mut record = record.clone();
        let of_machine = OF_THE_MACHINE.iter().find(|(name, _)| record["record"] == *name);
        for field in of_machine.map_or(&[][..], |(_, fields)| fields) {
            let old = record["fields"].as_object_mut().and_then(|fields| fields.remove(*field));
            assert!(old.is_some(), "{field} is no field of {record}");
        }
        record
    };
    assert!(emulated.len() > 50, "{} records", emulated.len());
    for (index, (a, b)) in emulated.iter().zip(sim).enumerate() {
        assert_eq!(without(a), without(b), "record {index} differs between the machines");
    }
    assert_eq!(emulated.len(), sim.len(), "records");
}

/// What goes to the ground station is the same on both machines, byte for byte, but for the values that tell the machine
/// itself.
#[track_caller]
fn assert_same_stream(emulated: &[u8], sim: &[u8], seeds: &frames::Seeds) {
    let (of_emulated, of_sim) = (frames::of_raw(emulated, seeds), frames::of_raw(sim, seeds));
    let name = |frame: &frames::Frame<'_>| {
        // Zeros at the end of a payload are not sent.
        let end = 10 + usize::from(*frame.bytes.get(1)?);
        let name = frame.bytes.get(18..end).filter(|_| frame.id == NAMED_VALUE_FLOAT)?;
        Some(String::from_utf8_lossy(name).trim_end_matches('\0').to_owned())
    };
    let mut of_machine = 0;
    for (index, (a, b)) in of_emulated.iter().zip(&of_sim).enumerate() {
        if a.bytes != b.bytes {
            let (name_a, name_b) = (name(a), name(b));
            assert!(
                name_a == name_b
                    && name_a.as_ref().is_some_and(|name| VALUES_OF_THE_MACHINE.contains(&&**name)),
                "frame {index} to the ground station differs between the machines: {name_a:?} {:02x?}, {name_b:?} {:02x?}",
                a.bytes,
                b.bytes
            );
            // All but the value and the checksum.
            assert_eq!(
                (&a.bytes[..14], &a.bytes[18..20]),
                (&b.bytes[..14], &b.bytes[18..20]),
                "frame {index}"
            );
            of_machine += 1;
        }
    }
    assert_eq!(of_emulated.len(), of_sim.len(), "frames to the ground station");
    let bytes: usize = of_emulated.iter().map(|frame| frame.bytes.len()).sum();
    assert_eq!(bytes, emulated.len(), "bytes that are no frame");
    assert!(of_machine * 20 < of_emulated.len(), "{of_machine} of {} frames differ", of_emulated.len());
}

#[test]
fn an_ardupilot_flight_is_the_same_on_both_machines() {
    both_machines_agree(&own("ap_quad_guided.tlog"), Manifest::own());
}

#[test]
fn a_signed_ardupilot_flight_is_the_same_on_both_machines() {
    both_machines_agree(&own("ap_quad_signed.raw"), Manifest::own());
}

#[test]
fn an_ardupilot_flight_with_faults_is_the_same_on_both_machines() {
    both_machines_agree(&own("ap_quad_faults.tlog"), Manifest::own());
}

#[test]
fn a_px4_flight_is_the_same_on_both_machines() {
    both_machines_agree(&own("px4_hil_quad_low.tlog"), Manifest::own());
}

#[test]
#[ignore = "further recordings in the emulator (cargo xtask prove emulator)"]
fn every_further_recording_is_the_same_on_both_machines() {
    let files = flights::further();
    let manifest = oracle::manifest(&files);
    for file in files {
        eprintln!("{}", file.display());
        both_machines_agree(&file, &manifest);
    }
}
