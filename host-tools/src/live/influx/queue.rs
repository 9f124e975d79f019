//! Batches on their way to the database, in order: some in memory, the rest in a file without a name.
//!
//! Memory takes the first [`MEMORY_BYTES`]; while there is anything in the file, what comes later goes there too, so that
//! the order holds. The file grows as long as the disk has room. What not even the file takes is lost, and counted.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant as Wall};

use super::figures::Figures;

/// Half a minute of a fast link, a quarter of an hour of a usual one.
pub const MEMORY_BYTES: usize = 16 * 1024 * 1024;
/// Points and length before each batch in the file.
const HEADER_BYTES: usize = 8 + 4;
/// A batch that says it is longer was never written by us.
const BATCH_BYTES_MAX: usize = 64 * 1024 * 1024;

/// Lines, and how many they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// Line protocol.
    pub text: Vec<u8>,
    /// Its lines.
    pub points: u64,
}

/// What waits.
#[derive(Debug)]
pub struct Queue {
    inner: Mutex<Inner>,
    changed: Condvar,
    memory_bytes_max: usize,
}

#[derive(Debug)]
struct Inner {
    memory: VecDeque<Batch>,
    memory_bytes: usize,
    file: File,
    /// The next batch of the file, and its end.
    read_at: u64,
    write_at: u64,
    file_points: u64,
    /// What the writer has in its hands.
    in_hand: u64,
    figures: Figures,
    /// No more comes; nobody waits longer than this.
    closed: Option<Wall>,
}

impl Queue {
    /// Nothing waits.
    pub fn new() -> io::Result<Self> {
        Self::with_memory(MEMORY_BYTES)
    }

