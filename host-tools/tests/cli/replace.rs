//! Existing files stay, and two sessions are never mixed.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::CommandFactory as _;
use clap::builder::PossibleValue;
use flate2::Compression;
use flate2::write::GzEncoder;
use hums::cli::Cli;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use tempfile::TempDir;

use crate::inputs::{leaves, value, words};
use crate::support::{
    all_named, attempt, contents, end_of, flight, frames_of, furnished, named, px4, run, stamps, stderr, text,
};

fn two_cards() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for (name, recording) in [("c1", "px4_hil_quad_low.tlog"), ("c2", "ap_quad_guided.tlog")] {
        let recording = end_of(recording, dir.path());
        let code = attempt(dir.path(), &format!("sim {} --sd {name}.img", recording.display()));
        assert!(code.status.success(), "{name}");
    }
    dir
}

fn parquet_sessions(fleet: &Path) -> Vec<PathBuf> {
    let mut sessions: Vec<PathBuf> = contents(fleet)
        .into_iter()
        .filter_map(|(name, _)| name.strip_prefix("HEARTBEAT/").map(PathBuf::from))
        .collect();
    sessions.sort();
    sessions
}

#[test]
fn two_cards_decoded_into_one_folder_stay_apart() {
    let dir = two_cards();
    let formats = "--format tlog,csv,parquet,thesis,jsonl,influx";
    for card in ["c1", "c2"] {
        run(dir.path(), &format!("decode {card}.img -o one_by_one {formats}"), 0);
        run(dir.path(), &format!("decode {card}.img -o {card} --format tlog,csv"), 0);
    }
    run(dir.path(), &format!("decode c1.img c2.img -o at_once {formats}"), 0);
    for folder in ["one_by_one", "at_once"] {
        let folder = dir.path().join(folder);
        assert_eq!(all_named(&folder, "00001").len(), 2, "{}", folder.display());
        assert_eq!(parquet_sessions(&folder).len(), 2, "{}", folder.display());
        for (card, recording) in [("c1", "px4_hil_quad_low.tlog"), ("c2", "ap_quad_guided.tlog")] {
            let alone = dir.path().join(card);
            let name = named(&alone, "00001");
            assert_eq!(
                frames_of(&folder.join(format!("{name}.tlog"))),
                frames_of(&dir.path().join(recording))
            );
            assert_eq!(
                contents(&folder.join(&name)),
                contents(&alone.join(&name)),
                "{card}: tables of one card"
            );
        }
    }
    assert_eq!(contents(&dir.path().join("one_by_one")), contents(&dir.path().join("at_once")));
}

fn whole_and_cut() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for folder in ["whole", "cut", "one"] {
        fs::create_dir(dir.path().join(folder)).expect("a directory");
    }
    run(dir.path(), "decode --format hum PX4 -o whole/log.hum", 0);
    let log = fs::read(dir.path().join("whole/log.hum")).expect("a log");
    fs::write(dir.path().join("cut/log.hum"), &log[..log.len() / 1024 * 512]).expect("written");
    dir
}

#[test]
fn an_output_that_exists_is_overwritten_with_force_only_by_every_format() {
    let dir = whole_and_cut();
    let out = dir.path().join("out");
    for line in ["decode LOG -o out --format tlog,jsonl,influx,csv,thesis", "report LOG -o out/"] {
        let line =
            |log: &str, more: &str| format!("{} {more}", line.replace("LOG", &format!("{log}/log.hum")));
        run(dir.path(), &line("whole", ""), 0);
        let made = contents(&out);
        let refused = |line: &str| {
            let said = stderr(&run(dir.path(), line, 1));
            assert!(said.contains("exists, and was not overwritten") && said.contains("--force"), "{said}");
            assert!(contents(&out) == made, "{line} changed something");
        };
        refused(&line("cut", ""));
        refused(&line("whole", ""));
        for format in ["tlog", "jsonl", "influx", "csv", "thesis"] {
            if line("", "").starts_with("decode") {
                refused(&format!("decode cut/log.hum -o out --format {format}"));
            }
        }
        run(dir.path(), &line("cut", "--force"), 3);
        assert!(contents(&out) != made);
        run(dir.path(), &line("whole", "--force"), 0);
        assert!(contents(&out) == made, "a table of the part is left");
        fs::remove_dir_all(&out).expect("removed");
    }
    run(dir.path(), "decode cut/log.hum -o fleet --format parquet", 3);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet", 0);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet --force", 0);
    let fleet = dir.path().join("fleet");
    let before = contents(&fleet);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet --message ATTITUDE", 0);
    assert!(contents(&fleet) == before);
    assert_eq!(parquet_sessions(&fleet).len(), 1);
}

