//! Commands, answers and blocks on the bus, each within its time (SD specification, chapter 7).

use hums_core::clock::{Instant, Span};

use super::crc::{crc7, crc16};
use super::error::SpiError;
use super::port::{Port, PortFailure};
use crate::WaitWork;

/// Maximum busy time of a card. The specification allows 250 to 500 ms (4.6.2.2); good cards have been seen to stand
/// still for 2.5 s.
pub const BUSY_MAX: Span = Span::from_secs(3);
/// Maximum time until a card finds a block. The specification allows 100 ms (4.6.2.1); a card that tidies up takes
/// longer for reading as well.
const DATA_MAX: Span = Span::from_secs(1);
/// Bytes after a command within which its answer comes: 8 by specification (7.5.4).
const ANSWER_BYTES: usize = 10;
/// Tokens before a single block, before each of many, and at their end.
pub(super) const TOKEN_ONE: u8 = 0xFE;
pub(super) const TOKEN_MANY: u8 = 0xFC;
const TOKEN_STOP: u8 = 0xFD;
pub(super) const STOP_TRANSMISSION: u8 = 12;
const STATUS: u8 = 13;
const APP: u8 = 55;
/// Bits of the second byte of a status: locked, and write protected (7.3.2.3).
const STATUS_LOCKED: u8 = 0x01 | 0x20;

pub(super) struct Line<P> {
    pub(super) port: P,
    pub(super) deadline: Option<Instant>,
    pub(super) checks: bool,
    pub(super) busy_times: u8,
}

impl From<PortFailure> for SpiError {
    fn from(_: PortFailure) -> Self {
        Self::Port
    }
}

impl<P: Port> Line<P> {
    /// Selects the card, runs `act`, and deselects it with the clocks of one byte more (7.5.1).
    pub(super) fn selected<T>(
        &mut self,
        act: impl FnOnce(&mut Self) -> Result<T, SpiError>,
    ) -> Result<T, SpiError> {
        self.port.select(true);
        let done = act(self);
        self.port.select(false);
        self.port.send(&[0xFF])?;
        done
    }

    pub(super) fn byte(&mut self) -> Result<u8, SpiError> {
        let mut byte = [0xFF];
        self.port.exchange(&mut byte)?;
        Ok(byte[0])
    }

    /// `late` after `limit`.
    pub(super) fn within<T>(
        &mut self,
        limit: Span,
        late: SpiError,
        mut step: impl FnMut(&mut Self) -> Result<Option<T>, SpiError>,
    ) -> Result<T, SpiError> {
        let end = self.port.now() + limit;
        loop {
            if let Some(done) = step(self)? {
                return Ok(done);
            }
            let now = self.port.now();
            if self.deadline.is_some_and(|deadline| now >= deadline) {
                return Err(SpiError::OutOfTime);
            }
            if now >= end {
                return Err(late);
            }
        }
    }

    pub(super) fn ready(&mut self, limit: Span) -> Result<(), SpiError> {
        self.within(limit, SpiError::Busy, |line| {
            // Several at a time: the last one counts.
            let mut bytes = [0xFF; 4];
            line.port.exchange(&mut bytes)?;
            Ok((bytes[3] == 0xFF).then_some(()))
        })
    }

    /// Does not wait for the card; returns the first byte of the answer.
    pub(super) fn command_now(&mut self, command: u8, argument: u32) -> Result<u8, SpiError> {
        let [a, b, c, d] = argument.to_be_bytes();
        let mut frame = [0x40 | command, a, b, c, d, 0];
        frame[5] = crc7(&frame[..5]);
        self.port.send(&frame)?;
        if command == STOP_TRANSMISSION {
            // A stuff byte (7.3.1.3).
            self.byte()?;
        }
        for _ in 0..ANSWER_BYTES {
            let answer = self.byte()?;
            if answer & 0x80 == 0 {
                return Ok(answer);
            }
        }
        Err(SpiError::NoAnswer)
    }

    /// As [`Self::command_now`], once the card is ready.
    pub(super) fn command(&mut self, command: u8, argument: u32) -> Result<u8, SpiError> {
        self.ready(BUSY_MAX)?;
        self.command_now(command, argument)
    }

    /// Must be taken.
    pub(super) fn must(&mut self, command: u8, argument: u32) -> Result<(), SpiError> {
        match self.command(command, argument)? {
            0 => Ok(()),
            bits => Err(SpiError::Refused(bits)),
        }
    }

    /// Returns its answer.
    pub(super) fn app_command(&mut self, command: u8, argument: u32) -> Result<u8, SpiError> {
        self.command(APP, 0)?;
        self.command(command, argument)
    }

    pub(super) fn receive(&mut self, block: &mut [u8], meanwhile: WaitWork<'_>) -> Result<(), SpiError> {
        let token = self.within(DATA_MAX, SpiError::NoData, |line| {
            meanwhile();
            Ok(Some(line.byte()?).filter(|token| *token != 0xFF))
        })?;
        if token != TOKEN_ONE {
            return Err(SpiError::Token(token));
        }
        self.port.receive(block, meanwhile)?;
        let mut crc = [0xFF; 2];
        self.port.exchange(&mut crc)?;
        if self.checks && u16::from_be_bytes(crc) != crc16(block) {
            return Err(SpiError::Damaged);
        }
        Ok(())
    }

    pub(super) fn give(&mut self, token: u8, block: &[u8]) -> Result<(), SpiError> {
        // One byte's gap before a token (N_WR, 7.5.2).
        self.port.send(&[0xFF, token])?;
        self.port.send(block)?;
        self.port.send(&crc16(block).to_be_bytes())?;
        let response = self.byte()?;
        match response & 0x1F {
            0b0_0101 => {}
            0b0_1011 => return Err(SpiError::Damaged),
            0b0_1101 => return Err(SpiError::NotWritten(response)),
            _ => return Err(SpiError::NoAnswer),
        }
        self.ready(BUSY_MAX)
    }

    /// Ends a read of many blocks, in the middle of the next one (7.2.3).
    pub(super) fn stop_reading(&mut self) -> Result<(), SpiError> {
        self.command_now(STOP_TRANSMISSION, 0)?;
        self.ready(BUSY_MAX)
    }

    pub(super) fn stop(&mut self) -> Result<(), SpiError> {
        // The byte after the token is not yet the card's busy signal.
        self.port.send(&[0xFF, TOKEN_STOP, 0xFF])?;
        self.ready(BUSY_MAX)
    }

    /// Ends a failed write of many blocks (7.2.4).
    pub(super) fn abort(&mut self) -> Result<(), SpiError> {
        self.command(STOP_TRANSMISSION, 0)?;
        self.ready(BUSY_MAX)
    }

    /// Asks for the result: only the status shows blocks that the card could not program.
    pub(super) fn check_written(&mut self) -> Result<(), SpiError> {
        let answer = self.command(STATUS, 0)?;
        let status = self.byte()?;
        match (answer, status) {
            (0, 0) => Ok(()),
            _ if status & STATUS_LOCKED != 0 => Err(SpiError::Locked),
            (0, _) => Err(SpiError::NotWritten(status)),
            _ => Err(SpiError::Refused(answer)),
        }
    }
}
