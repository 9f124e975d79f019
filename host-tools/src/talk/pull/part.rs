//! A part of a log: a file in which each sector that was brought stands at its own place, and zeros stand for the others.
//!
//! Its name says that it is a part, `00042-..._07.part.HUM`, and every reader says so too ([`crate::logs::naming::is_part`]). What is
//! in it is not brought again, neither by `--around` nor when all of the log is.

use std::fs::{self, File};
use std::io::{BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Header, SECTOR_BYTES, Sector};

use crate::files::{cannot_write, check_only_name, open_in_place, set_aside, settle};
use crate::logs::naming::part_name;

/// The part of one log.
#[derive(Debug)]
pub(super) struct Part {
    file: File,
    path: PathBuf,
    /// Which sectors are in it.
    has: Vec<bool>,
}

impl Part {
    /// The part beside a log's own path; made when missing. A log in work may have become longer.
    pub(super) fn open(whole: &Path, sectors: u32) -> Result<Self> {
        let path = part_name(whole);
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let file = open_in_place(&mut options, &path).with_context(|| cannot_write(&path))?;
        let about = file.metadata().with_context(|| cannot_write(&path))?;
        check_only_name(&file, &path)?;
        let bytes = u64::from(sectors) * SECTOR_BYTES as u64;
        if !about.is_file() || about.len() > bytes {
            bail!("{}: is no part of the board's log, which has {bytes} bytes; move it away", path.display());
        }
        file.set_len(bytes).with_context(|| cannot_write(&path))?;
        let mut part = Self { file, path, has: Vec::new() };
        part.look(sectors)?;
        Ok(part)
    }

    /// The part beside a log's own path, where there is one.
    pub(super) fn there(whole: &Path, sectors: u32) -> Result<Option<Self>> {
        if part_name(whole).is_file() { Self::open(whole, sectors).map(Some) } else { Ok(None) }
    }

