//! Whether what a log lacks before its first sector was left out on purpose.
//!
//! While a vehicle that is recorded by arming is disarmed, the recorder keeps the last while in a ring of files. When it
//! begins a file, it writes the oldest one anew, if the second oldest began long enough ago (`hums_recorder::ring`): by the times
//! of the groups that they begin with, which are in the files. So a log that lacks its first files may be whole: then a later file
//! of the ring was begun, and when that was, the first one that is left held the last while. Where no file says so, somebody else
//! took one. The first file of a log is never left out before
//! others are: a log that has it and begins later was recorded on a card that came later, and says so.
//! Where nobody was armed and the log did not end in order, one more file may have been begun behind its last entry, which is not there.
//! Between a log's first sector and its last one nothing is ever left out: after an arming the next log begins. But files that were
//! copied while the vehicle waited, and files of the same log that were copied later, are no whole together: what the ring gave away
//! between the two copies is in neither, and what is before that is none of the log's any more ([`leftovers`]).

use std::ops::Range;

use anyhow::Result;
use hums_blackbox::record::{Keep, Lost};
use hums_blackbox::{Entry, GroupDecoder, Header, Outline, Record, Sector};
use hums_core::clock::{Instant, Span};

use super::board::HEADING_GROUPS;
use super::groups::{Group, Groups, at_beginning};
use super::marks::{CARD_OUT, REFUSED};
use super::places::Log;

/// Files of a full ring but for one, of which the oldest goes however little the others hold.
const RING_FILES: usize = 15;
/// Where power went as a file was begun, of which nothing is there, nothing tells when that was: at most so long after the last
/// entry, of a vehicle that sends a heartbeat each second.
const SLACK: Span = Span::from_secs(10);
/// Numbers of the events that say that a card came or went.
const CARD: [u8; 2] = [6, CARD_OUT];
/// While the first files of a log got nothing, what comes waits in the sector queue: that they did is said within so many groups.
const TROUBLE_GROUPS: usize = 4;

/// What a log lacks that begins with another sector than the first one of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late {
    /// The sector from which on only the last while was kept. Those before it are another log's.
    pub from: u32,
    /// All from there on was left out on purpose.
    pub is_wanted: bool,
    /// The ring was full before its files held the while that was to be kept.
    pub is_cut: bool,
    /// Nothing is missing, and yet its first file has not the name of a first one, and no record says that the card took nothing into
    /// those before it.
    pub is_renamed: bool,
}

/// `None` where the log begins with its session in a file of that name, or its first group does not say that only the last while is kept.
pub fn late(log: &Log) -> Result<Option<Late>> {
    let mut groups = Groups::new(log);
    let Some(group) = groups.next_group()? else { return Ok(None) };
    let first = group.first().map(|step| step.header);
    let segment = log.first_segment();
    let Some(first) = first.filter(Header::starts_group) else { return Ok(None) };
    // Where the card goes for a moment while the box writes its first file, it begins again in the second one; and so on.
    let is_further = segment.is_some_and(|segment| segment > 1);
    if first.number == 0 && !is_further {
        return Ok(None);
    }
    let mut seen = Seen::default();
    seen.take(&group);
    if first.number == 0 {
        let is_renamed = !seen.has_trouble(&mut groups)?;
        return Ok(is_renamed.then_some(Late { from: 0, is_wanted: true, is_cut: false, is_renamed }));
    }
    // A file may begin just before the group that was asked for: then that one has the record.
    for _ in 1..HEADING_GROUPS {
        if seen.keep.is_none()
            && !seen.is_broken
            && let Some(group) = groups.next_group()?
        {
            seen.take(&group);
        }
    }
    let Some(keep) = seen.keep.filter(|keep| keep.from <= first.number) else { return Ok(None) };
    let late = |is_wanted| Late { from: keep.from, is_wanted, is_cut: false, is_renamed: false };
    let lacks_none = keep.from == first.number;
    if log.session.is_some() || lacks_none {
        let is_renamed = is_further && !seen.has_trouble(&mut groups)?;
        return Ok(Some(Late { is_renamed, ..late(true) }));
    }
    if !begins_with(log, &first)? {
        return Ok(Some(late(false)));
    }
    let is_wanted = match segment {
        Some(0) => seen.go_on(&mut groups, |seen| seen.card)?.card,
        Some(_) => {
            let anew = was_written_anew(log, &first, &mut groups, &mut seen, keep)?;
            return Ok(Some(Late { is_cut: anew == Some(false), ..late(anew.is_some()) }));
        }
        // Of one file of another name nobody knows where others were begun.
        None => seen.go_on(&mut groups, |seen| seen.seconds() >= keep.seconds)?.seconds() >= keep.seconds,
    };
    Ok(Some(late(is_wanted)))
}

