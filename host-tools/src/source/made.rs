//! Whether a tlog is what `hums decode` makes of a log: its name alone may be that of another flight.

use std::fs::File;
use std::path::Path;

use hums_blackbox::{Entry, GroupDecoder};

use super::tlog::records::{Record, Records};
use crate::logs::Log;
use crate::logs::groups::Groups;

/// So many of a tlog's first frames are looked for in the log: two that are alike are seldom of one moment.
const FRAMES: usize = 16;

/// Whether a tlog's first frames are in a log, in their order. One that has none hides no flight.
pub(super) fn is_made_of(tlog: &Path, log: &Log) -> bool {
    let wanted = first_frames(tlog);
    let mut found = 0;
    let (mut groups, mut decoder) = (Groups::new(log), Box::new(GroupDecoder::new()));
    while found < wanted.len()
        && let Ok(Some(group)) = groups.next_group()
    {
        for step in &group {
            if decoder.push(&step.header, &step.sector).is_err() {
                break;
            }
            while let Some(Ok(entry)) = decoder.next_entry() {
                let Entry::Frame { bytes, .. } = entry else { continue };
                found += usize::from(wanted.get(found).is_some_and(|frame| frame == bytes));
            }
        }
    }
    found >= wanted.len()
}

/// The first frames of a tlog; fewer where it ends or cannot be read further.
fn first_frames(tlog: &Path) -> Vec<Vec<u8>> {
    let Ok(file) = File::open(tlog) else { return Vec::new() };
    let (mut records, mut frames) = (Records::new(file), Vec::new());
    while frames.len() < FRAMES
        && let Ok(Some(record)) = records.next_record()
    {
        if let Record::Frame { bytes, .. } = record {
            frames.push(bytes);
        }
    }
    frames
}
