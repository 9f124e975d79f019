//! The order of logs in time.
//!
//! A clock may be wrong, so UTC decides last:
//! * logs of one card: by their numbers;
//! * logs of one box: by its count of power-ons, and within a power-on by the time since then, unless the count is no order
//!   (`uncounted`);
//! * other logs of one box, logs of different boxes, and recordings of other programs: by UTC.

use std::collections::{BTreeMap, BTreeSet};

use hums_core::clock::Instant;

use crate::logs::board::{Board, known};
use crate::logs::sessions::place;
use crate::summary::Overview;

/// Power-ons of a box's life, and the first moment since power-on.
type Count = (u32, Option<Instant>);

/// A log's place in time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogTime {
    card: Option<String>,
    board: Option<Board>,
    count: Option<Count>,
    power_on: Option<u32>,
    /// UTC of its start in microseconds since 1970; `None` if unknown, or if the other logs of its card contradict it.
    pub start_us: Option<u64>,
    /// The same, or that of the log before it.
    begun_us: u64,
}

impl LogTime {
    /// The place of a log, by its records.
    pub fn of(log: &Overview) -> Self {
        let summary = &log.ending.summary;
        let boot = log.contents.boot.as_ref().filter(|_| log.format.is_none());
        let (card, number) = place(&log.ending.name);
        Self {
            card: number.filter(|_| log.format.is_none()).map(|_| card.to_owned()),
            board: boot.and_then(|boot| known(boot.uid)),
            count: boot.map(|boot| (boot.boots, summary.first)).filter(|(boots, _)| *boots > 0),
            power_on: summary.session.filter(|_| summary.first_number == Some(0)),
            start_us: summary.first.and_then(|first| log.utc_us(first)),
            begun_us: 0,
        }
    }
}

/// Sorts logs, given in the order in which they were found: on a card by number.
pub fn sort<T>(mut logs: Vec<(LogTime, T)>) -> Vec<(LogTime, T)> {
    let uncounted = uncounted(&logs);
    let mut sorted = Vec::with_capacity(logs.len());
    // The counts of each box that are not yet sorted, the lowest one last.
    let mut left: BTreeMap<Board, Vec<Count>> = BTreeMap::new();
    for (time, _) in &mut logs {
        time.count = time.count.filter(|_| time.board.is_some_and(|board| !uncounted.contains(&board)));
        if let Some((board, count)) = time.board.zip(time.count) {
            left.entry(board).or_default().push(count);
        }
    }
    for counts in left.values_mut() {
        counts.sort_unstable_by(|one, other| other.cmp(one));
    }
    let mut chains: BTreeMap<_, Vec<(LogTime, T)>> = BTreeMap::new();
    for (time, log) in logs {
        let board = time.board.filter(|_| time.card.is_none());
        chains.entry((time.card.clone(), board)).or_default().push((time, log));
    }
    for ((card, _), logs) in &mut chains {
        carry(logs);
        if card.is_none() {
            logs.sort_by_key(|(time, _)| (time.count, time.begun_us));
        }
        forget_contradicted(logs);
        carry(logs);
    }
    let mut chains: Vec<_> = chains.into_values().map(|logs| logs.into_iter().peekable()).collect();
    loop {
        // A log waits for those of its box with a lower count, unless the orders of cards forbid it.
        let heads = chains.iter_mut().enumerate().filter_map(|(at, chain)| {
            let (time, _) = chain.peek()?;
            let counts = time.board.filter(|_| time.count.is_some()).and_then(|board| left.get(&board));
            let waits = counts.is_some_and(|counts| counts.last() != time.count.as_ref());
            Some((waits, time.begun_us, at))
        });
        let next = heads.min().and_then(|(.., at)| chains.get_mut(at)?.next());
        let Some((time, log)) = next else { return sorted };
        let counts = time.board.and_then(|board| left.get_mut(&board));
        if let (Some(counts), Some(count)) = (counts, time.count)
            && let Some(at) = counts.iter().rposition(|left| *left == count)
        {
            counts.remove(at);
        }
        sorted.push((time, log));
    }
}

