//! Batches on their way to the database, in order, in a file that outlives this program ([`Spool`]).
//!
//! What does not fit into the file makes the oldest ones go, which are counted: who looks at a database wants to see what
//! is now, and the flight's record on the card has the rest. Where the disk is full or fails, [`MEMORY_BYTES`] wait in
//! memory.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant as Wall};

use super::batch::Batch;
use super::figures::Figures;
use super::spool::Spool;
use crate::interrupt;

/// Half a minute of a fast link, a quarter of an hour of a usual one.
pub const MEMORY_BYTES: usize = 16 * 1024 * 1024;
/// How often it is looked whether there is room by now.
const LOOK: Duration = Duration::from_millis(200);

/// What became of a batch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delivered {
    /// The database has so many of its points.
    pub written: u64,
    /// It refuses so many for what they are.
    pub refused: u64,
    /// What it says of those.
    pub why: String,
}

/// What waits.
#[derive(Debug)]
pub struct Queue {
    inner: Mutex<Inner>,
    changed: Condvar,
    memory_bytes_max: usize,
    /// Who puts waits until there is room, also while the database is away: for a recording, which can.
    patient: bool,
}

#[derive(Debug)]
struct Inner {
    spool: Spool,
    /// What the file did not take; younger than all that is in it.
    memory: VecDeque<Batch>,
    memory_bytes: usize,
    /// What the writer has in its hands.
    in_hand: Option<InHand>,
    figures: Figures,
    /// No more comes; nobody waits longer than this.
    closed: Option<Wall>,
    told_full: bool,
}

#[derive(Clone, Copy, Debug)]
struct InHand {
    points: u64,
    /// Its number in the file, where it still counts as waiting.
    number: Option<u64>,
}

