//! `hums pull`: the board's logs over MAVLink FTP, burst by burst; what a burst lost is read piece by piece.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use hums_link::Frame;
use hums_link::messages;
use hums_link::packet::Fields;

use super::Client;
use crate::cli;
use crate::files::{appended, cannot_write, make_directory};
use crate::mavlink::ids::FILE_TRANSFER_PROTOCOL;
use crate::outcome::Outcome;
use crate::output::Stdout;

const HEAD: usize = 12;
const DATA_MAX: u8 = 239;
/// At the slowest budget that can carry a piece, one comes in about two seconds.
const ANSWER: Duration = Duration::from_secs(3);
const TRIES: usize = 10;
/// A burst is over when nothing came for so long.
const GAP: Duration = Duration::from_millis(2_500);

/// `MAV_FTP_OPCODE`
const RESET: u8 = 2;
const LIST: u8 = 3;
const OPEN: u8 = 4;
const READ: u8 = 5;
const BURST: u8 = 15;
const ACK: u8 = 128;
const NAK: u8 = 129;
const END_OF_FILE: u8 = 6;

/// An answer.
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
        let fields = Fields(frame.payload().get(3..)?);
        let size = usize::from(fields.u8(4).min(DATA_MAX));
        (frame.id() == FILE_TRANSFER_PROTOCOL).then(|| Self {
            sequence: fields.u16(0),
            opcode: fields.u8(3),
            of: fields.u8(5),
            complete: fields.u8(6) != 0,
            offset: fields.u32(8),
            // Zeros at the end are left out on the way.
            data: (0..size).map(|at| fields.u8(HEAD + at)).collect(),
        })
    }

    fn is_end(&self) -> bool {
        self.opcode == NAK && self.data.first() == Some(&END_OF_FILE)
    }
}

struct Ftp {
    client: Client,
    sequence: u16,
}

/// Runs `hums pull`.
pub fn run(args: &cli::Pull) -> Result<Outcome> {
    make_directory(&args.output)?;
    let mut ftp = Ftp { client: Client::connect(&args.at)?, sequence: 0 };
    ftp.ask(RESET, 0, 0, b"")?;
    let mut logs = ftp.list()?;
    logs.sort();
    if let Some(missing) = args.names.iter().find(|name| logs.iter().all(|(log, _)| log != *name)) {
        let names: Vec<&str> = logs.iter().map(|(log, _)| log.as_str()).collect();
        bail!("{missing}: the board has no such log; it has {}", names.join(", "));
    }
    logs.retain(|(log, _)| args.names.is_empty() || args.names.contains(log));
    let newest = args.last.unwrap_or(logs.len()).min(logs.len());
    let mut out = Stdout::new();
    for (name, bytes) in logs.split_off(logs.len() - newest) {
        let path = args.output.join(&name);
        if path.metadata().is_ok_and(|metadata| metadata.len() == u64::from(bytes)) {
            eprintln!("hums: {name}: is there already");
            continue;
        }
        ftp.pull(&name, &path)?;
        writeln!(out, "{}", path.display())?;
        out.flush()?;
    }
    Ok(Outcome::Done)
}

impl Ftp {
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

    fn ask(&mut self, opcode: u8, offset: u32, size: u8, data: &[u8]) -> Result<Answer> {
        for _ in 0..TRIES {
            let sequence = self.say(opcode, offset, size, data)?;
            let answer = self.client.until(Instant::now() + ANSWER, |frame| {
                Answer::read(frame)
                    .filter(|answer| answer.of == opcode && answer.sequence == sequence.wrapping_add(1))
            })?;
            if let Some(answer) = answer {
                return Ok(answer);
            }
        }
        bail!("the board does not answer over MAVLink FTP; is GS_BUDGET less than 500 B/s?")
    }

