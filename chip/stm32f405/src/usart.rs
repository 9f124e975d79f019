//! A USART or UART in asynchronous mode (RM0090, chapter 30). Divider and bus clock give the rate; the sender has its
//! own.
//!
//! Not modelled: synchronous, smart card, infrared (`IrDA`), LIN, half duplex, hardware flow control, 9 bits, parity,
//! break, mute mode: they stop the machine. TE's first idle frame is left out.

use crate::line::Line;
use crate::time::{NEVER, Ps};

/// Bits of `SR`.
const FE: u32 = 1 << 1;
const NF: u32 = 1 << 2;
const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
/// Bits of `CR1`.
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const IDLEIE: u32 = 1 << 4;
const RXNEIE: u32 = 1 << 5;
const TCIE: u32 = 1 << 6;
const TXEIE: u32 = 1 << 7;
const UE: u32 = 1 << 13;
const OVER8: u32 = 1 << 15;
/// Modelled bits.
const CR1_KNOWN: u32 = RE | TE | IDLEIE | RXNEIE | TCIE | TXEIE | 1 << 8 | UE | OVER8;
const CR2_KNOWN: u32 = 0x3000;
const CR3_KNOWN: u32 = EIE | DMAR | DMAT | 1 << 11;
/// Bits of `CR3`.
const EIE: u32 = 1;
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

/// Counters of a port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Characters received.
    pub received: u64,
    /// Bytes lost, because the byte before was not fetched.
    pub overruns: u64,
    /// Low stop bits.
    pub framing: u64,
    /// Characters with noise.
    pub noise: u64,
    /// While reception was off.
    pub missed: u64,
    /// Characters not gone out at a change of rate or switching off.
    pub cut: u64,
}

/// The port.
#[derive(Clone)]
pub struct Usart {
    /// The input line.
    pub line: Line,
    /// Sent characters, with the end of each stop bit.
    pub sent: Vec<(Ps, u8)>,
    /// Reception, transmission.
    pub routed: (bool, bool),
    /// The transmitter stands still.
    pub is_stuck: bool,
    /// Counters.
    pub counts: Counts,
    sr: u32,
    cr: [u32; 3],
    brr: u32,
    gtpr: u32,
    received: u8,
    to_send: Option<u8>,
    /// The character on its way out, and its end.
    sending: Option<(u8, Ps)>,
    free: Ps,
    /// Start bit, and when the character is there.
    incoming: Option<(Ps, Ps)>,
    idle_at: Ps,
    /// The next read of DR clears errors.
    sr_was_read: bool,
    /// The next write of DR clears TC; DMA's writes alone do not.
    tc_was_read: bool,
    pclk: u32,
}

impl Default for Usart {
    fn default() -> Self {
        Self::new()
    }
}

impl Usart {
    /// As after a reset.
    pub fn new() -> Self {
        Self {
            line: Line::default(),
            sent: Vec::new(),
            routed: (false, false),
            is_stuck: false,
            counts: Counts::default(),
            sr: TC | TXE,
            cr: [0; 3],
            brr: 0,
            gtpr: 0,
            received: 0,
            to_send: None,
            sending: None,
            free: 0,
            incoming: None,
            idle_at: NEVER,
            sr_was_read: false,
            tc_was_read: false,
            pclk: 0,
        }
    }

    /// The line outside stays.
    pub fn reset(&mut self, now: Ps) {
        *self = Self {
            line: std::mem::take(&mut self.line),
            sent: std::mem::take(&mut self.sent),
            routed: self.routed,
            is_stuck: self.is_stuck,
            counts: self.counts,
            pclk: self.pclk,
            free: now,
            ..Self::new()
        };
    }

    /// The bus clock is this from now on.
    pub fn set_clock(&mut self, pclk: u32) {
        self.pclk = pclk;
    }

    /// `None`: no rate is set.
    fn bit(&self) -> Option<Ps> {
        let ticks = if self.cr[0] & OVER8 == 0 { self.brr } else { (self.brr >> 4) * 8 + (self.brr & 7) };
        (ticks > 0 && self.pclk > 0).then(|| u64::from(ticks) * 1_000_000_000_000 / u64::from(self.pclk))
    }

