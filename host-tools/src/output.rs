//! Results on standard output. A reader that has gone away ends the program quietly (see [`ReaderGone`]), where
//! `println!` would panic.

use std::io::{self, Write};

use anyhow::Result;
use serde::Serialize;

use crate::outcome::ReaderGone;

/// Prints one line.
pub fn line(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    settle(out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()))
}

/// Prints one JSON object, indented.
pub fn json(value: &impl Serialize) -> Result<()> {
    line(&serde_json::to_string_pretty(value)?)
}

/// A broken pipe on standard output becomes [`ReaderGone`].
pub fn settle(result: io::Result<()>) -> Result<()> {
    result.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => ReaderGone.into(),
        _ => anyhow::Error::new(error).context("standard output"),
    })
}

/// Standard output as a writer that reports a broken pipe as [`ReaderGone`] inside the `io::Error`.
pub struct Stdout(io::Stdout);

impl Stdout {
    /// This process's standard output.
    pub fn new() -> Self {
        Self(io::stdout())
    }
}

impl Default for Stdout {
    fn default() -> Self {
        Self::new()
    }
}

fn gone(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::BrokenPipe { io::Error::other(ReaderGone) } else { error }
}

impl Write for Stdout {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.0.write(buffer).map_err(gone)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush().map_err(gone)
    }
}
