//! MAVLink FTP (<https://mavlink.io/en/services/ftp.html>), as far as needed.

use std::collections::BTreeMap;
use std::io;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Error, Result, anyhow, bail};
use hums_link::Frame;
use hums_link::messages;
use hums_link::packet::Fields;

use crate::mavlink::ids::FILE_TRANSFER_PROTOCOL;
use crate::talk::{Client, is_for_us};

const HEAD: usize = 12;
const DATA_MAX: u8 = 239;
/// The slowest budget delivers a piece in about two seconds.
const ANSWER: Duration = Duration::from_secs(3);
const TRIES: usize = 10;
/// 8 MiB take some 20 s, at worst as many minutes.
const CHECKSUM_TRIES: usize = 100;
/// Ends a burst.
const GAP: Duration = Duration::from_millis(2_500);

/// A card's directory has 65,536 entries.
const LOGS_MAX: usize = 100_000;
/// Of a burst; boards send far fewer, and later pieces are requested again.
const PIECES_MAX: usize = 4_096;

/// `MAV_FTP_OPCODE`
const RESET: u8 = 2;
const LIST: u8 = 3;
const OPEN: u8 = 4;
const READ: u8 = 5;
const CHECKSUM: u8 = 14;
const BURST: u8 = 15;
const ACK: u8 = 128;
const NAK: u8 = 129;
/// `MAV_FTP_ERR`
const END_OF_FILE: u8 = 6;
const FILE_NOT_FOUND: u8 = 10;

struct Answer {
    sequence: u16,
    opcode: u8,
    of: u8,
    complete: bool,
    offset: u32,
    data: Vec<u8>,
}

impl Answer {
    fn read(frame: &Frame<'_>) -> Option<Self> {
        let payload = frame.payload();
        let (whom, fields) = (Fields(payload), Fields(payload.get(3..)?));
        let size = usize::from(fields.u8(4).min(DATA_MAX));
        (frame.id() == FILE_TRANSFER_PROTOCOL && is_for_us(whom.u8(1), whom.u8(2))).then(|| Self {
            sequence: fields.u16(0),
            opcode: fields.u8(3),
            of: fields.u8(5),
            complete: fields.u8(6) != 0,
            offset: fields.u32(8),
            // Not sent.
            data: (0..size).map(|at| fields.u8(HEAD + at)).collect(),
        })
    }

    fn is_nak(&self, error: u8) -> bool {
        self.opcode == NAK && self.data.first() == Some(&error)
    }

    const fn end(&self) -> u32 {
        self.offset.saturating_add(self.data.len() as u32)
    }

    /// An open log may have grown: data before `length` only.
    fn before(mut self, length: u32) -> (u32, Vec<u8>) {
        self.data.truncate(length.saturating_sub(self.offset) as usize);
        (self.offset, self.data)
    }

    fn word(&self) -> u32 {
        self.data.iter().take(4).rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
    }
}

/// Concerns every log: a link's error.
fn silence(words: &'static str) -> Error {
    io::Error::new(io::ErrorKind::TimedOut, words).into()
}

/// Deleted since it was listed.
#[derive(Debug)]
pub(super) struct NoSuchLog;

impl std::fmt::Display for NoSuchLog {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the box no longer has this log: its card made room for later flights, or is another one")
    }
}

impl std::error::Error for NoSuchLog {}

fn refused(answer: &Answer, what: &str) -> Error {
    if answer.is_nak(FILE_NOT_FOUND) {
        return NoSuchLog.into();
    }
    let why = answer.data.first().map_or_else(String::new, |error| format!(" (MAVLink FTP error {error})"));
    anyhow!("the box refuses {what} of this log{why}; call again")
}

pub(super) struct Ftp {
    client: Client,
    sequence: u16,
}

impl Ftp {
    pub(super) fn new(client: Client) -> Result<Self> {
        let mut ftp = Self { client, sequence: 0 };
        ftp.ask(RESET, 0, 0, b"", TRIES)?;
        Ok(ftp)
    }

    pub(super) const fn system(&self) -> u8 {
        self.client.system()
    }

