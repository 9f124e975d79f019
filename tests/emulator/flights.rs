//! Recorded flights, on both machines.

use std::fs;
use std::path::Path;

use hums_tests::fat;
use hums_tests::flights::{self, Manifest, assert_found, own, stream};
use hums_tests::frames;
use hums_tests::oracle;
use hums_tests::program::{Machine, Recording};

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

    let sim_log = Recording::make(Machine::Sim, path, &[]).decode(&[0]);
    let of_sim = sim_log.frames(&manifest.seeds);
    assert_eq!(of_emulated.len(), of_sim.len());
    for (index, (a, b)) in of_emulated.iter().zip(&of_sim).enumerate() {
        assert_eq!(a.bytes, b.bytes, "frame {index} differs between the machines");
        if found.is_tlog {
            assert_eq!(a.time_us, b.time_us, "the time of frame {index} differs between the machines");
        }
    }

    let ground = oracle::ground_station(&emulated.gs());
    assert_eq!(ground["frames"].as_u64(), Some(emulated.number("gs_frames")));
    let heartbeats = ground["heartbeats"].as_object().unwrap();
    assert!(heartbeats.keys().any(|key| key.contains("/191/")), "our heartbeat: {ground}");
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
