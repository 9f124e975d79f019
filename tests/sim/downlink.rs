//! What the ground station gets is good MAVLink, with the vehicle's own heartbeat and ours in it.
#![cfg(feature = "oracle")]

use hums_tests::flights::{self, OWN, own};
use hums_tests::oracle;
use hums_tests::program::{Machine, Recording};

/// Our own component id on the vehicle: `MAV_COMP_ID_ONBOARD_COMPUTER`.
const OURS: &str = "/191/";

#[test]
fn the_stream_of_each_flight_parses_without_one_bad_frame() {
    for name in OWN {
        let recording = Recording::make(Machine::Sim, &own(name), &[]);
        let stream = oracle::ground_station(&recording.gs());
        let heartbeats = stream["heartbeats"].as_object().unwrap();
        let of = |wanted: fn(&str) -> bool| -> u64 {
            heartbeats.iter().filter(|(key, _)| wanted(key)).filter_map(|(_, count)| count.as_u64()).sum()
        };
        // A flight is minutes long and a heartbeat comes each second.
        assert!(of(|key| key.contains(OURS)) > 100, "{name}: our heartbeats: {stream}");
        // Autopilot 3 is ArduPilot, 12 is PX4.
        let vehicle = |key: &str| key.contains("/1/3/") || key.contains("/1/12/");
        assert!(of(vehicle) > 100, "{name}: the vehicle's heartbeats: {stream}");
        assert_eq!(stream["sequence_gaps"], 0, "{name}: our own frames are numbered without a gap");
        assert_eq!(stream["frames"].as_u64(), Some(recording.number("gs_frames")), "{name}");
        assert_eq!(std::fs::metadata(recording.gs()).unwrap().len(), recording.number("gs_bytes"), "{name}");
    }
}

#[test]
#[ignore = "further recordings (HUMS_FLIGHTS names no folder of them)"]
fn the_stream_of_each_further_recording_parses_without_one_bad_frame() {
    for file in flights::further() {
        let recording = Recording::make(Machine::Sim, &file, &[]);
        let stream = oracle::ground_station(&recording.gs());
        assert_eq!(stream["frames"].as_u64(), Some(recording.number("gs_frames")), "{}", file.display());
    }
}

#[test]
fn noise_at_the_autopilots_port_puts_no_bad_frame_on_the_ground_stations() {
    let recording =
        Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--noise", "0.005", "--seed", "3"]);
    let stream = oracle::ground_station(&recording.gs());
    assert!(stream["frames"].as_u64() > Some(100), "{stream}");
}
