//! The memories that the runtime does not look after: CCM's variables, and how deep the stack went.

use core::ptr;

/// What unused stack is painted with.
const PAINT: u32 = 0x5AFE_57AC;

unsafe extern "C" {
    static mut __sccm: u32;
    static mut __eccm: u32;
    pub(crate) static mut _stack_end: u32;
    pub(crate) static mut _stack_start: u32;
    static __stext: u32;
    static __etext: u32;
}

/// Sets CCM's variables to zero and paints the stack below the caller. To be called once, first of all,
/// before any variable in CCM is touched.
///
/// # Safety
/// No reference to a variable in the section `.ccm` may exist yet, and interrupts must not run yet.
pub(crate) unsafe fn init() {
    let here = cortex_m::register::msp::read() as usize;
    // SAFETY: the linker script gives these addresses, which are aligned to words, and lets only variables into the
    // section that begin as zeros. By the contract above nobody uses the section yet. Below the stack pointer nothing is live:
    // 256 bytes are left to this function.
    unsafe {
        let words = (&raw const __eccm).offset_from_unsigned(&raw const __sccm);
        ptr::write_bytes(&raw mut __sccm, 0, words);
        let bottom = &raw mut _stack_end;
        for word in 0..here.saturating_sub(bottom as usize + 256) / 4 {
            bottom.add(word).write_volatile(PAINT);
        }
    }
}

/// Bytes of stack that were ever used, and bytes there are.
pub(crate) fn stack_used() -> (usize, usize) {
    let (bottom, top) = stack_bounds();
    let free = 4 * stack_words().take_while(|word| *word == PAINT).count();
    (top - bottom - free, top - bottom)
}

/// The stack's first address and the one after its last.
pub(crate) fn stack_bounds() -> (usize, usize) {
    ((&raw const _stack_end).addr(), (&raw const _stack_start).addr())
}

/// The stack's words from its bottom up.
pub(crate) fn stack_words() -> impl Iterator<Item = u32> {
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: both addresses bound the stack's memory, which is always readable.
    let all = unsafe { top.offset_from_unsigned(bottom) };
    // SAFETY: within that memory.
    (0..all).map(move |word| unsafe { bottom.add(word).read_volatile() })
}

/// Where the program's functions are.
pub(crate) fn code() -> core::ops::Range<usize> {
    (&raw const __stext).addr()..(&raw const __etext).addr()
}

/// How deep each urgency alone took the stack. Only where somebody asks: it is the emulated board that measures, as its
/// tasks do not interrupt each other.
#[cfg(feature = "board-emulated")]
pub(crate) mod depth {
    use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

    use super::{_stack_end, PAINT, stack_bounds, stack_words};

    /// What is measured apart, from the most urgent down; `start` is what runs before the tasks do.
    pub(crate) const NAMES: [&str; 6] = ["watch", "reception", "monitor", "downlink", "storage", "start"];
    /// Of the caller itself.
    const MARGIN_BYTES: usize = 64;
    /// What the processor stacks with floating point (ARMv7-M, B1.5.7), and the handler before it is measured.
    const ENTRY_BYTES: u32 = 104 + 24;

    /// How low the one went that was interrupted last, before it was.
    static INTERRUPTED: AtomicU32 = AtomicU32::new(u32::MAX);
    static ON: AtomicBool = AtomicBool::new(false);
    static DEEPEST: [AtomicU32; NAMES.len()] = [const { AtomicU32::new(0) }; NAMES.len()];

    /// Measures from now on.
    pub(crate) fn measure() {
        ON.store(true, Ordering::Relaxed);
    }

    /// What has run until now went down so far, and the tasks begin with a clean stack.
    pub(crate) fn end_start() {
        if ON.load(Ordering::Relaxed) {
            note(NAMES.len() - 1, stack_bounds().1, 0);
            repaint();
        }
    }

    /// Runs the handler of the urgency at `index`.
    pub(crate) fn of(index: usize, run: impl FnOnce()) {
        if !ON.load(Ordering::Relaxed) {
            return run();
        }
        // What it interrupts has its own depth, and is told when this is over.
        let outer = lowest();
        repaint();
        let begin = cortex_m::register::msp::read() as usize;
        run();
        note(index, begin, ENTRY_BYTES);
        repaint();
        INTERRUPTED.store(outer as u32, Ordering::Relaxed);
    }

    /// The bytes of each of [`NAMES`].
    pub(crate) fn all() -> impl Iterator<Item = (&'static str, u32)> {
        NAMES.into_iter().zip(DEEPEST.iter().map(|deepest| deepest.load(Ordering::Relaxed)))
    }

    fn note(index: usize, begin: usize, entry: u32) {
        if let Some(deepest) = DEEPEST.get(index) {
            deepest.fetch_max(begin.saturating_sub(lowest()) as u32 + entry, Ordering::Relaxed);
        }
    }

    /// The lowest address that was used since the last repainting, with what a more urgent one painted over.
    fn lowest() -> usize {
        let lowest = stack_bounds().0 + 4 * stack_words().take_while(|word| *word == PAINT).count();
        lowest.min(INTERRUPTED.swap(u32::MAX, Ordering::Relaxed) as usize)
    }

    fn repaint() {
        let bottom = &raw mut _stack_end;
        let here = cortex_m::register::msp::read() as usize;
        let used = stack_words().take_while(|word| *word == PAINT).count();
        for word in used..here.saturating_sub(stack_bounds().0 + MARGIN_BYTES) / 4 {
            // SAFETY: below the stack pointer nothing is live, apart from what an interrupt will put there anew.
            unsafe { bottom.add(word).write_volatile(PAINT) };
        }
    }
}

/// On a real board nothing is measured apart.
#[cfg(not(feature = "board-emulated"))]
pub(crate) mod depth {
    pub(crate) const fn end_start() {}

    pub(crate) fn of(_index: usize, run: impl FnOnce()) {
        run();
    }
}
