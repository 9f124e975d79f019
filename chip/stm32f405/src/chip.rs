//! Devices, their connections, and the next event.
//!
//! A device is asked when read, and at its own next moment ([`Chip::happen`]); then `Chip::settle` looks at its interrupt, DMA
//! requests and next moment.

use std::collections::BTreeMap;

use crate::art::Art;
use crate::bits::Bits;
use crate::dma::Dma;
use crate::flash::Flash;
use crate::gpio::{Exti, Gpio, Pin};
use crate::map::{self, Unit};
use crate::memory::{CCM, Memory, SRAM, garbage};
use crate::otg::Otg;
use crate::pwr::Pwr;
use crate::rcc::{Cause, Clocks, Rcc};
use crate::small::{Crc, Iwdg, Rng};
use crate::spi::Spi;
use crate::tim::Tim;
use crate::tim11::Tim11;
use crate::time::{NEVER, Now, Timebase};
use crate::usart::Usart;

/// A stop: not modelled, or impossible on the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Missing or not modelled, or bits of it: address, and a written value.
    Register(u32, Option<u32>),
    /// Address, bytes.
    Width(u32, u32),
    /// Hertz, beyond the flash's wait states.
    FlashTooSlow(u32, u32),
    /// Does not pass: the model's fault.
    StandsStill(usize),
}

/// An oddity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Note {
    /// Reads give 0, writes are lost.
    NoClock(u32),
    /// Read, or written with 0.
    Reserved(u32),
}

/// Moments of devices, by their places in the schedule.
const FLASH: usize = 0;
const RCC: usize = 1;
const IWDG: usize = 2;
const RNG: usize = 3;
const USART: usize = 4;
const SPI: usize = 10;
const TIM: usize = 13;
const DMA: usize = 18;
const OTG: usize = 20;
const SLOTS: usize = 21;

/// The chip.
pub struct Chip {
    /// Time.
    pub time: Timebase,
    /// 128 KiB, by all.
    pub sram: Memory,
    /// 64 KiB, the processor's alone.
    pub ccm: Memory,
    /// The flash.
    pub flash: Flash,
    /// Its accelerator.
    pub art: Art,
    /// Clocks.
    pub rcc: Rcc,
    /// Supply.
    pub pwr: Pwr,
    /// Pins.
    pub gpio: Gpio,
    /// Lines of EXTI.
    pub exti: Exti,
    /// Ports, as [`Unit::Usart`] counts them.
    pub usarts: [Usart; 6],
    /// Buses.
    pub spis: [Spi; 3],
    /// Timers.
    pub tims: [Tim; 5],
    /// TIM11.
    pub tim11: Tim11,
    /// DMA.
    pub dmas: [Dma; 2],
    /// The watchdog.
    pub iwdg: Iwdg,
    /// Random numbers.
    pub rng: Rng,
    /// USB.
    pub otg: Otg,
    /// The CRC unit.
    pub crc: Crc,
    /// Number, 96 bits.
    pub uid: [u32; 3],
    /// `DBGMCU_IDCODE`.
    pub idcode: u32,
    /// `DBGMCU_CR` and the two freeze registers.
    pub dbgmcu: [u32; 3],
    /// A device on pins that the program moves itself.
    pub bits: Option<Bits>,
    /// The select pin of each bus.
    pub selects: [Option<Pin>; 3],
    /// Oddities, with their counts.
    pub notes: BTreeMap<Note, u64>,
    pub(crate) clocks: Clocks,
    pub(crate) lines: u128,
    pub(crate) trouble: Option<Trouble>,
    pub(crate) attention: bool,
    pub(crate) wait: u32,
    /// Memory that changed without a store of the processor.
    pub(crate) changed: Vec<(u32, u32)>,
    pub(crate) reset_by: Option<Cause>,
    pub(crate) event: bool,
    /// The current moment.
    pub(crate) moment: Now,
    selected: [bool; 3],
    deadlines: [u64; SLOTS],
    next: u64,
    /// The processor runs until then without being asked.
    pub(crate) until: u64,
    pub(crate) copies: [u64; 2],
}

