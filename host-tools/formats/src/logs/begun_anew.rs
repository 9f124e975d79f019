//! Files that the recorder had just begun to rewrite when power failed.
//!
//! A full card's oldest file gets the next name before its first new sector is written. If power fails in
//! between, that file has the newest number and holds the oldest log.
//!
//! The file's own beginning shows this. It names the session recorded just before it, and a start looks for
//! the newest one. A log may have a lower number than this file and a higher one than the session named in
//! it. Then the log was recorded later than the file's content.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use hums_blackbox::record::{Before, Found};
use hums_blackbox::{Header, Sector};

use super::groups::at_beginning;
use super::places::Log;
use super::reader::likely_epoch;

/// How a sector's bytes begin.
const HEAD: [u8; 2] = [b'H', 0xb0 | hums_blackbox::VERSION];
/// Blocks from a file's beginning in which a start finds a sector, or passes the file over (`PROBE_BLOCKS` of the recorder).
const PROBE_BLOCKS: usize = 9;
/// Number of files that a start looks at (`SEGMENTS_MAX` of the recorder). A power-on's first log is at most
/// this many numbers after the session that it names.
pub const LOOKED_AT_MAX: u32 = 3;

/// A file of a full card that the recorder has renamed to rewrite it, with its old content still in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BegunAnew {
    /// The session that the sectors name.
    pub session: u32,
    /// The number of the log that it held, from that log's beginning; `None` if that is lost.
    pub of: Option<u32>,
    /// Or it is a later log of the same power-on.
    pub or_later: bool,
    /// The next start found that content under the new name. Without it, files may have been renamed.
    pub is_confirmed: bool,
}

impl BegunAnew {
    const fn of_session(session: u32) -> Self {
        Self { session, of: None, or_later: false, is_confirmed: false }
    }

    /// Its description, as a part of a sentence.
    pub fn words(self) -> String {
        let later = if self.or_later { " or a later one of the same power-on" } else { "" };
        let what = match self.of {
            Some(of) => format!("session {of:05}{later}"),
            None => format!("the rest of an older session ({:08x}), whose beginning is lost", self.session),
        };
        let end = if self.is_confirmed { "as the next start found it" } else { "or files were renamed" };
        format!(
            "the recorder had just begun to write this file anew when power went: what is in it is {what}, which was the \
             oldest one, and nothing of its own is there; {end}"
        )
    }
}

/// A log of a card that has a number and sectors.
pub(super) struct Known<'a> {
    pub(super) number: u32,
    /// Its first sector.
    pub(super) first: Header,
    /// The block of that sector.
    pub(super) at: usize,
    pub(super) log: &'a Log,
}

/// The files begun anew, by their new numbers; several after several power cuts. `numbers` are those of all
/// logs of a card, `known` the ones with sectors, ordered by number.
pub(super) fn find(numbers: &BTreeSet<u32>, known: &[Known<'_>]) -> BTreeMap<u32, BegunAnew> {
    let mut all = BTreeMap::new();
    // The recorder rewrites files only after it has used up the first number.
    let Some(oldest) = numbers.first().copied().filter(|oldest| *oldest > 1) else { return all };
    let oldest_names =
        known.first().and_then(|known| before(known.log)).filter(|before| before.number < oldest);
    let card = Card {
        oldest,
        oldest_names: oldest_names.map(|before| before.session),
        sessions: known.iter().map(|known| known.first.session).collect(),
    };
    let (mut lower, mut torn) = (Lower::default(), Vec::new());
    for (nth, one) in known.iter().enumerate() {
        // Its new name is the one after another log's, until that one is deleted.
        let before = one.number.checked_sub(1);
        let has_place = one.number == oldest || before.is_some_and(|before| numbers.contains(&before));
        match has_place.then(|| held(one, &lower, &card)) {
            Some(Held::Older(anew)) => {
                all.insert(one.number, anew);
            }
            Some(Held::Unknown) if is_torn(one, &card) => torn.push((nth, lower.newest)),
            _ => lower.add(one),
        }
    }
    for (nth, lower) in torn {
        let (Some(one), next) = (known.get(nth), known.get(nth + 1)) else { continue };
        let is_next =
            |next: &Known<'_>| next.first.session == one.first.session && !all.contains_key(&next.number);
        if !next.is_some_and(is_next) && !is_newer(one.log, lower) {
            all.insert(one.number, BegunAnew::of_session(one.first.session));
        }
    }
    confirm(known, &mut all);
    all
}

/// Facts about a card.
struct Card {
    /// The number of its oldest log.
    oldest: u32,
    /// The session before that one, which is not there any more under its number.
    oldest_names: Option<u32>,
    /// The sessions with a log.
    sessions: BTreeSet<u32>,
}

/// The logs of lower numbers that hold their own session.
#[derive(Default)]
struct Lower<'a> {
    /// The highest one.
    newest: Option<&'a Log>,
    /// The session of the highest one, and its number.
    last: Option<(u32, u32)>,
    /// The highest number of another session.
    other: Option<u32>,
    /// The highest number of a first sector, by session.
    parts: BTreeMap<u32, u32>,
}

impl<'a> Lower<'a> {
    fn add(&mut self, one: &Known<'a>) {
        self.newest = Some(one.log);
        let session = one.first.session;
        let part = self.parts.entry(session).or_default();
        *part = one.first.number.max(*part);
        // A record that no start finds does not show the order.
        if one.at >= PROBE_BLOCKS {
            return;
        }
        if let Some((_, number)) = self.last.filter(|(last, _)| *last != session) {
            self.other = Some(number);
        }
        self.last = Some((session, one.number));
    }

