//! A card with known contents, and a host.

use std::cell::Cell;
use std::rc::Rc;

use hums_core::clock::{Instant, Span};
use hums_recorder::{BLOCK_BYTES, Block, CardDevice, Trouble};
use hums_usb::PACKET_BYTES;
use hums_usb::scsi::{Disk, Sense};
use hums_usb::server::Chunk;
use hums_usb::transport::{InvalidPacket, STATUS_BYTES, Step, Transport};

pub(crate) const BLOCKS: u32 = 1_000;
pub(crate) const SERIAL: [u8; 24] = *b"0123456789ABCDEF01234567";
pub(crate) const CHUNK: usize = 4;
/// `bCBWFlags` of a command whose data goes to the host.
pub(crate) const IN: u8 = 0x80;
pub(crate) const OUT: u8 = 0;

#[derive(Clone, Default)]
pub(crate) struct Numbered {
    /// It is not in the slot.
    pub(crate) gone: Rc<Cell<bool>>,
    /// This block cannot be read.
    pub(crate) bad: Rc<Cell<Option<u32>>>,
    /// It was looked for anew.
    pub(crate) resets: Rc<Cell<u32>>,
    /// The highest block that was read, plus 1.
    pub(crate) end: Rc<Cell<u32>>,
    pub(crate) reads: Rc<Cell<u32>>,
    pub(crate) now: Rc<Cell<Instant>>,
    /// Its content is another one.
    pub(crate) edition: Rc<Cell<u32>>,
}

pub(crate) fn content(number: u32) -> Block {
    let mut block = [0; BLOCK_BYTES];
    block.chunks_exact_mut(4).for_each(|word| word.copy_from_slice(&number.to_le_bytes()));
    block
}

impl CardDevice for Numbered {
    type Error = Trouble;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), Trouble> {
        if self.gone.get() {
            return Err(Trouble::Gone);
        }
        for (number, block) in (start..).zip(blocks) {
            if self.bad.get() == Some(number) {
                // As a bus that failed in the middle of the block.
                block[..100].fill(0xEE);
                return Err(Trouble::Refusing);
            }
            self.end.set(self.end.get().max(number + 1));
            self.reads.set(self.reads.get() + 1);
            *block = content(number + (self.edition.get() << 16));
        }
        Ok(())
    }

    fn write(&self, _: &[Block], _: u32) -> Result<(), Trouble> {
        panic!("the disk writes");
    }

    fn num_blocks(&self) -> Result<u32, Trouble> {
        if self.gone.get() { Err(Trouble::Gone) } else { Ok(BLOCKS) }
    }

    fn now(&self) -> Instant {
        self.now.get()
    }

    fn reset(&self) {
        self.resets.set(self.resets.get() + 1);
    }

    fn trouble(error: &Trouble) -> Trouble {
        *error
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Got {
    pub(crate) data: Vec<u8>,
    pub(crate) taken: usize,
    pub(crate) status: u8,
    pub(crate) residue: u32,
}

pub(crate) struct Host {
    pub(crate) disk: Disk<Numbered>,
    pub(crate) card: Numbered,
    chunks: [Chunk<'static>; 3],
    tag: u32,
}

/// A command wrapper.
pub(crate) fn wrapper(tag: u32, expected: u32, flags: u8, block: &[u8]) -> Vec<u8> {
    let mut packet = b"USBC".to_vec();
    packet.extend(tag.to_le_bytes());
    packet.extend(expected.to_le_bytes());
    packet.extend([flags, 0, block.len() as u8]);
    packet.extend(block);
    packet.resize(31, 0);
    packet
}

impl Host {
    pub(crate) fn new() -> Self {
        let card = Numbered::default();
        let memory = Vec::leak(vec![[0xAA; BLOCK_BYTES]; 3 * CHUNK]);
        Self { disk: Disk::new(card.clone(), SERIAL), card, chunks: Chunk::of(memory), tag: 0 }
    }

    /// Changes the card in the least time that a person needs.
    pub(crate) fn change_card(&mut self) {
        self.card.now.set(self.card.now.get() + Span::from_millis(101));
        self.card.edition.set(self.card.edition.get() + 1);
    }

    pub(crate) fn run(&mut self, expected: u32, flags: u8, block: &[u8]) -> Got {
        self.tag += 1;
        self.packet(&wrapper(self.tag, expected, flags, block)).expect("a valid wrapper")
    }

    pub(crate) fn packet(&mut self, packet: &[u8]) -> Result<Got, InvalidPacket> {
        let mut transport = Transport::begin(packet, &mut self.disk)?;
        let expected = u32::from_le_bytes(packet[8..12].try_into().unwrap());
        let (mut data, mut taken, mut is_open) = (Vec::new(), 0, true);
        loop {
            let step = transport.step(&mut self.disk, &mut self.chunks[0], &mut || true);
            let bytes = self.chunks[0].data();
            match step {
                Step::Send => {
                    assert!(is_open && packet[12] == IN, "data after the end, or to a host that sends");
                    is_open = bytes.len().is_multiple_of(PACKET_BYTES) && !bytes.is_empty();
                    data.extend_from_slice(bytes);
                    assert!(data.len() <= expected as usize, "more than the host expects");
                    self.chunks.rotate_left(1);
                }
                Step::Take => {
                    assert!(packet[12] == OUT);
                    let bytes = (expected as usize - taken).min(PACKET_BYTES);
                    assert!(bytes > 0, "it takes more than the host sends");
                    transport.taken(bytes);
                    taken += bytes;
                }
                Step::End => {
                    let status: [u8; STATUS_BYTES] = bytes.try_into().unwrap();
                    assert_eq!((&status[..4], &status[4..8]), (&b"USBS"[..], &packet[4..8]));
                    let residue = u32::from_le_bytes(status[8..12].try_into().unwrap());
                    assert_eq!(residue as usize, expected as usize - data.len());
                    if expected > 0 && packet[12] == IN && data.len() < expected as usize {
                        assert!(!is_open, "the host waits for more data");
                    }
                    if packet[12] == OUT {
                        assert_eq!(taken, expected as usize, "bytes of the host are left");
                    }
                    self.chunks.rotate_left(1);
                    self.disk.read_ahead(&mut self.chunks[0], &mut || true);
                    return Ok(Got { data, taken, status: status[12], residue });
                }
            }
        }
    }

    pub(crate) fn sense(&mut self) -> Sense {
        let got = self.run(18, IN, &[3, 0, 0, 0, 18, 0]);
        assert_eq!((got.status, got.data[0], got.data[7]), (0, 0x70, 10));
        Sense { key: got.data[2], code: got.data[12], qualifier: got.data[13] }
    }

    pub(crate) fn refused(&mut self, expected: u32, flags: u8, block: &[u8]) -> Sense {
        let got = self.run(expected, flags, block);
        assert_eq!((got.status, got.data.len()), (1, 0), "{block:x?}");
        self.sense()
    }
}

/// READ (10).
pub(crate) fn read_10(first: u32, count: u16) -> [u8; 10] {
    let mut block = [0x28, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    block[2..6].copy_from_slice(&first.to_be_bytes());
    block[7..9].copy_from_slice(&count.to_be_bytes());
    block
}