    /// Names and lengths of all logs.
    fn list(&mut self) -> Result<Vec<(String, u32)>> {
        let mut logs = Vec::new();
        loop {
            let answer = self.ask(LIST, logs.len() as u32, 0, b"/")?;
            if answer.is_end() {
                return Ok(logs);
            }
            let text = String::from_utf8_lossy(&answer.data).into_owned();
            let before = logs.len();
            for entry in text.split('\0').filter_map(|entry| entry.strip_prefix('F')) {
                let (name, bytes) = entry.split_once('\t').context("a directory entry without a length")?;
                // A name is a file's in our directory, and nothing else.
                if name.contains(['/', '\\']) || name.starts_with('.') {
                    bail!("the board names a file that is none: {name:?}");
                }
                logs.push((name.to_owned(), bytes.parse().context("a directory entry's length")?));
            }
            if answer.opcode != ACK || logs.len() == before {
                bail!("the board's directory cannot be read");
            }
        }
    }

    fn pull(&mut self, name: &str, path: &Path) -> Result<()> {
        let part = appended(path, "part");
        let context = || cannot_write(&part);
        let mut file = OpenOptions::new().create(true).append(true).open(&part).with_context(context)?;
        let opened = self.ask(OPEN, 0, 0, format!("/{name}").as_bytes())?;
        if opened.opcode != ACK {
            bail!("{name}: the board cannot open it");
        }
        let mut length = [0; 4];
        length.iter_mut().zip(&opened.data).for_each(|(to, from)| *to = *from);
        let length = u32::from_le_bytes(length);
        let mut have = u32::try_from(file.metadata()?.len()).unwrap_or(u32::MAX);
        if have > length {
            // Of another log of this name.
            file = File::create(&part).with_context(context)?;
            have = 0;
        }
        let mut silent = 0;
        while have < length {
            let pieces = self.burst(have, length)?;
            silent = if pieces.is_empty() { silent + 1 } else { 0 };
            if silent >= TRIES {
                bail!("{name}: nothing more comes after {have} of {length} bytes; to go on, call again");
            }
            let before = have;
            let end = pieces.iter().map(|(at, data)| *at + data.len() as u32).max().unwrap_or(have);
            while have < end {
                let data = if let Some(data) = pieces.get(&have) {
                    data.clone()
                } else {
                    // Up to the next piece that came.
                    let next = pieces.range(have..).next().map_or(end, |(at, _)| *at);
                    self.piece(have, next - have)?
                };
                file.write_all(&data).with_context(context)?;
                have += data.len() as u32;
            }
            eprintln!("hums: {name}: {have} of {length} bytes");
            if have == before && silent == 0 {
                bail!("{name}: the board sends nothing new after {have} of {length} bytes");
            }
        }
        file.flush().with_context(context)?;
        fs::rename(&part, path).with_context(|| format!("{}: cannot be named", path.display()))
    }

    /// What a burst from `offset` brings, by offset, as much of it as came.
    fn burst(&mut self, offset: u32, length: u32) -> Result<BTreeMap<u32, Vec<u8>>> {
        self.say(BURST, offset, DATA_MAX, b"")?;
        let mut pieces = BTreeMap::new();
        loop {
            let answer = self.client.until(Instant::now() + GAP, |frame| {
                Answer::read(frame).filter(|answer| answer.of == BURST)
            })?;
            let Some(answer) = answer else { return Ok(pieces) };
            let over = answer.opcode != ACK || answer.complete;
            let end = answer.offset.saturating_add(answer.data.len() as u32);
            if answer.opcode == ACK && answer.offset >= offset && !answer.data.is_empty() && end <= length {
                pieces.insert(answer.offset, answer.data);
            }
            if over {
                return Ok(pieces);
            }
        }
    }

    fn piece(&mut self, offset: u32, bytes: u32) -> Result<Vec<u8>> {
        let size = bytes.min(u32::from(DATA_MAX)) as u8;
        let mut answer = self.ask(READ, offset, size, b"")?;
        if answer.opcode != ACK || answer.offset != offset || answer.data.is_empty() {
            bail!("the board gives no bytes at {offset}");
        }
        // Never over the next piece.
        answer.data.truncate(usize::from(size));
        Ok(answer.data)
    }
}
