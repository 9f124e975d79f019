//! The session of each log number of a card. The first sector of each log has it, so it is known before the
//! logs are read. A log that was copied, renamed or exchanged with another one is found anywhere.

use std::collections::{BTreeMap, BTreeSet};

use hums_blackbox::Header;

use super::begun_anew::{self, BegunAnew, Known};
use super::fingerprint::{Fingerprint, fingerprint};
use super::places::{Log, Piece};

/// Number of blocks searched for a log's first sector: one read.
const LOOK_BLOCKS: usize = 128;

/// The numbers under which each session is there, by card.
#[derive(Clone, Debug, Default)]
pub struct Sessions {
    /// The numbers of its logs, by the prefix of their names, and by the session in their sectors.
    logs: BTreeMap<(String, u32), Vec<u32>>,
    /// Of logs that hold the same as another one: the name of that.
    again: BTreeMap<String, String>,
    /// The numbers of all logs of each card, also of those without a sector.
    numbers: BTreeMap<String, BTreeSet<u32>>,
    /// By card and number.
    begun_anew: BTreeMap<(String, u32), BegunAnew>,
}

impl Sessions {
    /// Looks at the first sectors of these logs, by their names. Names without a number are left out.
    pub fn of<'a>(logs: impl IntoIterator<Item = (&'a str, &'a Log)>) -> Self {
        let logs: Vec<(&str, &Log)> = logs.into_iter().collect();
        let mut all: BTreeMap<_, Vec<u32>> = BTreeMap::new();
        let mut alike: BTreeMap<u32, Vec<Candidate<'_>>> = BTreeMap::new();
        let mut numbers: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
        let mut known: BTreeMap<&str, Vec<Known<'_>>> = BTreeMap::new();
        for &(name, log) in &logs {
            let (card, number) = place(name);
            if let Some(number) = number {
                numbers.entry(card.to_owned()).or_default().insert(number);
            }
            let Some(first) = first_sector(log) else { continue };
            alike.entry(first.session).or_default().push(Candidate { name, number, log });
            if let Some(number) = number {
                all.entry((card.to_owned(), first.session)).or_default().push(number);
                known.entry(card).or_default().push(Known { number, session: first.session, log });
            }
        }
        let again = alike.into_values().flat_map(copies).collect();
        let mut anew = BTreeMap::new();
        for (card, mut known) in known {
            known.sort_by_key(|known| known.number);
            let numbers = numbers.get(card).map_or_else(BTreeMap::new, |all| begun_anew::find(all, &known));
            anew.extend(numbers.into_iter().map(|(number, anew)| ((card.to_owned(), number), anew)));
        }
        Self { logs: all, again, numbers, begun_anew: anew }
    }

    /// The old content of a log's file, if the recorder had just begun to rewrite it. A full card's oldest
    /// file gets the next name before its first sector is written.
    pub fn begun_anew(&self, name: &str) -> Option<BegunAnew> {
        let (card, number) = place(name);
        self.begun_anew.get(&(card.to_owned(), number?)).copied()
    }

    /// The name of the original if this log is a copy of it or of one of its files, sector by sector. Copies
    /// are not counted.
    pub fn again(&self, name: &str) -> Option<&str> {
        self.again.get(name).map(String::as_str)
    }

    /// The numbers under which a session is there on a card.
    pub fn numbers(&self, card: &str, session: u32) -> &[u32] {
        self.logs.get(&(card.to_owned(), session)).map_or(&[], Vec::as_slice)
    }

    /// Whether a card has a log of a lower number.
    pub fn has_older(&self, card: &str, number: u32) -> bool {
        self.numbers.get(card).is_some_and(|numbers| numbers.range(..number).next().is_some())
    }

    /// Whether the content of a card's oldest file may be of this session. It may if the session has no log
    /// on the card, or the one of the lowest number.
    pub fn may_be_oldest(&self, card: &str, session: u32) -> bool {
        let lowest = self.numbers.get(card).and_then(|numbers| numbers.first());
        let own = self.numbers(card, session).iter().min();
        own.is_none() || own == lowest
    }
}

/// A log of a session that may have copies.
struct Candidate<'a> {
    name: &'a str,
    number: Option<u32>,
    log: &'a Log,
}

impl Candidate<'_> {
    /// Fingerprints of the log, and of each of several files. An unreadable log does not count as a copy;
    /// reading it reports the error.
    fn fingerprints(&self) -> Vec<Fingerprint> {
        let file = |piece: &Piece| Log { pieces: vec![piece.clone()], ..self.log.clone() };
        let files = self.log.pieces.iter().map(file).filter(|_| self.log.pieces.len() > 1);
        std::iter::once(self.log.clone()).chain(files).filter_map(|log| fingerprint(&log).ok()).collect()
    }
}

