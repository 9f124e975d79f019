//! Entry into exceptions, and return from them.
//!
//! After the architecture's pseudocode (DDI 0403E, B1.5): `ExceptionEntry`, `PushStack`, `ExceptionTaken`, `ExceptionReturn`,
//! `PopStack`, `PreserveFPState`. Entry has two halves for late arrival: [`Core::interrupt`] stacks, then [`Core::enter`]
//! chooses the vector.

use crate::bus::{Bus, Size};
use crate::exceptions::{BUS_FAULT, DEBUG_MONITOR, HARD_FAULT, MEM_MANAGE, NMI, SVCALL, USAGE_FAULT};
use crate::processor::{Core, Outcome, Sleep};
use crate::psr::{epsr, it_of};
use crate::registers::{
    ASPEN, BFARVALID, BFHFNMIGN, DACCVIOL, DEBUGEVT, DIVBYZERO, FORCED, FPDSCR, IACCVIOL, IBUSERR, INVPC,
    INVSTATE, LSPACT, LSPEN, LSPERR, MLSPERR, MMARVALID, MSTKERR, MUNSTKERR, NOCP, NONBASETHRDENA, PRECISERR,
    STKALIGN, STKERR, UNALIGNED, UNDEFINSTR, UNSTKERR, VECTTBL,
};
use crate::timing;
use crate::trap::Trap;

impl Core {
    /// A fault's exception is taken, others are served.
    #[cold]
    #[inline(never)]
    pub(crate) fn trapped<B: Bus>(&mut self, bus: &mut B, trap: Trap) -> Option<Outcome> {
        self.previous = timing::NOTHING;
        match trap {
            Trap::Return(value) => {
                self.pc = self.next;
                self.return_from(bus, value);
                return None;
            }
            Trap::Reset => {
                self.pc = self.next;
                return Some(Outcome::ResetRequested);
            }
            Trap::Breakpoint(number) if self.breakpoints_stop => {
                self.it = self.it_now;
                return Some(Outcome::Breakpoint(number));
            }
            Trap::Supervisor => {
                self.pc = self.next;
                self.raise(bus, SVCALL);
                return self.locked_up.then_some(Outcome::Lockup);
            }
            _ => {}
        }
        self.it = self.it_now;
        let ignored = self.control.ccr & BFHFNMIGN != 0 && self.priority() < 0;
        if let (Trap::Bus(address), true) = (trap, ignored) {
            self.control.cfsr |= PRECISERR | BFARVALID;
            self.control.bfar = address;
            self.pc = self.next;
            return None;
        }
        let number = self.record(trap);
        self.raise(bus, number);
        self.locked_up.then_some(Outcome::Lockup)
    }

    /// Returns the exception.
    fn record(&mut self, trap: Trap) -> u16 {
        let control = &mut self.control;
        let (bits, number) = match trap {
            Trap::Undefined => (UNDEFINSTR, USAGE_FAULT),
            Trap::InvalidState => (INVSTATE, USAGE_FAULT),
            Trap::NoCoprocessor => (NOCP, USAGE_FAULT),
            Trap::Unaligned => (UNALIGNED, USAGE_FAULT),
            Trap::DivideByZero => (DIVBYZERO, USAGE_FAULT),
            Trap::Bus(address) => {
                control.bfar = address;
                (PRECISERR | BFARVALID, BUS_FAULT)
            }
            Trap::FetchBus => (IBUSERR, BUS_FAULT),
            Trap::LazyBus => (LSPERR, BUS_FAULT),
            Trap::Memory(address) => {
                control.mmfar = address;
                (DACCVIOL | MMARVALID, MEM_MANAGE)
            }
            Trap::FetchMemory => (IACCVIOL, MEM_MANAGE),
            Trap::LazyMemory => (MLSPERR, MEM_MANAGE),
            Trap::Breakpoint(_) => {
                let monitor = self.exceptions.grouped(self.exceptions.priority(DEBUG_MONITOR));
                let monitored = control.monitors() && monitor < self.priority();
                if monitored {
                    return DEBUG_MONITOR;
                }
                self.control.hfsr |= DEBUGEVT;
                return HARD_FAULT;
            }
            Trap::Supervisor | Trap::Return(_) | Trap::Reset => (0, HARD_FAULT),
        };
        control.cfsr |= bits;
        number
    }

