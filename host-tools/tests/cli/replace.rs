//! What is there already stays, and two sessions are never mixed.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::support::{
    all_named, attempt, contents, end_of, flight, frames_of, furnished, named, px4, run, stamps, text,
};

/// Two cards, each with the first session of a vehicle of its own.
fn two_cards() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for (name, recording) in [("c1", "px4_hil_quad_low.tlog"), ("c2", "ap_quad_guided.tlog")] {
        let recording = end_of(recording, dir.path());
        let code = attempt(dir.path(), &format!("sim --input {} --sd {name}.img", recording.display()));
        assert!(code.status.success(), "{name}");
    }
    dir
}

fn parquet_sessions(fleet: &Path) -> Vec<PathBuf> {
    let mut sessions: Vec<PathBuf> = contents(fleet)
        .into_iter()
        .filter_map(|(name, _)| name.strip_suffix("/HEARTBEAT.parquet").map(PathBuf::from))
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

/// Two folders, each with a log of the same name: the whole one, and one whose last half is gone.
fn whole_and_cut() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    for folder in ["whole", "cut", "one"] {
        fs::create_dir(dir.path().join(folder)).expect("a directory");
    }
    run(dir.path(), "pack PX4 -o whole/log.hum", 0);
    let log = fs::read(dir.path().join("whole/log.hum")).expect("a log");
    fs::write(dir.path().join("cut/log.hum"), &log[..log.len() / 1024 * 512]).expect("written");
    dir
}

#[test]
fn what_is_there_is_not_replaced_by_other_content_unless_the_user_says_so() {
    let dir = whole_and_cut();
    let out = dir.path().join("out");
    for line in ["decode LOG -o out --format tlog,jsonl,influx,csv,thesis", "report LOG -o out/"] {
        let line =
            |log: &str, more: &str| format!("{} {more}", line.replace("LOG", &format!("{log}/log.hum")));
        run(dir.path(), &line("whole", ""), 0);
        let made = contents(&out);
        run(dir.path(), &line("whole", ""), 0);
        assert_eq!(contents(&out), made, "the same again");
        let kept = |line: &str| {
            let said = String::from_utf8_lossy(&run(dir.path(), line, 1).stderr).into_owned();
            assert!(said.contains("is there already with other content, and was not replaced"), "{said}");
            assert!(said.contains("--replace"), "{said}");
            assert!(contents(&out) == made, "{line} changed something");
        };
        kept(&line("cut", ""));
        if line("", "").starts_with("decode") {
            kept(&line("whole", "--from 20"));
            kept(&line("whole", "--message ATTITUDE"));
        }
        // Each format by itself, so that none hides behind another.
        for format in ["tlog", "jsonl", "influx", "csv", "thesis"] {
            if line("", "").starts_with("decode") {
                kept(&format!("decode cut/log.hum -o out --format {format}"));
            }
        }
        // Nor by less of the same session, whatever the user says.
        for format in ["tlog", "jsonl", "influx", "csv", "thesis"] {
            let line = if line("", "").starts_with("decode") {
                format!("decode cut/log.hum -o out --format {format} --replace")
            } else {
                line("cut", "--replace")
            };
            let said = String::from_utf8_lossy(&run(dir.path(), &line, 1).stderr).into_owned();
            let words = "does not make it less; name another output, or delete it by hand";
            assert!(said.contains(words) || said.contains("may be an original"), "{line}: {said}");
            assert!(contents(&out) == made, "{line} changed something");
        }
        // The whole takes the place of a part.
        fs::remove_dir_all(&out).expect("removed");
        run(dir.path(), &line("cut", ""), 3);
        assert_ne!(contents(&out), made);
        run(dir.path(), &line("whole", "--replace"), 0);
        assert!(contents(&out).iter().all(|file| made.contains(file)), "a table of the part is left");
    }
    // Parquet tables of two parts of a session never lie side by side: a query reads all that is there.
    run(dir.path(), "decode cut/log.hum -o fleet --format parquet", 3);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet", 1);
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet --replace", 0);
    let made = contents(&dir.path().join("fleet"));
    run(dir.path(), "decode whole/log.hum -o fleet --format parquet --message ATTITUDE", 1);
    run(dir.path(), "decode cut/log.hum -o fleet --format parquet", 1);
    run(dir.path(), "decode cut/log.hum -o fleet --format parquet --replace", 1);
    assert!(contents(&dir.path().join("fleet")) == made);
    assert_eq!(parquet_sessions(&dir.path().join("fleet")).len(), 1);
    // A table of the user's own stays, and so does the folder that it is in.
    run(dir.path(), "decode whole/log.hum -o out --format csv", 0);
    let tables = out.join(named(&out, "log"));
    fs::write(tables.join("mine.csv"), "mine").expect("written");
    let before = contents(&out);
    run(dir.path(), "decode whole/log.hum -o out --format csv", 0);
    let said = run(dir.path(), "decode cut/log.hum -o out --format csv --replace", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("mine.csv, which hums did not make"));
    assert_eq!(contents(&out), before);
}

