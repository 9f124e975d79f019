//! Clock, and the words that survive a reset.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::{DCB, DWT, SCB};
use hums_core::clock::Instant;
use hums_stm32f4::words;
use hums_update::message::Message;
use hums_update::resident::Cause;
use stm32_metapac::flash::vals::Latency;
use stm32_metapac::rcc::vals::{Hpre, Pllm, Plln, Pllp, Pllsrc, Ppre, Sw};
use stm32_metapac::{DBGMCU, FLASH, RCC};

/// Cycles of a microsecond.
const MHZ: u64 = 168;
/// The chip revision with a broken prefetch (ES0182, 2.1.1).
const REVISION_A: u16 = 0x1000;

/// By the reset's flags, which stay for the application, and by its message, which is taken.
pub(crate) fn cause() -> Cause {
    let flags = RCC.csr().read();
    if !(flags.wdgrstf() || flags.wwdgrstf() || flags.sftrstf()) {
        return Cause::Usual;
    }
    let cause = match Message::of(words::read()) {
        Some(Message::Install) => Cause::Asked,
        Some(Message::Planned) => Cause::Usual,
        // One of this program is for the application.
        _ => return Cause::Crash,
    };
    words::write([0; 4]);
    cause
}

pub(crate) fn restart(message: Message) -> ! {
    words::write(message.words());
    SCB::sys_reset()
}

/// 168 MHz from the chip's own oscillator, peripheral buses at 42 and 84 MHz; counts time from here.
pub(crate) fn start_clock() {
    RCC.pllcfgr().modify(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_pllm(Pllm::DIV8);
        w.set_plln(Plln::MUL168);
        w.set_pllp(Pllp::DIV2);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    while !RCC.cr().read().pllrdy() {}
    // Without the data cache, which would keep erased data.
    let prefetches = DBGMCU.idcode().read().rev_id() != REVISION_A;
    FLASH.acr().write(|w| {
        w.set_latency(Latency::WS5);
        w.set_prften(prefetches);
        w.set_icen(true);
    });
    RCC.cfgr().modify(|w| {
        w.set_hpre(Hpre::DIV1);
        w.set_ppre1(Ppre::DIV4);
        w.set_ppre2(Ppre::DIV2);
    });
    RCC.cfgr().modify(|w| w.set_sw(Sw::PLL1_P));
    while RCC.cfgr().read().sws() != Sw::PLL1_P {}
    // SAFETY: the program has one thread and no other user of the counter.
    unsafe {
        (*DCB::PTR).demcr.modify(|word| word | 1 << 24);
        (*DWT::PTR).ctrl.modify(|word| word | 1);
    }
}

/// Time since [`start_clock`]. To be asked at least every 25 s, when the counter wraps.
pub(crate) fn now() -> Instant {
    static LAST: AtomicU32 = AtomicU32::new(0);
    static WRAPS: AtomicU32 = AtomicU32::new(0);
    let count = DWT::cycle_count();
    let wraps = WRAPS.load(Ordering::Relaxed) + u32::from(count < LAST.load(Ordering::Relaxed));
    WRAPS.store(wraps, Ordering::Relaxed);
    LAST.store(count, Ordering::Relaxed);
    Instant::from_micros((u64::from(wraps) << 32 | u64::from(count)) / MHZ)
}
