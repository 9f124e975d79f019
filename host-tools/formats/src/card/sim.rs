//! A simulated card: an image file with a real card's faults and slowness, in the simulation's time. Every
//! operation advances the card's clock; a stall is a longer operation.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use hums_recorder::{BLOCK_BYTES, Block, CardDevice};

use super::faults::{Cut, Faults, Stall};
use crate::rng::Rng;

/// Microseconds of a command besides its data: a usual card's programming time.
const COMMAND_US: u64 = 300;
/// Microseconds of a block over SPI at 21 MHz.
const BLOCK_US: u64 = 200;
/// The driver's timeout for a missing card, microseconds.
const ABSENT_US: u64 = 10_000;

const PURPOSE: u64 = 2;

/// The reason that an operation failed.
#[derive(Debug)]
pub enum CardError {
    /// The power is off: all operations fail.
    PowerGone,
    /// No card is in the slot.
    Absent,
    /// The card refused the write.
    WriteRefused,
    /// The block is beyond the card's end.
    OutOfRange,
    /// The image file itself failed.
    Image(io::Error),
}

impl std::fmt::Display for CardError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::PowerGone => f.write_str("power has gone"),
            Self::Absent => f.write_str("no card"),
            Self::WriteRefused => f.write_str("the card refused a write"),
            Self::OutOfRange => f.write_str("beyond the card's end"),
            Self::Image(error) => write!(f, "the image file: {error}"),
        }
    }
}

impl std::error::Error for CardError {}

/// One block write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The clock at the start, microseconds.
    pub at_us: u64,
    /// Which block.
    pub block: u32,
    /// Its new content.
    pub bytes: Block,
    /// Blocks behind it in the same command: undefined meanwhile (SD specification, 4.3.4).
    pub behind: u32,
}

/// A card in an image file.
#[derive(Debug)]
pub struct SimCard {
    image: RefCell<File>,
    blocks: u32,
    faults: Faults,
    rng: RefCell<Rng>,
    clock_us: Cell<u64>,
    writes: Cell<u64>,
    dead: Cell<bool>,
    keeps_logs: bool,
    image_error: RefCell<Option<io::Error>>,
    trace: RefCell<Option<Vec<Written>>>,
}

impl SimCard {
    /// A card of `image`'s whole blocks.
    pub fn new(image: File, faults: Faults) -> io::Result<Self> {
        let blocks = image.metadata()?.len() / BLOCK_BYTES as u64;
        let rng = RefCell::new(Rng::new(faults.seed, PURPOSE));
        Ok(Self {
            image: RefCell::new(image),
            blocks: u32::try_from(blocks).unwrap_or(u32::MAX),
            faults,
            rng,
            clock_us: Cell::new(0),
            writes: Cell::new(0),
            dead: Cell::new(false),
            keeps_logs: false,
            image_error: RefCell::new(None),
            trace: RefCell::new(None),
        })
    }

    /// Whether logs of earlier power-ons are kept or may be overwritten.
    #[must_use]
    pub fn keeping_logs(self, keeps_logs: bool) -> Self {
        Self { keeps_logs, ..self }
    }

    /// Whether logs of earlier power-ons are kept.
    pub const fn keeps_logs(&self) -> bool {
        self.keeps_logs
    }

    /// Microseconds since the first input byte.
    pub fn set_clock(&self, now_us: u64) {
        self.clock_us.set(now_us);
    }

    /// The time set, plus operations since then, microseconds.
    pub fn clock(&self) -> u64 {
        self.clock_us.get()
    }

    /// Writes that reached the card, a torn one included.
    pub fn writes(&self) -> u64 {
        self.writes.get()
    }

    /// Keeps every write for [`Self::take_trace`].
    pub fn start_trace(&self) {
        self.trace.replace(Some(Vec::new()));
    }

    /// Traced block writes.
    pub fn take_trace(&self) -> Vec<Written> {
        self.trace.take().unwrap_or_default()
    }

    /// Whether the power is off.
    pub fn is_dead(&self) -> bool {
        self.dead.get()
    }

    /// Whether a card is in the slot.
    pub fn is_present(&self) -> bool {
        let now = self.clock();
        !self.faults.outs.iter().any(|out| (out.from_us..out.to_us).contains(&now))
    }

    /// The image file's own error: a full disk is not the simulated card's fault.
    pub fn take_image_error(&self) -> Option<io::Error> {
        self.image_error.borrow_mut().take()
    }

