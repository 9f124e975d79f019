//! Several logs at once: each is read by a thread of its own and its workers. The results
//! are told in the logs' order, and only as many are in work that memory stays bounded.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use anyhow::Result;

use crate::logs::in_order::workers;

/// Logs in work at most: writing one leaves its workers idle; a few fill these pauses.
const AT_ONCE: usize = 4;

/// Calls `work` for each item, some side by side, and `tell` with the results in the items' order. The first error of
/// `tell` ends it: what is in work is finished, what is not is left.
pub fn side_by_side<I: Sync, R: Send>(
    items: &[I],
    work: impl Fn(&I) -> R + Sync,
    mut tell: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    let threads = items.len().min(AT_ONCE).min(workers());
    if threads <= 1 {
        return items.iter().try_for_each(|item| tell(work(item)));
    }
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, results) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, stop, work) = (sender.clone(), &next, &stop, &work);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { break };
                    if sender.send((index, work(item))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let mut told = 0;
        for (index, result) in results {
            waiting.insert(index, result);
            while let Some(result) = waiting.remove(&told) {
                told += 1;
                tell(result).inspect_err(|_| stop.store(true, Ordering::Relaxed))?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn results_are_told_in_order_whichever_is_done_first() {
        let items: Vec<u64> = (0..20).collect();
        let mut told = Vec::new();
        let work = |item: &u64| {
            thread::sleep(Duration::from_millis(item * 7 % 5));
            *item
        };
        side_by_side(&items, work, |item| {
            told.push(item);
            Ok(())
        })
        .expect("no error");
        assert_eq!(told, items);
    }

    #[test]
    fn an_error_ends_it() {
        let items = [1, 2, 3];
        let mut told = 0;
        let ended = side_by_side(
            &items,
            |item| *item,
            |_| {
                told += 1;
                anyhow::bail!("enough")
            },
        );
        assert!(ended.is_err());
        assert_eq!(told, 1);
    }
}