impl Chip {
    /// A chip at power-on, with crystal, low-speed oscillator, random seed.
    pub fn new(hse_hz: u32, lsi_hz: u32, seed: u64) -> Self {
        let mut chip = Self {
            time: Timebase::new(16_000_000),
            sram: Memory::new(SRAM.1, 0),
            ccm: Memory::new(CCM.1, 0),
            flash: Flash::new(),
            art: Art::new(),
            rcc: Rcc::new(hse_hz),
            pwr: Pwr::new(),
            gpio: Gpio::new(),
            exti: Exti::default(),
            usarts: std::array::from_fn(|_| Usart::new()),
            spis: std::array::from_fn(|_| Spi::new()),
            tims: [Tim::new(32, 4), Tim::new(16, 4), Tim::new(16, 4), Tim::new(32, 4), Tim::new(16, 2)],
            tim11: Tim11::default(),
            dmas: [Dma::new(), Dma::new()],
            iwdg: Iwdg::new(lsi_hz),
            rng: Rng::new(seed),
            otg: Otg::new(),
            crc: Crc::new(),
            uid: [0x0031_0045, 0x3136_510E, 0x3336_3734],
            // Revision Y of the STM32F405 and F407.
            idcode: 0x100F_6413,
            dbgmcu: [0; 3],
            bits: None,
            selects: [None; 3],
            notes: BTreeMap::new(),
            clocks: Clocks::default(),
            lines: 0,
            trouble: None,
            attention: false,
            wait: 0,
            changed: Vec::new(),
            reset_by: None,
            event: false,
            moment: Now::default(),
            selected: [false; 3],
            deadlines: [NEVER; SLOTS],
            next: NEVER,
            until: 0,
            copies: [NEVER; 2],
        };
        garbage(chip.sram.all_mut(), seed);
        garbage(chip.ccm.all_mut(), seed ^ 0x55);
        chip.apply_clocks(Now::default());
        chip
    }

    /// Reset without processor.
    pub fn reset(&mut self, cause: Cause, now: Now) {
        self.flash.reset(now.ps);
        let counts = self.art.counts;
        self.art = Art::new();
        self.art.counts = counts;
        self.rcc.reset(cause, now.ps);
        self.pwr.reset();
        self.gpio.reset();
        self.exti.reset();
        self.usarts.iter_mut().for_each(|usart| usart.reset(now.ps));
        self.spis.iter_mut().for_each(Spi::reset);
        self.tims.iter_mut().for_each(|tim| tim.reset(now.cycle));
        self.tim11.reset();
        self.dmas = [Dma::new(), Dma::new()];
        self.iwdg.reset();
        self.rng.reset();
        self.otg.reset();
        self.crc = Crc::new();
        if cause == Cause::Power {
            self.dbgmcu = [0; 3];
        }
        (self.copies, self.reset_by, self.trouble, self.lines, self.event) =
            ([NEVER; 2], None, None, 0, false);
        self.attention = true;
        self.changed.push((SRAM.0, SRAM.1));
        self.changed.push((CCM.0, CCM.1));
        self.changed.push((crate::memory::FLASH.0, crate::memory::FLASH.1));
        self.apply_clocks(now);
        self.pins_changed(now);
        for slot in 0..SLOTS {
            self.schedule(slot);
        }
    }

    /// No clock for the processor.
    pub fn is_stopped(&self) -> bool {
        self.clocks.hclk == 0
    }

    /// Unused ones.
    pub(crate) fn take_waits(&mut self) {
        self.wait = 0;
    }

    /// Cycle of the next event.
    pub fn next(&self) -> u64 {
        self.next
    }

    pub(crate) fn note(&mut self, note: Note) {
        *self.notes.entry(note).or_default() += 1;
    }

    pub(crate) fn stop(&mut self, trouble: Trouble) {
        self.trouble.get_or_insert(trouble);
        self.attention = true;
    }