    /// Taken at once, or escalated to `HardFault`, or the end.
    fn raise<B: Bus>(&mut self, bus: &mut B, number: u16) {
        let priority = self.priority();
        let fits = self.exceptions.enabled.has(number)
            && self.exceptions.grouped(self.exceptions.priority(number)) < priority;
        if fits {
            self.exceptions.pend(number);
            self.interrupt(bus, number);
            return;
        }
        if priority < 0 {
            self.locked_up = true;
            return;
        }
        if number != HARD_FAULT {
            self.control.hfsr |= FORCED;
        }
        self.exceptions.pend(HARD_FAULT);
        self.interrupt(bus, HARD_FAULT);
    }

    /// A fault of an exception's own stacking: becomes pending, chosen with the vector.
    fn derived(&mut self, number: u16, bits: u32) {
        self.control.cfsr |= bits;
        let fits = self.exceptions.enabled.has(number)
            && self.exceptions.grouped(self.exceptions.priority(number)) < self.priority();
        if fits {
            self.exceptions.pend(number);
        } else {
            self.control.hfsr |= FORCED;
            self.exceptions.pend(HARD_FAULT);
        }
    }

    /// First half of an entry: stacking.
    pub(crate) fn interrupt<B: Bus>(&mut self, bus: &mut B, _number: u16) {
        let mut exc_return = if self.ipsr != 0 {
            0xFFFF_FFF1
        } else if self.process_stack {
            0xFFFF_FFFD
        } else {
            0xFFFF_FFF9
        };
        if self.fp_active {
            exc_return &= !0x10;
        }
        self.cycles += timing::ENTRY;
        self.depths.interrupted(self.r[13]);
        self.push_frame(bus);
        self.entering = Some(exc_return);
        self.deadline = 0;
    }

    fn push_frame<B: Bus>(&mut self, bus: &mut B) {
        let float = self.fp_active;
        let size = if float { 0x68 } else { 0x20 };
        let forced = float || self.control.ccr & STKALIGN != 0;
        let padded = forced && self.r[13] & 4 != 0;
        let frame = self.r[13].wrapping_sub(size) & if forced { !7 } else { !3 };
        let privileged = self.privileged();
        self.r[13] = frame;
        let xpsr =
            self.flags.apsr() | epsr(self.it, self.thumb) | u32::from(self.ipsr) | u32::from(padded) << 9;
        let words = [self.r[0], self.r[1], self.r[2], self.r[3], self.r[12], self.r[14], self.pc, xpsr];
        let mut result = self.stack_words(bus, frame, &words, privileged);
        if float && result.is_ok() {
            if self.control.fpccr & LSPEN == 0 {
                let registers: [u32; 16] = core::array::from_fn(|i| self.s[i]);
                self.cycles += timing::FLOAT_STATE;
                result =
                    self.stack_words(bus, frame.wrapping_add(0x20), &registers, privileged).and_then(|()| {
                        self.stack_words(bus, frame.wrapping_add(0x60), &[self.fpscr], privileged)
                    });
            } else {
                self.prepare_lazily(frame);
            }
        }
        match result {
            Ok(()) => {}
            Err(Trap::Memory(_)) => self.derived(MEM_MANAGE, MSTKERR),
            Err(_) => self.derived(BUS_FAULT, STKERR),
        }
    }

    fn stack_words<B: Bus>(
        &mut self,
        bus: &mut B,
        frame: u32,
        words: &[u32],
        privileged: bool,
    ) -> Result<(), Trap> {
        // Stacking is precise.
        let imprecise = self.control.cfsr & crate::registers::IMPRECISERR;
        let pending = self.exceptions.pending.has(BUS_FAULT);
        for (at, &word) in (frame..).step_by(4).zip(words) {
            let actlr = core::mem::replace(&mut self.control.actlr, 2);
            let stored = self.write_slowly(bus, at, Size::Word, word, privileged);
            self.control.actlr = actlr;
            stored?;
        }
        assert_eq!(imprecise, self.control.cfsr & crate::registers::IMPRECISERR);
        assert_eq!(pending, self.exceptions.pending.has(BUS_FAULT));
        Ok(())
    }

