//! SPI1 to SPI3 as master (RM0090, chapter 28). The other end is a [`Wire`].
//!
//! Not modelled: slave mode, one line for both ways, the CRC unit, I2S, TI's frame: they stop the machine. A word is exchanged
//! at its last clock: the card decides by time.

use crate::time::{NEVER, Now, Timebase};

/// Bits of `CR1`.
const MSTR: u32 = 1 << 2;
const SPE: u32 = 1 << 6;
const LSBFIRST: u32 = 1 << 7;
const DFF: u32 = 1 << 11;
/// Not modelled: RXONLY, CRCNEXT, CRCEN, BIDIOE, BIDIMODE.
const CR1_UNKNOWN: u32 = 1 << 10 | 1 << 12 | 1 << 13 | 1 << 14 | 1 << 15;
/// Bits of `CR2`.
const RXDMAEN: u32 = 1;
const TXDMAEN: u32 = 1 << 1;
const ERRIE: u32 = 1 << 5;
const RXNEIE: u32 = 1 << 6;
const TXEIE: u32 = 1 << 7;
/// Bits of `SR`.
const RXNE: u32 = 1;
const TXE: u32 = 1 << 1;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// The other end of a bus.
pub trait Wire {
    /// Last clock at `ps`, at `hz`; returns the answer.
    fn exchange(&mut self, ps: u64, hz: u32, sent: u8) -> u8;

    /// The answer to the byte that begins, for a program that reads each bit.
    fn begin(&mut self, _ps: u64, _hz: u32) -> u8 {
        0xFF
    }

    /// The select pin changed.
    fn select(&mut self, ps: u64, selected: bool);

    /// The supply came or went.
    fn power(&mut self, _ps: u64, _on: bool) {}
}

/// Nobody is there, and the line is high.
pub struct Nobody;

impl Wire for Nobody {
    fn exchange(&mut self, _: u64, _: u32, _: u8) -> u8 {
        0xFF
    }

    fn select(&mut self, _: u64, _: bool) {}
}

/// The bus's master.
pub struct Spi {
    cr1: u32,
    cr2: u32,
    crcpr: u32,
    i2spr: u32,
    rx: Option<u16>,
    rx_last: u16,
    overrun: bool,
    overrun_read: bool,
    modf: bool,
    to_send: Option<u16>,
    /// The word, and its last clock.
    sending: Option<(u16, u64)>,
    /// Processor cycles of a clock of the bus APB.
    bus_cycles: u64,
    /// Clock, to the card, from it.
    pub routed: [bool; 3],
    /// The connected device.
    pub wire: Box<dyn Wire>,
    /// Words exchanged.
    pub words: u64,
}

impl Default for Spi {
    fn default() -> Self {
        Self::new()
    }
}

impl Spi {
    /// As after a reset.
    pub fn new() -> Self {
        Self {
            cr1: 0,
            cr2: 0,
            crcpr: 7,
            i2spr: 2,
            rx: None,
            rx_last: 0,
            overrun: false,
            overrun_read: false,
            modf: false,
            to_send: None,
            sending: None,
            bus_cycles: 1,
            routed: [false; 3],
            wire: Box::new(Nobody),
            words: 0,
        }
    }

    /// Reset; outside stays.
    pub fn reset(&mut self) {
        let wire = std::mem::replace(&mut self.wire, Box::new(Nobody));
        *self =
            Self { wire, routed: self.routed, bus_cycles: self.bus_cycles, words: self.words, ..Self::new() };
    }

    /// The bus clock in processor cycles.
    pub fn set_clock(&mut self, bus_cycles: u64) {
        self.bus_cycles = bus_cycles.max(1);
    }

    fn word_cycles(&self) -> u64 {
        let bits = if self.cr1 & DFF == 0 { 8 } else { 16 };
        bits * (2 << (self.cr1 >> 3 & 7)) * self.bus_cycles
    }

    /// Brings it to this moment.
    pub fn advance(&mut self, now: Now, time: &Timebase) {
        while let Some((word, end)) = self.sending.take_if(|(_, end)| *end <= now.cycle) {
            let received = self.exchange(word, time.ps(end), time.hz());
            if self.rx.is_some() {
                self.overrun = true;
            } else {
                self.rx = Some(received);
            }
            if let Some(next) = self.to_send.take() {
                self.sending = Some((next, end + self.word_cycles()));
            }
        }
    }

    fn exchange(&mut self, word: u16, ps: u64, hclk: u32) -> u16 {
        self.words += 1;
        let hz = (u64::from(hclk) / self.bus_cycles / (2 << (self.cr1 >> 3 & 7))) as u32;
        let [clock, out, back] = self.routed;
        if !clock {
            return 0xFFFF;
        }
        let mut byte = |byte: u8| {
            let byte = if self.cr1 & LSBFIRST == 0 { byte } else { byte.reverse_bits() };
            let answer = self.wire.exchange(ps, hz, if out { byte } else { 0xFF });
            let answer = if back { answer } else { 0xFF };
            if self.cr1 & LSBFIRST == 0 { answer } else { answer.reverse_bits() }
        };
        if self.cr1 & DFF == 0 {
            return u16::from(byte(word as u8));
        }
        let high = byte((word >> 8) as u8);
        u16::from(high) << 8 | u16::from(byte(word as u8))
    }