#[test]
fn every_command_with_the_flag_makes_the_same_again_with_it() {
    let mut root = Cli::command();
    root.build();
    let mut commands = Vec::new();
    leaves(&root, &[], &mut commands);
    let mut tried = Vec::new();
    for (command, path) in &commands {
        let of = |name: &str| command.get_arguments().find(|arg| arg.get_id() == name);
        if of("force").is_none() {
            continue;
        }
        let output = of("output").expect("what it writes");
        let dir = furnished();
        let out = dir.path().join("new");
        let file = format!("new/{}", value(path[0], "output"));
        let name = if of("format").is_some() { "new/".to_owned() } else { file };
        fs::create_dir(&out).expect("made");
        let mut given = vec![(output, name)];
        given.extend(of("format").map(|arg| {
            let all = arg.get_possible_values();
            // A log is written alone.
            let names = all.iter().map(PossibleValue::get_name).filter(|name| *name != "hum");
            (arg, names.collect::<Vec<_>>().join(","))
        }));
        let line = words(command, path, &given).join(" ");
        run(dir.path(), &line, 0);
        let made = contents(&out);
        let said = run(dir.path(), &line, 1);
        assert!(contents(&out) == made, "{line}");
        assert!(String::from_utf8_lossy(&said.stderr).contains("or say --force"));
        run(dir.path(), &format!("{line} --force"), 0);
        assert!(contents(&out) == made, "{line}");
        tried.push(path[0]);
    }
    assert_eq!(tried, ["report", "decode", "share", "logbook", "box"]);
}

#[test]
fn a_slip_in_the_name_of_an_output_costs_no_recording() {
    let dir = furnished();
    run(dir.path(), "sim PX4 --sd card.img --card-size 64", 0);
    let at = |name: &str| dir.path().join(name);
    fs::write(at("thesis.txt"), "months of work").expect("written");
    fs::write(at("gs"), frames_of(&px4())[..50].concat()).expect("written");
    let before = stamps(dir.path());
    let names = ["card.img", "thesis.txt", "hums.elf", "flight.tlog", "gs", "log.hum"];
    for line in [
        "decode folder/log.hum -o OUT --format tlog",
        "report folder/log.hum -o OUT",
        "decode --format hum folder/flight.tlog -o OUT",
        "sim folder/flight.tlog --sd new.img --gs OUT",
        "sim folder/flight.tlog --sd new.img --tap OUT",
    ] {
        for name in names {
            let line = line.replace("OUT", name);
            let said = run(dir.path(), &line, 1);
            assert!(stamps(dir.path()) == before, "{line}");
            let said = String::from_utf8_lossy(&said.stderr);
            assert_eq!(said.contains("--force"), !line.starts_with("sim"), "{line}: {said}");
        }
    }
    let said = run(dir.path(), "sim PX4 --sd new.img --gs both --tap ./both", 2);
    assert!(String::from_utf8_lossy(&said.stderr).contains("are one file"));
}

#[test]
fn a_page_of_an_equal_session_of_another_card_is_refused() {
    let dir = tempfile::tempdir().expect("directory");
    for folder in ["one", "two"] {
        fs::create_dir(dir.path().join(folder)).expect("made");
    }
    run(dir.path(), "decode --format hum PX4 -o one/00002_00.HUM", 0);
    fs::copy(dir.path().join("one/00002_00.HUM"), dir.path().join("two/00002_00.HUM")).expect("copied");
    let other = end_of("ap_quad_guided.tlog", dir.path());
    run(dir.path(), &format!("decode --format hum {} -o two/00001_00.HUM", other.display()), 0);
    let page = |folder: &str, flag: &str, code| {
        run(dir.path(), &format!("report {folder} --session 00002 -o page.html {flag}"), code);
        fs::read(dir.path().join("page.html")).expect("a page")
    };
    let one = page("one", "", 0);
    assert!(page("two", "", 1) == one);
    assert!(page("two", "--force", 0) == one, "no folder is in a page");
}

