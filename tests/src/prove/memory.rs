//! To the byte: resident memory also depends on the allocator.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

static HELD: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator with a count of bytes. Set as `#[global_allocator]` for `held_bytes`.
#[derive(Debug)]
pub struct Counting;

// SAFETY: every call is the system allocator's, with unchanged arguments; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`, and `at` came from the system's allocator.
        unsafe { System.dealloc(at, layout) }
    }
}

/// `None` without [`Counting`].
pub(super) fn held_bytes() -> Option<usize> {
    Some(HELD.load(Ordering::Relaxed)).filter(|&bytes| bytes > 0)
}
