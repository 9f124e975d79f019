//! The registers and memory of an update; `hums_onboard::update` decides, and the resident program installs.

use core::ptr;
use core::slice;
use core::sync::atomic::{AtomicBool, Ordering};

use hums_onboard::ResetCause;
use hums_onboard::update::RunningImage;
use hums_stm32f4::words;
use hums_update::header::Header;
use hums_update::map;
use hums_update::message::Message;
use hums_update::state::{Record, State};

use crate::boards::board;

static ON_TRIAL: AtomicBool = AtomicBool::new(false);

/// The message of the resident program, and the cause of this start by it. Clears the message: every start calls it once.
pub(crate) fn take(reset: ResetCause) -> (ResetCause, Option<Message>) {
    let message = Message::of(words::read());
    words::write([0; 4]);
    match message.filter(|message| reset == ResetCause::Software && *message != Message::Install) {
        Some(message) => (ResetCause::Update, Some(message)),
        None => (reset, None),
    }
}

pub(crate) fn restart(message: Message) -> ! {
    words::write(message.words());
    board::restart()
}

fn flash(from: u32, bytes: usize) -> &'static [u8] {
    // SAFETY: flash, always readable. The state changes only in `confirm`, which has no such slice meanwhile.
    unsafe { slice::from_raw_parts(ptr::with_exposed_provenance(from as usize), bytes) }
}

/// This image.
pub(crate) fn running() -> RunningImage<'static> {
    let running = RunningImage {
        board: board::NAME,
        header: Header::read(flash(map::APPLICATION, hums_update::header::BYTES)),
        state: State::read(flash(map::STATE, map::STATE_BYTES)),
    };
    ON_TRIAL.store(running.is_on_trial(), Ordering::Relaxed);
    running
}

pub(crate) fn is_on_trial() -> bool {
    ON_TRIAL.load(Ordering::Relaxed)
}

/// Ends the trial. Without room or with flash that refuses it goes on.
pub(crate) fn confirm(running: &RunningImage<'static>) {
    let Some(header) = &running.header else { return };
    let bytes = Record::Confirmed(header.floor).bytes(header.id());
    let words = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
    let at = running.state.free;
    if at + bytes.len() > map::STATE_BYTES {
        return;
    }
    // SAFETY: aligned words of the state's sector, which no slice borrows now.
    if unsafe { hums_stm32f4::flash::write(map::STATE as usize + at, words) }.is_ok() {
        ON_TRIAL.store(false, Ordering::Relaxed);
    }
}