    /// `UpdateFPCCR`: space is reserved; registers follow when a handler touches them.
    fn prepare_lazily(&mut self, frame: u32) {
        self.control.fpcar = frame.wrapping_add(0x20) & !7;
        let priority = self.priority();
        let exceptions = &self.exceptions;
        let ready = |number| {
            u32::from(
                exceptions.enabled.has(number) && exceptions.grouped(exceptions.priority(number)) < priority,
            )
        };
        let monitor = u32::from(
            self.control.monitors() && exceptions.grouped(exceptions.priority(DEBUG_MONITOR)) < priority,
        );
        self.control.fpccr = self.control.fpccr & (ASPEN | LSPEN)
            | LSPACT
            | u32::from(!self.privileged()) << 1
            | u32::from(self.ipsr == 0) << 3
            | u32::from(priority > -1) << 4
            | ready(MEM_MANAGE) << 5
            | ready(BUS_FAULT) << 6
            | monitor << 8;
        self.fp_ready = false;
    }

    /// Second half: the most urgent exception's vector.
    pub(crate) fn enter<B: Bus>(&mut self, bus: &mut B) {
        let Some(exc_return) = self.entering else { return };
        let Some(number) = self.exceptions.first() else {
            self.entering = None;
            self.depths.resumed();
            self.unstack(bus, exc_return);
            return;
        };
        self.entering = None;
        let vector = self.control.vtor.wrapping_add(u32::from(number) * 4);
        let read = bus.read(vector, Size::Word, self.cycles);
        self.cycles += u64::from(bus.take_wait());
        if self.ipsr == 0 && self.process_stack {
            core::mem::swap(&mut self.r[13], &mut self.other_sp);
        }
        self.depths.entered(number, self.r[13]);
        self.exceptions.activate(number);
        self.ipsr = number;
        self.r[14] = exc_return;
        self.process_stack = false;
        self.fp_active = false;
        self.fp_ready = false;
        self.it = 0;
        self.exclusive = false;
        self.event = true;
        self.branched = true;
        self.deadline = 0;
        if let Ok(handler) = read {
            self.pc = handler & !1;
            self.thumb = handler & 1 == 1;
        } else {
            self.control.hfsr |= VECTTBL;
            self.exceptions.active.put(number, false);
            self.exceptions.pend(number);
            if number == HARD_FAULT || number == NMI || self.priority() < 0 {
                self.locked_up = true;
                return;
            }
            self.exceptions.pend(HARD_FAULT);
            self.ipsr = 0;
            self.entering = Some(exc_return);
        }
    }

    fn return_from<B: Bus>(&mut self, bus: &mut B, value: u32) {
        let returning = self.ipsr;
        let nested = self.exceptions.active.iter().count();
        let good = match value & 15 {
            _ if value & 0x0FFF_FFE0 != 0x0FFF_FFE0 => false,
            1 => nested != 1,
            9 | 13 => nested == 1 || self.control.ccr & NONBASETHRDENA != 0,
            _ => false,
        };
        if !self.exceptions.active.has(returning) || !good {
            self.leave_handler(returning);
            self.bad_return(bus, value);
            return;
        }
        self.leave_handler(returning);
        self.depths.returned();
        self.exclusive = false;
        self.event = true;
        if self.due_after_return(value) {
            self.cycles += timing::TAIL_CHAIN;
            self.entering = Some(value);
            self.deadline = 0;
            return;
        }
        self.cycles += timing::RETURN;
        self.depths.resumed();
        self.unstack(bus, value);
        if value & 8 != 0 && self.control.scr & 2 != 0 && self.ipsr == 0 {
            self.sleeping = Some(Sleep::Interrupt);
        }
    }

    /// Tail-chaining: it pre-empts the code to return to.
    fn due_after_return(&self, _value: u32) -> bool {
        self.due(self.priority()).is_some()
    }

    fn leave_handler(&mut self, number: u16) {
        self.exceptions.deactivate(number);
        if number != NMI {
            self.faultmask = false;
        }
        self.deadline = 0;
    }

    /// Refused: `UsageFault` INVPC, with the frame still stacked.
    fn bad_return<B: Bus>(&mut self, _bus: &mut B, value: u32) {
        self.derived(USAGE_FAULT, INVPC);
        self.entering = Some(value | 0xF000_0000);
        self.cycles += timing::TAIL_CHAIN;
        if self.exceptions.first().is_none() {
            self.locked_up = true;
        }
    }