    /// The rate that the port runs at.
    pub fn baud(&self) -> f64 {
        self.bit().map_or(0.0, |bit| 1e12 / bit as f64)
    }

    fn listens(&self) -> bool {
        self.cr[0] & (UE | RE) == UE | RE && self.routed.0
    }

    /// When something happens next.
    pub fn deadline(&self) -> Ps {
        let reception = match self.incoming {
            Some((_, done)) => done,
            None if self.listens() => match (self.line.falls(self.free), self.bit()) {
                (NEVER, _) | (_, None) => NEVER,
                (edge, Some(bit)) => edge + 9 * bit + bit / 2,
            },
            None => NEVER,
        };
        let sending = self.sending.map_or(NEVER, |(_, end)| if self.is_stuck { NEVER } else { end });
        // Earlier characters take the idle line away.
        reception.min(sending).min(self.idle_at)
    }

    /// Handles due events.
    pub fn happen(&mut self, now: Ps) {
        if let Some((byte, end)) = self.sending.filter(|(_, end)| *end <= now && !self.is_stuck) {
            if self.routed.1 {
                self.sent.push((end, byte));
            }
            self.sending = None;
            match self.to_send.take() {
                Some(next) => self.send(next, end),
                None => self.sr |= TC,
            }
        }
        if !self.listens() {
            let waiting = self.line.waiting();
            self.line.forget(now);
            self.counts.missed += (waiting - self.line.waiting()) as u64;
            (self.incoming, self.free) = (None, self.free.max(now));
            return;
        }
        let Some(bit) = self.bit() else {
            // Its clock stands still.
            (self.incoming, self.idle_at, self.free) = (None, NEVER, now);
            return;
        };
        let edge = self.incoming.map_or_else(|| self.line.falls(self.free), |(edge, _)| edge);
        if edge != NEVER && edge + 9 * bit + bit / 2 <= now {
            self.incoming = None;
            self.receive(edge, bit);
        } else if edge <= now {
            self.incoming = Some((edge, edge + 9 * bit + bit / 2));
        }
        if self.idle_at <= now {
            if self.line.falls(self.free) >= self.idle_at && self.incoming.is_none() {
                self.sr |= IDLE;
            }
            self.idle_at = NEVER;
        }
        // A faster clock within a character: samples until now are over.
        if self.deadline() <= now {
            (self.incoming, self.idle_at, self.free) = (None, NEVER, now);
        }
    }

    fn receive(&mut self, edge: Ps, bit: Ps) {
        let Some(seen) = self.line.sample(edge, bit) else {
            self.free = edge + bit / 2;
            return;
        };
        self.free = edge + 9 * bit + bit / 2;
        self.idle_at = self.free + 10 * bit + bit / 2;
        self.line.forget(edge);
        self.counts.received += 1;
        self.counts.noise += u64::from(seen.noise);
        self.counts.framing += u64::from(seen.framing);
        self.sr |= if seen.noise { NF } else { 0 } | if seen.framing { FE } else { 0 };
        if self.sr & RXNE != 0 {
            self.sr |= ORE;
            self.counts.overruns += 1;
        } else {
            self.received = seen.byte;
            self.sr |= RXNE;
        }
    }

    fn send(&mut self, byte: u8, now: Ps) {
        let stop = if self.cr[1] >> 12 & 3 == 2 { 2 } else { 1 };
        let end = self.bit().map_or(NEVER, |bit| now + (9 + stop) * bit);
        self.sending = Some((byte, end));
        self.sr |= TXE;
    }

    /// DMA is to fetch a character.
    pub fn wants_fetch(&self) -> bool {
        self.cr[2] & DMAR != 0 && self.sr & RXNE != 0
    }

    /// DMA is to bring a character.
    pub fn wants_byte(&self) -> bool {
        self.cr[2] & DMAT != 0 && self.sr & TXE != 0 && self.cr[0] & (UE | TE) == UE | TE
    }

