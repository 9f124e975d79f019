//! defmt's messages into a file of the host (`log=PATH`), as they would go over RTT: `defmt-print -e IMAGE < PATH`
//! shows them. Without the argument they are dropped. Writing takes no virtual time.

use core::cell::RefCell;

use critical_section::{Mutex, RestoreState};
use defmt::{Encoder, Logger};
use heapless::Vec;
use semihosting::fs::File;
use semihosting::io::Write;

/// A frame is written to the host in pieces of this size.
const PIECE_BYTES: usize = 128;

struct State {
    encoder: Encoder,
    piece: Vec<u8, PIECE_BYTES>,
    file: Option<File>,
    interrupts: RestoreState,
}

static STATE: Mutex<RefCell<State>> = Mutex::new(RefCell::new(State {
    encoder: Encoder::new(),
    piece: Vec::new(),
    file: None,
    interrupts: RestoreState::invalid(),
}));

/// Sends all further messages to `file`.
pub(super) fn open(file: Option<File>) {
    with(|state| state.file = file);
}

#[defmt::global_logger]
struct FileLogger;

// SAFETY: interrupts are off from `acquire` to `release`, so that frames do not mix, as the trait demands.
unsafe impl Logger for FileLogger {
    fn acquire() {
        // SAFETY: `release` follows, by the trait's contract.
        let interrupts = unsafe { critical_section::acquire() };
        with(|state| {
            state.interrupts = interrupts;
            state.encode(|encoder, out| encoder.start_frame(out));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        let interrupts = with(|state| {
            state.encode(|encoder, out| encoder.end_frame(out));
            state.flush();
            state.interrupts
        });
        // SAFETY: what `acquire` gave, in this order by the trait's contract.
        unsafe { critical_section::release(interrupts) };
    }

    unsafe fn write(bytes: &[u8]) {
        with(|state| state.encode(|encoder, out| encoder.write(bytes, out)));
    }
}

fn with<R>(act: impl FnOnce(&mut State) -> R) -> R {
    critical_section::with(|cs| act(&mut STATE.borrow_ref_mut(cs)))
}

impl State {
    fn encode(&mut self, act: impl FnOnce(&mut Encoder, &mut dyn FnMut(&[u8]))) {
        let Self { encoder, piece, file, .. } = self;
        act(encoder, &mut |bytes| {
            for part in bytes.chunks(PIECE_BYTES) {
                if piece.extend_from_slice(part).is_err() {
                    write_out(file, piece);
                    // Empty now, and no part is longer than it.
                    let _ = piece.extend_from_slice(part);
                }
            }
        });
    }

    fn flush(&mut self) {
        write_out(&mut self.file, &mut self.piece);
    }
}

fn write_out(file: &mut Option<File>, piece: &mut Vec<u8, PIECE_BYTES>) {
    // A log that cannot be written is no reason to stop.
    let _ = file.as_mut().map(|file| file.write_all(piece));
    piece.clear();
}
