//! The order of logs in time.
//!
//! A clock may be wrong, so UTC decides last:
//! * logs of one card: by their numbers;
//! * other logs of one box: by its count of power-ons, and within a power-on by the time since then;
//! * logs of different boxes, and recordings of other programs: by UTC. A log without UTC stays after the log before it.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use hums_core::clock::Instant;

use crate::logs::board::{Board, known};
use crate::logs::sessions::place;
use crate::summary::Overview;

/// A log's place in time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogTime {
    /// Its card, if its name is a card's number; its box.
    chain: (Option<String>, Board),
    /// Box, power-ons of its life, and first moment since power-on.
    power_on: Option<(Board, u32, Option<Instant>)>,
    /// UTC of its start in microseconds since 1970; `None` if unknown, or if the other logs of its card contradict it.
    pub start_us: Option<u64>,
    /// The same, or that of the log before it.
    begun_us: u64,
}

impl LogTime {
    /// By the log's records.
    pub fn of(log: &Overview) -> Self {
        let first = log.ending.summary.first;
        let start_us = first.and_then(|first| log.utc_us(first));
        let boot = log.contents.boot.as_ref().filter(|_| log.format.is_none());
        let board = boot.map_or([0; 12], |boot| boot.uid);
        let (card, number) = place(&log.ending.name);
        let card = number.filter(|_| log.format.is_none()).map(|_| card.to_owned());
        let boots = boot.map(|boot| boot.boots).filter(|boots| *boots > 0);
        let power_on = known(board).zip(boots).map(|(board, boots)| (board, boots, first));
        Self { chain: (card, board), power_on, start_us, begun_us: 0 }
    }

    fn compare(&self, other: &Self) -> Ordering {
        let by_box = self.power_on.zip(other.power_on).filter(|(one, other)| one.0 == other.0);
        by_box
            .map_or(Ordering::Equal, |(one, other)| one.cmp(&other))
            .then(self.begun_us.cmp(&other.begun_us))
    }
}

/// Sorts logs, given in the order in which they were found: on a card by number.
pub fn sort<T>(logs: Vec<(LogTime, T)>) -> Vec<(LogTime, T)> {
    let count = logs.len();
    let mut chains: BTreeMap<_, Vec<(LogTime, T)>> = BTreeMap::new();
    for (time, log) in logs {
        chains.entry(time.chain.clone()).or_default().push((time, log));
    }
    for ((card, board), logs) in &mut chains {
        carry(logs);
        if card.is_none() {
            logs.sort_by(|(one, _), (other, _)| one.compare(other));
        }
        // Without a box, UTC made the order.
        if card.is_some() || known(*board).is_some() {
            forget_contradicted(logs);
            carry(logs);
        }
    }
    let mut chains: Vec<_> = chains.into_values().map(|logs| logs.into_iter().peekable()).collect();
    let mut sorted = Vec::with_capacity(count);
    loop {
        let heads =
            chains.iter_mut().enumerate().filter_map(|(at, chain)| Some((at, chain.peek()?.0.clone())));
        let first = heads.min_by(|(_, one), (_, other)| one.compare(other));
        let next = first.and_then(|(at, _)| chains.get_mut(at)?.next());
        match next {
            Some(log) => sorted.push(log),
            None => return sorted,
        }
    }
}

fn carry<T>(logs: &mut [(LogTime, T)]) {
    let mut begun_us = 0;
    for (time, _) in logs {
        begun_us = time.start_us.unwrap_or(begun_us);
        time.begun_us = begun_us;
    }
}

/// Keeps the starts of the longest row that never falls; of two such rows the later one.
fn forget_contradicted<T>(logs: &mut [(LogTime, T)]) {
    let starts: Vec<Option<u64>> = logs.iter().map(|(time, _)| time.start_us).collect();
    let start = |at: usize| starts.get(at).copied().flatten();
    // The last log of the best row of each length, and the log before each in its row.
    let (mut ends, mut before) = (Vec::<usize>::new(), vec![None; starts.len()]);
    for at in (0..starts.len()).filter(|at| start(*at).is_some()) {
        let length = ends.partition_point(|end| start(*end) <= start(at));
        if let Some(before) = before.get_mut(at) {
            *before = length.checked_sub(1).and_then(|last| ends.get(last).copied());
        }
        match ends.get_mut(length) {
            Some(end) => *end = at,
            None => ends.push(at),
        }
    }
    let mut row =
        std::iter::successors(ends.last().copied(), |at| before.get(*at).copied().flatten()).peekable();
    for (at, (time, _)) in logs.iter_mut().enumerate().rev() {
        if row.next_if_eq(&at).is_none() {
            time.start_us = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Board = [7; 12];

    fn log(card: Option<&str>, boots: u32, start_us: u64) -> LogTime {
        let power_on = (boots > 0).then_some((BOX, boots, None));
        let board = if boots > 0 { BOX } else { [0; 12] };
        let start_us = Some(start_us).filter(|start_us| *start_us > 0);
        LogTime { chain: (card.map(str::to_owned), board), power_on, start_us, begun_us: 0 }
    }

    fn sorted(logs: &[LogTime]) -> Vec<(usize, Option<u64>)> {
        let logs = logs.iter().cloned().zip(0..).collect();
        sort(logs).into_iter().map(|(time, at)| (at, time.start_us)).collect()
    }

    #[test]
    fn a_card_keeps_its_order_and_a_start_that_contradicts_it_is_unknown() {
        let card = [40, 50, 9_000, 60, 3, 70].map(|start_us| log(Some("a"), 0, start_us));
        let expected = [Some(40), Some(50), None, Some(60), None, Some(70)];
        assert_eq!(sorted(&card), (0..).zip(expected).collect::<Vec<_>>());
        // A new store counts from one again.
        let card = [(8, 50), (9, 60), (1, 70)].map(|(boots, start_us)| log(Some("a"), boots, start_us));
        assert_eq!(sorted(&card), [(0, Some(50)), (1, Some(60)), (2, Some(70))]);
        // Either clock may be wrong: the newer log counts.
        assert_eq!(sorted(&[90, 20].map(|start_us| log(Some("a"), 0, start_us))), [(0, None), (1, Some(20))]);
    }

    #[test]
    fn between_cards_the_box_counts_and_utc_decides_only_without_a_count() {
        let cards =
            [log(Some("a"), 3, 9_000), log(Some("a"), 4, 0), log(Some("b"), 1, 10), log(Some("b"), 2, 20)];
        assert_eq!(sorted(&cards).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [2, 3, 0, 1]);
        let cards = [log(Some("a"), 0, 30), log(Some("a"), 0, 0), log(Some("b"), 0, 20), log(None, 0, 25)];
        assert_eq!(sorted(&cards).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [2, 3, 0, 1]);
        // Downloads of two cards of one box, by name.
        let pulled = [log(None, 1, 10), log(None, 3, 5), log(None, 2, 20)];
        assert_eq!(sorted(&pulled), [(0, Some(10)), (2, Some(20)), (1, None)]);
    }

    #[test]
    fn recordings_are_sorted_by_utc_and_one_without_it_stays_after_the_one_before() {
        let recordings = [50, 0, 20, 0].map(|start_us| log(None, 0, start_us));
        assert_eq!(sorted(&recordings).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [2, 3, 0, 1]);
        assert!(sorted(&[]).is_empty());
    }
}
