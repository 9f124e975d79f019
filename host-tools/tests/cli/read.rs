//! Reading: every format, filters, damage, and files that are not logs.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::support::{
    attempt, contents, end_of, flight, frames_of, hums, json, named, px4, recorded, records, run, stderr,
    text,
};

fn packed(dir: &Path) {
    run(dir, "decode --format hum PX4 -o flight.hum", 0);
}

#[test]
fn a_packed_recording_comes_back_frame_for_frame_each_at_its_millisecond() {
    let dir = tempfile::tempdir().expect("directory");
    for name in ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"] {
        run(dir.path(), &format!("decode --format hum {} -o {name}.hum", flight(name).display()), 0);
        run(dir.path(), &format!("decode {name}.hum -o {name} --format tlog"), 0);
        let [before, after] =
            [flight(name), dir.path().join(name)].map(|path| fs::read(path).expect("a tlog"));
        let (before, after) = (records(&before), records(&after));
        assert_eq!(before.len(), after.len(), "{name}");
        for (one, other) in before.iter().zip(&after) {
            assert!(one.1 == other.1 && one.0.abs_diff(other.0) < 1000, "{name}: {one:?} {other:?}");
        }
    }
}

#[test]
fn what_is_made_on_standard_output_by_its_path_is_nothing_but_that() {
    let dir = tempfile::tempdir().expect("directory");
    run(
        dir.path(),
        &format!("decode --format hum {} -o few.hum", flight("px4_hil_quad_low.tlog").display()),
        0,
    );
    for (line, made) in [
        ("decode few.hum --format tlog -o", "a.tlog"),
        ("decode few.hum --format jsonl --message ATTITUDE -o", "a.jsonl"),
        ("decode --format hum PX4 -o", "few.hum"),
    ] {
        if made != "few.hum" {
            run(dir.path(), &format!("{line} {made}"), 0);
        }
        let whole = fs::read(dir.path().join(made)).expect("made");
        for name in ["-", "/dev/stdout"] {
            let piped = run(dir.path(), &format!("{line} {name}"), 0);
            assert!(piped.stdout == whole, "{line} {name} into a pipe");
        }
        let file = fs::File::create(dir.path().join("redirected")).expect("made");
        let words = line.split_whitespace().map(|word| if word == "PX4" { px4() } else { word.into() });
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_hums"));
        let status = command.current_dir(dir.path()).args(words).arg("/dev/stdout").stdout(file).status();
        assert!(status.expect("it runs").success());
        assert!(fs::read(dir.path().join("redirected")).expect("there") == whole, "{line} into a file");
    }
    let page = run(dir.path(), "report few.hum -o -", 0);
    assert!(page.stdout.starts_with(b"<!doctype html>"), "{}", String::from_utf8_lossy(&page.stderr));
    assert!(!dir.path().join("-").exists());
}

