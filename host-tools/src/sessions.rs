//! Which session each number of a card holds. The first sector of each log tells it, so it is known before the logs are
//! read: a log that was copied, renamed or exchanged with another one is found wherever it stands.

use std::collections::BTreeMap;

use hums_blackbox::Header;

use crate::logs::Log;

/// Blocks that are searched for a log's first sector: what is read at once.
const LOOK_BLOCKS: usize = 128;

/// The numbers under which each session is there, by card.
#[derive(Clone, Debug, Default)]
pub struct Sessions {
    /// By what stands before the number in a log's name, and by the session that its sectors name: the number, and that of
    /// its first sector. Logs by arming share the session of a power-on, and their sectors are numbered on.
    logs: BTreeMap<(String, u32), Vec<(u32, u32)>>,
}

impl Sessions {
    /// Looks at the first sectors of these logs, by their names. What has no number is left out.
    pub fn of<'a>(logs: impl IntoIterator<Item = (&'a str, &'a Log)>) -> Self {
        let mut all: BTreeMap<_, Vec<(u32, u32)>> = BTreeMap::new();
        for (name, log) in logs {
            if let (card, Some(number)) = place(name)
                && let Some(first) = first_sector(log)
            {
                all.entry((card.to_owned(), first.session)).or_default().push((number, first.number));
            }
        }
        Self { logs: all }
    }

    /// The numbers under which a session is there on a card.
    pub fn numbers(&self, card: &str, session: u32) -> Vec<u32> {
        self.of_session(card, session).iter().map(|(number, _)| *number).collect()
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

    fn of_session(&self, card: &str, session: u32) -> &[(u32, u32)] {
        self.logs.get(&(card.to_owned(), session)).map_or(&[], Vec::as_slice)
    }
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
