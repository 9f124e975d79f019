//! Several logs in parallel, each with further workers. Results come in order; the number in work, and so
//! memory, is bounded.

use anyhow::Result;

use super::in_order::{in_order, workers};

/// Also on two processors: while one log waits for the disk, another one is in work.
const AT_ONCE: usize = 4;
/// Logs in work, or done and waiting for an earlier one.
const AHEAD_MAX: usize = 16;

/// Hands results of `work` to `tell` in the items' order. After an error of `tell` only begun items are
/// finished.
pub fn side_by_side<I: Sync, R: Send>(
    items: &[I],
    work: impl Fn(&I) -> R + Sync,
    mut tell: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    // One by itself needs no workers.
    if let [item] = items {
        return tell(work(item));
    }
    let at_once = if workers() > 1 { AT_ONCE } else { 1 };
    let mut next = items.iter();
    in_order(at_once, AHEAD_MAX, || Ok(next.next()), work, tell)
}

#[cfg(test)]
mod tests {
    use std::thread;
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