    /// Finds out which sectors are whole, and of the session of the first one: the others are brought again.
    fn look(&mut self, sectors: u32) -> Result<()> {
        let mut session = None;
        for place in 0..sectors {
            let header = Header::read(self.read(place)?.bytes()).ok();
            let is_of_it =
                header.is_some_and(|header| *session.get_or_insert(header.session) == header.session);
            // One in progress is written over yet.
            self.has.push(is_of_it && header.is_some_and(|header| !header.partial));
        }
        Ok(())
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a sector is in it.
    pub(super) fn has(&self, place: u32) -> bool {
        self.has.get(place as usize).is_some_and(|has| *has)
    }

    /// The first place from this one on whose sector is in it, or is not.
    pub(super) fn next(&self, from: u32, is_in: bool) -> Option<u32> {
        (from..self.has.len() as u32).find(|place| self.has(*place) == is_in)
    }

    /// What is at a place.
    pub(super) fn read(&mut self, place: u32) -> Result<Sector> {
        let mut bytes = [0; SECTOR_BYTES];
        self.seek(place)
            .and_then(|()| self.file.read_exact(&mut bytes))
            .with_context(|| cannot_write(&self.path))?;
        Ok(Sector::from_bytes(bytes))
    }

    /// Puts a sector at its place.
    pub(super) fn put(&mut self, place: u32, sector: &Sector) -> Result<()> {
        self.seek(place)
            .and_then(|()| self.file.write_all(sector.bytes()))
            .with_context(|| cannot_write(&self.path))?;
        if let Some(has) = self.has.get_mut(place as usize) {
            *has = true;
        }
        Ok(())
    }

    fn seek(&mut self, place: u32) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(u64::from(place) * SECTOR_BYTES as u64)).map(|_| ())
    }

    /// The whole log is here now: what is in that goes. What has more than that is kept: the card may have lost it since.
    pub(super) fn finish(mut self, whole: &Path) -> Result<()> {
        let is_in_it = self.is_in(whole)?;
        let Self { file, path, .. } = self;
        drop(file);
        if is_in_it {
            return fs::remove_file(&path).with_context(|| format!("{}: cannot be removed", path.display()));
        }
        let aside = settle(set_aside(&path, &path), &path)?;
        note!(
            "{}: has sectors that the whole log has not: it is kept as {}",
            path.display(),
            aside.display()
        );
        Ok(())
    }

    /// Whether the whole log has all that is in it. Copies of a sector in progress are at its own place and the one after: the
    /// full one, where it can be read, has what they have.
    fn is_in(&mut self, whole: &Path) -> Result<bool> {
        let mut log = BufReader::new(settle(File::open(whole), whole)?);
        let (mut theirs, mut before) = ([0; SECTOR_BYTES], None);
        for place in 0..self.has.len() as u32 {
            settle(log.read_exact(&mut theirs), whole)?;
            let ours = self.read(place)?;
            let is_nothing = ours.bytes().iter().all(|byte| *byte == 0);
            let (here, copy) = (Header::read(&theirs).ok(), Header::read(ours.bytes()).ok());
            let is_full_one = |full: &Header| {
                copy.is_some_and(|copy| {
                    copy.partial
                        && !full.partial
                        && (copy.session, copy.number) == (full.session, full.number)
                })
            };
            let became = [before, here].iter().flatten().any(is_full_one);
            if *ours.bytes() != theirs && !is_nothing && !became {
                return Ok(false);
            }
            before = here;
        }
        Ok(true)
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
        assert!(Part::there(&whole, 8).expect("none").is_none());
        let mut part = Part::open(&whole, 8).expect("made");
        for place in [0, 3, 4] {
            part.put(place, &sector(place as u8)).expect("room");
        }
        part.put(6, &Sector::from_bytes([0x48; SECTOR_BYTES])).expect("room");
        assert!(Part::open(&whole, 8).is_err(), "another run has it");
        drop(part);
        // The log has grown since.
        let mut part = Part::there(&whole, 10).expect("it is").expect("there");
        assert_eq!((0..10).filter(|place| part.has(*place)).collect::<Vec<_>>(), [0, 3, 4]);
        assert_eq!((part.next(1, true), part.next(3, false), part.next(5, true)), (Some(3), Some(5), None));
        assert_eq!(part.read(3).expect("a sector"), sector(3));
        // What is in the whole log goes; what the card has lost since does not.
        let mut log = std::fs::read(part_name(&whole)).expect("there");
        log[1] ^= 1;
        std::fs::write(&whole, &log).expect("written");
        part.finish(&whole).expect("kept");
        log[1] ^= 1;
        let kept = dir.path().join("hums-kept/1").join(part_name(&whole).file_name().expect("a name"));
        assert_eq!(std::fs::read(&kept).expect("kept"), log);
        std::fs::rename(&kept, part_name(&whole)).expect("put back");
        std::fs::write(&whole, &log).expect("written");
        let part = Part::there(&whole, 10).expect("it is").expect("there");
        part.finish(&whole).expect("removed");
        assert!(!part_name(&whole).exists());
        std::fs::write(part_name(&whole), [0; 11 * SECTOR_BYTES]).expect("written");
        assert!(Part::open(&whole, 10).is_err(), "longer than the log");
        std::fs::write(part_name(&whole), [0; SECTOR_BYTES]).expect("written");
        std::fs::hard_link(part_name(&whole), dir.path().join("backup")).expect("a second name");
        let refused = Part::open(&whole, 10).expect_err("it has two names");
        assert!(refused.to_string().contains("has another name too"), "{refused}");
    }

    #[test]
    fn a_sector_in_progress_is_kept_until_the_whole_log_has_what_it_became() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let mut in_progress = sector(1);
        in_progress.set_partial(true);
        in_progress.seal(7);
        assert!(Header::read(in_progress.bytes()).is_ok_and(|header| header.partial));
        let is_kept = |theirs: &Sector| {
            let mut part = Part::open(&whole, 1).expect("made");
            part.put(0, &in_progress).expect("room");
            std::fs::write(&whole, theirs.bytes()).expect("written");
            part.finish(&whole).expect("finished");
            let kept = dir.path().join("hums-kept/1").join(part_name(&whole).file_name().expect("a name"));
            let is_kept = kept.exists();
            let _ = std::fs::remove_dir_all(dir.path().join("hums-kept"));
            is_kept
        };
        assert!(!is_kept(&sector(1)) && !is_kept(&in_progress));
        let mut damaged = *sector(1).bytes();
        damaged[300] ^= 1;
        assert!(is_kept(&Sector::from_bytes(damaged)), "the card has lost it since");
    }
}
