//! The ground station gets valid MAVLink, with the vehicle's own heartbeat and ours in it.
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
        // A flight lasts minutes, a heartbeat comes each second.
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
fn the_box_tells_how_it_is_doing_as_an_onboard_computer() {
    let recording = Recording::make(Machine::Sim, &own("ap_quad_guided.tlog"), &["--card-size", "256"]);
    let stream = oracle::ground_station(&recording.gs());
    let told = &stream["computer"];
    let seconds = told["uptime"].as_u64().unwrap() / 1_000;
    let count = told["count"].as_u64().unwrap();
    assert!((seconds / 12..=seconds / 9).contains(&count), "every ten seconds: {count} in {seconds} s");
    let unknown = u32::MAX;
    assert_eq!(told["storage_type"], serde_json::json!([4, unknown, unknown, unknown]), "{told}");
    let (used, total) =
        (told["storage_usage"][0].as_u64().unwrap(), told["storage_total"][0].as_u64().unwrap());
    assert!((240..256).contains(&total) && used <= total, "a card of 256 MiB: {told}");
    assert_eq!((&told["link_type"][0], &told["link_type"][1]), (&0.into(), &1.into()), "{told}");
    let rate = |name: &str, link: usize| told[name][link].as_u64().unwrap();
    // 921,600 and 57,600 baud; 2,000 bytes a second.
    assert_eq!((rate("link_rx_max", 0), rate("link_tx_max", 1)), (90, 6), "{told}");
    assert!(
        (1..=90).contains(&rate("link_rx_rate", 0)) && (1..=2).contains(&rate("link_tx_rate", 1)),
        "{told}"
    );
    for (name, nothing) in [("temperature_board", 127), ("ram_total", unknown), ("ram_usage", unknown)] {
        assert_eq!(told[name], nothing, "{told}");
    }
    assert_eq!(told["cpu_cores"][1], 255, "{told}");
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
