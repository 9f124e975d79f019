//! Which session each number of a card holds. The first sector of each log tells it, so it is known before the logs are
//! read: a log that was copied, renamed or exchanged with another one is found wherever it stands.

use std::collections::{BTreeMap, BTreeSet};

use hums_blackbox::Header;
use hums_blackbox::record::{Before, Boot};

use super::board::{HEADING_GROUPS, find_boot};
use super::fingerprint::{Fingerprint, fingerprint};
use super::groups::Groups;
use super::places::{Log, Piece};

/// Blocks that are searched for a log's first sector: what is read at once.
const LOOK_BLOCKS: usize = 128;

/// The numbers under which each session is there, by card.
#[derive(Clone, Debug, Default)]
pub struct Sessions {
    /// By what stands before the number in a log's name, and by the session that its sectors name: the number, and that of
    /// its first sector. Logs by arming share the session of a power-on, and their sectors are numbered on.
    logs: BTreeMap<(String, u32), Vec<(u32, u32)>>,
    /// Of logs that hold the same as another one: the name of that.
    again: BTreeMap<String, String>,
    /// The numbers of all logs of each card, also of those without a sector.
    numbers: BTreeMap<String, BTreeSet<u32>>,
    /// By card and number.
    begun_anew: BTreeMap<(String, u32), BegunAnew>,
}

impl Sessions {
    /// Looks at the first sectors of these logs, by their names. What has no number is left out.
    pub fn of<'a>(logs: impl IntoIterator<Item = (&'a str, &'a Log)>) -> Self {
        let logs: Vec<(&str, &Log)> = logs.into_iter().collect();
        let mut all: BTreeMap<_, Vec<(u32, u32)>> = BTreeMap::new();
        let mut alike: BTreeMap<u32, Vec<Candidate<'_>>> = BTreeMap::new();
        let mut numbers: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
        let mut oldest: BTreeMap<&str, (u32, &Log)> = BTreeMap::new();
        for &(name, log) in &logs {
            let (card, number) = place(name);
            if let Some(number) = number {
                numbers.entry(card.to_owned()).or_default().insert(number);
                let oldest = oldest.entry(card).or_insert((number, log));
                *oldest = if number < oldest.0 { (number, log) } else { *oldest };
            }
            let Some(first) = first_sector(log) else { continue };
            alike.entry(first.session).or_default().push(Candidate { name, card, number, log });
            if let Some(number) = number {
                all.entry((card.to_owned(), first.session)).or_default().push((number, first.number));
            }
        }
        let again = alike.into_values().flat_map(copies).collect();
        let mut sessions = Self { logs: all, again, numbers, begun_anew: BTreeMap::new() };
        for (card, (number, log)) in oldest {
            if let Some((there, of)) = sessions.find_begun_anew(card, number, log) {
                let later = logs.iter().filter_map(|(name, log)| {
                    let (other, number) = place(name);
                    Some((number.filter(|number| other == card && *number > there)?, log))
                });
                // The next start looked at what was there.
                let next = later.min_by_key(|(number, _)| *number).and_then(|(_, log)| before(log));
                let is_confirmed = next.is_some_and(|next| next.number == there);
                sessions.begun_anew.insert((card.to_owned(), there), BegunAnew { of, is_confirmed });
            }
        }
        sessions
    }

    /// What a log's file held when the recorder had just begun to write it anew, if it had. A full card's oldest file gets the
    /// next name before its first sector is written.
    pub fn begun_anew(&self, name: &str) -> Option<BegunAnew> {
        let (card, number) = place(name);
        self.begun_anew_number(card, number?)
    }

    /// The same by card and number.
    pub fn begun_anew_number(&self, card: &str, number: u32) -> Option<BegunAnew> {
        self.begun_anew.get(&(card.to_owned(), number)).copied()
    }

    /// The name of the log of which this one is a copy, sector by sector, or a copy of one of its files: under a name that
    /// is no number, or on another card. It is not to be counted again.
    pub fn again(&self, name: &str) -> Option<&str> {
        self.again.get(name).map(String::as_str)
    }

    /// The numbers under which a session is there on a card.
    pub fn numbers(&self, card: &str, session: u32) -> Vec<u32> {
        self.of_session(card, session).iter().map(|(number, _)| *number).collect()
    }

    /// How many of the numbers between these two no log of a card has.
    pub fn absent(&self, card: &str, after: u32, before: u32) -> u32 {
        let (first, end) = (after.saturating_add(1), before.max(after.saturating_add(1)));
        let there = self.numbers.get(card).map_or(0, |numbers| numbers.range(first..end).count());
        (end - first).saturating_sub(there as u32)
    }

    /// Whether a card has a log of a lower number.
    pub fn has_older(&self, card: &str, number: u32) -> bool {
        self.numbers.get(card).is_some_and(|numbers| numbers.range(..number).next().is_some())
    }

    /// The lower number under which the log of this name is there too.
    pub fn copy_of(&self, name: &str, session: u32) -> Option<u32> {
        let (card, number) = place(name);
        let (number, all) = (number?, self.of_session(card, session));
        let (_, first) = all.iter().find(|(other, _)| *other == number)?;
        let same = all.iter().filter(|(other, other_first)| other_first == first && *other < number);
        same.map(|(other, _)| *other).min()
    }

    /// The same where the log was not read.
    pub fn copy_of_log(&self, name: &str, log: &Log) -> Option<u32> {
        self.copy_of(name, first_sector(log)?.session)
    }

    /// The number under which a card has what was its oldest log before this one, and the number that it had; `oldest` is the
    /// lowest number that is there. What is left of it is older than the oldest log: it begins before that one in the same
    /// power-on, or the oldest log names it as the session before. Its new name is the one after another log's.
    fn find_begun_anew(&self, card: &str, oldest: u32, log: &Log) -> Option<(u32, u32)> {
        let first = first_sector(log)?;
        let of_session = self.of_session(card, first.session).iter();
        let earlier = of_session.filter(|(_, number)| *number < first.number).map(|(there, _)| *there).next();
        let (there, of) = if let Some(there) = earlier {
            (there, oldest.checked_sub(1)?)
        } else {
            let before = before(log).filter(|before| before.number < oldest)?;
            match self.of_session(card, before.session) {
                [(there, _)] => (*there, before.number),
                _ => return None,
            }
        };
        (self.absent(card, there.checked_sub(2)?, there) == 0).then_some((there, of))
    }

    fn of_session(&self, card: &str, session: u32) -> &[(u32, u32)] {
        self.logs.get(&(card.to_owned(), session)).map_or(&[], Vec::as_slice)
    }
}

