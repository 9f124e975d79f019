//! Counters and parameters outlive a power cut at any word of the store.

use std::fs;
use std::path::Path;

use hums_core::usage::UsageCounter;
use hums_tests::child;
use hums_tests::damage::Random;
use hums_tests::flights::{Manifest, own};
use hums_tests::frames::build_v2;
use hums_tests::program::{self, Machine, Recording, command, hums, hums_with};
use hums_tests::store::Stored;

const FLIGHT: &str = "px4_hil_quad_low.tlog";

fn fly(store: &Path, flags: &[&str]) -> Recording {
    let flags = [&["--store", store.to_str().unwrap()][..], flags].concat();
    Recording::attempt(Machine::Sim, &own(FLIGHT), &flags)
}

fn flown(store: &Path) {
    let _ = fly(store, &[]).expect_code(&[0]);
}

#[test]
fn two_flights_add_up_in_the_store_whatever_card_is_in_the_slot() {
    let dir = tempfile::tempdir().unwrap();
    let store = dir.path().join("store.bin");
    let once = {
        flown(&store);
        *Stored::read(&store).lifetime()
    };
    flown(&store);
    let twice = *Stored::read(&store).lifetime();
    assert_eq!((once.boots, twice.boots), (1, 2));
    assert_eq!((once.sessions, twice.sessions), (1, 2));
    for counter in [UsageCounter::Flights, UsageCounter::Flight, UsageCounter::Distance, UsageCounter::Energy]
    {
        let (once, twice) = (once.totals.raw(counter), twice.totals.raw(counter));
        assert!(once > 0.9, "{}: {once}", counter.name());
        assert!((twice - 2.0 * once).abs() < 0.11, "{}: {once}, then {twice}", counter.name());
    }
    let [once, twice] = [once, twice].map(|lifetime| lifetime.totals.raw(UsageCounter::HeightMax).to_bits());
    assert_eq!(once, twice, "a maximum is no sum");
}

#[test]
fn a_run_without_a_store_begins_anew() {
    let recording = Recording::make(Machine::Sim, &own(FLIGHT), &[]);
    assert!(records(&recording.image()).contains("the store is new"));
}

#[test]
fn whatever_word_of_the_store_power_goes_at_the_counters_are_the_old_or_the_new_ones() {
    let dir = tempfile::tempdir().unwrap();
    let store = dir.path().join("store.bin");
    flown(&store);
    let mut random = Random::new(4);
    let mut cuts = 0;
    for cut in 0..16 {
        let before = *Stored::read(&store).lifetime();
        // A flight writes some 400 words; a later cut is never met.
        let at = (1 + random.below(500)).to_string();
        let flags = ["--cut-store-after", &at, "--seed", &cut.to_string()];
        let recording = fly(&store, &flags).expect_code(&[0, 3]);
        let was_cut = recording.json()["power_cut"] == true;
        cuts += u32::from(was_cut);
        let after = *Stored::read(&store).lifetime();
        assert!(
            after == before || after.boots == before.boots + 1,
            "cut at {at}: {before:?}, then {after:?}"
        );
        assert!(was_cut || after.boots == before.boots + 1, "{at}");
        let flights = |lifetime: &hums_core::lifetime::Lifetime| lifetime.totals.raw(UsageCounter::Flights);
        let more = flights(&after) - flights(&before);
        assert!((0.0..=1.0).contains(&more), "cut at {at}: {more} flights more");
    }
    assert!(cuts >= 8, "{cuts} of 16 cuts were met");
}

fn time_s(line: &str) -> f64 {
    let entry: serde_json::Value = serde_json::from_str(line).unwrap();
    entry["time_boot"].as_f64().unwrap_or_default()
}

