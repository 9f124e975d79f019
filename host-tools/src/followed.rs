//! Logs one after the other, each with what a later one says of its end.
//!
//! The recorder notes at each start where the session before ended on that card. A log is therefore held back until the
//! next ones were read: a file that was made when the power went has no sector, and says nothing.

use std::collections::VecDeque;

use hums_blackbox::record::Before;

use crate::ending::Proof;
use crate::summary::Overview;

/// Logs held back at most.
const HELD_MAX: usize = 4;

/// Holds logs back for as long as a later one may say something of their end.
#[derive(Debug, Default)]
pub struct Followed {
    held: VecDeque<Overview>,
}

impl Followed {
    /// Takes the next log; gives those of which nothing more will be said, in order.
    pub fn push(&mut self, mut next: Overview) -> Vec<Overview> {
        if let Some(before) = next.contents.before.filter(Before::has_end) {
            let is_it = |log: &Overview| log.summary.session == Some(before.session);
            let between = self.is_between(before.number, &next);
            match self.held.iter_mut().rev().find(|log| is_it(log)) {
                Some(log) => log.proof = Proof::of(&log.summary, Some(&before)),
                None => next.gone_before = Some(before.number).filter(|_| between),
            }
        }
        let has_sectors = next.summary.session.is_some();
        self.held.push_back(next);
        // Only the newest that has sectors can be what the next start found.
        let keep = if has_sectors { 1 } else { HELD_MAX };
        let done = self.held.len().saturating_sub(keep);
        self.held.drain(..done).collect()
    }

    /// There are no more logs.
    pub fn finish(self) -> impl Iterator<Item = Overview> {
        self.held.into_iter()
    }

    /// Whether a log of this number would lie between the last one and `next` on the same card.
    fn is_between(&self, number: u32, next: &Overview) -> bool {
        let last = self.held.back().map(|log| place(&log.name));
        last.is_some_and(|(card, last)| {
            let (card_next, next) = place(&next.name);
            card == card_next && last.zip(next).is_some_and(|(last, next)| last < number && number < next)
        })
    }
}

/// A log's name in two: what stands before its number, and the number.
fn place(name: &str) -> (&str, Option<u32>) {
    let (card, number) = name.rsplit_once('/').unwrap_or(("", name));
    (card, number.parse().ok().filter(|_| number.len() == 5))
}
