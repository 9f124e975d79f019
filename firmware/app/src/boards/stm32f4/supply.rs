//! Supply monitor. Below 2.7 V a microSD card is out of specification (SD specification, 6.6), so the board stops
//! writing. The chip's voltage detector (PVD) interrupts everything and leaves a note in memory. The processor then
//! waits for the supply to return, and restarts, or for power off.
//!
//! The brown-out reset (BOR) is set in option bytes, which stay as delivered: a supply failure during their write can
//! lock the chip for ever. With BOR off the chip resets at 1.7 V (RM0090, 5.2.2).

use cortex_m::peripheral::NVIC;
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use hums_stm32f4::supply::is_low;
use hums_stm32f4::{supply, watchdog};
use hums_update::message::Message;

use crate::{fault, update};

/// The PVD's line into the interrupt controller (RM0090, 12.2.5).
const LINE: usize = 16;

/// Starts monitoring.
pub(super) fn watch() {
    supply::watch();
    // Rising, because the detector's output is high while the supply is low.
    pac::EXTI.rtsr(0).modify(|w| w.set_line(LINE, true));
    pac::EXTI.imr(0).modify(|w| w.set_line(LINE, true));
    // SAFETY: the handler below shares no data, and no code relies on its being masked.
    unsafe { NVIC::unmask(interrupt::PVD) };
    // A supply that is already low makes no edge.
    if is_low() {
        NVIC::pend(interrupt::PVD);
    }
}

#[interrupt]
fn PVD() {
    fault::supply_low();
    while is_low() {
        // A reset would not restore the supply. The note explains why no other code feeds the watchdog.
        watchdog::feed();
    }
    update::restart(Message::Planned);
}