#[test]
fn gaps_of_an_earlier_copy_do_not_stay_beside_a_tlog_without_gaps() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let log = fs::read(dir.path().join("log.hum")).expect("a log");
    let mut damaged = log.clone();
    damaged[150 * 512 + 100] ^= 4;
    fs::write(dir.path().join("log.hum"), damaged).expect("written");
    let line = "decode log.hum -o back.tlog --format tlog";
    run(dir.path(), line, 3);
    run(dir.path(), &format!("{line} --force"), 3);
    let gaps = dir.path().join("back.tlog.gaps.csv");
    assert!(gaps.exists());
    fs::write(dir.path().join("log.hum"), log).expect("written");
    run(dir.path(), line, 1);
    fs::remove_file(dir.path().join("back.tlog")).expect("removed");
    run(dir.path(), line, 1);
    assert!(gaps.exists() && !dir.path().join("back.tlog").exists());
    run(dir.path(), &format!("{line} --force"), 0);
    assert!(!gaps.exists() && dir.path().join("back.tlog").exists());
}

#[test]
fn a_skipped_log_counts_as_the_written_one() {
    let dir = tempfile::tempdir().expect("directory");
    fs::create_dir(dir.path().join("logs")).expect("a folder");
    run(dir.path(), "decode --format hum PX4 -o logs/log.hum", 0);
    let path = dir.path().join("logs/log.hum");
    let mut log = fs::read(&path).expect("a log");
    log[150 * 512 + 100] ^= 4;
    fs::write(&path, log).expect("written");
    let whole = fs::read(flight("ap_quad_guided.tlog")).expect("a recording");
    let (first, last) = whole.split_at(whole.len() / 2);
    fs::write(dir.path().join("logs/noisy.tlog"), [first, &[0x55; 3000], last].concat()).expect("written");
    let decode = |manifest: &str| {
        let line = format!("decode logs -o out --format jsonl --manifest {manifest}");
        let said = stderr(&run(dir.path(), &line, 3));
        let made = fs::read(dir.path().join(manifest)).expect("a manifest");
        let made: serde_json::Value = serde_json::from_slice(&made).expect("JSON");
        let logs = made["logs"].as_array().expect("logs").clone();
        let lacks: Vec<_> = logs.iter().map(|log| log["lacks"].as_str().expect("words").to_owned()).collect();
        (said.contains("skipped: 2 sessions are there already"), lacks)
    };
    let (skipped, lacks) = decode("first.json");
    assert!(!skipped && lacks.len() == 2 && lacks.iter().all(|words| !words.is_empty()), "{lacks:?}");
    assert_eq!(decode("again.json"), (true, lacks));
}

#[test]
fn a_skipped_log_proves_the_end_of_the_log_before() {
    let dir = tempfile::tempdir().expect("directory");
    for name in ["ap_quad_guided.tlog", "ap_quad_faults.tlog"] {
        run(dir.path(), &format!("sim {} --sd card.img --speed max", flight(name).display()), 0);
    }
    run(dir.path(), "decode card.img -o all --format tlog", 0);
    run(dir.path(), "decode card.img --session 00002 -o out/ --format tlog", 0);
    let said = stderr(&run(dir.path(), "decode card.img -o out --format tlog", 0));
    assert_eq!(said.matches("skipped: ").count(), 1, "{said}");
}

#[test]
fn a_log_with_some_of_its_outputs_is_not_skipped() {
    let dir = two_cards();
    run(dir.path(), "decode c1.img c2.img -o out --format tlog", 0);
    let before = contents(&dir.path().join("out"));
    for format in ["tlog,csv", "tlog,parquet", "jsonl,tlog"] {
        let said = stderr(&run(dir.path(), &format!("decode c1.img c2.img -o out --format {format}"), 1));
        assert!(said.contains("other outputs of this log are missing"), "{format}: {said}");
    }
    let tables = |(name, _): &(String, Vec<u8>)| !name.ends_with("lock");
    let after: Vec<_> = contents(&dir.path().join("out")).into_iter().filter(tables).collect();
    assert_eq!(after, before);
    run(dir.path(), "decode c1.img c2.img -o out --format tlog,csv --force", 0);
    run(dir.path(), "decode c1.img c2.img -o out --format tlog,csv", 0);
}

#[test]
fn a_time_in_which_there_is_nothing_is_told_and_nothing_is_written() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    for (output, format) in [("out", "csv,tlog,parquet,thesis"), ("out.tlog", "tlog"), ("-", "jsonl")] {
        let line = format!("decode log.hum -o {output} --format {format} --from 99999");
        let output = run(dir.path(), &line, 1);
        let said = stderr(&output);
        assert!(
            said.contains("log: nothing of it is within --from and --to: its times go from 0.000 s to "),
            "{said}"
        );
        assert!(text(&output).is_empty());
    }
    assert!(!dir.path().join("out.tlog").exists());
    assert!(all_named(&dir.path().join("out"), "log").is_empty());
}

