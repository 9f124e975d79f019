//! Accesses by the processor ([`Bus`]) and by DMA: addresses, wait states, refusals.
//!
//! Wait states: the memories have none; the flash's are [`crate::art`]'s. Reads wait for an erase or programming. A
//! load from a device costs two clocks of its bus (RM0090, 2.1: the bridges synchronise), a buffered store none.
//! Contention of the processor and DMA is not modelled.

use cortex_m4_model::{Bus, Fault, Size};

use crate::chip::{Chip, Note, Trouble};
use crate::dma::Port;
use crate::map::{self, Unit};
use crate::memory::{CCM, FLASH, SRAM};
use crate::rcc::Bank;
use crate::tim11::Input;
use crate::time::Now;

/// Embassy reads other chips' DCKCFGR, and writes 0: reserved here, harmless.
const RESERVED: u32 = 0x4002_388C;

/// A read of this register of the USB port takes a packet's status out of its FIFO.
const GRXSTSP: u32 = 0x20;

enum Place {
    Flash(u32),
    Sram(u32),
    Ccm(u32),
    /// Written by the factory.
    Factory,
    Device,
    Nothing,
}

fn place(address: u32) -> Place {
    let within = |(from, bytes): (u32, u32)| address.checked_sub(from).filter(|offset| *offset < bytes);
    if let Some(offset) = within(SRAM) {
        Place::Sram(offset)
    } else if let Some(offset) = within(CCM) {
        Place::Ccm(offset)
    } else if let Some(offset) = within(FLASH).or_else(|| within((0, FLASH.1))) {
        Place::Flash(offset)
    } else if matches!(address, 0x4000_0000..=0x4007_FFFF | 0x5000_0000..=0x5006_0BFF | 0xE004_2000..=0xE004_23FF)
    {
        Place::Device
    } else if within((0x1FFF_0000, 0x1_0000)).is_some() {
        Place::Factory
    } else {
        Place::Nothing
    }
}

impl Chip {
    fn stall(&mut self, now: u64) -> u32 {
        let Some((end, (from, bytes))) = self.flash.finish() else { return 0 };
        self.changed.push((FLASH.0 + from, bytes));
        self.settle(Unit::Flash, self.time.at(now));
        self.attention = true;
        u32::try_from(self.time.cycle(end).saturating_sub(now)).unwrap_or(u32::MAX)
    }

    fn read_flash(&mut self, offset: u32, size: Size, now: u64) -> Option<u32> {
        if let Some(held) = self.art.held(offset, size) {
            return Some(held);
        }
        let stall = self.stall(now);
        let wait = self.art.load(offset, &self.flash.content, now + u64::from(stall));
        self.wait = self.wait.saturating_add(stall + wait);
        self.flash.content.get(offset, size)
    }

    fn read_factory(&mut self, address: u32, size: Size) -> u32 {
        let word = match address & !3 {
            uid @ 0x1FFF_7A10..=0x1FFF_7A18 => self.uid[(uid as usize - 0x1FFF_7A10) / 4],
            // Kilobytes of flash, in the upper half.
            0x1FFF_7A20 => 1024 << 16 | 0xFFFF,
            0x1FFF_7800..=0x1FFF_7A0F => u32::MAX,
            _ => {
                self.stop(Trouble::Register(address, None));
                return 0;
            }
        };
        lane(word, address, size)
    }