/// Whether nothing tells where a log began of which [`late`] knows nothing: its first sector lies elsewhere than in a log that begins
/// with its session, and the records with which each file of a log begins are lost.
pub fn is_begun_unknown(log: &Log) -> Result<bool> {
    if log.session.is_some() {
        return Ok(false);
    }
    let mut blocks = log.blocks();
    while let Some(block) = blocks.next_block()? {
        if let Ok(header) = Header::read(block) {
            let is_of_power_on = blocks.place() == (0, u64::from(header.number));
            return Ok(!is_of_power_on && header.number > 0 && at_beginning(log, |_| Some(())).is_none());
        }
    }
    Ok(false)
}

/// How many of a log's first files are none of it any more: they were copied while the vehicle waited, and the ring has given them
/// away since, with others that were copied never. So it is where sectors are missing between two files, and those from the second on
/// say that what is missing before them was left out on purpose.
pub fn leftovers(log: &Log) -> Result<usize> {
    if log.session.is_some() || log.pieces.len() < 2 || log.first_segment().is_none() {
        return Ok(0);
    }
    let only = |files: Range<usize>| Log {
        files: log.files.get(files.clone()).unwrap_or_default().to_vec(),
        pieces: log.pieces.get(files).unwrap_or_default().to_vec(),
        ..log.clone()
    };
    let mut groups = Groups::new(log);
    let mut seen = Seen::default();
    for _ in 0..HEADING_GROUPS {
        groups.next_group()?.iter().for_each(|group| seen.take(group));
    }
    // All was kept from the beginning on.
    if seen.keep.is_none() {
        return Ok(0);
    }
    // With the number of the sector of its session that each file begins with.
    let (mut begins, mut session) = (Vec::new(), None);
    for file in 0..log.pieces.len() {
        let of = only(file..file + 1);
        let Some(header) = first_header(&of)? else { continue };
        if header.session == *session.get_or_insert(header.session) {
            begins.push((file, header.number, of));
        }
    }
    let lowest = begins.first().map_or(0, |(_, number, _)| *number);
    for pair in begins.windows(2).rev() {
        let [(_, number, before), (file, next, _)] = pair else { continue };
        if *next > *number && !ends_before(before, *number, *next)? {
            let late = late(&only(*file..log.pieces.len()))?;
            if late.is_some_and(|late| late.is_wanted && late.from <= lowest) {
                return Ok(*file);
            }
        }
    }
    Ok(0)
}

/// The sector with which a file begins: in its first block, or a copy of it in the second one.
fn first_header(file: &Log) -> Result<Option<Header>> {
    let mut blocks = file.blocks();
    for _ in 0..2 {
        let Some(block) = blocks.next_block()? else { break };
        if let Ok(header) = Header::read(block) {
            return Ok(Some(header));
        }
    }
    Ok(None)
}

/// Whether a file that begins with the sector of one number has the last one before another.
fn ends_before(file: &Log, begins: u32, next: u32) -> Result<bool> {
    let at = u64::from(next - begins - 1);
    let last = file.blocks().from(at, 1);
    let mut last = last.blocks();
    let header = last.next_block()?.and_then(|block| Header::read(block).ok());
    Ok(header.is_some_and(|header| header.number == next - 1))
}

