//! The system control space: SCB, NVIC, `SysTick`, MPU, FPU and debug registers, and the DWT's cycle counter.
//!
//! Addresses and reset values: `ARMv7-M` Architecture Reference Manual (DDI 0403E), chapters B3 and C1; Cortex-M4 TRM. Without
//! a debugger: no FPB, ITM, TPIU and ETM. An unmodelled access is [`crate::Outcome::Unmodelled`].

use crate::bus::Size;
use crate::exceptions::{BUS_FAULT, DEBUG_MONITOR, MEM_MANAGE, NMI, PENDSV, SVCALL, SYSTICK, USAGE_FAULT};
use crate::processor::{Core, slow_regions};
use crate::registers::FPDSCR;
use crate::trap::Trap;

/// Identification registers from `0xE000_ED40` on.
const FEATURES: [u32; 13] = [
    0x0000_0030,
    0x0000_0200,
    0x0010_0000,
    0,
    0x0010_0030,
    0,
    0x0100_0000,
    0,
    0x0110_1110,
    0x0211_2000,
    0x2123_2231,
    0x0111_1131,
    0x0131_0102,
];

const CPUID: u32 = 0x410F_C241;

impl Core {
    /// Bytes and halfwords are parts of a word's registers.
    pub(crate) fn read_own(&mut self, address: u32, size: Size) -> u32 {
        let word = self.read_register(address & !3);
        let shift = (address & 3) * 8;
        word >> shift & (u32::MAX >> (32 - 8 * size.bytes()))
    }

    /// Only priorities and fault status take less than a word.
    pub(crate) fn write_own(&mut self, address: u32, size: Size, value: u32) -> Result<(), Trap> {
        let at = address & !3;
        if size == Size::Word {
            return self.write_register(at, value);
        }
        let shift = (address & 3) * 8;
        let mask = (u32::MAX >> (32 - 8 * size.bytes())) << shift;
        let old = match at {
            0xE000_E400..0xE000_E4F0 | 0xE000_ED18..0xE000_ED24 => self.read_register(at),
            // Writing ones clears: the rest is zeros.
            0xE000_ED28 => 0,
            _ => {
                self.unmodelled = Some(address);
                self.deadline = 0;
                return Ok(());
            }
        };
        self.write_register(at, old & !mask | value << shift & mask)
    }

    fn read_register(&mut self, address: u32) -> u32 {
        let control = &self.control;
        match address {
            0xE000_1000 => 4 << 28 | control.dwt,
            0xE000_1004 => self.cyccnt(),
            0xE000_E004 => u32::from(self.exceptions.lines().saturating_sub(1) / 32),
            0xE000_E008 => control.actlr,
            0xE000_E010..=0xE000_E01C => {
                self.tick();
                self.systick.read(address - 0xE000_E010, self.cycles)
            }
            0xE000_E100..0xE000_E500 => self.read_nvic(address),
            0xE000_ED00 => CPUID,
            0xE000_ED04 => self.icsr(),
            0xE000_ED08 => control.vtor,
            0xE000_ED0C => 0xFA05_0000 | u32::from(self.exceptions.group) << 8,
            0xE000_ED10 => control.scr,
            0xE000_ED14 => control.ccr,
            0xE000_ED18..=0xE000_ED20 => {
                let first = (address - 0xE000_ED18) as u16 + 4;
                u32::from_le_bytes(core::array::from_fn(|i| self.exceptions.priority_byte(first + i as u16)))
            }
            0xE000_ED24 => self.shcsr(),
            0xE000_ED28 => control.cfsr,
            0xE000_ED2C => control.hfsr,
            0xE000_ED34 => control.mmfar,
            0xE000_ED38 => control.bfar,
            0xE000_ED40..=0xE000_ED70 => FEATURES[(address - 0xE000_ED40) as usize / 4],
            0xE000_ED88 => control.cpacr,
            0xE000_ED90..=0xE000_EDB8 => self.mpu.read(address - 0xE000_ED90).unwrap_or(0),
            // DWT_LSR (no lock); DFSR, AFSR, DHCSR and DCRDR without a debugger, STIR, MVFR2.
            0xE000_1FB4 | 0xE000_ED30 | 0xE000_ED3C | 0xE000_EDF0 | 0xE000_EDF8 | 0xE000_EF00
            | 0xE000_EF48 => 0,
            0xE000_EDFC => control.demcr,
            0xE000_EF34 => control.fpccr,
            0xE000_EF38 => control.fpcar,
            0xE000_EF3C => control.fpdscr,
            0xE000_EF40 => 0x1011_0021,
            0xE000_EF44 => 0x1100_0011,
            _ => {
                self.unmodelled = Some(address);
                self.deadline = 0;
                0
            }
        }
    }

