//! The disk's SCSI commands.
//!
//! | command | answer |
//! |---|---|
//! | TEST UNIT READY | reads a block, so that a pulled card is noticed |
//! | REQUEST SENSE, INQUIRY (also its pages 00, 80, 83), REPORT LUNS | data |
//! | MODE SENSE (6, 10) | a header with the bit for write protection, and no page |
//! | READ CAPACITY (10, 16), READ FORMAT CAPACITIES | the card's blocks |
//! | READ (10, 12, 16) | blocks |
//! | START STOP UNIT | with `LOEJ` and without `START`: the host ejects the disk |
//! | PREVENT ALLOW MEDIUM REMOVAL | allowing is accepted, preventing refused |
//! | SYNCHRONIZE CACHE | done: there is no cache |
//! | any that writes | refused: write protected |
//! | any other | refused: unknown |
//!
//! A card that comes back after it was gone is reported once as a unit attention, so that the host reads its file system anew.

use hums_core::clock::Span;
use hums_recorder::{BLOCK_BYTES, Block, CardDevice, Trouble, WaitWork};

use crate::server::{Ahead, Chunk};

/// Blocks read ahead count for this long: nobody changes a card in this time.
const FRESH: Span = Span::from_millis(100);

/// Reason of a refusal: sense key, additional code and its qualifier (SPC-4, 4.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sense {
    /// Sense key.
    pub key: u8,
    /// Additional sense code.
    pub code: u8,
    /// Qualifier of the code.
    pub qualifier: u8,
}

impl Sense {
    /// No card in the slot.
    pub const NO_MEDIUM: Self = Self::new(0x02, 0x3A);
    /// The card did not give a block.
    pub const UNREADABLE: Self = Self::new(0x03, 0x11);
    /// The disk has no such command.
    pub const UNKNOWN_COMMAND: Self = Self::new(0x05, 0x20);
    /// A block beyond the card's end.
    pub const OUT_OF_RANGE: Self = Self::new(0x05, 0x21);
    /// A field of the command block.
    pub const INVALID_FIELD: Self = Self::new(0x05, 0x24);
    /// Another card may be in the slot.
    pub const CHANGED: Self = Self::new(0x06, 0x28);
    /// The disk cannot be written.
    pub const PROTECTED: Self = Self::new(0x07, 0x27);

    const fn new(key: u8, code: u8) -> Self {
        Self { key, code, qualifier: 0 }
    }
}

/// Accepted command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// No data.
    Done,
    /// This many bytes of [`Disk::reply`].
    Reply(usize),
    /// Blocks of the card. All of them exist.
    Blocks {
        /// The first one.
        first: u32,
        /// Their number.
        count: u32,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    Unknown,
    /// A card of this many blocks.
    Card(u32),
    Empty,
    Ejected,
}

/// Hexadecimal digits of the serial number.
pub const SERIAL_BYTES: usize = 24;

/// Removable disk, SPC-2.
const INQUIRY: [u8; 8] = [0, 0x80, 4, 2, 31, 0, 0, 0];
const NAMES: [u8; 28] = *b"HUMS    Card reader     1.0 ";
const REPLY_BYTES: usize = 48;
const _: () = assert!(INQUIRY.len() + NAMES.len() <= REPLY_BYTES && 4 + 8 + SERIAL_BYTES <= REPLY_BYTES);
/// `WP` of the device-specific parameter of a mode header (SBC-3, 6.5.1).
const WRITE_PROTECTED: u8 = 0x80;

/// A read-only disk on a card.
pub struct Disk<D> {
    card: D,
    serial: [u8; SERIAL_BYTES],
    sense: Sense,
    slot: Slot,
    /// The block behind the last ones that were read for the command in work, or the one before.
    next: Option<u32>,
    reply: [u8; REPLY_BYTES],
}

impl<D: CardDevice> Disk<D> {
    /// The disk of this card's slot. The serial number is the board's.
    pub const fn new(card: D, serial: [u8; SERIAL_BYTES]) -> Self {
        Self {
            card,
            serial,
            sense: Sense { key: 0, code: 0, qualifier: 0 },
            slot: Slot::Unknown,
            next: None,
            reply: [0; REPLY_BYTES],
        }
    }