#[test]
fn what_has_no_frame_is_not_packed() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("text"), "no frame in here\n".repeat(500)).expect("written");
    let output = run(dir.path(), "decode --format hum text -o out.hum", 1);
    assert!(String::from_utf8_lossy(&output.stderr).contains("is neither a log of HUMS"));
    assert!(!dir.path().join("out.hum").exists());
    let frame = &fs::read(px4()).expect("a recording")[8..];
    fs::write(dir.path().join("log.bin"), [&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", frame].concat())
        .expect("written");
    let output = run(dir.path(), "decode --format hum log.bin -o out.hum", 1);
    assert!(String::from_utf8_lossy(&output.stderr).contains("is an ArduPilot log"), "{output:?}");
    assert!(!dir.path().join("out.hum").exists());
}

#[test]
fn a_compressed_recording_is_packed_as_it_is_unpacked() {
    let dir = tempfile::tempdir().expect("directory");
    let mut gz = GzEncoder::new(Vec::new(), Compression::fast());
    gz.write_all(&fs::read(px4()).expect("a recording")).expect("memory");
    let gz = gz.finish().expect("memory");
    fs::write(dir.path().join("flight.tlog.gz"), &gz).expect("written");
    fs::write(dir.path().join("cut.tlog.gz"), &gz[..gz.len() / 2]).expect("written");
    packed(dir.path());
    run(dir.path(), "decode --format hum flight.tlog.gz -o of_gz.hum", 0);
    let of = |name: &str| fs::read(dir.path().join(name)).expect("a log");
    assert!(of("flight.hum") == of("of_gz.hum"));
    let cut = run(dir.path(), "decode --format hum cut.tlog.gz -o cut.hum", 3);
    assert!(String::from_utf8_lossy(&cut.stderr).contains("ends too soon"), "{cut:?}");
}

#[test]
fn tables_have_a_row_for_each_frame_and_both_times() {
    let dir = recorded();
    run(dir.path(), "decode card.img -o out --format csv", 0);
    let out = dir.path().join("out");
    let tables = out.join(named(&out, "00001"));
    let table = |name: &str| fs::read_to_string(tables.join(name)).expect(name);
    let attitude = table("ATTITUDE.csv");
    let mut lines = attitude.lines();
    let header = lines.next().expect("a header");
    assert!(
        header.starts_with("time_boot[s],time_utc,system,component,time_boot_ms[ms],roll[rad],"),
        "{header}"
    );
    let row = lines.next().expect("a row");
    assert_eq!(row.split(',').count(), header.split(',').count(), "{row}");
    let info = json(&run(dir.path(), "info card.img --json", 0));
    for message in info["logs"][0]["messages"].as_array().expect("messages") {
        let name = message["name"].as_str().expect("a name");
        let rows = table(&format!("{name}.csv")).lines().count() as u64 - 1;
        // A text may contain a line break.
        assert!(message["frames"] == rows || name == "STATUSTEXT", "{name}: {rows}");
    }
    assert!(table("HUMS_USAGE.csv").contains("flight_time_s"));
    assert!(table("HUMS_BOOT.csv").contains("sim"));
}

#[test]
fn each_line_is_an_object_and_they_are_in_order() {
    let dir = recorded();
    let output = run(dir.path(), "decode card.img -o - --format jsonl", 0);
    let (mut frames, mut last) = (0, 0.0);
    for line in text(&output).lines() {
        let object: serde_json::Value = serde_json::from_str(line).expect(line);
        frames += u64::from(object["message"].is_string());
        let at = object["time_boot"].as_f64().expect("a time");
        assert!(at >= last, "{line}");
        last = at;
    }
    assert_eq!(frames, 16_645);
}

#[test]
fn filters_choose_by_time_and_by_message() {
    let dir = tempfile::tempdir().expect("directory");
    packed(dir.path());
    let decode = |more: &str| {
        let line = format!("decode flight.hum -o - --format jsonl --message ATTITUDE {more}");
        let lines = text(&run(dir.path(), &line, 0));
        lines.lines().filter(|line| !line.contains("HUMS_CHECKED")).collect::<Vec<_>>().join("\n")
    };
    let all = decode("");
    let part = decode("--from 100 --to 110.5");
    let expected: Vec<&str> = all
        .lines()
        .filter(|line| {
            let object: serde_json::Value = serde_json::from_str(line).expect(line);
            object["time_boot"].as_f64().is_some_and(|at| (100.0..=110.5).contains(&at))
        })
        .collect();
    assert_eq!(part.lines().collect::<Vec<_>>(), expected);
    let first: serde_json::Value = serde_json::from_str(expected.first().expect("some")).expect("an object");
    let utc = first["time_utc"].as_str().expect("UTC");
    assert_eq!(decode(&format!("--from {utc} --to 110.5")), part);
    run(dir.path(), "decode flight.hum -o - --format jsonl --message ATITUDE", 2);
    run(dir.path(), "decode flight.hum -o - --format jsonl --from yesterday", 2);
}

fn findings_of(jsonl: &str) -> Vec<String> {
    let findings = jsonl.lines().filter(|line| line.contains("\"record\":\"HUMS_FINDING\""));
    let findings = findings.map(|line| serde_json::from_str::<serde_json::Value>(line).expect(line));
    let words = |row: serde_json::Value| {
        let fields = &row["fields"];
        format!("{} {} {} {}", fields["check"], fields["level"], fields["at[s]"], fields["checked_by"])
    };
    findings.map(words).collect()
}

#[test]
fn a_recording_that_nobody_checked_has_the_findings_of_this_program_and_says_so() {
    let dir = tempfile::tempdir().expect("directory");
    let at = dir.path();
    fs::copy(flight("ap_quad_faults.tlog"), at.join("flight.tlog")).expect("copied");
    run(at, "decode --format hum flight.tlog -o flight.hum", 0);
    for input in ["flight.hum", "flight.tlog"] {
        let info: serde_json::Value =
            serde_json::from_str(&text(&run(at, &format!("info --json {input}"), 0))).expect("JSON");
        let expected: Vec<String> = info["logs"][0]["findings"]
            .as_array()
            .expect("findings")
            .iter()
            .map(|finding| {
                format!("{} {} {} \"hums\"", finding["check"], finding["level"], finding["time_s"])
            })
            .collect();
        let jsonl = text(&run(at, &format!("decode {input} -o - --format jsonl"), 0));
        let found = findings_of(&jsonl);
        assert!(found.len() > 5 && found == expected, "{input}: {found:?}\n{expected:?}");
        let last: serde_json::Value =
            serde_json::from_str(jsonl.lines().last().expect("a line")).expect("JSON");
        assert_eq!(last["record"], "HUMS_CHECKED");
        assert_eq!(last["fields"]["checked_by"], info["logs"][0]["checked_by"]);
        assert_eq!(
            (&last["fields"]["verdict"], last["fields"]["findings"].as_u64()),
            (&"critical".into(), Some(found.len() as u64))
        );
        let until = format!(
            "decode {input} -o - --format jsonl --to {}",
            found[2].split(' ').nth(2).expect("a time")
        );
        let part = text(&run(at, &until, 0));
        let checked: serde_json::Value =
            serde_json::from_str(part.lines().last().expect("a line")).expect("JSON");
        let there = findings_of(&part).len();
        assert!((3..found.len()).contains(&there), "{there} of {}", found.len());
        assert_eq!(checked["fields"]["findings"].as_u64(), Some(there as u64), "{checked}");
        run(at, &format!("decode {input} -o {input}.out --format csv,influx"), 0);
        let tables: Vec<_> = fs::read_dir(at.join(format!("{input}.out"))).expect("made").collect();
        assert_eq!(tables.len(), 2, "tables and points");
        for entry in tables {
            let path = entry.expect("an entry").path();
            let has = if path.is_dir() {
                fs::read_to_string(path.join("HUMS_FINDING.csv")).expect("a table").lines().count()
                    == found.len() + 1
            } else {
                let points = fs::read_to_string(&path).expect("points");
                points.lines().filter(|line| line.starts_with("HUMS_FINDING,")).count() == found.len()
            };
            assert!(has, "{}", path.display());
        }
    }
}

#[test]
fn where_files_go_depends_on_how_many_there_are() {
    let dir = recorded();
    let at = dir.path();
    run(at, "decode card.img -o one.tlog --format tlog", 0);
    assert!(at.join("one.tlog").is_file());
    run(at, "decode card.img -o both --format tlog,csv", 0);
    let name = format!("both/{}", named(&at.join("both"), "00001"));
    assert!(at.join(format!("{name}.tlog")).is_file() && at.join(name).join("ATTITUDE.csv").is_file());
    run(at, "sim PX4 --sd card.img", 0);
    run(at, "decode card.img -o two --format tlog", 0);
    let tlog = |dir: &str, base: &str, ending: &str| {
        at.join(dir).join(named(&at.join(dir), base) + ending).is_file()
    };
    assert!(tlog("two", "00001", ".tlog") && tlog("two", "00002", ".tlog"));
    run(at, "decode card.img -o - --format tlog", 2);
    run(at, "decode --format hum PX4 -o cards.hum", 0);
    run(at, "decode card.img cards.hum -o all --format jsonl", 0);
    assert!(tlog("all", "00001", ".jsonl") && tlog("all", "cards", ".jsonl"));
}

#[test]
fn segments_copied_off_a_card_are_a_log() {
    let dir = recorded();
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let start =
        image.chunks(512).position(|block| block[0] == b'H' && block[1] >> 4 == 0xb).expect("a sector") * 512;
    let folder = dir.path().join("copied/box7");
    fs::create_dir_all(&folder).expect("made");
    fs::write(folder.join("00001_00.hum"), &image[start..start + (8 << 20)]).expect("written");
    fs::write(folder.join("notes.txt"), "not a log").expect("written");
    run(dir.path(), "decode copied -o back.tlog --format tlog", 0);
    assert_eq!(frames_of(&dir.path().join("back.tlog")), frames_of(&px4()));
    let (first, second) = image[start..start + (1 << 20)].split_at(100 * 512);
    fs::create_dir(folder.join("two")).expect("made");
    fs::write(folder.join("two/00001_00.hum"), first).expect("written");
    fs::write(folder.join("two/00001_01.hum"), second).expect("written");
    let two = "copied/box7/two/00001_01.hum copied/box7/two/00001_00.hum";
    run(dir.path(), &format!("decode {two} -o again.tlog --format tlog"), 3);
    assert_eq!(frames_of(&dir.path().join("again.tlog")), frames_of(&px4()));
}

#[test]
fn what_is_no_log_is_told_apart() {
    let dir = tempfile::tempdir().expect("directory");
    let at = dir.path();
    fs::write(at.join("empty"), b"").expect("written");
    fs::write(at.join("text"), "hello").expect("written");
    fs::write(at.join("zeros"), vec![0; 3 << 20]).expect("written");
    fs::create_dir(at.join("folder")).expect("made");
    let dataflash = b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n";
    let ulog = [&b"ULog\x01\x12\x35\x01"[..], &[0; 8]].concat();
    fs::write(at.join("ArduPilot"), dataflash).expect("written");
    fs::write(at.join("ULog"), &ulog).expect("written");
    // As large as a possible card without a partition table.
    fs::write(at.join("large"), [&dataflash[..], &vec![b'\n'; 3 << 20]].concat()).expect("written");
    for input in ["ArduPilot", "ULog", "large", "PX4"] {
        let error = stderr(&run(at, &format!("info --verify {input}"), 1));
        assert!(error.contains("not a log of HUMS; `hums check` judges it"), "{input}: {error}");
    }
    for (input, said) in [
        ("empty", "is empty"),
        ("text", "neither a log"),
        ("zeros", "no partition table"),
        ("folder", "no log"),
        ("missing", "cannot be read"),
        ("PX4", "hums decode --format hum"),
    ] {
        for command in ["info", "info --verify", "decode -o out --format csv", "check"] {
            if input == "PX4" && command != "info --verify" {
                run(at, &format!("{command} {input}"), 0);
                continue;
            }
            let error = stderr(&run(at, &format!("{command} {input}"), 1));
            assert!(error.contains(said), "{command} {input}: {error}");
            let lists = command == "info --verify"
                || input != "zeros"
                || error.contains("an ArduPilot log (.bin, .log)");
            assert!(lists, "{command} {input}: {error}");
        }
    }
}

#[test]
fn a_reader_that_goes_away_ends_it_quietly() {
    let dir = tempfile::tempdir().expect("directory");
    packed(dir.path());
    let program = env!("CARGO_BIN_EXE_hums");
    for line in ["decode flight.hum -o - --format jsonl", "info flight.hum --json", "decode --help"] {
        let mut child = std::process::Command::new(program)
            .current_dir(dir.path())
            .args(line.split(' '))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]), "hums {line}");
    }
}