#[test]
fn a_slip_in_the_name_of_an_output_costs_no_recording_with_any_flag() {
    let dir = furnished();
    run(dir.path(), "sim --input PX4 --sd card.img --card-size 64", 0);
    let at = |name: &str| dir.path().join(name);
    fs::write(at("spool"), b"HUMSPOOL and what waits").expect("written");
    fs::write(at("thesis.txt"), "months of work").expect("written");
    fs::write(at("mine.jsonl"), "{\"time_boot\":1,\"mine\":true}\n").expect("written");
    // What a port sent, and a log off the card: originals of the kinds that the commands make.
    fs::write(at("gs"), frames_of(&px4())[..50].concat()).expect("written");
    let image = fs::read(at("card.img")).expect("an image");
    let first = image.chunks(512).position(|block| block.starts_with(&[0x48, 0xb2])).expect("a sector") * 512;
    fs::write(at("00001_00.HUM"), &image[first..first + (1 << 20)]).expect("written");
    fs::write(at("flight.ulg"), b"ULog\x01\x12\x35\x01 and so on").expect("written");
    let (before, whole) = (stamps(dir.path()), contents(dir.path()));
    for line in [
        "decode folder/log.hum -o OUT --format tlog",
        "decode folder/log.hum -o OUT --format jsonl",
        "decode folder/log.hum -o OUT --format influx",
        "report folder/log.hum -o OUT",
        "pack folder/flight.tlog -o OUT",
        "sim --input folder/flight.tlog --sd new.img --gs OUT",
        "sim --input folder/flight.tlog --sd new.img --tap OUT",
    ] {
        let names =
            ["card.img", "spool", "thesis.txt", "mine.jsonl", "flight.ulg", "hums.elf", "flight.tlog", "gs"];
        for name in names.into_iter().chain(["log.hum", "00001_00.HUM"]) {
            for flag in if line.starts_with("sim") { &[""][..] } else { &["", "--replace"] } {
                // A log that was packed of the same recording is the same again.
                if line.starts_with("pack") && name == "log.hum" {
                    continue;
                }
                let line = format!("{} {flag}", line.replace("OUT", name));
                run(dir.path(), &line, 1);
                assert!(stamps(dir.path()) == before, "{line}");
            }
        }
    }
    assert!(contents(dir.path()) == whole, "something was changed");
    let said = run(dir.path(), "sim --input PX4 --sd new.img --gs both --tap ./both", 2);
    assert!(String::from_utf8_lossy(&said.stderr).contains("are one file"));
}

#[test]
fn what_was_made_of_the_same_log_is_replaced_and_what_was_made_of_another_one_is_not() {
    let dir = tempfile::tempdir().expect("directory");
    let tlog = fs::read(px4()).expect("a recording");
    let few: usize = frames_of(&px4())[..800].iter().map(|frame| 8 + frame.len()).sum();
    fs::write(dir.path().join("few.tlog"), &tlog[..few]).expect("written");
    run(dir.path(), "pack few.tlog -o few.hum", 0);
    run(dir.path(), "pack PX4 -o log.hum", 0);
    run(dir.path(), &format!("pack {} -o other.hum", flight("ap_quad_guided.tlog").display()), 0);
    for line in [
        "decode LOG.hum -o OUT --format influx",
        "report LOG.hum -o OUT",
        // The first one is the beginning of the second one: nothing is lost.
        "decode LOG.hum -o OUT --format tlog",
        "pack LOG.tlog -o OUT",
    ] {
        let _ = fs::remove_file(dir.path().join("out"));
        let of = |log: &str| match (log, line.starts_with("pack")) {
            ("log", true) => line.replace("LOG.tlog", "PX4").replace("OUT", "out"),
            ("other", true) => line
                .replace("LOG.tlog", &flight("ap_quad_guided.tlog").display().to_string())
                .replace("OUT", "out"),
            _ => line.replace("LOG", log).replace("OUT", "out"),
        };
        run(dir.path(), &of("few"), 0);
        run(dir.path(), &of("log"), 1);
        run(dir.path(), &format!("{} --replace", of("log")), 0);
        let made = fs::read(dir.path().join("out")).expect("there");
        let said = run(dir.path(), &format!("{} --replace", of("other")), 1);
        let said = String::from_utf8_lossy(&said.stderr).into_owned();
        assert!(
            said.contains("may be an original") && said.contains("name another output"),
            "{line}: {said}"
        );
        assert!(fs::read(dir.path().join("out")).expect("there") == made, "{line}");
    }
    // The beginning of the recording has the same session, and takes no place of the whole.
    let made = fs::read(dir.path().join("log.hum")).expect("there");
    let said = run(dir.path(), "pack few.tlog -o log.hum --replace", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("does not make it less"));
    assert!(fs::read(dir.path().join("log.hum")).expect("there") == made);
    // Of raw bytes nothing tells of which recording a log was packed.
    fs::write(dir.path().join("one.raw"), frames_of(&px4())[..400].concat()).expect("written");
    fs::write(dir.path().join("two.raw"), frames_of(&px4())[400..900].concat()).expect("written");
    run(dir.path(), "pack one.raw -o raw.hum", 0);
    run(dir.path(), "pack two.raw -o raw.hum --replace", 1);
    // A shorter beginning never takes the place of a tlog.
    let before = tlog.clone();
    fs::write(dir.path().join("flight.tlog"), &before).expect("written");
    run(dir.path(), "decode log.hum -o back.tlog --format tlog", 0);
    let back = fs::read(dir.path().join("back.tlog")).expect("there");
    run(dir.path(), "decode few.hum -o back.tlog --format tlog --replace", 1);
    assert!(fs::read(dir.path().join("back.tlog")).expect("there") == back);
}

