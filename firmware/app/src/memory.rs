//! The memories that the runtime does not look after: CCM's variables, and how deep the stack went.

use core::ptr;

/// What unused stack is painted with.
const PAINT: u32 = 0x5AFE_57AC;

unsafe extern "C" {
    static mut __sccm: u32;
    static mut __eccm: u32;
    static __siccm: u32;
    static mut _stack_end: u32;
    static mut _stack_start: u32;
}

/// Gives CCM's variables their first values and paints the stack below the caller. To be called once, first of all,
/// before any variable in CCM is touched.
///
/// # Safety
/// No reference to a variable in the section `.ccm` may exist yet, and interrupts must not run yet.
pub(crate) unsafe fn init() {
    let here = cortex_m::register::msp::read() as usize;
    // SAFETY: the linker script gives these addresses: CCM's section and its image in flash are equally long and
    // aligned to words. By the contract above nobody uses the section yet. Below the stack pointer nothing is live:
    // 256 bytes are left to this function.
    unsafe {
        let words = (&raw const __eccm).offset_from_unsigned(&raw const __sccm);
        ptr::copy_nonoverlapping(&raw const __siccm, &raw mut __sccm, words);
        let bottom = &raw mut _stack_end;
        for word in 0..here.saturating_sub(bottom as usize + 256) / 4 {
            bottom.add(word).write_volatile(PAINT);
        }
    }
}

/// Bytes of stack that were ever used, and bytes there are.
pub(crate) fn stack_used() -> (usize, usize) {
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: both addresses bound the stack's memory, which is always readable.
    let (all, free) = unsafe {
        let all = top.offset_from_unsigned(bottom);
        (all, (0..all).take_while(|word| bottom.add(*word).read_volatile() == PAINT).count())
    };
    (4 * (all - free), 4 * all)
}
