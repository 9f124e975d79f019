//! Fault note of the last reset. A panic, a processor fault, a stack overflow, a hanging task or a low supply leaves
//! a note in memory that survives a reset. The next start reads it.
//!
//! This memory is random after power-on, so a note needs a valid mark and checksum. It consists of atomics because
//! the writer may interrupt any code, itself included. For the same reason it does not read the clock: it takes the
//! time of the last frame or tick ([`seen`], [`tick`]).

use core::fmt::{self, Write as _};
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use cortex_m_rt::ExceptionFrame;
use heapless::String;
use hums_blackbox::record;
use hums_core::clock::Instant;
use hums_onboard::Task;

use crate::exceptions;
use crate::registers::{Registers, stacked};

const PLACE_BYTES: usize = 64;
/// Bytes of the file's path within the place: the rest is for the line.
const FILE_BYTES: usize = PLACE_BYTES - 8;
const SEEN: usize = 8;
/// Bytes of [`Fault::last_messages`].
const LAST_BYTES: usize = 200;
const MARK: u32 = 0x4641_554C;

/// The reason of a fault, a number in its note.
#[derive(Clone, Copy)]
pub(crate) enum Reason {
    LowSupply,
    Panic,
    ProcessorFault,
    StackOverflow,
    /// A task that never returns.
    Hanging,
    /// A task that waits for ever.
    Silent,
}

impl Reason {
    const ALL: [Self; 6] = [
        Self::LowSupply,
        Self::Panic,
        Self::ProcessorFault,
        Self::StackOverflow,
        Self::Hanging,
        Self::Silent,
    ];

    /// The kind of the record and its message.
    const fn recorded(self) -> (u8, &'static str) {
        match self {
            Self::LowSupply => (0, "below 2.7 V"),
            Self::Panic => (1, "panic"),
            Self::ProcessorFault => (2, "processor fault"),
            Self::StackOverflow => (2, "stack overflow"),
            Self::Hanging => (WATCHDOG, "hangs"),
            Self::Silent => (WATCHDOG, "silent"),
        }
    }
}

const WATCHDOG: u8 = 3;

struct Note {
    mark: AtomicU32,
    sum: AtomicU32,
    reason: AtomicU32,
    task: AtomicU32,
    at_ms: AtomicU32,
    registers: [AtomicU32; size_of::<Registers>() / 4],
    /// ASCII, ended by a zero or by its capacity.
    place: [AtomicU8; PLACE_BYTES],
}

#[unsafe(link_section = ".uninit.fault")]
static NOTE: Note = Note {
    mark: AtomicU32::new(0),
    sum: AtomicU32::new(0),
    reason: AtomicU32::new(0),
    task: AtomicU32::new(0),
    at_ms: AtomicU32::new(0),
    registers: [const { AtomicU32::new(0) }; size_of::<Registers>() / 4],
    place: [const { AtomicU8::new(0) }; PLACE_BYTES],
};

/// The last messages of the autopilot: which, and when in milliseconds since the start.
struct LastMessages {
    /// [`MARK`] in card-reader mode.
    card_reader: AtomicU32,
    now_ms: AtomicU32,
    next: AtomicU32,
    messages: [(AtomicU32, AtomicU32); SEEN],
}

#[unsafe(link_section = ".uninit.seen")]
static LAST_SEEN: LastMessages = LastMessages {
    card_reader: AtomicU32::new(0),
    now_ms: AtomicU32::new(0),
    next: AtomicU32::new(0),
    messages: [const { (AtomicU32::new(0), AtomicU32::new(0)) }; SEEN],
};
const NOTHING: u32 = u32::MAX;
/// Task that missed its deadline, as an exception number; 0: none.
static SILENT: AtomicU32 = AtomicU32::new(0);

struct Starts {
    mark: AtomicU32,
    count: AtomicU32,
}

#[unsafe(link_section = ".uninit.starts")]
static STARTS: Starts = Starts { mark: AtomicU32::new(0), count: AtomicU32::new(0) };

pub(crate) struct Fault {
    kind: u8,
    task: &'static str,
    registers: Registers,
    place: String<PLACE_BYTES>,
    message: &'static str,
    last_messages: String<LAST_BYTES>,
}

