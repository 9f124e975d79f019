//! Where standard output and standard error may lead.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::support::{Stamp, contents, frames_of, furnished, named, px4, run, stamps, text};

/// Runs a line in a shell, in which `hums` is the program.
fn shell(dir: &Path, line: &str) -> Output {
    let hums = format!("hums() {{ {} \"$@\"; }}; {line}", env!("CARGO_BIN_EXE_hums"));
    let ended = Command::new("bash").args(["-c", &hums]).current_dir(dir).output().expect("a shell");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(!said.contains("panicked"), "{line}: {said}");
    ended
}

/// What stays as it is, with all that lies beside it.
struct Place {
    dir: tempfile::TempDir,
    before: Vec<(String, Stamp)>,
}

impl Place {
    fn new() -> Self {
        let dir = furnished();
        let at = |name: &str| dir.path().join(name);
        for line in [
            "decode log.hum -o out --format tlog,csv,jsonl,influx,parquet,thesis --to 5",
            "report log.hum -o out/",
            "sim --input flight.tlog --sd card.img --card-size 34 --store store.bin",
        ] {
            run(dir.path(), line, 0);
        }
        let name = named(&at("out"), "log");
        for (table, link) in [("ATTITUDE.csv", "table"), (".hums", "stamp")] {
            fs::hard_link(at("out").join(&name).join(table), at("out").join(&name).join(link))
                .expect("a link");
        }
        for ending in ["tlog", "jsonl", "lp"] {
            std::os::unix::fs::symlink(format!("out/{name}.{ending}"), at(&format!("made.{ending}")))
                .expect("a link");
        }
        std::os::unix::fs::symlink(format!("out/{name}"), at("tables")).expect("a link");
        // Under names that say nothing.
        for (nth, table) in ["ATTITUDE.csv", ".hums"].iter().enumerate() {
            fs::copy(at("out").join(&name).join(table), at(&format!("renamed.{nth}"))).expect("a copy");
        }
        for ending in ["jsonl", "lp"] {
            fs::copy(at(&format!("out/{name}.{ending}")), at(&format!("{ending}.txt"))).expect("a copy");
        }
        for table in ["flightvalues", "esc_status", "esc_info", "vfr_hud", "gaps"] {
            let of = at(&format!("out/{name}.thesis/{table}.csv"));
            fs::copy(of, at(&format!("{table}.txt"))).expect("a copy");
        }
        fs::write(at("gaps"), "from[s],to[s],cause,sectors_lost,sectors_skipped,frames_missing\n")
            .expect("written");
        fs::copy(at("out/index.html"), at("page")).expect("a copy");
        assert!(shell(dir.path(), "gzip -c renamed.0 > packed").status.success());
        fs::copy(at("flight.tlog"), at("folder/NAME.HUM")).expect("a copy");
        let session = contents(&at("out")).into_iter().find(|(name, _)| name.ends_with("ATTITUDE.parquet"));
        fs::write(at("part.parquet.mine"), session.expect("a table").1).expect("written");
        // Damaged from its beginning on: only its name says what it is.
        fs::write(at("folder/bad.ulg"), [7; 5_000]).expect("written");
        fs::write(at("there"), "what was there").expect("written");
        let before = stamps(dir.path());
        Self { dir, before }
    }

    /// It is refused, nothing is changed, and the stream that is left (where one is) says why.
    #[track_caller]
    fn refuses(&self, line: &str) {
        let ended = shell(self.dir.path(), line);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned() + &text(&ended);
        assert!(stamps(self.dir.path()) == self.before, "{line} changed something\n{said}");
        assert_eq!(ended.status.code(), Some(2), "{line}: {said}");
        let is_told = said.contains(": goes into ") && said.contains("nothing was written");
        let is_nowhere = line.contains("&>>") || line.contains("2>&1");
        assert_eq!(is_told, !is_nowhere, "{line}: {said}");
    }
}

#[test]
fn nothing_that_is_said_goes_into_a_file_that_the_command_line_names() {
    let place = Place::new();
    for (line, input) in [
        ("info flight.tlog", "flight.tlog"),
        ("info flight.tlog/", "flight.tlog"),
        ("check --json flight.tlog", "flight.tlog"),
        ("decode log.hum -o new --format tlog", "link-log.hum"),
        ("report log.hum -o new.html", "hard-log.hum"),
        ("report log.hum -othere", "there"),
        ("pack flight.tlog -o new.hum", "flight.tlog"),
        ("sim --input flight.tlog --params hums.param --sd new.img", "hums.param"),
        ("check flight.tlog --params hums.param", "hums.param"),
        ("check --json - < flight.tlog", "flight.tlog"),
        ("live --input - --listen 127.0.0.1:0 < flight.tlog", "hard-flight.tlog"),
        ("demo --input flight.tlog --dashboard never", "link-flight.tlog"),
        ("params list --link udpout:127.0.0.1:9 --key=key.txt", "key.txt"),
        ("check nosuch there", "there"),
        ("--nonsense there", "there"),
    ] {
        for into in [">>", "2>>", "&>>", "1<>", "2<>"] {
            place.refuses(&format!("hums {line} {into} {input}"));
        }
    }
}

