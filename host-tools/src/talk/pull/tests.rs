use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

use hums_blackbox::record::{Clock, FindingRecord, Mark, MarkReason, Note};
use hums_blackbox::{Header, Record, SECTOR_BYTES, Sector, SectorSink, Writer};
use hums_core::clock::Instant;
use hums_core::health::{Level, Subsystem};
use hums_link::messages;
use hums_link::packet::Fields;
use hums_recorder::card::SEGMENT_BYTES_MAX;

use super::*;
use crate::talk::tests::fake;

pub(super) fn packed(dir: &Path, name: &str) -> Vec<u8> {
    let input = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/flights").join(name);
    let output = dir.join(name);
    let words = ["hums", "decode", "--format", "hum", "-o"].map(OsString::from);
    crate::run(words.into_iter().chain([output.clone().into(), input.into()]));
    fs::read(output).expect("there")
}

const NAME: &str = "00001_00.HUM";

fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("there");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("there").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

type Files = Vec<(String, Vec<u8>)>;

/// Before each answer `change` gets the logs and the opcode, and may give an error.
fn board_of(files: Files, change: impl FnMut(&mut Files, u8) -> Option<u8> + Send + 'static) -> Client {
    board_with(files, None, change)
}

/// The card does not list this name.
fn board_with(
    mut files: Files,
    skipped: Option<&'static str>,
    mut change: impl FnMut(&mut Files, u8) -> Option<u8> + Send + 'static,
) -> Client {
    let mut open = 0;
    fake::found(&[1], move |frame| {
        let asked = Fields(frame.payload().get(3..).unwrap_or_default());
        let (opcode, size, at) = (asked.u8(3), usize::from(asked.u8(4)), asked.u32(8) as usize);
        let sequence = asked.u16(0);
        let error = change(&mut files, opcode);
        let said = |more: u16, kind: u8, at: usize, is_last: bool, data: &[u8]| {
            let [s0, s1] = sequence.wrapping_add(more).to_le_bytes();
            let head = [s0, s1, 0, kind, data.len() as u8, opcode, u8::from(is_last), 0];
            let payload = [&head[..], &(at as u32).to_le_bytes(), data].concat();
            (1, messages::file_transfer(255, 190, &payload))
        };
        if let Some(error) = error {
            return vec![said(1, 129, 0, false, &[error])];
        }
        if opcode == 4 {
            let path: Vec<u8> = (0..size).map(|byte| asked.u8(12 + byte)).collect();
            let is_it = |(name, _): &(String, Vec<u8>)| format!("/{name}").as_bytes() == path;
            let Some(found) = files.iter().position(is_it) else {
                return vec![said(1, 129, 0, false, &[10])];
            };
            open = found;
        }
        let log = &files[open].1;
        let answer = |more: u16, at: usize, is_last: bool, data: &[u8]| said(more, 128, at, is_last, data);
        match opcode {
            3 if at >= files.len() => vec![said(1, 129, 0, false, &[6])],
            3 if Some(files[at].0.as_str()) == skipped => vec![answer(1, at, false, b"S\0")],
            3 => {
                let (name, log) = &files[at];
                vec![answer(1, at, false, format!("F{name}\t{}\0", log.len()).as_bytes())]
            }
            4 => vec![answer(1, 0, false, &(log.len() as u32).to_le_bytes())],
            5 => vec![answer(1, at, false, &log[at.min(log.len())..(at + size).min(log.len())])],
            14 => {
                let sum = hums_link::ftp::checksum(0, &log[..at.min(log.len())]);
                vec![answer(1, at, false, &sum.to_le_bytes())]
            }
            15 => {
                let pieces = log[at..].chunks(size).take(20).enumerate();
                let is_last = |piece: usize| piece == 19 || at + (piece + 1) * size >= log.len();
                pieces.map(|(n, data)| answer(n as u16 + 1, at + n * size, is_last(n), data)).collect()
            }
            _ => vec![answer(1, 0, false, &[])],
        }
    })
}

/// Replaced by the other log at this request for bytes.
fn board(log: Vec<u8>, other: Vec<u8>, mut reads: u32) -> Ftp {
    let client = board_of(vec![(NAME.to_owned(), log)], move |files, opcode| {
        if matches!(opcode, 5 | 15) {
            reads = reads.saturating_sub(1);
            if reads == 0 {
                files[0].1.clone_from(&other);
            }
        }
        None
    });
    Ftp::new(client).expect("it answers")
}

