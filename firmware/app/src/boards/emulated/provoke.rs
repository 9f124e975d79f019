//! Faults on purpose (`provoke=WHAT`), so that a test sees what becomes of them: when the downlink sends for the first
//! time, the task panics, or makes the processor fault, or never comes back.

use core::sync::atomic::{AtomicU8, Ordering};

/// What is to go wrong.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Fault {
    /// Nothing.
    #[default]
    None = 0,
    /// A panic in the task.
    Panic = 1,
    /// An access to memory that is not there.
    Bus = 2,
    /// The task waits for ever, so that the watchdog must notice.
    Silence = 3,
}

static FAULT: AtomicU8 = AtomicU8::new(Fault::None as u8);

impl Fault {
    /// By the name on the command line.
    pub(super) fn named(name: &str) -> Option<Self> {
        match name {
            "panic" => Some(Self::Panic),
            "bus-fault" => Some(Self::Bus),
            "silence" => Some(Self::Silence),
            _ => None,
        }
    }
}

/// Makes `fault` go wrong later.
pub(super) fn arm(fault: Fault) {
    FAULT.store(fault as u8, Ordering::Relaxed);
}

/// The place where it goes wrong.
#[expect(clippy::panic, reason = "it is the purpose")]
pub(super) async fn here() {
    /// Between the flash and the system's own memory there is nothing.
    const NOWHERE: *const u32 = core::ptr::without_provenance(0x0900_0000);
    let fault = FAULT.load(Ordering::Relaxed);
    if fault == Fault::Panic as u8 {
        panic!("provoked");
    } else if fault == Fault::Bus as u8 {
        // SAFETY: there is no memory and no device at this address, so nothing can come of it but the fault.
        unsafe { NOWHERE.read_volatile() };
    } else if fault == Fault::Silence as u8 {
        core::future::pending::<()>().await;
    }
}