/// The session before a log on its card and how it ended, where the beginning of the log tells that.
fn before(log: &Log) -> Option<Before> {
    let mut groups = Groups::new(log);
    let end_of = |boot: &Boot<'_>| Some(boot.before).filter(Before::has_end);
    for _ in 0..HEADING_GROUPS {
        if let Some(before) = find_boot(&groups.next_group().ok()??, end_of) {
            return Some(before);
        }
    }
    None
}

/// A file of a full card that the recorder has given a new name, to write it anew, and whose old content is still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BegunAnew {
    /// The number of the session that it held: the oldest one of the card.
    pub of: u32,
    /// The next start found that content under the new name. Without it, files may have been renamed.
    pub is_confirmed: bool,
}

impl BegunAnew {
    /// What it is, as a part of a sentence.
    pub fn words(self) -> String {
        let Self { of, is_confirmed } = self;
        let end = if is_confirmed { "as the next start found it" } else { "or files were renamed" };
        format!(
            "the recorder had just begun to write this file anew when power went: what is in it is session {of:05}, which \
             is the oldest one, and nothing of its own is there; {end}"
        )
    }
}

/// A log of a session of which others may be copies.
struct Candidate<'a> {
    name: &'a str,
    card: &'a str,
    number: Option<u32>,
    log: &'a Log,
}

impl Candidate<'_> {
    /// Whether one may be a copy of the other. Two numbers of one card cannot: one of them has lost its own session.
    fn may_be_copy(&self, other: &Self) -> bool {
        self.card != other.card || self.number.is_none() || other.number.is_none()
    }

    /// Of all of it, then of each file where there are several. What cannot be read is no copy; it is said where it is read.
    fn fingerprints(&self) -> Vec<Fingerprint> {
        let file = |piece: &Piece| Log { pieces: vec![piece.clone()], ..self.log.clone() };
        let files = self.log.pieces.iter().map(file).filter(|_| self.log.pieces.len() > 1);
        std::iter::once(self.log.clone()).chain(files).filter_map(|log| fingerprint(&log).ok()).collect()
    }
}