#[test]
fn slips_of_the_command_line_are_usage_errors() {
    let dir = tempfile::tempdir().expect("directory");
    for line in [
        "",
        "fly",
        "sim",
        "sim PX4",
        "sim udp:1.2.3.4:5 --sd c.img",
        "sim PX4 --sd c.img --stall 5",
        "sim PX4 --sd c.img --noise 2",
        "sim PX4 --sd c.img --noise often",
        "sim PX4 --sd c.img --speed fast",
        "sim PX4 --sd c.img --card-size 5",
        "sim PX4 --sd c.img --gs - --json",
        "sim udpin:127.0.0.1:1 --sd c.img --speed max",
        "sim --firmware x.elf PX4 --sd c.img --card-out 1..2",
        "sim PX4 --sd c.img --costs",
        "check",
        "decode PX4",
        "decode c.img -o out --format xml",
        "info",
        "decode --format hum,tlog PX4 -o out",
        "decode --format hum PX4 -o out.hum --from 1",
    ] {
        let output = run(dir.path(), line, 2);
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "hums {line}");
    }
    assert!(!dir.path().join("c.img").exists(), "a slip left an image behind");
}

#[test]
fn where_the_system_gives_no_thread_the_work_is_done_without() {
    let dir = recorded();
    let decoded = |folder: &str, stack: Option<&str>| {
        let mut decode = hums();
        decode.current_dir(dir.path()).args([
            "decode",
            "card.img",
            "--format",
            "tlog,csv,parquet",
            "-o",
            folder,
        ]);
        stack.map(|stack| decode.env("RUST_MIN_STACK", stack));
        let ended = decode.output().expect("it runs");
        assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
        contents(&dir.path().join(folder))
    };
    assert!(decoded("out", None) == decoded("again", Some("140737488355328")));
}

