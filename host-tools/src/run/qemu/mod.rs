//! QEMU with the firmware in it: its command line, its pipes, and how it ends.

mod command;
mod lines;

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tempfile::TempDir;

use command::{Arguments, PROGRAM, command, make_fifo};
use lines::{Line, listen};

pub use command::check;
pub use lines::Again;

use crate::files::settle;

/// The firmware is to be started again.
const EXIT_AGAIN: i32 = 3;
/// How long the firmware may take until it listens.
const BOOT: Duration = Duration::from_mins(1);
/// How long it may take to work off what was sent and to close the log.
const SHUTDOWN: Duration = Duration::from_mins(3);
/// How long to wait for a socket to appear.
const CONNECT: Duration = Duration::from_secs(10);

/// The bit of a count in the clock's pipe that says that the bytes are the ground station's.
const FROM_GS: u32 = 1 << 31;

/// How a start of the firmware ended.
pub enum Ended {
    /// In order: its counters, one JSON object.
    Done(String),
    /// It goes on with another start.
    Again(Again),
}

/// Where the bytes of a port go; it outlives a start.
pub type Ground = Arc<Mutex<Box<dyn Write + Send>>>;

/// What a start of the firmware needs.
pub struct Start<'a> {
    /// The image.
    pub firmware: &'a Path,
    /// The card's image.
    pub card: &'a Path,
    /// The store's flash.
    pub store: &'a Path,
    /// Where the bytes for the ground station go.
    pub gs: Ground,
    /// Where the bytes for the autopilot go.
    pub autopilot: Ground,
    /// Further arguments, `key=value`.
    pub arguments: Vec<String>,
    /// It counts the instructions of each stage.
    pub costs: bool,
    /// Memory that survived the reset before this start.
    pub survived: Option<Vec<u8>>,
}

/// The count of a feed's record that is the end of the power.
const POWER_OFF: u32 = u32::MAX;
/// The file in the emulator's directory through which memory survives a reset.
const SURVIVED: &str = "uninit";

/// The firmware, running.
pub struct Qemu {
    child: Child,
    lines: Receiver<Line>,
    /// The clock: 12-byte records of time and count.
    feed: Option<File>,
    /// The autopilot UART.
    uart: Option<UnixStream>,
    /// The ground station's.
    ground: Option<UnixStream>,
    downlink: Option<JoinHandle<std::io::Result<u64>>>,
    complaints: JoinHandle<String>,
    dir: TempDir,
}

impl Qemu {
    /// Starts the firmware and waits until it listens.
    pub fn start(start: Start<'_>) -> Result<Self> {
        let dir = tempfile::Builder::new().prefix("hums-").tempdir().context("no temporary directory")?;
        let at = |name: &str| dir.path().join(name);
        // Links keep the paths in QEMU's argument short and free of characters that it would read.
        for (path, link) in [(start.card, "card"), (start.store, "store")] {
            let path = std::path::absolute(path)?;
            symlink(&path, at(link)).with_context(|| format!("{}: cannot be linked", path.display()))?;
        }
        if let Some(survived) = &start.survived {
            std::fs::write(at(SURVIVED), survived)
                .context("what survived the reset cannot be handed over")?;
        }
        make_fifo(&at("feed"))?;
        let Start { firmware, arguments, costs, .. } = &start;
        let mut child = command(&Arguments { firmware, more: arguments, costs: *costs }, dir.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("{PROGRAM} cannot be started"))?;
        let (lines, complaints) = listen(&mut child)?;
        let mut qemu =
            Self { child, lines, feed: None, uart: None, ground: None, downlink: None, complaints, dir };
        // It waits for this one before it starts the firmware, so that not one byte is missed.
        let ground = qemu.connect("gs")?;
        qemu.ground = Some(ground.try_clone().context("the ground station's port")?);
        qemu.downlink = Some(forward(ground, start.gs));
        let uart = qemu.connect("ap")?;
        // What is sent to the autopilot must be read, or the emulator would wait for that.
        let _ = forward(uart.try_clone().context("the autopilot's port")?, start.autopilot);
        qemu.uart = Some(uart);
        match qemu.lines.recv_timeout(BOOT) {
            Ok(Line::Ready) => {}
            Ok(Line::Result(_) | Line::Again(_)) | Err(RecvTimeoutError::Disconnected) => {
                let why = qemu.end()?;
                bail!("the firmware ended before it listened{why}");
            }
            Err(RecvTimeoutError::Timeout) => bail!("the firmware did not start to listen within {BOOT:?}"),
        }
        // For reading as well: that never waits, and the firmware sees the end when this handle is dropped.
        let feed = OpenOptions::new().read(true).write(true).open(qemu.dir.path().join("feed"));
        qemu.feed = Some(feed.context("the clock's pipe cannot be opened")?);
        Ok(qemu)
    }

