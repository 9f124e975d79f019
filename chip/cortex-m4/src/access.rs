//! Loads and stores.

use crate::bus::{Bus, Fault, Size};
use crate::exceptions::{BUS_FAULT, HARD_FAULT};
use crate::op::Width;
use crate::processor::Core;
use crate::registers::{FORCED, IMPRECISERR};
use crate::trap::Trap;

enum Way {
    Bus,
    Bit(u32, u32),
    Own,
}

impl Core {
    #[inline(always)]
    pub(crate) fn load<B: Bus>(&mut self, bus: &mut B, address: u32, width: Width) -> Result<u32, Trap> {
        match width {
            Width::Word => self.read(bus, address, Size::Word),
            Width::Byte => self.read(bus, address, Size::Byte),
            Width::Half => self.read(bus, address, Size::Half),
            Width::SByte => self.read(bus, address, Size::Byte).map(|value| value as i8 as u32),
            Width::SHalf => self.read(bus, address, Size::Half).map(|value| value as i16 as u32),
        }
    }

    #[inline(always)]
    pub(crate) fn store<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        width: Width,
        value: u32,
    ) -> Result<(), Trap> {
        match width {
            Width::Word => self.write(bus, address, Size::Word, value),
            Width::Byte | Width::SByte => self.write(bus, address, Size::Byte, value & 0xFF),
            Width::Half | Width::SHalf => self.write(bus, address, Size::Half, value & 0xFFFF),
        }
    }

    #[inline(always)]
    pub(crate) fn read<B: Bus>(&mut self, bus: &mut B, address: u32, size: Size) -> Result<u32, Trap> {
        if address & (size.bytes() - 1) != 0 {
            return self.read_unaligned(bus, address, size);
        }
        self.read_aligned(bus, address, size)
    }

    #[inline(always)]
    pub(crate) fn write<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        value: u32,
    ) -> Result<(), Trap> {
        if address & (size.bytes() - 1) != 0 {
            return self.write_unaligned(bus, address, size, value);
        }
        self.write_aligned(bus, address, size, value)
    }

    #[inline(always)]
    pub(crate) fn read_strict<B: Bus>(&mut self, bus: &mut B, address: u32, size: Size) -> Result<u32, Trap> {
        if address & (size.bytes() - 1) != 0 {
            return Err(Trap::Unaligned);
        }
        self.read_aligned(bus, address, size)
    }

    #[inline(always)]
    pub(crate) fn write_strict<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        value: u32,
    ) -> Result<(), Trap> {
        if address & (size.bytes() - 1) != 0 {
            return Err(Trap::Unaligned);
        }
        self.write_aligned(bus, address, size, value)
    }

    #[inline(always)]
    fn read_aligned<B: Bus>(&mut self, bus: &mut B, address: u32, size: Size) -> Result<u32, Trap> {
        if self.slow[(address >> 24) as usize] {
            return self.read_slowly(bus, address, size, self.privileged());
        }
        match bus.read(address, size, self.cycles) {
            Ok(value) => {
                self.cycles += u64::from(bus.take_wait());
                if bus.attention() {
                    self.attention();
                }
                Ok(value)
            }
            Err(Fault::Bus) => Err(Trap::Bus(address)),
        }
    }

    #[inline(always)]
    fn write_aligned<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        value: u32,
    ) -> Result<(), Trap> {
        if self.slow[(address >> 24) as usize] {
            return self.write_slowly(bus, address, size, value, self.privileged());
        }
        self.cache.stored(address);
        match bus.write(address, size, value, self.cycles) {
            Ok(()) => {
                self.cycles += u64::from(bus.take_wait());
                if bus.attention() {
                    self.attention();
                }
                Ok(())
            }
            Err(Fault::Bus) => self.refused_store(address),
        }
    }

    #[cold]
    fn attention(&mut self) {
        self.leave = true;
        self.deadline = 0;
    }

    /// A refused store is reported late, by the write buffer, unless ACTLR.DISDEFWBUF is set.
    #[cold]
    fn refused_store(&mut self, address: u32) -> Result<(), Trap> {
        if self.control.actlr & 2 != 0 {
            return Err(Trap::Bus(address));
        }
        self.control.cfsr |= IMPRECISERR;
        // A `BusFault` that is enabled waits for its turn; one that is not is a `HardFault`.
        let number = if self.exceptions.enabled.has(BUS_FAULT) {
            BUS_FAULT
        } else {
            self.control.hfsr |= FORCED;
            HARD_FAULT
        };
        if self.exceptions.pend(number) {
            self.deadline = 0;
        }
        Ok(())
    }

    #[cold]
    fn read_unaligned<B: Bus>(&mut self, bus: &mut B, address: u32, size: Size) -> Result<u32, Trap> {
        self.may_be_unaligned(address)?;
        let (mut value, mut done) = (0, 0);
        while done < size.bytes() {
            let at = address.wrapping_add(done);
            let part = part_of(at, size.bytes() - done);
            value |= self.read_aligned(bus, at, part)? << (8 * done);
            done += part.bytes();
            self.cycles += u64::from(done < size.bytes());
        }
        Ok(value)
    }

    #[cold]
    fn write_unaligned<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        value: u32,
    ) -> Result<(), Trap> {
        self.may_be_unaligned(address)?;
        let mut done = 0;
        while done < size.bytes() {
            let at = address.wrapping_add(done);
            let part = part_of(at, size.bytes() - done);
            let mask = u32::MAX >> (32 - 8 * part.bytes());
            self.write_aligned(bus, at, part, value >> (8 * done) & mask)?;
            done += part.bytes();
            self.cycles += u64::from(done < size.bytes());
        }
        Ok(())
    }

    fn may_be_unaligned(&self, address: u32) -> Result<(), Trap> {
        let trapped = self.control.ccr & crate::registers::UNALIGN_TRP != 0;
        if trapped || own(address) { Err(Trap::Unaligned) } else { Ok(()) }
    }

    fn way(&self, address: u32, write: bool, privileged: bool) -> Result<Way, Trap> {
        if own(address) {
            return if privileged || self.control.user_may(address, write) {
                Ok(Way::Own)
            } else {
                Err(Trap::Bus(address))
            };
        }
        if self.mpu.is_on() && !self.mpu.allows_data(address, write, privileged, self.priority() < 0) {
            return Err(Trap::Memory(address));
        }
        Ok(match address {
            0x2200_0000..0x2400_0000 | 0x4200_0000..0x4400_0000 => {
                let offset = address & 0x01FF_FFFF;
                Way::Bit((address & 0xF000_0000) + (offset >> 5), offset >> 2 & 7)
            }
            _ => Way::Bus,
        })
    }

    #[cold]
    #[inline(never)]
    pub(crate) fn read_slowly<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        privileged: bool,
    ) -> Result<u32, Trap> {
        let (at, bit) = match self.way(address, false, privileged)? {
            Way::Own => return Ok(self.read_own(address, size)),
            Way::Bus => (address, None),
            Way::Bit(at, bit) => (at, Some(bit)),
        };
        let (at, bit) = align_bit(at, bit, size);
        let value = bus.read(at, size, self.cycles).map_err(|Fault::Bus| Trap::Bus(address))?;
        self.cycles += u64::from(bus.take_wait());
        if bus.attention() {
            self.attention();
        }
        Ok(bit.map_or(value, |bit| value >> bit & 1))
    }

    #[cold]
    #[inline(never)]
    pub(crate) fn write_slowly<B: Bus>(
        &mut self,
        bus: &mut B,
        address: u32,
        size: Size,
        value: u32,
        privileged: bool,
    ) -> Result<(), Trap> {
        let (at, bit) = match self.way(address, true, privileged)? {
            Way::Own => return self.write_own(address, size, value),
            Way::Bus => (address, None),
            Way::Bit(at, bit) => (at, Some(bit)),
        };
        let (at, bit) = align_bit(at, bit, size);
        let value = match bit {
            None => value,
            Some(bit) => {
                let old = bus.read(at, size, self.cycles).map_err(|Fault::Bus| Trap::Bus(address))?;
                self.cycles += u64::from(bus.take_wait()) + 1;
                old & !(1 << bit) | (value & 1) << bit
            }
        };
        self.cache.stored(at);
        let written = bus.write(at, size, value, self.cycles);
        self.cycles += u64::from(bus.take_wait());
        if bus.attention() {
            self.attention();
        }
        if written.is_err() { self.refused_store(address) } else { Ok(()) }
    }
}

/// Whether an address is the processor's own on its private bus. The vendor's devices there (an STM32's DBGMCU at
/// `0xE004_2000`) belong to the chip.
pub(crate) fn own(address: u32) -> bool {
    address >> 20 == 0xE00 && address >> 12 != 0xE_0042
}

/// A bit-band access by a byte, halfword or word that holds the bit.
fn align_bit(at: u32, bit: Option<u32>, size: Size) -> (u32, Option<u32>) {
    let low = at & (size.bytes() - 1);
    (at - low, bit.map(|bit| bit + 8 * low))
}

fn part_of(address: u32, bytes: u32) -> Size {
    if address & 1 != 0 || bytes == 1 {
        Size::Byte
    } else if address & 2 != 0 || bytes < 4 {
        Size::Half
    } else {
        Size::Word
    }
}
