//! Clock tree: 168 MHz from a crystal, or from the chip's own oscillator if the crystal fails or has another frequency than the
//! board's: a PLL set for 8 MHz would run at 252 MHz from 12.
//!
//! The chip's oscillator is accurate to 1 % at 25 °C and to 4 % from -10 to 85 °C (datasheet, table 38). A UART tolerates some
//! 3.5 % between both ends. So recording continues with the same error in its times, and a note reports it.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::pac::rcc::vals::{Pllm, Pllsrc, Sw};
use embassy_stm32::pac::timer::vals::CcmrInputCcs;
use embassy_stm32::pac::{DBGMCU, FLASH, RCC, TIM11};
use embassy_stm32::rcc;
use embassy_stm32::time::Hertz;

/// Polls for the crystal: 0.1 s at the initial 16 MHz. A good crystal starts in 2 ms (datasheet, table 36).
const TRIES_MAX: u32 = 200_000;
/// The chip revision with a broken prefetch (ES0182, 2.1.1).
const REVISION_A: u16 = 0x1000;

/// `TI1_RMP` of TIM11's option register: its input is the crystal by `RTCPRE` (RM0090, 19.5.11).
const INPUT_IS_CRYSTAL: u32 = 2;
/// The largest `RTCPRE`.
const PRESCALER: u8 = 31;
/// Edges of a capture, and their code.
const EDGES: (u32, u8) = (8, 3);
/// The chip's own oscillator, which counts the time between captures.
const HSI_HZ: u32 = 16_000_000;
/// Polls for a capture, which takes 62 µs with the slowest crystal.
const CAPTURE_TRIES_MAX: u32 = 10_000;

static CRYSTAL_FAILED: AtomicBool = AtomicBool::new(false);
static CRYSTAL_IS_WRONG: AtomicBool = AtomicBool::new(false);

pub(crate) fn crystal_failed() -> bool {
    CRYSTAL_FAILED.load(Ordering::Relaxed)
}

pub(crate) fn crystal_is_wrong() -> bool {
    CRYSTAL_IS_WRONG.load(Ordering::Relaxed)
}

/// A board's crystal.
#[derive(Clone, Copy)]
pub(crate) struct Crystal {
    pub(crate) hz: u32,
    /// Divides it to 2 MHz, the input of the PLL.
    pub(crate) divider: rcc::PllPreDiv,
}

/// Settings for [`embassy_stm32::init`]: 2 MHz * 168 / 2 = 168 MHz, from the crystal or, if it fails, from the chip's own 16 MHz by
/// 8. The peripheral buses at 42 and 84 MHz either way.
pub(super) fn config(crystal: Crystal) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let runs = crystal_starts(crystal.hz);
    CRYSTAL_FAILED.store(!runs, Ordering::Relaxed);
    let mode = rcc::HseMode::Oscillator;
    config.rcc.hse = runs.then_some(rcc::Hse { freq: Hertz(crystal.hz), mode });
    config.rcc.pll_src = if runs { rcc::PllSource::HSE } else { rcc::PllSource::HSI };
    config.rcc.pll = Some(rcc::Pll {
        prediv: if runs { crystal.divider } else { rcc::PllPreDiv::DIV8 },
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

fn crystal_starts(hz: u32) -> bool {
    RCC.cr().modify(|w| w.set_hseon(true));
    let starts = (0..TRIES_MAX).any(|_| RCC.cr().read().hserdy());
    let is_wrong = starts && !has_frequency(hz);
    CRYSTAL_IS_WRONG.store(is_wrong, Ordering::Relaxed);
    let runs = starts && !is_wrong;
    if !runs {
        RCC.cr().modify(|w| w.set_hseon(false));
    }
    runs
}

/// Whether the running crystal has this frequency, to an eighth: the chip's own oscillator is off by up to 8 % (DS8626, table 38).
/// TIM11 counts that oscillator between captures of the crystal. Without a capture the crystal counts as right.
fn has_frequency(hz: u32) -> bool {
    RCC.cfgr().modify(|w| w.set_rtcpre(PRESCALER));
    RCC.apb2enr().modify(|w| w.set_tim11en(true));
    // The timer takes no write in the first cycles after its clock begins (ES0182).
    cortex_m::asm::dsb();
    TIM11.or().write_value(INPUT_IS_CRYSTAL);
    TIM11.ccmr_input(0).write(|w| {
        w.set_ccs(0, CcmrInputCcs::TI4);
        w.set_icpsc(0, EDGES.1);
    });
    TIM11.ccer().write(|w| w.set_cce(0, true));
    TIM11.cr1().write(|w| w.set_cen(true));
    let capture = || {
        let is_there = (0..CAPTURE_TRIES_MAX).any(|_| TIM11.sr().read().ccif(0));
        is_there.then(|| TIM11.ccr(0).read().ccr())
    };
    let counted = capture().and_then(|first| Some(u32::from(capture()?.wrapping_sub(first))));
    RCC.apb2enr().modify(|w| w.set_tim11en(false));
    RCC.cfgr().modify(|w| w.set_rtcpre(0));
    let wanted = u32::from(PRESCALER) * EDGES.0 * (HSI_HZ / 1_000) / (hz / 1_000);
    counted.is_none_or(|counted| counted.abs_diff(wanted) <= wanted / 8)
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

/// Crystal failure: the chip has switched to its own oscillator without the PLL (RM0090, 7.2.7).
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
