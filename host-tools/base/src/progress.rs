//! How far a long reading is: a line on standard error, if that is a terminal.

use std::io::{IsTerminal as _, Write as _};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::plural::count;
use crate::printable::word;

/// Between two drawings.
const EVERY: Duration = Duration::from_millis(100);

/// A line that shows the progress of a task.
#[derive(Debug)]
pub struct Progress {
    name: String,
    /// 0: it is not shown.
    total: u64,
    done: AtomicU64,
    drawn: Mutex<Option<Instant>>,
}

/// The progress over a number of bytes. It is hidden if that number is unknown.
pub fn bytes(total: Option<u64>, name: &str) -> Progress {
    Progress::new(total.unwrap_or(0), word(name).into_owned())
}

/// The progress over several logs; it is not shown for a single one.
pub fn logs(logs: usize) -> Progress {
    Progress::new(if logs < 2 { 0 } else { logs as u64 }, count(logs as u64, "log"))
}

impl Progress {
    fn new(total: u64, name: String) -> Self {
        let total = if std::io::stderr().is_terminal() { total } else { 0 };
        Self { name, total, done: AtomicU64::new(0), drawn: Mutex::new(None) }
    }

    /// So much is done.
    pub fn set_position(&self, done: u64) {
        self.done.store(done, Ordering::Relaxed);
        let Ok(mut drawn) = self.drawn.lock() else { return };
        if self.total == 0 || drawn.is_some_and(|drawn| drawn.elapsed() < EVERY) {
            return;
        }
        *drawn = Some(Instant::now());
        // A terminal that is gone shows nothing.
        let _ = write!(std::io::stderr(), "\r{} {} % ", self.name, (done * 100 / self.total).min(100));
    }

    /// So much more is done.
    pub fn inc(&self, more: u64) {
        self.set_position(self.done.load(Ordering::Relaxed) + more);
    }

    /// Prints something else in its place.
    pub fn suspend<T>(&self, print: impl FnOnce() -> T) -> T {
        self.finish_and_clear();
        print()
    }

    /// Takes the line away.
    pub fn finish_and_clear(&self) {
        if let Ok(mut drawn) = self.drawn.lock()
            && drawn.take().is_some()
        {
            let _ = write!(std::io::stderr(), "\r{:1$}\r", "", self.name.chars().count() + 7);
        }
    }
}