#[test]
fn nothing_that_is_said_goes_behind_a_recording_or_what_is_made_of_one_wherever_it_lies() {
    let place = Place::new();
    let commands =
        ["info folder", "verify .", "check nosuch", "--help", "man decode", "decode log.hum -o out"];
    let kept = [
        "folder/flight.tlog",
        "folder/log.hum",
        "folder/NAME.HUM",
        "folder/bad.ulg",
        "card.img",
        "store.bin",
        "part.parquet.mine",
        "made.tlog",
        "made.jsonl",
        "made.lp",
        "tables/ATTITUDE.csv",
        "tables/table",
        "tables/.hums",
        "out/index.html",
        "renamed.0",
        "renamed.1",
        "jsonl.txt",
        "lp.txt",
        "flightvalues.txt",
        "esc_status.txt",
        "esc_info.txt",
        "vfr_hud.txt",
        "gaps.txt",
        "gaps",
        "page",
        "packed",
    ];
    for (at, into) in kept.iter().enumerate() {
        // Each command with each way, and each file with each way.
        for (way, redirection) in [">>", "2>>", "&>>"].iter().enumerate() {
            let command = commands[(at + way) % commands.len()];
            place.refuses(&format!("hums {command} {redirection} {into}"));
        }
    }
    // Nor is it there behind what somebody else has said in it.
    place.refuses("cp log.hum new.hum; (hums info log.hum) 3<>new.hum >&3; code=$?; rm new.hum; exit $code");
}

#[test]
fn nothing_is_written_over_what_is_in_a_file_that_somebody_opened() {
    let place = Place::new();
    for line in [
        "hums --help 1<>there",
        "hums man 1<>there 2>&1",
        "hums completions bash 1<>there",
        "hums --nonsense 2<>there",
        "hums ls nonexistent 2<>there",
        "hums ls nonexistent 2<>folder/hums.param",
        "hums info log.hum 1<>there",
        "hums decode log.hum --format tlog -o - 1<>there",
        "hums report log.hum -o /dev/stdout 1<>there",
        "hums decode log.hum --format tlog -o /dev/fd/7 7<>there",
    ] {
        if line.contains("/fd/7") {
            let ended = shell(place.dir.path(), line);
            let said = String::from_utf8_lossy(&ended.stderr).into_owned();
            assert!(said.contains("has something in it where it would be written"), "{line}: {said}");
            assert!(stamps(place.dir.path()) == place.before, "{line}");
        } else {
            place.refuses(line);
        }
    }
}

#[test]
fn what_is_said_may_follow_a_text() {
    let dir = furnished();
    let at = |name: &str| dir.path().join(name);
    for line in [
        "hums info folder >> notes 2>&1",
        "(echo first; hums info folder; hums check folder --json) > folder/notes.txt",
        "hums ls nosuch 2>> notes",
        "hums info . >> folder/notes.txt",
        "hums check --json flight.tlog >> results.jsonl; hums check --json flight.tlog >> results.jsonl",
        "hums completions bash > folder/new",
    ] {
        fs::write(at("notes"), "what was there").expect("written");
        let ended = shell(dir.path(), line);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(matches!(ended.status.code(), Some(0 | 1 | 4)), "{line}: {said}");
        assert!(fs::read(at("notes")).expect("there").starts_with(b"what was there"), "{line}");
    }
    // As power that went leaves a log of this PC; and what was said in another script than ASCII's, in colour.
    for text in [[&[b'.'; 600][..], &[0; 600]].concat(), "\u{1b}[31mHöhe\u{1b}[0m\t1\r\n".into()] {
        fs::write(at("notes"), text).expect("written");
        assert_eq!(shell(dir.path(), "hums info folder >> notes 2>&1").status.code(), Some(0));
    }
}

#[test]
fn what_is_made_goes_behind_nothing() {
    let dir = furnished();
    let made = "echo mine > notes; hums decode log.hum -o - --format tlog > all.tlog && hums pack flight.tlog -o - > all.hum && \
                hums decode log.hum -o - --format tlog | cat >> notes";
    assert!(shell(dir.path(), made).status.success());
    assert_eq!(frames_of(&dir.path().join("all.tlog")).len(), frames_of(&px4()).len());
    let before = contents(dir.path());
    for line in [
        "hums pack flight.tlog -o - >> all.hum",
        "hums pack flight.tlog -o - >> all.hum 2>&1",
        "hums pack flight.tlog -o /dev/stdout >> all.hum",
        "hums pack flight.tlog -o /dev/fd/7 7>>all.hum",
        "hums decode log.hum -o - --format tlog >> all.tlog",
        "hums decode log.hum -o - --format jsonl >> all.tlog",
        "hums decode log.hum -o - --format jsonl >> notes",
        "hums report log.hum -o - >> folder/flight.tlog",
        "hums report log.hum -o /dev/fd/7 7>>notes",
        "hums sim --input flight.tlog --sd card.img --gs - >> notes",
        "hums sim --input flight.tlog --sd card.img --tap - >> notes",
        "hums sim --input flight.tlog --sd card.img --gs /dev/stdout >> notes",
    ] {
        let ended = shell(dir.path(), line);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(2), "{line}: {said}");
        assert!(line.contains("2>&1") || said.contains("nothing was written"), "{line}: {said}");
        assert!(contents(dir.path()) == before, "{line}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_standard_error_on_a_full_disk_ends_nothing() {
    let dir = furnished();
    assert_eq!(shell(dir.path(), "hums ls nosuch 2> /dev/full").status.code(), Some(1));
    // What is said in flight cannot be said: the card has all of it.
    let line = "hums sim --input flight.tlog --sd card.img --card-size 34 --tap /dev/full 2> /dev/full";
    assert_eq!(shell(dir.path(), line).status.code(), Some(3));
    let line = "hums decode card.img -o all.tlog --format tlog";
    assert_eq!(shell(dir.path(), line).status.code(), Some(0));
    assert_eq!(frames_of(&dir.path().join("all.tlog")).len(), frames_of(&px4()).len());
}
