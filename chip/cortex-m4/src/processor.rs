//! The processor's state, and its interface.

use crate::bus::Bus;
use crate::cache::Cache;
use crate::depths::Depths;
use crate::exceptions::Exceptions;
use crate::mpu::Mpu;
use crate::psr::Flags;
use crate::registers::Control;
use crate::systick::SysTick;

/// Instructions of the trace.
pub const TRACED: usize = 32;

/// The reason of a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Can go on: limit reached, or the bus asked for attention.
    Ran,
    /// WFI or WFE waits for an event, an interrupt's line or [`Core::next_event`].
    Sleeping,
    /// AIRCR.SYSRESETREQ: the chip resets all, then calls [`Core::reset`].
    ResetRequested,
    /// A fault in a fault: only a reset helps.
    Lockup,
    /// BKPT with its number, after [`Core::stop_at_breakpoints`]. The program counter is at it; [`Core::skip`] goes on behind
    /// it.
    Breakpoint(u8),
    /// A fault's handler comes next, after [`Core::stop_at_faults`]; [`Core::fault_status`] has the cause. The program counter
    /// is the handler's return address: what faulted, or behind a store reported late. The stack pointer is below the entry's
    /// frame.
    Fault,
    /// An access to an unmodelled register of the processor. It read zero, or was ignored.
    Unmodelled(u32),
}

#[expect(clippy::struct_excessive_bools, reason = "bits of registers")]
/// The processor. Public methods are the chip's; times are cycles of HCLK.
pub struct Core {
    /// Registers 0 to 14; 13 is the stack pointer in use. 15 is the executed instruction's address and 4.
    pub(crate) r: [u32; 16],
    pub(crate) other_sp: u32,
    /// Next, or executed now.
    pub(crate) pc: u32,
    pub(crate) next: u32,
    pub(crate) flags: Flags,
    /// `ITSTATE` of the next instruction, and of the executed one.
    pub(crate) it: u8,
    pub(crate) it_now: u8,
    /// EPSR.T: cleared, every instruction is a fault.
    pub(crate) thumb: bool,
    /// Current exception; 0 is thread mode.
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
    /// No check needed: access allowed, no lazy state, context active.
    pub(crate) fp_ready: bool,
    /// Open local monitor.
    pub(crate) exclusive: bool,
    pub(crate) event: bool,
    pub(crate) sleeping: Option<Sleep>,
    pub(crate) locked_up: bool,
    pub(crate) cycles: u64,
    /// Next moment with more to do than an instruction.
    pub(crate) deadline: u64,
    pub(crate) until: u64,
    /// The bus asked for attention.
    pub(crate) leave: bool,
    /// The next fetch is from a new place.
    pub(crate) branched: bool,
    /// Written last: see [`crate::timing`].
    pub(crate) previous: u8,
    /// Entry or tail-chaining under way: stacked, without a vector yet.
    pub(crate) entering: Option<u32>,
    /// Stops [`Core::step`] behind an entry.
    pub(crate) single: bool,
    pub(crate) unmodelled: Option<u32>,
    pub(crate) exceptions: Exceptions,
    pub(crate) control: Control,
    pub(crate) systick: SysTick,
    pub(crate) mpu: Mpu,
    /// Slow accesses by an address's top byte: they need more than the bus.
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
    /// A processor with interrupt lines (at most 240; STM32F405: 82) and bits of priority (3 to 8; there 4).
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

    /// Stack pointer and program counter come from `vectors` (the boot address). Cycles go on; interrupt lines are low until
    /// set again.
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

    /// Cycles of its clock, sleep included.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Instructions since it was made.
    pub fn instructions(&self) -> u64 {
        self.traced
    }

    /// Cycles of sleep.
    pub fn slept(&self) -> u64 {
        self.slept
    }

    /// Bytes of the main stack that this exception alone took at its deepest, frame included; 0 is thread mode. Interrupts
    /// count on their own.
    pub fn stack_depth(&self, exception: u16) -> u32 {
        self.depths.of(exception)
    }

    /// Whether WFI or WFE waits.
    pub fn is_sleeping(&self) -> bool {
        self.sleeping.is_some()
    }

    /// `SCR.SLEEPDEEP`: the chip's stop or standby.
    pub fn sleeps_deeply(&self) -> bool {
        self.control.scr & 4 != 0
    }

    /// The next event of its own, in cycles: `SysTick`'s, if it interrupts.
    pub fn next_event(&self) -> Option<u64> {
        self.systick.next_interrupt()
    }

    /// Time without instructions: sleep, or standstill.
    pub fn advance_to(&mut self, cycle: u64) {
        let passed = cycle.saturating_sub(self.cycles);
        if self.sleeping.is_some() {
            self.slept += passed;
        }
        self.cycles += passed;
        self.deadline = 0;
    }

    /// While high, the interrupt is pending (again after its handler).
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

    /// NMI (STM32: the clock security system).
    pub fn set_nmi(&mut self) {
        if self.exceptions.pend(crate::exceptions::NMI) {
            self.pended();
        }
    }

    /// Looked at before the next instruction; an event if `SCR.SEVONPEND`.
    pub(crate) fn pended(&mut self) {
        if self.control.scr & 0x10 != 0 {
            self.event = true;
        }
        self.deadline = 0;
    }

    /// An event for WFE (EXTI in event mode).
    pub fn event(&mut self) {
        self.event = true;
        self.deadline = 0;
    }

    /// Goes on behind a breakpoint.
    pub fn skip(&mut self) {
        self.pc = self.pc.wrapping_add(2);
    }

    /// BKPT ends a run with [`Outcome::Breakpoint`]; by default it is a `HardFault`.
    pub fn stop_at_breakpoints(&mut self, on: bool) {
        self.breakpoints_stop = on;
    }

    /// A fault ends a run with [`Outcome::Fault`] before its handler; off by default.
    pub fn stop_at_faults(&mut self, on: bool) {
        self.faults_stop = on;
    }

    /// Changed by DMA or the flash controller.
    pub fn forget_code(&mut self, address: u32, bytes: u32) {
        self.cache.forget(address, bytes);
    }

    /// CYCCNT counts in sleep (`DBGMCU_CR.DBG_SLEEP`); off by default.
    pub fn count_in_sleep(&mut self, on: bool) {
        self.cyccnt_sleeps = !on;
    }

    /// Divider of `SysTick`'s other clock source (STM32: 8, the default).
    pub fn divide_systick(&mut self, divider: u32) {
        self.systick.divider = u64::from(divider.max(1));
    }

    /// 0 to 12, 13 the stack pointer in use, 14 LR, 15 the next instruction's address.
    pub fn register(&self, number: u8) -> u32 {
        if number == 15 { self.pc } else { self.r[usize::from(number & 15)] }
    }

    /// Numbered as in [`Core::register`].
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

    /// Bits; 0 to 31.
    pub fn float(&self, number: u8) -> u32 {
        self.s[usize::from(number & 31)]
    }

    /// APSR, IPSR and EPSR.
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

    /// CFSR, HFSR, MMFAR, BFAR.
    pub fn fault_status(&self) -> [u32; 4] {
        [self.control.cfsr, self.control.hfsr, self.control.mmfar, self.control.bfar]
    }

    /// Last instructions, oldest first; zeros before the first.
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

/// Slow regions by sixteenths of a gibibyte: the processor's own, or bit-band aliases; with the MPU on all.
pub(crate) fn slow_regions(mpu: bool) -> [bool; 256] {
    let mut slow = [mpu; 256];
    for top in [0x22, 0x23, 0x42, 0x43, 0xE0] {
        slow[top] = true;
    }
    slow
}