    fn read_device(&mut self, address: u32, size: Size) -> u32 {
        let now = self.moment;
        let word = address & !3;
        let Some((unit, gate)) = map::unit_at(address) else {
            self.stop(Trouble::Register(address, None));
            return 0;
        };
        if gate.is_some_and(|(bank, bit)| !self.rcc.is_on(bank, bit)) {
            self.note(Note::NoClock(word));
            return 0;
        }
        let offset = if unit == Unit::Otg { word - map::OTG } else { word & 0x3FF };
        let value = match unit {
            Unit::Tim(number) => self.tims[number as usize].read(offset, now.cycle),
            Unit::Tim11 => self.tim11.read(offset, self.tim11_input(now)),
            Unit::Usart(number) => self.usarts[number as usize].read(offset),
            Unit::Spi(number) => self.spis[number as usize].read(offset, now, &self.time),
            Unit::Iwdg => self.iwdg.read(offset, now.ps),
            Unit::Pwr => self.pwr.read(offset),
            Unit::Syscfg => self.exti.read_syscfg(offset),
            Unit::Exti => self.exti.read(offset),
            Unit::Gpio(port) => self.gpio.read(port as usize, offset),
            Unit::Crc => self.crc.read(offset),
            Unit::Rcc => self.rcc.read(offset, now),
            Unit::Flash => self.flash.read(offset),
            Unit::Dma(number) => self.dmas[number as usize].read(offset),
            Unit::Rng => self.rng.read(offset, now.ps, self.clocks.pll48),
            Unit::Otg => self.otg.read(offset, now.ps),
            Unit::Dbgmcu => self.read_dbgmcu(offset),
        };
        let Some(value) = value else {
            if word == RESERVED {
                self.note(Note::Reserved(word));
            } else {
                self.stop(Trouble::Register(address, None));
            }
            return 0;
        };
        lane(value, address, size)
    }

    fn write_device(&mut self, address: u32, size: Size, value: u32) -> Option<Unit> {
        let word = address & !3;
        let Some((unit, gate)) = map::unit_at(address) else {
            self.stop(Trouble::Register(address, Some(value)));
            return None;
        };
        if gate.is_some_and(|(bank, bit)| !self.rcc.is_on(bank, bit) || self.rcc.is_held(bank, bit)) {
            self.note(Note::NoClock(word));
            return None;
        }
        let offset = if unit == Unit::Otg { word - map::OTG } else { word & 0x3FF };
        let value = match (unit, size) {
            (_, Size::Word)
            | (Unit::Usart(_) | Unit::Spi(_) | Unit::Tim(_) | Unit::Tim11 | Unit::Iwdg, _)
                if address == word =>
            {
                value
            }
            (Unit::Gpio(port), _) => {
                let shift = 8 * (address & 3);
                let mask = (u32::MAX >> (32 - 8 * size.bytes())) << shift;
                let kept = self.gpio.read(port as usize, offset).filter(|_| offset != 0x18).unwrap_or(0);
                kept & !mask | value << shift & mask
            }
            _ => {
                self.stop(Trouble::Width(address, size.bytes()));
                return None;
            }
        };
        if self.write_register(unit, offset, value).is_none() {
            if word == RESERVED && value == 0 {
                self.note(Note::Reserved(address));
            } else {
                self.stop(Trouble::Register(address, Some(value)));
            }
        }
        Some(unit)
    }

    fn write_register(&mut self, unit: Unit, offset: u32, value: u32) -> Option<()> {
        let now = self.moment;
        match unit {
            Unit::Tim(number) => self.tims[number as usize].write(offset, value, now.cycle),
            Unit::Tim11 => self.tim11.write(offset, value, self.tim11_input(now)),
            Unit::Usart(number) => self.usarts[number as usize].write(offset, value, now.ps),
            Unit::Spi(number) => self.spis[number as usize].write(offset, value, now, &self.time),
            Unit::Iwdg => {
                if self.iwdg.write(offset, value, now.ps)? {
                    self.rcc.force_lsi(now.ps);
                }
                Some(())
            }
            Unit::Pwr => self.pwr.write(offset, value),
            Unit::Syscfg => self.exti.write_syscfg(offset, value),
            Unit::Exti => self.exti.write(offset, value),
            Unit::Gpio(port) => self.gpio.write(port as usize, offset, value),
            Unit::Crc => self.crc.write(offset, value),
            Unit::Rcc => self.write_rcc(offset, value, now),
            Unit::Flash => self.write_flash_register(offset, value, now),
            Unit::Dma(number) => {
                let number = number as usize;
                let mut dma = self.dmas[number].clone();
                let done = dma.write(offset, value, &mut DmaPort { chip: self, controller: number });
                self.dmas[number] = dma;
                done
            }
            Unit::Rng => self.rng.write(offset, value, now.ps),
            Unit::Otg => self.otg.write(offset, value),
            Unit::Dbgmcu => {
                *self.dbgmcu.get_mut((offset as usize).checked_sub(4)? / 4)? = value;
                // The processor's counter may count in sleep.
                self.attention = true;
                Some(())
            }
        }
    }