    fn say(&mut self, opcode: u8, offset: u32, size: u8, data: &[u8]) -> Result<u16> {
        self.sequence = self.sequence.wrapping_add(1);
        let [s0, s1] = self.sequence.to_le_bytes();
        let mut payload =
            vec![s0, s1, 0, opcode, if data.is_empty() { size } else { data.len() as u8 }, 0, 0, 0];
        payload.extend_from_slice(&offset.to_le_bytes());
        payload.extend_from_slice(data);
        let (system, component) = self.client.target();
        self.client.send(&messages::file_transfer(system, component, &payload))?;
        Ok(self.sequence)
    }

    fn ask(&mut self, opcode: u8, offset: u32, size: u8, data: &[u8], tries: usize) -> Result<Answer> {
        for _ in 0..tries {
            let sequence = self.say(opcode, offset, size, data)?;
            let answer = self.client.until(Instant::now() + ANSWER, |frame| {
                Answer::read(frame)
                    .filter(|answer| answer.of == opcode && answer.sequence == sequence.wrapping_add(1))
            })?;
            if let Some(answer) = answer {
                return Ok(answer);
            }
        }
        Err(silence("the box does not answer over MAVLink FTP; is GS_BUDGET less than 500 B/s?"))
    }

    /// Names and lengths, also the number of those that the card did not give.
    pub(super) fn list(&mut self) -> Result<(Vec<(String, u32)>, usize)> {
        let (mut logs, mut skipped) = (Vec::new(), 0);
        loop {
            let before = logs.len() + skipped;
            let answer = self.ask(LIST, before as u32, 0, b"/", TRIES)?;
            if answer.is_nak(END_OF_FILE) {
                return Ok((logs, skipped));
            }
            let text = String::from_utf8_lossy(&answer.data).into_owned();
            skipped += text.split('\0').filter(|entry| entry.starts_with('S')).count();
            for entry in text.split('\0').filter_map(|entry| entry.strip_prefix('F')) {
                let (name, bytes) = entry
                    .split_once('\t')
                    .context("the box's list has a file without a length; call again")?;
                // A plain file name in our directory.
                if name.contains(['/', '\\']) || name.starts_with('.') {
                    bail!("invalid file name in the box's list: {name:?}; read the card");
                }
                logs.push((
                    name.to_owned(),
                    bytes.parse().context("the box's list has a length that is no number; call again")?,
                ));
            }
            if answer.opcode != ACK || logs.len() + skipped == before {
                bail!("the box's directory cannot be read; call again, or read the card itself");
            }
            if logs.len() + skipped > LOGS_MAX {
                bail!("the box lists more than {LOGS_MAX} logs, which no card has; read the card itself");
            }
        }
    }

    /// Returns its bytes.
    pub(super) fn open(&mut self, name: &str) -> Result<u32> {
        let opened = self.ask(OPEN, 0, 0, format!("/{name}").as_bytes(), TRIES)?;
        if opened.opcode != ACK {
            return Err(refused(&opened, "the opening"));
        }
        Ok(opened.word())
    }

    /// Checksum of the first bytes (at least one), as [`hums_link::ftp::checksum`].
    pub(super) fn checksum(&mut self, name: &str, bytes: u32) -> Result<u32> {
        let answer = self.ask(CHECKSUM, bytes, 0, format!("/{name}").as_bytes(), CHECKSUM_TRIES)?;
        if answer.opcode != ACK {
            return Err(refused(&answer, "the checksum"));
        }
        if answer.offset != bytes {
            bail!("the answer has the checksum of another number of bytes; call again");
        }
        Ok(answer.word())
    }

