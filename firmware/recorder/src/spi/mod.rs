//! An SD card on an SPI bus, as a block device with limited waits.
//!
//! * Each wait has a limit, and all waits of one service together have one: [`SERVICE_MAX`]. The recorder then gives
//!   the card up, reports it, and tries again.
//! * Checksums in both directions, on every card with them: a damaged block is sent again, [`TRIES`] times in all.
//! * Many blocks go with one command, and the card's status is read afterwards.
//! * A card that lost its power for a moment is identified again at the next try. It is used only if it is the same
//!   one (its CID), because the layers above know the places of its files.
//!
//! The driver waits with the processor: it belongs to the least urgent task.
//!
//! Source: SD Specifications Part 1, Physical Layer Simplified Specification 9.10, chapter 7.

mod crc;
mod error;
mod identify;
mod line;
pub mod port;
mod registers;

use core::cell::RefCell;

use crate::{BLOCK_BYTES, Block, CardDevice, WaitWork};
use hums_core::clock::{Instant, Span};

pub use error::SpiError;
pub use line::BUSY_MAX;
pub use port::{Clock, Port, PortFailure};

use crate::Trouble;
use identify::Identity;
use line::{Line, TOKEN_MANY, TOKEN_ONE};

/// Time limit of all waits of one service together. Storage must report in every 10 s.
pub const SERVICE_MAX: Span = Span::from_secs(8);
/// Tries of an access whose failure may be temporary.
pub const TRIES: u32 = 3;

const READ: u8 = 17;
const READ_MANY: u8 = 18;
const ERASE_BEFORE: u8 = 23;
const WRITE: u8 = 24;
const WRITE_MANY: u8 = 25;

/// A card.
pub struct SpiCard<P> {
    inner: RefCell<Inner<P>>,
}

struct Inner<P> {
    line: Line<P>,
    /// `None`: the card must be identified before it is used.
    card: Option<Identity>,
    cid: Option<[u8; 16]>,
    retries: u32,
}

impl<P: Port> SpiCard<P> {
    /// Looked for at the first access.
    pub const fn new(port: P) -> Self {
        let line = Line { port, deadline: None, checks: false, busy_times: 0 };
        Self { inner: RefCell::new(Inner { line, card: None, cid: None, retries: 0 }) }
    }
}

impl<P: Port> Inner<P> {
    fn card(&mut self) -> Result<Identity, SpiError> {
        if let Some(card) = self.card {
            return Ok(card);
        }
        let card = self.line.identify()?;
        if self.cid.is_some_and(|cid| cid != card.cid) {
            return Err(SpiError::Changed);
        }
        self.cid = Some(card.cid);
        self.card = Some(card);
        Ok(card)
    }

    fn access<T>(
        &mut self,
        mut act: impl FnMut(&mut Line<P>, &Identity) -> Result<T, SpiError>,
    ) -> Result<T, SpiError> {
        let mut tries = 1;
        loop {
            // A failed identification is not repeated here: the recorder looks again in a while.
            let card = self.card()?;
            let done = self.line.selected(|line| act(line, &card));
            let Err(error) = done else { return done };
            if error.has_lost_card() {
                self.card = None;
            }
            if !error.is_passing() || tries >= TRIES {
                return Err(error);
            }
            tries += 1;
            self.retries = self.retries.saturating_add(1);
        }
    }
}

/// The address of a block in commands, if this and `count - 1` more exist on the card.
fn address(card: &Identity, block: u32, count: usize) -> Result<u32, SpiError> {
    let end = u64::from(block) + count as u64;
    if end > u64::from(card.csd.blocks) {
        return Err(SpiError::OutOfRange);
    }
    let address = if card.by_bytes { block.checked_mul(BLOCK_BYTES as u32) } else { Some(block) };
    address.ok_or(SpiError::OutOfRange)
}

fn read<P: Port>(
    line: &mut Line<P>,
    address: u32,
    blocks: &mut [Block],
    meanwhile: WaitWork<'_>,
) -> Result<(), SpiError> {
    if let [block] = blocks {
        line.must(READ, address)?;
        return line.receive(block, meanwhile);
    }
    line.must(READ_MANY, address)?;
    let received = blocks.iter_mut().try_for_each(|block| line.receive(block, meanwhile));
    let stopped = line.stop_reading();
    received.and(stopped)
}

fn write<P: Port>(line: &mut Line<P>, address: u32, blocks: &[Block]) -> Result<(), SpiError> {
    let given = match blocks {
        [block] => {
            line.must(WRITE, address)?;
            line.give(TOKEN_ONE, block)
        }
        _ => give_many(line, address, blocks),
    };
    // The status of a card that still answers is more precise.
    match given {
        Ok(()) => line.check_written(),
        Err(SpiError::NotWritten(response)) => {
            Err(line.check_written().err().unwrap_or(SpiError::NotWritten(response)))
        }
        Err(error) => Err(error),
    }
}

fn give_many<P: Port>(line: &mut Line<P>, address: u32, blocks: &[Block]) -> Result<(), SpiError> {
    // Some cards are faster if they know the number of blocks (4.3.4); a card without this command writes as well.
    line.app_command(ERASE_BEFORE, blocks.len() as u32)?;
    line.must(WRITE_MANY, address)?;
    match blocks.iter().try_for_each(|block| line.give(TOKEN_MANY, block)) {
        Ok(()) => line.stop(),
        Err(error) => {
            let _ = line.abort();
            Err(error)
        }
    }
}

impl<P: Port> CardDevice for SpiCard<P> {
    type Error = SpiError;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), SpiError> {
        self.read_while(blocks, start, &mut || true)
    }

    fn read_while(&self, blocks: &mut [Block], start: u32, meanwhile: WaitWork<'_>) -> Result<(), SpiError> {
        if blocks.is_empty() {
            return Ok(());
        }
        let mut inner = self.inner.borrow_mut();
        inner.access(|line, card| read(line, address(card, start, blocks.len())?, blocks, meanwhile))
    }

    fn write(&self, blocks: &[Block], start: u32) -> Result<(), SpiError> {
        if blocks.is_empty() {
            return Ok(());
        }
        self.inner.borrow_mut().access(|line, card| {
            if card.csd.is_locked {
                return Err(SpiError::Locked);
            }
            write(line, address(card, start, blocks.len())?, blocks)
        })
    }

    fn num_blocks(&self) -> Result<u32, SpiError> {
        self.inner.borrow_mut().access(|_, card| Ok(card.csd.blocks))
    }

    fn reset(&self) {
        let mut inner = self.inner.borrow_mut();
        (inner.card, inner.cid) = (None, None);
    }

    fn recheck(&self) {
        self.inner.borrow_mut().card = None;
    }

    fn begin_service(&self) {
        let mut inner = self.inner.borrow_mut();
        inner.line.deadline = Some(inner.line.port.now() + SERVICE_MAX);
    }

    fn now(&self) -> Instant {
        self.inner.borrow().line.port.now()
    }

    fn take_retries(&self) -> u32 {
        core::mem::take(&mut self.inner.borrow_mut().retries)
    }

    fn trouble(error: &SpiError) -> Trouble {
        error.trouble()
    }
}
