//! The session of each log number of a card, from first sectors, before the logs are read. Copied, renamed or
//! exchanged logs are found anywhere.

use std::collections::{BTreeMap, BTreeSet};

use hums_blackbox::Header;

use super::fingerprint::{Fingerprint, fingerprint};
use super::places::{Log, Piece};

/// Blocks of one read.
const LOOK_BLOCKS: usize = 128;

/// The numbers of each session, by card.
#[derive(Clone, Debug, Default)]
pub struct Sessions {
    logs: BTreeMap<(String, u32), Vec<u32>>,
    /// Original by name of the copy.
    again: BTreeMap<String, String>,
    numbers: BTreeMap<String, BTreeSet<u32>>,
}

impl Sessions {
    /// From first sectors, by name. Names without a number are left out.
    pub fn of<'a>(logs: impl IntoIterator<Item = (&'a str, &'a Log)>) -> Self {
        let logs: Vec<(&str, &Log)> = logs.into_iter().collect();
        let mut all: BTreeMap<_, Vec<u32>> = BTreeMap::new();
        let mut alike: BTreeMap<u32, Vec<Candidate<'_>>> = BTreeMap::new();
        let mut numbers: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
        for &(name, log) in &logs {
            let (card, number) = place(name);
            if let Some(number) = number {
                numbers.entry(card.to_owned()).or_default().insert(number);
            }
            let Some(first) = first_sector(log) else { continue };
            alike.entry(first.session).or_default().push(Candidate { name, number, log });
            if let Some(number) = number {
                all.entry((card.to_owned(), first.session)).or_default().push(number);
            }
        }
        let again = alike.into_values().flat_map(copies).collect();
        Self { logs: all, again, numbers }
    }

    /// The original of a copy (or of one of its files), sector by sector.
    pub fn again(&self, name: &str) -> Option<&str> {
        self.again.get(name).map(String::as_str)
    }

    /// A session's numbers on a card.
    pub fn numbers(&self, card: &str, session: u32) -> &[u32] {
        self.logs.get(&(card.to_owned(), session)).map_or(&[], Vec::as_slice)
    }

    /// Whether a card has a log of a lower number.
    pub fn has_older(&self, card: &str, number: u32) -> bool {
        self.numbers.get(card).is_some_and(|numbers| numbers.range(..number).next().is_some())
    }

    /// Whether the card's oldest file may be of this session: it has no log there, or the lowest number.
    pub fn may_be_oldest(&self, card: &str, session: u32) -> bool {
        let lowest = self.numbers.get(card).and_then(|numbers| numbers.first());
        let own = self.numbers(card, session).iter().min();
        own.is_none() || own == lowest
    }
}

/// May have copies.
struct Candidate<'a> {
    name: &'a str,
    number: Option<u32>,
    log: &'a Log,
}

impl Candidate<'_> {
    fn fingerprints(&self) -> Vec<Fingerprint> {
        let file = |piece: &Piece| Log { pieces: vec![piece.clone()], ..self.log.clone() };
        let files = self.log.pieces.iter().map(file).filter(|_| self.log.pieces.len() > 1);
        std::iter::once(self.log.clone()).chain(files).filter_map(|log| fingerprint(&log).ok()).collect()
    }
}

/// Copies with their originals. A card's log counts before another name, more files before fewer.
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
pub fn copy_words(original: &str) -> String {
    format!("is a copy of {original} (not counted)")
}

/// Prefix and number.
pub fn place(name: &str) -> (&str, Option<u32>) {
    let (card, number) = name.rsplit_once('/').unwrap_or(("", name));
    (card, number.parse().ok().filter(|_| number.len() == 5))
}

/// The session of a log's first sector.
pub fn first_session(log: &Log) -> Option<u32> {
    first_sector(log).map(|first| first.session)
}

/// Reading the log reports errors.
fn first_sector(log: &Log) -> Option<Header> {
    let mut blocks = log.blocks();
    for _ in 0..LOOK_BLOCKS {
        if let Ok(header) = Header::read(blocks.next_block().ok()??) {
            return Some(header);
        }
    }
    None
}