    fn read_dbgmcu(&self, offset: u32) -> Option<u32> {
        if offset == 0 { Some(self.idcode) } else { self.dbgmcu.get(offset as usize / 4 - 1).copied() }
    }

    fn tim11_input(&self, now: Now) -> Input {
        Input { ps: now.ps, timer_hz: self.clocks.timer[1], edges_mhz: self.rcc.crystal_for_rtc_mhz(now.ps) }
    }

    fn write_rcc(&mut self, offset: u32, value: u32, now: Now) -> Option<()> {
        const BANKS: [(u32, Bank); 5] = [
            (0x10, Bank::Ahb1),
            (0x14, Bank::Ahb2),
            (0x18, Bank::Ahb3),
            (0x20, Bank::Apb1),
            (0x24, Bank::Apb2),
        ];
        self.rcc.write(offset, value, now, self.pwr.is_backup_unlocked())?;
        if let Some((_, bank)) = BANKS.into_iter().find(|(of, _)| *of == offset) {
            for bit in (0..32).filter(|bit| value >> bit & 1 == 1) {
                if let Some(unit) = map::unit_of((bank, bit)) {
                    self.reset_unit(unit, now);
                }
            }
        }
        self.apply_clocks(now);
        Some(())
    }

    fn write_flash_register(&mut self, offset: u32, value: u32, now: Now) -> Option<()> {
        self.flash.write(offset, value, now.ps)?;
        if offset == 0 {
            let acr = self.flash.acr();
            let bit = |number: u32| acr >> number & 1 == 1;
            self.art.latency = acr & 7;
            self.art.prefetch = bit(8);
            self.art.set_caches(bit(9), bit(10));
            self.art.reset_caches(bit(11), bit(12));
            self.check_latency();
        }
        Some(())
    }

    fn reset_unit(&mut self, unit: Unit, now: Now) {
        match unit {
            Unit::Tim(number) => self.tims[number as usize].reset(now.cycle),
            Unit::Tim11 => self.tim11.reset(),
            Unit::Usart(number) => self.usarts[number as usize].reset(now.ps),
            Unit::Spi(number) => self.spis[number as usize].reset(),
            Unit::Pwr => self.pwr.reset(),
            Unit::Syscfg => self.exti.reset_syscfg(),
            Unit::Gpio(port) => self.gpio.reset_port(port as usize),
            Unit::Crc => self.crc = crate::small::Crc::new(),
            Unit::Dma(number) => self.dmas[number as usize] = crate::dma::Dma::new(),
            Unit::Rng => self.rng.reset(),
            Unit::Otg => self.otg.reset(),
            Unit::Iwdg | Unit::Exti | Unit::Rcc | Unit::Flash | Unit::Dbgmcu => {}
        }
        self.settle(unit, now);
    }
}

fn lane(word: u32, address: u32, size: Size) -> u32 {
    word >> (8 * (address & 3)) & (u32::MAX >> (32 - 8 * size.bytes()))
}

impl Bus for Chip {
    #[inline]
    fn read(&mut self, address: u32, size: Size, now: u64) -> Result<u32, Fault> {
        let value = match place(address) {
            Place::Sram(offset) => self.sram.get(offset, size),
            Place::Ccm(offset) => self.ccm.get(offset, size),
            Place::Flash(offset) => self.read_flash(offset, size, now),
            Place::Factory => Some(self.read_factory(address, size)),
            Place::Device => {
                self.moment = self.time.at(now);
                let value = self.read_device(address, size);
                self.wait += match address >> 16 {
                    0x4000 => 2 * self.clocks.hclk.checked_div(self.clocks.pclk[0]).unwrap_or(1),
                    0x4001 => 2 * self.clocks.hclk.checked_div(self.clocks.pclk[1]).unwrap_or(1),
                    _ => 1,
                };
                match map::unit_at(address) {
                    Some((unit @ (Unit::Usart(_) | Unit::Spi(_) | Unit::Rng), _)) if address & 0xC != 0 => {
                        self.settle(unit, self.moment);
                    }
                    Some((Unit::Otg, _)) if address == map::OTG + GRXSTSP => {
                        self.settle(Unit::Otg, self.moment);
                    }
                    _ => {}
                }
                Some(value)
            }
            Place::Nothing => None,
        };
        value.ok_or(Fault::Bus)
    }