#[test]
fn a_message_that_is_not_there_is_told_and_makes_no_empty_tlog() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    for line in ["decode log.hum -o out.tlog --format tlog", "decode PX4 -o out.jsonl --format jsonl"] {
        let said = stderr(&run(dir.path(), &format!("{line} --message AIRSPEED_AUTOCAL"), 1));
        assert!(
            said.contains(": no AIRSPEED_AUTOCAL is in it") && said.contains("nothing was written"),
            "{said}"
        );
        let said = run(dir.path(), &format!("{line} --message AIRSPEED_AUTOCAL --to 10"), 1);
        assert!(String::from_utf8_lossy(&said.stderr).contains(": no AIRSPEED_AUTOCAL of it is within"));
    }
    assert_eq!(contents(dir.path()).len(), 1);
    let said =
        run(dir.path(), "decode log.hum -o out --format tlog,jsonl,thesis --message AIRSPEED_AUTOCAL", 0);
    assert!(String::from_utf8_lossy(&said.stderr).contains("log: no frame of what was asked for is in it"));
    let made = contents(&dir.path().join("out"));
    assert!(made.len() > 2 && made.iter().all(|(name, bytes)| !name.contains(".tlog") && !bytes.is_empty()));
}

#[test]
fn tables_that_would_lie_below_a_file_are_refused_in_every_format() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    fs::write(dir.path().join("notes.txt"), "mine").expect("written");
    fs::create_dir(dir.path().join("fleet")).expect("made");
    fs::write(dir.path().join("fleet/HEARTBEAT"), "mine").expect("written");
    for (output, format) in [("notes.txt/", "csv"), ("notes.txt/", "parquet"), ("fleet", "parquet")] {
        let ended =
            attempt(dir.path(), &format!("decode log.hum -o {output} --format {format} --vehicle quad-7"));
        let told = stderr(&ended);
        assert_eq!(ended.status.code(), Some(1), "{output} {format}: {told}");
        assert!(told.contains("is a file, and a directory is needed there"), "{output} {format}: {told}");
    }
    assert_eq!(fs::read(dir.path().join("notes.txt")).expect("there"), b"mine");
    assert!(contents(&dir.path().join("fleet")).iter().all(|(name, _)| !name.ends_with(".parquet")));
}

/// The vehicle of a table.
fn vehicle(path: &Path) -> String {
    let file = SerializedFileReader::new(fs::File::open(path).expect("a file")).expect("a table");
    let about = file.metadata().file_metadata().key_value_metadata().expect("metadata");
    let vehicle = about.iter().find(|about| about.key == "hums.vehicle").expect("a vehicle");
    vehicle.value.clone().expect("a name")
}

/// The sessions of recordings are known by their bytes. Folders that are decoded again and again, in one call or in many,
/// have each session once; so has a copy, and a compressed one.
#[test]
fn recordings_are_once_in_a_fleet_however_often_their_folders_are_decoded() {
    let dir = tempfile::tempdir().expect("directory");
    for folder in ["hexa", "quad", "spare"] {
        fs::create_dir_all(dir.path().join("logs").join(folder)).expect("a folder");
    }
    let to = |path: &str| dir.path().join("logs").join(path);
    for (name, path) in [
        ("ap_quad_guided.tlog", "quad/a.tlog"),
        ("px4_hil_quad_low.tlog", "quad/b.tlog"),
        ("ap_quad_faults.tlog", "hexa/a.tlog"),
    ] {
        fs::rename(end_of(name, dir.path()), to(path)).expect("moved");
    }
    let raw = fs::read(flight("ap_quad_signed.raw")).expect("a recording");
    fs::write(to("quad/c.raw"), &raw[..400_000]).expect("written");
    fs::copy(to("quad/a.tlog"), to("spare/again.tlog")).expect("a copy");
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&fs::read(to("quad/b.tlog")).expect("a recording")).expect("packed");
    fs::write(to("spare/b.tlog.gz"), packed.finish().expect("packed")).expect("written");
    let each =
        ["quad/a.tlog", "quad/b.tlog", "hexa/a.tlog", "quad/c.raw", "spare/again.tlog", "spare/b.tlog.gz"];
    let decode = |inputs: &str, more: &str| {
        let ended = attempt(dir.path(), &format!("decode {inputs} -o fleet --format parquet {more}"));
        let told = stderr(&ended);
        (ended.status.code(), told)
    };
    let mut known = Vec::new();
    for round in 0..2 {
        let (code, told) = decode("logs", "");
        assert_eq!(
            (code, told.contains("skipped: 4 sessions are there already")),
            (Some(0), round > 0),
            "{told}"
        );
        for path in each {
            let (code, told) = decode(&format!("logs/{path}"), "");
            assert!(code == Some(0) && told.contains("exists, and was not overwritten"), "{path}: {told}");
        }
        let (code, told) = decode("logs", "--vehicle quad-7");
        assert!(code == Some(0) && told.contains("skipped: 4 sessions are there already"), "{told}");
        assert_eq!(decode("logs", "--force").0, Some(0));
        let sessions = parquet_sessions(&dir.path().join("fleet"));
        assert_eq!(sessions.len(), 4, "{sessions:?}");
        if round > 0 {
            assert_eq!(sessions, known);
        }
        known = sessions;
    }
    // Vehicles without an id are apart by folder and autopilot, and have the name that the user gives.
    let vehicles = |fleet: &str| -> BTreeSet<String> {
        let table = dir.path().join(fleet).join("HEARTBEAT");
        parquet_sessions(&dir.path().join(fleet)).iter().map(|path| vehicle(&table.join(path))).collect()
    };
    let names: Vec<String> = vehicles("fleet").into_iter().collect();
    let expected =
        ["ArduPilot-hexa", "ArduPilot-quad", "PX4-quad"].map(|end| format!("system-1-quadrotor-{end}"));
    assert_eq!(names, expected);
    run(dir.path(), "decode logs -o named --format parquet --vehicle 7/new", 0);
    assert_eq!(vehicles("named").into_iter().collect::<Vec<_>>(), ["vehicle-7-new"]);
}