    /// Downloads bytes in order, piece by piece.
    pub(super) fn bring(
        &mut self,
        from: u32,
        to: u32,
        mut take: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let mut have = from;
        let mut silent = 0;
        while have < to {
            let (before, mut pieces) = (have, BTreeMap::new());
            let came = self.burst(have, to, |at, data| {
                // Wait for a lost one.
                if at >= have {
                    pieces.insert(at, data);
                }
                while let Some(data) = pieces.remove(&have) {
                    have += data.len() as u32;
                    take(&data)?;
                }
                Ok(())
            })?;
            silent = if came { 0 } else { silent + 1 };
            if silent >= TRIES {
                return Err(silence("nothing more comes; to go on, call again"));
            }
            let ends = pieces.range(have..).map(|(at, data)| *at + data.len() as u32);
            let end = ends.max().unwrap_or(have);
            while have < end {
                let data = if let Some(data) = pieces.remove(&have) {
                    data
                } else {
                    // Up to the next piece that came.
                    let next = pieces.range(have..).next().map_or(end, |(at, _)| *at);
                    self.piece(have, next - have)?
                };
                have += data.len() as u32;
                take(&data)?;
            }
            if have == before && came {
                bail!("the box repeats bytes that it has sent; call again");
            }
        }
        Ok(())
    }

    /// Pieces from `offset`; returns whether any came.
    fn burst(
        &mut self,
        offset: u32,
        length: u32,
        mut take: impl FnMut(u32, Vec<u8>) -> Result<()>,
    ) -> Result<bool> {
        self.say(BURST, offset, DATA_MAX, b"")?;
        let mut pieces = 0;
        loop {
            let answer = self.client.until(Instant::now() + GAP, |frame| {
                Answer::read(frame).filter(|answer| answer.of == BURST)
            })?;
            let Some(answer) = answer else { return Ok(pieces > 0) };
            if answer.opcode == NAK && !answer.is_nak(END_OF_FILE) {
                return Err(refused(&answer, "bytes"));
            }
            let is_last = answer.opcode != ACK || answer.complete || answer.end() >= length;
            if answer.opcode == ACK && answer.offset >= offset {
                let (at, data) = answer.before(length);
                if !data.is_empty() {
                    pieces += 1;
                    take(at, data)?;
                }
            }
            if is_last || pieces >= PIECES_MAX {
                return Ok(pieces > 0);
            }
        }
    }

    pub(super) fn piece(&mut self, offset: u32, bytes: u32) -> Result<Vec<u8>> {
        let size = bytes.min(u32::from(DATA_MAX)) as u8;
        let mut answer = self.ask(READ, offset, size, b"", TRIES)?;
        if answer.opcode == NAK && !answer.is_nak(END_OF_FILE) {
            return Err(refused(&answer, "bytes"));
        }
        if answer.opcode != ACK || answer.offset != offset || answer.data.is_empty() {
            bail!("the box gives no bytes at {offset}; call again");
        }
        // Never over the next piece.
        answer.data.truncate(usize::from(size));
        Ok(answer.data)
    }
}

#[cfg(test)]
mod tests {
    use hums_link::packet::Packet;

    use super::*;
    use crate::talk::tests::fake;

    #[test]
    fn an_answer_counts_that_the_board_that_was_asked_gives_to_us() {
        let client = fake::found(&[2, 1], |frame| {
            let asked = Fields(frame.payload().get(3..).unwrap_or_default());
            let answer = |system, station, word: u8| -> (u8, Packet) {
                let [s0, s1] = asked.u16(0).wrapping_add(1).to_le_bytes();
                let payload = [s0, s1, 0, ACK, 4, asked.u8(3), 0, 0, 0, 0, 0, 0, word, 0, 0, 0];
                (system, messages::file_transfer(station, 190, &payload))
            };
            vec![answer(2, 255, 7), answer(1, 77, 8), answer(1, 255, 9)]
        });
        let mut ftp = Ftp::new(client).expect("it answers");
        assert_eq!(ftp.open("00001_00.HUM").expect("an answer"), 9);
    }

    #[test]
    fn of_a_piece_that_goes_over_the_length_at_opening_what_lies_before_it_counts() {
        let answer = |offset| Answer {
            sequence: 0,
            opcode: ACK,
            of: BURST,
            complete: false,
            offset,
            data: vec![7; 239],
        };
        for (offset, bytes) in [(0, 239), (4_369, 239), (4_575, 33), (4_608, 0), (u32::MAX - 9, 0)] {
            let (at, data) = answer(offset).before(4_608);
            assert_eq!((at, data.len()), (offset, bytes));
        }
    }
}
