//! DMA1 and DMA2 (RM0090, chapter 10).
//!
//! An item moves when a device asks: no arbitration, no bus waits, no burst. FIFO errors (`FEIF`) and direct mode
//! errors are never set. Flow control by a device (SDIO) stops the machine.

use std::ops::ControlFlow;

use cortex_m4_model::Size;

/// Bits of `CR`.
const EN: u32 = 1;
const HTIE: u32 = 1 << 3;
const CIRC: u32 = 1 << 8;
const PINC: u32 = 1 << 9;
const MINC: u32 = 1 << 10;
const PFCTRL: u32 = 1 << 5;
const DBM: u32 = 1 << 18;
const CT: u32 = 1 << 19;
const TEIF: u32 = 1 << 3;
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;
/// Position of a stream's flags.
const PLACES: [u32; 4] = [0, 6, 16, 22];

/// A device's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Received (0: USART1, 1: USART2, 2: USART3, 3: UART4, 4: UART5, 5: USART6).
    UsartRx(u8),
    /// Takes a character.
    UsartTx(u8),
    /// Received by SPI1 to SPI3 (0 to 2).
    SpiRx(u8),
    /// Takes a word.
    SpiTx(u8),
}

/// The asking device, by stream and channel (RM0090, tables 42 and 43), as far as modelled.
pub fn request(dma: usize, stream: usize, channel: u32) -> Option<Request> {
    use Request::{SpiRx, SpiTx, UsartRx, UsartTx};
    Some(match (dma, channel, stream) {
        (0, 0, 0 | 2) => SpiRx(2),
        (0, 0, 3) => SpiRx(1),
        (0, 0, 4) => SpiTx(1),
        (0, 0, 5 | 7) => SpiTx(2),
        (0, 4, 0) => UsartRx(4),
        (0, 4, 1) => UsartRx(2),
        (0, 4, 2) => UsartRx(3),
        (0, 4, 3) | (0, 7, 4) => UsartTx(2),
        (0, 4, 4) => UsartTx(3),
        (0, 4, 5) => UsartRx(1),
        (0, 4, 6) => UsartTx(1),
        (0, 4, 7) => UsartTx(4),
        (1, 3, 0 | 2) => SpiRx(0),
        (1, 3, 3 | 5) => SpiTx(0),
        (1, 4, 2 | 5) => UsartRx(0),
        (1, 4, 7) => UsartTx(0),
        (1, 5, 1 | 2) => UsartRx(5),
        (1, 5, 6 | 7) => UsartTx(5),
        _ => return None,
    })
}

/// Memory and devices of DMA.
pub trait Port {
    /// `None`: refused.
    fn load(&mut self, address: u32, size: Size) -> Option<u32>;
    /// A store.
    fn store(&mut self, address: u32, size: Size, value: u32) -> Option<()>;
}

/// A stream.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stream {
    cr: u32,
    ndtr: u32,
    par: u32,
    mar: [u32; 2],
    fcr: u32,
    flags: u32,
    reload: u32,
    done: u32,
    stored: u32,
    fifo: [u8; 32],
    held: usize,
}

impl Stream {
    /// Its channel.
    pub fn channel(&self) -> u32 {
        self.cr >> 25 & 7
    }

    /// Items that are left.
    pub fn left(&self) -> u32 {
        self.ndtr
    }

    /// From memory to memory.
    pub fn copies(&self) -> bool {
        self.cr >> 6 & 3 == 2
    }

    fn size(bits: u32) -> Size {
        match bits & 3 {
            0 => Size::Byte,
            1 => Size::Half,
            _ => Size::Word,
        }
    }

    fn memory(&self) -> u32 {
        self.mar[usize::from(self.cr & (DBM | CT) == DBM | CT)]
    }

    fn begin(&mut self) {
        (self.reload, self.done, self.stored, self.held) = (self.ndtr, 0, 0, 0);
        if self.ndtr == 0 {
            self.cr &= !EN;
        }
    }