/// First sectors, and the name that `pull` gives the first.
fn two_logs(dir: &Path) -> (Vec<u8>, Vec<u8>, String) {
    let [one, other] = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"]
        .map(|name| packed(dir, name).get(..80 * SECTOR_BYTES).expect("a longer log").to_vec());
    let path = dir.join("one.HUM");
    fs::write(&path, &one).expect("written");
    let name = heading_here(&path, NAME, one.len() as u32).expect("it reads").name;
    (one, other, name)
}

#[test]
fn a_log_begins_anew_when_the_card_loses_some_of_it_and_is_not_mixed_with_another_one_that_comes_in_its_place()
 {
    let dir = tempfile::tempdir().expect("a folder");
    let (log, other, name) = two_logs(dir.path());
    let mut lost = log.clone();
    lost[4096..8192].fill(0);
    for (next, case) in [(&lost, "lost"), (&other, "exchanged")] {
        let output = dir.path().join(case);
        fs::create_dir(&output).expect("made");
        let part = output.join(format!(".{name}.pull.hums-part"));
        fs::write(&part, &log[..20_000]).expect("written");
        // The heading is read before.
        let mut ftp = board(log.clone(), next.clone(), 8 * 3 + 1);
        let pulled = pull(&mut ftp, NAME, &output);
        if case == "lost" {
            let (path, is_new) = pulled.expect("it came").expect("a log");
            assert!(is_new && fs::read(path).expect("there") == lost);
        } else {
            let told = pulled.expect_err("it is another one").to_string();
            assert!(told.contains("replaced it during the download"), "{told}");
            assert_eq!(names_in(&output), Vec::<String>::new());
        }
    }
    let output = dir.path().join("early");
    fs::create_dir(&output).expect("made");
    let mut ftp = board(log.clone(), other.clone(), 8 * 3 + 1);
    let told = pull(&mut ftp, NAME, &output).expect_err("it is another one").to_string();
    assert!(told.contains("replaced it during the download"), "{told}");
    assert_eq!(names_in(&output), Vec::<String>::new());
}

#[test]
fn a_card_that_loses_the_beginning_of_a_log_is_not_called_another_log() {
    let dir = tempfile::tempdir().expect("a folder");
    let (log, _, name) = two_logs(dir.path());
    // The first sector alone, then the whole first page.
    let without = |bytes: usize| [&vec![0; bytes][..], &log[bytes..]].concat();
    for (next, words) in
        [(without(SECTOR_BYTES), None), (without(8 * SECTOR_BYTES), Some("can no longer read its beginning"))]
    {
        let output = tempfile::tempdir().expect("a folder");
        let mut ftp = board(log.clone(), next.clone(), 8 * 3 + 5);
        let pulled = pull(&mut ftp, NAME, output.path());
        let Some(words) = words else {
            let (path, _) = pulled.expect("it came").expect("a log");
            assert_eq!(
                (path.file_name().expect("a name"), fs::read(&path).expect("there")),
                (name.as_ref(), next)
            );
            continue;
        };
        let told = pulled.expect_err("nothing tells what it is").to_string();
        assert!(told.contains(words), "{told}");
        assert_eq!(names_in(output.path()), Vec::<String>::new());
    }
}

#[test]
fn what_is_no_file_in_the_place_of_a_log_is_told_and_left() {
    let dir = tempfile::tempdir().expect("a folder");
    let (log, other, name) = two_logs(dir.path());
    let output = dir.path().join("logs");
    fs::create_dir_all(output.join(&name)).expect("made");
    let mut ftp = board(log, other, u32::MAX);
    let told = pull(&mut ftp, NAME, &output).expect_err("a folder").to_string();
    assert!(told.contains("is not a file; move it away"), "{told}");
    assert_eq!(names_in(&output), [name]);
}