    /// Time of events that are waited for without asking.
    pub fn deadline(&self) -> u64 {
        let asked = self.cr2 & (RXDMAEN | TXDMAEN | RXNEIE | TXEIE | ERRIE) != 0;
        self.sending.filter(|_| asked).map_or(NEVER, |(_, end)| end)
    }

    fn status(&self) -> u32 {
        let flag = |on: bool, bit: u32| if on { bit } else { 0 };
        flag(self.rx.is_some(), RXNE)
            | flag(self.to_send.is_none(), TXE)
            | flag(self.overrun, OVR)
            | flag(self.modf, MODF)
            | flag(self.sending.is_some(), BSY)
    }

    /// DMA is to fetch a word.
    pub fn wants_fetch(&self) -> bool {
        self.cr2 & RXDMAEN != 0 && self.rx.is_some()
    }

    /// DMA is to bring a word.
    pub fn wants_word(&self) -> bool {
        self.cr2 & TXDMAEN != 0 && self.to_send.is_none() && self.cr1 & SPE != 0
    }

    /// The level of its interrupt.
    pub fn interrupts(&self) -> bool {
        let status = self.status();
        self.cr2 & RXNEIE != 0 && status & RXNE != 0
            || self.cr2 & TXEIE != 0 && status & TXE != 0
            || self.cr2 & ERRIE != 0 && status & (OVR | MODF) != 0
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32, now: Now, time: &Timebase) -> Option<u32> {
        self.advance(now, time);
        Some(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => {
                // OVR is cleared by a read of DR and then one of SR.
                let status = self.status();
                if std::mem::take(&mut self.overrun_read) {
                    self.overrun = false;
                }
                status
            }
            0x0C => {
                self.overrun_read = self.overrun;
                self.rx_last = self.rx.take().unwrap_or(self.rx_last);
                u32::from(self.rx_last)
            }
            0x10 => self.crcpr,
            0x14 | 0x18 | 0x1C => 0,
            0x20 => self.i2spr,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: Now, time: &Timebase) -> Option<()> {
        self.advance(now, time);
        match offset {
            0x00 => {
                let is_unknown = value & CR1_UNKNOWN != 0 || value & SPE != 0 && value & MSTR == 0;
                if is_unknown {
                    return None;
                }
                self.cr1 = value & 0xFFFF;
                self.start(now);
            }
            0x04 if value & 0x10 == 0 => self.cr2 = value & 0xF7,
            0x08 => {}
            0x0C => {
                self.to_send = Some(if self.cr1 & DFF == 0 { value as u16 & 0xFF } else { value as u16 });
                self.start(now);
            }
            0x10 => self.crcpr = value & 0xFFFF,
            0x1C if value & 0xC00 == 0 => {}
            0x20 => self.i2spr = value & 0x3FF,
            _ => return None,
        }
        Some(())
    }

    fn start(&mut self, now: Now) {
        if self.cr1 & SPE != 0
            && self.sending.is_none()
            && let Some(word) = self.to_send.take()
        {
            self.sending = Some((word, now.cycle + self.word_cycles()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::rc::Rc;

    struct Echo(Rc<RefCell<Vec<(u64, u32, u8)>>>);

    impl Wire for Echo {
        fn exchange(&mut self, ps: u64, hz: u32, sent: u8) -> u8 {
            self.0.borrow_mut().push((ps, hz, sent));
            !sent
        }
        fn select(&mut self, _: u64, _: bool) {}
    }

    #[test]
    fn words_take_their_clocks_and_come_back() {
        let seen = Rc::default();
        let time = Timebase::new(168_000_000);
        let mut spi = Spi::new();
        spi.wire = Box::new(Echo(Rc::clone(&seen)));
        spi.routed = [true; 3];
        spi.set_clock(2);
        let at = |cycle| time.at(cycle);
        for (offset, value) in [(0, 0), (4, 0), (8, 2), (0x10, 7), (0x20, 2)] {
            assert_eq!(spi.read(offset, at(0), &time), Some(value), "{offset:#x}");
        }
        // 84 MHz by 4: 64 cycles of 168 MHz for a byte.
        spi.write(0, SPE | MSTR | 1 << 3 | 0x300, at(0), &time);
        spi.write(0xC, 0xA5, at(100), &time);
        spi.write(0xC, 0x5A, at(101), &time);
        let cases = [(101, BSY), (163, BSY), (164, BSY | RXNE | TXE), (228, OVR | RXNE | TXE)];
        for (cycle, status) in cases {
            assert_eq!(spi.read(8, at(cycle), &time), Some(status), "{cycle}");
        }
        assert_eq!(spi.read(0xC, at(229), &time), Some(0x5A));
        assert_eq!(spi.read(8, at(230), &time), Some(OVR | TXE));
        assert_eq!(spi.read(8, at(231), &time), Some(TXE));
        let seen: Vec<_> = seen.borrow().iter().map(|(_, hz, byte)| (*hz, *byte)).collect();
        assert_eq!(seen, [(21_000_000, 0xA5), (21_000_000, 0x5A)]);
    }

    #[test]
    fn what_is_not_modelled_is_refused() {
        let time = Timebase::new(168_000_000);
        let now = time.at(0);
        for (offset, value) in [(0, SPE), (0, 1 << 13), (0, 1 << 15), (4, 0x10), (0x1C, 0x800), (0x24, 0)] {
            assert_eq!(Spi::new().write(offset, value, now, &time), None, "{offset:#x} {value:#x}");
        }
    }
}