    fn end(&mut self, port: &mut impl Port) {
        self.flags |= if self.drain(port, true).is_break() { TEIF } else { 0 };
        self.flags |= TCIF;
    }

    fn push(&mut self, value: u32, size: Size) {
        let count = size.bytes() as usize;
        self.fifo[self.held..self.held + count].copy_from_slice(&value.to_le_bytes()[..count]);
        self.held += count;
    }

    fn pop(&mut self, size: Size) -> u32 {
        let count = size.bytes() as usize;
        let mut bytes = [0; 4];
        bytes[..count].copy_from_slice(&self.fifo[..count]);
        self.fifo.copy_within(count.., 0);
        self.held -= count;
        u32::from_le_bytes(bytes)
    }

    fn drain(&mut self, port: &mut impl Port, all: bool) -> ControlFlow<()> {
        let is_direct = self.fcr & 4 == 0;
        let size = Self::size(if is_direct { self.cr >> 11 } else { self.cr >> 13 });
        let threshold = if is_direct || all { 1 } else { 4 * (self.fcr as usize & 3) + 4 };
        if self.held < threshold {
            return ControlFlow::Continue(());
        }
        while self.held >= size.bytes() as usize {
            let value = self.pop(size);
            let step = if self.cr & MINC == 0 { 0 } else { self.stored };
            self.stored += size.bytes();
            if port.store(self.memory() + step, size, value).is_none() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    fn item(&mut self, port: &mut impl Port) -> ControlFlow<()> {
        let refused = ControlFlow::Break(());
        let psize = Self::size(self.cr >> 11);
        let msize = if self.fcr & 4 == 0 { psize } else { Self::size(self.cr >> 13) };
        let step = if self.cr & PINC == 0 { 0 } else { self.done * psize.bytes() };
        let device = self.par + step;
        if self.cr >> 6 & 3 == 1 {
            while self.held < psize.bytes() as usize {
                let step = if self.cr & MINC == 0 { 0 } else { self.stored };
                let Some(value) = port.load(self.memory() + step, msize) else { return refused };
                self.stored += msize.bytes();
                self.push(value, msize);
            }
            let value = self.pop(psize);
            if port.store(device, psize, value).is_none() {
                return refused;
            }
        } else {
            let Some(value) = port.load(device, psize) else { return refused };
            self.push(value, psize);
            let is_last = self.ndtr == 1;
            self.drain(port, is_last)?;
        }
        self.done += 1;
        self.ndtr -= 1;
        ControlFlow::Continue(())
    }

    /// Answers a request.
    pub fn serve(&mut self, port: &mut impl Port) {
        if self.item(port).is_break() {
            self.flags |= TEIF;
            self.cr &= !EN;
            return;
        }
        if self.ndtr == self.reload / 2 && self.reload > 1 {
            self.flags |= HTIF;
        }
        if self.ndtr > 0 {
            return;
        }
        self.flags |= TCIF;
        if self.cr & (CIRC | DBM) == 0 {
            self.cr &= !EN;
            return;
        }
        (self.ndtr, self.done, self.stored) = (self.reload, 0, 0);
        if self.cr & DBM != 0 {
            self.cr ^= CT;
        }
    }

    /// Whether it is on.
    pub fn is_on(&self) -> bool {
        self.cr & EN != 0
    }

    fn interrupts(&self) -> bool {
        // DMEIE, TEIE, HTIE and TCIE lie one below their flags.
        self.flags & (self.cr & (HTIE | HTIE << 1 | HTIE >> 1 | HTIE >> 2)) << 1 != 0
    }
}

/// A controller.
#[derive(Clone)]
pub struct Dma {
    /// Its streams.
    pub streams: [Stream; 8],
    /// Bits by stream.
    pub on: u8,
}

impl Default for Dma {
    fn default() -> Self {
        Self::new()
    }
}

impl Dma {
    /// As after a reset.
    pub fn new() -> Self {
        Self { streams: [Stream { fcr: 0x21, ..Stream::default() }; 8], on: 0 }
    }

    /// A request served.
    pub fn note(&mut self, stream: usize) {
        self.on = self.on & !(1 << stream) | u8::from(self.streams[stream].is_on()) << stream;
    }

    /// Interrupts by stream.
    pub fn interrupts(&self) -> u8 {
        (0..8).map(|stream| u8::from(self.streams[stream].interrupts()) << stream).sum()
    }

    fn flags(&self, first: usize) -> u32 {
        (0..4).map(|stream| self.streams[first + stream].flags << PLACES[stream]).sum()
    }

    /// The register at this offset.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.flags(0),
            0x04 => self.flags(4),
            0x08 | 0x0C => 0,
            0x10..0xD0 => {
                let stream = &self.streams[(offset as usize - 0x10) / 0x18];
                match (offset - 0x10) % 0x18 {
                    0x00 => stream.cr,
                    0x04 => stream.ndtr,
                    0x08 => stream.par,
                    0x0C => stream.mar[0],
                    0x10 => stream.mar[1],
                    // The FIFO's level: empty, below a quarter, and so on.
                    _ => stream.fcr & 0x87 | if stream.held == 0 { 4 } else { stream.held as u32 / 4 } << 3,
                }
            }
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, port: &mut impl Port) -> Option<()> {
        match offset {
            0x00 | 0x04 => {}
            0x08 | 0x0C => {
                let first = offset as usize - 8;
                for (stream, place) in PLACES.into_iter().enumerate() {
                    self.streams[first + stream].flags &= !(value >> place & 0x3D);
                }
            }
            0x10..0xD0 => {
                let number = (offset as usize - 0x10) / 0x18;
                let stream = &mut self.streams[number];
                let is_off = !stream.is_on();
                match (offset - 0x10) % 0x18 {
                    0x00 if value & PFCTRL != 0 => return None,
                    0x00 => {
                        let was_on = stream.is_on();
                        if was_on && value & EN == 0 && stream.ndtr > 0 {
                            stream.end(port);
                        }
                        stream.cr = value & 0x0FFF_FFFF;
                        if !was_on && stream.is_on() {
                            stream.begin();
                        }
                    }
                    0x04 if is_off => stream.ndtr = value & 0xFFFF,
                    0x08 if is_off => stream.par = value,
                    0x0C if is_off || stream.cr & (DBM | CT) == DBM | CT => stream.mar[0] = value,
                    0x10 if is_off || stream.cr & (DBM | CT) == DBM => stream.mar[1] = value,
                    0x14 if is_off => stream.fcr = value & 0x87 | 0x20,
                    _ => {}
                }
                self.note(number);
            }
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Memory from `0x2000_0000` on; a counting register at `0x4000_0004`.
    struct Board {
        memory: [u8; 64],
        device: u8,
        written: Vec<u32>,
    }

    impl Board {
        fn new() -> Self {
            Self { memory: [0xEE; 64], device: 0, written: Vec::new() }
        }
    }

    impl Port for Board {
        fn load(&mut self, address: u32, size: Size) -> Option<u32> {
            if address == 0x4000_0004 {
                self.device += 1;
                return Some(u32::from(self.device));
            }
            let at = address.checked_sub(0x2000_0000)? as usize;
            let mut bytes = [0; 4];
            let count = size.bytes() as usize;
            bytes[..count].copy_from_slice(self.memory.get(at..at + count)?);
            Some(u32::from_le_bytes(bytes))
        }

        fn store(&mut self, address: u32, size: Size, value: u32) -> Option<()> {
            if address == 0x4000_0004 {
                self.written.push(value);
                return Some(());
            }
            let at = address.checked_sub(0x2000_0000)? as usize;
            let count = size.bytes() as usize;
            self.memory.get_mut(at..at + count)?.copy_from_slice(&value.to_le_bytes()[..count]);
            Some(())
        }
    }

    fn stream(board: &mut Board, cr: u32, items: u32, memory: u32, fcr: u32) -> Dma {
        let mut dma = Dma::new();
        for (offset, value) in
            [(0x14, items), (0x18, 0x4000_0004), (0x1C, memory), (0x24, fcr), (0x10, cr | EN)]
        {
            assert!(dma.write(offset, value, board).is_some());
        }
        dma
    }

    fn serve(dma: &mut Dma, board: &mut Board, times: usize) {
        for _ in 0..times {
            dma.streams[0].serve(board);
            dma.note(0);
        }
    }

    #[test]
    fn registers_have_the_manuals_reset_values() {
        for offset in (0..0xD0).step_by(4) {
            let value = if offset >= 0x10 && (offset - 0x10) % 0x18 == 0x14 { 0x21 } else { 0 };
            assert_eq!(Dma::new().read(offset), Some(value), "{offset:#x}");
        }
        assert_eq!(Dma::new().read(0xD0), None);
    }

    #[test]
    fn a_ring_tells_half_and_full_and_goes_on() {
        let mut board = Board::new();
        let mut dma = stream(&mut board, MINC | CIRC, 8, 0x2000_0000, 0);
        for (times, flags, left) in [(3, 0, 5), (1, HTIF, 4), (4, HTIF | TCIF, 8), (2, HTIF | TCIF, 6)] {
            serve(&mut dma, &mut board, times);
            assert_eq!((dma.read(0), dma.read(0x14)), (Some(flags), Some(left)));
        }
        assert_eq!(board.memory[..9], [9, 10, 3, 4, 5, 6, 7, 8, 0xEE]);
        dma.write(8, HTIF, &mut board);
        assert_eq!(dma.read(0), Some(TCIF));
    }

    #[test]
    fn a_normal_transfer_ends_and_its_interrupt_follows_its_enable() {
        for (enable, interrupts) in [(0, 0), (HTIE, 1), (HTIE << 1, 1), (HTIE >> 1, 0)] {
            let mut board = Board::new();
            board.memory[..3].copy_from_slice(&[7, 8, 9]);
            let mut dma = stream(&mut board, MINC | 1 << 6 | enable, 3, 0x2000_0000, 0);
            serve(&mut dma, &mut board, 3);
            assert_eq!(board.written, [7, 8, 9]);
            assert_eq!((dma.on, dma.interrupts()), (0, interrupts), "{enable:#x}");
        }
    }

    #[test]
    fn the_fifo_packs_bytes_into_words() {
        let mut board = Board::new();
        let mut dma = stream(&mut board, MINC | 2 << 13, 8, 0x2000_0000, 4 | 1);
        serve(&mut dma, &mut board, 7);
        assert_eq!(board.memory[..8], [0xEE; 8], "below half nothing goes");
        serve(&mut dma, &mut board, 1);
        assert_eq!(board.memory[..8], [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn two_buffers_take_turns() {
        let mut board = Board::new();
        let mut dma = stream(&mut board, MINC | DBM, 2, 0x2000_0000, 0);
        dma.write(0x20, 0x2000_0010, &mut board);
        serve(&mut dma, &mut board, 5);
        assert_eq!((board.memory[..2].to_vec(), board.memory[16..18].to_vec()), (vec![5, 2], vec![3, 4]));
    }

    #[test]
    fn memory_that_dma_does_not_reach_is_an_error() {
        let mut board = Board::new();
        let mut dma = stream(&mut board, MINC, 2, 0x1000_0000, 0);
        serve(&mut dma, &mut board, 1);
        assert_eq!((dma.read(0), dma.on), (Some(TEIF), 0));
    }

    #[test]
    fn a_stream_that_is_switched_off_says_so_and_keeps_its_count() {
        let mut board = Board::new();
        let mut dma = stream(&mut board, MINC, 8, 0x2000_0000, 0);
        serve(&mut dma, &mut board, 3);
        dma.write(0x10, 0, &mut board);
        assert_eq!((dma.read(0), dma.read(0x14), dma.on), (Some(TCIF), Some(5), 0));
    }
}