/// Names of copies among the logs of one session, each with that of its original: a card's log before one of another name,
/// one of more files before one of less.
fn copies(mut logs: Vec<Candidate<'_>>) -> Vec<(String, String)> {
    let eligible =
        |log: &Candidate<'_>| logs.iter().any(|other| log.name != other.name && log.may_be_copy(other));
    if !logs.iter().any(eligible) {
        return Vec::new();
    }
    logs.sort_by_key(|log| (log.number.is_none(), std::cmp::Reverse(log.log.pieces.len())));
    let (mut originals, mut copies) = (Vec::<(Candidate<'_>, Vec<Fingerprint>)>::new(), Vec::new());
    for log in logs {
        let all = log.fingerprints();
        let is_original = |(other, others): &&(Candidate<'_>, Vec<Fingerprint>)| {
            log.may_be_copy(other) && all.first().is_some_and(|whole| others.contains(whole))
        };
        match originals.iter().find(is_original) {
            Some((original, _)) => copies.push((log.name.to_owned(), original.name.to_owned())),
            None => originals.push((log, all)),
        }
    }
    copies
}

/// What is said of a copy.
pub fn again_words(original: &str) -> String {
    format!("is the same session as {original} once more (not counted)")
}

/// What is said of a log that holds the session of this number.
pub fn copy_words(of: u32) -> String {
    format!("is session {of:05} once more; its own log is not there")
}

/// A log's name in two: what stands before its number, and the number.
pub fn place(name: &str) -> (&str, Option<u32>) {
    let (card, number) = name.rsplit_once('/').unwrap_or(("", name));
    (card, number.parse().ok().filter(|_| number.len() == 5))
}

/// The session of a log's first sector.
pub fn first_session(log: &Log) -> Option<u32> {
    first_sector(log).map(|first| first.session)
}

/// A log's first sector. That a log cannot be read is said where it is read.
fn first_sector(log: &Log) -> Option<Header> {
    let mut blocks = log.blocks();
    for _ in 0..LOOK_BLOCKS {
        if let Ok(header) = Header::read(&blocks.next_block().ok()??) {
            return Some(header);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::fs;

    use hums_blackbox::record::Found;
    use hums_blackbox::{Record, Sector, SectorSink, Writer};
    use hums_core::time::Instant;

    use super::*;
    use crate::logs::find::find_in;

    /// The first sector of a session with this number.
    fn sector(session: u32, number: u32) -> Vec<u8> {
        let mut bytes = [0; 512];
        bytes[..2].copy_from_slice(&[0x48, 0xb1]);
        bytes[11..15].copy_from_slice(&number.to_le_bytes());
        sealed(Sector::from_bytes(bytes), session)
    }

    fn sealed(mut sector: Sector, session: u32) -> Vec<u8> {
        sector.seal(session);
        sector.bytes().to_vec()
    }

    #[derive(Default)]
    struct Sink(Vec<Sector>);

    impl SectorSink for Sink {
        fn room(&self) -> usize {
            usize::MAX
        }

        fn put(&mut self, sector: &Sector) {
            self.0.push(*sector);
        }
    }

    /// A log of which the start found this session under this number.
    fn after(number: u32, session: u32) -> Vec<u8> {
        let (mut writer, mut sink) = (Box::new(Writer::new()), Sink::default());
        let before = Before { found: Found::Frames, number, session, ..Before::default() };
        let boot = Record::Boot(Boot { before, ..Boot::default() });
        writer.record(Instant::ZERO, &boot, &mut sink).expect("room");
        writer.finish(&mut sink);
        sink.0.into_iter().flat_map(|sector| sealed(sector, 9)).collect()
    }

    #[test]
    fn a_file_that_was_to_be_written_anew_is_known_and_the_next_start_confirms_it() {
        let dir = tempfile::tempdir().expect("a folder");
        let write = |name: u32, bytes: Vec<u8>| {
            fs::write(dir.path().join(format!("{name:05}_00.HUM")), bytes).expect("room");
        };
        let anew = || {
            let found = find_in(dir.path(), false).expect("a folder");
            let sessions = Sessions::of(found.logs.iter().map(|log| (log.name.as_str(), log)));
            found
                .logs
                .iter()
                .filter_map(|log| Some((log.name.clone(), sessions.begun_anew(&log.name)?)))
                .collect::<Vec<_>>()
        };
        // The beginning of the power-on whose second log is the oldest one that is there.
        write(5, sector(7, 100));
        write(6, sector(8, 0));
        write(7, sector(7, 0));
        assert_eq!(anew(), [("00007".to_owned(), BegunAnew { of: 4, is_confirmed: false })]);
        write(8, after(7, 7));
        assert_eq!(anew(), [("00007".to_owned(), BegunAnew { of: 4, is_confirmed: true })]);
        // No log has the number before it: somebody gave it that name.
        fs::remove_file(dir.path().join("00006_00.HUM")).expect("there");
        assert_eq!(anew(), []);
        // All of the power-on before the oldest one that is there.
        write(5, after(4, 7));
        write(6, sector(8, 0));
        assert_eq!(anew(), [("00007".to_owned(), BegunAnew { of: 4, is_confirmed: true })]);
    }
}
