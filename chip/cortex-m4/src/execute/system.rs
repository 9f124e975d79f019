//! System instructions, and branches by register.

use crate::op::Op;
use crate::processor::{Core, Sleep};
use crate::timing::REFILL_NEAR;
use crate::trap::Trap;

/// Numbers of special registers (`SYSm`).
mod special {
    pub(super) const MSP: u8 = 8;
    pub(super) const PSP: u8 = 9;
    pub(super) const PRIMASK: u8 = 16;
    pub(super) const BASEPRI: u8 = 17;
    pub(super) const BASEPRI_MAX: u8 = 18;
    pub(super) const FAULTMASK: u8 = 19;
    pub(super) const CONTROL: u8 = 20;
}

impl Core {
    pub(super) fn execute_system(&mut self, op: Op) -> Result<(), Trap> {
        match op {
            Op::CallExchange { m } => {
                let target = self.get(m);
                self.r[14] = self.next | 1;
                self.exchange_call(target);
            }
            Op::MovPc { m } => self.jump(self.get(m), REFILL_NEAR),
            Op::AddPc { m } => self.jump(self.get(15).wrapping_add(self.get(m)), REFILL_NEAR),
            Op::Wfe => {
                if !core::mem::take(&mut self.event) {
                    self.sleep(Sleep::Event);
                }
            }
            Op::Wfi => self.sleep(Sleep::Interrupt),
            Op::Sev => self.event = true,
            Op::Barrier { flush } => {
                if flush {
                    self.branched = true;
                    self.cycles += REFILL_NEAR;
                }
                self.deadline = 0;
            }
            Op::Cps { disable, primask, faultmask } => self.change_masks(disable, primask, faultmask),
            Op::MoveFromSpecial { d, special } => self.set(d, self.special(special)),
            Op::MoveToSpecial { n, special, mask } => self.set_special(special, mask, self.get(n)),
            Op::Svc { .. } => return Err(Trap::Supervisor),
            Op::Breakpoint { number } => return Err(Trap::Breakpoint(number)),
            Op::NoCoprocessor => return Err(Trap::NoCoprocessor),
            _ => return Err(Trap::Undefined),
        }
        Ok(())
    }

    /// BLX: never a return from an exception.
    fn exchange_call(&mut self, target: u32) {
        self.jump(target, crate::timing::REFILL_FAR);
        if target & 1 == 0 {
            self.thumb = false;
            self.deadline = 0;
        }
    }

    fn sleep(&mut self, kind: Sleep) {
        self.sleeping = Some(kind);
        self.deadline = 0;
    }

    fn change_masks(&mut self, disable: bool, primask: bool, faultmask: bool) {
        if !self.privileged() {
            return;
        }
        if primask {
            self.primask = disable;
        }
        if faultmask && (!disable || self.priority() > -1) {
            self.faultmask = disable;
        }
        self.deadline = 0;
    }

    fn special(&self, number: u8) -> u32 {
        let privileged = self.privileged();
        let (main, process) = self.stacks();
        match number {
            0..=7 => {
                let mut value = 0;
                if number & 1 != 0 {
                    value |= u32::from(self.ipsr);
                }
                if number & 4 == 0 {
                    value |= self.flags.apsr();
                }
                // EPSR reads as zero.
                value
            }
            special::MSP if privileged => main,
            special::PSP if privileged => process,
            special::PRIMASK if privileged => u32::from(self.primask),
            special::BASEPRI | special::BASEPRI_MAX if privileged => u32::from(self.basepri),
            special::FAULTMASK if privileged => u32::from(self.faultmask),
            special::CONTROL => {
                u32::from(self.unprivileged)
                    | u32::from(self.process_stack) << 1
                    | u32::from(self.fp_active) << 2
            }
            _ => 0,
        }
    }

    fn set_special(&mut self, number: u8, mask: u8, value: u32) {
        if number <= 7 {
            if number & 4 == 0 {
                if mask & 2 != 0 {
                    self.flags.set_nzcvq(value);
                }
                if mask & 1 != 0 {
                    self.flags.set_ge(value);
                }
            }
            return;
        }
        if !self.privileged() {
            return;
        }
        match number {
            special::MSP if self.uses_process_stack() => self.other_sp = value & !3,
            special::MSP => self.r[13] = value & !3,
            special::PSP if self.uses_process_stack() => self.r[13] = value & !3,
            special::PSP => self.other_sp = value & !3,
            special::PRIMASK => self.primask = value & 1 != 0,
            special::BASEPRI => self.basepri = self.exceptions.kept(value as u8),
            special::BASEPRI_MAX => {
                let value = self.exceptions.kept(value as u8);
                if value != 0 && (value < self.basepri || self.basepri == 0) {
                    self.basepri = value;
                }
            }
            special::FAULTMASK if self.priority() > -1 || value & 1 == 0 => self.faultmask = value & 1 != 0,
            special::CONTROL => self.set_control(value),
            _ => {}
        }
        self.deadline = 0;
    }

    fn set_control(&mut self, value: u32) {
        self.unprivileged = value & 1 != 0;
        if self.ipsr == 0 && self.process_stack != (value & 2 != 0) {
            self.process_stack = value & 2 != 0;
            core::mem::swap(&mut self.r[13], &mut self.other_sp);
        }
        self.fp_active = value & 4 != 0;
        self.fp_ready = false;
    }
}
