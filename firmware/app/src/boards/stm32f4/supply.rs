//! The supply: below 2.7 V a microSD card may do anything with what it is told (SD specification, 6.6), and so this
//! board writes nothing any more. The chip's own detector (PVD) interrupts everything; the note is left in memory, and
//! the processor waits for the supply to come back, when it starts anew, or to go, when it is off.
//!
//! The reset that goes with it, BOR, is set in option bytes, which are not touched: a supply that fails while they are
//! written can lock the chip for good. Off, as they are delivered, the chip resets itself at 1.7 V (RM0090, 5.2.2).

use cortex_m::peripheral::NVIC;
use embassy_stm32::interrupt;
use embassy_stm32::pac;

use super::reset::restart;
use super::watchdog;
use crate::fault;

/// The PVD's line into the interrupt controller (RM0090, 12.2.5).
const LINE: usize = 16;
/// 2.7 V falling, the fifth of the detector's eight levels (RM0090, 5.4.1).
const LEVEL_2V7: u8 = 0b101;

/// Watches from now on.
pub(super) fn watch() {
    pac::PWR.cr1().modify(|w| {
        w.set_pls(LEVEL_2V7);
        w.set_pvde(true);
    });
    // Rising, because the detector's output is high while the supply is low.
    pac::EXTI.rtsr(0).modify(|w| w.set_line(LINE, true));
    pac::EXTI.imr(0).modify(|w| w.set_line(LINE, true));
    // SAFETY: the handler below shares nothing with anybody, and nobody relies on its being masked.
    unsafe { NVIC::unmask(interrupt::PVD) };
    // One that is low already makes no edge.
    if is_low() {
        NVIC::pend(interrupt::PVD);
    }
}

/// Whether it is too low now.
pub(super) fn is_low() -> bool {
    pac::PWR.csr1().read().pvdo()
}

#[interrupt]
fn PVD() {
    fault::supply_low();
    while is_low() {
        // A reset would not bring it back, and the note tells why nobody else feeds it.
        watchdog::reload();
    }
    restart();
}