#[test]
fn a_part_has_sectors_of_one_session_also_where_the_log_is_exchanged_while_it_is_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let (log, other, name) = two_logs(dir.path());
    let what: cli::LogMoment = "0".parse().expect("a time");
    let mut ftp = board(log.clone(), other, 8 * 3 + 5);
    let span = hums_core::clock::Span::from_secs(9_999);
    let files = [(NAME.to_owned(), log.len() as u32)];
    let brought = around::pull(&mut ftp, &files, dir.path(), (&what, span)).expect("a part");
    let [(_, path)] = &brought.files[..] else { panic!("{brought:?}") };
    assert_eq!(path, &crate::logs::naming::part_name(&dir.path().join(name)));
    let part = fs::read(path).expect("there");
    assert_eq!(part.len(), log.len());
    let mut others = 0;
    for (ours, theirs) in part.chunks(SECTOR_BYTES).zip(log.chunks(SECTOR_BYTES)) {
        // Half of each sector, which fails its check.
        let is_sector = Header::read(ours.first_chunk().expect("a sector")).is_ok();
        assert!(ours == theirs || !is_sector);
        others += u32::from(!is_sector && ours.iter().any(|byte| *byte != 0));
    }
    assert!(others <= 1, "{others}");
    assert_eq!(brought.outcome, Outcome::Losses);
}

/// Seconds of [`recorded`], and its criticals.
const SECONDS: u64 = 1_500;
const CRITICALS_S: [u64; 2] = [200, 1_000];
/// UTC at its power-on, microseconds since 1970.
const EPOCH_US: u64 = 1_790_000_000_000_000;

#[derive(Default)]
struct Memory {
    sectors: Vec<u8>,
    session: u32,
}

impl SectorSink for Memory {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(self.session);
        self.sectors.extend_from_slice(sector.bytes());
    }
}

/// A note each tenth of a second, two criticals, the time of day at once; ends in order.
fn recorded(session: u32, seconds: u64) -> Vec<u8> {
    recorded_by(session, seconds, &[(10, EPOCH_US)])
}

/// Tenth of a second, and UTC at power-on.
fn recorded_by(session: u32, seconds: u64, clocks: &[(u64, u64)]) -> Vec<u8> {
    let mut memory = Memory { session, ..Memory::default() };
    let mut writer = Box::new(Writer::new());
    for tenth in 0..seconds * 10 {
        let at = Instant::from_millis(tenth * 100);
        let mut record = |record: Record<'_>| writer.record(at, &record, &mut memory).expect("there is room");
        let random = tenth.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from(session);
        let text = format!("{random:016x}{:016x}", random.rotate_left(29) ^ tenth);
        record(Record::Note(Note { severity: 6, text: &text }));
        for (_, epoch_us) in clocks.iter().filter(|(from, _)| *from == tenth) {
            record(Record::Clock(Clock { boot: at, utc_micros: epoch_us + at.as_micros(), source: 3 }));
        }
        if CRITICALS_S.contains(&(tenth / 10)) && tenth % 10 == 0 {
            record(Record::Finding(FindingRecord {
                at,
                subsystem: Subsystem::Propulsion,
                check: "motor_loss",
                instance: 1,
                level: Level::Critical,
                previous: Level::Ok,
                value: 1.0,
                limit: 0.5,
                unit: "",
            }));
        }
    }
    writer.finish(&mut memory);
    memory.sectors
}

#[derive(clap::Parser)]
struct Line {
    #[command(flatten)]
    pull: cli::Pull,
}

fn brought(files: &Files, args: &[&str]) -> Result<Outcome> {
    brought_of(board_of(files.clone(), |_, _| None), args)
}

fn brought_of(board: Client, args: &[&str]) -> Result<Outcome> {
    brought_into(tempfile::tempdir().expect("a folder").path(), board, args)
}

fn brought_into(output: &Path, board: Client, args: &[&str]) -> Result<Outcome> {
    let folder = output.to_str().expect("a name");
    let line = ["pull", "--link", "udpin:127.0.0.1:14550", "--json", "-o", folder];
    let line = <Line as clap::Parser>::try_parse_from(line.iter().chain(args)).expect("good");
    bring(board, &line.pull)
}

fn named(log: Vec<u8>) -> Files {
    vec![(NAME.to_owned(), log)]
}

/// First place, and the one behind it.
fn group_at(log: &[u8], second: u64) -> std::ops::Range<usize> {
    let starts = (0..).zip(log.chunks(SECTOR_BYTES)).filter_map(|(place, sector)| {
        let sector = Sector::from_bytes(*sector.first_chunk().expect("a sector"));
        Some((place, sector.preamble()?.start_ms))
    });
    let (before, after): (Vec<_>, Vec<_>) = starts.partition(|(_, start_ms)| *start_ms <= second * 1_000);
    before.last().expect("it begins").0..after.first().map_or(log.len() / SECTOR_BYTES, |(place, _)| *place)
}