    /// The clocks changed.
    pub fn apply_clocks(&mut self, now: Now) {
        let clocks = self.rcc.clocks(now.ps);
        if clocks != self.clocks {
            for spi in &mut self.spis {
                spi.advance(now, &self.time);
            }
            self.clocks = clocks;
            self.attention = true;
            // Steps of a microsecond.
            self.time.set(now, if clocks.hclk == 0 { 1_000_000 } else { clocks.hclk });
            let cycles = |hz: u32| u64::from(clocks.hclk.checked_div(hz).unwrap_or(1));
            for (number, usart) in self.usarts.iter_mut().enumerate() {
                usart.set_clock(clocks.pclk[usize::from(number == 0 || number == 5)]);
            }
            for (number, spi) in self.spis.iter_mut().enumerate() {
                spi.set_clock(cycles(clocks.pclk[usize::from(number == 0)]));
            }
            for tim in &mut self.tims {
                tim.set_clock(now.cycle, cycles(clocks.timer[0]));
            }
            for slot in 0..SLOTS {
                self.schedule(slot);
            }
        }
        self.check_latency();
        self.schedule(RCC);
    }

    /// DS8626, table 10: 30 MHz for each step at 2.7 V and more.
    pub(crate) fn check_latency(&mut self) {
        let (hz, latency) = (self.clocks.hclk, self.flash.acr() & 7);
        if hz > 30_000_000 * (latency + 1) {
            self.stop(Trouble::FlashTooSlow(hz, latency));
        }
    }

    fn schedule(&mut self, slot: usize) {
        let time = &self.time;
        let at = match slot {
            FLASH => time.cycle(self.flash.deadline()),
            RCC => time.cycle(self.rcc.deadline()),
            IWDG => time.cycle(self.iwdg.deadline()),
            RNG => time.cycle(self.rng.deadline()),
            USART..SPI => time.cycle(self.usarts[slot - USART].deadline()),
            SPI..TIM => self.spis[slot - SPI].deadline(),
            TIM..DMA => self.tims[slot - TIM].deadline(),
            OTG => time.cycle(self.otg.deadline()),
            _ => self.copies[slot - DMA],
        };
        self.deadlines[slot] = at;
        self.next = self.deadlines.iter().copied().min().unwrap_or(NEVER);
        if self.next < self.until {
            self.attention = true;
        }
    }

    /// Events up to this cycle, each at its moment; ends at a reset.
    pub fn happen(&mut self, until: u64) {
        while self.next <= until && self.reset_by.is_none() && self.trouble.is_none() {
            let at = self.next;
            let slot = self.deadlines.iter().position(|deadline| *deadline == at).unwrap_or(0);
            let now = self.time.at(at);
            let unit = match slot {
                FLASH => Unit::Flash,
                RCC => Unit::Rcc,
                IWDG => Unit::Iwdg,
                RNG => Unit::Rng,
                USART..SPI => Unit::Usart((slot - USART) as u8),
                SPI..TIM => Unit::Spi((slot - SPI) as u8),
                TIM..DMA => Unit::Tim((slot - TIM) as u8),
                OTG => Unit::Otg,
                _ => Unit::Dma((slot - DMA) as u8),
            };
            self.device_happens(unit, now);
            self.settle(unit, now);
            if self.deadlines[slot] <= at && self.reset_by.is_none() {
                self.stop(Trouble::StandsStill(slot));
            }
        }
    }

    fn device_happens(&mut self, unit: Unit, now: Now) {
        match unit {
            Unit::Flash => {
                if let Some((from, bytes)) = self.flash.happen(now.ps) {
                    self.changed.push((crate::memory::FLASH.0 + from, bytes));
                }
            }
            Unit::Rcc => {
                self.rcc.settle(now.ps);
                self.apply_clocks(now);
            }
            Unit::Iwdg => {
                self.reset_by = Some(Cause::Watchdog);
                self.attention = true;
            }
            Unit::Usart(number) => self.usarts[number as usize].happen(now.ps),
            Unit::Spi(number) => self.spis[number as usize].advance(now, &self.time),
            Unit::Tim(number) => self.tims[number as usize].advance(now.cycle),
            Unit::Dma(number) => self.copy(number as usize),
            Unit::Otg => {
                let (function, pins) = map::OTG_PINS;
                // A device's clock may be off by 0.25 % (USB 2.0, 7.1.11).
                self.otg.is_wired = self.clocks.pll48.abs_diff(48_000_000) <= 120_000
                    && pins.iter().all(|pin| self.gpio.is_routed(*pin, function));
                self.otg.happen(now.ps);
            }
            _ => {}
        }
    }

    /// DMA serves it, then [`Chip::refresh`].
    pub(crate) fn settle(&mut self, unit: Unit, now: Now) {
        self.moment = now;
        self.pump();
        self.refresh(unit, now);
    }