#[test]
fn what_stands_in_a_file_beside_what_was_made_of_the_log_is_not_replaced() {
    let dir = tempfile::tempdir().expect("directory");
    let at = |name: &str| dir.path().join(name);
    run(dir.path(), "pack PX4 -o log.hum", 0);
    run(dir.path(), &format!("pack {} -o other.hum", flight("ap_quad_guided.tlog").display()), 0);
    for log in ["log", "other"] {
        run(dir.path(), &format!("decode {log}.hum -o {log}.lp --format influx --message HEARTBEAT"), 0);
    }
    run(dir.path(), "report log.hum -o log.html --replace", 0);
    let read = |name: &str| fs::read(at(name)).expect("there");
    let (points, others) = (read("log.lp"), read("other.lp"));
    let log = &read("log.hum")[..60 * 512];
    let page = read("log.html");
    let kept = |line: &str, there: &[u8]| {
        fs::write(at("out"), there).expect("written");
        let said = run(dir.path(), &format!("{line} -o out --replace"), 1);
        let said = String::from_utf8_lossy(&said.stderr);
        assert!(said.contains("may be an original"), "{line}: {said}");
        assert!(read("out") == there, "{line}");
    };
    let influx = "decode log.hum --format influx";
    kept(influx, &[points.as_slice(), &others].concat());
    kept(influx, &[points.as_slice(), b"# what I found\n"].concat());
    kept(influx, &points[..points.len() - 1]);
    for behind in [&read("other.hum")[..10 * 512], b"mine"] {
        kept("pack PX4", &[log, behind].concat());
    }
    kept("report log.hum", &[page.as_slice(), b"<p>bent arm"].concat());
    // Without that it is replaced.
    for (line, there) in [(influx, points.as_slice()), ("pack PX4", log), ("report log.hum", &page)] {
        fs::write(at("out"), there).expect("written");
        run(dir.path(), &format!("{line} -o out --replace"), 0);
    }
    // A link that has the name of the log's file leads to another one.
    run(dir.path(), "decode log.hum -o made/ --format tlog", 0);
    let name = format!("{}.tlog", named(&at("made"), "log"));
    let original = fs::read(flight("ap_quad_guided.tlog")).expect("a recording");
    fs::write(at("original.tlog"), &original[..50_000]).expect("written");
    fs::remove_file(at("made").join(&name)).expect("removed");
    std::os::unix::fs::symlink("../original.tlog", at("made").join(&name)).expect("a link");
    let said = run(dir.path(), "decode log.hum -o made/ --format tlog --replace", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("may be an original"));
    assert!(read("original.tlog") == original[..50_000]);
}

