//! `hums due`: what parts have run, and the hours of vehicles.

use std::fs;
use std::process::Command;

use super::support::{attempt, contents, flight, json, recorded, records, run, stderr, text};

#[test]
fn a_manifest_names_each_file_with_its_hash() {
    use sha2::Digest as _;
    let dir = recorded();
    run(dir.path(), "info --verify card.img --manifest made.json", 0);
    let made = fs::read(dir.path().join("made.json")).expect("a manifest");
    let made: serde_json::Value = serde_json::from_slice(&made).expect("JSON");
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let hash = hums::hex::hex(&sha2::Sha256::digest(&image));
    let [input] = made["inputs"].as_array().expect("a list").as_slice() else { panic!("{made}") };
    assert_eq!((&input["file"], &input["sha256"]), (&"card.img".into(), &hash.as_str().into()));
    assert_eq!((&made["logs"][0]["frames"], &made["logs"][0]["lacks"]), (&16_645.into(), &"".into()));
    run(dir.path(), "info --verify card.img --manifest made.json", 1);
    run(dir.path(), "info --verify card.img --manifest made.txt", 0);
    let text = fs::read_to_string(dir.path().join("made.txt")).expect("text");
    assert!(text.contains(&format!("Files read\n{hash}  card.img\n")), "{text}");
    assert!(text.contains("16645 messages; nothing is missing or damaged\n"), "{text}");
    let check = Command::new("sha256sum").current_dir(dir.path()).args(["--check", "made.txt"]).output();
    assert_eq!(String::from_utf8_lossy(&check.expect("coreutils").stdout), "card.img: OK\n");
    run(dir.path(), "info --verify card.img --manifest card.img", 2);
}

#[test]
fn a_tlog_with_findings_has_them_as_texts_of_the_box() {
    let dir = tempfile::tempdir().expect("directory");
    fs::copy(flight("ap_quad_faults.tlog"), dir.path().join("faults.tlog")).expect("a copy");
    run(dir.path(), "decode faults.tlog -o found.tlog --format tlog --findings --manifest made.json", 0);
    let found = fs::read(dir.path().join("found.tlog")).expect("a tlog");
    let all = records(&found);
    // Component 191 of MAVLink 2.
    let is_text = |frame: &[u8]| frame[0] == 0xFD && frame[6] == 191;
    let others: Vec<_> = all.iter().filter(|(_, frame)| !is_text(frame)).map(|(_, frame)| *frame).collect();
    let recording = fs::read(dir.path().join("faults.tlog")).expect("a recording");
    let before = records(&recording);
    assert!(
        others == before.iter().map(|(_, frame)| *frame).collect::<Vec<_>>(),
        "the frames are as they were"
    );
    assert!(all.is_sorted_by_key(|(us, _)| *us), "at their times");
    let text =
        |frame: &[u8]| String::from_utf8_lossy(&frame[11..frame.len() - 2]).trim_end_matches('\0').to_owned();
    let texts: Vec<_> =
        all.iter().filter(|(_, frame)| is_text(frame)).map(|(us, frame)| (*us, text(frame))).collect();
    let (us, _) = texts
        .iter()
        .find(|(_, text)| text == "HUMS: battery 1 cell low: 3.40 V, LAND NOW")
        .expect("it is found");
    assert!(us.abs_diff(before[0].0 + 260_800_000) < 300_000, "{us}");
    let made: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("made.json")).expect("a manifest")).expect("JSON");
    assert_eq!(
        (&made["inputs"][0]["file"], &made["outputs"][0]["file"]),
        (&"faults.tlog".into(), &"found.tlog".into())
    );
}

#[test]
fn a_manifest_names_each_table_of_a_fleet_once() {
    let dir = tempfile::tempdir().expect("directory");
    fs::create_dir(dir.path().join("logs")).expect("a folder");
    run(dir.path(), "decode --format hum PX4 -o logs/whole.hum", 0);
    let whole = fs::read(dir.path().join("logs/whole.hum")).expect("a log");
    fs::write(dir.path().join("logs/half.hum"), &whole[..whole.len() / 1024 * 512]).expect("written");
    let out = dir.path().join("out");
    let line = format!("decode logs -o {} --format parquet --manifest made.json", out.display());
    attempt(dir.path(), &line);
    let made: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("made.json")).expect("a manifest")).expect("JSON");
    let named = made["outputs"].as_array().expect("outputs").iter();
    let mut named: Vec<_> = named.map(|file| file["file"].as_str().expect("a name").to_owned()).collect();
    let tables = contents(&out).into_iter().map(|(name, _)| name).filter(|name| name.ends_with(".parquet"));
    let mut tables: Vec<_> = tables.map(|name| format!("out/{name}")).collect();
    named.sort();
    tables.sort();
    assert!(tables.len() > 5);
    assert_eq!(named, tables);
}

