//! The processor's state, and the interface for the chip round it.

use crate::bus::Bus;
use crate::cache::Cache;
use crate::depths::Depths;
use crate::exceptions::Exceptions;
use crate::mpu::Mpu;
use crate::psr::Flags;
use crate::registers::Control;
use crate::systick::SysTick;

/// How many instructions the trace keeps.
pub const TRACED: usize = 32;

/// Why the processor stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It ran, and can go on: the limit is reached, or the bus asked for attention.
    Ran,
    /// WFI or WFE waits: nothing happens until an event, an interrupt's line or [`Core::next_event`].
    Sleeping,
    /// AIRCR.SYSRESETREQ: the chip resets all, and then calls [`Core::reset`].
    ResetRequested,
    /// A fault in a fault: only a reset helps, for example the watchdog's.
    Lockup,
    /// BKPT with its number, if [`Core::stop_at_breakpoints`] was asked for. The program counter is at it; [`Core::skip`] goes on
    /// behind it.
    Breakpoint(u8),
    /// A fault's handler is the next to be entered, if [`Core::stop_at_faults`] was asked for; [`Core::fault_status`] has the cause.
    /// The program counter is where the handler would return to: what faulted, or behind a store that was told late. The stack
    /// pointer is below the frame that the entry stacked; the other registers are as they were.
    Fault,
    /// A register of the processor's own at this address, which the model does not have, was accessed. The instruction is done,
    /// as if it read zero and ignored writes.
    Unmodelled(u32),
}

#[expect(clippy::struct_excessive_bools, reason = "bits of registers")]
/// The processor. Public methods are the chip's; all times are cycles of its clock (HCLK).
pub struct Core {
    /// Registers 0 to 14; 13 is the stack pointer in use. 15 is the executed instruction's address and 4.
    pub(crate) r: [u32; 16],
    /// The stack pointer that is not in use.
    pub(crate) other_sp: u32,
    /// The address of the instruction that comes next, or that is executed now.
    pub(crate) pc: u32,
    /// The address after the executed instruction.
    pub(crate) next: u32,
    pub(crate) flags: Flags,
    /// `ITSTATE` for the next instruction, and for the one executed.
    pub(crate) it: u8,
    pub(crate) it_now: u8,
    /// EPSR.T: cleared, every instruction is a fault.
    pub(crate) thumb: bool,
    /// The current exception's number; 0 is thread mode.
    pub(crate) ipsr: u16,
    pub(crate) primask: bool,
    pub(crate) faultmask: bool,
    pub(crate) basepri: u8,
    /// `CONTROL.nPRIV`, `SPSEL` and `FPCA`.
    pub(crate) unprivileged: bool,
    pub(crate) process_stack: bool,
    pub(crate) fp_active: bool,
    /// The single-precision registers.
    pub(crate) s: [u32; 32],
    pub(crate) fpscr: u32,
    /// Floating-point instructions need no check: access allowed, no lazy state, context active.
    pub(crate) fp_ready: bool,
    /// The local exclusive monitor is open.
    pub(crate) exclusive: bool,
    pub(crate) event: bool,
    pub(crate) sleeping: Option<Sleep>,
    pub(crate) locked_up: bool,
    pub(crate) cycles: u64,
    /// The next moment at which more than an instruction is to be done.
    pub(crate) deadline: u64,
    pub(crate) until: u64,
    /// The bus asked for attention.
    pub(crate) leave: bool,
    /// The pipeline was refilled: the next fetch is from a new place.
    pub(crate) branched: bool,
    /// The register that the last instruction wrote, for the timing of loads and stores: see [`crate::timing`].
    pub(crate) previous: u8,
    /// An exception's entry (or tail-chaining) is under way: the frame is on the stack, the vector not yet chosen.
    pub(crate) entering: Option<u32>,
    /// [`Core::step`] stops behind an entry.
    pub(crate) single: bool,
    pub(crate) unmodelled: Option<u32>,
    pub(crate) exceptions: Exceptions,
    pub(crate) control: Control,
    pub(crate) systick: SysTick,
    pub(crate) mpu: Mpu,
    /// By the top byte of an address: whether a data access needs more than the bus.
    pub(crate) slow: [bool; 256],
    pub(crate) cache: Cache,
    trace: [u32; TRACED],
    traced: u64,
    pub(crate) breakpoints_stop: bool,
    pub(crate) faults_stop: bool,
    pub(crate) slept: u64,
    pub(crate) cyccnt_sleeps: bool,
    pub(crate) depths: Depths,
}

