//! Memory that the runtime does not manage: variables in CCM, and the stack's high-water mark.

use core::ptr;

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
    // section that begin as zeros. By the contract above the section is not in use yet. Below the stack pointer nothing is live:
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

/// High-water mark and size, bytes.
pub(crate) fn stack_used() -> (usize, usize) {
    let (bottom, top) = stack_bounds();
    let free = 4 * stack_words().take_while(|word| *word == PAINT).count();
    (top - bottom - free, top - bottom)
}

pub(crate) fn stack_bounds() -> (usize, usize) {
    ((&raw const _stack_end).addr(), (&raw const _stack_start).addr())
}

pub(crate) fn stack_words() -> impl Iterator<Item = u32> {
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: both addresses bound the stack's memory, which is always readable.
    let all = unsafe { top.offset_from_unsigned(bottom) };
    // SAFETY: within that memory.
    (0..all).map(move |word| unsafe { bottom.add(word).read_volatile() })
}

pub(crate) fn code() -> core::ops::Range<usize> {
    (&raw const __stext).addr()..(&raw const __etext).addr()
}
