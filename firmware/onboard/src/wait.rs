//! Waits for a device with a time limit.

use core::task::Poll;

use hums_core::clock::Instant;

/// Polls until the device is ready; `None` if it is not by `end`. The argument of `poll` is whether it may sleep
/// until the next interrupt.
///
/// The last poll begins at `end` or later: more urgent tasks may have had the processor meanwhile.
pub fn until<T>(end: Instant, now: impl Fn() -> Instant, mut poll: impl FnMut(bool) -> Poll<T>) -> Option<T> {
    loop {
        let is_last = now() >= end;
        match poll(!is_last) {
            Poll::Ready(done) => return Some(done),
            Poll::Pending if is_last => return None,
            Poll::Pending => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    fn polled(end_ms: u64, away_ms: u64) -> (Option<u64>, u64) {
        let (now_ms, polls) = (Cell::new(0), Cell::new(0));
        let done = until(
            Instant::from_millis(end_ms),
            || Instant::from_millis(now_ms.get()),
            |_| {
                polls.set(polls.get() + 1);
                let done = if now_ms.get() >= 5 { Poll::Ready(now_ms.get()) } else { Poll::Pending };
                now_ms.set(now_ms.get() + away_ms);
                done
            },
        );
        (done, polls.get())
    }

    #[test]
    fn a_device_that_is_done_while_others_had_the_processor_is_done() {
        for away_ms in [1, 5, 20, 1_000] {
            assert!(polled(20, away_ms).0.is_some(), "{away_ms} ms");
        }
    }

    #[test]
    fn a_device_that_is_not_done_in_time_is_given_up_once() {
        assert_eq!(polled(4, 1), (None, 5));
        assert_eq!(polled(0, 1), (None, 1));
    }
}