/// Names of copies among the logs of one session, each with its original. A card's log counts as the original
/// before one of another name, and one of more files before one of fewer.
fn copies(mut logs: Vec<Candidate<'_>>) -> Vec<(String, String)> {
    if logs.len() < 2 {
        return Vec::new();
    }
    logs.sort_by_key(|log| (log.number.is_none(), std::cmp::Reverse(log.log.pieces.len())));
    let (mut originals, mut copies) = (Vec::<(&str, Vec<Fingerprint>)>::new(), Vec::new());
    for log in &logs {
        let all = log.fingerprints();
        let is_original =
            |(_, others): &&(&str, Vec<Fingerprint>)| all.first().is_some_and(|whole| others.contains(whole));
        match originals.iter().find(is_original) {
            Some((original, _)) => copies.push((log.name.to_owned(), (*original).to_owned())),
            None => originals.push((log.name, all)),
        }
    }
    copies
}

/// Words about a copy.
pub fn again_words(original: &str) -> String {
    format!("is the same session as {original} once more (not counted)")
}

/// A log's name in two: the prefix and the number.
pub fn place(name: &str) -> (&str, Option<u32>) {
    let (card, number) = name.rsplit_once('/').unwrap_or(("", name));
    (card, number.parse().ok().filter(|_| number.len() == 5))
}

/// The session of a log's first sector.
pub fn first_session(log: &Log) -> Option<u32> {
    first_sector(log).map(|first| first.session)
}

/// A log's first sector. Reading the log reports errors.
fn first_sector(log: &Log) -> Option<Header> {
    let mut blocks = log.blocks();
    for _ in 0..LOOK_BLOCKS {
        if let Ok(header) = Header::read(blocks.next_block().ok()??) {
            return Some(header);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::fs;

    use hums_blackbox::record::{Before, Boot, Found};
    use hums_blackbox::{Record, Sector, SectorSink, Writer};
    use hums_core::clock::Instant;

    use super::*;
    use crate::logs::find::find_in;

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

    /// A log whose start found this session under this number.
    fn after(number: u32, session: u32) -> Vec<u8> {
        log(9, number, session)
    }

    /// The same of a session of this name.
    fn log(own: u32, number: u32, session: u32) -> Vec<u8> {
        let (mut writer, mut sink) = (Box::new(Writer::new()), Sink::default());
        let before = Before { found: Found::Frames, number, session, ..Before::default() };
        let boot = Record::Boot(Boot { before, ..Boot::default() });
        writer.record(Instant::ZERO, &boot, &mut sink).expect("room");
        writer.finish(&mut sink);
        sink.0.into_iter().flat_map(|sector| sealed(sector, own)).collect()
    }

    /// Logs in a folder; the recorder had begun to rewrite some files.
    struct Card(tempfile::TempDir);

    impl Card {
        fn new() -> Self {
            Self(tempfile::tempdir().expect("a folder"))
        }

        fn write(&self, name: u32, bytes: impl AsRef<[u8]>) {
            fs::write(self.0.path().join(format!("{name:05}_00.HUM")), bytes).expect("room");
        }

        fn remove(&self, name: u32) {
            fs::remove_file(self.0.path().join(format!("{name:05}_00.HUM"))).expect("there");
        }

        /// By number: the old log, and whether the next start found it so.
        fn anew(&self) -> Vec<(u32, u32, bool)> {
            let found = find_in(self.0.path(), false).expect("a folder");
            let sessions = Sessions::of(found.logs.iter().map(|log| (log.name.as_str(), log)));
            let anew = |name: &str| {
                let BegunAnew { of, is_confirmed } = sessions.begun_anew(name)?;
                Some((place(name).1?, of, is_confirmed))
            };
            found.logs.iter().filter_map(|log| anew(&log.name)).collect()
        }
    }

    #[test]
    fn a_file_that_was_to_be_written_anew_is_known_and_the_next_start_confirms_it() {
        let card = Card::new();
        card.write(5, after(4, 4));
        card.write(6, log(6, 5, 5));
        // Two sessions fill the card: the oldest one is the content of the newest file.
        card.write(7, log(4, 3, 3));
        assert_eq!(card.anew(), [(7, 4, false)]);
        card.write(8, after(7, 4));
        assert_eq!(card.anew(), [(7, 4, true)]);
        // Logs in the order of recording, of which somebody deleted the first ones.
        card.write(7, log(7, 6, 6));
        assert_eq!(card.anew(), []);
    }

    #[test]
    fn power_that_goes_several_times_at_the_start_renames_nothing() {
        let card = Card::new();
        // The card had 10 to 14. Power failed just after 10 and 11 got the next names; then a start overwrote 12.
        card.write(13, log(13, 12, 12));
        card.write(14, log(14, 13, 13));
        card.write(15, log(10, 9, 9));
        assert_eq!(card.anew(), [(15, 10, false)]);
        card.write(16, log(11, 10, 10));
        assert_eq!(card.anew(), [(15, 10, false), (16, 11, false)]);
        card.write(17, log(17, 16, 11));
        let both = [(15, 10, true), (16, 11, true)];
        assert_eq!(card.anew(), both);
        // The names stay while later starts write over the others, to the last.
        for number in [13, 14] {
            card.remove(number);
            card.write(number + 5, log(number + 5, number + 4, number + 4));
            assert_eq!(card.anew(), both);
        }
        card.remove(15);
        card.write(20, log(20, 19, 19));
        assert_eq!(card.anew(), both[1..]);
    }
}
