//! The bench check, over the page's own link.

use std::io::{self, ErrorKind, Read as _, Write};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use anyhow::{Result, anyhow};
use serde::Serialize;

use crate::cli;
use crate::duplex::{Duplex, Port};
use crate::page::json::json;
use crate::talk::setup::SetupJson;

/// Fits any buffer.
const PIECE_BYTES: usize = 1_024;
const SILENCE: Duration = Duration::from_millis(20);

/// The check.
#[derive(Debug)]
pub struct Bench {
    args: cli::Setup,
    running: Option<Running>,
    has_result: bool,
    /// For the pages.
    pub shown: Arc<str>,
}

#[derive(Debug)]
struct Running {
    received: Sender<Vec<u8>>,
    sent: Receiver<Vec<u8>>,
    thread: JoinHandle<Result<SetupJson>>,
}

#[derive(Serialize)]
struct BenchJson {
    t: &'static str,
    words: String,
    found: Option<SetupJson>,
    port: u8,
}

impl Bench {
    /// Not begun.
    pub fn new(args: cli::Setup) -> Self {
        let mut bench = Self { args, running: None, has_result: false, shown: Arc::default() };
        bench.show("not checked".to_owned(), None);
        bench
    }

    fn show(&mut self, words: String, found: Option<SetupJson>) {
        self.has_result = found.is_some();
        self.shown = json(&BenchJson { t: "bench", words, found, port: self.args.port }).into();
    }

    /// Begins, unless it runs.
    pub fn start(&mut self, system: Option<u8>) {
        if self.running.is_some() {
            return;
        }
        self.args.at.system = system;
        let ((received, reader), (writer, sent)) = (channel(), channel());
        let duplex = Duplex { reader: Box::new(Reader(reader)), writer: Box::new(Writer(writer)) };
        let args = self.args.clone();
        let thread = Builder::new().name("bench".to_owned()).spawn(move || SetupJson::on(duplex, &args));
        self.running = thread.ok().map(|thread| Running { received, sent, thread });
        let words = if self.running.is_some() { "checking" } else { "not checked: no thread" };
        self.show(words.to_owned(), None);
    }

    /// Passes bytes on; `link` is there once an arming is known. Arming ends check and result.
    pub fn pass(&mut self, received: &[u8], is_armed: bool, link: Option<&mut dyn Write>) {
        if is_armed && self.has_result {
            self.show("not checked since the last arming".to_owned(), None);
        }
        let Some(running) = self.running.take() else { return };
        if !is_armed && !running.thread.is_finished() {
            let mut pieces = received.chunks(PIECE_BYTES);
            let _ = pieces.try_for_each(|piece| running.received.send(piece.to_vec()));
            let mut sent = running.sent.try_iter();
            match link.map_or(Ok(()), |link| sent.try_for_each(|bytes| link.write_all(&bytes))) {
                Ok(()) => self.running = Some(running),
                Err(error) => self.show(format!("not checked: the link takes nothing: {error}"), None),
            }
            return;
        }
        let found = if is_armed { Ok(Err(anyhow!("the vehicle is armed"))) } else { running.thread.join() };
        match found.unwrap_or_else(|_| Err(anyhow!("a fault of hums; please report it"))) {
            Ok(found) => self.show(found.verdict(), Some(found)),
            Err(error) => self.show(format!("not checked: {error:#}"), None),
        }
    }
}

struct Reader(Receiver<Vec<u8>>);

impl Port for Reader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.0.recv_timeout(SILENCE) {
            Ok(bytes) => bytes.as_slice().read(buffer),
            Err(RecvTimeoutError::Timeout) => Err(ErrorKind::WouldBlock.into()),
            Err(RecvTimeoutError::Disconnected) => Ok(0),
        }
    }
}

struct Writer(Sender<Vec<u8>>);

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.send(bytes.to_vec()).map_err(|_| ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