#[test]
fn a_damaged_copy_takes_the_place_of_nothing_and_the_sound_log_that_of_a_damaged_copy() {
    let dir = tempfile::tempdir().expect("directory");
    let out = dir.path().join("out");
    for folder in ["whole", "damaged"] {
        fs::create_dir(dir.path().join(folder)).expect("a directory");
    }
    run(dir.path(), "pack PX4 -o whole/log.hum", 0);
    let mut log = fs::read(dir.path().join("whole/log.hum")).expect("a log");
    // Few frames are lost, and a table of gaps comes to the others.
    log[127 * 512 + 100] ^= 4;
    fs::write(dir.path().join("damaged/log.hum"), log).expect("written");
    let formats = "tlog,jsonl,influx,csv,parquet,thesis";
    let lines = |log: &str| {
        [format!("decode {log}/log.hum -o out --format {formats}"), format!("report {log}/log.hum -o out/")]
    };
    let mut each =
        formats.split(',').map(|format| format!("decode damaged/log.hum -o out --format {format}"));
    for line in lines("whole") {
        run(dir.path(), &line, 0);
    }
    let made = contents(&out);
    for line in each.by_ref().chain(["report damaged/log.hum -o out/".to_owned()]) {
        let said = run(dir.path(), &format!("{line} --replace"), 1);
        let said = String::from_utf8_lossy(&said.stderr);
        assert!(said.contains("does not make it less"), "{line}: {said}");
        assert!(contents(&out) == made, "{line} changed something");
    }
    fs::remove_dir_all(&out).expect("removed");
    for line in lines("damaged") {
        run(dir.path(), &line, 3);
    }
    // The same again is no less.
    let damaged = contents(&out);
    for line in lines("damaged") {
        run(dir.path(), &format!("{line} --replace"), 3);
    }
    assert!(contents(&out) == damaged);
    for line in lines("whole") {
        run(dir.path(), &format!("{line} --replace"), 0);
    }
    assert!(contents(&out) == made);
}

#[test]
fn a_command_with_all_files_of_a_folder_can_be_called_again() {
    let dir = tempfile::tempdir().expect("directory");
    fs::copy(px4(), dir.path().join("flight.tlog")).expect("a copy");
    run(dir.path(), "pack flight.tlog -o log.hum", 0);
    for line in ["decode * -o . --format tlog,csv,jsonl,influx,parquet,thesis", "report * -o ./"] {
        // As a shell puts it there: without what begins with a dot.
        let all = || -> String {
            let entries = fs::read_dir(dir.path()).expect("a directory");
            let names =
                entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
            let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
            names.sort();
            line.replace('*', &names.join(" "))
        };
        run(dir.path(), &all(), 0);
        let made = contents(dir.path());
        let said = String::from_utf8_lossy(&run(dir.path(), &all(), 0).stderr).into_owned();
        assert!(said.contains("and is passed over"), "{said}");
        assert!(line.starts_with("report") || said.contains("is what this command makes of"), "{said}");
        assert!(line.starts_with("report") || contents(dir.path()) == made);
        // An output that was changed is not replaced, and no input either.
        run(dir.path(), &format!("{} --replace", all()), 0);
        assert!(line.starts_with("report") || contents(dir.path()) == made);
    }
}

#[test]
fn gaps_of_an_earlier_copy_do_not_stay_beside_a_tlog_without_gaps() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    let log = fs::read(dir.path().join("log.hum")).expect("a log");
    let mut damaged = log.clone();
    damaged[150 * 512 + 100] ^= 4;
    fs::write(dir.path().join("log.hum"), damaged).expect("written");
    let line = "decode log.hum -o back.tlog --format tlog";
    run(dir.path(), line, 3);
    run(dir.path(), line, 3);
    let gaps = dir.path().join("back.tlog.gaps.csv");
    assert!(gaps.exists());
    fs::write(dir.path().join("log.hum"), log).expect("written");
    run(dir.path(), line, 1);
    fs::remove_file(dir.path().join("back.tlog")).expect("removed");
    run(dir.path(), line, 1);
    assert!(gaps.exists() && !dir.path().join("back.tlog").exists());
    run(dir.path(), &format!("{line} --replace"), 0);
    assert!(!gaps.exists());
}

#[test]
fn a_time_in_which_there_is_nothing_is_told_and_nothing_is_written() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    for (output, format) in [("out", "csv,tlog,parquet,thesis"), ("out.tlog", "tlog"), ("-", "jsonl")] {
        let line = format!("decode log.hum -o {output} --format {format} --from 99999");
        let output = run(dir.path(), &line, 1);
        let said = String::from_utf8_lossy(&output.stderr);
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
fn tables_that_would_lie_below_a_file_are_refused_in_every_format() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "pack PX4 -o log.hum", 0);
    fs::write(dir.path().join("notes.txt"), "mine").expect("written");
    fs::create_dir(dir.path().join("fleet")).expect("made");
    fs::write(dir.path().join("fleet/vehicle=system-1"), "mine").expect("written");
    for (output, format) in [("notes.txt/", "csv"), ("notes.txt/", "parquet"), ("fleet", "parquet")] {
        let ended = attempt(dir.path(), &format!("decode log.hum -o {output} --format {format}"));
        let told = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(1), "{output} {format}: {told}");
        assert!(told.contains("is a file, and a directory is needed there"), "{output} {format}: {told}");
    }
    assert_eq!(fs::read(dir.path().join("notes.txt")).expect("there"), b"mine");
}