#[test]
fn a_session_whose_clock_is_wrong_by_years_is_told_with_its_date() {
    const YEARS_US: u64 = 70 * 31_557_600_000_000;
    let dir = tempfile::tempdir().expect("directory");
    let log = fs::read(end_of("ap_quad_guided.tlog", dir.path())).expect("a recording");
    let late = |(us, frame): (u64, &[u8])| [&(us + YEARS_US).to_be_bytes()[..], frame].concat();
    let late: Vec<u8> = crate::support::records(&log).into_iter().flat_map(late).collect();
    fs::write(dir.path().join("late.tlog"), late).expect("written");
    let told = run(dir.path(), "decode late.tlog -o fleet --format parquet", 0).stderr;
    let (told, dates) = (String::from_utf8_lossy(&told), contents(&dir.path().join("fleet/sessions")));
    assert!(told.contains("its clock says 20") && told.contains("its tables have that date"), "{told}");
    assert!(matches!(&dates[..], [(place, _)] if place.starts_with("date=209")), "{told}");
}

/// A folder of pages gets those that it lacks; `--force` writes all of them.
#[test]
fn pages_that_exist_are_skipped_and_the_others_are_written() {
    let dir = tempfile::tempdir().expect("directory");
    fs::create_dir(dir.path().join("logs")).expect("a folder");
    let add =
        |name: &str| fs::rename(end_of(name, dir.path()), dir.path().join("logs").join(name)).expect("moved");
    let report = |more: &str| {
        let ended = attempt(dir.path(), &format!("report logs -o pages/ --json {more}"));
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let told = stderr(&ended);
        let made = crate::support::json(&ended);
        let count = |name: &str| made[name].as_array().expect("a list").len();
        (count("pages"), count("skipped"), told.matches(": skipped: ").count())
    };
    add("ap_quad_guided.tlog");
    assert_eq!(report(""), (2, 0, 0));
    add("px4_hil_quad_low.tlog");
    let mine = |name: &(String, Vec<u8>)| name.0.starts_with("ap_quad");
    let before = contents(&dir.path().join("pages")).into_iter().find(mine);
    assert_eq!(report(""), (2, 1, 1), "the new one, and the table");
    assert_eq!(contents(&dir.path().join("pages")).into_iter().find(mine), before);
    let table = fs::read_to_string(dir.path().join("pages/index.html")).expect("a table");
    assert!(table.contains("ap_quad_guided.tlog") && table.contains("px4_hil_quad_low.tlog"));
    assert_eq!(report("--force"), (3, 0, 0));
    let whole = contents(&dir.path().join("pages"));
    fs::remove_file(dir.path().join("pages/index.html")).expect("it was there");
    assert_eq!(report(""), (1, 2, 2), "the table alone");
    assert!(contents(&dir.path().join("pages")) == whole, "the table has each page");
}
