//! A download from a card that changes continues with the same log, or ends with an error.

use crate::rig;

use hums_blackbox::Header;
use hums_recorder::{BLOCK_BYTES, Buffers, Card, CardState, CardStatus, LogName};
use hums_sdcard::{Event, Fault, Kind, MS, Medium, Model, Plan};
use rig::{FILE_TRANSFER_PROTOCOL, LOG_DATA, LOG_ENTRY, Rig, read as read_card};

const MIB: u32 = 2_048;
const S: u64 = 1_000;
const VICTIM: LogName = LogName { session: 2, segment: 0 };

const LIST: u8 = 3;
const OPEN: u8 = 4;
const READ: u8 = 5;
const CHECKSUM: u8 = 14;
const BURST: u8 = 15;
const ACK: u8 = 128;
const NAK: u8 = 129;
const FAIL: u8 = 1;
const END_OF_FILE: u8 = 6;
const FILE_NOT_FOUND: u8 = 10;

fn model(medium: &Medium) -> Model {
    Model::new(Kind::Sdhc, medium.clone())
}

/// A session of this many seconds, and one more; power cuts end both.
fn with_two_sessions(mib: u32, seconds: u64) -> Medium {
    // The size gives the volume's number, by which the mark separates sessions of equal names.
    let medium = Medium::formatted(mib * MIB);
    for _ in 0..2 {
        let mut rig = Rig::new(model(&medium));
        rig.run_to(seconds * S);
    }
    medium
}

/// Later segments fill the room: the next one overwrites the oldest.
fn full() -> Medium {
    let medium = with_two_sessions(40, 20);
    let (status, held) = (CardStatus::new(), Buffers::new());
    let mounted = Card::mount(&medium, &status, &held);
    let mut card = mounted.map_err(|error| error.to_string()).expect("it is in order");
    let mut segments = (0..).map(|segment| LogName { session: 3, segment });
    for kib in [2 * 1024, 128] {
        while segments.next().is_some_and(|name| card.create(name, kib * 1024).is_ok()) {}
    }
    medium
}

fn recording(medium: &Medium) -> Rig {
    let mut rig = Rig::new(model(medium));
    rig.run_to(12 * S);
    rig.assert_state(CardState::Recording);
    rig
}

/// The session continues in another segment.
fn insert(rig: &mut Rig, medium: &Medium) {
    rig.slot.event(Event::Pull);
    let now_ms = rig.slot.now_ns() / MS;
    rig.run_to(now_ms + 3 * S);
    rig.slot.event(Event::Insert(model(medium)));
    rig.run_to(now_ms + 12 * S);
    rig.assert_state(CardState::Recording);
}

fn wait(rig: &mut Rig, ms: u64) {
    let now_ms = rig.slot.now_ns() / MS;
    rig.run_to(now_ms + ms);
}

type Answer = (u8, u8, bool, u32, Vec<u8>);

fn ftp(rig: &mut Rig, opcode: u8, offset: u32, size: u8, data: &[u8], ms: u64) -> Vec<Answer> {
    let size = if data.is_empty() { size } else { data.len() as u8 };
    let mut payload = vec![0, 1, 191, 7, 0, 0, opcode, size, 0, 0, 0];
    payload.extend(offset.to_le_bytes());
    payload.extend(data);
    rig.logs.clear();
    rig.ask(FILE_TRANSFER_PROTOCOL, &payload);
    wait(rig, ms);
    answers(rig)
}

fn answers(rig: &Rig) -> Vec<Answer> {
    let files = rig.logs.iter().filter(|(id, _)| *id == FILE_TRANSFER_PROTOCOL);
    files
        .map(|(_, payload)| {
            let payload = &payload[3..];
            let offset = u32::from_le_bytes(payload[8..12].try_into().expect("four bytes"));
            let data = payload[12..12 + usize::from(payload[4])].to_vec();
            (payload[3], payload[5], payload[6] != 0, offset, data)
        })
        .collect()
}

