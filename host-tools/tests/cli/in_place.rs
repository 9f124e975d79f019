//! Files that are updated in place (a card's image, a store), and names of times and counts of recordings.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::{attempt, contents, flight, hums, json, piped, px4, recorded, run, stderr, text, until};

fn is_begun(dir: &Path) -> bool {
    let mut names = fs::read_dir(dir).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    names.any(|name| name.to_string_lossy().starts_with(".gs."))
}

#[test]
fn two_runs_do_not_use_one_card_or_one_store() {
    let dir = recorded();
    let mut first = Command::new(env!("CARGO_BIN_EXE_hums"))
        .args(["sim", "-", "--sd", "card.img", "--store", "store", "--gs", "gs"])
        .current_dir(dir.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("it runs");
    let tlog = fs::read(px4()).expect("a recording");
    let mut input = first.stdin.take().expect("it is piped");
    input.write_all(&tlog[..tlog.len() / 2]).expect("it reads");
    until("it records", || is_begun(dir.path()));
    for line in ["sim PX4 --sd card.img", "sim PX4 --sd new.img --store store"] {
        let said = stderr(&run(dir.path(), line, 1));
        assert!(said.contains("another run of hums is using it; wait for its end"), "{said}");
    }
    drop(input);
    assert_eq!(first.wait().expect("it is ours").code(), Some(3));
    run(dir.path(), "sim PX4 --sd card.img --store store", 0);
    run(dir.path(), "info --verify card.img", 0);
}

#[test]
fn what_has_no_frame_changes_neither_card_nor_store_and_a_compressed_recording_is_one() {
    let dir = tempfile::tempdir().expect("directory");
    let write = |name: &str, bytes: &[u8]| fs::write(dir.path().join(name), bytes).expect("written");
    let packed = |bytes: &[u8]| {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(bytes).expect("packed");
        gzip.finish().expect("packed")
    };
    let recording = fs::read(flight("ap_quad_signed.raw")).expect("a recording");
    let raw = &recording[..20_000];
    write("plain.raw", raw);
    write("same.raw.gz", &packed(raw));
    write("cut.raw.gz", &packed(raw)[..9_000]);
    let frames = |name: &str, code: i32| {
        let ended = run(dir.path(), &format!("sim {name} --sd {name}.img --card-size 34 --json"), code);
        json(&ended)["frames_in"].as_u64().expect("a count")
    };
    let all = frames("plain.raw", 0);
    assert_eq!(frames("same.raw.gz", 0), all);
    assert!((1..all).contains(&frames("cut.raw.gz", 3)), "a part of it");
    run(dir.path(), "sim plain.raw --sd plain.raw.img --store store", 0);

    let text = "no frame in here\n".repeat(500);
    write("text", text.as_bytes());
    write("text.gz", &packed(text.as_bytes()));
    write("log.bin", &[&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", &[0; 75]].concat());
    write("twice.gz", &packed(&packed(raw)));
    write("empty", b"");
    let before = contents(dir.path());
    for (input, why) in [
        ("missing", "missing: "),
        ("empty", "empty: "),
        (".", ""),
        ("text", "has no MAVLink frame, so nothing was written"),
        ("text.gz", "has no MAVLink frame"),
        ("log.bin", "is an ArduPilot log (DataFlash), which has no MAVLink frames"),
        ("twice.gz", "is compressed twice"),
        ("-", "has no MAVLink frame"),
    ] {
        for to in ["plain.raw.img --store store --overwrite-oldest", "new.img --store new --tap tap --gs gs"]
        {
            let line = format!("sim {input} --sd {to}");
            let ended = piped(hums().current_dir(dir.path()).args(line.split(' ')), text.as_bytes());
            let said = stderr(&ended);
            assert_eq!(ended.status.code(), Some(1), "{line}: {said}");
            assert!(said.contains(why), "{line}: {said}");
        }
    }
    assert!(contents(dir.path()) == before, "something was written");
}

#[test]
fn a_damaged_store_is_told_and_one_that_cannot_be_read_is_refused_and_stays() {
    let dir = tempfile::tempdir().expect("directory");
    let recording = fs::read(flight("ap_quad_signed.raw")).expect("a recording");
    fs::write(dir.path().join("short.raw"), &recording[..20_000]).expect("written");
    let sim = "sim short.raw --sd card.img --store store";
    let store = dir.path().join("store");
    let boots = || {
        let told = json(&run(dir.path(), "info card.img --json", 0));
        let last = told["logs"].as_array().and_then(|logs| logs.last()).expect("a log");
        last["lifetime"]["boots"].as_f64().expect("a counter")
    };
    for boot in 1..3 {
        run(dir.path(), sim, 0);
        assert_eq!(boots() as i32, boot);
    }
    let whole = fs::read(&store).expect("a store");
    for (told, (at, bytes)) in (1..).zip([(0, 1), (200, 8), (400, 8), (800, 8)]) {
        let mut damaged = whole.clone();
        damaged[at..at + bytes].fill(0xA5);
        fs::write(&store, &damaged).expect("written");
        let said = run(dir.path(), sim, 0);
        assert!((1.0..=3.0).contains(&boots()), "{at}: {}", boots());
        let said = String::from_utf8_lossy(&said.stderr);
        assert!(said.contains("--store store: is damaged: a stored item was lost"), "{at}: {said}");
        run(dir.path(), &format!("decode card.img -o out{at} --format jsonl"), 0);
        let records: Vec<u8> =
            contents(&dir.path().join(format!("out{at}"))).into_iter().flat_map(|(_, bytes)| bytes).collect();
        let records = String::from_utf8_lossy(&records);
        assert_eq!(records.matches("a saved value was lost, using an older one").count(), told, "{at}");
    }
    let mut damaged = whole;
    for at in [0, 16_384] {
        damaged[at..at + 64].fill(0);
    }
    let (no_store, with_magic) = (vec![0x5A; 32_768], [&b"2TSH"[..], &vec![0x5A; 32_764]].concat());
    for (bytes, why) in [
        (&damaged[..], "name a new file"),
        (&no_store, "is no store, though it has the length of one"),
        (&with_magic, "move it away, or name a new file"),
        (b"too short", "is no store"),
    ] {
        fs::write(&store, bytes).expect("written");
        let said = stderr(&run(dir.path(), &format!("{sim} --overwrite-oldest"), 1));
        assert!(said.contains(why), "{said}");
        assert!(fs::read(&store).expect("there") == bytes);
    }
}

#[test]
fn a_store_that_is_read_only_is_refused_as_an_image_is() {
    let dir = recorded();
    run(dir.path(), "sim PX4 --sd new.img --store store", 0);
    for name in ["card.img", "store"] {
        let path = dir.path().join(name);
        let mut permissions = path.metadata().expect("there").permissions();
        permissions.set_readonly(true);
        fs::set_permissions(path, permissions).expect("ours");
    }
    let before = contents(dir.path());
    for line in ["sim PX4 --sd card.img", "sim PX4 --sd new.img --store store"] {
        let said = stderr(&run(dir.path(), line, 1));
        assert!(said.contains(": is read-only; make it writable or name another"), "{line}: {said}");
    }
    assert!(contents(dir.path()) == before, "something was written");
}

#[test]
fn an_image_is_whole_or_not_there_and_one_without_a_partition_table_is_told() {
    let dir = tempfile::tempdir().expect("directory");
    let image = dir.path().join("card.img");
    let program = env!("CARGO_BIN_EXE_hums");
    let limited = format!("ulimit -f 1024; exec {program} sim {} --sd card.img", px4().display());
    let ended =
        Command::new("bash").args(["-c", &limited]).current_dir(dir.path()).output().expect("it runs");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("card.img: cannot have"), "{said}");
    assert_eq!(fs::read_dir(dir.path()).expect("a directory").count(), 0, "nothing is left");
    fs::write(dir.path().join(".card.img.hums-part"), [0; 512]).expect("written");
    run(dir.path(), "sim PX4 --sd card.img", 0);
    assert_eq!(fs::read_dir(dir.path()).expect("a directory").count(), 2);
    fs::File::create(&image).and_then(|file| file.set_len(64 << 20)).expect("made");
    let said = stderr(&run(dir.path(), "sim PX4 --sd card.img", 3));
    assert!(
        said.contains("the card has no partition table (MBR), so that nothing can be recorded on it"),
        "{said}"
    );
    assert!(said.contains("name an image of a card, or a new file"), "{said}");
}

#[test]
fn a_store_beside_recordings_is_named_and_is_no_loss() {
    let dir = recorded();
    run(dir.path(), "sim PX4 --sd new.img --store store.bin", 0);
    for line in
        ["info .", "check .", "info --list .", "info --verify .", "decode . -o out --format tlog --to 1"]
    {
        let said = stderr(&run(dir.path(), line, 0));
        assert!(said.contains("store.bin: is the memory of a simulated board, and"), "{line}: {said}");
    }
    let said = run(dir.path(), "check store.bin", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("is the memory of a simulated board"));
    fs::write(dir.path().join("flight.bin"), vec![7; 32 << 10]).expect("written");
    run(dir.path(), "info .", 3);
}

#[test]
fn a_store_that_cannot_be_made_leaves_nothing_that_is_in_the_way() {
    let dir = tempfile::tempdir().expect("a folder");
    run(dir.path(), "sim PX4 --sd card.img --card-size 34", 0);
    let (before, program) = (contents(dir.path()), env!("CARGO_BIN_EXE_hums"));
    // No file may be longer than this, in KiB: a write beyond it fails as on a full disk. A store has 32.
    let limited = |kib: u32, line: &str| {
        let line =
            format!("ulimit -f {kib}; exec {program} {}", line.replace("PX4", &px4().display().to_string()));
        let ended =
            Command::new("bash").args(["-c", &line]).current_dir(dir.path()).output().expect("it runs");
        let said = stderr(&ended);
        assert_eq!(ended.status.code(), Some(1), "{line}: {said}");
        said
    };
    let said = limited(20, "sim PX4 --sd card.img --store store");
    assert!(said.contains("store: cannot be written"), "{said}");
    assert!(contents(dir.path()) == before, "{said}");
}

#[test]
fn a_run_that_is_killed_leaves_a_card_and_a_store_that_the_next_one_goes_on_with() {
    let dir = recorded();
    for after_ms in [0, 3, 10, 30, 60] {
        let mut sim = Command::new(env!("CARGO_BIN_EXE_hums"))
            .args(["sim", "--sd", "card.img", "--store", "store"])
            .arg(px4())
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it runs");
        std::thread::sleep(std::time::Duration::from_millis(after_ms));
        sim.kill().expect("it is ours");
        sim.wait().expect("it is ours");
        let told = text(&attempt(dir.path(), "info --verify card.img"));
        assert!(told.starts_with("Card card.img: ok; "), "{after_ms} ms: {told}");
    }
    run(dir.path(), "sim PX4 --sd card.img --store store", 0);
    let told = json(&attempt(dir.path(), "info card.img --json"));
    let logs = told["logs"].as_array().expect("logs");
    assert!(logs[0]["frames"] == 16_645 && logs.last().expect("one")["frames"] == 16_645, "{told}");
}

#[test]
fn what_is_no_card_is_no_card_for_a_run_and_stays_as_it_is() {
    let dir = tempfile::tempdir().expect("directory");
    let at = |name: &str| dir.path().join(name);
    run(dir.path(), "sim PX4 --sd card.img --card-size 34", 0);
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let [tlog, log] = [px4(), at("log.hum")].map(|path| fs::read(path).expect("a recording"));
    let card = fs::read(at("card.img")).expect("an image");
    let mut damaged = card.clone();
    let volume = 2048 * 512;
    damaged[volume..volume + 512].fill(0x5a);
    let mut exfat = card[..512].to_vec();
    exfat[450] = 7;
    let mut used = exfat.clone();
    used.resize(1 << 20, 0);
    used.extend_from_slice(b"somebody's files");
    for (name, bytes, why) in [
        ("flight.tlog", tlog.as_slice(), "has no partition table"),
        ("joined.hum", &log, "has no partition table"),
        ("damaged.img", &damaged, "volume is damaged"),
        ("exfat.img", &used, "is of type 0x07, not FAT32"),
    ] {
        fs::write(at(name), bytes).expect("written");
        fs::File::options().write(true).open(at(name)).and_then(|file| file.set_len(40 << 20)).expect("room");
        let before = fs::read(at(name)).expect("there");
        let said = stderr(&run(dir.path(), &format!("sim PX4 --sd {name}"), 1));
        assert!(said.contains(why) && said.contains("it stays. Name an image"), "{name}: {said}");
        assert!(fs::read(at(name)).expect("there") == before, "{name}");
    }
    fs::write(at("few.tlog"), &tlog[..4000]).expect("written");
    let said = run(dir.path(), "sim PX4 --sd few.tlog", 1);
    assert!(String::from_utf8_lossy(&said.stderr).contains("is no image of an SD card"));
    // A card with nothing but a table may be formatted by command, and is reported.
    fs::write(at("new.img"), &exfat).expect("written");
    fs::File::options()
        .write(true)
        .open(at("new.img"))
        .and_then(|file| file.set_len(40 << 20))
        .expect("room");
    run(dir.path(), "sim PX4 --sd new.img", 3);
}

#[test]
fn a_store_that_is_refused_leaves_no_card_and_a_card_that_is_refused_no_store() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("text"), "no store").expect("written");
    for store in ["text", ".", "missing/store"] {
        run(dir.path(), &format!("sim PX4 --sd card.img --store {store}"), 1);
    }
    fs::create_dir(dir.path().join("folder")).expect("made");
    run(dir.path(), "sim PX4 --sd folder --store store", 1);
    for name in ["card.img", "store", "missing"] {
        assert!(!dir.path().join(name).exists(), "{name}");
    }
}