fn spoiled(log: &[u8], place: usize) -> Vec<Files> {
    let at = place * SECTOR_BYTES;
    let with = |sector: &[u8]| {
        let mut log = log.to_vec();
        log[at..at + SECTOR_BYTES].copy_from_slice(sector);
        named(log)
    };
    let mut flipped = log[at..at + SECTOR_BYTES].to_vec();
    flipped[100] ^= 1;
    let other = recorded(8, 10);
    let elsewhere = (place + 7) * SECTOR_BYTES % log.len();
    vec![
        with(&[0; SECTOR_BYTES]),
        with(&[0xff; SECTOR_BYTES]),
        with(&[b'x'; SECTOR_BYTES]),
        with(&flipped),
        with(&other[SECTOR_BYTES..2 * SECTOR_BYTES]),
        with(&log[elsewhere..elsewhere + SECTOR_BYTES]),
    ]
}

#[test]
fn a_moment_of_which_a_sector_is_lost_is_told() {
    let log = recorded(7, SECONDS);
    let moment = ["--around", "10:00", "--span", "1"];
    assert_eq!(brought(&named(log.clone()), &moment).expect("it comes"), Outcome::Done);
    let (here, before) = (group_at(&log, 600), group_at(&log, 100));
    assert!(before.end < here.start, "{before:?} {here:?}");
    for place in [here.start, here.start + 5, here.end - 1] {
        for files in spoiled(&log, place) {
            assert_eq!(brought(&files, &moment).expect("it comes"), Outcome::Losses, "{place}");
        }
    }
    for files in spoiled(&log, before.start + 20) {
        assert_eq!(brought(&files, &moment).expect("it comes"), Outcome::Done);
    }
}

#[test]
fn a_search_tells_what_it_could_not_read() {
    let log = recorded(7, SECONDS);
    let search = ["--around", "critical", "--span", "1"];
    assert_eq!(brought(&named(log.clone()), &search).expect("found"), Outcome::Done);
    let short = recorded(7, 100);
    for files in [named(short.clone()), named(short[..short.len() - SECTOR_BYTES].to_vec())] {
        let told = brought(&files, &search).expect_err("there is none").to_string();
        assert!(told.contains("no such finding is in this log"), "{told}");
    }
    let [first, last] = CRITICALS_S.map(|second| group_at(&log, second));
    let later = group_at(&log, SECONDS - 50);
    assert!(first.end < last.start && last.end <= later.start, "{first:?} {last:?} {later:?}");
    for place in [last.start, last.start + 1, later.start, later.start + 5, log.len() / SECTOR_BYTES - 2] {
        for files in spoiled(&log, place) {
            assert_eq!(brought(&files, &search).expect("one is found"), Outcome::Losses, "{place}");
        }
    }
    for files in spoiled(&log, first.start + 20) {
        assert_eq!(brought(&files, &search).expect("found"), Outcome::Done);
    }
}

#[test]
fn a_moment_at_which_nothing_was_recorded_is_refused() {
    let log = recorded(7, 30);
    let files = named(log.clone());
    for (moment, words) in [
        ("0:30", "the log ends at 0:29.9"),
        ("9:10", "ends at 0:29.9"),
        ("99999:00", "ends at 0:29.9"),
        ("2030-01-01T00:00:00Z", "ends at 0:29.9 (2026-09-21 14:13:49 UTC)"),
        ("2026-09-21T14:13:19Z", "begins later, 2026-09-21 14:13:20 UTC"),
    ] {
        let told = brought(&files, &["--around", moment]).expect_err("there is none").to_string();
        assert!(told.contains(words), "{moment}: {told}");
    }
    // The time of day was learned in the only group.
    for moment in ["0", "0:29.9", "2026-09-21T14:13:20Z", "2026-09-21T14:13:49Z"] {
        assert_eq!(brought(&files, &["--around", moment]).expect("it comes"), Outcome::Done, "{moment}");
    }
    // Perhaps in the unreadable sectors.
    for files in spoiled(&log, log.len() / SECTOR_BYTES - 1).into_iter().take(4) {
        assert_eq!(brought(&files, &["--around", "0:29.9"]).expect("it comes"), Outcome::Losses);
    }
}

