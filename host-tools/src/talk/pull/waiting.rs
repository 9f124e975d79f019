//! A vehicle that is recorded by arming is recorded while it waits for that too, into a log of which the box gives the oldest files away
//! again ([`crate::logs::late`]): no flight is in it, and a file of it may go while others come.

use std::ops::Range;
use std::path::PathBuf;

use anyhow::Result;
use hums_blackbox::{Entry, GroupDecoder, Header, Record, SECTOR_BYTES, Sector};

use super::compare::bytes_of;
use super::ftp::Ftp;
use super::judge::LogJson;
use super::moment::{Sectors, group_before};
use super::session::number;
use crate::logs;
use crate::logs::late::late;
use crate::outcome::Outcome;
use crate::plural::count;

/// The record of what is kept comes within 50 ms of a group: so many sectors of the fastest line.
const KEEP_SECTORS: u32 = 12;

/// The number of the newest of these logs, which are in their order, if the vehicle waits in it for an arming: its last record of that
/// says so.
pub(super) fn newest(ftp: &mut Ftp, logs: &[(String, u32)]) -> Result<Option<u32>> {
    let is_filled = |bytes: u32| bytes >= SECTOR_BYTES as u32;
    let Some((name, bytes)) = logs.iter().rfind(|(_, bytes)| is_filled(*bytes)) else { return Ok(None) };
    // It may be gone by now: that is told where it is brought.
    let Some(length) = ftp.open(name).ok().filter(|length| is_filled(*length)) else { return Ok(None) };
    let mut log = Glance { ftp, count: length.min(*bytes) / SECTOR_BYTES as u32 };
    let mut end = log.count;
    // What ended in order is no longer in work.
    if log.sector(end - 1)?.is_some_and(|(header, _)| header.closed) {
        return Ok(None);
    }
    // A group may be so short that the one before has the record.
    for _ in 0..2 {
        let start = group_before(&mut log, end)?;
        match log.keeps_all(start..end.min(start + KEEP_SECTORS))? {
            Some(true) => break,
            // It may have been armed since.
            Some(false) => {
                let waits = log.keeps_all(start..end)? == Some(false);
                return Ok(number(name).filter(|_| waits));
            }
            None => end = start,
        }
    }
    Ok(None)
}

/// The log that is open on a board, of which nothing is kept here.
struct Glance<'a> {
    ftp: &'a mut Ftp,
    count: u32,
}

impl Glance<'_> {
    /// What the last record among these sectors of a group says of what is kept: whether all is.
    fn keeps_all(&mut self, places: Range<u32>) -> Result<Option<bool>> {
        let (mut bytes, size) = (Vec::new(), SECTOR_BYTES as u32);
        self.ftp.bring(places.start * size, places.end * size, |more| {
            bytes.extend_from_slice(more);
            Ok(())
        })?;
        let (mut decoder, mut said) = (Box::new(GroupDecoder::new()), None);
        for sector in bytes.as_chunks().0 {
            let Ok(header) = Header::read(sector) else { break };
            if decoder.push(&header, &Sector::from_bytes(*sector)).is_err() {
                break;
            }
            while let Some(Ok(entry)) = decoder.next_entry() {
                if let Entry::Record { record: Record::Keep(keep), .. } = entry {
                    said = Some(keep.all);
                }
            }
        }
        Ok(said)
    }
}

impl Sectors for Glance<'_> {
    fn count(&self) -> u32 {
        self.count
    }

    fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>> {
        let bytes = bytes_of(self.ftp, place * SECTOR_BYTES as u32, SECTOR_BYTES as u32)?;
        let sector = bytes.first_chunk().map(|bytes| Sector::from_bytes(*bytes));
        Ok(sector.and_then(|sector| Some((Header::read(sector.bytes()).ok()?, sector))))
    }
}

/// Says of files that the board gave away before they came what they were: of a log that says itself that they were not to be kept they
/// are no loss.
pub(super) fn tell_gone(gone: &[String], pulled: &[LogJson]) -> Result<Outcome> {
    let mut outcome = Outcome::Done;
    for gone in gone.chunk_by(|one, next| number(one) == number(next)) {
        let [first, ..] = gone else { continue };
        let of_log = pulled.iter().filter(|log| number(&log.name) == number(first));
        let paths: Vec<PathBuf> = of_log.map(|log| log.path.clone()).collect();
        let mut is_wanted = !paths.is_empty();
        for log in logs::find(&paths, false)?.logs {
            is_wanted &= late(&log)?.is_some_and(|late| late.is_wanted && !late.is_renamed);
        }
        let files = count(gone.len() as u64, "file");
        if is_wanted {
            note!(
                "the recorder gave away {files} of the time before an arming meanwhile, from {first} on: they were not to be kept"
            );
        } else {
            note!(
                "the board no longer has {files} that it had in its list, from {first} on: its card made room for later ones"
            );
            outcome = Outcome::Losses;
        }
    }
    Ok(outcome)
}