    fn connect(&mut self, name: &str) -> Result<UnixStream> {
        let path = self.dir.path().join(name);
        let start = Instant::now();
        loop {
            if let Ok(stream) = UnixStream::connect(&path) {
                return Ok(stream);
            }
            if self.child.try_wait()?.is_some() {
                let why = self.end()?;
                bail!("{PROGRAM} ended at once{why}");
            }
            if start.elapsed() > CONNECT {
                bail!("{PROGRAM} does not listen at its {name} port");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// "At this time these bytes have arrived." `false`: it is being reset, and takes no more.
    pub fn arrive(&mut self, at_us: u64, bytes: &[u8]) -> Result<bool> {
        self.give(at_us, bytes, false)
    }

    /// The same for bytes of the ground station.
    pub fn hear(&mut self, at_us: u64, bytes: &[u8]) -> Result<bool> {
        self.give(at_us, bytes, true)
    }

    fn give(&mut self, at_us: u64, bytes: &[u8], from_gs: bool) -> Result<bool> {
        match self.send(at_us, bytes, if from_gs { FROM_GS } else { 0 }) {
            Ok(()) => Ok(true),
            // It said so before it ended; its lines may still be on their way.
            Err(_) if self.child.wait()?.code() == Some(EXIT_AGAIN) => Ok(false),
            Err(error) => {
                let why = self.end()?;
                bail!("the firmware stopped taking bytes ({error}){why}")
            }
        }
    }

    /// "At this time power goes."
    pub fn power_off(&mut self, at_us: u64) -> Result<()> {
        // Where it is reset before, that is how it ends.
        let _ = self.send(at_us, &[], POWER_OFF);
        Ok(())
    }

    /// A record of the feed, its count with these bits, and the bytes at their port.
    fn send(&mut self, at_us: u64, bytes: &[u8], bits: u32) -> std::io::Result<()> {
        let mut record = [0; 12];
        record[..8].copy_from_slice(&at_us.to_le_bytes());
        record[8..].copy_from_slice(&(bytes.len() as u32 | bits).to_le_bytes());
        let port = if bits == FROM_GS { &mut self.ground } else { &mut self.uart };
        match (&mut self.feed, port) {
            (Some(feed), Some(uart)) => feed.write_all(&record).and_then(|()| uart.write_all(bytes)),
            _ => Ok(()),
        }
    }

    /// No more bytes: the firmware closes the log and prints its counters, one JSON object; or it goes on with another
    /// start.
    pub fn finish(mut self) -> Result<Ended> {
        self.feed = None;
        let result = match self.lines.recv_timeout(SHUTDOWN) {
            Ok(Line::Result(json)) => Some(Ended::Done(json)),
            Ok(Line::Again(again)) => Some(Ended::Again(again)),
            Ok(Line::Ready) | Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) => {
                bail!("the firmware did not end within {SHUTDOWN:?} after its input")
            }
        };
        let status = self.child.wait().context("the emulator's end")?;
        (self.uart, self.ground) = (None, None);
        if let Some(downlink) = self.downlink.take()
            && let Ok(result) = downlink.join()
        {
            settle(result.map(drop), Path::new("--gs"))?;
        }
        match (status.code(), result) {
            (Some(0), Some(done @ Ended::Done(_))) => Ok(done),
            (Some(EXIT_AGAIN), Some(Ended::Again(mut again))) => {
                again.survived = std::fs::read(self.dir.path().join(SURVIVED)).ok();
                Ok(Ended::Again(again))
            }
            _ => {
                let why = self.end()?;
                bail!("the firmware failed{why}")
            }
        }
    }

    /// How it ended, as the end of a sentence.
    fn end(&mut self) -> Result<String> {
        (self.feed, self.uart, self.ground) = (None, None, None);
        let status = if let Some(status) = self.child.try_wait()? {
            status
        } else {
            std::thread::sleep(Duration::from_millis(200));
            let _ = self.child.kill();
            self.child.wait()?
        };
        let mut why = match status.code() {
            Some(0) => String::new(),
            Some(2) => ": it could not open its clock's pipe".to_owned(),
            Some(101) => ": it panicked (see above)".to_owned(),
            Some(102) => ": all its tasks wait for ever".to_owned(),
            Some(code) => format!(": {PROGRAM} exit code {code}"),
            None => ": it was killed".to_owned(),
        };
        let complaints = std::mem::replace(&mut self.complaints, std::thread::spawn(String::new));
        let complaints = complaints.join().unwrap_or_default();
        // What it says in passing is no complaint, and a register dump is for the few who can read it.
        for line in complaints.lines().filter(|line| line.starts_with("qemu") && !line.contains(": info: ")) {
            let _ = write!(why, "\n{line}");
        }
        Ok(why)
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // Only one that is still running, after an error, takes notice.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn forward(mut from: UnixStream, to: Ground) -> JoinHandle<std::io::Result<u64>> {
    std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        let mut total = 0;
        loop {
            let got = match from.read(&mut buffer) {
                Ok(0) => break,
                Ok(got) => got,
                // The emulator's end resets the connection.
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(_) => break,
            };
            let mut to = to.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            to.write_all(buffer.get(..got).unwrap_or_default())?;
            to.flush()?;
            total += got as u64;
        }
        Ok(total)
    })
}
