//! Where the bytes of the ground-station UART go, and, where somebody is there to answer, where its own come from.

use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{Receiver, TryRecvError, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use anyhow::{Context as _, Result};

use crate::duplex::{self, Port};
use crate::endpoint::Endpoint;
use crate::files::{Inputs, Output, check_standard_output_is_open};
use crate::made;
use crate::output::Stdout;

/// How long the reader waits before it looks whether anybody still listens.
const SILENCE: Duration = Duration::from_millis(50);
/// Pieces that may wait for the pipeline; more are lost, as at a UART.
const PIECES: usize = 64;
/// The largest UDP datagram.
const BUFFER_BYTES: usize = 65_536;

/// The other side of the ground station's port.
pub struct Ground {
    /// What goes to it.
    pub writer: Box<dyn Write + Send>,
    /// What comes from it.
    pub heard: Heard,
    /// The file that `writer` writes, where it is one.
    pub file: Option<SinkFile>,
}

/// A file that a run writes, and whoever ends the run makes whole.
#[derive(Clone, Debug)]
pub struct SinkFile(Arc<Mutex<Output>>);

impl SinkFile {
    /// The run is over: the file gets its name.
    pub fn finish(&self) -> Result<()> {
        self.with(|file| Ok(file.finish())).context("--gs: cannot be written")?
    }

    fn with<T>(&self, act: impl FnOnce(&mut Output) -> io::Result<T>) -> io::Result<T> {
        let mut file = self.0.lock().map_err(|_| io::Error::other("a thread that wrote it has failed"))?;
        let done = act(&mut file);
        done.map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", file.path().display())))
    }
}

impl Write for SinkFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|file| file.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.with(Output::flush)
    }
}

/// What the ground station sends.
pub struct Heard(Option<Receiver<Vec<u8>>>);

impl Heard {
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

/// Opens SINK, which is none of the inputs.
pub fn open(endpoint: &Endpoint, inputs: &Inputs) -> Result<Ground> {
    let heard = Heard::nobody();
    match endpoint {
        Endpoint::File(path) => {
            let file = SinkFile(Arc::new(Mutex::new(Output::create(path, inputs, &made::RAW, None)?)));
            Ok(Ground { writer: Box::new(file.clone()), heard, file: Some(file) })
        }
        Endpoint::Standard => {
            inputs.refuse_standard_output()?;
            check_standard_output_is_open()?;
            Ok(Ground { writer: Box::new(BufWriter::new(Stdout::new())), heard, file: None })
        }
        _ => {
            let duplex = duplex::open(endpoint, SILENCE)?;
            Ok(Ground { writer: duplex.writer, heard: listen(duplex.reader), file: None })
        }
    }
}

/// A thread reads, so that the pipeline never waits for a ground station.
fn listen(mut port: Box<dyn Port>) -> Heard {
    let (sender, receiver) = sync_channel(PIECES);
    std::thread::spawn(move || {
        let mut buffer = vec![0; BUFFER_BYTES];
        loop {
            let piece = match port.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => buffer.get(..count).unwrap_or_default().to_vec(),
                Err(error) if duplex::is_silence(&error) => continue,
                Err(_) => break,
            };
            // A piece that finds no room is lost.
            if let Err(TrySendError::Disconnected(_)) = sender.try_send(piece) {
                break;
            }
        }
    });
    Heard(Some(receiver))
}

/// A writer that nobody reads.
pub fn nowhere() -> Box<dyn Write + Send> {
    Box::new(io::sink())
}
