//! Live bytes: UDP, TCP, serial, at their arrival since the first byte.
//!
//! A source ends with its peer or Ctrl-C ([`crate::interrupt`]). Silence is an empty chunk: the pipeline's
//! clock goes on.
//!
//! A network's bursts exceed any UART: bytes count as arriving at 921,600 baud at most, as at the monitor's
//! port.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use anyhow::Result;

use super::stream::{Chunk, Source};
use crate::duplex::{self, Port};
use crate::endpoint::Endpoint;
use crate::interrupt;

/// Silence before an empty chunk is handed on.
const SILENCE: Duration = Duration::from_millis(50);
/// A UDP datagram.
const BUFFER_BYTES: usize = 65_536;
/// 921,600 baud, ten bits a byte.
const BYTES_PER_SECOND_MAX: u64 = 92_160;
struct Live {
    port: Box<dyn Port>,
    first: Option<Instant>,
    last_us: u64,
    buffer: Vec<u8>,
}

pub(super) fn open(endpoint: &Endpoint) -> Result<(Box<dyn Source>, Box<dyn Write + Send>)> {
    let duplex = duplex::open(endpoint, SILENCE)?;
    interrupt::watch();
    let live = Live { port: duplex.reader, first: None, last_us: 0, buffer: vec![0; BUFFER_BYTES] };
    Ok((Box::new(live), duplex.writer))
}

impl Source for Live {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        loop {
            if interrupt::requested() {
                return Ok(None);
            }
            let got = match self.port.read(&mut self.buffer) {
                Ok(0) => return Ok(None),
                Ok(got) => got,
                Err(error) if duplex::is_silence(&error) => 0,
                Err(error) => return Err(error),
            };
            if got == 0 && self.first.is_none() {
                continue;
            }
            let now = Instant::now();
            let first = *self.first.get_or_insert(now);
            let clock_us = u64::try_from(now.duration_since(first).as_micros()).unwrap_or(u64::MAX);
            let at_us = clock_us.max(self.last_us + got as u64 * 1_000_000 / BYTES_PER_SECOND_MAX);
            self.last_us = at_us;
            let bytes = self.buffer.get(..got).unwrap_or_default().to_vec();
            return Ok(Some(Chunk { at_us, bytes }));
        }
    }
}