#[test]
fn power_that_goes_at_any_moment_of_a_flight_costs_two_minutes_of_it_at_most() {
    let dir = tempfile::tempdir().unwrap();
    let mut random = Random::new(11);
    let mut cuts_in_flight = 0;
    for (flight, blocks) in [("ap_quad_faults.tlog", 2_800), (FLIGHT, 1_900)] {
        for cut in 0..6 {
            let store = dir.path().join(format!("{flight}.{cut}"));
            let at = (100 + random.below(blocks)).to_string();
            let flags = ["--store", store.to_str().unwrap(), "--cut-after-writes", &at];
            let recording = Recording::attempt(Machine::Sim, &own(flight), &flags).expect_code(&[0, 3]);
            let text = records(&recording.image());
            let event =
                |name: &str| text.lines().find(|line| line.contains("HUMS_EVENT") && line.contains(name));
            let Some(take_off_s) = event("\"take_off\"").map(time_s) else { continue };
            let end_s =
                event("\"landing\",\"text\":\"\"").or_else(|| text.lines().last()).map(time_s).unwrap();
            cuts_in_flight += u32::from(event("\"landing\",\"text\":\"\"").is_none());
            let kept = Stored::read(&store);
            let lifetime = kept.lifetime.unwrap_or_default();
            let kept_s = lifetime.totals.raw(UsageCounter::Flight);
            let flown_s = end_s - take_off_s;
            // The record may be a second behind, a take-off half a second late.
            assert!(
                (flown_s - 121.0..flown_s + 2.0).contains(&kept_s),
                "{flight}, cut at {at}: {kept_s} s of {flown_s} s are kept"
            );
        }
    }
    assert!(cuts_in_flight >= 5, "{cuts_in_flight}");
}

#[test]
fn components_wear_from_flight_to_flight_until_they_are_due_and_info_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let (store, file) = (dir.path().join("store.bin"), dir.path().join("hums.param"));
    // The airframe is due after 504 s, a flight takes 232 s; motor 2 has hours to spare.
    let text = "CMP1_KIND 1\nCMP1_HOURS 0.14\nCMP2_KIND 3\nCMP2_NUMBER 2\nCMP2_MOT_HOURS 100\n";
    fs::write(&file, text).unwrap();
    let mut seen = Vec::new();
    for _ in 0..3 {
        let recording = fly(&store, &["--params", file.to_str().unwrap()]).expect_code(&[0]);
        let info = hums_with("info {} --json", &[&recording.image()]).expect_code(&[0]);
        let info: serde_json::Value = serde_json::from_str(&info.text()).unwrap();
        let components = info.to_string();
        let status = |place: u64| component_status(&info, place).unwrap_or_else(|| panic!("{components}"));
        let due = recording.json()["findings"].to_string().contains("airframe_due");
        seen.push((status(1), status(2), due));
    }
    let expected = [("green", "green", false), ("yellow", "green", true), ("red", "green", true)];
    assert_eq!(seen, expected.map(|(first, second, due)| (first.to_owned(), second.to_owned(), due)));
}

#[test]
fn a_component_that_a_command_says_is_replaced_begins_anew_and_that_is_recorded() {
    const COMMAND_LONG: u32 = 76;
    const HEARTBEAT: u32 = 0;
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    fs::write(path("hums.param"), "CMP1_KIND 1\nCMP1_FLIGHTS 10\n").unwrap();
    let params = ["--params".to_owned(), path("hums.param").display().to_string()];
    let flags = |more: [String; 2]| -> Vec<String> { params.iter().cloned().chain(more).collect() };
    // USER_1, component 1: once in flight, once after the disarming at 248.7 s.
    let mut command = [1.0_f32.to_le_bytes(), [0; 4]].concat();
    command.resize(28, 0);
    command.extend([0x22, 0x79, 1, 191, 0]);
    let seeds = &Manifest::own().seeds;
    let entry = |second: u64, id: u32, payload: &[u8]| {
        let time_us = 1_700_000_000_000_000 + second * 1_000_000;
        [&time_us.to_be_bytes()[..], &build_v2(second as u8, id, payload, seeds[&id])].concat()
    };
    let said: Vec<Vec<u8>> = (0..260)
        .flat_map(|second| {
            let asked = [100, 250].contains(&second).then(|| entry(second, COMMAND_LONG, &command));
            [Some(entry(second, HEARTBEAT, &[0, 0, 0, 0, 6, 8, 0, 4, 3])), asked]
        })
        .flatten()
        .collect();
    fs::write(path("gs.tlog"), said.concat()).unwrap();
    let store = path("store.bin");
    let run = |more: [String; 2]| {
        let flags = flags(more);
        let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
        fly(&store, &flags).expect_code(&[0])
    };
    let recording = run(["--gs-input".into(), path("gs.tlog").display().to_string()]);
    let text = records(&recording.image());
    let replaced: Vec<&str> = text
        .lines()
        .filter(|line| {
            line.contains("\"replaced\"")
                && line.contains("HUMS_COMPONENT")
                && line.contains("\"why\":\"replaced\"")
        })
        .collect();
    assert_eq!(replaced.len(), 1, "once, and not in flight: {replaced:?}");
    assert!(time_s(replaced[0]) > 249.0, "{}", replaced[0]);
    let fields = serde_json::from_str::<serde_json::Value>(replaced[0]).unwrap()["fields"].clone();
    assert_eq!(fields["flights"].as_f64(), Some(1.0), "what the old one had run: {fields}");
    let recording = run(["--seed".into(), "1".into()]);
    let info = hums_with("info {} --json", &[&recording.image()]).expect_code(&[0]);
    let info: serde_json::Value = serde_json::from_str(&info.text()).unwrap();
    let component = &info["logs"][0]["components"][0];
    assert_eq!(
        (component["flights"].as_f64(), component["replaced"].as_u64()),
        (Some(1.0), Some(1)),
        "{component}"
    );
}