    fn write_register(&mut self, address: u32, value: u32) -> Result<(), Trap> {
        self.deadline = 0;
        match address {
            0xE000_1000 => {
                let count = self.cyccnt();
                self.control.dwt = value & 0x0FFF_FFFF;
                self.set_cyccnt(count);
            }
            0xE000_1004 => self.set_cyccnt(value),
            0xE000_E008 => self.control.actlr = value & 0x307,
            0xE000_E010..=0xE000_E01C => {
                self.tick();
                self.systick.write(address - 0xE000_E010, value, self.cycles);
            }
            0xE000_E100..0xE000_E500 => self.write_nvic(address, value),
            0xE000_ED04 => self.write_icsr(value),
            0xE000_ED08 => self.control.vtor = value & 0xFFFF_FF80,
            0xE000_ED0C if value >> 16 == 0x05FA => {
                self.exceptions.group = (value >> 8 & 7) as u8;
                if value & 4 != 0 {
                    return Err(Trap::Reset);
                }
            }
            0xE000_ED10 => self.control.scr = value & 0x16,
            0xE000_ED14 => self.control.ccr = value & 0x31B,
            0xE000_ED18..=0xE000_ED20 => {
                for (i, byte) in value.to_le_bytes().into_iter().enumerate() {
                    self.exceptions.set_priority((address - 0xE000_ED18) as u16 + 4 + i as u16, byte);
                }
            }
            0xE000_ED24 => self.write_shcsr(value),
            0xE000_ED28 => self.control.cfsr &= !value,
            0xE000_ED2C => self.control.hfsr &= !value,
            0xE000_ED34 => self.control.mmfar = value,
            0xE000_ED38 => self.control.bfar = value,
            0xE000_ED88 => {
                self.control.cpacr = value & 0x00F0_0000;
                self.fp_ready = false;
            }
            0xE000_ED90..=0xE000_EDB8 => {
                self.mpu.write(address - 0xE000_ED90, value);
                self.slow = slow_regions(self.mpu.is_on());
                self.cache.clear();
            }
            0xE000_EDFC => {
                let count = self.cyccnt();
                self.control.demcr = value & 0x010F_07F1;
                self.set_cyccnt(count);
            }
            0xE000_EF00 => self.pend_from_software((value & 0x1FF) as u16 + 16),
            0xE000_EF34 => {
                self.control.fpccr = value & 0xC000_017B;
                self.fp_ready = false;
            }
            0xE000_EF38 => self.control.fpcar = value & !7,
            0xE000_EF3C => self.control.fpdscr = value & FPDSCR,
            // Read-only, of the debugger, with a key that is wrong; or DWT_LAR, the key to a lock that is not there.
            0xE000_1FB0
            | 0xE000_E004
            | 0xE000_ED00
            | 0xE000_ED0C
            | 0xE000_ED30
            | 0xE000_ED3C..=0xE000_ED70
            | 0xE000_EDF0..=0xE000_EDF8
            | 0xE000_EF40..=0xE000_EF48 => {}
            _ => self.unmodelled = Some(address),
        }
        Ok(())
    }

    /// `SysTick`'s zeros up to now become pending.
    pub(crate) fn tick(&mut self) {
        if self.systick.update(self.cycles) && self.exceptions.pend(SYSTICK) {
            self.pended();
        }
    }

    fn counted(&self) -> u32 {
        (self.cycles - if self.cyccnt_sleeps { self.slept } else { 0 }) as u32
    }

    /// `DWT_CTRL.CYCCNTENA`, and DEMCR.TRCENA for the whole unit.
    fn counts(&self) -> bool {
        self.control.dwt & 1 != 0 && self.control.demcr >> 24 & 1 == 1
    }

    fn cyccnt(&self) -> u32 {
        if self.counts() { self.counted().wrapping_sub(self.control.cyccnt) } else { self.control.cyccnt }
    }

    fn set_cyccnt(&mut self, value: u32) {
        self.control.cyccnt = if self.counts() { self.counted().wrapping_sub(value) } else { value };
    }

