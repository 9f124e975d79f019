//! A reset, and the end of the power: the emulator ends, says how far the input was taken, and the host starts it again
//! from there (`resets=1`). Memory that survives a reset goes through a file of the host, [`FILE`] in the emulator's
//! working directory: the cause of the reset, then the section `.uninit` as it is. After a loss of power there is none.

use core::ffi::CStr;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use semihosting::fs::File;
use semihosting::io::{Read, Write};
use semihosting::{println, process};

use super::clock;
use crate::boards::machine::ResetCause;
use crate::fault;
use crate::status::{CARD_STATUS, PORT_STATUS};

/// The host is to start the emulator again.
const EXIT_AGAIN: i32 = 3;
/// As Rust programs end that panic.
const EXIT_FAULT: i32 = 101;

const FILE: &CStr = c"uninit";
/// A word of the file.
const WORD: usize = 4;

/// Bytes taken out of the autopilot's port since the start: what the host need not send again.
static TAKEN: AtomicU32 = AtomicU32::new(0);
static AGAIN: AtomicBool = AtomicBool::new(false);
static CAUSE: AtomicU32 = AtomicU32::new(0);

unsafe extern "C" {
    static mut __suninit: u32;
    static mut __euninit: u32;
}

/// The host starts the emulator again: brings back what survived, if anything did. Before anybody looks at it.
pub(super) fn remember() {
    AGAIN.store(true, Ordering::Relaxed);
    let Ok(mut file) = File::open(FILE) else { return };
    let mut word = [0; WORD];
    if file.read_exact(&mut word).is_err() {
        return;
    }
    CAUSE.store(u32::from_le_bytes(word), Ordering::Relaxed);
    for place in words() {
        if file.read_exact(&mut word).is_err() {
            return;
        }
        // SAFETY: the place is in the section, whose variables are all made of `AtomicU32`.
        unsafe { AtomicU32::from_ptr(place) }.store(u32::from_le_bytes(word), Ordering::Relaxed);
    }
}

/// Why this start was.
pub(super) fn cause() -> ResetCause {
    match CAUSE.load(Ordering::Relaxed) {
        1 => ResetCause::Software,
        2 => ResetCause::Watchdog,
        _ => ResetCause::PowerOn,
    }
}

/// The processor is reset, and what survives is kept.
pub(super) fn reset(cause: ResetCause) -> ! {
    if !AGAIN.load(Ordering::Relaxed) {
        if let Some(fault) = fault::take() {
            println!("fault: {fault}");
        }
        process::exit(EXIT_FAULT);
    }
    if let Ok(mut file) = File::create(FILE) {
        let cause: u32 = if cause == ResetCause::Watchdog { 2 } else { 1 };
        let mut kept = file.write_all(&cause.to_le_bytes());
        for place in words() {
            // SAFETY: as above.
            let word = unsafe { AtomicU32::from_ptr(place) }.load(Ordering::Relaxed);
            kept = kept.and_then(|()| file.write_all(&word.to_le_bytes()));
        }
        if kept.is_err() {
            println!("what survives the reset cannot be written");
        }
    }
    end("reset")
}

/// Bytes were taken out of the autopilot's port.
pub(super) fn took(bytes: u32) {
    TAKEN.fetch_add(bytes, Ordering::Relaxed);
}

/// Power goes: nothing survives.
pub(super) fn power_off() -> ! {
    end("power")
}

/// Says how far it came, and ends the emulator.
fn end(what: &str) -> ! {
    let (port, card) = (PORT_STATUS.read(), CARD_STATUS.read());
    println!(
        "again {{\"what\":\"{}\",\"at_us\":{},\"taken\":{},\"frames_in\":{},\"bytes_in\":{},\
         \"bytes_not_frames\":{},\"blocks_written\":{}}}",
        what,
        clock::now_us(),
        TAKEN.load(Ordering::Relaxed),
        port.frames,
        port.bytes,
        port.bytes_not_frames,
        card.blocks_written,
    );
    process::exit(EXIT_AGAIN);
}

/// The words of the section.
fn words() -> impl Iterator<Item = *mut u32> {
    let (begin, end) = (&raw mut __suninit, &raw mut __euninit);
    // SAFETY: the linker script gives both ends of one section, aligned to words.
    let count = unsafe { end.offset_from_unsigned(begin) };
    // SAFETY: within that section.
    (0..count).map(move |index| unsafe { begin.add(index) })
}