#[test]
fn a_time_of_day_goes_by_the_last_clock_record_of_its_log() {
    const HOUR_US: u64 = 3_600_000_000;
    // The clock is set in the last group.
    let log = recorded_by(7, 400, &[(10, EPOCH_US), (3_900, EPOCH_US + HOUR_US)]);
    let last = group_at(&log, 390);
    assert!(last.start > 0 && last.end == log.len() / SECTOR_BYTES, "{last:?}");
    let around = |files: &Files, utc: &str| brought(files, &["--around", utc, "--span", "5"]);
    let (begin, end) = log.split_at(group_at(&log, 200).start * SECTOR_BYTES);
    let of = |names: [&str; 2], logs: [&[u8]; 2]| -> Files {
        names.into_iter().map(str::to_owned).zip(logs.map(<[u8]>::to_vec)).collect()
    };
    let in_group = log.len() - 5 * SECTOR_BYTES;
    for files in [
        named(log.clone()),
        of(["00001_00.HUM", "00001_01.HUM"], [begin, end]),
        // A further file begins in the middle of that group.
        of(["00001_00.HUM", "00001_01.HUM"], [&log[..in_group], &log[in_group..]]),
    ] {
        assert_eq!(around(&files, "2026-09-21T15:14:20Z").expect("it comes"), Outcome::Done);
        let told = around(&files, "2026-09-21T14:19:30Z").expect_err("by no clock").to_string();
        assert!(told.contains("begins later, 2026-09-21 15:13:20 UTC"), "{told}");
    }
    let mut lost = log.clone();
    lost[in_group..in_group + 512].fill(0);
    assert_eq!(around(&named(lost), "2026-09-21T14:14:20Z").expect("it comes"), Outcome::Losses);
}

#[test]
fn a_file_that_begins_in_the_middle_of_a_group_is_read_with_the_one_before_it() {
    let log = recorded(7, 400);
    let cut = log.len() - 5 * SECTOR_BYTES;
    let files = |cut: usize| -> Files {
        let names = ["00001_00.HUM", "00001_01.HUM"].map(str::to_owned);
        names.into_iter().zip([log[..cut].to_vec(), log[cut..].to_vec()]).collect()
    };
    let middle = (group_at(&log, 200).start + 9) * SECTOR_BYTES;
    for (cut, at_it) in [(cut, "399"), (middle, "200")] {
        for at in ["20", at_it, "399"] {
            let dir = tempfile::tempdir().expect("a folder");
            let board = board_of(files(cut), |_, _| None);
            let args = ["--around", at, "--span", "1"];
            assert_eq!(brought_into(dir.path(), board, &args).expect("it comes"), Outcome::Done, "{at}");
            let found = crate::logs::find::find_in(dir.path(), false).expect("parts");
            let paths: Vec<PathBuf> = found.paths().map(Path::to_owned).collect();
            let named = crate::logs::find(&paths, false).expect("parts");
            for found in [found, named] {
                let [log] = &found.logs[..] else { panic!("{at}: {:?}", found.logs) };
                if at != at_it {
                    continue;
                }
                let overview = crate::summary::Overview::verified(log).expect("it reads");
                // Sectors looked at on the way are of no use elsewhere.
                let moment = Instant::from_millis(at.parse::<u64>().expect("seconds") * 1_000);
                let hides = |gap: &hums_blackbox::Gap| {
                    gap.from.is_none_or(|from| from <= moment) && gap.to.is_none_or(|to| to >= moment)
                };
                assert!(!overview.contents.gaps.iter().any(hides), "{at}: {:?}", overview.contents.gaps);
            }
        }
        assert_eq!(
            brought(&files(cut), &["--around", "critical", "--span", "1"]).expect("found"),
            Outcome::Done
        );
    }
}

#[test]
fn a_log_that_the_boards_card_does_not_give_is_told() {
    let files: Files = vec![(NAME.to_owned(), recorded(7, 20)), ("00002_00.HUM".to_owned(), Vec::new())];
    let board = || board_with(files.clone(), Some("00002_00.HUM"), |_, _| None);
    assert_eq!(brought_of(board(), &[]).expect("it comes"), Outcome::Losses);
    assert_eq!(brought_of(board(), &[NAME]).expect("it comes"), Outcome::Done, "no other was asked for");
    let told = brought_of(board(), &["00002_00.HUM"]).expect_err("it is not given").to_string();
    assert!(told.contains("lists no such log now"), "{told}");
}