    fn pend_from_software(&mut self, number: u16) {
        if self.exceptions.pend(number) {
            self.pended();
        }
    }

    fn icsr(&self) -> u32 {
        let exceptions = &self.exceptions;
        let pending = |number| u32::from(exceptions.pending.has(number));
        let others = exceptions.active.iter().filter(|&number| number != self.ipsr).count();
        u32::from(self.ipsr)
            | u32::from(others == 0) << 11
            | u32::from(exceptions.first().unwrap_or(0)) << 12
            | u32::from(exceptions.pending.iter().any(|number| number >= 16)) << 22
            | pending(SYSTICK) << 26
            | pending(PENDSV) << 28
            | pending(NMI) << 31
    }

    fn write_icsr(&mut self, value: u32) {
        for (set, clear, number) in [(28, Some(27), PENDSV), (26, Some(25), SYSTICK), (31, None, NMI)] {
            if value >> set & 1 == 1 {
                self.pend_from_software(number);
            } else if clear.is_some_and(|clear| value >> clear & 1 == 1) {
                self.exceptions.unpend(number);
            }
        }
    }

    fn shcsr(&self) -> u32 {
        let exceptions = &self.exceptions;
        let bits = |set: &crate::exceptions::Set, places: &[(u32, u16)]| {
            places.iter().fold(0, |word, &(bit, number)| word | u32::from(set.has(number)) << bit)
        };
        bits(&exceptions.active, &ACTIVE)
            | bits(&exceptions.pending, &PENDED)
            | bits(&exceptions.enabled, &ENABLED)
    }

    fn write_shcsr(&mut self, value: u32) {
        let exceptions = &mut self.exceptions;
        for (bit, number) in ACTIVE {
            exceptions.active.put(number, value >> bit & 1 == 1);
        }
        for (bit, number) in PENDED {
            exceptions.pending.put(number, value >> bit & 1 == 1);
        }
        for (bit, number) in ENABLED {
            exceptions.enabled.put(number, value >> bit & 1 == 1);
        }
    }

    fn read_nvic(&self, address: u32) -> u32 {
        let exceptions = &self.exceptions;
        if address >= 0xE000_E400 {
            let first = (address - 0xE000_E400) as u16 + 16;
            return u32::from_le_bytes(core::array::from_fn(|i| match first + i as u16 {
                number if exceptions.is_interrupt(number) => exceptions.priority_byte(number),
                _ => 0,
            }));
        }
        let set = match address >> 7 & 7 {
            2 | 3 => &exceptions.enabled,
            4 | 5 => &exceptions.pending,
            _ => &exceptions.active,
        };
        let first = (address & 0x7F) as u16 * 8 + 16;
        (0..32)
            .filter(|bit| exceptions.is_interrupt(first + bit) && set.has(first + bit))
            .map(|bit| 1 << bit)
            .sum()
    }

    fn write_nvic(&mut self, address: u32, value: u32) {
        if address >= 0xE000_E400 {
            for (i, byte) in value.to_le_bytes().into_iter().enumerate() {
                self.exceptions.set_priority((address - 0xE000_E400) as u16 + 16 + i as u16, byte);
            }
            return;
        }
        let first = (address & 0x7F) as u16 * 8 + 16;
        for bit in (0..32).filter(|bit| value >> bit & 1 == 1) {
            let number = first + bit;
            if !self.exceptions.is_interrupt(number) {
                continue;
            }
            match address >> 7 & 7 {
                2 => self.exceptions.enabled.put(number, true),
                3 => self.exceptions.enabled.put(number, false),
                4 => self.pend_from_software(number),
                5 => self.exceptions.unpend(number),
                _ => {}
            }
        }
    }
}

/// Places in SHCSR.
const ACTIVE: [(u32, u16); 7] = [
    (0, MEM_MANAGE),
    (1, BUS_FAULT),
    (3, USAGE_FAULT),
    (7, SVCALL),
    (8, DEBUG_MONITOR),
    (10, PENDSV),
    (11, SYSTICK),
];
const PENDED: [(u32, u16); 4] = [(12, USAGE_FAULT), (13, MEM_MANAGE), (14, BUS_FAULT), (15, SVCALL)];
const ENABLED: [(u32, u16); 3] = [(16, MEM_MANAGE), (17, BUS_FAULT), (18, USAGE_FAULT)];
