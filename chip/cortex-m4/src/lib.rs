//! The processor: an instruction-level model of the Arm Cortex-M4 with its single-precision FPU (ARMv7E-M, FPv4-SP).
//!
//! A run is deterministic: time is the count of cycles of a documented model (`timing.rs`; modelled, not measured).
//!
//! Modelled: all instructions of ARMv7E-M with FPv4-SP. Exceptions with priorities, groups, pre-emption,
//! tail-chaining, late arrival, lazy stacking of floating-point registers. Faults with their status and escalation,
//! lockup; NVIC, `SysTick`, SCB, MPU, FPU's registers, DWT's cycle counter; privilege, both stacks, masks; WFI, WFE,
//! SEV, sleep on exit; bit-band aliases; the local exclusive monitor.
//!
//! Not modelled: a debugger, FPB, ITM, TPIU, ETM, DWT's comparators and other counters (an access is
//! [`Outcome::Unmodelled`]). Also abandoned and continued instructions (LDM, STM: an interrupt waits for their end),
//! the write buffer's time, and the bus matrix. A refused store is imprecise, but reported at once. UNPREDICTABLE
//! encodings are undefined here, as far as the decoder sees it.
#![forbid(unsafe_code)]
#![expect(clippy::inline_always, reason = "the path of every instruction: measured, a third of the speed")]
#![expect(
    clippy::many_single_char_names,
    reason = "operands are d, n, m, t and a, as in the architecture's manual"
)]

mod access;
mod bus;
mod cache;
mod control;
mod decode;
mod depths;
mod exceptions;
mod execute;
mod flow;
mod mpu;
pub mod op;
mod processor;
mod psr;
mod registers;
mod run;
mod softfloat;
mod systick;
mod timing;
mod trap;

pub use bus::{Bus, Fault, Size};
pub use decode::decode;
pub use processor::{Core, Outcome, TRACED};