    fn begin(&self, cost_us: u64) -> Result<(), CardError> {
        if self.is_dead() {
            return Err(CardError::PowerGone);
        }
        let now = self.clock();
        let end_of = |stall: &Stall| stall.from_us.saturating_add(stall.for_us);
        let stalled = self.faults.stalls.iter().filter(|stall| (stall.from_us..end_of(stall)).contains(&now));
        let free_at = stalled.map(end_of).max().unwrap_or(now);
        if self.is_present() {
            self.clock_us.set(free_at.saturating_add(cost_us));
        }
        if self.is_present() {
            return Ok(());
        }
        self.clock_us.set(self.clock().saturating_add(ABSENT_US));
        Err(CardError::Absent)
    }

    /// False if the power failed meanwhile.
    fn write_block(
        &self,
        bytes: &[u8; BLOCK_BYTES],
        block: u32,
        behind: u32,
        at_us: u64,
    ) -> Result<(), CardError> {
        if self.rng.borrow_mut().chance(self.faults.write_error) {
            return Err(CardError::WriteRefused);
        }
        let count = self.writes.get() + 1;
        self.writes.set(count);
        if let Some(trace) = self.trace.borrow_mut().as_mut() {
            trace.push(Written { at_us, block, bytes: *bytes, behind });
        }
        let cut = self.faults.cuts.iter().filter(|cut| cut.write <= count).min_by_key(|cut| cut.write);
        let bytes = match cut {
            Some(Cut { torn: true, .. }) => bytes.get(..BLOCK_BYTES / 2).unwrap_or_default(),
            _ => &bytes[..],
        };
        let mut image = self.image.borrow_mut();
        let result = image
            .seek(SeekFrom::Start(u64::from(block) * BLOCK_BYTES as u64))
            .and_then(|_| image.write_all(bytes));
        result.map_err(|error| self.keep(error))?;
        if cut.is_some() {
            for block in block + 1..=block + behind {
                let at = SeekFrom::Start(u64::from(block) * BLOCK_BYTES as u64);
                let erased = image.seek(at).and_then(|_| image.write_all(&[0; BLOCK_BYTES]));
                erased.map_err(|error| self.keep(error))?;
            }
            self.dead.set(true);
            return Err(CardError::PowerGone);
        }
        Ok(())
    }

    /// The power fails with the image file: the recorder would take it for refused writes, and go on over
    /// older logs.
    fn keep(&self, error: io::Error) -> CardError {
        self.dead.set(true);
        let copy = io::Error::new(error.kind(), error.to_string());
        self.image_error.borrow_mut().get_or_insert(copy);
        CardError::Image(error)
    }

    fn check_range(&self, start: u32, count: usize) -> Result<(), CardError> {
        let end = u64::from(start) + count as u64;
        if end <= u64::from(self.blocks) { Ok(()) } else { Err(CardError::OutOfRange) }
    }
}