#[test]
fn a_card_says_which_part_is_due_and_what_is_left_of_the_others() {
    let dir = tempfile::tempdir().expect("directory");
    let parts = "CMP1_KIND 1\nCMP1_FLIGHTS 2\nCMP2_KIND 3\nCMP2_NUMBER 3\nCMP2_HOURS 10\nCMP3_KIND 8\n";
    fs::write(dir.path().join("parts.param"), parts).expect("a file");
    let sim = "sim PX4 --sd card.img --store store.bin --params parts.param";
    run(dir.path(), sim, 0);
    let told = text(&run(dir.path(), "due card.img", 0));
    assert!(told.contains("airframe") && told.contains("1 of 2 flights"), "{told}");
    run(dir.path(), sim, 0);
    let told = text(&run(dir.path(), "due card.img", 4));
    let line = |words: &str| told.lines().find(|line| line.contains(words)).expect(words);
    assert!(
        line("2 of 2 flights").starts_with("  DUE ") && line("2 of 2 flights").contains("due now"),
        "{told}"
    );
    line("  once replaced or serviced: hums box replaced airframe --serial SERIAL --link SRC, or --card DIR");
    assert!(line("motor 3").contains("of 10 h in the air") && line("motor 3").contains(" flights"), "{told}");
    assert!(line("other").contains("no limit"), "{told}");
    let vehicle = json(&run(dir.path(), "due card.img --json", 4))["vehicles"][0].clone();
    assert_eq!((&vehicle["logs"], &vehicle["flights"]), (&2.into(), &2.into()), "{vehicle}");
    let motor = &vehicle["parts"][1];
    let [run_h, left_h, flights] =
        ["run", "left", "left_flights"].map(|name| motor[name].as_f64().expect("a number"));
    assert!((run_h + left_h - 10.0).abs() < 1e-6 && (flights - left_h / run_h * 2.0).abs() < 1.0, "{motor}");
    assert_eq!(motor["rule"], "CMP2_HOURS");
}

#[test]
fn the_newest_log_of_a_card_is_the_last_one_whatever_its_clock_says() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("parts.param"), "CMP1_KIND 1\nCMP1_FLIGHTS 9\n").expect("a file");
    for name in ["ap_quad_faults.tlog", "ap_quad_guided.tlog"] {
        let flight = flight(name).display().to_string();
        run(dir.path(), &format!("sim {flight} --sd card.img --store store.bin --params parts.param"), 0);
    }
    let vehicle = json(&run(dir.path(), "due card.img --json", 0))["vehicles"][0].clone();
    assert_eq!((&vehicle["logs"], &vehicle["parts"][0]["run"]), (&2.into(), &2.0.into()), "{vehicle}");
    assert_eq!(vehicle["parts"][0]["since_utc"], serde_json::Value::Null, "one clock is wrong: {vehicle}");
    let logs = json(&run(dir.path(), "info --list card.img --json", 0));
    let names = [0, 1].map(|log| logs["logs"][log]["name"].as_str().unwrap_or_default().to_owned());
    assert_eq!(names, ["00001", "00002"], "{logs}");
    run(dir.path(), "logbook card.img -o book.html", 0);
    let book = fs::read_to_string(dir.path().join("book.html")).expect("a page");
    assert!(book.contains("22 %") && !book.contains("11 %"), "two of nine: {book}");
}