    /// Memory for so many bytes.
    pub fn with_memory(memory_bytes_max: usize) -> io::Result<Self> {
        let inner = Inner {
            memory: VecDeque::new(),
            memory_bytes: 0,
            file: tempfile::tempfile()?,
            read_at: 0,
            write_at: 0,
            file_points: 0,
            in_hand: 0,
            figures: Figures::default(),
            closed: None,
        };
        Ok(Self { inner: Mutex::new(inner), changed: Condvar::new(), memory_bytes_max })
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a batch; never waits for the database.
    pub fn put(&self, batch: Batch) {
        let mut inner = self.lock();
        let fits = inner.memory_bytes + batch.text.len() <= self.memory_bytes_max;
        if inner.read_at == inner.write_at && fits {
            inner.memory_bytes += batch.text.len();
            inner.memory.push_back(batch);
        } else if let Err(error) = inner.spill(&batch) {
            inner.figures.lost += batch.points;
            inner.figures.trouble = format!("points do not fit on the disk: {error}");
        }
        drop(inner);
        self.changed.notify_all();
    }

    /// The oldest batch, once there is one; `None` when no more comes. It is then in the writer's hand until
    /// [`Self::done`].
    pub fn take(&self) -> Option<Batch> {
        let mut inner = self.lock();
        loop {
            if let Some(batch) = inner.oldest() {
                inner.in_hand = batch.points;
                return Some(batch);
            }
            if inner.closed.is_some() {
                return None;
            }
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The database has the batch, or (`Err`) refuses it for what it is.
    pub fn done(&self, batch: &Batch, refused: Option<String>) {
        let mut inner = self.lock();
        inner.in_hand = 0;
        match refused {
            None => {
                inner.figures.written += batch.points;
                inner.figures.trouble.clear();
            }
            Some(why) => {
                inner.figures.rejected += batch.points;
                inner.figures.trouble = why;
            }
        }
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
            inner = self.changed.wait_timeout(inner, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// No more comes; what is not written by `until` stays.
    pub fn close(&self, until: Wall) {
        self.lock().closed = Some(until);
        self.changed.notify_all();
    }

    /// What became of the points.
    pub fn figures(&self) -> Figures {
        let inner = self.lock();
        let in_memory: u64 = inner.memory.iter().map(|batch| batch.points).sum();
        Figures {
            waiting: in_memory + inner.file_points + inner.in_hand,
            spilled_bytes: inner.write_at - inner.read_at,
            ..inner.figures.clone()
        }
    }
}

impl Inner {
    fn spill(&mut self, batch: &Batch) -> io::Result<()> {
        let length = u32::try_from(batch.text.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
        let mut bytes = Vec::with_capacity(HEADER_BYTES + batch.text.len());
        bytes.extend(batch.points.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend(&batch.text);
        self.file.seek(SeekFrom::Start(self.write_at))?;
        // Half a batch at the end of a full disk is written over by the next one.
        self.file.write_all(&bytes)?;
        self.write_at += bytes.len() as u64;
        self.file_points += batch.points;
        Ok(())
    }

    fn oldest(&mut self) -> Option<Batch> {
        if let Some(batch) = self.memory.pop_front() {
            self.memory_bytes -= batch.text.len();
            return Some(batch);
        }
        if self.read_at == self.write_at {
            return None;
        }
        match self.unspill() {
            Ok(batch) => {
                self.file_points -= batch.points.min(self.file_points);
                if self.read_at == self.write_at {
                    (self.read_at, self.write_at) = (0, 0);
                    // The room is given back; where that fails, it is used again.
                    let _ = self.file.set_len(0);
                }
                Some(batch)
            }
            Err(error) => {
                self.figures.lost += self.file_points;
                self.figures.trouble = format!("the file of waiting points cannot be read: {error}");
                (self.read_at, self.write_at, self.file_points) = (0, 0, 0);
                None
            }
        }
    }

    fn unspill(&mut self) -> io::Result<Batch> {
        self.file.seek(SeekFrom::Start(self.read_at))?;
        let (mut points, mut length) = ([0; 8], [0; 4]);
        self.file.read_exact(&mut points)?;
        self.file.read_exact(&mut length)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > BATCH_BYTES_MAX {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let mut text = vec![0; length];
        self.file.read_exact(&mut text)?;
        self.read_at += (HEADER_BYTES + length) as u64;
        Ok(Batch { text, points: u64::from_le_bytes(points) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(number: u64) -> Batch {
        Batch { text: format!("m value={number} {number}\n").repeat(100).into_bytes(), points: 100 }
    }

    #[test]
    fn order_and_count_hold_through_memory_and_file() {
        let queue = Queue::with_memory(5_000).expect("a file");
        let mut taken = Vec::new();
        for number in 0..50 {
            queue.put(batch(number));
            // The database comes back for a moment now and then.
            if number % 10 == 9 {
                for _ in 0..4 {
                    let batch = queue.take().expect("it waits");
                    queue.done(&batch, None);
                    taken.push(batch);
                }
            }
        }
        let figures = queue.figures();
        assert_eq!((figures.written, figures.waiting, figures.lost), (2_000, 3_000, 0));
        assert!(figures.spilled_bytes > 10_000);
        queue.close(Wall::now());
        while let Some(batch) = queue.take() {
            queue.done(&batch, None);
            taken.push(batch);
        }
        assert_eq!(taken, (0..50).map(batch).collect::<Vec<_>>());
        assert_eq!((queue.figures().waiting, queue.figures().spilled_bytes), (0, 0));
    }

    #[test]
    fn what_the_database_refuses_is_counted_with_its_reason() {
        let queue = Queue::new().expect("a file");
        queue.put(batch(1));
        let taken = queue.take().expect("it waits");
        assert_eq!(queue.figures().waiting, 100, "it is in the writer's hand");
        queue.done(&taken, Some("field type conflict".to_owned()));
        let figures = queue.figures();
        assert_eq!((figures.written, figures.rejected, figures.waiting), (0, 100, 0));
        assert_eq!(figures.trouble, "field type conflict");
    }

    #[test]
    fn at_the_end_nobody_waits_for_ever() {
        let queue = Queue::new().expect("a file");
        queue.close(Wall::now() + Duration::from_millis(50));
        let start = Wall::now();
        assert!(!queue.trouble("away".to_owned(), Duration::from_mins(1)));
        assert!(start.elapsed() < Duration::from_secs(5));
    }
}