#[test]
fn a_moment_is_of_the_newest_log_with_data_or_of_the_named_one() {
    let file = |name: &str, log: &[u8]| (name.to_owned(), log.to_vec());
    let log = recorded(7, SECONDS);
    let files =
        vec![file("00003_00.HUM", &recorded(6, 20)), file("00004_00.HUM", &log), file("00005_00.HUM", &[])];
    for args in [&["--around", "critical"][..], &["--around", "24:00"], &["--around", "0:10", "00003_00.HUM"]]
    {
        assert_eq!(brought(&files, args).expect("it comes"), Outcome::Done, "{args:?}");
    }
    let two = ["--around", "0:10", "00003_00.HUM", "00004_00.HUM"];
    let told = brought(&files, &two).expect_err("two logs");
    assert!(told.is::<crate::outcome::Usage>(), "{told:#}");
}

#[test]
fn a_board_that_contradicts_itself_is_told() {
    let log = recorded(7, 30);
    // The directory lists a log that is empty when opened.
    let emptied = |files: &mut Files, opcode| {
        if opcode == 4 {
            files[0].1.clear();
        }
        None
    };
    assert_eq!(brought_of(board_of(named(log.clone()), emptied), &[]).expect("told"), Outcome::Losses);
    let told =
        brought_of(board_of(named(log), emptied), &["--around", "0:01"]).expect_err("nothing").to_string();
    assert!(told.contains("is shorter than the box's directory says"), "{told}");
    let long = named(vec![0; 2 * SEGMENT_BYTES_MAX as usize + 1]);
    let told = brought(&long, &["--around", "0:01"]).expect_err("no recorder's").root_cause().to_string();
    assert!(told.contains("no recorder makes a file of 16777217 bytes"), "{told}");
}

#[test]
fn a_log_of_which_nothing_came_is_a_loss_unless_it_is_begun_just_now() {
    let two = |first: Vec<u8>, second: Vec<u8>| -> Files {
        vec![("00001_00.HUM".to_owned(), first), ("00002_00.HUM".to_owned(), second)]
    };
    let first_lost = two(Vec::new(), recorded(7, 30));
    let begun = two(recorded(7, 30), Vec::new());
    let code = |files: &Files, args: &[&str]| brought(files, args).expect("told");
    let alone = code(&two(recorded(7, 30), recorded(8, 30)), &["--last", "1"]);
    assert_eq!(code(&first_lost, &[]), Outcome::Losses);
    assert_eq!(code(&begun, &["--last", "1"]), Outcome::Done);
    assert_eq!(code(&begun, &["00002_00.HUM"]), Outcome::Losses, "it was asked for by its name");
    assert_eq!(code(&first_lost, &["--last", "1"]), alone, "and what was not asked for is none");
}

#[test]
fn what_comes_of_a_burst_is_handed_on_before_its_end() {
    let mut ftp = board(vec![7; 10_000], Vec::new(), u32::MAX);
    ftp.open(NAME).expect("a log");
    let mut came = Vec::new();
    let told = ftp.bring(0, 10_000, |bytes| {
        came.push(bytes.len());
        (came.len() < 3).then_some(()).context("the link ends")
    });
    assert_eq!((told.expect_err("it ends").to_string().as_str(), came), ("the link ends", vec![239; 3]));
    let mut ftp = board((0..200).cycle().take(10_000).collect(), Vec::new(), u32::MAX);
    ftp.open(NAME).expect("a log");
    let mut all = Vec::new();
    ftp.bring(100, 9_000, |bytes| {
        all.extend_from_slice(bytes);
        Ok(())
    })
    .expect("it comes");
    assert_eq!(all, (0..200).cycle().take(9_000).skip(100).collect::<Vec<u8>>());
}

#[test]
fn a_refusal_says_no_more_than_is_known() {
    let dir = tempfile::tempdir().expect("a folder");
    let log = recorded(7, 30);
    for (error, words) in [
        (10, "the box no longer has this log: its card made room for later flights, or is another one"),
        (1, "the box refuses the checksum of this log (MAVLink FTP error 1); call again"),
    ] {
        let refuse = move |_: &mut Files, opcode| (opcode == 14).then_some(error);
        let mut ftp = Ftp::new(board_of(named(log.clone()), refuse)).expect("it answers");
        let output = dir.path().join(error.to_string());
        fs::create_dir(&output).expect("made");
        let told = pull(&mut ftp, NAME, &output).expect_err("not confirmed").to_string();
        assert_eq!(told, words);
        let begun = output.join(&names_in(&output)[0]);
        assert_eq!(fs::read(&begun).expect("kept"), log);
    }
}

