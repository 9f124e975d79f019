//! Inputs: recordings of every format as one stream of items ([`item`], [`recording`]). For `hums sim`
//! they are the UART's bytes.
//!
//! | format | read by |
//! |---|---|
//! | log of HUMS | `own` |
//! | tlog, raw MAVLink | `mavlink` |
//! | ArduPilot's `DataFlash` | `dataflash` |
//! | PX4's `ULog` | `ulog` |
//!
//! A further format is a [`item::Reader`], and a line of [`recording::Recording::new`]. Items come in order
//! ([`recording::Recording::read`]), or in [`parts`] ([`recording::LogPlace::in_parts`]) for all cores.
//!
//! # Bytes
//!
//! | source | arrival times |
//! |---|---|
//! | a tlog (file or `-`) | the recorded ones, counted from the first |
//! | raw bytes (file or `-`) | none recorded: paced as on a line at 115,200 baud; [`booted`] has the autopilot's |
//! | UDP, TCP, serial | the clock's |
//!
//! Times are microseconds since the first byte and never fall ([`tlog::times`]).

pub mod blocks;
mod boot;
pub mod booted;
mod buffer;
pub mod checksums;
pub mod clock;
mod compressed;
mod counts;
pub mod dataflash;
mod daytime;
pub mod doubt;
pub mod epochs;
pub mod find;
pub mod format;
pub mod input;
pub mod item;
#[cfg(not(target_family = "wasm"))]
pub mod live;
#[cfg(target_family = "wasm")]
#[path = "no_live.rs"]
pub mod live;
pub mod mavlink;
pub mod noise;
pub mod own;
pub mod pace;
pub mod paced;
pub mod parts;
pub mod raw;
pub mod recording;
pub mod repairs;
mod said;
pub mod sniff;
mod stream;
pub mod timeline;
pub mod tlog;
pub mod told;
pub mod ulog;

pub use said::parameter;
pub use stream::{Chunk, Source};

use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, Error, Result, anyhow, bail};

use crate::endpoint::Endpoint;
use crate::files::is_seekable;
use crate::logs::{self, Content};
use crate::outcome::usage;
use input::Input;

pub use recording::RAW_BAUD;

/// The way back to a source that receives.
pub type Way = Box<dyn Write + Send>;

/// The source of a recording's times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Back to back at this rate, baud, whatever the recorded times.
    pub line_rate: Option<u32>,
}

/// SRC with the way back, if any.
pub fn open_both(endpoint: &Endpoint, timing: Timing) -> Result<(Box<dyn Source>, Option<Way>)> {
    if endpoint.is_live() && timing.line_rate.is_none() {
        let (source, writer) = live::open(endpoint)?;
        return Ok((source, Some(writer)));
    }
    Ok((open(endpoint, timing)?, None))
}

/// Opens SRC.
pub fn open(endpoint: &Endpoint, timing: Timing) -> Result<Box<dyn Source>> {
    if endpoint.is_live() {
        if timing.line_rate.is_some() {
            return Err(usage(format!("--line-rate: {endpoint} comes at its own rate; give a file or `-`")));
        }
        return Ok(live::open(endpoint)?.0);
    }
    let input = match endpoint {
        Endpoint::File(path) => {
            let context = || format!("{}: cannot be opened", path.display());
            let about = path.metadata().with_context(context)?;
            if about.is_dir() {
                bail!("{}: is a directory; give a recording (tlog or raw MAVLink bytes)", path.display());
            }
            // Opening a pipe would wait for its other end, without a message.
            if !is_seekable(&about) {
                bail!(
                    "{0}: is a pipe, a socket, a terminal or the like; copy it into a file, or name `-` and give it as \
                     standard input: < {0}",
                    path.display()
                );
            }
            refuse_our_own(path)?;
            Input::open(path)?
        }
        _ => Input::new(io::stdin()).with_context(|| format!("{endpoint}"))?,
    };
    let progress = input.progress();
    let (kind, input) = sniff::sniff(input).with_context(|| format!("{endpoint}"))?;
    let start = input.get_ref().0.get_ref();
    if let Some(what) = format::hint(start) {
        bail!("{endpoint}: {what}");
    }
    if let Some(format) = format::format_of(start).filter(|format| !format.is_of_link()) {
        bail!(
            "{endpoint}: is {}, which has no MAVLink frames; hums check, info, report and decode read it",
            format.with_article()
        );
    }
    let is_file = matches!(endpoint, Endpoint::File(_));
    let source: Box<dyn Source> = match (kind, timing.line_rate) {
        (sniff::InputKind::Empty, _) => match progress.damage() {
            Some(words) => bail!("{endpoint}: {words}"),
            None => bail!("{endpoint}: is empty: not one byte would arrive"),
        },
        (sniff::InputKind::Tlog, None) if is_file => Box::new(tlog::Tlog::ahead(input)),
        (sniff::InputKind::Tlog, None) => Box::new(tlog::Tlog::new(input)),
        (sniff::InputKind::Tlog, Some(baud)) => {
            Box::new(paced::PacedSource::new(tlog::Tlog::new(input), baud))
        }
        (sniff::InputKind::Raw, baud) => {
            Box::new(paced::PacedSource::new(raw::Raw::new(input), baud.unwrap_or(RAW_BAUD)))
        }
    };
    Ok(Box::new(compressed::Compressed::new(source, progress)))
}

/// The error for a command that writes frames.
pub fn no_frame(input: impl Display) -> Error {
    anyhow!("{input}: has no MAVLink frame, so nothing was written; hums check says what a file is")
}

/// Its frames are not as received.
fn refuse_our_own(path: &Path) -> Result<()> {
    let name = path.display();
    let what = match logs::find::look(path)? {
        Content::Log => "a log of HUMS",
        Content::Image if !logs::on_card(path).is_empty() => "an SD card with logs of HUMS",
        _ => return Ok(()),
    };
    bail!(
        "{name}: is {what}, not a recording; `hums decode {name} -o OUT --format tlog` makes recordings of it"
    )
}
