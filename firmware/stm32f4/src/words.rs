//! Four words at the end of memory, which survive a reset. Neither program's linker gives them to a variable (`memory.x`).

use core::ptr;

const AT: usize = 0x2001_FFF0;

fn place() -> *mut [u32; 4] {
    ptr::with_exposed_provenance_mut(AT)
}

/// After a power-on they are anything.
pub fn read() -> [u32; 4] {
    // SAFETY: always readable, and no variable of either program.
    unsafe { place().read_volatile() }
}

/// For the next start.
pub fn write(words: [u32; 4]) {
    // SAFETY: as above.
    unsafe { place().write_volatile(words) };
}
