//! The condition for feeding the watchdog: every task has reported in recently.
//!
//! Each task reports when it goes round its loop; the monitor's tick asks, and feeds the watchdog only on a yes. If
//! the monitor itself stalls, the watchdog is not fed and resets the machine.

use core::sync::atomic::{AtomicU32, Ordering};

use hums_core::clock::{Instant, Span};
use hums_recorder::spi::SERVICE_MAX;

/// Reporting tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Bytes to frames; it loops at least when the line is silent.
    Reception,
    /// Frames to records; it loops at every tick.
    Monitor,
    /// To the ground station; waits for its port.
    Downlink,
    /// To the card; its library waits for the card.
    Storage,
}

impl Task {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Reception, Self::Monitor, Self::Downlink, Self::Storage];

    /// As the log names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reception => "reception",
            Self::Monitor => "monitor",
            Self::Downlink => "downlink",
            Self::Storage => "storage",
        }
    }

    /// Its longest allowed silence. The short ones wait only for the ground station's port, 70 ms for its longest
    /// frame at 38,400 baud. Storage waits for its card, with a limit ([`SERVICE_MAX`]).
    pub(crate) const fn silence_max(self) -> Span {
        match self {
            Self::Reception | Self::Monitor | Self::Downlink => Span::from_secs(1),
            Self::Storage => Span::from_secs(10),
        }
    }
}

// A second for its own work.
const _: () = assert!(Task::Storage.silence_max().as_millis() > SERVICE_MAX.as_millis() + 1_000);

/// One static, shared by all tasks.
#[derive(Debug, Default)]
pub struct Supervisor {
    /// Milliseconds since power-on, modulo 2^32: differences stay right for 49 days of silence.
    reported_ms: [AtomicU32; Task::ALL.len()],
}

impl Supervisor {
    /// All count as having reported at power-on.
    pub const fn new() -> Self {
        Self { reported_ms: [const { AtomicU32::new(0) }; Task::ALL.len()] }
    }

    /// `task` has looped.
    pub fn report(&self, task: Task, now: Instant) {
        self.reported_ms[task as usize].store(now.as_millis() as u32, Ordering::Relaxed);
    }

    /// `None`: the watchdog may be fed.
    pub fn silent(&self, now: Instant) -> Option<Task> {
        let now_ms = now.as_millis() as u32;
        Task::ALL.into_iter().find(|task| {
            let silent_ms = now_ms.wrapping_sub(self.reported_ms[*task as usize].load(Ordering::Relaxed));
            u64::from(silent_ms) > task.silence_max().as_millis()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_report(supervisor: &Supervisor, now: Instant) {
        for task in Task::ALL {
            supervisor.report(task, now);
        }
    }

    #[test]
    fn tasks_that_report_keep_the_watchdog_fed() {
        let supervisor = Supervisor::new();
        for second in 0..100 {
            let now = Instant::from_millis(second * 1_000);
            assert_eq!(supervisor.silent(now), None, "at {second} s");
            all_report(&supervisor, now);
        }
    }

    #[test]
    fn each_task_is_missed_when_its_own_time_is_over() {
        for dead in Task::ALL {
            let supervisor = Supervisor::new();
            let limit = dead.silence_max();
            let end = Instant::ZERO + limit;
            for task in Task::ALL.into_iter().filter(|task| *task != dead) {
                supervisor.report(task, end);
            }
            assert_eq!(supervisor.silent(end), None, "{dead:?} is not late yet");
            let late = end + Span::from_millis(1);
            assert_eq!(supervisor.silent(late), Some(dead));
        }
    }

    #[test]
    fn the_millisecond_counter_may_wrap() {
        let supervisor = Supervisor::new();
        let before = Instant::from_millis(u64::from(u32::MAX) - 10);
        all_report(&supervisor, before);
        assert_eq!(supervisor.silent(before + Span::from_millis(500)), None);
        assert_eq!(supervisor.silent(before + Span::from_millis(1_500)), Some(Task::Reception));
    }
}