/// Whether the ring gave away a file before the first one that is left, and then whether those after it held enough.
fn was_written_anew(
    log: &Log,
    first: &Header,
    groups: &mut Groups<'_>,
    seen: &mut Seen,
    keep: Keep,
) -> Result<Option<bool>> {
    let Some(start) = seen.start else { return Ok(None) };
    let begun = begun(log, first)?;
    let later = begun.times.iter().skip(1).enumerate();
    let mut later = later.map(|(nth, at)| (nth, *at, at.since(start).as_millis() / 1000));
    let is_enough = |nth: usize, seconds: u64| seconds >= u64::from(keep.seconds) || nth + 1 >= RING_FILES;
    let gone = later.find(|(nth, _, seconds)| is_enough(*nth, *seconds));
    // Files that were begun after the arming are none of the ring's.
    if let Some((_, at, seconds)) = gone {
        let armed = seen.go_on(groups, |seen| seen.last.is_some_and(|last| last > at))?.all;
        return Ok(armed.is_none_or(|armed| at <= armed).then_some(seconds >= u64::from(keep.seconds)));
    }
    // One more may have been begun behind the last entry.
    let seen = seen.go_on(groups, |_| false)?;
    let seconds = u64::from(seen.seconds());
    let is_begun =
        !seen.is_closed && !seen.is_broken && is_enough(begun.times.len().saturating_sub(1), seconds);
    let holds_enough = begun.ends_hollow || seconds >= u64::from(keep.seconds);
    Ok((seen.all.is_none() && (begun.ends_hollow || is_begun)).then_some(holds_enough))
}

/// When files of a log were begun.
struct Begun {
    /// When the first group of each of the ring's began.
    times: Vec<Instant>,
    /// The last one has no sector: it was begun when power went.
    ends_hollow: bool,
}

/// When the files of a log were begun, up to the first one that begins with the rest of a group: it is the last one that may have taken
/// another's place, of a full ring, and what lies behind it is none of the ring's.
fn begun(log: &Log, first: &Header) -> Result<Begun> {
    let mut begun = Begun { times: Vec::new(), ends_hollow: false };
    for piece in &log.pieces {
        let one = Log { pieces: vec![piece.clone()], ..log.clone() };
        // What a file held before is of another session, or older.
        let is_own = |header: &Header| header.session == first.session && header.number >= first.number;
        let mut blocks = one.blocks();
        let mut begins = None;
        // Of its first sector there may be no more than a copy in the second place.
        for is_second in [false, true] {
            let Some(block) = blocks.next_block()? else { break };
            let header = Header::read(block).ok().filter(is_own);
            if let Some(header) = header.filter(|header| header.partial || !is_second) {
                begins = Some((header, Sector::from_bytes(*block).preamble()));
                break;
            }
        }
        begun.ends_hollow = begins.is_none();
        match begins {
            Some((_, Some(group))) => begun.times.push(Instant::from_millis(group.start_ms)),
            Some(_) => {
                begun.times.extend(begun.times.last().copied());
                break;
            }
            None => {}
        }
    }
    Ok(begun)
}

