//! A log on the board whose sectors are downloaded one by one, into a part of it.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use anyhow::{Result, bail};
use hums_blackbox::{Header, SECTOR_BYTES, Sector};
use hums_recorder::card::SEGMENT_BYTES_MAX;

use super::compare::{bytes_of, heading_of};
use super::ftp::Ftp;
use super::moment::Sectors;
use super::part::Part;
use super::stretch::Stretch;

/// Twice the longest log of any recorder: a part of a longer one would fill the disk.
const LOG_BYTES_MAX: u64 = 2 * SEGMENT_BYTES_MAX as u64;

/// A log on the board, and its local part.
pub(super) struct Remote<'a> {
    ftp: &'a mut Ftp,
    name: &'a str,
    part: &'a mut Part,
}

impl<'a> Remote<'a> {
    /// Opens a log that the board's directory lists as not empty. `parts` are those of the logs opened
    /// before.
    pub(super) fn open(
        ftp: &'a mut Ftp,
        parts: &'a mut BTreeMap<String, Part>,
        name: &'a str,
        output: &Path,
    ) -> Result<Self> {
        let length = ftp.open(name)?;
        if u64::from(length) > LOG_BYTES_MAX {
            bail!("{name}: no recorder makes a log of {length} bytes, as the board says that it has");
        }
        let sectors = length / SECTOR_BYTES as u32;
        if sectors == 0 {
            bail!("{name}: nothing is in it, though the board's directory says so; call again");
        }
        let none = match parts.entry(name.to_owned()) {
            Entry::Occupied(part) => return Ok(Self { ftp, name, part: part.into_mut() }),
            Entry::Vacant(none) => none,
        };
        let heading = heading_of(ftp, name, length)?;
        let whole = output.join(&heading.name);
        if whole.exists() {
            bail!(
                "{} is there already: `hums decode --from --to` shows a moment of it, and `hums box pull` brings what it lacks",
                whole.display()
            );
        }
        let part = none.insert(Part::begin(&whole, sectors, &heading.sectors)?);
        Ok(Self { ftp, name, part })
    }

    /// Adds the places of sectors of other sessions, which are not in the part.
    pub(super) fn add_strange(&self, all: &mut BTreeSet<(String, u32)>) {
        all.extend(self.part.strange().iter().map(|place| (self.name.to_owned(), *place)));
    }

    /// These places of it.
    pub(super) fn stretch(&self, places: Range<u32>) -> Stretch {
        let (name, path) = (self.name.to_owned(), self.part.path().to_owned());
        Stretch { name, path, places, sectors: self.part.sectors() }
    }

    /// The number of its first sector, if known.
    pub(super) fn first_number(&self) -> Option<u32> {
        self.part.base()
    }

    /// Downloads the missing sectors of these places.
    pub(super) fn bring(&mut self, places: Range<u32>) -> Result<Stretch> {
        let Range { start: mut place, end: to } = places;
        while let Some(first) = self.part.next(place, false).filter(|first| *first < to) {
            let end = self.part.next(first, true).unwrap_or(to).min(to);
            let Self { ftp, part, .. } = self;
            let (mut next, mut waiting) = (first, Vec::new());
            let size = SECTOR_BYTES as u32;
            ftp.bring(first * size, end * size, |bytes| {
                waiting.extend_from_slice(bytes);
                while let Some((sector, rest)) = waiting.split_first_chunk::<SECTOR_BYTES>() {
                    part.put(next, &Sector::from_bytes(*sector))?;
                    next += 1;
                    waiting = rest.to_vec();
                }
                Ok(())
            })?;
            note!("{}: {} of {} sectors came", self.name, end - places.start, to - places.start);
            place = end;
        }
        Ok(self.stretch(places))
    }
}

impl Sectors for Remote<'_> {
    fn count(&self) -> u32 {
        self.part.sectors()
    }

    fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>> {
        if !self.part.has(place) {
            let bytes = bytes_of(self.ftp, place * SECTOR_BYTES as u32, SECTOR_BYTES as u32)?;
            let sector = bytes.first_chunk().map_or(Sector::zeroed(), |bytes| Sector::from_bytes(*bytes));
            self.part.put(place, &sector)?;
        }
        let sector = self.part.read(place)?;
        let header = Header::read(sector.bytes()).ok().filter(|header| self.part.belongs(place, header));
        Ok(header.map(|header| (header, sector)))
    }
}