    fn unstack<B: Bus>(&mut self, bus: &mut B, value: u32) {
        let to_thread = value & 8 != 0;
        let to_process = value & 4 != 0 && to_thread;
        let float = value & 0x10 == 0;
        // Handler mode has used the main stack.
        let frame = if to_process { self.other_sp } else { self.r[13] };
        let frame = if self.uses_process_stack() { self.r[13] } else { frame };
        let privileged = !to_thread || !self.unprivileged;
        let mut words = [0; 8];
        let mut result = self.unstack_words(bus, frame, &mut words, privileged);
        if float && result.is_ok() {
            result = self.unstack_float(bus, frame, privileged);
        }
        let [r0, r1, r2, r3, r12, lr, pc, xpsr] = words;
        let size = if float { 0x68 } else { 0x20 };
        let forced = float || self.control.ccr & STKALIGN != 0;
        let padding = if forced && xpsr & 0x200 != 0 { 4 } else { 0 };
        let was_process = self.uses_process_stack();
        let stack = frame.wrapping_add(size) | padding;
        if let Err(trap) = result {
            match trap {
                Trap::Memory(_) => self.derived(MEM_MANAGE, MUNSTKERR),
                _ => self.derived(BUS_FAULT, UNSTKERR),
            }
            self.entering = Some(value);
            self.deadline = 0;
            return;
        }
        if to_process == was_process {
            self.r[13] = stack;
        } else {
            self.other_sp = self.r[13];
            self.r[13] = stack;
        }
        self.ipsr = (xpsr & 0x1FF) as u16;
        self.process_stack = to_process || !to_thread && self.process_stack;
        self.fp_active = float;
        self.fp_ready = false;
        [self.r[0], self.r[1], self.r[2], self.r[3]] = [r0, r1, r2, r3];
        self.r[12] = r12;
        self.r[14] = lr;
        self.flags.set_nzcvq(xpsr);
        self.flags.set_ge(xpsr);
        self.it = it_of(xpsr);
        self.thumb = xpsr >> 24 & 1 == 1;
        self.pc = pc & !1;
        self.branched = true;
        self.deadline = 0;
        if to_thread != (self.ipsr == 0) {
            // The frame's mode is wrong: the fault is stacked anew.
            self.ipsr = if to_thread { 0 } else { self.ipsr };
            self.push_frame(bus);
            self.derived(USAGE_FAULT, INVPC);
            self.entering = Some(value | 0xF000_0000);
        }
    }

    fn unstack_words<B: Bus>(
        &mut self,
        bus: &mut B,
        frame: u32,
        words: &mut [u32],
        privileged: bool,
    ) -> Result<(), Trap> {
        for (at, word) in (frame..).step_by(4).zip(words) {
            *word = self.read_slowly(bus, at, Size::Word, privileged)?;
        }
        Ok(())
    }

    fn unstack_float<B: Bus>(&mut self, bus: &mut B, frame: u32, privileged: bool) -> Result<(), Trap> {
        if self.control.fpccr & LSPACT != 0 {
            // Never stored: the registers hold them.
            self.control.fpccr &= !LSPACT;
            return Ok(());
        }
        let mut registers = [0; 17];
        self.cycles += timing::FLOAT_STATE;
        self.unstack_words(bus, frame.wrapping_add(0x20), &mut registers, privileged)?;
        self.s[..16].copy_from_slice(&registers[..16]);
        self.fpscr = registers[16] & crate::registers::FPSCR;
        Ok(())
    }

    /// Access, saved state of the interrupted code, a context of its own.
    #[cold]
    #[inline(never)]
    pub(crate) fn prepare_float<B: Bus>(&mut self, bus: &mut B) -> Result<(), Trap> {
        let allowed = match self.control.cpacr >> 20 & 3 {
            1 => self.privileged(),
            3 => true,
            _ => false,
        };
        if !allowed {
            return Err(Trap::NoCoprocessor);
        }
        if self.control.fpccr & LSPACT != 0 {
            let registers: [u32; 17] = core::array::from_fn(|i| if i < 16 { self.s[i] } else { self.fpscr });
            let privileged = self.control.fpccr & 2 == 0;
            self.cycles += timing::FLOAT_STATE;
            let stored = self.stack_words(bus, self.control.fpcar, &registers, privileged);
            stored.map_err(|trap| match trap {
                Trap::Memory(_) => Trap::LazyMemory,
                _ => Trap::LazyBus,
            })?;
            self.control.fpccr &= !LSPACT;
        }
        if self.control.fpccr & ASPEN != 0 && !self.fp_active {
            self.fpscr = self.fpscr & !FPDSCR | self.control.fpdscr & FPDSCR;
            self.fp_active = true;
        }
        // Remembered only if the same for unprivileged access.
        self.fp_ready = self.control.cpacr >> 20 & 3 == 3;
        Ok(())
    }
}