    pub(crate) fn refresh(&mut self, unit: Unit, now: Now) {
        match unit {
            Unit::Flash => self.schedule(FLASH),
            Unit::Rcc => self.schedule(RCC),
            Unit::Iwdg => self.schedule(IWDG),
            Unit::Rng => self.schedule(RNG),
            Unit::Otg => self.schedule(OTG),
            Unit::Usart(number) => self.schedule(USART + number as usize),
            Unit::Spi(number) => self.schedule(SPI + number as usize),
            Unit::Tim(number) => self.schedule(TIM + number as usize),
            Unit::Dma(number) => {
                let number = number as usize;
                if self.copies[number] == NEVER && self.copying(number).is_some() {
                    let items =
                        self.copying(number).map_or(0, |stream| self.dmas[number].streams[stream].left());
                    // Four bus cycles an item: a read and a write, each arbitrated.
                    self.copies[number] = now.cycle + 4 * u64::from(items);
                }
                self.schedule(DMA + number);
            }
            _ => {}
        }
        self.look_at(unit, now);
    }

    pub(crate) fn look_at(&mut self, unit: Unit, now: Now) {
        match unit {
            Unit::Flash => self.line(map::FLASH, self.flash.interrupts()),
            Unit::Otg => self.line(map::OTG_LINE, self.otg.interrupts()),
            Unit::Rng => self.line(map::RNG, self.rng.interrupts(now.ps, self.clocks.pll48)),
            Unit::Usart(number) => {
                let number = number as usize;
                self.line(map::USART[number], self.usarts[number].interrupts());
            }
            Unit::Spi(number) => {
                let number = number as usize;
                self.line(map::SPI[number], self.spis[number].interrupts());
            }
            Unit::Tim(number) => {
                let number = number as usize;
                self.line(map::TIM[number], self.tims[number].interrupts());
            }
            Unit::Dma(number) => {
                let number = number as usize;
                let pending = self.dmas[number].interrupts();
                for (stream, line) in map::DMA[number].into_iter().enumerate() {
                    self.line(line, pending >> stream & 1 == 1);
                }
            }
            Unit::Exti | Unit::Pwr | Unit::Syscfg => self.look_at_lines(),
            Unit::Gpio(_) => self.pins_changed(now),
            _ => {}
        }
    }

    pub(crate) fn line(&mut self, number: u16, high: bool) {
        let bit = 1 << number;
        if (self.lines & bit != 0) != high {
            self.lines ^= bit;
            self.attention = true;
        }
    }

    /// The lines of EXTI as they are now.
    pub fn look_at_lines(&mut self) {
        self.event |= self.exti.look(&self.gpio, self.pwr.is_low());
        self.attention |= self.event;
        let pending = self.exti.pending();
        for (lines, number) in map::EXTI {
            self.line(number, pending & lines != 0);
        }
    }

    /// Pins changed.
    pub fn pins_changed(&mut self, now: Now) {
        if let Some((pin, level)) = self.bits.as_mut().and_then(|bits| bits.look(&self.gpio, now.ps)) {
            self.gpio.drive(pin, Some(level));
        }
        let gpio = &self.gpio;
        for (usart, (function, rx, tx)) in self.usarts.iter_mut().zip(map::USART_PINS) {
            let is = |pins: &[Pin]| pins.iter().any(|pin| gpio.is_routed(*pin, function));
            usart.routed = (is(rx), is(tx));
        }
        for (number, (function, pins)) in map::SPI_PINS.into_iter().enumerate() {
            let spi = &mut self.spis[number];
            spi.routed = pins.map(|pins| pins.iter().any(|pin| gpio.is_routed(*pin, function)));
            let selected = self.selects[number].is_some_and(|pin| gpio.pulls_low(pin));
            if selected != self.selected[number] {
                spi.advance(now, &self.time);
                spi.wire.select(now.ps, selected);
                self.selected[number] = selected;
            }
        }
        for slot in USART..SPI {
            self.schedule(slot);
        }
        self.look_at_lines();
    }

    /// A host was plugged in.
    pub fn host_plugged(&mut self) {
        self.schedule(OTG);
    }

    /// Characters were added.
    pub fn line_changed(&mut self, number: usize) {
        self.schedule(USART + number);
    }
}
