//! What went wrong before the last reset: a panic, a processor fault or a silent task leaves its note in memory that a
//! reset does not clear, and the next start reads it.
//!
//! That memory is garbage after power-on, so a note counts only with its mark and its check sum. It is made of atomics
//! because the writer may have interrupted anybody, itself included.

use core::fmt::{self, Write as _};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use heapless::String;
use hums_blackbox::record;

use crate::boards::board;
use crate::executors;

/// Bytes of the place that are kept: a file of ours and its line.
const PLACE_BYTES: usize = 64;
/// Bytes of the file's path within the place: the rest is for the line.
const FILE_BYTES: usize = PLACE_BYTES - 8;
/// Bytes of the message that are kept.
const MESSAGE_BYTES: usize = 128;
/// Registers of a processor fault, in the order of [`record::Fault::registers`].
const REGISTERS: usize = 12;
/// Says that a note is there.
const MARK: u32 = 0x4641_554C;

/// How a start can end, by the numbers that the record uses.
#[derive(Clone, Copy)]
enum Kind {
    Panic = 1,
    HardFault = 2,
    Watchdog = 3,
}

struct Note {
    mark: AtomicU32,
    sum: AtomicU32,
    kind: AtomicU32,
    task: AtomicU32,
    registers: [AtomicU32; REGISTERS],
    place: Text<{ PLACE_BYTES / 4 }>,
    message: Text<{ MESSAGE_BYTES / 4 }>,
}

#[unsafe(link_section = ".uninit.fault")]
static NOTE: Note = Note {
    mark: AtomicU32::new(0),
    sum: AtomicU32::new(0),
    kind: AtomicU32::new(0),
    task: AtomicU32::new(0),
    registers: [const { AtomicU32::new(0) }; REGISTERS],
    place: Text::new(),
    message: Text::new(),
};

struct Starts {
    mark: AtomicU32,
    count: AtomicU32,
}

#[unsafe(link_section = ".uninit.starts")]
static STARTS: Starts = Starts { mark: AtomicU32::new(0), count: AtomicU32::new(0) };

/// How the last start ended.
pub(crate) struct Fault {
    kind: u8,
    task: &'static str,
    registers: [u32; REGISTERS],
    place: String<PLACE_BYTES>,
    message: String<MESSAGE_BYTES>,
}

impl Fault {
    /// As the log records it.
    pub(crate) fn record(&self) -> record::Fault<'_> {
        let Self { kind, task, registers, place, message } = self;
        record::Fault { kind: *kind, task, place, registers: *registers, message }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [_, _, _, _, _, lr, pc, _, cfsr, _, _, bfar] = self.registers;
        write!(f, "{} in {} at {}", self.message, self.task, self.place)?;
        if self.kind == Kind::HardFault as u8 {
            write!(f, " (pc {pc:08x} lr {lr:08x} cfsr {cfsr:08x} bfar {bfar:08x})")?;
        }
        Ok(())
    }
}

/// How the start before this one ended, if it left a note; gives it once.
pub(crate) fn take() -> Option<Fault> {
    let noted = NOTE.mark.swap(0, Ordering::Relaxed) == MARK;
    if !noted || NOTE.sum.load(Ordering::Relaxed) != NOTE.sum_now() {
        return None;
    }
    Some(Fault {
        kind: NOTE.kind.load(Ordering::Relaxed) as u8,
        task: executors::task_of(NOTE.task.load(Ordering::Relaxed) as u16),
        registers: NOTE.registers.each_ref().map(|register| register.load(Ordering::Relaxed)),
        place: NOTE.place.read(),
        message: NOTE.message.read(),
    })
}

/// How many starts there were since power-on, this one included.
#[cfg(feature = "board-emulated")]
pub(crate) fn starts() -> u32 {
    STARTS.count.load(Ordering::Relaxed)
}

/// Counts a start; how many there were since power-on, this one included.
pub(crate) fn count_start() -> u32 {
    let starts = if STARTS.mark.swap(MARK, Ordering::Relaxed) == MARK {
        STARTS.count.load(Ordering::Relaxed).saturating_add(1)
    } else {
        1
    };
    STARTS.count.store(starts, Ordering::Relaxed);
    starts
}