    /// Whether the host has ejected the disk.
    pub fn is_ejected(&self) -> bool {
        self.slot == Slot::Ejected
    }

    /// Data of the last [`Answer::Reply`].
    pub const fn reply(&self) -> &[u8] {
        &self.reply
    }

    /// Executes a command block. `false`: it is refused, and REQUEST SENSE has the reason.
    pub fn command(&mut self, block: &[u8]) -> Option<Answer> {
        if block.first() != Some(&REQUEST_SENSE) {
            self.sense = Sense::default();
        }
        self.next = None;
        self.card.begin_service();
        let answer = self.execute(block);
        answer.map_err(|sense| self.sense = sense).ok()
    }

    /// Reads blocks of an accepted command into the chunk: up to `count`, up to the chunk's end, up to the first unreadable one.
    /// Returns their number. 0: the first one is unreadable.
    pub fn read(&mut self, first: u32, count: u32, chunk: &mut Chunk<'_>, meanwhile: WaitWork<'_>) -> u32 {
        let count = chunk.blocks.len().min(count as usize);
        let blocks = chunk.blocks.get_mut(..count).unwrap_or_default();
        let ahead = chunk.ahead.take().filter(|ahead| ahead.first == first);
        let read = match ahead.filter(|ahead| self.card.now().since(ahead.read) <= FRESH) {
            Some(ahead) => Ok(ahead.count.min(count)),
            None => self.readable(first, blocks, meanwhile),
        };
        let count = read.map_err(|sense| self.sense = sense).unwrap_or(0) as u32;
        self.next = first.checked_add(count).filter(|_| count > 0);
        count
    }

    /// Reads the blocks behind the last ones, once. If the card does not give them, the next command for them tries it again.
    pub fn read_ahead(&mut self, chunk: &mut Chunk<'_>, meanwhile: WaitWork<'_>) {
        let (Some(first), Slot::Card(blocks)) = (self.next.take(), self.slot) else { return };
        let count = chunk.blocks.len().min(blocks.saturating_sub(first) as usize);
        let blocks = chunk.blocks.get_mut(..count).unwrap_or_default();
        chunk.ahead = None;
        self.card.begin_service();
        if !blocks.is_empty() && self.access(|card| card.read_while(blocks, first, meanwhile)).is_ok() {
            chunk.ahead = Some(Ahead { first, count, read: self.card.now() });
        }
    }

    fn readable(
        &mut self,
        first: u32,
        blocks: &mut [Block],
        meanwhile: WaitWork<'_>,
    ) -> Result<usize, Sense> {
        // A card that was put in within the command is another one.
        let Slot::Card(_) = self.slot else { return Err(Sense::NO_MEDIUM) };
        self.card.begin_service();
        let all = self.access(|card| card.read_while(blocks, first, meanwhile));
        let Err(Sense::UNREADABLE) = all else { return all.map(|()| blocks.len()) };
        let mut count = 0;
        for (block, at) in blocks.chunks_mut(1).zip(first..) {
            match self.access(|card| card.read_while(block, at, meanwhile)) {
                Ok(()) => count += 1,
                Err(sense) if count == 0 => return Err(sense),
                Err(_) => break,
            }
        }
        Ok(count)
    }

