//! The ground station's output, and its input, live or timed (`--gs-input`). With a file the run repeats to the byte.

use std::io::Write;

use anyhow::{Context, Result};

use super::arrivals::CHUNK_BYTES_MAX;
use crate::cli::Sim;
use crate::files::Inputs;
use crate::outcome::Outcome;
use crate::sink::{self, GroundInput, SideOutput};
use crate::source::{self, Chunk, Source, Timing};

/// The ground station's messages.
pub struct Ground {
    input: GroundInput,
    stored: Option<Box<dyn Source>>,
    next: Option<Chunk>,
    got: SideOutput,
}

/// Outputs must differ from the inputs.
pub fn open(run: &Sim, inputs: &Inputs) -> Result<(Ground, Box<dyn Write + Send>)> {
    let sink::Ground { writer, input } = match &run.gs {
        Some(endpoint) => sink::open(endpoint, inputs)?,
        None => sink::Ground { writer: SideOutput::nowhere(), input: GroundInput::nobody() },
    };
    let timing = Timing { line_rate: None };
    let stored = run.gs_input.as_ref().map(|input| source::open(input, timing)).transpose()?;
    Ok((Ground { input, stored, next: None, got: writer.clone() }, Box::new(writer)))
}

impl Ground {
    /// Completes an output file, unless an error was reported.
    pub fn finish(&self) -> Outcome {
        self.got.finish()
    }

    /// The oldest first; `None` at the end.
    pub fn until(&mut self, now_us: u64) -> Result<Option<Chunk>> {
        if self.next.is_none()
            && let Some(stored) = &mut self.stored
        {
            self.next = stored.next().context("--gs-input: cannot be read")?;
        }
        if let Some(chunk) = &mut self.next
            && chunk.at_us <= now_us
        {
            let rest = chunk.bytes.split_off(chunk.bytes.len().min(CHUNK_BYTES_MAX));
            let bytes = std::mem::replace(&mut chunk.bytes, rest);
            let at_us = chunk.at_us;
            if chunk.bytes.is_empty() {
                self.next = None;
            }
            return Ok(Some(Chunk { at_us, bytes }));
        }
        Ok(self.input.take().map(|bytes| Chunk { at_us: now_us, bytes }))
    }
}