impl Fault {
    pub(crate) fn record(&self) -> record::Fault<'_> {
        let Self { kind, task, registers, place, message, .. } = self;
        record::Fault { kind: *kind, task, place, registers: *registers, message }
    }

    /// In words: when it was, and which messages came before it, by their numbers, the newest first.
    pub(crate) fn last_messages(&self) -> &str {
        &self.last_messages
    }

    /// Watchdog reset without a note: interrupts were off, or memory did not survive.
    pub(crate) fn without_note() -> Self {
        Self {
            kind: WATCHDOG,
            task: "?",
            registers: Registers::default(),
            place: "?".chars().collect(),
            message: "no note was left",
            last_messages: String::new(),
        }
    }
}

pub(crate) fn take() -> Option<Fault> {
    let noted = NOTE.mark.swap(0, Ordering::Relaxed) == MARK;
    if !noted || NOTE.sum.load(Ordering::Relaxed) != NOTE.sum_now() {
        return None;
    }
    let (kind, message) = Reason::ALL.get(NOTE.reason.load(Ordering::Relaxed) as usize)?.recorded();
    Some(Fault {
        kind,
        task: exceptions::task_of(NOTE.task.load(Ordering::Relaxed) as u16),
        registers: NOTE.registers.each_ref().map(|register| register.load(Ordering::Relaxed)),
        place: NOTE.read_place(),
        message,
        last_messages: LAST_SEEN.read(),
    })
}

/// Forgets the messages that came before this start: after [`take`], and before the first [`seen`].
pub(crate) fn begin(card_reader: bool) {
    LAST_SEEN.card_reader.store(if card_reader { MARK } else { 0 }, Ordering::Relaxed);
    LAST_SEEN.now_ms.store(0, Ordering::Relaxed);
    for (_, id) in &LAST_SEEN.messages {
        id.store(NOTHING, Ordering::Relaxed);
    }
}

pub(crate) fn seen(at: Instant, id: u32) {
    let LastMessages { next, messages, .. } = &LAST_SEEN;
    let index = next.load(Ordering::Relaxed) as usize % SEEN;
    next.store(index as u32 + 1, Ordering::Relaxed);
    let ms = at.as_millis() as u32;
    if let Some((at_ms, of)) = messages.get(index) {
        at_ms.store(ms, Ordering::Relaxed);
        of.store(id, Ordering::Relaxed);
    }
    tick(at);
}

/// Time also passes without messages.
pub(crate) fn tick(now: Instant) {
    LAST_SEEN.now_ms.store(now.as_millis() as u32, Ordering::Relaxed);
}

impl LastMessages {
    fn read(&self) -> String<LAST_BYTES> {
        let mut text = String::new();
        let at_ms = NOTE.at_ms.load(Ordering::Relaxed);
        let next = self.next.load(Ordering::Relaxed) as usize;
        if self.card_reader.load(Ordering::Relaxed) == MARK {
            let _ = text.push_str("card reader: ");
        }
        // The text is cut if full, so the newest come first.
        let _ = write!(text, "restart at {at_ms} ms; last messages:");
        for back in 1..=SEEN {
            let Some((at, id)) = self.messages.get((next % SEEN + SEEN - back) % SEEN) else { continue };
            let (at, id) = (at.load(Ordering::Relaxed), id.load(Ordering::Relaxed));
            if id != NOTHING {
                let _ = write!(text, " {id} at {at}{}", if back == SEEN { "" } else { "," });
            }
        }
        text
    }
}

pub(crate) fn count_start() -> u32 {
    let starts = if STARTS.mark.swap(MARK, Ordering::Relaxed) == MARK {
        STARTS.count.load(Ordering::Relaxed).saturating_add(1)
    } else {
        1
    };
    STARTS.count.store(starts, Ordering::Relaxed);
    starts
}

pub(crate) fn silent(task: Option<Task>) {
    SILENT.store(task.map_or(0, |task| u32::from(exceptions::number_of(task))), Ordering::Relaxed);
}

