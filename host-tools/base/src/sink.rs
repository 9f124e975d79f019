//! The ground-station UART: the destination of its bytes, and the source of answers, if there is one.

use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{Receiver, TryRecvError, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::{Context as _, Result};

use crate::duplex::{self, Port};
use crate::endpoint::Endpoint;
use crate::files::{Inputs, Output, settle};
use crate::outcome::Outcome;
use crate::output::Stdout;

/// Interval at which the reader checks whether anybody still listens.
const SILENCE: Duration = Duration::from_millis(50);
/// Pieces that may wait for the pipeline; more are lost, as at a UART.
const PIECES: usize = 64;
/// The largest UDP datagram.
const BUFFER_BYTES: usize = 65_536;

/// The other side of the ground station's port.
pub struct Ground {
    /// Its output.
    pub writer: SideOutput,
    /// Its input.
    pub input: GroundInput,
}

/// Output beside a recording: `--gs`, `--tap`. A failure is reported at once, and the recording continues without it:
/// writing never fails. A clone writes to the same output.
#[derive(Clone)]
pub struct SideOutput(Arc<Mutex<Inside>>);

struct Inside {
    flag: &'static str,
    to: To,
    failed: bool,
}

enum To {
    /// Nobody reads.
    Nowhere,
    File(Box<Output>),
    Stream(Box<dyn Write + Send>),
}

impl SideOutput {
    /// A writer without a reader.
    pub fn nowhere() -> Self {
        Self::new("", To::Nowhere)
    }

    /// A file.
    pub fn file(flag: &'static str, file: Output) -> Self {
        Self::new(flag, To::File(Box::new(file)))
    }

    fn new(flag: &'static str, to: To) -> Self {
        Self(Arc::new(Mutex::new(Inside { flag, to, failed: false })))
    }

    /// The run is over: a file gets its name. `Losses` where not all of it was written.
    pub fn finish(&self) -> Outcome {
        let mut inside = self.lock();
        let Inside { to, .. } = &mut *inside;
        let finished = match to {
            To::Nowhere => Ok(()),
            To::File(file) => file.finish(),
            To::Stream(stream) => stream.flush().map_err(anyhow::Error::new),
        };
        if let Err(error) = finished {
            inside.fail(&error);
        }
        Outcome::lossy(inside.failed)
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        // The state after a failed thread is consistent.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inside {
    fn attempt(&mut self, act: impl FnOnce(&mut dyn Write) -> io::Result<()>) {
        let done = match &mut self.to {
            To::Nowhere => Ok(()),
            To::File(file) => {
                let done = act(&mut **file);
                settle(done, file.path())
            }
            To::Stream(stream) => act(stream).context("cannot be written"),
        };
        if let Err(error) = done {
            self.fail(&error);
        }
    }

    fn fail(&mut self, error: &anyhow::Error) {
        note!("{}: {error:#}; what is recorded on the card does not depend on it", self.flag);
        // A file that is not whole goes, and leaves its room to the card's image.
        (self.to, self.failed) = (To::Nowhere, true);
    }
}

impl Write for SideOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.lock().attempt(|to| to.write_all(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.lock().attempt(|to| to.flush());
        Ok(())
    }
}

/// The ground station's bytes.
pub struct GroundInput(Option<Receiver<Vec<u8>>>);

impl GroundInput {
    /// Nobody is there.
    pub const fn nobody() -> Self {
        Self(None)
    }

    /// The bytes that came since the last call, or none.
    pub fn take(&mut self) -> Option<Vec<u8>> {
        match self.0.as_ref()?.try_recv() {
            Ok(bytes) => Some(bytes),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.0 = None;
                None
            }
        }
    }
}

const FLAG: &str = "--gs";

/// Opens SINK, which must not be one of the inputs.
pub fn open(endpoint: &Endpoint, inputs: &Inputs) -> Result<Ground> {
    let input = GroundInput::nobody();
    match endpoint {
        Endpoint::File(path) => {
            let file = Output::create(path, inputs)?;
            Ok(Ground { writer: SideOutput::file(FLAG, file), input })
        }
        Endpoint::Standard => {
            let stream = To::Stream(Box::new(BufWriter::new(Stdout::default())));
            Ok(Ground { writer: SideOutput::new(FLAG, stream), input })
        }
        _ => {
            let duplex = duplex::open(endpoint, SILENCE)?;
            let writer = SideOutput::new(FLAG, To::Stream(duplex.writer));
            let input = listen(duplex.reader).context("--gs: no thread; close other programs")?;
            Ok(Ground { writer, input })
        }
    }
}

/// A thread reads, so that the pipeline never waits for a ground station.
fn listen(mut port: Box<dyn Port>) -> io::Result<GroundInput> {
    let (sender, receiver) = sync_channel(PIECES);
    std::thread::Builder::new().name("ground".to_owned()).spawn(move || {
        let mut buffer = vec![0; BUFFER_BYTES];
        loop {
            let piece = match port.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => buffer.get(..count).unwrap_or_default().to_vec(),
                Err(error) if duplex::is_silence(&error) => continue,
                Err(_) => break,
            };
            if let Err(TrySendError::Disconnected(_)) = sender.try_send(piece) {
                break;
            }
        }
    })?;
    Ok(GroundInput(Some(receiver)))
}

/// A writer without a reader.
pub fn nowhere() -> Box<dyn Write + Send> {
    Box::new(io::sink())
}