impl CardDevice for SimCard {
    type Error = CardError;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), CardError> {
        self.begin(COMMAND_US + BLOCK_US * blocks.len() as u64)?;
        self.check_range(start, blocks.len())?;
        let mut image = self.image.borrow_mut();
        image
            .seek(SeekFrom::Start(u64::from(start) * BLOCK_BYTES as u64))
            .map_err(|error| self.keep(error))?;
        for block in blocks {
            image.read_exact(block).map_err(|error| self.keep(error))?;
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: u32) -> Result<(), CardError> {
        self.begin(COMMAND_US + BLOCK_US * blocks.len() as u64)?;
        self.check_range(start, blocks.len())?;
        if self.faults.keeps_table && start == 0 {
            return Err(CardError::WriteRefused);
        }
        for (index, block) in (0..).zip(blocks) {
            let left = blocks.len() as u32 - index;
            let at_us = self.clock().saturating_sub(BLOCK_US * u64::from(left));
            self.write_block(block, start + index, left - 1, at_us)?;
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<u32, CardError> {
        self.begin(COMMAND_US)?;
        Ok(self.blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::super::faults::CardOut;
    use super::*;

    fn card(faults: Faults) -> SimCard {
        let image = tempfile::tempfile().expect("temporary file");
        image.set_len(64 * 512).expect("64 blocks");
        SimCard::new(image, faults).expect("card")
    }

    fn block(byte: u8) -> Block {
        [byte; BLOCK_BYTES]
    }

    fn content(card: &SimCard, index: u32) -> [u8; 512] {
        let mut image = card.image.borrow_mut();
        let mut bytes = [0; 512];
        image.seek(SeekFrom::Start(u64::from(index) * 512)).expect("seek");
        image.read_exact(&mut bytes).expect("read");
        bytes
    }

    #[test]
    fn power_goes_within_a_write_of_several_blocks() {
        for torn in [false, true] {
            let card = card(Faults { cuts: vec![Cut { write: 4, torn }], ..Faults::default() });
            card.write(&[block(1)], 0).expect("first");
            card.write(&[block(9)], 3).expect("before");
            let cut = card.write(&[block(2), block(3), block(4)], 1);
            assert!(matches!(cut, Err(CardError::PowerGone)));
            assert_eq!(content(&card, 1), [2; 512]);
            assert_eq!(content(&card, 2)[..256], [3; 256]);
            assert_eq!(content(&card, 2)[256..], [if torn { 0 } else { 3 }; 256]);
            assert_eq!(content(&card, 3), [0; 512], "erased before it came");
            assert!(card.is_dead() && card.write(&[block(5)], 0).is_err());
            assert_eq!(card.writes(), 4);
        }
    }

    #[test]
    fn a_stall_takes_its_time_and_then_the_write_is_done() {
        let stall = Stall { from_us: 1_000_000, for_us: 2_500_000 };
        let card = card(Faults { stalls: vec![stall], ..Faults::default() });
        card.set_clock(999_000);
        card.write(&[block(1)], 0).expect("before");
        assert!(card.clock() < 1_000_000);
        card.set_clock(1_400_000);
        card.write(&[block(2)], 0).expect("stalled");
        assert_eq!(card.clock(), 3_500_000 + COMMAND_US + BLOCK_US);
        assert_eq!(content(&card, 0), [2; 512]);
    }

    #[test]
    fn a_card_that_is_out_comes_back_with_its_content() {
        let out = CardOut { from_us: 1_000_000, to_us: 2_000_000 };
        let card = card(Faults { outs: vec![out], ..Faults::default() });
        card.write(&[block(1)], 0).expect("before");
        card.set_clock(1_500_000);
        assert!(matches!(card.write(&[block(2)], 0), Err(CardError::Absent)));
        card.set_clock(2_000_000);
        let mut back = [[0; BLOCK_BYTES]];
        card.read(&mut back, 0).expect("after");
        assert_eq!(back[0], [1; 512]);
    }

    #[test]
    fn write_errors_repeat_with_the_seed() {
        let run = |seed| {
            let card = card(Faults { write_error: 0.3, seed, ..Faults::default() });
            (0..60).map(|at| card.write(&[block(1)], at).is_ok()).collect::<Vec<_>>()
        };
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
        assert!(run(1).contains(&true) && run(1).contains(&false));
    }

    #[test]
    fn a_card_that_keeps_its_table_cannot_be_formatted() {
        for keeps_table in [true, false] {
            let image = tempfile::tempfile().expect("temporary file");
            image.set_len(34 << 20).expect("the smallest card");
            let card = SimCard::new(image, Faults { keeps_table, ..Faults::default() }).expect("card");
            assert_eq!(hums_recorder::format::format(&card, 1).is_err(), keeps_table);
            assert_eq!(card.writes() == 0, keeps_table, "nothing of it was written");
        }
    }

    #[test]
    fn an_image_that_fails_is_a_card_whose_power_has_gone() {
        let image = tempfile::NamedTempFile::new().expect("temporary file");
        image.as_file().set_len(64 * 512).expect("64 blocks");
        let card =
            SimCard::new(File::open(image.path()).expect("for reading"), Faults::default()).expect("card");
        assert!(matches!(card.write(&[block(1)], 3), Err(CardError::Image(_))));
        assert!(matches!(card.read(&mut [block(1)], 3), Err(CardError::PowerGone)));
        assert!(card.take_image_error().is_some());
    }

    #[test]
    fn the_end_of_the_card_is_an_error() {
        let card = card(Faults::default());
        assert!(matches!(card.write(&[block(1), block(1)], 63), Err(CardError::OutOfRange)));
        assert!(matches!(card.read(&mut [[0; BLOCK_BYTES]], u32::MAX), Err(CardError::OutOfRange)));
        assert_eq!(card.num_blocks().expect("size"), 64);
    }
}
