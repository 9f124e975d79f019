//! Bytes at the autopilot's UART and their times.

use std::cell::Cell;
use std::collections::VecDeque;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};
use hums_link::{Check, Frame, Framer};

use crate::cli::Sim;
use crate::endpoint::Endpoint;
use crate::files::{Inputs, Output};
use crate::outcome::Outcome;
use crate::sink::{SideOutput, nowhere};
use crate::source::noise::Noisy;
use crate::source::{self, Chunk, Source, Timing};

/// The board's ring.
pub const CHUNK_BYTES_MAX: usize = 2048;
/// Bytes of standard input, until the first frame.
const FIRST_BYTES_MAX: usize = 16 << 20;

/// The stream of arrivals.
pub struct Arrivals {
    source: Noisy<Box<dyn Source>>,
    /// Read to find the first frame.
    first: VecDeque<Chunk>,
    name: String,
    waiting: VecDeque<Chunk>,
    tap: SideOutput,
    bytes: u64,
    autopilot: Option<Box<dyn Write + Send>>,
    /// Ended early.
    broken_off: bool,
}

impl Arrivals {
    /// --tap gets a copy of the bytes. `prepare` runs after a stored input's first frame, so that a slip leaves
    /// nothing behind; before a live one, which does not wait.
    pub fn open<T>(run: &Sim, inputs: &Inputs, prepare: impl FnOnce() -> Result<T>) -> Result<(Self, T)> {
        if run.input.is_live() {
            let prepared = prepare()?;
            return Ok((Self::new(run, inputs)?, prepared));
        }
        let arrivals = Self::new(run, inputs)?;
        Ok((arrivals, prepare()?))
    }

    fn new(run: &Sim, inputs: &Inputs) -> Result<Self> {
        let timing = Timing { line_rate: run.faults.line_rate };
        if let Endpoint::File(_) = run.input {
            // Any amount may come before the first frame.
            until_frame(&mut *source::open(&run.input, timing)?, &run.input, |_| true)?;
        }
        let (source, autopilot) = source::open_both(&run.input, timing)?;
        let mut source = Noisy::new(source, run.faults.noise.unwrap_or(0.0), run.faults.seed);
        let mut first = VecDeque::new();
        if run.input == Endpoint::Standard {
            let mut bytes = 0;
            until_frame(&mut source, &run.input, |chunk| {
                bytes += chunk.bytes.len();
                first.push_back(chunk);
                bytes < FIRST_BYTES_MAX
            })?;
        }
        Ok(Self {
            source,
            first,
            name: run.input.to_string(),
            waiting: VecDeque::new(),
            tap: run.tap.as_deref().map_or_else(|| Ok(SideOutput::nowhere()), |path| tap_of(path, inputs))?,
            bytes: 0,
            autopilot,
            broken_off: false,
        })
    }

    /// The next arrival; `None` at the end.
    pub fn next_arrival(&mut self) -> Result<Option<Chunk>> {
        if let Some(chunk) = self.waiting.pop_front() {
            return Ok(Some(chunk));
        }
        let context = || format!("{}: cannot be read", self.name);
        let next = match self.first.pop_front() {
            Some(chunk) => Some(chunk),
            None => self.source.next().with_context(context)?,
        };
        let Some(chunk) = next else { return Ok(None) };
        self.bytes += chunk.bytes.len() as u64;
        self.tap.write_all(&chunk.bytes)?;
        if chunk.bytes.len() <= CHUNK_BYTES_MAX {
            return Ok(Some(chunk));
        }
        let piece = |bytes: &[u8]| Chunk { at_us: chunk.at_us, bytes: bytes.to_vec() };
        self.waiting.extend(chunk.bytes.chunks(CHUNK_BYTES_MAX).map(piece));
        Ok(self.waiting.pop_front())
    }

    /// Completes the copy, or reports its error.
    pub fn finish(&self) -> Outcome {
        self.tap.finish()
    }

    /// The power went before this one.
    pub fn put_back(&mut self, chunk: Chunk) {
        self.waiting.push_front(chunk);
    }

    /// Taken once; bytes to a recording are dropped.
    pub fn take_autopilot(&mut self) -> Box<dyn Write + Send> {
        self.autopilot.take().unwrap_or_else(nowhere)
    }

    /// Arrived so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// As far as it has come; raw bytes are never damaged.
    pub fn is_damaged(&self) -> bool {
        self.broken_off || self.source.damages() > 0
    }

    /// An end by the user.
    pub const fn break_off(&mut self) {
        self.broken_off = true;
    }

    /// Oddities of the input.
    pub fn remark(&self) -> Option<String> {
        let broken_off =
            self.broken_off.then(|| "was not read to its end: the run was ended before".to_owned());
        let all: Vec<String> = self.source.remark().into_iter().chain(broken_off).collect();
        (!all.is_empty()).then(|| format!("{}: {}", self.name, all.join("; ")))
    }
}

/// The first valid frame, while `go_on` agrees. An error if there is none.
fn until_frame(
    source: &mut dyn Source,
    input: &Endpoint,
    mut go_on: impl FnMut(Chunk) -> bool,
) -> Result<()> {
    let (mut framer, found) = (Framer::new(), Cell::new(false));
    let mut look = |frame: Frame<'_>| found.set(found.get() || frame.check() == Check::Verified);
    while let Some(chunk) = source.next().with_context(|| format!("{input}: cannot be read"))? {
        framer.push(&chunk.bytes, &mut look);
        if source.has_records() {
            framer.idle(&mut look);
        }
        if !go_on(chunk) || found.get() {
            break;
        }
    }
    framer.idle(&mut look);
    if found.get() {
        return Ok(());
    }
    Err(source::no_frame(input))
}

/// Must not be an input.
fn tap_of(path: &Path, inputs: &Inputs) -> Result<SideOutput> {
    Ok(SideOutput::file("--tap", Output::create(path, inputs)?))
}
