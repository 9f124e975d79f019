//! Keeps the threads that work on one log on different cores.
//!
//! Linux wakes a thread on the core of the one that wakes it, unless an idle one shares a cache with that. Where none
//! does, as in virtual machines, two workers were seen to share one core for half of a short log's ten milliseconds,
//! and the other core had nothing to do. So the thread that reads the log stays where it is, and those that help it
//! keep off its core.

#[cfg(target_os = "linux")]
pub use linux::Apart;
#[cfg(not(target_os = "linux"))]
pub use other::Apart;

#[cfg(target_os = "linux")]
mod linux {
    use std::sync::atomic::{AtomicBool, Ordering};

    use rustix::thread::{CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity};

    /// One log's threads are apart at a time: two that stay could stay on the same core.
    static TAKEN: AtomicBool = AtomicBool::new(false);

    /// The cores of the calling thread and of those that help it, until dropped. What the kernel refuses is not done:
    /// it is only slower.
    pub struct Apart {
        before: CpuSet,
        here: CpuSet,
        others: CpuSet,
    }

    impl Apart {
        /// `None` where there is no other core, or another log's threads are kept apart.
        pub fn begin() -> Option<Self> {
            let before = sched_getaffinity(None).ok()?;
            let (mut here, mut others) = (CpuSet::new(), before);
            let core = sched_getcpu();
            if core >= CpuSet::MAX_CPU {
                return None;
            }
            here.set(core);
            others.unset(core);
            let first = others.count() > 0 && !TAKEN.swap(true, Ordering::Relaxed);
            first.then_some(Self { before, here, others })
        }

        /// The calling thread keeps to its core. Threads that it makes from then on would, too.
        pub fn stay(&self) {
            let _ = sched_setaffinity(None, &self.here);
        }

        /// A thread that helps keeps off that core.
        pub fn keep_off(&self) {
            let _ = sched_setaffinity(None, &self.others);
        }
    }

    impl Drop for Apart {
        fn drop(&mut self) {
            let _ = sched_setaffinity(None, &self.before);
            TAKEN.store(false, Ordering::Relaxed);
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn helpers_keep_off_the_core_and_all_is_as_before_when_it_ends() {
            let allowed = || sched_getaffinity(None).expect("the allowed cores");
            let before = allowed();
            if before.count() < 2 {
                assert!(Apart::begin().is_none());
                return;
            }
            // Another test may be reading a log.
            let apart = std::iter::repeat_with(Apart::begin).flatten().next().expect("its turn");
            assert!(Apart::begin().is_none(), "one at a time");
            std::thread::scope(|scope| {
                let helper = scope.spawn(|| {
                    apart.keep_off();
                    allowed()
                });
                apart.stay();
                let here = allowed();
                let helper = helper.join().expect("a helper");
                assert_eq!((here.count(), helper.count()), (1, before.count() - 1));
                assert!((0..CpuSet::MAX_CPU).all(|core| !(here.is_set(core) && helper.is_set(core))));
            });
            drop(apart);
            assert!(allowed() == before);
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod other {
    /// Other systems are left to themselves.
    pub enum Apart {}

    impl Apart {
        /// Nothing is kept apart here.
        pub fn begin() -> Option<Self> {
            None
        }

        /// There is none.
        pub fn stay(&self) {
            match *self {}
        }

        /// There is none.
        pub fn keep_off(&self) {
            match *self {}
        }
    }
}