impl Queue {
    /// With what waits in the file already.
    pub fn new(spool: Spool, patient: bool) -> Self {
        let figures = Figures { lost: spool.damage().points, ..Figures::default() };
        let inner = Inner {
            spool,
            memory: VecDeque::new(),
            memory_bytes: 0,
            in_hand: None,
            figures,
            closed: None,
            told_full: false,
        };
        Self { inner: Mutex::new(inner), changed: Condvar::new(), memory_bytes_max: MEMORY_BYTES, patient }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, inner: MutexGuard<'a, Inner>, time: Duration) -> MutexGuard<'a, Inner> {
        self.changed.wait_timeout(inner, time).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Takes a batch. Of a recording it waits for room, until the user ends the program; otherwise it waits for nothing.
    pub fn put(&self, batch: Batch) {
        let mut inner = self.lock();
        let has_room = |inner: &Inner| inner.spool.has_room(&batch) || inner.spool.is_empty();
        while self.patient && !has_room(&inner) && inner.closed.is_none() && !interrupt::requested() {
            inner.tell_full();
            inner = self.wait(inner, LOOK);
        }
        // The end of a recording that nobody waits for any longer takes the place of nothing older: it can be written again.
        let fits = !self.patient || has_room(&inner);
        inner.put(batch, fits, self.memory_bytes_max);
        drop(inner);
        self.changed.notify_all();
    }

    /// The oldest batch, once there is one; `None` when no more comes. It is then in the writer's hand until
    /// [`Self::done`], and stays in the file until then.
    pub fn take(&self) -> Option<Batch> {
        let mut inner = self.lock();
        loop {
            if let Some(batch) = inner.oldest() {
                return Some(batch);
            }
            if inner.closed.is_some() {
                return None;
            }
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The batch in hand was delivered.
    pub fn done(&self, delivered: Delivered) {
        let mut inner = self.lock();
        inner.done(delivered);
        drop(inner);
        self.changed.notify_all();
    }

    /// The database does not take anything now. Waits so long; `false` when the time at the end is up.
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

    /// No more comes; what is not written by `until` stays in the file.
    pub fn close(&self, until: Wall) {
        self.lock().closed = Some(until);
        self.changed.notify_all();
    }

    /// What became of the points.
    pub fn figures(&self) -> Figures {
        let inner = self.lock();
        let in_memory: u64 = inner.memory.iter().map(|batch| batch.points).sum();
        // What is in hand and is not in the file: out of memory, or made room there.
        let in_hand = inner.in_hand.filter(|hand| hand.number.is_none()).map_or(0, |hand| hand.points);
        Figures {
            waiting: inner.spool.points() + in_memory + in_hand,
            stored: inner.spool.points(),
            spilled_bytes: inner.spool.bytes(),
            ..inner.figures.clone()
        }
    }
}

impl Inner {
    /// Says once that the file is full and the database takes nothing.
    fn tell_full(&mut self) {
        if !self.told_full && !self.figures.trouble.is_empty() {
            self.told_full = true;
            note!(
                "{}: is full, and the database takes nothing ({}): reading the recording waits for it, until Ctrl-C",
                self.spool.path().display(),
                self.figures.trouble
            );
        }
    }

    /// Puts a batch into the file, where it `fits`, else into memory.
    fn put(&mut self, batch: Batch, fits: bool, memory_bytes_max: usize) {
        // In order: what is in memory is younger than what is in the file.
        if fits && self.memory.is_empty() {
            match self.spool.put(&batch) {
                Ok(lost) => return self.lose_oldest(lost),
                Err(error) => {
                    self.figures.disk = format!("points did not fit on the disk: {error}");
                    self.figures.trouble.clone_from(&self.figures.disk);
                }
            }
        }
        if self.memory_bytes + batch.text.len() <= memory_bytes_max {
            self.memory_bytes += batch.text.len();
            self.memory.push_back(batch);
        } else {
            self.figures.lost += batch.points;
        }
    }

    /// The file has made room. What the writer has in its hands at that moment is not lost yet.
    fn lose_oldest(&mut self, points: u64) {
        let oldest = self.spool.number();
        let mut lost = points;
        if let Some(hand) =
            self.in_hand.as_mut().filter(|hand| hand.number.is_some_and(|number| number < oldest))
        {
            hand.number = None;
            lost = lost.saturating_sub(hand.points);
        }
        self.figures.lost += lost;
    }

    fn oldest(&mut self) -> Option<Batch> {
        match self.spool.oldest() {
            Ok(Some(batch)) => {
                self.in_hand = Some(InHand { points: batch.points, number: Some(self.spool.number()) });
                return Some(batch);
            }
            Ok(None) => {}
            Err(error) => {
                self.figures.lost += self.spool.forget();
                self.figures.trouble = format!("the file of waiting points cannot be read: {error}");
            }
        }
        let batch = self.memory.pop_front()?;
        self.memory_bytes -= batch.text.len();
        self.in_hand = Some(InHand { points: batch.points, number: None });
        Some(batch)
    }

    fn done(&mut self, delivered: Delivered) {
        if let Some(InHand { number: Some(number), .. }) = self.in_hand.take()
            && number == self.spool.number()
            && let Err(error) = self.spool.drop_oldest()
        {
            self.figures.lost += self.spool.forget();
            self.figures.trouble = format!("the file of waiting points cannot be used: {error}");
        }
        self.figures.written += delivered.written;
        self.figures.rejected += delivered.refused;
        if delivered.refused > 0 {
            self.figures.refusal.clone_from(&delivered.why);
        }
        // On the page a word on what was refused stays until all is well.
        self.figures.trouble = delivered.why;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::influx::target::Database;

    fn batch(number: u64) -> Batch {
        Batch { text: format!("m value={number} {number}\n").repeat(100).into_bytes(), points: 100 }
    }

    fn all() -> Delivered {
        Delivered { written: 100, ..Delivered::default() }
    }

    fn queue(dir: &tempfile::TempDir, limit: u64) -> Queue {
        let database = Database { number: 1, name: "http://h".to_owned() };
        let spool = Spool::open(&dir.path().join("spool"), limit, &database).expect("a file").expect("free");
        Queue::new(spool, false)
    }

    #[test]
    fn order_and_count_hold_and_what_a_kill_leaves_is_written_by_the_next_program() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut taken = Vec::new();
        let first = queue(&dir, 1 << 20);
        for number in 0..50 {
            first.put(batch(number));
            // The database comes back for a moment now and then.
            if number % 10 == 9 {
                for _ in 0..4 {
                    taken.push(first.take().expect("it waits"));
                    first.done(all());
                }
            }
        }
        // In the writer's hand when it is killed.
        first.take().expect("it waits");
        let figures = first.figures();
        assert_eq!((figures.written, figures.waiting, figures.lost), (2_000, 3_000, 0));
        drop(first);

        let next = queue(&dir, 1 << 20);
        assert_eq!((next.figures().waiting, next.figures().stored), (3_000, 3_000));
        next.close(Wall::now());
        while let Some(batch) = next.take() {
            next.done(all());
            taken.push(batch);
        }
        assert_eq!(taken, (0..50).map(batch).collect::<Vec<_>>());
        assert_eq!((next.figures().waiting, next.figures().spilled_bytes), (0, 0));
    }

    #[test]
    fn a_full_file_loses_the_oldest_and_counts_each_point_once() {
        let dir = tempfile::tempdir().expect("a folder");
        let queue = queue(&dir, 10_000);
        queue.put(batch(0));
        let in_hand = queue.take().expect("it waits");
        for number in 1..20 {
            queue.put(batch(number));
        }
        let figures = queue.figures();
        assert!(figures.lost > 500 && figures.spilled_bytes <= 10_000, "{figures:?}");
        assert_eq!(figures.lost + figures.waiting, 2_000, "what is in hand still waits: {figures:?}");
        queue.done(Delivered { written: in_hand.points, ..Delivered::default() });
        queue.close(Wall::now());
        let mut last = None;
        while let Some(batch) = queue.take() {
            queue.done(all());
            last = Some(batch);
        }
        let figures = queue.figures();
        assert_eq!((figures.written + figures.lost, figures.waiting), (2_000, 0), "{figures:?}");
        assert_eq!(last, Some(batch(19)), "the newest is there");
    }

    #[test]
    fn a_recording_waits_for_room_while_the_database_is_away_and_loses_no_point() {
        let dir = tempfile::tempdir().expect("a folder");
        let queue = Queue { patient: true, ..queue(&dir, 10_000) };
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
    fn the_end_of_a_recording_takes_the_place_of_nothing_that_waits() {
        let dir = tempfile::tempdir().expect("a folder");
        let queue = Queue { patient: true, ..queue(&dir, 10_000) };
        queue.put(batch(0));
        let stored = queue.figures().stored;
        queue.close(Wall::now());
        (1..20).for_each(|number| queue.put(batch(number)));
        let figures = queue.figures();
        assert!(figures.stored > stored && figures.stored < figures.waiting, "{figures:?}");
        assert_eq!((figures.waiting, figures.lost), (2_000, 0), "{figures:?}");
        assert_eq!(queue.take(), Some(batch(0)), "the oldest is there");
    }

    #[test]
    fn a_disk_that_takes_nothing_is_told_until_the_end_and_memory_takes_what_it_can() {
        let dir = tempfile::tempdir().expect("a folder");
        // No batch fits into a file of this size, as none fits on a full disk.
        let mut queue = queue(&dir, 100);
        queue.memory_bytes_max = 3 * batch(0).text.len();
        (0..4).for_each(|number| queue.put(batch(number)));
        let figures = queue.figures();
        assert_eq!((figures.waiting, figures.stored, figures.lost), (300, 0, 100));
        assert!(figures.disk.contains("did not fit on the disk"), "{figures:?}");
        queue.take().expect("it waits");
        queue.done(all());
        let figures = queue.figures();
        assert!(figures.trouble.is_empty() && !figures.disk.is_empty(), "all is well now: {figures:?}");
    }

    #[test]
    fn what_the_database_refuses_is_counted_with_its_reason() {
        let dir = tempfile::tempdir().expect("a folder");
        let queue = queue(&dir, 10_000);
        queue.put(batch(1));
        queue.take().expect("it waits");
        assert_eq!(queue.figures().waiting, 100, "it is in the writer's hand");
        queue.done(Delivered { written: 97, refused: 3, why: "field type conflict".to_owned() });
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
        let dir = tempfile::tempdir().expect("a folder");
        let queue = queue(&dir, 10_000);
        queue.close(Wall::now() + Duration::from_millis(50));
        let start = Wall::now();
        assert!(!queue.trouble("away".to_owned(), Duration::from_mins(1)));
        assert!(start.elapsed() < Duration::from_secs(5));
    }
}