#[test]
fn a_log_that_breaks_off_in_the_air_has_one_time_in_the_air_and_logs_stand_in_the_order_in_which_they_began()
{
    let dir = tempfile::tempdir().expect("directory");
    let input = flight("ap_quad_faults.tlog");
    run(dir.path(), &format!("sim {} --sd z.img --store store.bin --reboot-at 244.7", input.display()), 3);
    fs::rename(end_of("ap_quad_guided.tlog", dir.path()), dir.path().join("y.tlog")).expect("renamed");
    let lines = text(&run(dir.path(), "info --list .", 3));
    let name = |line: &str| line.split_whitespace().next().unwrap_or_default().to_owned();
    let names: Vec<String> = lines.lines().skip(1).map(name).filter(|name| name != "in").collect();
    assert_eq!(names, ["y.tlog", "z/00001", "z/00002"], "{lines}");
    let broken = lines.lines().find(|line| line.starts_with("z/00001")).expect("it is there");
    assert!(broken.contains("  3:16  ") && broken.contains("; ends in the air; "), "{lines}");
    let checked = text(&run(dir.path(), "check z.img --session 1", 4));
    assert!(checked.contains("  in air   3:16 in 1 flight, whose landing is not in the log"), "{checked}");
    let info = text(&run(dir.path(), "info z.img/ --session 1", 3));
    let counted = "(counted here to the end of the log; the box had stored its own last at 4:00.0)";
    assert!(info.contains(counted), "{info}");
    let counter = |info: &str, title: &str| {
        let line = info.lines().find(|line| line.trim_start().starts_with(title));
        line.and_then(|line| line.split_whitespace().rev().nth(1)).map(str::to_owned)
    };
    assert_eq!(counter(&info, "In the air").as_deref(), Some("3:16"), "{info}");
    let next = text(&run(dir.path(), "info z.img --session 2", 0));
    assert_eq!(counter(&next, "Take-offs").as_deref(), Some("0"), "{next}");
    assert_eq!(counter(&next, "Landings").as_deref(), Some("1"), "{next}");
    fs::create_dir(dir.path().join("beside")).expect("a folder");
    fs::copy(dir.path().join("y.tlog"), dir.path().join("beside/y.tlog")).expect("a copy");
    for (line, code) in
        [("report beside/y.tlog", 0), ("report beside/y.tlog", 1), ("report beside/y.tlog --force", 0)]
    {
        run(dir.path(), line, code);
    }
    run(dir.path(), &format!("report {} -o pages/", dir.path().join("beside").display()), 0);
    for page in ["beside/y.html", "pages/index.html"] {
        let page = fs::read_to_string(dir.path().join(page)).expect("a page");
        assert!(page.contains("y.tlog") && !page.contains("beside/"), "a folder is in the page");
        assert!(!page.contains(&dir.path().display().to_string()), "a folder is in the page");
    }
    let report = run(dir.path(), "report y.tlog beside/y.tlog", 2);
    assert!(String::from_utf8_lossy(&report.stderr).contains("-o is missing"));
}

