//! Logs one after the other, each with what a later one says of its end.
//!
//! The recorder notes at each start where the session before ended on that card. A log is therefore held back until the
//! next ones were read: a file that was made when the power went has no sector, and says nothing.

use std::collections::VecDeque;

use hums_blackbox::record::Before;

use crate::ending::{Ending, Misnamed, Proof, SessionBefore};
use crate::sessions::{Sessions, place};

/// Logs held back at most; so many after a log may say something of its end.
pub const HELD_MAX: usize = 4;

/// What is made of a log that was read.
pub trait Logged {
    /// What is known of its end, where it is a log of ours.
    fn ending(&mut self) -> Option<&mut Ending>;
}

/// Holds logs back for as long as a later one may say something of their end.
#[derive(Debug)]
pub struct Followed<T> {
    held: VecDeque<T>,
    sessions: Sessions,
}

impl<T: Logged> Followed<T> {
    /// Of logs whose first sectors were looked at.
    pub const fn new(sessions: Sessions) -> Self {
        Self { held: VecDeque::new(), sessions }
    }

    /// Takes the next log; gives those of which nothing more will be said, in order.
    pub fn push(&mut self, mut next: T) -> Vec<T> {
        let mut has_sectors = false;
        if let Some(ending) = next.ending() {
            has_sectors = ending.summary.session.is_some();
            ending.misnamed = self.misnamed(ending);
            ending.again = self.sessions.again(&ending.name).map(str::to_owned);
            if let Some(before) = ending.summary.marks.before.filter(Before::has_end)
                && ending.is_counted()
            {
                self.tell(&before, ending);
            }
        }
        self.held.push_back(next);
        // Only the newest that has sectors can be what the next start found.
        let keep = if has_sectors { 1 } else { HELD_MAX };
        let done = self.held.len().saturating_sub(keep);
        self.held.drain(..done).collect()
    }

    /// There are no more logs.
    pub fn finish(self) -> impl Iterator<Item = T> {
        self.held.into_iter()
    }

    /// What of a log's name disagrees with what the logs hold.
    fn misnamed(&self, ending: &Ending) -> Option<Misnamed> {
        let session = ending.summary.session?;
        if let Some(of) = self.sessions.copy_of(&ending.name, session) {
            return Some(Misnamed::Copy { of });
        }
        let before = ending.summary.marks.before.filter(Before::has_end)?;
        let is_later = place(&ending.name).1.is_some_and(|number| number <= before.number);
        (is_later && before.session != session).then_some(Misnamed::Later { before: before.number })
    }

    /// What the start of `next` found of the log before it.
    fn tell(&mut self, before: &Before, next: &mut Ending) {
        let (card, number) = place(&next.name);
        let mut held: Vec<&mut Ending> = self.held.iter_mut().filter_map(Logged::ending).collect();
        // Its place is between a log that was read and the next one, on the same card; or a log of its number is there, and
        // is another session.
        let is_looked_at = |name: &str| {
            let (other, read) = place(name);
            let numbers = number.zip(read);
            card == other && numbers.is_some_and(|(next, read)| read <= before.number && before.number < next)
        };
        let is_looked_at = held.iter().any(|log| is_looked_at(&log.name));
        let numbers = self.sessions.numbers(card, before.session);
        let elsewhere = numbers.first().copied().filter(|_| !numbers.contains(&before.number));
        match held.iter_mut().rev().find(|log| log.summary.session == Some(before.session)) {
            Some(log) => {
                log.proof = Proof::of(&log.summary, Some(before));
                next.before = SessionBefore::There;
            }
            None if numbers.contains(&before.number) => next.before = SessionBefore::There,
            None if is_looked_at => next.before = SessionBefore::Gone(before.number),
            None => next.before = SessionBefore::NotLookedFor(before.number),
        }
        if let Some(there) = elsewhere {
            next.before = SessionBefore::Elsewhere { number: before.number, there };
        }
        // The start looked at each file from the newest on until it found a sector.
        for log in held.into_iter().filter(|log| log.summary.session.is_none()) {
            let (other, empty) = place(&log.name);
            let is_after = |empty: u32| before.number < empty && number.is_some_and(|next| empty < next);
            if card == other && empty.is_some_and(is_after) {
                log.proof = Proof::NextStart(None);
            }
        }
    }
}
