//! A part of a log: a file with each downloaded sector at its own place, and zeros for the others.
//!
//! Its name marks it as a part, `00042-..._07.part.HUM`, and every reader reports that
//! ([`crate::logs::naming::is_part`]). Neither `--around` nor a full download fetches its sectors again.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Header, SECTOR_BYTES, Sector};

use super::compare::beginning_of;
use crate::files::{cannot_write, open_in_place};
use crate::logs::naming::part_name;

/// The part of one log.
#[derive(Debug)]
pub(super) struct Part {
    file: File,
    path: PathBuf,
    /// Which sectors are in it.
    has: Vec<bool>,
    /// Those of them that came now: the others were here before, and may have been changed.
    came: BTreeSet<u32>,
    /// The session of the part, once a sector has named it.
    session: Option<u32>,
    /// The number of the sector at its beginning, if the first ones show it.
    base: Option<u32>,
    /// The places of sectors of other sessions that came, and are not in it.
    strange: BTreeSet<u32>,
}

impl Part {
    /// Opens the part beside a log's own path, or makes it. An open log may have grown. A file that is not a
    /// part of the log with these first sectors is refused.
    pub(super) fn open(whole: &Path, sectors: u32, head: &[Sector]) -> Result<Self> {
        let path = part_name(whole);
        if fs::symlink_metadata(&path).is_ok_and(|about| !about.is_file()) {
            bail!(
                "{}: is a link, or no file, and stands where a part of a log is written; nothing was written: put the file itself \
                 in its place, or move it away",
                path.display()
            );
        }
        let mut part = Self::at(path, head)?;
        let bytes = u64::from(sectors) * SECTOR_BYTES as u64;
        let there = part.file.metadata().with_context(|| cannot_write(&part.path))?.len();
        if there > bytes || !part.is_of(head, there)? {
            bail!(
                "{}: is no part of the board's log, which has {bytes} bytes; move it away",
                part.path.display()
            );
        }
        part.file.set_len(bytes).with_context(|| cannot_write(&part.path))?;
        part.look(sectors)?;
        Ok(part)
    }

    fn at(path: PathBuf, head: &[Sector]) -> Result<Self> {
        let (session, base) = beginning_of(head);
        let file = Self::opened(&path)?;
        let (has, came, strange) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
        Ok(Self { file, path, has, came, session, base, strange })
    }

    fn opened(path: &Path) -> Result<File> {
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        open_in_place(&mut options, path).with_context(|| cannot_write(path))
    }

    /// The part beside a log's own path, where there is one.
    pub(super) fn there(whole: &Path, sectors: u32, head: &[Sector]) -> Result<Option<Self>> {
        let is_there = fs::symlink_metadata(part_name(whole)).is_ok();
        is_there.then(|| Self::open(whole, sectors, head)).transpose()
    }

    /// Whether a file of this many bytes is a part of the log with these first sectors. It is one if it is
    /// empty. Otherwise its sectors must be of this session only and equal the known ones.
    fn is_of(&mut self, head: &[Sector], bytes: u64) -> Result<bool> {
        let (mut is_empty, mut session) = (true, self.session);
        let mut is_known = false;
        self.file.rewind().with_context(|| cannot_write(&self.path))?;
        let mut log = BufReader::new(&self.file).take(bytes);
        for place in 0..bytes.div_ceil(SECTOR_BYTES as u64) as usize {
            let mut block = Vec::new();
            let read = log.by_ref().take(SECTOR_BYTES as u64).read_to_end(&mut block);
            read.with_context(|| cannot_write(&self.path))?;
            is_empty &= block.iter().all(|byte| *byte == 0);
            let Some(header) = block.first_chunk::<SECTOR_BYTES>().and_then(|block| Header::read(block).ok())
            else {
                continue;
            };
            let is_other = |theirs: &Sector| {
                let theirs_header = Header::read(theirs.bytes());
                !header.partial
                    && theirs_header.is_ok_and(|theirs| !theirs.partial)
                    && *theirs.bytes() != *block
            };
            if *session.get_or_insert(header.session) != header.session
                || head.get(place).is_some_and(is_other)
            {
                return Ok(false);
            }
            is_known = true;
        }
        Ok(is_known || is_empty)
    }

