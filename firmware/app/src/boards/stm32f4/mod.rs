//! Common part of the STM32F4 boards: everything except clocks, pins and channels.

mod card;
mod clock;
mod flash;
mod pins;
mod port;
mod random;
mod reset;
mod supply;
pub(super) mod time;
mod usb;
mod watchdog;

use core::ptr;

use cortex_m::peripheral::syst::SystClkSource;
use embassy_stm32::gpio::{Flex, Level, Pull, Speed};
use embassy_stm32::{Peripherals, pac, usart};
use embassy_time::{Duration, Instant};

pub(crate) use card::SpiPort;
pub(crate) use clock::{Crystal, crystal_failed, crystal_is_wrong};
pub(crate) use flash::StoreFlash;
pub(crate) use hums_stm32f4::watchdog::feed as feed_watchdog;
pub(crate) use pins::PinPort;
pub(crate) use port::{PortRx, PortTx, halves};
pub(crate) use random::number as random_number;
pub(crate) use reset::{reset_cause, restart};
pub(crate) use usb::{begin_with_data0, drop_control_packet, frame_number, has_bus_event};

use crate::boards::machine::SYSTICK_RELOAD;

#[cfg(feature = "log")]
use defmt_rtt as _;

pub(crate) const AUTOPILOT_BAUD: u32 = 921_600;
/// Baud rate of the ground station's port: the radios' usual one.
pub(crate) const GS_BAUD: u32 = 57_600;
/// 22 ms at 921,600 baud. Reception runs every millisecond, so it may be delayed by 20 of its periods.
pub(crate) const RING_BYTES: usize = 2_048;
/// Period of reception, which is the resolution of arrival times in the log.
pub(crate) const FETCH_EVERY: Duration = Duration::from_millis(1);
/// Turns of `SysTick` without the watchdog being fed after which it counts as late: 0.6 s, as the watchdog's own clock may
/// be fast by half (datasheet, table 36), so that its second is 0.68 s.
pub(crate) const LATE_TURNS: u32 = 6;
/// 88 ms at 57,600 baud.
pub(crate) const GS_RING_BYTES: usize = 512;
/// Period of the uplink, which is not urgent.
pub(crate) const GS_FETCH_EVERY: Duration = Duration::from_millis(10);

pub(crate) fn start(crystal: Crystal) -> Peripherals {
    watchdog::start();
    let parts = embassy_stm32::init(clock::config(crystal));
    clock::finish();
    time::start();
    supply::watch();
    start_counters();
    parts
}

/// `DEV_ID` of the STM32F405 and F407 (RM0090, 38.6.1).
const DEVICE: u16 = 0x413;
/// Address of the flash's size in KiB (RM0090, 39.2).
const FLASH_KIB: usize = 0x1FFF_7A22;
/// Flash of the memory map (`memory.x`).
const FLASH_KIB_MIN: u16 = 1_024;

pub(crate) fn chip_is_wrong() -> bool {
    let flash = ptr::with_exposed_provenance::<u16>(FLASH_KIB);
    // SAFETY: an aligned constant of the factory's, which can always be read.
    let kib = unsafe { flash.read_volatile() };
    pac::DBGMCU.idcode().read().dev_id() != DEVICE || kib < FLASH_KIB_MIN
}

fn start_counters() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(SYSTICK_RELOAD);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();
    }
}

/// A port at this rate. The receive pin has a pull-up, because an undriven line would float and bring noise.
pub(crate) fn line(baudrate: u32) -> usart::Config {
    let mut line = usart::Config::default();
    line.baudrate = baudrate;
    line.rx_pull = Pull::Up;
    line
}

/// A pin of the debug port becomes the LED's only so long after the start, so that a probe can connect before.
const PROBE_TIME: Duration = Duration::from_secs(1);

pub(crate) struct Led {
    pin: Flex<'static>,
    lit: Level,
    from: Instant,
}

impl Led {
    /// `waits`: the pin belongs to the debug port.
    pub(crate) fn new(pin: Flex<'static>, lit: Level, waits: bool) -> Self {
        let from = if waits { Instant::MIN + PROBE_TIME } else { Instant::MIN };
        Self { pin, lit, from }
    }

    pub(crate) fn set(&mut self, lit: bool) {
        if Instant::now() < self.from {
            return;
        }
        self.pin.set_level(if lit == bool::from(self.lit) { Level::High } else { Level::Low });
        self.pin.set_as_output(Speed::Low);
    }
}

/// Sleeps between interrupts.
pub(crate) fn idle() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
