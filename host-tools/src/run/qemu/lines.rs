//! What the firmware and QEMU say while they run.

use std::io::{BufRead, BufReader, Read};
use std::process::Child;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

use anyhow::{Context, Result};
use serde::Deserialize;

/// A line of the firmware's.
pub(super) enum Line {
    /// It listens.
    Ready,
    /// Its counters, one JSON object.
    Result(String),
    /// It is to be started again.
    Again(Again),
}

/// The firmware was reset, or its power went, and is to be started again.
#[derive(Debug, Deserialize)]
pub struct Again {
    /// `reset` or `power`.
    pub what: String,
    /// When, in microseconds since its start.
    pub at_us: u64,
    /// How many bytes of its input it took out of the port.
    pub taken: u64,
    /// Frames that came in.
    pub frames_in: u64,
    /// Bytes that came in.
    pub bytes_in: u64,
    /// Bytes of them that belong to no frame.
    pub bytes_not_frames: u64,
    /// Blocks of the card that were written.
    pub blocks_written: u64,
    /// Memory that survived.
    #[serde(skip)]
    pub survived: Option<Vec<u8>>,
}

/// The firmware's lines, and QEMU's complaints.
pub(super) fn listen(child: &mut Child) -> Result<(Receiver<Line>, JoinHandle<String>)> {
    let stdout = child.stdout.take().context("the emulator has no output")?;
    let mut stderr = child.stderr.take().context("the emulator has no error output")?;
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            let sent = match line.as_str() {
                "ready" => sender.send(Line::Ready),
                json if json.starts_with('{') => sender.send(Line::Result(json.to_owned())),
                line if again(line).is_some() => {
                    again(line).map_or(Ok(()), |again| sender.send(Line::Again(again)))
                }
                message => {
                    eprintln!("firmware: {message}");
                    Ok(())
                }
            };
            if sent.is_err() {
                break;
            }
        }
    });
    let complaints = std::thread::spawn(move || {
        let mut text = String::new();
        // Whatever could be read is told.
        let _ = stderr.read_to_string(&mut text);
        text
    });
    Ok((lines, complaints))
}

/// What it says when it is to be started again.
fn again(line: &str) -> Option<Again> {
    serde_json::from_str(line.strip_prefix("again ")?).ok()
}