    /// The highest number of another session.
    fn other_than(&self, session: u32) -> Option<u32> {
        match self.last {
            Some((last, number)) if last != session => Some(number),
            _ => self.other,
        }
    }

    /// Whether the log just before goes on with this one.
    fn goes_on(&self, one: &Known<'_>) -> bool {
        let is_part = |part: &u32| *part <= one.first.number;
        self.last.is_some_and(|(session, number)| session == one.first.session && number + 1 == one.number)
            && self.parts.get(&one.first.session).is_some_and(is_part)
    }

    /// Whether a later part of the same power-on is there.
    fn has_later_part(&self, one: &Known<'_>) -> bool {
        self.parts.get(&one.first.session).is_some_and(|part| *part > one.first.number)
    }
}

/// Facts about the content of a file.
enum Held {
    /// It is older than the logs of lower numbers.
    Older(BegunAnew),
    /// It is its own.
    Own,
    /// The record in its beginning is lost.
    Unknown,
}

fn held(one: &Known<'_>, lower: &Lower<'_>, card: &Card) -> Held {
    if lower.goes_on(one) {
        return Held::Own;
    }
    let (session, is_first) = (one.first.session, one.first.number == 0);
    let anew = BegunAnew::of_session(session);
    let is_older = |before: &Before| {
        let newest = lower.other_than(session).is_some_and(|other| other > before.number);
        let is_far = is_first && one.number.saturating_sub(before.number) > LOOKED_AT_MAX;
        before.number < card.oldest && (newest || is_far || lower.has_later_part(one))
    };
    let Some(before) = own(one.log) else {
        let is_older = card.oldest_names == Some(session) || lower.has_later_part(one);
        return if is_older { Held::Older(anew) } else { Held::Unknown };
    };
    // If another card was in the box, the first record is about that one; the last one is about this card.
    match Some(before).filter(is_older).and_then(|_| own_last(one.log)).filter(is_older) {
        Some(before) => {
            Held::Older(BegunAnew { of: Some(before.number.saturating_add(1)), or_later: !is_first, ..anew })
        }
        None => Held::Own,
    }
}

/// Whether power failed while a file's first sector was rewritten. Three signs show it:
/// - The head of the new sector has number 0 and a session that occurs nowhere else on the card.
/// - The sector fails its check.
/// - The older log continues behind it.
///
/// A damaged head differs in some bytes of the session only, or has zeros or ones there.
fn is_torn(one: &Known<'_>, card: &Card) -> bool {
    let first = || one.log.blocks().next_block().ok().flatten().copied();
    let Some(block) = (one.at == 1).then(first).flatten() else { return false };
    let torn = Sector::from_bytes(block);
    let (new, old) = (torn.session().to_le_bytes(), one.first.session.to_le_bytes());
    let is_other =
        new.iter().zip(&old).all(|(new, old)| new != old) && !matches!(torn.session(), 0 | u32::MAX);
    let is_first = block.starts_with(&HEAD) && torn.starts_group() && torn.number() == 0;
    is_first && is_other && !card.sessions.contains(&torn.session())
}

/// Whether a log began after one of a lower number, by the clocks of both if both are set: then it is not
/// older.
fn is_newer(log: &Log, lower: Option<&Log>) -> bool {
    let epoch = |log: &Log| likely_epoch(log).ok().flatten();
    lower.and_then(epoch).is_some_and(|lower| epoch(log).is_some_and(|own| own > lower))
}

/// Marks a series of begun files as confirmed by the next start, which looked at the last one. Each of the
/// series holds the recording after the one before it.
fn confirm(known: &[Known<'_>], all: &mut BTreeMap<u32, BegunAnew>) {
    let mut later: Option<(u32, BegunAnew, u32)> = None;
    for (nth, one) in known.iter().enumerate().rev() {
        let Some(anew) = all.get_mut(&one.number) else { continue };
        let (next, first) = (known.get(nth + 1), one.first.number);
        anew.is_confirmed = match (next, later) {
            (Some(next), Some((number, after, after_first))) if next.number == number => {
                let in_order = |(of, after_of)| (of, first) < (after_of, after_first);
                after.is_confirmed && one.number + 1 == number && anew.of.zip(after.of).is_none_or(in_order)
            }
            (Some(next), _) => before(next.log)
                .is_some_and(|found| (found.number, found.session) == (one.number, anew.session)),
            (None, _) => false,
        };
        later = Some((one.number, *anew, first));
    }
}

/// The session before a log on its card and its end, if the beginning of the log records them.
pub(super) fn before(log: &Log) -> Option<Before> {
    at_beginning(log, |boot| Some(boot.before).filter(Before::has_end))
}

/// Whether a log's beginning reports that its card had no log.
pub(super) fn found_nothing(log: &Log) -> bool {
    own(log).is_some_and(|before| before.found == Found::Nothing)
}

/// The first record of a log's beginning about its card.
fn own(log: &Log) -> Option<Before> {
    at_beginning(log, |boot| Some(boot.before).filter(|before| before.found != Found::Unknown))
}

/// The last such record.
fn own_last(log: &Log) -> Option<Before> {
    let last = Cell::new(None);
    let _: Option<()> = at_beginning(log, |boot| {
        if boot.before.found != Found::Unknown {
            last.set(Some(boot.before));
        }
        None
    });
    last.get()
}
