//! Clock tree: 168 MHz from a crystal, or from the chip's own oscillator if the crystal fails.
//!
//! The chip's oscillator is accurate to 1 % at 25 °C and to 4 % from -10 to 85 °C (datasheet, table 38). A UART tolerates some
//! 3.5 % between both ends. So recording continues with the same error in its times, and a note reports it.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::pac::rcc::vals::{Pllm, Pllsrc, Sw};
use embassy_stm32::pac::{DBGMCU, FLASH, RCC};
use embassy_stm32::rcc;
use embassy_stm32::time::Hertz;

/// Polls for the crystal: 0.1 s at the initial 16 MHz. A good crystal starts in 2 ms (datasheet, table 36).
const TRIES_MAX: u32 = 200_000;
/// The chip revision with a broken prefetch (ES0182, 2.1.1).
const REVISION_A: u16 = 0x1000;

/// The crystal does not run.
static CRYSTAL_FAILED: AtomicBool = AtomicBool::new(false);

/// Whether the crystal has failed since the start.
pub(crate) fn crystal_failed() -> bool {
    CRYSTAL_FAILED.load(Ordering::Relaxed)
}

/// Settings for [`embassy_stm32::init`]: 168 MHz from 8 MHz at the clock's pin: 8 / 4 * 168 / 2; from the chip's own 16 MHz, 16 /
/// 8, where there are none. The peripheral buses at 42 and 84 MHz either way.
pub(super) fn config(mode: rcc::HseMode) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let runs = crystal_starts(mode);
    CRYSTAL_FAILED.store(!runs, Ordering::Relaxed);
    config.rcc.hse = runs.then_some(rcc::Hse { freq: Hertz(8_000_000), mode });
    config.rcc.pll_src = if runs { rcc::PllSource::HSE } else { rcc::PllSource::HSI };
    config.rcc.pll = Some(rcc::Pll {
        prediv: if runs { rcc::PllPreDiv::DIV4 } else { rcc::PllPreDiv::DIV8 },
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config
}

fn crystal_starts(mode: rcc::HseMode) -> bool {
    RCC.cr().modify(|w| w.set_hsebyp(mode != rcc::HseMode::Oscillator));
    RCC.cr().modify(|w| w.set_hseon(true));
    let starts = (0..TRIES_MAX).any(|_| RCC.cr().read().hserdy());
    if !starts {
        RCC.cr().modify(|w| w.set_hseon(false));
    }
    starts
}

/// After the clocks are set: prefetch and both caches of the flash, which embassy-stm32 leaves off, and the watch over the crystal.
pub(super) fn finish() {
    let prefetches = DBGMCU.idcode().read().rev_id() != REVISION_A;
    FLASH.acr().modify(|w| {
        w.set_prften(prefetches);
        w.set_icen(true);
        w.set_dcen(true);
    });
    if !crystal_failed() {
        RCC.cr().modify(|w| w.set_csson(true));
    }
}

/// Crystal failure: the chip has switched to its own oscillator without the PLL (RM0090, 7.2.7). The handler uses only registers
/// that no other code touches after the start.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() {
    if !RCC.cir().read().cssf() {
        return;
    }
    RCC.cir().modify(|w| w.set_cssc(true));
    CRYSTAL_FAILED.store(true, Ordering::Relaxed);
    RCC.cr().modify(|w| {
        w.set_csson(false);
        w.set_hseon(false);
        w.set_pllon(false);
    });
    // The watchdog limits these waits. The next start tries the crystal first.
    while RCC.cr().read().pllrdy() {}
    RCC.pllcfgr().modify(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_pllm(Pllm::DIV8);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    while !RCC.cr().read().pllrdy() {}
    RCC.cfgr().modify(|w| w.set_sw(Sw::PLL1_P));
    while RCC.cfgr().read().sws() != Sw::PLL1_P {}
}