fn component_status(info: &serde_json::Value, place: u64) -> Option<String> {
    match info {
        serde_json::Value::Object(fields) => {
            let status = fields.get("status").and_then(|status| status.as_str());
            match (fields.get("place").and_then(serde_json::Value::as_u64), status) {
                (Some(found), Some(status)) if found == place => Some(status.to_owned()),
                _ => fields.values().find_map(|value| component_status(value, place)),
            }
        }
        serde_json::Value::Array(values) => {
            values.iter().rev().find_map(|value| component_status(value, place))
        }
        _ => None,
    }
}

#[test]
fn parameters_that_were_set_once_stay() {
    let dir = tempfile::tempdir().unwrap();
    let (store, file) = (dir.path().join("store.bin"), dir.path().join("hums.param"));
    fs::write(&file, "# lipo\nCELL_VOLT_WARN,3.9\nGS_BUDGET 1000\n").unwrap();
    let warned = |recording: &Recording| recording.json()["findings"].to_string().contains("cell_voltage");
    assert!(!warned(&Recording::make(Machine::Sim, &own(FLIGHT), &[])), "the default does not warn");
    let first = fly(&store, &["--params", file.to_str().unwrap()]).expect_code(&[0]);
    assert!(warned(&first));
    assert_eq!(Stored::read(&store).params, [("CELL_VOLT_WARN".into(), 3.9), ("GS_BUDGET".into(), 1000.0)]);
    assert!(warned(&fly(&store, &[]).expect_code(&[0])), "also without the file");
}

#[test]
fn a_parameter_file_that_is_wrong_is_told_with_line_and_range_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let (file, image) = (dir.path().join("hums.param"), dir.path().join("card.img"));
    for (text, why) in [
        ("\nNO_SUCH 1\n", "line 2: there is no parameter NO_SUCH"),
        ("CELL_VOLT_WARN 3.6\nCELL_VOLT_CRIT,12\n", "line 2: CELL_VOLT_CRIT takes 0 to 4.5 V, not 12"),
        ("CELL_VOLT_WARN\n", "line 1: wants NAME VALUE"),
        ("VIBE_WARN x\n", "line 1: VIBE_WARN takes "),
        ("VIBE_WARN 1 2\n", "line 1: wants NAME VALUE"),
    ] {
        fs::write(&file, text).unwrap();
        for flags in [&[][..], &["--firmware", "hums.elf"]] {
            let mut sim = command(["sim"]);
            sim.arg(own(FLIGHT)).arg("--sd").arg(&image).arg("--params").arg(&file).args(flags);
            let outcome = child::run(&mut sim, program::LIMIT).expect_code(&[1, 2]);
            assert!(outcome.stderr.contains(why), "{}", outcome.stderr);
        }
        assert!(!image.exists());
    }
}

fn records(image: &Path) -> String {
    let jsonl = ["-o", "-", "--format", "jsonl"].map(AsRef::as_ref);
    hums(["decode".as_ref(), image.as_os_str()].into_iter().chain(jsonl)).expect_code(&[0, 3]).text()
}