    fn execute(&mut self, block: &[u8]) -> Result<Answer, Sense> {
        let command = Command::of(block)?;
        match command.code {
            TEST_UNIT_READY => {
                self.blocks()?;
                self.access(|card| card.read(&mut [[0; BLOCK_BYTES]], 0))?;
                Ok(Answer::Done)
            }
            REQUEST_SENSE => {
                let Sense { key, code, qualifier } = core::mem::take(&mut self.sense);
                let data = [0x70, 0, key, 0, 0, 0, 0, 10, 0, 0, 0, 0, code, qualifier, 0, 0, 0, 0];
                Ok(self.answer(&[&data], command.byte(4).into()))
            }
            INQUIRY_COMMAND => self.inquiry(&command),
            MODE_SENSE_6 => Ok(self.answer(&[&[3, 0, WRITE_PROTECTED, 0]], command.byte(4).into())),
            MODE_SENSE_10 => {
                Ok(self.answer(&[&[0, 6, 0, WRITE_PROTECTED, 0, 0, 0, 0]], command.u16(7).into()))
            }
            START_STOP_UNIT => {
                // `LOEJ` without `START`.
                if command.byte(4) & 3 == 2 {
                    self.slot = Slot::Ejected;
                }
                Ok(Answer::Done)
            }
            PREVENT_ALLOW if command.byte(4) & 1 == 1 => Err(Sense::INVALID_FIELD),
            PREVENT_ALLOW | SYNCHRONIZE_CACHE_10 | SYNCHRONIZE_CACHE_16 => Ok(Answer::Done),
            READ_FORMAT_CAPACITIES => {
                let blocks = self.blocks()?.to_be_bytes();
                // One descriptor, of formatted medium.
                let size = [2, 0, (BLOCK_BYTES >> 8) as u8, 0];
                Ok(self.answer(&[&[0, 0, 0, 8], &blocks, &size], command.u16(7).into()))
            }
            READ_CAPACITY_10 => {
                let last = (self.blocks()? - 1).to_be_bytes();
                Ok(self.answer(&[&last, &(BLOCK_BYTES as u32).to_be_bytes()], u32::MAX))
            }
            SERVICE_ACTION_IN if command.byte(1) & 0x1F == READ_CAPACITY_16 => {
                let last = u64::from(self.blocks()? - 1).to_be_bytes();
                let data: [&[u8]; 3] = [&last, &(BLOCK_BYTES as u32).to_be_bytes(), &[0; 20]];
                Ok(self.answer(&data, command.u32(10)))
            }
            READ_10 => self.blocks_at(command.u32(2).into(), command.u16(7).into()),
            READ_12 => self.blocks_at(command.u32(2).into(), command.u32(6)),
            READ_16 => {
                let first = u64::from(command.u32(2)) << 32 | u64::from(command.u32(6));
                self.blocks_at(first, command.u32(10))
            }
            REPORT_LUNS => Ok(self.answer(&[&[0, 0, 0, 8], &[0; 12]], command.u32(6))),
            code if WRITING.contains(&code) => Err(Sense::PROTECTED),
            _ => Err(Sense::UNKNOWN_COMMAND),
        }
    }

    /// INQUIRY (SPC-4, 6.4), with the pages that hosts ask for (7.8).
    fn inquiry(&mut self, command: &Command<'_>) -> Result<Answer, Sense> {
        let length = command.u16(3).into();
        let serial = self.serial;
        Ok(match (command.byte(1) & 1, command.byte(2)) {
            (0, 0) => self.answer(&[&INQUIRY, &NAMES], length),
            (1, 0x00) => self.answer(&[&[0, 0x00, 0, 3, 0x00, 0x80, 0x83]], length),
            (1, 0x80) => self.answer(&[&[0, 0x80, 0, SERIAL_BYTES as u8], &serial], length),
            (1, 0x83) => {
                // One designator: ASCII, of the vendor and the board (7.8.6.4).
                let head = [0, 0x83, 0, 12 + SERIAL_BYTES as u8, 2, 1, 0, 8 + SERIAL_BYTES as u8];
                self.answer(&[&head, &NAMES[..8], &serial], length)
            }
            _ => return Err(Sense::INVALID_FIELD),
        })
    }

    fn answer(&mut self, pieces: &[&[u8]], length: u32) -> Answer {
        let mut bytes = 0;
        for (to, from) in self.reply.iter_mut().zip(pieces.iter().copied().flatten()) {
            *to = *from;
            bytes += 1;
        }
        Answer::Reply(bytes.min(length as usize))
    }