    /// The level of its interrupt.
    pub fn interrupts(&self) -> bool {
        let [cr1, _, cr3] = self.cr;
        let sr = self.sr;
        cr1 & RXNEIE != 0 && sr & (RXNE | ORE) != 0
            || cr1 & (TXEIE | TCIE | IDLEIE) & sr != 0
            || cr3 & EIE != 0 && cr3 & DMAR != 0 && sr & (FE | NF | ORE) != 0
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => {
                (self.sr_was_read, self.tc_was_read) = (true, true);
                self.sr
            }
            0x04 => {
                self.sr &= !RXNE;
                if std::mem::take(&mut self.sr_was_read) {
                    self.sr &= !(FE | NF | ORE | IDLE | 1);
                }
                u32::from(self.received)
            }
            0x08 => self.brr,
            0x0C..=0x14 => self.cr[(offset as usize - 0xC) / 4],
            0x18 => self.gtpr,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: Ps) -> Option<()> {
        match offset {
            // Written to 0 these are cleared.
            0x00 => self.sr &= value | !(RXNE | TC),
            0x04 => self.write_data(value as u8, now),
            0x08 => {
                self.cut();
                self.brr = value & 0xFFFF;
            }
            0x0C => {
                if value & 0xFFFF & !CR1_KNOWN != 0 {
                    return None;
                }
                let listened = self.listens();
                self.cr[0] = value & CR1_KNOWN;
                if self.listens() && !listened {
                    self.free = now;
                }
                if value & UE == 0 {
                    self.cut();
                    (self.incoming, self.idle_at) = (None, NEVER);
                }
            }
            0x10 if value & 0x7FFF & !CR2_KNOWN == 0 => self.cr[1] = value & CR2_KNOWN,
            0x14 if value & 0xFFF & !CR3_KNOWN == 0 => self.cr[2] = value & CR3_KNOWN,
            0x18 => self.gtpr = value & 0xFFFF,
            _ => return None,
        }
        Some(())
    }

    /// Is lost.
    fn cut(&mut self) {
        if self.sending.take().is_some() {
            self.counts.cut += 1 + u64::from(self.to_send.take().is_some());
            self.sr |= TXE | TC;
        }
    }