    /// Finds out which sectors are whole: the others are brought again.
    fn look(&mut self, sectors: u32) -> Result<()> {
        for place in 0..sectors {
            let header = Header::read(self.read(place)?.bytes()).ok();
            // One in progress is written over yet.
            let has = |header: Header| !header.partial && self.belongs(place, &header);
            self.has.push(header.is_some_and(has));
        }
        Ok(())
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

    /// Takes the sectors of these places that were here before for missing: they are brought again. Whether there are any.
    pub(super) fn doubt(&mut self, places: Range<u32>) -> bool {
        let mut any = false;
        for place in places.filter(|place| !self.came.contains(place)) {
            any |= self.has.get_mut(place as usize).is_some_and(std::mem::take);
        }
        any
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a sector is the one that belongs there. A copy of one in progress may lie one place further.
    pub(super) fn belongs(&self, place: u32, header: &Header) -> bool {
        let number = self.base.map_or(header.number, |base| base.wrapping_add(place));
        header.number == number || header.partial && header.number.wrapping_add(1) == number
    }

    /// Whether a sector is in it.
    pub(super) fn has(&self, place: u32) -> bool {
        self.has.get(place as usize).is_some_and(|has| *has)
    }

    /// The first place from this one on whose sector is in it, or is not.
    pub(super) fn next(&self, from: u32, is_in: bool) -> Option<u32> {
        (from..self.has.len() as u32).find(|place| self.has(*place) == is_in)
    }

    /// The sector at a place.
    pub(super) fn read(&mut self, place: u32) -> Result<Sector> {
        let mut bytes = [0; SECTOR_BYTES];
        self.seek(place)
            .and_then(|()| self.file.read_exact(&mut bytes))
            .with_context(|| cannot_write(&self.path))?;
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
            .with_context(|| cannot_write(&self.path))?;
        if let Some(has) = self.has.get_mut(place as usize) {
            *has = true;
        }
        self.came.insert(place);
        Ok(())
    }

    fn seek(&mut self, place: u32) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(u64::from(place) * SECTOR_BYTES as u64)).map(|_| ())
    }

    /// The whole log is here now: its part goes.
    pub(super) fn finish(self) -> Result<()> {
        let Self { file, path, .. } = self;
        drop(file);
        fs::remove_file(&path).with_context(|| format!("{}: cannot be removed", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sector(number: u8) -> Sector {
        let mut bytes = [0; SECTOR_BYTES];
        (bytes[0], bytes[1], bytes[11]) = (b'H', 0xb0 | hums_blackbox::VERSION, number);
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(7);
        sector
    }

    #[test]
    fn what_is_in_a_part_is_known_again_and_what_is_torn_is_not() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        assert!(Part::there(&whole, 8, &[]).expect("none").is_none());
        let mut part = Part::open(&whole, 8, &[]).expect("made");
        for place in [0, 3, 4] {
            part.put(place, &sector(place as u8)).expect("room");
        }
        part.put(6, &Sector::from_bytes([0x48; SECTOR_BYTES])).expect("room");
        assert!(Part::open(&whole, 8, &[]).is_err(), "another run has it");
        drop(part);
        // The log has grown since.
        let mut part = Part::there(&whole, 10, &[]).expect("it is").expect("there");
        assert_eq!((0..10).filter(|place| part.has(*place)).collect::<Vec<_>>(), [0, 3, 4]);
        assert_eq!((part.next(1, true), part.next(3, false), part.next(5, true)), (Some(3), Some(5), None));
        assert_eq!(part.read(3).expect("a sector"), sector(3));
        part.finish().expect("removed");
        assert!(!part_name(&whole).exists());
        fs::write(part_name(&whole), [0; 11 * SECTOR_BYTES]).expect("written");
        assert!(Part::open(&whole, 10, &[]).is_err(), "longer than the log");
    }

    #[test]
    fn a_file_that_is_no_part_of_the_log_is_refused_and_sectors_of_another_log_are_not_put_in() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let path = part_name(&whole);
        let other = |number: u8| {
            let mut sector = sector(number);
            sector.seal(8);
            sector
        };
        let mut bytes = *sector(0).bytes();
        bytes[100] ^= 1;
        let mut changed = Sector::from_bytes(bytes);
        changed.seal(7);
        let head = [sector(0)];
        let texts = b"a diary of mine, ".repeat(100);
        let mixed = [&sector(0).bytes()[..], &other(1).bytes()[..]].concat();
        for what in [&texts[..], &other(0).bytes()[..], &mixed[..], &changed.bytes()[..], &b"text"[..]] {
            fs::write(&path, what).expect("written");
            let refused = Part::open(&whole, 8, &head).expect_err("no part of it").to_string();
            assert!(refused.contains("is no part of the board's log"), "{refused}");
            assert_eq!(fs::read(&path).expect("there"), what);
        }
        fs::remove_file(&path).expect("ours");
        // A sector of another session comes during the download.
        let mut part = Part::open(&whole, 8, &head).expect("made");
        part.put(0, &sector(0)).expect("room");
        part.put(1, &other(1)).expect("room");
        assert!(part.has(0) && !part.has(1) && part.strange().len() == 1);
        assert_eq!(part.read(1).expect("nothing"), Sector::zeroed());
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_link() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        std::os::unix::fs::symlink("diary", part_name(&whole)).expect("a link");
        for text in [None, Some("a diary of mine")] {
            if let Some(text) = text {
                fs::write(dir.path().join("diary"), text).expect("written");
            }
            let told = Part::there(&whole, 8, &[]).expect_err("it is a link").to_string();
            assert!(told.contains("is a link"), "{told}");
        }
        assert_eq!(fs::read(dir.path().join("diary")).expect("there"), b"a diary of mine");
        assert!(!dir.path().join("hums-kept").exists());
    }
}