    fn blocks(&mut self) -> Result<u32, Sense> {
        let was_empty = match self.slot {
            Slot::Card(blocks) => return Ok(blocks),
            Slot::Ejected => return Err(Sense::NO_MEDIUM),
            Slot::Unknown => false,
            Slot::Empty => true,
        };
        let blocks = self.access(CardDevice::num_blocks)?;
        if blocks == 0 {
            return Err(Sense::NO_MEDIUM);
        }
        self.slot = Slot::Card(blocks);
        if was_empty { Err(Sense::CHANGED) } else { Ok(blocks) }
    }

    fn blocks_at(&mut self, first: u64, count: u32) -> Result<Answer, Sense> {
        let blocks = self.blocks()?;
        let end = first.checked_add(u64::from(count)).ok_or(Sense::OUT_OF_RANGE)?;
        match u32::try_from(first) {
            Ok(first) if end <= u64::from(blocks) => Ok(Answer::Blocks { first, count }),
            _ => Err(Sense::OUT_OF_RANGE),
        }
    }

    fn access<T>(&mut self, act: impl FnOnce(&D) -> Result<T, D::Error>) -> Result<T, Sense> {
        act(&self.card).map_err(|error| match D::trouble(&error) {
            Trouble::Gone => {
                self.card.reset();
                self.slot = Slot::Empty;
                Sense::NO_MEDIUM
            }
            Trouble::Stuck | Trouble::Refusing | Trouble::Locked => Sense::UNREADABLE,
        })
    }
}

const TEST_UNIT_READY: u8 = 0x00;
const REQUEST_SENSE: u8 = 0x03;
const INQUIRY_COMMAND: u8 = 0x12;
const MODE_SENSE_6: u8 = 0x1A;
const START_STOP_UNIT: u8 = 0x1B;
const PREVENT_ALLOW: u8 = 0x1E;
const READ_FORMAT_CAPACITIES: u8 = 0x23;
const READ_CAPACITY_10: u8 = 0x25;
const READ_10: u8 = 0x28;
const SYNCHRONIZE_CACHE_10: u8 = 0x35;
const MODE_SENSE_10: u8 = 0x5A;
const READ_16: u8 = 0x88;
const SYNCHRONIZE_CACHE_16: u8 = 0x91;
const SERVICE_ACTION_IN: u8 = 0x9E;
const READ_CAPACITY_16: u8 = 0x10;
const REPORT_LUNS: u8 = 0xA0;
const READ_12: u8 = 0xA8;

/// FORMAT UNIT, WRITE (6), (10), AND VERIFY (10), WRITE SAME (10), UNMAP, WRITE (16), AND VERIFY (16), WRITE SAME (16), WRITE (12),
/// AND VERIFY (12).
pub const WRITING: [u8; 11] = [0x04, 0x0A, 0x2A, 0x2E, 0x41, 0x42, 0x8A, 0x8E, 0x93, 0xAA, 0xAE];

struct Command<'a> {
    code: u8,
    block: &'a [u8],
}

impl<'a> Command<'a> {
    /// Lengths by group of codes: SPC-4, 4.3.
    fn of(block: &'a [u8]) -> Result<Self, Sense> {
        let code = *block.first().ok_or(Sense::INVALID_FIELD)?;
        let bytes = match code >> 5 {
            0 => 6,
            1 | 2 => 10,
            4 => 16,
            5 => 12,
            _ => return Err(Sense::UNKNOWN_COMMAND),
        };
        if block.len() < bytes { Err(Sense::INVALID_FIELD) } else { Ok(Self { code, block }) }
    }

    fn bytes<const COUNT: usize>(&self, at: usize) -> [u8; COUNT] {
        self.block.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; COUNT])
    }

    fn byte(&self, at: usize) -> u8 {
        u8::from_be_bytes(self.bytes(at))
    }

    fn u16(&self, at: usize) -> u16 {
        u16::from_be_bytes(self.bytes(at))
    }

    fn u32(&self, at: usize) -> u32 {
        u32::from_be_bytes(self.bytes(at))
    }
}