/// Which instruction sleeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sleep {
    Interrupt,
    Event,
}

impl Core {
    /// A processor with this many interrupt lines (at most 240; the STM32F405 has 82) and bits of priority (3 to 8; 4 there).
    pub fn new(lines: u16, priority_bits: u8) -> Self {
        Core {
            r: [0; 16],
            other_sp: 0,
            pc: 0,
            next: 0,
            flags: Flags::default(),
            it: 0,
            it_now: 0,
            thumb: true,
            ipsr: 0,
            primask: false,
            faultmask: false,
            basepri: 0,
            unprivileged: false,
            process_stack: false,
            fp_active: false,
            s: [0; 32],
            fpscr: 0,
            fp_ready: false,
            exclusive: false,
            event: false,
            sleeping: None,
            locked_up: false,
            cycles: 0,
            deadline: 0,
            until: 0,
            leave: false,
            branched: true,
            previous: 0x1F,
            entering: None,
            single: false,
            unmodelled: None,
            exceptions: Exceptions::new(lines, priority_bits),
            control: Control::default(),
            systick: SysTick::default(),
            mpu: Mpu::default(),
            slow: slow_regions(false),
            cache: Cache::default(),
            trace: [0; TRACED],
            traced: 0,
            breakpoints_stop: false,
            faults_stop: false,
            slept: 0,
            cyccnt_sleeps: true,
            depths: Depths::default(),
        }
    }

    /// Reset: all registers get their values, stack pointer and program counter come from `vectors` (the chip's boot address).
    /// The count of cycles goes on; interrupt lines are low until the chip sets them again.
    pub fn reset(&mut self, bus: &mut impl Bus, vectors: u32) {
        let fresh = Core::new(self.exceptions.lines(), self.exceptions.priority_bits());
        let old = core::mem::replace(self, fresh);
        self.cycles = old.cycles;
        self.trace = old.trace;
        self.traced = old.traced;
        self.breakpoints_stop = old.breakpoints_stop;
        self.faults_stop = old.faults_stop;
        self.cyccnt_sleeps = old.cyccnt_sleeps;
        self.slept = old.slept;
        self.depths = old.depths;
        self.systick.divider = old.systick.divider;
        self.control.vtor = 0;
        self.r[14] = 0xFFFF_FFFF;
        self.fpscr = 0;
        let word = |bus: &mut _, address| Bus::read(bus, address, crate::Size::Word, old.cycles);
        match (word(bus, vectors), word(bus, vectors.wrapping_add(4))) {
            (Ok(stack), Ok(entry)) => {
                self.r[13] = stack & !3;
                self.depths.begin(self.r[13]);
                self.pc = entry & !1;
                self.thumb = entry & 1 == 1;
            }
            _ => self.locked_up = true,
        }
    }

    /// Cycles of the processor's clock since it was made, sleep included.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Instructions since it was made.
    pub fn instructions(&self) -> u64 {
        self.traced
    }

    /// Cycles that it slept of these.
    pub fn slept(&self) -> u64 {
        self.slept
    }

    /// How many bytes of the main stack this exception alone took at its deepest, its frame included, in all that was run; 0 is
    /// thread mode. Interrupts count on their own.
    pub fn stack_depth(&self, exception: u16) -> u32 {
        self.depths.of(exception)
    }

    /// Whether WFI or WFE waits.
    pub fn is_sleeping(&self) -> bool {
        self.sleeping.is_some()
    }

    /// `SCR.SLEEPDEEP`: whether sleep is the chip's stop or standby mode.
    pub fn sleeps_deeply(&self) -> bool {
        self.control.scr & 4 != 0
    }

    /// The moment (in [`Core::cycles`]) of the next event of the processor's own: `SysTick`'s, if it interrupts.
    pub fn next_event(&self) -> Option<u64> {
        self.systick.next_interrupt()
    }

    /// Time goes on to `cycle` without instructions: sleep, or a processor that stands still.
    pub fn advance_to(&mut self, cycle: u64) {
        let passed = cycle.saturating_sub(self.cycles);
        if self.sleeping.is_some() {
            self.slept += passed;
        }
        self.cycles += passed;
        self.deadline = 0;
    }

    /// An interrupt line's level: while high, the interrupt is made pending (again after its handler returned).
    pub fn set_line(&mut self, interrupt: u16, high: bool) {
        if self.exceptions.set_line(interrupt, high) {
            self.pended();
        }
    }

    /// An interrupt by a pulse.
    pub fn set_pending(&mut self, interrupt: u16) {
        if self.exceptions.pend(interrupt + 16) {
            self.pended();
        }
    }