    fn write_data(&mut self, byte: u8, now: Ps) {
        if self.cr[0] & (UE | TE) != UE | TE {
            return;
        }
        if std::mem::take(&mut self.tc_was_read) {
            self.sr &= !TC;
        }
        if self.sending.is_none() {
            self.send(byte, now);
        } else {
            // A waiting one is lost (manual).
            self.to_send = Some(byte);
            self.sr &= !TXE;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::{Flaw, chars};

    /// APB2 at 84 MHz, 921,600 baud.
    fn port() -> Usart {
        let mut port = Usart::new();
        port.set_clock(84_000_000);
        port.routed = (true, true);
        port.write(0x08, 91, 0);
        port.write(0x0C, UE | TE | RE, 0);
        port
    }

    #[test]
    fn a_clock_that_becomes_faster_within_a_character_does_not_stop_it() {
        let mut port = port();
        port.set_clock(8_000_000);
        port.line.extend(chars(b"UUUUUUUUUUUUUUUU", 0, 921_600.0).0);
        let (end, mut last) = (port.deadline(), 0);
        port.happen(end - 1);
        port.set_clock(84_000_000);
        while port.deadline() != NEVER {
            let now = port.deadline().max(end);
            port.happen(now);
            assert!(port.deadline() > now && now > last, "{now} after {last}");
            last = now;
        }
    }

    fn run(port: &mut Usart, mut each: impl FnMut(&mut Usart, Ps)) {
        for _ in 0..1_000 {
            let at = port.deadline();
            if at == NEVER {
                return;
            }
            port.happen(at);
            each(port, at);
        }
        panic!("it never ends");
    }

    #[test]
    fn registers_have_the_manuals_reset_values() {
        let mut port = Usart::new();
        for (offset, value) in [(0, 0xC0), (8, 0), (0xC, 0), (0x10, 0), (0x14, 0), (0x18, 0)] {
            assert_eq!(port.read(offset), Some(value), "{offset:#x}");
        }
        assert_eq!(port.read(0x1C), None);
        for (offset, bit) in [(0xC, 12), (0xC, 10), (0xC, 1), (0xC, 0), (0x10, 11), (0x14, 3), (0x14, 9)] {
            assert_eq!(port.write(offset, 1 << bit, 0), None, "{offset:#x} bit {bit}");
        }
    }

    #[test]
    fn the_rate_is_what_divider_and_clock_make() {
        let mut port = port();
        assert!((port.baud() - 923_076.9).abs() < 1.0, "{}", port.baud());
        port.write(0x0C, UE | TE | RE | OVER8, 0);
        port.write(0x08, 0x2D, 0);
        assert!((port.baud() - 4_000_000.0).abs() < 1.0, "{}", port.baud());
    }

    #[test]
    fn characters_come_at_their_times_and_are_told() {
        let mut port = port();
        let (sent, _) = chars(b"HUMS", 1_000_000, 921_600.0);
        port.line.extend(sent);
        let mut seen = Vec::new();
        run(&mut port, |port, at| {
            if port.read(0) == Some(0xE0) {
                seen.push((at / 1_000_000, port.read(4).unwrap_or(0) as u8));
            }
        });
        assert_eq!(seen, [(11, b'H'), (22, b'U'), (32, b'M'), (43, b'S')]);
        assert_eq!(port.read(0), Some(0xC0 | IDLE));
    }

    #[test]
    fn what_nobody_fetches_is_overrun() {
        let mut port = port();
        port.line.extend(chars(b"abc", 0, 921_600.0).0);
        run(&mut port, |_, _| ());
        assert_eq!(port.counts.overruns, 2);
        assert_eq!(port.read(0), Some(0xC0 | RXNE | ORE | IDLE));
        assert_eq!(port.read(4), Some(u32::from(b'a')));
        assert_eq!(port.read(0), Some(0xC0));
    }

    #[test]
    fn flaws_are_flagged_and_the_byte_is_given() {
        for (flaw, bit) in [(Flaw::None, 0), (Flaw::Noise, NF), (Flaw::Framing, FE)] {
            let mut port = port();
            let (mut sent, _) = chars(b"U", 0, 921_600.0);
            sent[0].flaw = flaw;
            port.line.extend(sent);
            let at = port.deadline();
            port.happen(at);
            assert_eq!(port.read(0), Some(0xC0 | RXNE | bit));
            assert_eq!(port.read(4), Some(u32::from(b'U')));
        }
    }

    #[test]
    fn transmission_has_two_places_and_ends_with_tc() {
        let mut port = port();
        assert_eq!(port.read(0), Some(TXE | TC));
        port.write(4, 0x31, 0);
        assert_eq!(port.read(0), Some(TXE));
        port.write(4, 0x32, 0);
        assert_eq!(port.read(0), Some(0));
        run(&mut port, |_, _| ());
        assert_eq!(port.read(0), Some(TXE | TC));
        let bytes: Vec<_> = port.sent.iter().map(|(at, byte)| (at / 1_000_000, *byte)).collect();
        assert_eq!(bytes, [(10, 0x31), (21, 0x32)]);
        port.is_stuck = true;
        port.write(4, 0x33, 0);
        assert_eq!(port.deadline(), NEVER);
    }

    #[test]
    fn what_has_not_gone_out_is_cut_by_another_rate_and_dma_s_bytes_leave_tc_alone() {
        let mut port = port();
        port.write(4, 0x31, 0);
        port.write(4, 0x32, 0);
        assert_eq!(port.read(0), Some(TC));
        port.write(0x08, 1_458, 0);
        run(&mut port, |_, _| ());
        assert_eq!((port.counts.cut, port.sent.len()), (2, 0));
        port.write(0x08, 91, 0);
        assert_eq!(port.counts.cut, 2);
    }

    #[test]
    fn interrupts_and_requests_follow_their_enables() {
        let cases = [
            (RXNEIE, 0, true, false),
            (0, DMAR, false, true),
            (0, DMAR | EIE, false, true),
            (TCIE, 0, true, false),
            (0, 0, false, false),
        ];
        for (cr1, cr3, interrupts, fetch) in cases {
            let mut port = port();
            port.write(0x0C, UE | TE | RE | cr1, 0);
            port.write(0x14, cr3, 0);
            port.line.extend(chars(b"x", 0, 921_600.0).0);
            port.happen(port.deadline());
            assert_eq!((port.interrupts(), port.wants_fetch()), (interrupts, fetch), "{cr1:#x} {cr3:#x}");
        }
    }
}
