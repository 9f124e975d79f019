//! Parallel work with results in order, in bounded memory.
//!
//! The calling thread fetches items, hands on results, and works itself when free: one core needs no further
//! thread.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc;
use std::sync::{Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::thread;

use anyhow::Result;

/// Available processors, or `RAYON_NUM_THREADS`.
pub fn workers() -> usize {
    // Each log asks, and the system reads a dozen files.
    static WORKERS: LazyLock<usize> = LazyLock::new(|| {
        let told = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse().ok());
        let told = told.filter(|count| *count > 0);
        told.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from))
    });
    *WORKERS
}

/// Hands results of `work` to `take` in the items' order. At most `ahead_max` items are in work or wait. The
/// first error ends it.
pub fn in_order<T: Send, R: Send>(
    workers: usize,
    ahead_max: usize,
    mut next: impl FnMut() -> Result<Option<T>>,
    work: impl Fn(T) -> R + Sync,
    mut take: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    let queue = Queue { state: Mutex::default(), more: Condvar::new() };
    let (sender, results) = mpsc::channel();
    let (mut given, mut taken, mut ended) = (0, 0, false);
    let mut waiting = BTreeMap::new();
    thread::scope(|scope| {
        let mut sender = Some(sender);
        let _closing = Closing(&queue);
        loop {
            while !ended && given - taken < ahead_max {
                match next()? {
                    Some(item) => queue.push((given, item)),
                    None => ended = true,
                }
                given += usize::from(!ended);
            }
            // A single item is done sooner than a thread awakes.
            if let Some(sender) = sender.take() {
                for _ in 1..workers.min(given) {
                    let (queue, work, sender) = (&queue, &work, sender.clone());
                    let worker = move || {
                        while let Some((index, item)) = queue.wait() {
                            let promise = Promise { sender: &sender, index, result: None };
                            promise.keep(work(item));
                        }
                    };
                    // Without more threads, the existing ones work.
                    if thread::Builder::new().spawn_scoped(scope, worker).is_err() {
                        break;
                    }
                }
            }
            waiting.extend(results.try_iter());
            if let Some(result) = waiting.remove(&taken) {
                // The end of the scope reports a worker's panic.
                let Some(result) = result else { break };
                taken += 1;
                take(result)?;
            } else if let Some((index, item)) = queue.try_take() {
                waiting.insert(index, Some(work(item)));
            } else if taken == given {
                break;
            } else {
                waiting.extend(results.recv());
            }
        }
        Ok(())
    })
}

struct Queue<T> {
    state: Mutex<(VecDeque<T>, bool)>,
    more: Condvar,
}

impl<T> Queue<T> {
    fn lock(&self) -> MutexGuard<'_, (VecDeque<T>, bool)> {
        // Held without panics.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, item: T) {
        self.lock().0.push_back(item);
        self.more.notify_one();
    }

    fn try_take(&self) -> Option<T> {
        self.lock().0.pop_front()
    }

    /// `None` once closed.
    fn wait(&self) -> Option<T> {
        let waits = |state: &mut (VecDeque<T>, bool)| state.0.is_empty() && !state.1;
        let mut state = self.more.wait_while(self.lock(), waits).unwrap_or_else(PoisonError::into_inner);
        if state.1 { None } else { state.0.pop_front() }
    }
}

struct Closing<'a, T>(&'a Queue<T>);

impl<T> Drop for Closing<'_, T> {
    fn drop(&mut self) {
        self.0.lock().1 = true;
        self.0.more.notify_all();
    }
}

/// A result, sent also without a value after a panic, for the waiting receiver.
struct Promise<'a, R> {
    sender: &'a mpsc::Sender<(usize, Option<R>)>,
    index: usize,
    result: Option<R>,
}

impl<R> Promise<'_, R> {
    fn keep(mut self, result: R) {
        self.result = Some(result);
    }
}

impl<R> Drop for Promise<'_, R> {
    fn drop(&mut self) {
        // Without a receiver the work ended with an error.
        let _ = self.sender.send((self.index, self.result.take()));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use anyhow::ensure;

    use super::*;

    fn numbers(end: usize) -> impl FnMut() -> Result<Option<usize>> {
        let mut at = 0..end;
        move || Ok(at.next())
    }

    #[test]
    fn results_come_in_order_whoever_is_done_first() {
        for workers in [1, 2, 5] {
            let mut taken = Vec::new();
            let work = |item: usize| {
                thread::sleep(std::time::Duration::from_micros((item as u64 * 7 % 5) * 300));
                item
            };
            in_order(workers, 6, numbers(40), work, |item| {
                taken.push(item);
                Ok(())
            })
            .expect("no error");
            assert!(taken.iter().copied().eq(0..40), "{workers}");
        }
    }

    #[test]
    fn no_more_than_the_limit_is_held() {
        let (begun, held_max) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let mut taken = 0;
        let mut source = numbers(100);
        let next = || {
            begun.fetch_add(1, Ordering::Relaxed);
            source()
        };
        in_order(
            4,
            7,
            next,
            |item| item,
            |_| {
                held_max.fetch_max(begun.load(Ordering::Relaxed) - taken, Ordering::Relaxed);
                taken += 1;
                Ok(())
            },
        )
        .expect("no error");
        assert!(held_max.into_inner() <= 8);
    }

    #[test]
    fn an_error_ends_it_and_nobody_waits() {
        let refuse = |item| {
            ensure!(item != 3, "enough");
            Ok(())
        };
        assert!(in_order(3, 8, numbers(1_000), |item| item, refuse).is_err());
        let mut left = 5;
        let next = || {
            left -= 1;
            ensure!(left > 0, "the card is gone");
            Ok(Some(left))
        };
        assert!(in_order(3, 8, next, |item| item, |_| Ok(())).is_err());
    }

    #[test]
    #[should_panic(expected = "a scoped thread panicked")]
    fn a_worker_that_panics_is_told() {
        let work = |item: usize| {
            // A panic of the calling thread is reported anyway.
            assert!(thread::current().name().is_some() || item < 10, "for this test");
            thread::sleep(std::time::Duration::from_millis(1));
        };
        let _ = in_order(4, 8, numbers(100), work, |()| Ok(()));
    }
}
