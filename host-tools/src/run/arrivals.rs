//! What arrives at the autopilot UART, and when: the source, noise and all, cut into pieces that every machine takes.

use std::collections::VecDeque;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};

use crate::cli::Run;
use crate::files::{Inputs, Output};
use crate::made;
use crate::outcome::Outcome;
use crate::sink::{Beside, nowhere};
use crate::source::noise::Noisy;
use crate::source::{self, Chunk, Source, Timing};

/// The most bytes that arrive at once: as much as the board's ring holds.
pub const CHUNK_BYTES_MAX: usize = 2048;

/// The stream of arrivals.
pub struct Arrivals {
    source: Noisy<Box<dyn Source>>,
    name: String,
    waiting: VecDeque<Chunk>,
    tap: Beside,
    bytes: u64,
    /// To the autopilot, where there is a live one.
    autopilot: Option<Box<dyn Write + Send>>,
}

impl Arrivals {
    /// As the command line says it; `tap` gets a copy of the bytes, and is none of the inputs. `prepare` is what else must be ready: done after a
    /// stored input was found good, so that a slip leaves nothing behind, and before a live one, which waits for nobody.
    pub fn open<T>(
        run: &Run,
        tap: Option<(&Path, &Inputs)>,
        prepare: impl FnOnce() -> Result<T>,
    ) -> Result<(Self, T)> {
        if run.input.is_live() {
            let prepared = prepare()?;
            return Ok((Self::new(run, tap)?, prepared));
        }
        let arrivals = Self::new(run, tap)?;
        Ok((arrivals, prepare()?))
    }

    fn new(run: &Run, tap: Option<(&Path, &Inputs)>) -> Result<Self> {
        let (source, autopilot) = source::open_both(&run.input, Timing { line_rate: run.faults.line_rate })?;
        Ok(Self {
            source: Noisy::new(source, run.faults.noise.unwrap_or(0.0), run.faults.seed),
            name: run.input.to_string(),
            waiting: VecDeque::new(),
            tap: tap.map_or_else(|| Ok(Beside::nowhere()), |(path, inputs)| tap_of(path, inputs))?,
            bytes: 0,
            autopilot,
        })
    }

    /// The next arrival; `None` at the end.
    pub fn next_arrival(&mut self) -> Result<Option<Chunk>> {
        if let Some(chunk) = self.waiting.pop_front() {
            return Ok(Some(chunk));
        }
        let context = || format!("{}: cannot be read", self.name);
        let Some(chunk) = self.source.next().with_context(context)? else { return Ok(None) };
        self.bytes += chunk.bytes.len() as u64;
        self.tap.write_all(&chunk.bytes)?;
        if chunk.bytes.len() <= CHUNK_BYTES_MAX {
            return Ok(Some(chunk));
        }
        let piece = |bytes: &[u8]| Chunk { at_us: chunk.at_us, bytes: bytes.to_vec() };
        self.waiting.extend(chunk.bytes.chunks(CHUNK_BYTES_MAX).map(piece));
        Ok(self.waiting.pop_front())
    }

    /// The run is over: the copy of the bytes is whole, unless something failed, which was said.
    pub fn finish(&self) -> Outcome {
        self.tap.finish()
    }

    /// The machine did not take this one: its power went before.
    pub fn put_back(&mut self, chunk: Chunk) {
        self.waiting.push_front(chunk);
    }

    /// The way to the autopilot, once; nobody hears what is sent to a recording.
    pub fn take_autopilot(&mut self) -> Box<dyn Write + Send> {
        self.autopilot.take().unwrap_or_else(nowhere)
    }

    /// Bytes that have arrived.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The recording is damaged, as far as it has come. (Of raw bytes nobody knows: a line may be noisy.)
    pub fn is_damaged(&self) -> bool {
        self.source.has_records() && self.source.damages() > 0
    }

    /// What was strange in the input.
    pub fn remark(&self) -> Option<String> {
        self.source.remark().map(|remark| format!("{}: {remark}", self.name))
    }
}

/// A file for a copy of the bytes, which is none of the inputs.
fn tap_of(path: &Path, inputs: &Inputs) -> Result<Beside> {
    Ok(Beside::file("--tap", Output::create(path, inputs, &made::RAW, None)?))
}