/// `interrupted` ran until now.
///
/// The cause is the task that missed its deadline. If none is known, the monitor itself no longer runs: it waits or is blocked. A
/// hanging task blocks all less urgent ones. So the cause is the least urgent task that ran since the last feeding.
pub(crate) fn late(interrupted: &ExceptionFrame) {
    let running = (interrupted.xpsr() & 0x1FF) as u16;
    let silent = SILENT.load(Ordering::Relaxed) as u16;
    let noted = NOTE.mark.load(Ordering::Relaxed) == MARK;
    let before = NOTE.task.load(Ordering::Relaxed) as u16;
    if silent == 0 && noted && exceptions::rank(running) < exceptions::rank(before) {
        return;
    }
    let blamed = match silent {
        0 if running == 0 => exceptions::number_of(Task::Monitor),
        0 => running,
        silent => silent,
    };
    if running == blamed {
        NOTE.keep_registers(stacked(interrupted));
        NOTE.keep(Reason::Hanging, blamed, format_args!("pc {:08x}", interrupted.pc()));
    } else if !noted {
        // Otherwise an earlier check has found more.
        NOTE.keep_registers(Registers::default());
        NOTE.keep(Reason::Silent, blamed, format_args!("waits"));
    }
}

pub(crate) fn not_late() {
    NOTE.mark.store(0, Ordering::Relaxed);
}

/// The supply is too low for any write: all code must wait until it returns.
pub(crate) fn supply_low() {
    cortex_m::interrupt::disable();
    NOTE.keep_registers(Registers::default());
    NOTE.keep(Reason::LowSupply, exceptions::begun(), format_args!("supply"));
}

/// The processor cannot go on.
pub(crate) fn processor(reason: Reason, running: u16, registers: Registers, place: fmt::Arguments) {
    NOTE.keep_registers(registers);
    NOTE.keep(reason, running, place);
}

/// The program cannot go on. The place shows the reason; the message would need the `Debug` of everything, 10 KiB of
/// flash.
pub(crate) fn panicked(registers: Registers, info: &PanicInfo) {
    NOTE.keep_registers(registers);
    let running = exceptions::running();
    match info.location() {
        Some(place) => {
            // The end of a long path is more telling than its beginning.
            let file = place.file();
            let file = file.get(file.len().saturating_sub(FILE_BYTES)..).unwrap_or(file);
            NOTE.keep(Reason::Panic, running, format_args!("{file}:{}", place.line()));
        }
        None => NOTE.keep(Reason::Panic, running, format_args!("?")),
    }
}

impl Note {
    /// Keeps the registers of a fault; [`Self::keep`] follows.
    fn keep_registers(&self, registers: Registers) {
        for (kept, value) in self.registers.iter().zip(registers) {
            kept.store(value, Ordering::Relaxed);
        }
    }

    fn keep(&self, reason: Reason, running: u16, place: fmt::Arguments) {
        self.reason.store(reason as u32, Ordering::Relaxed);
        self.task.store(u32::from(running), Ordering::Relaxed);
        self.at_ms.store(LAST_SEEN.now_ms.load(Ordering::Relaxed), Ordering::Relaxed);
        let mut text = String::<PLACE_BYTES>::new();
        // A file's path and a line fit.
        let _ = text.write_fmt(place);
        let ended = text.bytes().chain(core::iter::repeat(0));
        for (kept, byte) in self.place.iter().zip(ended) {
            kept.store(byte, Ordering::Relaxed);
        }
        self.sum.store(self.sum_now(), Ordering::Relaxed);
        self.mark.store(MARK, Ordering::Relaxed);
    }

    fn read_place(&self) -> String<PLACE_BYTES> {
        let bytes = self.place.iter().map(|byte| byte.load(Ordering::Relaxed));
        bytes.take_while(u8::is_ascii).map(char::from).take_while(|letter| *letter != '\0').collect()
    }

    /// Any change of one number or byte changes it; memory that was never written matches by a chance of 2^-32.
    fn sum_now(&self) -> u32 {
        let words = [&self.reason, &self.task, &self.at_ms].into_iter().chain(&self.registers);
        let words = words.map(|word| word.load(Ordering::Relaxed));
        let bytes = self.place.iter().map(|byte| u32::from(byte.load(Ordering::Relaxed)));
        words.chain(bytes).fold(MARK, |sum, word| sum.rotate_left(5) ^ word.wrapping_mul(0x9E37_79B1))
    }
}