    /// The non-maskable interrupt (of an STM32: the clock security system).
    pub fn set_nmi(&mut self) {
        if self.exceptions.pend(crate::exceptions::NMI) {
            self.pended();
        }
    }

    /// Something became pending: it is looked at before the next instruction, and is an event if `SCR.SEVONPEND` says so.
    pub(crate) fn pended(&mut self) {
        if self.control.scr & 0x10 != 0 {
            self.event = true;
        }
        self.deadline = 0;
    }

    /// An event for WFE from outside (EXTI in event mode).
    pub fn event(&mut self) {
        self.event = true;
        self.deadline = 0;
    }

    /// Goes on behind a breakpoint.
    pub fn skip(&mut self) {
        self.pc = self.pc.wrapping_add(2);
    }

    /// Whether BKPT ends a run with [`Outcome::Breakpoint`] (for semihosting); at first it is what it is without a debugger: a
    /// `HardFault`.
    pub fn stop_at_breakpoints(&mut self, on: bool) {
        self.breakpoints_stop = on;
    }

    /// Whether a fault ends a run with [`Outcome::Fault`] before its handler is entered; at first the program's own handler has it.
    pub fn stop_at_faults(&mut self, on: bool) {
        self.faults_stop = on;
    }

    /// Discards the decoded instructions of these bytes, which DMA or the flash controller changed.
    pub fn forget_code(&mut self, address: u32, bytes: u32) {
        self.cache.forget(address, bytes);
    }

    /// Whether CYCCNT counts in sleep (`DBGMCU_CR.DBG_SLEEP` of an STM32); at first it does not.
    pub fn count_in_sleep(&mut self, on: bool) {
        self.cyccnt_sleeps = !on;
    }

    /// By how much the chip divides the processor's clock for `SysTick`'s other clock source (STM32: 8, as at first).
    pub fn divide_systick(&mut self, divider: u32) {
        self.systick.divider = u64::from(divider.max(1));
    }

    /// A register by number: 0 to 12, 13 the stack pointer in use, 14 LR, 15 the address of the next instruction.
    pub fn register(&self, number: u8) -> u32 {
        if number == 15 { self.pc } else { self.r[usize::from(number & 15)] }
    }

    /// Sets a register, as [`Core::register`] numbers them.
    pub fn set_register(&mut self, number: u8, value: u32) {
        match number {
            13 => self.r[13] = value & !3,
            15 => {
                self.pc = value & !1;
                self.branched = true;
            }
            _ => self.r[usize::from(number & 15)] = value,
        }
    }

    /// A single-precision register's bits, 0 to 31.
    pub fn float(&self, number: u8) -> u32 {
        self.s[usize::from(number & 31)]
    }

    /// The program status: APSR, IPSR and EPSR as MRS shows them with all bits.
    pub fn xpsr(&self) -> u32 {
        self.flags.apsr() | crate::psr::epsr(self.it, self.thumb) | u32::from(self.ipsr)
    }

    /// The floating-point status.
    pub fn fpscr(&self) -> u32 {
        self.fpscr
    }

    /// Main and process stack pointer.
    pub fn stacks(&self) -> (u32, u32) {
        if self.uses_process_stack() { (self.other_sp, self.r[13]) } else { (self.r[13], self.other_sp) }
    }

    /// CFSR, HFSR, MMFAR, BFAR, for the report of a fault.
    pub fn fault_status(&self) -> [u32; 4] {
        [self.control.cfsr, self.control.hfsr, self.control.mmfar, self.control.bfar]
    }

    /// The addresses of the last instructions, oldest first; zeros before the first.
    pub fn trace(&self) -> [u32; TRACED] {
        let mut ordered = self.trace;
        ordered.rotate_left(self.traced as usize % TRACED);
        ordered
    }

    #[inline(always)]
    pub(crate) fn note(&mut self, pc: u32) {
        self.trace[self.traced as usize % TRACED] = pc;
        self.traced += 1;
    }

    pub(crate) fn uses_process_stack(&self) -> bool {
        self.process_stack && self.ipsr == 0
    }

    pub(crate) fn privileged(&self) -> bool {
        self.ipsr != 0 || !self.unprivileged
    }
}

/// Which sixteenths of a gibibyte are the processor's own or bit-band aliases; with the MPU on, all need a look.
pub(crate) fn slow_regions(mpu: bool) -> [bool; 256] {
    let mut slow = [mpu; 256];
    for top in [0x22, 0x23, 0x42, 0x43, 0xE0] {
        slow[top] = true;
    }
    slow
}