fn input(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/inputs").join(name).display().to_string()
}

fn session_of_points(folder: &Path, recording: &str) -> String {
    let files = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let of = |path: &PathBuf| {
        path.extension().is_some_and(|lp| lp == "lp") && path.display().to_string().contains(recording)
    };
    let points = fs::read_to_string(files.into_iter().find(of).expect("points")).expect("text");
    let tag = points.split_once(",session=").expect("a tag").1;
    tag.split([',', ' ']).next().expect("a name").to_owned()
}

#[test]
fn recordings_without_a_known_message_are_sessions_with_dates_of_their_own() {
    let dir = tempfile::tempdir().expect("a directory");
    let inputs = ["comp0.tlog", "comp1.tlog"].map(input);
    run(dir.path(), &format!("decode {} -o fleet --format parquet,influx", inputs.join(" ")), 0);
    let mut tables: Vec<(String, String)> = Vec::new();
    for (name, _) in contents(&dir.path().join("fleet/sessions")) {
        let parts: Vec<&str> = name.split('/').collect();
        let [date, _, session] = parts.as_slice() else { panic!("{name}") };
        tables.push(((*date).to_owned(), (*session).to_owned()));
    }
    let dates: Vec<&str> = tables.iter().map(|(date, _)| date.as_str()).collect();
    assert_eq!(dates, ["date=2026-09-21", "date=2026-09-27"]);
    for (name, (_, session)) in ["comp0.tlog", "comp1.tlog"].iter().zip(&tables) {
        let of_points = session_of_points(&dir.path().join("fleet"), name);
        assert!(session.starts_with(&format!("{of_points}-")), "{session} {of_points}");
    }
    assert_ne!(tables[0].1, tables[1].1);
}