fn path(name: LogName) -> Vec<u8> {
    format!("/{name}").into_bytes()
}

fn open(rig: &mut Rig, name: LogName) -> u32 {
    let opened = ftp(rig, OPEN, 0, 0, &path(name), 2_000);
    assert_eq!((opened[0].0, opened[0].1), (ACK, OPEN), "{opened:?}");
    u32::from_le_bytes(opened[0].4[..4].try_into().expect("a length"))
}

fn read(rig: &mut Rig, bytes: u32) -> Vec<u8> {
    let mut data = Vec::new();
    while data.len() < bytes as usize {
        let (kind, _, _, offset, piece) =
            ftp(rig, READ, data.len() as u32, 239, &[], 1_000).pop().expect("an answer");
        assert_eq!((kind, offset as usize), (ACK, data.len()));
        data.extend(piece);
    }
    data
}

fn crc32(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

fn list(rig: &mut Rig) -> usize {
    rig.logs.clear();
    rig.ask(117, &[0, 0, 255, 255, 1, 191]);
    wait(rig, 5_000);
    rig.logs.iter().filter(|(id, _)| *id == LOG_ENTRY).count()
}

fn data(rig: &mut Rig, id: u16, offset: u32, count: u32) -> Vec<(u32, Vec<u8>)> {
    rig.logs.clear();
    let mut payload = offset.to_le_bytes().to_vec();
    payload.extend(count.to_le_bytes());
    payload.extend(id.to_le_bytes());
    payload.extend([1, 191]);
    rig.ask(119, &payload);
    wait(rig, 3_000);
    let pieces = rig.logs.iter().filter(|(id, _)| *id == LOG_DATA);
    pieces
        .map(|(_, payload)| {
            let offset = u32::from_le_bytes(payload[..4].try_into().expect("four bytes"));
            (offset, payload[7..7 + usize::from(payload[6])].to_vec())
        })
        .collect()
}

#[test]
fn a_file_that_makes_room_while_it_is_read_ends_with_an_error() {
    let medium = full();
    let mut rig = recording(&medium);
    let length = open(&mut rig, VICTIM);
    assert!(length > 20_000 && length.is_multiple_of(512), "{length}");
    let before = read(&mut rig, 2_390);
    let since_ms = rig.slot.now_ns() / MS;
    insert(&mut rig, &medium);
    for opcode in [READ, BURST] {
        if opcode == BURST {
            // Still open for a client that lost the first answer.
            assert_eq!(ftp(&mut rig, OPEN, 0, 0, &path(VICTIM), 2_000)[0].4, [FILE_NOT_FOUND]);
        }
        let answers = ftp(&mut rig, opcode, before.len() as u32, 239, &[], 2_000);
        assert!(answers.iter().all(|answer| answer.0 == NAK), "{opcode}: {answers:?}");
        assert!(!answers.is_empty());
    }
    rig.assert_told("HUMS: this log is gone: download ended", since_ms);
    let newest = open(&mut rig, LogName { session: 4, segment: 1 });
    assert!(newest > 0);
}

#[test]
fn a_burst_that_is_under_way_when_its_file_makes_room_ends_with_an_error() {
    let medium = full();
    let mut rig = recording(&medium);
    let whole = {
        let length = open(&mut rig, VICTIM);
        read(&mut rig, length.min(20_000))
    };
    let since_ms = rig.slot.now_ns() / MS;
    // The burst goes on for ten seconds and more.
    let mut said = ftp(&mut rig, BURST, 0, 239, &[], 2_000);
    insert(&mut rig, &medium);
    said.extend(answers(&rig));
    assert_eq!(said.last().map(|answer| (answer.0, answer.1)), Some((NAK, BURST)), "{} answers", said.len());
    for (_, _, _, offset, data) in said.iter().filter(|answer| answer.0 == ACK) {
        assert_eq!(data, &whole[*offset as usize..][..data.len()], "at {offset}");
    }
    rig.assert_told("HUMS: this log is gone: download ended", since_ms);
}

#[test]
fn a_log_that_makes_room_while_it_is_downloaded_by_number_is_not_gone_on_with() {
    let medium = full();
    let mut rig = recording(&medium);
    assert!(list(&mut rig) > 10);
    let before = data(&mut rig, 2, 0, 900);
    assert_eq!(before.len(), 10);
    let again = data(&mut rig, 2, 450, 900);
    assert_eq!(again[0], before[5], "it goes on");
    let since_ms = rig.slot.now_ns() / MS;
    insert(&mut rig, &medium);
    assert_eq!(data(&mut rig, 2, 900, 900), [], "what lies there now is another log");
    rig.assert_told("HUMS: this log is gone: download ended", since_ms);
    assert!(list(&mut rig) > 10);
    assert_eq!(data(&mut rig, 2, 900, 900), []);
    // The place now means the new log.
    let fresh = data(&mut rig, 2, 0, 900);
    assert_eq!(fresh.len(), 10);
    assert_ne!(fresh[0], before[0]);
}

#[test]
fn a_number_of_a_list_that_is_no_longer_so_is_refused_and_told_once() {
    let medium = full();
    let mut rig = recording(&medium);
    assert!(list(&mut rig) > 10);
    insert(&mut rig, &medium);
    let since_ms = rig.slot.now_ns() / MS;
    for _ in 0..3 {
        assert_eq!(data(&mut rig, 5, 0, 900), [], "an answer would be of whatever lies there");
    }
    let told =
        rig.texts.iter().filter(|(at, text)| at.as_millis() >= since_ms && text.contains("list them again"));
    assert_eq!(told.count(), 1, "{:?}", rig.texts);
}

#[test]
fn another_card_with_logs_of_the_same_names_is_not_gone_on_with() {
    let (one, other) = (with_two_sessions(40, 20), with_two_sessions(41, 25));
    let mut rig = recording(&one);
    let length = open(&mut rig, VICTIM);
    read(&mut rig, 2_390);
    let asked = data(&mut rig, 2, 0, 900);
    assert_eq!(asked.len(), 10);
    insert(&mut rig, &other);
    let answers = ftp(&mut rig, READ, 2_390, 239, &[], 2_000);
    assert_eq!(answers[0].0, NAK, "{answers:?}");
    assert_eq!(data(&mut rig, 2, 900, 900), []);
    assert_ne!(open(&mut rig, VICTIM), length, "the other card's own can be read");
}

#[test]
fn a_checksum_is_of_what_was_recorded_and_nothing_is_lost_while_it_is_computed() {
    let medium = with_two_sessions(40, 40);
    let mut rig = recording(&medium);
    let length = open(&mut rig, VICTIM);
    let whole = read(&mut rig, length);
    assert_eq!(ftp(&mut rig, READ, length, 239, &[], 2_000)[0].4, [END_OF_FILE]);
    for (asked, covered) in [(0, length), (700, 700), (length, length), (u32::MAX, length)] {
        // Computed once, answered for the last request.
        let mut answers = ftp(&mut rig, CHECKSUM, asked, 0, &path(VICTIM), 5);
        let again = ftp(&mut rig, CHECKSUM, asked, 0, &path(VICTIM), 10_000);
        answers.extend(again);
        let last = answers.last().expect("an answer");
        let expected = crc32(&whole[..covered as usize]).to_le_bytes().to_vec();
        assert_eq!(last, &(ACK, CHECKSUM, false, covered, expected), "{answers:?}");
    }
    let missing = ftp(&mut rig, CHECKSUM, 0, 0, b"/00099_00.HUM", 2_000);
    assert_eq!((missing[0].0, &missing[0].4[..]), (NAK, &[FILE_NOT_FOUND][..]));
    assert_eq!(rig.status.read().frames_lost, 0);
    drop(rig);
    assert_eq!(read_card(&medium).gaps, []);
}

fn places(medium: &Medium, name: LogName) -> (u32, u32) {
    let (status, held) = (CardStatus::new(), Buffers::new());
    let mounted = Card::mount(medium, &status, &held);
    let card = mounted.map_err(|error| error.to_string()).expect("it is in order");
    let mut segment = card.segment(name).expect("it is there");
    let mut block = [0; BLOCK_BYTES];
    card.read(&mut segment, 0, &mut block).expect("it reads");
    let content = medium.content();
    let first = content.iter().find(|(_, there)| **there == block).map(|(at, _)| *at).expect("there");
    let is_recorded = |at: &u32| Header::read(&medium.get(first + at)).is_ok();
    (first, (0..segment.blocks()).take_while(is_recorded).count() as u32)
}

#[test]
fn what_a_card_has_lost_of_a_log_hides_nothing_of_the_rest() {
    /// Sectors in a row that may be lost anywhere.
    const LOST_MAX: u32 = 64;
    let medium = with_two_sessions(40, 60);
    let (first, sectors) = places(&medium, VICTIM);
    assert!(sectors > 250, "{sectors}");
    let mut rig = recording(&medium);
    let pages = (0..sectors - 8).step_by(8).map(|at| (at, 8));
    let rows = [0, 1, sectors / 2, sectors - LOST_MAX - 1].map(|at| (at, LOST_MAX));
    // Parity shows the log's length, but does not cover the last ten seconds.
    let more = [(1, 150), (30, sectors - 100)];
    let whole = medium.content();
    let (other, _) = places(&medium, LogName { session: 1, segment: 0 });
    let text = b"0123456789abcdef".repeat(32);
    let fills = [[0; 512], [0xff; 512], *text.first_chunk().expect("a block"), whole[&(other + 9)]];
    for (at, lost) in pages.chain(rows).chain(more) {
        let fills = if at == 0 { &fills[..3] } else { &fills[..] };
        for fill in fills {
            (at..at + lost).for_each(|at| medium.set(first + at, fill));
            assert_eq!(
                open(&mut rig, VICTIM),
                sectors * 512,
                "{lost} from {at} on of {sectors}: {:?}",
                &fill[..2]
            );
        }
        if at == 8 {
            let came = read(&mut rig, 12 * 512);
            assert_eq!(came[11 * 512..][..512], fills[3], "a sector of another session");
            assert!(came[7 * 512..8 * 512] == whole[&(first + 7)]);
        }
        (at..at + lost).for_each(|at| medium.set(first + at, &whole[&(first + at)]));
    }
}

#[test]
fn the_log_in_work_is_downloaded_as_far_as_it_no_longer_changes() {
    let medium = with_two_sessions(40, 12);
    let mut rig = recording(&medium);
    let name = LogName { session: 3, segment: 0 };
    let length = open(&mut rig, name);
    assert!(length > 5_000, "{length}");
    let whole = read(&mut rig, length);
    wait(&mut rig, 10_000);
    let sum = ftp(&mut rig, CHECKSUM, length, 0, &path(name), 10_000);
    assert_eq!(sum[0].4, crc32(&whole).to_le_bytes(), "what was read stays as it was: {sum:?}");
    assert!(open(&mut rig, name) > length, "and it grows");
}

#[test]
fn a_burst_has_the_size_that_was_asked_for_and_is_complete_before_the_end_only_with_a_whole_message() {
    let medium = with_two_sessions(40, 20);
    let mut rig = recording(&medium);
    let length = open(&mut rig, VICTIM);
    let (mut had, mut bursts) = (0, 0);
    while had < length {
        bursts += 1;
        let answers = ftp(&mut rig, BURST, had, 239, &[], 30_000);
        for (kind, _, complete, offset, data) in &answers {
            if *kind == NAK {
                assert_eq!((data[0], had), (END_OF_FILE, length));
                continue;
            }
            assert_eq!(*offset, had);
            assert!(data.len() == 239 || had + data.len() as u32 == length, "{} at {had}", data.len());
            // MAVProxy takes this for the file's end.
            assert!(!*complete || data.len() == 239, "{} bytes at {had} are not the end", data.len());
            had += data.len() as u32;
        }
    }
    assert!(bursts > 1, "one burst shows nothing");
}

#[test]
fn a_log_that_the_card_refuses_slowly_is_left_out_of_a_list_and_never_called_empty() {
    let medium = with_two_sessions(40, 20);
    let refusing = |skip| {
        let plan = Plan::always(Fault::NoBlock).from(20 * S * MS).until(60 * S * MS).skip(skip);
        let mut rig = Rig::new(model(&medium).with(plan));
        rig.run_to(20 * S);
        rig.assert_state(CardState::Recording);
        rig
    };
    for (skip, said) in [(0, (NAK, &[FAIL][..])), (1, (ACK, b"S\0"))] {
        let mut rig = refusing(skip);
        let answers = ftp(&mut rig, LIST, 1, 0, b"/", 10_000);
        let [(kind, LIST, _, _, data)] = &answers[..] else { panic!("after {skip} blocks: {answers:?}") };
        assert_eq!((*kind, &data[..]), said, "the directory, and a log of it");
        let opened = ftp(&mut rig, OPEN, 0, 0, &path(VICTIM), 10_000);
        assert!(opened.iter().all(|answer| (answer.0, &answer.4[..]) == (NAK, &[FAIL])), "{opened:?}");
        rig.run_to(60 * S);
        assert!(open(&mut rig, VICTIM) > 20_000, "once the card gives it");
    }
    for skip in [0, 1] {
        let mut rig = refusing(skip);
        rig.logs.clear();
        rig.ask(117, &[0, 0, 255, 255, 1, 191]);
        rig.run_to(66 * S);
        rig.assert_told("HUMS: card did not give all logs: list again", 20 * S);
        let entries: Vec<_> = rig.logs.iter().filter(|(id, _)| *id == LOG_ENTRY).collect();
        let word = |entry: &[u8], at: usize| u32::from_le_bytes(entry[at..at + 4].try_into().expect("four"));
        assert!(entries.iter().all(|(_, entry)| word(entry, 4) > 0), "neither empty nor none: {entries:?}");
        let listed = entries.len();
        assert!(list(&mut rig) > listed);
    }
}

fn set_budget(rig: &mut Rig, bytes_a_second: f32) {
    let mut payload = bytes_a_second.to_le_bytes().to_vec();
    payload.extend([1, 191]);
    payload.extend(b"GS_BUDGET\0\0\0\0\0\0\0\x09");
    rig.ask(23, &payload);
}

#[test]
fn on_a_slow_line_too_a_burst_ends_with_its_mark() {
    let medium = with_two_sessions(40, 60);
    let mut rig = recording(&medium);
    set_budget(&mut rig, 1_000.0);
    let length = open(&mut rig, VICTIM);
    let mut had = 0;
    for _ in 0..2 {
        let answers = ftp(&mut rig, BURST, had, 239, &[], 90_000);
        let (last, before) = answers.split_last().expect("a burst");
        assert!(before.iter().all(|(_, _, complete, _, data)| !complete && (1..239).contains(&data.len())));
        had += before.iter().map(|answer| answer.4.len() as u32).sum::<u32>();
        // MAVProxy takes a shorter complete message for the file's end, but not one without data.
        assert!(last.2 && last.4.is_empty() && last.3 == had, "{last:?} at {had}");
    }
    assert!(had < length);
}

#[test]
fn a_port_that_is_full_asks_the_card_nothing_again() {
    let medium = with_two_sessions(40, 20);
    let mut rig = recording(&medium);
    set_budget(&mut rig, 100.0);
    let bytes = |rig: &mut Rig| {
        let before = rig.slot.counts().bytes;
        wait(rig, 20_000);
        rig.slot.counts().bytes - before
    };
    let quiet = bytes(&mut rig);
    rig.ask(117, &[0, 0, 255, 255, 1, 191]);
    let listing = bytes(&mut rig);
    assert!(listing < quiet + 500_000, "{listing} bytes over the bus, {quiet} without a list");
}
