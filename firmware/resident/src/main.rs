//! The resident program: the first of a start, never rewritten in the field. It starts the application, or installs one from the
//! card; `hums_update::resident` decides. This crate has the registers.
//!
//! The way to the application takes some 7 ms of the chip's first clock: the header's CRC and the records of the state. Only for
//! work with the card the processor goes to 168 MHz, by its own oscillator. That way ends with a reset, so the application always
//! finds the chip as after a reset.
#![no_std]
#![no_main]

mod board;
mod chip;
mod flash;
mod port;

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use hums_core::clock::Span;
use hums_recorder::SpiCard;
use hums_stm32f4::supply;
use hums_stm32f4::watchdog::{self, Divider};
use hums_update::resident::{Decision, Job, Resident, WorkResult, decide};
use hums_update::{keys, map};

/// Of the watchdog: 128 ms by the divider at 32 kHz.
const TURNS: u16 = 4_096;
/// The watchdog of a trial's start: 4 s of 32 kHz, 2.7 s at the fastest.
const TRIAL: Divider = Divider::DIVIDE_BY32;
/// The watchdog of this program: 32 s, 22 s at the fastest. The longest erase takes 4 s, a silent card 8 s.
const SERVICE: Divider = Divider::DIVIDE_BY256;
/// Period of the search for a card.
const LOOK_EVERY: Span = Span::from_secs(2);

#[cortex_m_rt::entry]
fn main() -> ! {
    supply::watch();
    match decide(&mut flash::Flash::new(), board::NAME, chip::cause()) {
        Decision::Start { on_trial } => start(on_trial),
        Decision::Work(job) => serve(job),
    }
}

fn start(on_trial: bool) -> ! {
    if on_trial {
        // A program that hangs before its own watchdog runs.
        watchdog::start(TRIAL, TURNS);
    }
    // SAFETY: the header is complete, so there is a vector table behind it; all registers but the supply detector's are as
    // after a reset.
    unsafe {
        (*SCB::PTR).vtor.write(map::VECTORS);
        cortex_m::asm::bootload(core::ptr::with_exposed_provenance(map::VECTORS as usize));
    }
}

#[inline(never)]
fn serve(mut job: Job) -> ! {
    watchdog::start(SERVICE, TURNS);
    chip::start_clock();
    board::hold();
    let card = SpiCard::new(port::Port::new());
    let mut flash = flash::Flash::new();
    loop {
        let mut resident = Resident { flash: &mut flash, card: &card, board: board::NAME, keys: keys::ALL };
        match resident.work(job) {
            WorkResult::Restart(message) => chip::restart(message),
            WorkResult::Wait(next) => job = next,
        }
        let end = chip::now() + LOOK_EVERY;
        while chip::now() < end {
            board::show_waiting();
            watchdog::feed();
        }
        hums_recorder::CardDevice::reset(&card);
    }
}

#[cortex_m_rt::exception]
unsafe fn HardFault(_: &cortex_m_rt::ExceptionFrame) -> ! {
    SCB::sys_reset()
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    SCB::sys_reset()
}