#[test]
fn a_ulog_with_a_field_twice_has_a_column_for_each() {
    let dir = tempfile::tempdir().expect("a directory");
    run(dir.path(), &format!("decode {} -o out --format jsonl,csv,parquet", input("dup.ulg")), 0);
    let lines = fs::read_dir(dir.path().join("out")).expect("a folder");
    let lines = lines
        .map(|entry| entry.expect("an entry").path())
        .find(|path| path.extension().is_some_and(|e| e == "jsonl"));
    let lines = fs::read_to_string(lines.expect("lines")).expect("text");
    assert!(lines.lines().any(|line| line.contains("\"a\":") && line.contains("\"a_2\":")), "{lines}");
}

#[test]
fn each_flight_of_a_recording_becomes_files_of_its_own_and_no_frame_is_lost() {
    let dir = tempfile::tempdir().expect("directory");
    let recordings = ["ap_quad_guided.tlog", "ap_quad_faults.tlog"];
    let joined = recordings.map(|name| fs::read(flight(name)).expect("a recording")).concat();
    fs::write(dir.path().join("two.tlog"), joined).expect("written");
    let info = json(&attempt(dir.path(), "info --json two.tlog"));
    let flights = info["logs"][0]["flights"].as_array().expect("flights");
    let times: Vec<_> =
        flights.iter().map(|flight| (flight["from_s"].as_f64(), flight["to_s"].as_f64())).collect();
    assert_eq!(times, [(Some(48.3), Some(264.35)), (Some(1442.45), Some(1748.65))]);
    attempt(dir.path(), "decode two.tlog -o whole.tlog --format tlog");
    attempt(dir.path(), "decode two.tlog -o out --format tlog,csv --split flights");
    let made = contents(&dir.path().join("out"));
    let tlogs: Vec<_> = made
        .iter()
        .filter(|(name, _)| Path::new(name).extension().is_some_and(|end| end == "tlog"))
        .collect();
    assert!(
        tlogs[0].0.ends_with("-flight1.tlog") && tlogs[1].0.ends_with("-flight2.tlog"),
        "{}",
        tlogs.len()
    );
    let whole = fs::read(dir.path().join("whole.tlog")).expect("made");
    assert!(tlogs.len() == 2 && [&tlogs[0].1[..], &tlogs[1].1].concat() == whole);
    run(dir.path(), "decode two.tlog -o out --format tlog --split flights --from 1", 2);
    run(dir.path(), "decode two.tlog -o - --format tlog --split flights", 2);
}