/// Whether this sector lies where a log's first one does: in the first block, or a copy of it in the second one.
fn begins_with(log: &Log, first: &Header) -> Result<bool> {
    let mut blocks = log.blocks();
    for is_second in [false, true] {
        let header = blocks.next_block()?.and_then(|block| Header::read(block).ok());
        let header = header.filter(|header| header.partial || !is_second);
        if header.is_some_and(|header| (header.session, header.number) == (first.session, first.number)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What was read of the time before the arming.
#[derive(Default)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
struct Seen {
    decoder: Box<GroupDecoder>,
    start: Option<Instant>,
    last: Option<Instant>,
    /// The first record of what is kept.
    keep: Option<Keep>,
    /// When a record said that everything is kept from now on.
    all: Option<Instant>,
    /// A card came or went, or there was none.
    card: bool,
    /// A card went, or took nothing.
    trouble: bool,
    /// The log ended in order.
    is_closed: bool,
    is_broken: bool,
}

impl Seen {
    /// Reads on until there is enough, the vehicle is armed, or something is missing.
    fn go_on(&mut self, groups: &mut Groups<'_>, enough: impl Fn(&Self) -> bool) -> Result<&Self> {
        while !enough(self) && self.all.is_none() && !self.is_broken {
            match groups.next_group()? {
                Some(group) => self.take(&group),
                None => break,
            }
        }
        Ok(self)
    }

    /// Whether a record in the first groups says that the card went, or refused something: then a file may have been begun into which
    /// nothing came.
    fn has_trouble(&mut self, groups: &mut Groups<'_>) -> Result<bool> {
        for _ in 1..TROUBLE_GROUPS {
            match groups.next_group()?.filter(|_| !self.trouble) {
                Some(group) => self.take(&group),
                None => break,
            }
        }
        Ok(self.trouble)
    }

    /// Takes the next group.
    fn take(&mut self, group: &Group) {
        self.is_broken |= self.start.is_some() && group.first().is_some_and(|step| step.missing > 0);
        if self.is_broken {
            return;
        }
        self.is_closed = group.last().is_some_and(|step| step.header.closed);
        for step in group {
            if self.decoder.push(&step.header, &step.sector).is_err() {
                self.is_broken = true;
                return;
            }
            self.start.get_or_insert(Instant::from_millis(self.decoder.preamble().start_ms));
            while let Some(outline) = self.decoder.next_outline() {
                let (at, record) = match outline {
                    Ok(Outline::Frame { at, .. } | Outline::Whole(Entry::Frame { at, .. })) => (at, None),
                    Ok(Outline::Whole(Entry::Record { at, record })) => (at, Some(record)),
                    Err(_) => {
                        self.is_broken = true;
                        return;
                    }
                };
                self.last = Some(at);
                match record {
                    Some(Record::Keep(keep)) => {
                        self.keep.get_or_insert(keep);
                        if keep.all {
                            self.all.get_or_insert(at);
                        }
                    }
                    Some(Record::Event(event)) => {
                        self.card |= CARD.contains(&event.number);
                        self.trouble |= event.number == CARD_OUT;
                    }
                    Some(Record::Loss(loss)) => {
                        self.card |= loss.what == Lost::Card;
                        self.trouble |= loss.what == Lost::Card;
                    }
                    Some(Record::Finding(finding)) => self.trouble |= finding.check == REFUSED,
                    _ => {}
                }
            }
        }
    }

    /// Seconds before the arming, or before the last entry, rounded up: what the ring holds may end a little before the time
    /// at which its oldest file went.
    fn seconds(&self) -> u32 {
        let end = self.all.or(self.last.map(|last| last + SLACK));
        let span = self.start.zip(end).map_or(Span::ZERO, |(start, end)| end.since(start));
        u32::try_from(span.as_millis() / 1000).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use hums_blackbox::Writer;
    use hums_blackbox::record::Note;

    use super::*;
    use crate::logs::fat::Extent;
    use crate::logs::find;
    use crate::logs::memory::Memory;
    use crate::logs::places::Piece;
    use crate::loss;
    use crate::summary::Overview;

    #[test]
    fn of_a_log_whose_beginning_is_lost_nothing_tells_where_it_began() {
        use hums_blackbox::record::Boot;

        let (mut memory, mut writer) = (Memory::default(), Box::new(Writer::new()));
        let boot = Record::Boot(Boot { version: "1.2.3", ..Boot::default() });
        let mut starts = Vec::new();
        // Two files of five groups each, each of which begins with the record of a start.
        for file in 0..2 {
            for group in 0..5 {
                assert!(writer.restart(&mut memory));
                starts.push(memory.0.len());
                let at = Instant::from_millis(1_000 * (10 * file + group));
                let record =
                    if group == 0 { boot } else { Record::Note(Note { severity: 6, text: "a word" }) };
                writer.record(at, &record, &mut memory).expect("room");
            }
        }
        assert!(writer.finish(&mut memory));
        let second = starts[5];
        let is_unknown = |from: usize, lost: usize| {
            let mut sectors = memory.0[from..].to_vec();
            sectors[..lost].fill([0x5a; 512]);
            let dir = tempfile::tempdir().expect("a folder");
            fs::write(dir.path().join("00002_00.HUM"), sectors.concat()).expect("room");
            let found = find(&[dir.path().to_owned()], false).expect("a log");
            let is_unknown = is_begun_unknown(&found.logs[0]).expect("it reads");
            let overview = Overview::of(&found.logs[0]).expect("it reads");
            let lost: Option<u32> = overview.contents.gaps.first().map_or(Some(0), loss::sectors_lost);
            assert_eq!(lost.is_none(), is_unknown, "{:?}", overview.contents.gaps);
            is_unknown
        };
        assert!(!is_unknown(0, 0) && !is_unknown(0, 3), "its places tell that it began with the power-on");
        assert!(!is_unknown(second, 0), "its first file is not there, and this one begins as one does");
        assert!(is_unknown(second, 1) && is_unknown(second, 3));
    }

    /// What a log lacks whose first file is gone, the others being begun at these times. Each of them begins with a short group that says
    /// nothing, and says in the next one that the last 30 s are kept, until the vehicle is armed.
    fn read(begun_ms: &[u64], armed_ms: u64) -> Option<Late> {
        of_log(&files_of(begun_ms, armed_ms, true), late)
    }

    /// The same of one that waits until then, and does not end in order.
    fn waited(begun_ms: &[u64], last_ms: u64) -> Option<Late> {
        of_log(&files_of(begun_ms, last_ms, false), late)
    }

    /// A file of a log: the number in its name, and what is in it.
    type File = (u32, Vec<u8>);

    /// What is said of the log of these files.
    fn of_log<T>(files: &[File], say: impl Fn(&Log) -> Result<T>) -> T {
        let dir = tempfile::tempdir().expect("a folder");
        let name = |(number, _): &File| format!("00001_{number:02}.HUM");
        let piece = |file: &File| {
            let path = dir.path().join(name(file));
            fs::write(&path, &file.1).expect("room");
            Piece { path, extents: vec![Extent { start: 0, length: file.1.len() as u64 }] }
        };
        let pieces = files.iter().map(piece).collect();
        let (name, files) = ("00001".to_owned(), files.iter().map(name).collect());
        say(&Log { name, files, pieces, session: None, left_over: false }).expect("it reads")
    }

    /// Files that were begun at these times, the first one with the number 13.
    fn files_of(begun_ms: &[u64], end_ms: u64, is_armed_then: bool) -> Vec<File> {
        let (mut memory, mut writer) = (Memory::default(), Box::new(Writer::new()));
        let note = Record::Note(Note { severity: 6, text: "a word" });
        let keep = |all| Record::Keep(Keep { all, from: 0, seconds: 30 });
        let all = keep(true);
        let put = |at_ms, record: &Record<'_>, memory: &mut Memory, writer: &mut Writer| {
            writer.record(Instant::from_millis(at_ms), record, memory).expect("room");
        };
        put(0, &note, &mut memory, &mut writer);
        let (mut starts, mut is_armed) = (Vec::new(), false);
        for at_ms in begun_ms {
            if !is_armed && *at_ms > end_ms {
                is_armed = true;
                put(end_ms, &keep(true), &mut memory, &mut writer);
            }
            assert!(writer.restart(&mut memory));
            starts.push(memory.0.len());
            put(*at_ms, &note, &mut memory, &mut writer);
            assert!(writer.restart(&mut memory));
            put(at_ms + 20, &keep(is_armed), &mut memory, &mut writer);
        }
        if !is_armed {
            put(end_ms, if is_armed_then { &all } else { &note }, &mut memory, &mut writer);
        }
        assert!(if is_armed_then { writer.finish(&mut memory) } else { writer.restart(&mut memory) });
        starts.push(memory.0.len());
        (13..).zip(starts.windows(2)).map(|(nth, file)| (nth, memory.0[file[0]..file[1]].concat())).collect()
    }

    #[test]
    fn box_and_reader_count_the_rings_age_by_the_times_of_the_groups_that_its_files_begin_with() {
        let wanted =
            |begun: &[u64], armed_ms| read(begun, armed_ms).map(|late| (late.is_wanted, late.is_cut));
        let (gone, taken) = (Some((true, false)), Some((false, false)));
        assert_eq!(wanted(&[90_070, 120_070], 125_000), gone);
        assert_eq!(wanted(&[90_070, 120_069], 125_000), taken, "a millisecond too soon");
        assert_eq!(wanted(&[90_070, 100_000, 110_000, 120_093], 125_000), gone);
        assert_eq!(wanted(&[90_070, 100_000, 120_093], 110_000), taken, "after the arming nothing goes");
        assert_eq!(wanted(&[90_070], 125_000), taken, "no other file is there");
    }

    /// The same of one that never was armed and did not end in order: power went, or it was copied while it waited.
    #[test]
    fn the_file_that_was_begun_last_and_is_not_there_may_have_taken_the_oldest_ones_place() {
        let late = |begun: &[u64], last_ms| waited(begun, last_ms).map(|late| (late.is_wanted, late.is_cut));
        assert_eq!(late(&[90_070, 100_000, 110_000], 119_000), Some((true, false)));
        assert_eq!(
            late(&[90_070, 100_000, 105_000], 109_000),
            Some((false, false)),
            "it has not what was to be kept"
        );
        let full = (0..15).map(|nth| 90_000 + nth * 1_000).collect::<Vec<_>>();
        assert_eq!(late(&full, 104_900), Some((true, true)));
    }

    #[test]
    fn what_the_ring_has_given_away_since_is_none_of_the_log() {
        let left = |files: &[File]| of_log(files, leftovers);
        // Of 13 to 19 the ring holds 16, which was begun at 120 s, and those after it; the vehicle is armed at 160 s.
        let begun = [90_000, 100_000, 110_000, 120_000, 130_000, 140_000, 150_000];
        let all = files_of(&begun, 160_000, true);
        assert_eq!(left(&all), 0, "nothing is missing between them");
        let without = |gone: std::ops::Range<usize>| {
            let mut some = all.clone();
            drop(some.drain(gone));
            some
        };
        assert_eq!(left(&without(1..3)), 1, "copied while it waited");
        assert_eq!(left(&without(2..3)), 2);
        // Of what was copied first the last file was in work.
        let mut cut = all.clone();
        cut[2].1.truncate(512);
        assert_eq!(left(&cut), 3);
        for taken in [3..4, 4..5, 5..6, 2..5] {
            assert_eq!(left(&without(taken.clone())), 0, "somebody took {taken:?}");
        }
        // Files after the arming.
        let mut taken = files_of(&[90_000, 120_000, 130_000, 140_000, 150_000], 125_000, true);
        drop(taken.remove(3));
        assert_eq!(left(&taken), 0, "somebody took one of what was kept");
    }

    #[test]
    fn a_log_whose_first_files_got_nothing_is_not_called_renamed_where_a_record_says_why() {
        use hums_blackbox::record::Event;

        let is_renamed = |segment: u32, number: u8, from: u32| {
            let (mut memory, mut writer) = (Memory::default(), Box::new(Writer::new()));
            let at = Instant::from_millis(700);
            if from > 0 {
                let note = Record::Note(Note { severity: 6, text: "a word" });
                writer.record(Instant::ZERO, &note, &mut memory).expect("room");
                assert!(writer.restart(&mut memory));
            }
            let begins = memory.0.len();
            let event = Record::Event(Event { number, text: "HUMS: card: none found, push one in" });
            let keep = Record::Keep(Keep { all: false, from, seconds: 30 });
            for record in [keep, event] {
                writer.record(at, &record, &mut memory).expect("room");
            }
            assert!(writer.finish(&mut memory));
            let files = [(segment, memory.0[begins..].concat())];
            of_log(&files, late).is_some_and(|late| late.is_renamed)
        };
        for from in [0, 1] {
            assert!(!is_renamed(0, 6, from) && !is_renamed(1, 6, from), "{from}");
            assert!(
                is_renamed(2, 6, from) && is_renamed(7, 6, from),
                "{from}: nothing says that the card went"
            );
            assert!(!is_renamed(2, 7, from) && !is_renamed(7, 7, from), "{from}");
        }
    }

    #[test]
    fn a_ring_that_was_full_before_it_held_enough_says_so() {
        let begun = |files: u64| (0..files).map(|nth| 90_000 + nth * 1_000).collect::<Vec<_>>();
        let is_cut = |files| read(&begun(files), 125_000).map(|late| (late.is_wanted, late.is_cut));
        assert_eq!(is_cut(16), Some((true, true)));
        assert_eq!(is_cut(15), Some((false, false)));
    }
}
