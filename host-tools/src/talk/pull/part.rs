//! A part of a log: a file with each downloaded sector at its own place, and zeros for the others.
//!
//! Its name marks it as a part, `00042-..._07.part.HUM`, and every reader reports that
//! ([`crate::logs::naming::is_part`]). One call of `--around` makes it. It gets its name once the whole
//! moment is in it, and is not extended later.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use hums_blackbox::{Header, SECTOR_BYTES, Sector};
use tempfile::NamedTempFile;

use super::compare::beginning_of;
use crate::files::{begin, cannot_write};
use crate::logs::naming::part_name;
use crate::outcome::exists;

/// The part of one log.
#[derive(Debug)]
pub(super) struct Part {
    file: NamedTempFile<File>,
    /// Its name, once complete.
    target: PathBuf,
    /// Which sectors it has.
    has: Vec<bool>,
    /// The session of the part, once a sector has named it.
    session: Option<u32>,
    /// The number of the sector at its beginning, if the first ones show it.
    base: Option<u32>,
    /// Places at which sectors of other sessions came, which are not kept.
    strange: BTreeSet<u32>,
}

impl Part {
    /// Begins the part beside a log's own path, for a log of this many sectors with these first ones. An
    /// existing part is not overwritten: the card may have lost sectors that are in it.
    pub(super) fn begin(whole: &Path, sectors: u32, head: &[Sector]) -> Result<Self> {
        let target = part_name(whole);
        if target.symlink_metadata().is_ok() {
            return Err(exists(&target, false));
        }
        let (session, base) = beginning_of(head);
        let open = |part: &Path| File::options().read(true).write(true).create_new(true).open(part);
        let bytes = u64::from(sectors) * SECTOR_BYTES as u64;
        let file = begin(&target, open).and_then(|file| file.as_file().set_len(bytes).map(|()| file));
        let file = file.with_context(|| cannot_write(&target))?;
        let (has, strange) = (vec![false; sectors as usize], BTreeSet::new());
        let mut part = Self { file, target, has, session, base, strange };
        (0..).zip(head).try_for_each(|(place, sector)| part.put(place, sector))?;
        Ok(part)
    }

    /// Number of sectors of the log.
    pub(super) fn sectors(&self) -> u32 {
        self.has.len() as u32
    }

    /// Places at which sectors of other sessions came, which are not kept: another log has replaced this one,
    /// or the card has lost some.
    pub(super) const fn strange(&self) -> &BTreeSet<u32> {
        &self.strange
    }

    /// The number of the sector at its beginning, if known.
    pub(super) const fn base(&self) -> Option<u32> {
        self.base
    }

    /// Its path until it is complete.
    pub(super) fn path(&self) -> &Path {
        self.file.path()
    }

    /// The whole moment is in it: it gets its name.
    pub(super) fn finish(self) -> Result<PathBuf> {
        let Self { file, target, .. } = self;
        file.persist_noclobber(&target).with_context(|| cannot_write(&target))?;
        Ok(target)
    }

    /// Whether a sector belongs at this place. A copy of a sector in progress may be one place further.
    pub(super) fn belongs(&self, place: u32, header: &Header) -> bool {
        let number = self.base.map_or(header.number, |base| base.wrapping_add(place));
        header.number == number || header.partial && header.number.wrapping_add(1) == number
    }

    /// Whether it has a sector.
    pub(super) fn has(&self, place: u32) -> bool {
        self.has.get(place as usize).is_some_and(|has| *has)
    }

    /// The first place from this one on whose sector is there, or is missing.
    pub(super) fn next(&self, from: u32, is_in: bool) -> Option<u32> {
        (from..self.has.len() as u32).find(|place| self.has(*place) == is_in)
    }

    /// The sector at a place.
    pub(super) fn read(&mut self, place: u32) -> Result<Sector> {
        let mut bytes = [0; SECTOR_BYTES];
        self.seek(place)
            .and_then(|()| self.file.read_exact(&mut bytes))
            .with_context(|| cannot_write(&self.target))?;
        Ok(Sector::from_bytes(bytes))
    }

    /// Puts a sector at its place, unless it is another session's.
    pub(super) fn put(&mut self, place: u32, sector: &Sector) -> Result<()> {
        if let Ok(header) = Header::read(sector.bytes()) {
            if *self.session.get_or_insert(header.session) != header.session {
                self.strange.insert(place);
                return Ok(());
            }
            self.base = self.base.or_else(|| header.number.checked_sub(place).filter(|_| !header.partial));
        }
        self.seek(place)
            .and_then(|()| self.file.write_all(sector.bytes()))
            .with_context(|| cannot_write(&self.target))?;
        if let Some(has) = self.has.get_mut(place as usize) {
            *has = true;
        }
        Ok(())
    }

    fn seek(&mut self, place: u32) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(u64::from(place) * SECTOR_BYTES as u64)).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn sector(session: u32, number: u8) -> Sector {
        let mut bytes = [0; SECTOR_BYTES];
        (bytes[0], bytes[1], bytes[11]) = (b'H', 0xb0 | hums_blackbox::VERSION, number);
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(session);
        sector
    }

    #[test]
    fn a_part_has_sectors_of_one_session_at_their_places_and_is_not_overwritten() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let mut part = Part::begin(&whole, 8, &[sector(7, 0)]).expect("made");
        for place in [3, 4] {
            part.put(place, &sector(7, place as u8)).expect("room");
        }
        part.put(6, &sector(9, 6)).expect("room");
        assert_eq!((0..8).filter(|place| part.has(*place)).collect::<Vec<_>>(), [0, 3, 4]);
        assert_eq!((part.next(1, true), part.next(3, false), part.next(5, true)), (Some(3), Some(5), None));
        assert_eq!(part.read(3).expect("a sector"), sector(7, 3));
        assert_eq!(part.strange().iter().collect::<Vec<_>>(), [&6]);
        let bytes = fs::read(part.path()).expect("there");
        assert!(bytes.len() == 8 * SECTOR_BYTES && bytes[6 * SECTOR_BYTES..].iter().all(|byte| *byte == 0));
        let path = part.finish().expect("it gets its name");
        assert!(path == part_name(&whole) && Part::begin(&whole, 8, &[]).is_err(), "it is there");
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_link() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let other = dir.path().join("other");
        fs::write(&other, "mine").expect("written");
        std::os::unix::fs::symlink(&other, part_name(&whole)).expect("a link");
        assert!(Part::begin(&whole, 8, &[]).is_err());
        assert_eq!(fs::read(&other).expect("there"), b"mine");
    }
}