/// Boxes whose count of power-ons is no order: a log lacks it, two sessions begin with the same power-on, or it falls on a
/// card. An erase of the chip lets it begin again.
fn uncounted<T>(logs: &[(LogTime, T)]) -> BTreeSet<Board> {
    let (mut sessions, mut last, mut uncounted) = (BTreeMap::new(), BTreeMap::new(), BTreeSet::new());
    for (time, _) in logs {
        let Some(board) = time.board else { continue };
        let boots = time.count.map_or(0, |(boots, _)| boots);
        let is_other = time
            .power_on
            .is_some_and(|session| *sessions.entry((board, boots)).or_insert(session) != session);
        let falls = time.card.as_ref().is_some_and(|card| last.insert((board, card), boots) > Some(boots));
        if boots == 0 || is_other || falls {
            uncounted.insert(board);
        }
    }
    uncounted
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
        let is_counted = boots > 0;
        LogTime {
            card: card.map(str::to_owned),
            board: is_counted.then_some(BOX),
            count: is_counted.then_some((boots, None)),
            start_us: Some(start_us).filter(|start_us| *start_us > 0),
            ..LogTime::default()
        }
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
    fn a_card_keeps_its_order_also_where_the_box_is_another_or_unknown() {
        let card = [(5, 50), (0, 9_000), (6, 60)].map(|(boots, start_us)| log(Some("a"), boots, start_us));
        assert_eq!(sorted(&card), [(0, Some(50)), (1, None), (2, Some(60))]);
        let mut card = [(5, 50), (1, 40), (6, 60)].map(|(boots, start_us)| log(Some("a"), boots, start_us));
        card[1].board = Some([8; 12]);
        assert_eq!(sorted(&card), [(0, None), (1, Some(40)), (2, Some(60))]);
    }

    #[test]
    fn a_count_that_began_again_after_an_erase_is_no_order() {
        let log =
            |session, boots, start_us| LogTime { power_on: Some(session), ..log(None, boots, start_us) };
        let erased = [log(1, 1, 10), log(2, 2, 20), log(3, 1, 30), log(4, 2, 40)];
        assert_eq!(sorted(&erased), [(0, Some(10)), (1, Some(20)), (2, Some(30)), (3, Some(40))]);
        // The same log twice, and a later log of the power-on.
        let whole = [log(1, 1, 10), log(3, 3, 5), log(1, 1, 10), LogTime { power_on: None, ..log(5, 2, 20) }];
        assert_eq!(sorted(&whole).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [0, 2, 3, 1]);
        let unknown = [log(1, 3, 10), LogTime { count: None, ..log(2, 1, 20) }, log(3, 2, 30)];
        assert_eq!(sorted(&unknown), [(0, Some(10)), (1, Some(20)), (2, Some(30))]);
    }

    /// By pairs, UTC and count would go in a circle.
    #[test]
    fn the_order_does_not_depend_on_the_names_of_cards() {
        for names in [["a", "b", "c"], ["b", "c", "a"], ["c", "a", "b"], ["c", "b", "a"]] {
            let [first, second, third] = names.map(Some);
            let mut other = log(third, 1, 200);
            other.board = Some([8; 12]);
            let logs = [log(first, 3, 100), log(second, 2, 300), other];
            assert_eq!(sorted(&logs).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [2, 1, 0], "{names:?}");
        }
        // Counts and cards in a circle: each card keeps its order.
        let of = |board, card, boots| LogTime { board: Some([board; 12]), ..log(Some(card), boots, 0) };
        let circle = [of(1, "a", 2), of(2, "a", 1), of(2, "b", 2), of(1, "b", 1)];
        assert_eq!(sorted(&circle).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [0, 1, 2, 3]);
    }

    #[test]
    fn recordings_are_sorted_by_utc_and_one_without_it_stays_after_the_one_before() {
        let recordings = [50, 0, 20, 0].map(|start_us| log(None, 0, start_us));
        assert_eq!(sorted(&recordings).iter().map(|(at, _)| *at).collect::<Vec<_>>(), [2, 3, 0, 1]);
        assert!(sorted(&[]).is_empty());
    }
}