fn files_of(log: &[u8], groups: usize) -> Files {
    let starts: Vec<usize> = (0..log.len() / SECTOR_BYTES)
        .filter(|place| {
            Sector::from_bytes(*log[place * SECTOR_BYTES..].first_chunk().expect("one")).starts_group()
        })
        .collect();
    let cuts = starts.iter().copied().step_by(groups).map(|place| place * SECTOR_BYTES);
    let ends = cuts.clone().skip(1).chain([log.len()]);
    (0..)
        .zip(cuts.zip(ends))
        .map(|(n, (start, end))| (format!("00001_{n:02}.HUM"), log[start..end].to_vec()))
        .collect()
}

fn verified(folder: &Path) -> Outcome {
    let found = crate::logs::find::find_in(folder, false).expect("a folder");
    let mut outcome = Outcome::Done;
    crate::verify::verify_each(&found, |log| {
        outcome = outcome.and(Outcome::lossy(!crate::verify::failed(log).is_empty()));
        Ok(())
    })
    .expect("they read");
    outcome
}

#[test]
fn all_logs_of_a_board_are_judged_as_verify_judges_their_folder() {
    let files = files_of(&recorded(7, SECONDS), 2);
    assert!(files.len() > 4, "{}", files.len());
    let last = files.len() - 1;
    let mut boards = vec![(files.clone(), Outcome::Done)];
    for at in [0, 1, last - 1] {
        let (mut absent, mut empty, mut cut, mut lost) =
            (files.clone(), files.clone(), files.clone(), files.clone());
        absent.remove(at);
        empty[at].1.clear();
        cut[at].1.truncate(20 * SECTOR_BYTES);
        lost[at].1[..SECTOR_BYTES].fill(0);
        boards.extend([absent, empty, cut, lost].map(|files| (files, Outcome::Losses)));
    }
    boards.push((files[2..].to_vec(), Outcome::Losses));
    boards.push((files[..last].to_vec(), Outcome::Losses));
    for (files, expected) in boards {
        let folder = tempfile::tempdir().expect("a folder");
        let names: Vec<_> = files.iter().map(|(name, log)| (name, log.len())).collect();
        let pulled =
            brought_into(folder.path(), board_of(files.clone(), |_, _| None), &[]).expect("they come");
        assert_eq!((pulled, verified(folder.path())), (expected, expected), "{names:?}");
    }
    // Not requested is not lost.
    let code = |args: &[&str]| brought(&files, args).expect("they come");
    assert_eq!(code(&["--last", "2"]), Outcome::Done);
    assert_eq!(code(&["00001_01.HUM", "00001_03.HUM", &files[last].0]), Outcome::Done);
    let mut flipped = files.clone();
    flipped[1].1[SECTOR_BYTES + 100] ^= 1;
    assert_eq!(brought(&flipped, &["00001_01.HUM"]).expect("it comes"), Outcome::Losses);
}

