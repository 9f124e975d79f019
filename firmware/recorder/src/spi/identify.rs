//! Identification of the card in the slot (SD specification, 7.2.1 and figure 7-2).

use hums_core::clock::Span;

use super::error::SpiError;
use super::line::{BUSY_MAX, Line, STOP_TRANSMISSION};
use super::port::{Clock, Port};
use super::registers::Csd;

const RESET: u8 = 0;
const CONDITIONS: u8 = 8;
const SEND_CSD: u8 = 9;
const SEND_CID: u8 = 10;
const BLOCK_LENGTH: u8 = 16;
const START: u8 = 41;
const READ_OCR: u8 = 58;
const CHECKS: u8 = 59;

/// The card's answer while it is not ready for anything else.
const IDLE: u8 = 1;
const ILLEGAL: u8 = 4;
/// Of [`CONDITIONS`]: 2.7 to 3.6 V, and a pattern that comes back.
const VOLTAGE: u32 = 0x1AA;
/// Of [`START`]: the host supports cards of more than 2 GB.
const HIGH_CAPACITY: u32 = 1 << 30;

/// Maximum time until a card takes its first command. One in the middle of a block needs some of it.
const RESET_MAX: Span = Span::from_millis(200);
/// Maximum time until a card ends a row of blocks, by the specification.
const STOP_MAX: Span = Span::from_millis(500);
const BUSY_TIMES: u8 = 4;
/// Maximum start time of a card. The specification allows 1 s.
const START_MAX: Span = Span::from_secs(2);
/// Bytes with the card not selected that wake it up: at least 74 clocks (6.4.1).
const WAKE: [u8; 10] = [0xFF; 10];

/// An identified card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    /// CID register.
    pub(super) cid: [u8; 16],
    pub(super) csd: Csd,
    /// Blocks are addressed by their first byte: cards up to 2 GB.
    pub(super) by_bytes: bool,
}

impl<P: Port> Line<P> {
    pub(super) fn identify(&mut self) -> Result<Identity, SpiError> {
        self.port.set_clock(Clock::Identification);
        self.checks = false;
        self.port.select(false);
        self.port.send(&WAKE)?;
        // A card that is at work is not interrupted, because that may cost more than the block in work (7.2.4). One
        // that stays busy after [`BUSY_TIMES`] timeouts has nothing to lose.
        match self.selected(|line| line.ready(BUSY_MAX)) {
            Ok(()) => {}
            Err(SpiError::Busy) if self.busy_times >= BUSY_TIMES => {}
            Err(SpiError::Busy) => {
                self.busy_times += 1;
                return Err(SpiError::Busy);
            }
            Err(error) => return Err(error),
        }
        self.busy_times = 0;
        self.reset()?;
        let identity = self.selected(Self::start)?;
        self.port.set_clock(Clock::Transfer);
        Ok(identity)
    }

    /// Sends the first command until the card takes it. A transfer from before a processor restart ends after at most
    /// a block and its busy time.
    fn reset(&mut self) -> Result<(), SpiError> {
        let mut answers = false;
        let done = self.within(RESET_MAX, SpiError::NoAnswer, |line| {
            let answer = line.selected(|line| line.command_now(RESET, 0));
            match answer {
                Ok(IDLE) => return Ok(Some(())),
                Ok(_) => answers = true,
                Err(SpiError::NoAnswer) => {}
                Err(error) => return Err(error),
            }
            line.selected(|line| {
                // Ends a block that is being received, then its row, in either direction.
                for _ in 0..13 {
                    let mut bytes = [0xFF; 40];
                    line.port.exchange(&mut bytes)?;
                    answers |= bytes.iter().any(|byte| *byte != 0xFF);
                }
                // The next try shows whether a row was open and has ended.
                let _ = line.command_now(STOP_TRANSMISSION, 0).and_then(|_| line.ready(STOP_MAX));
                Ok(())
            })?;
            Ok(None)
        });
        // A device drives the line, but does not understand.
        done.map_err(|error| if answers && error == SpiError::NoAnswer { SpiError::Busy } else { error })
    }

    fn start(&mut self) -> Result<Identity, SpiError> {
        let is_old = self.conditions()?;
        // A card without checksums must be trusted; records have checksums of their own.
        let checks = self.command(CHECKS, 1)? & !IDLE == 0;
        let start = if is_old { 0 } else { HIGH_CAPACITY };
        self.within(START_MAX, SpiError::Busy, |line| match line.app_command(START, start)? {
            0 => Ok(Some(())),
            IDLE => Ok(None),
            _ => Err(SpiError::NotSd),
        })?;
        let by_bytes = is_old || self.ocr()? & HIGH_CAPACITY == 0;
        if by_bytes {
            self.must(BLOCK_LENGTH, 512)?;
        }
        self.checks = checks;
        let csd = Csd::read(&self.register(SEND_CSD)?).ok_or(SpiError::NotSd)?;
        let cid = self.register(SEND_CID)?;
        Ok(Identity { cid, csd, by_bytes })
    }

    fn conditions(&mut self) -> Result<bool, SpiError> {
        let answer = self.command(CONDITIONS, VOLTAGE)?;
        if answer & ILLEGAL != 0 {
            return Ok(true);
        }
        let mut echo = [0xFF; 4];
        self.port.exchange(&mut echo)?;
        if answer != IDLE {
            return Err(SpiError::Refused(answer));
        }
        if u32::from_be_bytes(echo) & 0xFFF == VOLTAGE { Ok(false) } else { Err(SpiError::NotSd) }
    }

    fn ocr(&mut self) -> Result<u32, SpiError> {
        self.must(READ_OCR, 0)?;
        let mut ocr = [0xFF; 4];
        self.port.exchange(&mut ocr)?;
        Ok(u32::from_be_bytes(ocr))
    }

    fn register(&mut self, command: u8) -> Result<[u8; 16], SpiError> {
        self.must(command, 0)?;
        let mut register = [0; 16];
        self.receive(&mut register, &mut || true)?;
        Ok(register)
    }
}