/// A task has been silent for too long: says so to whoever starts after the watchdog.
pub(crate) fn silent(task: hums_onboard::Task) {
    NOTE.keep(Kind::Watchdog, executors::number_of(task), format_args!("watchdog"), format_args!("silent"));
}

impl Note {
    fn keep(&self, kind: Kind, running: u16, place: fmt::Arguments, message: fmt::Arguments) {
        self.kind.store(kind as u32, Ordering::Relaxed);
        self.task.store(u32::from(running), Ordering::Relaxed);
        self.place.write(place);
        self.message.write(message);
        self.sum.store(self.sum_now(), Ordering::Relaxed);
        self.mark.store(MARK, Ordering::Relaxed);
    }

    /// Any change of one word changes it; memory that was never written matches by a chance of 2^-32.
    fn sum_now(&self) -> u32 {
        let words = [&self.kind, &self.task].into_iter().chain(&self.registers);
        let words = words.chain(&self.place.0).chain(&self.message.0);
        words.fold(MARK, |sum, word| {
            sum.rotate_left(5) ^ word.load(Ordering::Relaxed).wrapping_mul(0x9E37_79B1)
        })
    }
}

/// Printable ASCII in words, ended by a zero or by its capacity.
struct Text<const WORDS: usize>([AtomicU32; WORDS]);

impl<const WORDS: usize> Text<WORDS> {
    const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; WORDS])
    }

    fn write(&self, text: fmt::Arguments) {
        for word in &self.0 {
            word.store(0, Ordering::Relaxed);
        }
        // It never refuses: what does not fit is cut off.
        let _ = TextWriter { words: &self.0, bytes: 0 }.write_fmt(text);
    }

    fn read<const BYTES: usize>(&self) -> String<BYTES> {
        let bytes = self.0.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes());
        let mut text = String::new();
        for byte in bytes.take_while(|byte| *byte != 0) {
            let _ = text.push(if (b' '..=b'~').contains(&byte) { char::from(byte) } else { '?' });
        }
        text
    }
}

struct TextWriter<'a> {
    words: &'a [AtomicU32],
    bytes: usize,
}

impl fmt::Write for TextWriter<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            let Some(word) = self.words.get(self.bytes / 4) else { return Ok(()) };
            word.fetch_or(u32::from(byte) << (8 * (self.bytes % 4)), Ordering::Relaxed);
            self.bytes += 1;
        }
        Ok(())
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    for register in &NOTE.registers {
        register.store(0, Ordering::Relaxed);
    }
    match info.location() {
        Some(place) => {
            // The end of a long path says more than its beginning.
            let file = place.file();
            let file = file.get(file.len().saturating_sub(FILE_BYTES)..).unwrap_or(file);
            let place = format_args!("{file}:{}", place.line());
            NOTE.keep(Kind::Panic, executors::running(), place, format_args!("{}", info.message()));
        }
        None => NOTE.keep(
            Kind::Panic,
            executors::running(),
            format_args!("?"),
            format_args!("{}", info.message()),
        ),
    }
    board::restart();
}

/// Every fault of the processor ends here, as the milder ones are not switched on.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // SAFETY: reading the status registers that every Cortex-M4 has (ARMv7-M, B3.2.2) has no side effect.
    let [cfsr, hfsr, mmfar, bfar] = unsafe {
        let scb = &*SCB::PTR;
        [scb.cfsr.read(), scb.hfsr.read(), scb.mmfar.read(), scb.bfar.read()]
    };
    let (f, status) = (frame, [cfsr, hfsr, mmfar, bfar]);
    let stacked = [f.r0(), f.r1(), f.r2(), f.r3(), f.r12(), f.lr(), f.pc(), f.xpsr()];
    for (register, value) in NOTE.registers.iter().zip(stacked.into_iter().chain(status)) {
        register.store(value, Ordering::Relaxed);
    }
    // What ran before this exception is in the stacked status.
    let running = (f.xpsr() & 0x1FF) as u16;
    NOTE.keep(Kind::HardFault, running, format_args!("pc {:08x}", f.pc()), format_args!("processor fault"));
    board::restart();
}