fn late_log() -> String {
    let formats = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 129, 23, ATT, Qff, TimeUS,Roll,Pitch\n";
    (0..11).fold(formats.to_owned(), |log, second| {
        log + &format!("ATT, {}, {second}.5, 2.0\n", (300 + second) * 1_000_000)
    })
}

#[test]
fn the_times_asked_for_are_those_that_the_tables_have_and_what_was_written_is_counted() {
    let dir = tempfile::tempdir().expect("directory");
    fs::write(dir.path().join("late.log"), late_log()).expect("written");
    let rows = |flags: &str| {
        let line = format!("decode late.log -o - --format jsonl --message ATT {flags}");
        text(&run(dir.path(), &line, 0)).lines().filter(|line| line.contains("\"ATT\"")).count()
    };
    assert_eq!([rows(""), rows("--from 305"), rows("--to 302"), rows("--from 302 --to 304")], [11, 6, 3, 3]);
    let said = stderr(&run(dir.path(), "decode late.log -o - --format jsonl --from 5000", 1));
    assert!(said.contains("its times go from 300.000 s to 310.000 s"), "{said}");
    let said = text(&run(dir.path(), "decode late.log -o out/ --format jsonl,csv --message ATT", 0));
    // With the row that names the recorder of the checks.
    assert!(said.contains(".jsonl: 12 objects") && said.contains(": 2 tables, 12 rows"), "{said}");
}
