//! Bulk-Only Transport: command wrappers in, data and status wrappers out.
//!
//! Host and command block each announce direction and length of the data. The thirteen cases (BOT, 6.7):
//!
//! | case | host | command | data on the bus | status |
//! |---|---|---|---|---|
//! | 1 | none | none | none | the command's |
//! | 2, 3 | none | in, out | none | phase error |
//! | 4, 5, 6 | in | none, less, as much | the command's, ended by a short packet | the command's, with residue |
//! | 7 | in | more | as much as the host wants | phase error |
//! | 8 | in | out | none, ended by a short packet | phase error |
//! | 9, 11 to 13 | out | none, out | taken and dropped | the command's, with residue |
//! | 10 | out | in | taken and dropped | phase error |
//!
//! A write is refused: case 3, 8, 9 or 11 to 13, with the status of a refused command. A refused command has no data. In place of
//! a short packet BOT wants padding or a halted endpoint; Linux's gadget sends a short packet too if its controller cannot halt.

use hums_recorder::{BLOCK_BYTES, CardDevice, WaitWork};

use crate::PACKET_BYTES;
use crate::scsi::{Answer, Disk};
use crate::server::Chunk;

/// Bytes of a command wrapper (BOT, 5.1).
pub const WRAPPER_BYTES: usize = 31;
/// Bytes of a status wrapper (BOT, 5.2).
pub const STATUS_BYTES: usize = 13;
const COMMAND_SIGNATURE: [u8; 4] = *b"USBC";
const STATUS_SIGNATURE: [u8; 4] = *b"USBS";
/// Longest command block.
const BLOCK_MAX: usize = 16;
const TO_HOST: u8 = 0x80;

/// The packet is no command wrapper, or one for another unit. Only a reset by the host ends this state (BOT, 6.6.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidPacket;

/// The next action on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Send the chunk's bytes in packets of [`PACKET_BYTES`]; none is one empty packet.
    Send,
    /// Take a packet and report its length to [`Transport::taken`].
    Take,
    /// Send the chunk's bytes, which are the status wrapper. The command is over.
    End,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    Passed = 0,
    Failed = 1,
    PhaseError = 2,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Reply(u32),
    Blocks(u32, u32),
    /// The data is over: a short packet, if none was sent.
    End,
    /// This many bytes of the host are still to be taken.
    Take(u32),
    Status,
}

/// A command in work.
pub struct Transport {
    tag: [u8; 4],
    expected: u32,
    sent: u32,
    status: Status,
    stage: Stage,
}

impl Transport {
    /// Begins the command of a packet.
    pub fn begin<D: CardDevice>(packet: &[u8], disk: &mut Disk<D>) -> Result<Self, InvalidPacket> {
        let wrapper: &[u8; WRAPPER_BYTES] = packet.try_into().map_err(|_| InvalidPacket)?;
        let [s0, s1, s2, s3, t0, t1, t2, t3, e0, e1, e2, e3, flags, unit, length, block @ ..] = *wrapper;
        let block =
            block.get(..usize::from(length)).filter(|block| !block.is_empty()).ok_or(InvalidPacket)?;
        if [s0, s1, s2, s3] != COMMAND_SIGNATURE || flags & !TO_HOST != 0 || unit != 0 {
            return Err(InvalidPacket);
        }
        const { assert!(WRAPPER_BYTES == 15 + BLOCK_MAX) };
        let expected = u32::from_le_bytes([e0, e1, e2, e3]);
        let answer = disk.command(block);
        let wants_data = expected > 0 && flags == TO_HOST;
        let has = match answer {
            Some(Answer::Reply(bytes)) => bytes as u64,
            Some(Answer::Blocks { count, .. }) => u64::from(count) * BLOCK_BYTES as u64,
            Some(Answer::Done) | None => 0,
        };
        let status = match answer {
            None => Status::Failed,
            Some(_) if has > if wants_data { expected.into() } else { 0 } => Status::PhaseError,
            Some(_) => Status::Passed,
        };
        let bytes = u32::try_from(has).unwrap_or(u32::MAX).min(expected);
        let stage = match answer {
            _ if expected == 0 => Stage::Status,
            _ if !wants_data => Stage::Take(expected),
            Some(Answer::Reply(_)) => Stage::Reply(bytes),
            Some(Answer::Blocks { first, .. }) => Stage::Blocks(first, bytes),
            Some(Answer::Done) | None => Stage::End,
        };
        Ok(Self { tag: [t0, t1, t2, t3], expected, sent: 0, status, stage })
    }

    /// The next action. It fills the chunk.
    pub fn step<D: CardDevice>(
        &mut self,
        disk: &mut Disk<D>,
        chunk: &mut Chunk<'_>,
        meanwhile: WaitWork<'_>,
    ) -> Step {
        match self.stage {
            Stage::Reply(bytes) if bytes > 0 => {
                (self.stage, self.sent) = (Stage::End, bytes);
                chunk.put(disk.reply().get(..bytes as usize).unwrap_or_default());
                return Step::Send;
            }
            Stage::Blocks(first, left) if left > 0 => {
                let count = disk.read(first, left.div_ceil(BLOCK_BYTES as u32), chunk, meanwhile);
                if count > 0 {
                    let bytes = left.min(count * BLOCK_BYTES as u32);
                    self.stage = Stage::Blocks(first + count, left - bytes);
                    self.sent += bytes;
                    chunk.has(bytes);
                    return Step::Send;
                }
                self.status = Status::Failed;
            }
            Stage::Take(left) if left > 0 => return Step::Take,
            Stage::Reply(_) | Stage::Blocks(..) | Stage::End | Stage::Take(_) | Stage::Status => {}
        }
        let is_open = !matches!(self.stage, Stage::Take(_) | Stage::Status)
            && self.sent < self.expected
            && self.sent.is_multiple_of(PACKET_BYTES as u32);
        self.stage = Stage::Status;
        if is_open {
            chunk.put(&[]);
            return Step::Send;
        }
        chunk.put(&self.wrapper());
        Step::End
    }

    /// A packet of the host was taken. A short one ends the data.
    pub fn taken(&mut self, bytes: usize) {
        if let Stage::Take(left) = self.stage {
            let is_short = bytes < PACKET_BYTES;
            self.stage = Stage::Take(if is_short { 0 } else { left.saturating_sub(bytes as u32) });
        }
    }

    fn wrapper(&self) -> [u8; STATUS_BYTES] {
        let ([t0, t1, t2, t3], [s0, s1, s2, s3]) = (self.tag, STATUS_SIGNATURE);
        let [r0, r1, r2, r3] = (self.expected - self.sent).to_le_bytes();
        [s0, s1, s2, s3, t0, t1, t2, t3, r0, r1, r2, r3, self.status as u8]
    }
}