#[test]
fn an_end_that_is_not_proved_is_told_and_the_log_is_not_called_whole() {
    let mut memory = Memory { session: 7, ..Memory::default() };
    let mut writer = Box::new(Writer::new());
    for tenth in 0..3_000_u64 {
        let at = Instant::from_millis(tenth * 100);
        let mut record = |record: Record<'_>| writer.record(at, &record, &mut memory).expect("there is room");
        let text = format!("{:016x}", tenth.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        record(Record::Note(Note { severity: 6, text: &text }));
        if tenth == 1_000 {
            let sector = writer.counters().sectors as u32;
            let mark = Record::Mark(Mark { why: MarkReason::Disarmed, sector, frames: 0 });
            writer.record(at, &mark, &mut memory).expect("there is room");
        }
    }
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("00001-s00000007_00.HUM");
    fs::write(&path, &memory.sectors).expect("written");
    let mut logs = [LogJson::new(NAME.to_owned(), path, true)];
    assert_eq!(judge(&[], &mut logs).expect("it reads"), Outcome::Done);
    assert!(!logs[0].whole);
    let end = serde_json::to_value(&logs[0].end).expect("JSON");
    let words = end["words"].as_str().expect("words");
    assert!(
        words.starts_with("whole to the disarming at") && words.ends_with("whose end cannot be proved"),
        "{words}"
    );
}

#[test]
fn what_no_file_of_a_session_has_is_told_of_a_moment_and_of_a_search() {
    let log = recorded(7, SECONDS);
    let files = files_of(&log, 1);
    let after = |second: u64| {
        let place = group_at(&log, second).start * SECTOR_BYTES;
        let mut end = 0;
        files.iter().position(|(_, file)| {
            end += file.len();
            place < end
        })
    };
    let moment = |files: &Files, second: u64| {
        let second = second.to_string();
        brought(files, &["--around", &second, "--span", "5"]).expect("it comes")
    };
    let search = |files: &Files| brought(files, &["--around", "critical", "--span", "1"]).expect("found");
    let at = after(600).expect("a file");
    assert!(at > 0 && at < after(1_000).expect("a file"), "{at}");
    assert_eq!((moment(&files, 600), search(&files)), (Outcome::Done, Outcome::Done));
    let changed = |change: &dyn Fn(&mut Files)| {
        let mut files = files.clone();
        change(&mut files);
        files
    };
    let absent = changed(&|files| drop(files.remove(at)));
    let empty = changed(&|files| files[at].1.clear());
    let cut = changed(&|files| files[at].1.truncate(SECTOR_BYTES));
    let first = changed(&|files| drop(files.drain(..=at)));
    let early = brought(&first, &["--around", "600"]).expect_err("it is before them").to_string();
    assert!(early.contains("the box's files of this log begin at"), "{early}");
    for files in [&absent, &empty, &cut, &first] {
        assert!(files.len() == first.len() || moment(files, 600) == Outcome::Losses);
        assert_eq!(moment(files, 1_400), Outcome::Done, "nothing of that moment is missing");
        let has_empty = files.iter().any(|(_, bytes)| bytes.is_empty());
        let expected = if has_empty { Outcome::Losses } else { Outcome::Done };
        assert_eq!(search(files), expected, "nor what comes after the latest one");
    }
    let later = after(1_300).expect("a file");
    assert!(later > after(1_000).expect("a file") && later + 1 < files.len());
    for files in [
        changed(&|files| drop(files.remove(later))),
        changed(&|files| files[later].1.clear()),
        changed(&|files| files[later].1.truncate(SECTOR_BYTES)),
        changed(&|files| files.last_mut().expect("one").1.clear()),
    ] {
        assert_eq!(search(&files), Outcome::Losses);
    }
}

#[test]
fn one_log_that_cannot_come_keeps_no_other_from_coming() {
    let dir = tempfile::tempdir().expect("a folder");
    let files: Files = (1..4).map(|n| (format!("{n:05}_00.HUM"), recorded(n, 20))).collect();
    let mut changed = files[0].1.clone();
    changed[700] ^= 1;
    let [one, two, three] = [1, 2, 3].map(|n| dir.path().join(format!("{n:05}-s{n:08x}_00.HUM")));
    fs::write(&one, &changed).expect("written");
    fs::create_dir(&two).expect("a folder stands where a log is to be");
    let board = || board_of(files.clone(), |_, _| None);
    let told = brought_into(dir.path(), board(), &[]).expect_err("one differs");
    assert!(format!("{told:#}").contains("differs from the box's log of the same session"), "{told:#}");
    assert_eq!(fs::read(&one).expect("there"), changed);
    assert!(two.is_dir());
    assert_eq!(fs::read(&three).expect("it came"), files[2].1);
}

#[test]
fn the_newest_logs_come_with_all_of_their_files() {
    let names = |args: &[&str], files: &Files| {
        let folder = tempfile::tempdir().expect("a folder");
        let outcome =
            brought_into(folder.path(), board_of(files.clone(), |_, _| None), args).expect("they come");
        (outcome, names_in(folder.path()).len())
    };
    let log = recorded(7, SECONDS);
    let mut files = files_of(&log, 2);
    let count = files.len();
    files.push(("00002_00.HUM".to_owned(), recorded(8, 30)));
    assert_eq!(names(&["--last", "1"], &files), (Outcome::Done, 1));
    assert_eq!(names(&["--last", "2"], &files), (Outcome::Done, count + 1));
    assert_eq!(names(&["--last", "0"], &files).1, 0);
}

#[test]
fn a_file_that_the_card_made_room_of_meanwhile_is_a_loss_and_the_others_come() {
    let flight = board_of(files_of(&recorded(7, SECONDS), 2), |files, opcode| {
        if opcode == 4 && files[0].0 == NAME {
            drop(files.remove(0));
        }
        None
    });
    assert_eq!(brought_of(flight, &[]).expect("the others come"), Outcome::Losses);
}