    #[inline]
    fn write(&mut self, address: u32, size: Size, value: u32, now: u64) -> Result<(), Fault> {
        let done = match place(address) {
            Place::Sram(offset) => self.sram.set(offset, size, value),
            Place::Ccm(offset) => self.ccm.set(offset, size, value),
            Place::Flash(offset) => {
                let stall = self.stall(now);
                self.wait = self.wait.saturating_add(stall);
                let now = self.time.at(now + u64::from(stall));
                self.flash.program(offset, size, value, now.ps);
                self.art.stored(offset, &self.flash.content);
                self.settle(Unit::Flash, now);
                Some(())
            }
            Place::Factory => {
                self.stop(Trouble::Register(address, Some(value)));
                Some(())
            }
            Place::Device => {
                self.moment = self.time.at(now);
                if let Some(unit) = self.write_device(address, size, value) {
                    self.settle(unit, self.moment);
                }
                Some(())
            }
            Place::Nothing => None,
        };
        done.ok_or(Fault::Bus)
    }

    fn fetch(&mut self, address: u32) -> Result<u16, Fault> {
        let value = match place(address) {
            Place::Sram(offset) => self.sram.get(offset, Size::Half),
            Place::Flash(offset) => self.flash.content.get(offset, Size::Half),
            // Instructions do not come from CCM (RM0090, 2.3.1), nor from devices.
            _ => None,
        };
        value.map(|half| half as u16).ok_or(Fault::Bus)
    }

    #[inline]
    fn fetch_wait(&mut self, address: u32, bytes: u32, _branched: bool, now: u64) -> u32 {
        let offset = address.wrapping_sub(FLASH.0);
        if offset >= FLASH.1 {
            return 0;
        }
        if self.flash.busy_until().is_some() && self.art.needs_flash(offset, bytes) {
            let stall = self.stall(now);
            return stall.saturating_add(self.art.fetch(offset, bytes, now + u64::from(stall)));
        }
        self.art.fetch(offset, bytes, now)
    }

    #[inline]
    fn take_wait(&mut self) -> u32 {
        std::mem::take(&mut self.wait)
    }

    #[inline]
    fn attention(&self) -> bool {
        self.attention
    }
}

/// SRAM and devices; the flash to read; never CCM (RM0090, 2.1); DMA1's device port only APB1.
pub struct DmaPort<'a> {
    pub(crate) chip: &'a mut Chip,
    pub(crate) controller: usize,
}

impl DmaPort<'_> {
    fn reaches(&self, address: u32) -> bool {
        self.controller == 1 || address >> 16 == 0x4000
    }
}

impl Port for DmaPort<'_> {
    fn load(&mut self, address: u32, size: Size) -> Option<u32> {
        match place(address) {
            Place::Sram(offset) => self.chip.sram.get(offset, size),
            Place::Flash(offset) => self.chip.flash.content.get(offset, size),
            Place::Device if self.reaches(address) => {
                let value = self.chip.read_device(address, size);
                self.after(address);
                Some(value)
            }
            _ => None,
        }
    }

    fn store(&mut self, address: u32, size: Size, value: u32) -> Option<()> {
        match place(address) {
            Place::Sram(offset) => {
                self.chip.changed.push((address, size.bytes()));
                self.chip.sram.set(offset, size, value)
            }
            Place::Device if self.reaches(address) => {
                self.chip.write_device(address, size, value);
                self.after(address);
                Some(())
            }
            _ => None,
        }
    }
}

impl DmaPort<'_> {
    fn after(&mut self, address: u32) {
        if let Some((unit @ (Unit::Usart(_) | Unit::Spi(_) | Unit::Gpio(_) | Unit::Tim(_)), _)) =
            map::unit_at(address)
        {
            self.chip.refresh(unit, self.chip.moment);
        }
    }
}
