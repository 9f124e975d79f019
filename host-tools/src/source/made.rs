//! Whether a tlog is what `hums decode` makes of a recording: its name alone may be that of another flight, and somebody may have
//! put another flight behind it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::item::{Item, Stop, Want};
use super::recording::Place;
use super::tlog::records::{Record, Records};

/// Whether a tlog has nothing but frames of a recording, in their order. One that has none hides no flight.
pub(super) fn is_made_of(tlog: &Path, of: &Place) -> bool {
    let Ok(file) = File::open(tlog) else { return false };
    let mut records = Records::new(file);
    let mut wanted = next_frame(&mut records);
    let Ok(recording) = of.open() else { return false };
    // That the recording cannot be read further is told where it is read.
    let _ = recording.read(Want { frames: true, ..Want::default() }, &mut |_, item| {
        let Wanted::Frame(bytes) = &wanted else { return Err(Stop.into()) };
        if let Item::Frame(frame) = item
            && frame.bytes() == bytes
        {
            wanted = next_frame(&mut records);
        }
        Ok(())
    });
    matches!(wanted, Wanted::End)
}

/// What comes next in a tlog.
enum Wanted {
    Frame(Vec<u8>),
    /// What no decoding writes.
    Else,
    End,
}

fn next_frame(records: &mut Records<impl Read>) -> Wanted {
    match records.next_record() {
        Ok(Some(Record::Frame { bytes, .. })) => Wanted::Frame(bytes),
        Ok(Some(Record::Noise(_))) | Err(_) => Wanted::Else,
        Ok(None) => Wanted::End,
    }
}