#[test]
fn logs_without_an_id_are_of_the_vehicle_of_their_folder_or_of_the_one_that_is_named() {
    let dir = tempfile::tempdir().expect("directory");
    for (folder, name) in
        [("red", "ap_quad_faults.tlog"), ("red", "ap_quad_guided.tlog"), ("blue", "ap_quad_guided.tlog")]
    {
        fs::create_dir_all(dir.path().join(folder)).expect("a folder");
        fs::copy(flight(name), dir.path().join(folder).join(name)).expect("a copy");
    }
    // Equal bytes are one flight.
    let blue = dir.path().join("blue/ap_quad_guided.tlog");
    let whole = fs::read(&blue).expect("a recording");
    let last = records(&whole).last().map_or(0, |(_, frame)| 8 + frame.len());
    fs::write(&blue, &whole[..whole.len() - last]).expect("written");
    fs::copy(&blue, dir.path().join("blue/again.tlog")).expect("a copy");
    let vehicles = |line: &str| {
        let told = json(&run(dir.path(), line, 0));
        let vehicles = told["vehicles"].as_array().expect("a list").clone();
        let of = |vehicle: &serde_json::Value| {
            let name = vehicle["vehicle"]
                .as_str()
                .expect("a name")
                .rsplit('/')
                .next()
                .unwrap_or_default()
                .to_owned();
            (
                name,
                vehicle["logs"].as_u64().expect("a number"),
                vehicle["flight_s"].as_f64().expect("a number"),
            )
        };
        vehicles.iter().map(of).collect::<Vec<_>>()
    };
    let by_folder = vehicles("due . --json");
    let [(blue, 1, blue_s), (red, 2, red_s)] = by_folder.as_slice() else { panic!("{by_folder:?}") };
    assert!(blue.starts_with("blue, quadrotor, ") && red.starts_with("red, quadrotor, "), "{by_folder:?}");
    assert!((210.0..225.0).contains(blue_s) && (515.0..535.0).contains(red_s), "{by_folder:?}");
    let named = vehicles("due . --json --vehicle mine");
    let [(name, 3, all_s)] = named.as_slice() else { panic!("{named:?}") };
    assert!(name == "mine" && (all_s - blue_s - red_s).abs() < 1e-6, "{named:?}");
    let listed = json(&run(dir.path(), "info --list . --json", 0));
    assert_eq!(listed["logs"].as_array().map(Vec::len), Some(3), "{listed}");
    let checked = text(&run(dir.path(), "check .", 4));
    assert!(checked.contains("3 logs checked"), "{checked}");
    fs::create_dir(dir.path().join("empty")).expect("a folder");
    for input in ["empty", "nothere.tlog"] {
        for command in ["due", "check", "info --list"] {
            let said = run(dir.path(), &format!("{command} red {input} blue"), 1);
            let told = stderr(&said);
            assert!(!text(&said).is_empty() && told.contains(&format!("{input}: ")), "{command}: {told}");
        }
    }
}

#[test]
fn a_shared_copy_says_how_many_of_how_many_were_removed() {
    let dir = tempfile::tempdir().expect("directory");
    fs::create_dir(dir.path().join("logs")).expect("a folder");
    fs::copy(flight("ap_quad_guided.tlog"), dir.path().join("logs/flown.tlog")).expect("copied");
    fs::write(dir.path().join("logs/notes.txt"), "windy").expect("written");
    let said = run(dir.path(), "share logs -o shared.tlog", 0);
    let (told, remarks) = (text(&said), String::from_utf8_lossy(&said.stderr));
    assert!(remarks.contains("logs: 1 file passed over"), "{remarks}");
    let lines = told.lines().filter_map(|line| line.strip_prefix("removed: "));
    let removed: Vec<(u64, u64, &str)> = lines
        .map(|line| {
            let (part, rest) = line.split_once(" of ").expect("a part");
            let (all, what) = rest.split_once(' ').expect("of what");
            (part.parse().expect("a number"), all.parse().expect("a number"), what)
        })
        .collect();
    assert!(removed.iter().all(|(part, all, _)| (1..=*all).contains(part)), "{told}");
    assert!(removed.iter().any(|(part, all, what)| *what == "STATUSTEXT" && part < all), "{told}");
    assert!(removed.iter().any(|(.., what)| what.contains('.')), "a field: {told}");
}

/// A manifest says of a recording of another program what the list says.
#[test]
fn a_manifest_says_what_a_damaged_recording_lacks() {
    let dir = tempfile::tempdir().expect("directory");
    let whole = fs::read(flight("ap_quad_guided.tlog")).expect("a recording");
    fs::create_dir(dir.path().join("logs")).expect("a folder");
    let (first, last) = whole.split_at(whole.len() / 2);
    fs::write(dir.path().join("logs/noisy.tlog"), [first, &[0x55; 3000], last].concat()).expect("written");
    fs::write(dir.path().join("logs/whole.tlog"), &whole).expect("written");
    let listed = text(&attempt(dir.path(), "info --list logs"));
    attempt(dir.path(), "decode logs -o out --format jsonl --manifest made.json");
    let made: serde_json::Value =
        serde_json::from_slice(&fs::read(dir.path().join("made.json")).expect("a manifest")).expect("JSON");
    let lacks = |log: usize| made["logs"][log]["lacks"].as_str().expect("words");
    assert!(!lacks(0).is_empty() && listed.contains(lacks(0)), "{made} {listed}");
    assert_eq!((lacks(1), &made["inputs"][0]["file"]), ("", &"logs/noisy.tlog".into()));
    let log = &made["logs"][1];
    let session = log["session"].as_str().is_some_and(|session| session.starts_with('r'));
    assert!(session && log["frames"].as_u64() > Some(50_000) && log["gaps"] == 0, "{log}");
    assert!(made["logs"][0]["gaps"].as_u64() > Some(0), "{made}");
}
