//! Whether a tlog is what `hums decode` makes of a recording: its name alone may be that of another flight, and somebody may have
//! put another flight behind it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;

use super::epochs::Epochs;
use super::item::{Item, Stop, Want};
use super::recording::Place;
use super::tlog::records::{Record, Records};
use crate::logs::reader;

/// What a tlog is beside a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Made {
    /// It has nothing but frames of the recording, in their order and at their times: what `hums decode` makes of it.
    Of,
    /// The same frames, and other times.
    OtherTimes,
    /// More or other frames.
    No,
}

/// What a tlog is beside a recording. One that has no frame hides no flight.
pub(super) fn made_of(tlog: &Path, of: &Place) -> Made {
    let epochs = epochs_of(of).unwrap_or_default();
    let time = |at: Instant| epochs.utc_us(at).unwrap_or_else(|| at.as_micros());
    if is_in(tlog, of, |at, time_us| time_us == time(at)) {
        Made::Of
    } else if is_in(tlog, of, |_, _| true) {
        Made::OtherTimes
    } else {
        Made::No
    }
}

/// UTC of a recording, as `hums decode` writes it into a tlog.
fn epochs_of(of: &Place) -> Result<Epochs> {
    if let Some(log) = of.own() {
        return reader::epoch(log).map(Epochs::of);
    }
    let mut epochs = Epochs::default();
    of.open()?.read(Want::default(), &mut |at, item| {
        epochs.take(at, &item);
        Ok(())
    })?;
    Ok(epochs)
}

/// Whether each frame of a tlog comes in a recording, in their order, at a time that fits.
fn is_in(tlog: &Path, of: &Place, fits: impl Fn(Instant, u64) -> bool) -> bool {
    let Ok(file) = File::open(tlog) else { return false };
    let mut records = Records::new(file);
    let mut wanted = next_frame(&mut records);
    let Ok(recording) = of.open() else { return false };
    // That the recording cannot be read further is told where it is read.
    let _ = recording.read(Want { frames: true, ..Want::default() }, &mut |at, item| {
        let Wanted::Frame { time_us, bytes } = &wanted else { return Err(Stop.into()) };
        if let Item::Frame(frame) = item
            && frame.bytes() == bytes
            && fits(at, *time_us)
        {
            wanted = next_frame(&mut records);
        }
        Ok(())
    });
    matches!(wanted, Wanted::End)
}

/// What comes next in a tlog.
enum Wanted {
    Frame {
        time_us: u64,
        bytes: Vec<u8>,
    },
    /// What no decoding writes.
    Else,
    End,
}

fn next_frame(records: &mut Records<impl Read>) -> Wanted {
    match records.next_record() {
        Ok(Some(Record::Frame { time_us, bytes })) => Wanted::Frame { time_us, bytes },
        Ok(Some(Record::Noise(_))) | Err(_) => Wanted::Else,
        Ok(None) => Wanted::End,
    }
}
