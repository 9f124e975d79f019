//! Batches for the database, in order, in bounded memory.
//!
//! A live link's oldest batches give way, counted as lost; a recording waits for room. The card has the whole
//! flight.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant as Wall};

use super::batch::Batch;
use super::figures::Figures;
use crate::interrupt;

/// Two minutes of a fast link, an hour of a usual one.
const BYTES_MAX: usize = 64 * 1024 * 1024;
/// Look at Ctrl-C, while a recording waits.
const LOOK: Duration = Duration::from_millis(200);

/// A batch's result.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delivery {
    /// Points in the database.
    pub written: u64,
    /// Invalid points.
    pub refused: u64,
    /// Reason of the refusal.
    pub why: String,
}

/// Waiting batches.
#[derive(Debug)]
pub struct Queue {
    inner: Mutex<Inner>,
    changed: Condvar,
    bytes_max: usize,
    /// [`Queue::put`] waits for room.
    patient: bool,
}

#[derive(Debug, Default)]
struct Inner {
    waiting: VecDeque<Batch>,
    /// Bytes of `waiting`.
    bytes: usize,
    /// Taken by the writer, not delivered.
    in_hand: u64,
    figures: Figures,
    /// Waiting ends at this time.
    closed: Option<Wall>,
}

impl Queue {
    /// An empty queue; see [`Queue::put`] for `patient`.
    pub fn new(patient: bool) -> Self {
        Self { inner: Mutex::default(), changed: Condvar::new(), bytes_max: BYTES_MAX, patient }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, inner: MutexGuard<'a, Inner>, time: Duration) -> MutexGuard<'a, Inner> {
        self.changed.wait_timeout(inner, time).unwrap_or_else(PoisonError::into_inner).0
    }

    /// A patient queue waits for room until the user stops; others drop their oldest batches.
    pub fn put(&self, batch: Batch) {
        let mut inner = self.lock();
        let has_room = |inner: &Inner| inner.bytes + batch.text.len() <= self.bytes_max;
        while self.patient && !has_room(&inner) && inner.closed.is_none() && !interrupt::requested() {
            inner = self.wait(inner, LOOK);
        }
        while !has_room(&inner) {
            let Some(oldest) = inner.pop() else { break };
            inner.figures.lost += oldest.points;
        }
        inner.bytes += batch.text.len();
        inner.waiting.push_back(batch);
        drop(inner);
        self.changed.notify_all();
    }

    /// The oldest; `None` at the end. Counts as waiting until [`Self::done`].
    pub fn take(&self) -> Option<Batch> {
        let mut inner = self.lock();
        loop {
            if let Some(batch) = inner.pop() {
                inner.in_hand = batch.points;
                drop(inner);
                self.changed.notify_all();
                return Some(batch);
            }
            if inner.closed.is_some() {
                return None;
            }
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The taken batch was delivered.
    pub fn done(&self, delivered: Delivery) {
        let mut inner = self.lock();
        inner.in_hand = 0;
        inner.figures.written += delivered.written;
        inner.figures.rejected += delivered.refused;
        if delivered.refused > 0 {
            inner.figures.refusal.clone_from(&delivered.why);
        }
        // Shown until all is well.
        inner.figures.trouble = delivered.why;
    }

    /// The database takes none: waits; `false` when the end's time is over.
    pub fn trouble(&self, why: String, wait: Duration) -> bool {
        let mut inner = self.lock();
        inner.figures.trouble = why;
        let until = Wall::now() + wait;
        loop {
            let until = inner.closed.map_or(until, |closed| until.min(closed));
            let left = until.saturating_duration_since(Wall::now());
            if left.is_zero() {
                return inner.closed.is_none_or(|closed| Wall::now() < closed);
            }
            inner = self.wait(inner, left);
        }
    }

    /// Points unwritten by `until` are lost.
    pub fn close(&self, until: Wall) {
        self.lock().closed = Some(until);
        self.changed.notify_all();
    }

    /// Counts of the points.
    pub fn figures(&self) -> Figures {
        let inner = self.lock();
        let waiting = inner.waiting.iter().map(|batch| batch.points).sum::<u64>() + inner.in_hand;
        Figures { waiting, ..inner.figures.clone() }
    }
}

impl Inner {
    fn pop(&mut self) -> Option<Batch> {
        let batch = self.waiting.pop_front()?;
        self.bytes -= batch.text.len();
        Some(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(number: u64) -> Batch {
        Batch { text: format!("m value={number} {number}\n").repeat(100).into_bytes(), points: 100 }
    }

    fn all() -> Delivery {
        Delivery { written: 100, ..Delivery::default() }
    }

    fn queue(bytes_max: usize, patient: bool) -> Queue {
        Queue { bytes_max, ..Queue::new(patient) }
    }

    #[test]
    fn a_full_queue_loses_the_oldest_and_counts_each_point_once() {
        let queue = queue(10_000, false);
        queue.put(batch(0));
        queue.take().expect("it waits");
        (1..20).for_each(|number| queue.put(batch(number)));
        let figures = queue.figures();
        assert!(figures.lost > 500, "{figures:?}");
        assert_eq!(figures.lost + figures.waiting, 2_000, "what is in hand still waits: {figures:?}");
        queue.done(all());
        queue.close(Wall::now());
        let mut taken = Vec::new();
        while let Some(batch) = queue.take() {
            queue.done(all());
            taken.push(batch);
        }
        let figures = queue.figures();
        assert_eq!((figures.written + figures.lost, figures.waiting), (2_000, 0), "{figures:?}");
        let first = 20 - taken.len() as u64;
        assert_eq!(taken, (first..20).map(batch).collect::<Vec<_>>(), "the newest, in order");
    }

    #[test]
    fn a_recording_waits_for_room_while_the_database_is_away_and_loses_no_point() {
        let queue = queue(10_000, true);
        assert!(queue.trouble("away".to_owned(), Duration::ZERO));
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| (0..20).for_each(|number| queue.put(batch(number))));
            let mut taken = 0;
            while taken < 20 {
                queue.take().expect("it waits");
                queue.done(all());
                assert!(queue.trouble("away".to_owned(), Duration::from_millis(10)));
                taken += 1;
            }
            reader.join().expect("it ends");
        });
        let figures = queue.figures();
        assert_eq!((figures.written, figures.lost, figures.waiting), (2_000, 0, 0), "{figures:?}");
    }

    #[test]
    fn what_the_database_refuses_is_counted_with_its_reason() {
        let queue = Queue::new(false);
        queue.put(batch(1));
        queue.take().expect("it waits");
        assert_eq!(queue.figures().waiting, 100, "it is in the writer's hand");
        queue.done(Delivery { written: 97, refused: 3, why: "field type conflict".to_owned() });
        let figures = queue.figures();
        assert_eq!((figures.written, figures.rejected, figures.waiting), (97, 3, 0));
        assert_eq!(
            (figures.trouble.as_str(), figures.refusal.as_str()),
            ("field type conflict", "field type conflict")
        );
        queue.put(batch(2));
        queue.take().expect("it waits");
        queue.done(all());
        let figures = queue.figures();
        assert_eq!((figures.trouble.as_str(), figures.refusal.as_str()), ("", "field type conflict"));
    }

    #[test]
    fn at_the_end_nobody_waits_for_ever() {
        let queue = Queue::new(false);
        queue.close(Wall::now() + Duration::from_millis(50));
        let start = Wall::now();
        assert!(!queue.trouble("away".to_owned(), Duration::from_mins(1)));
        assert!(start.elapsed() < Duration::from_secs(5));
    }
}
