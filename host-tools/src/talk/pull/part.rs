//! A part of a log: a file in which each sector that was brought stands at its own place, and zeros stand for the others.
//!
//! What is in it and differs from what the board sends in its place (a sector that was changed, or that its card has lost since) is
//! kept: the part as it was stays in `hums-kept`.
//!
//! Its name says that it is a part, `00042-..._07.part.HUM`, and every reader says so too ([`crate::logs::naming::is_part`]). What is
//! in it is not brought again, neither by `--around` nor when all of the log is.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Header, SECTOR_BYTES, Sector};

use super::compare::beginning_of;
use crate::files::{cannot_write, check_only_name, open_in_place, remake_in_place, set_aside, settle};
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
    /// The session of which it is a part, where a sector has told it.
    session: Option<u32>,
    /// The number of the sector that belongs at its beginning, where the first ones tell it.
    base: Option<u32>,
    /// The places of sectors of other sessions that came, and are not in it.
    strange: BTreeSet<u32>,
    /// What was in it before is kept.
    is_kept: bool,
}

impl Part {
    /// The part beside a log's own path; made when missing. A log in work may have become longer. What is no part of the log that
    /// begins with these sectors is kept, and the part begins anew.
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
        if there > bytes {
            bail!(
                "{}: is no part of the board's log, which has {bytes} bytes; move it away",
                part.path.display()
            );
        }
        if !part.is_of(head, there)? {
            let aside = settle(set_aside(&part.path, &part.path), &part.path)?;
            note!(
                "{}: what was there is no part of this log; it begins anew, and that stays as {}",
                part.path.display(),
                aside.display()
            );
            part = Self::at(part.path, head)?;
        }
        part.file.set_len(bytes).with_context(|| cannot_write(&part.path))?;
        part.look(sectors)?;
        Ok(part)
    }

    fn at(path: PathBuf, head: &[Sector]) -> Result<Self> {
        let (session, base) = beginning_of(head);
        let file = Self::opened(&path)?;
        let (has, came, strange) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
        Ok(Self { file, path, has, came, session, base, strange, is_kept: false })
    }

    fn opened(path: &Path) -> Result<File> {
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let file = open_in_place(&mut options, path).with_context(|| cannot_write(path))?;
        check_only_name(&file, path)?;
        Ok(file)
    }

    /// The part beside a log's own path, where there is one.
    pub(super) fn there(whole: &Path, sectors: u32, head: &[Sector]) -> Result<Option<Self>> {
        let is_there = fs::symlink_metadata(part_name(whole)).is_ok();
        is_there.then(|| Self::open(whole, sectors, head)).transpose()
    }

    /// Whether what has so many bytes is a part of the log that begins with these sectors: it is empty, or has sectors of that
    /// session and of no other one, and those that are known are the same.
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

    /// The places of sectors of other sessions that came, and are not in it: another log has come in its place, or the card has lost
    /// some.
    pub(super) const fn strange(&self) -> &BTreeSet<u32> {
        &self.strange
    }

    /// The number of the sector that belongs at its beginning, where one tells it.
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

    /// What is at a place.
    pub(super) fn read(&mut self, place: u32) -> Result<Sector> {
        let mut bytes = [0; SECTOR_BYTES];
        self.seek(place)
            .and_then(|()| self.file.read_exact(&mut bytes))
            .with_context(|| cannot_write(&self.path))?;
        Ok(Sector::from_bytes(bytes))
    }

    /// Puts a sector at its place, unless it is another session's. Where something else stands there, the part as it is is kept.
    pub(super) fn put(&mut self, place: u32, sector: &Sector) -> Result<()> {
        if let Ok(header) = Header::read(sector.bytes()) {
            if *self.session.get_or_insert(header.session) != header.session {
                self.strange.insert(place);
                return Ok(());
            }
            self.base = self.base.or_else(|| header.number.checked_sub(place).filter(|_| !header.partial));
        }
        if !self.is_kept && self.would_lose(place, sector)? {
            self.keep()?;
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

    /// Whether something stands at a place that this sector has not, nor the one before.
    fn would_lose(&mut self, place: u32, sector: &Sector) -> Result<bool> {
        let there = self.read(place)?;
        let before = place.checked_sub(1).map(|before| self.read(before)).transpose()?;
        let full = [before.as_ref(), Some(sector)].map(|full| Header::read(full?.bytes()).ok());
        Ok(!is_in(&there, sector, full))
    }

    /// Keeps all that was in it, and goes on in a copy.
    fn keep(&mut self) -> Result<()> {
        note!(
            "{}: has a sector that differs from what the board sends in its place, which is taken",
            self.path.display()
        );
        self.file.rewind().with_context(|| cannot_write(&self.path))?;
        self.file = remake_in_place(&self.path, true, |copy| {
            let (mut from, mut to) = (&self.file, copy);
            settle(io::copy(&mut from, &mut to).map(|_| ()), &self.path)
        })?;
        self.is_kept = true;
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

    /// Whether the whole log has all that is in it.
    fn is_in(&mut self, whole: &Path) -> Result<bool> {
        let mut log = BufReader::new(settle(File::open(whole), whole)?);
        let (mut theirs, mut before) = ([0; SECTOR_BYTES], None);
        for place in 0..self.has.len() as u32 {
            settle(log.read_exact(&mut theirs), whole)?;
            let here = Header::read(&theirs).ok();
            if !is_in(&self.read(place)?, &Sector::from_bytes(theirs), [before, here]) {
                return Ok(false);
            }
            before = here;
        }
        Ok(true)
    }
}

/// Whether all that is in a sector of a part is in the one that takes its place, or in the one before that: nothing is in it, or it is the
/// same. Copies of a sector in progress are at its own place and the one after: the full one, where it can be read, has what they have.
fn is_in(ours: &Sector, theirs: &Sector, [before, here]: [Option<Header>; 2]) -> bool {
    let is_nothing = ours.bytes().iter().all(|byte| *byte == 0);
    let copy = Header::read(ours.bytes()).ok().filter(|copy| copy.partial);
    let is_full_one = |full: &Header| {
        copy.as_ref()
            .is_some_and(|copy| !full.partial && (copy.session, copy.number) == (full.session, full.number))
    };
    is_nothing || ours == theirs || [before, here].iter().flatten().any(is_full_one)
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

    /// What is kept of a part under this number.
    fn kept(part: &Path, number: u32) -> Option<Vec<u8>> {
        let folder = part.with_file_name("hums-kept").join(number.to_string());
        fs::read(folder.join(part.file_name().expect("a name"))).ok()
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
        let part = Part::there(&whole, 10, &[]).expect("it is").expect("there");
        part.finish(&whole).expect("removed");
        assert!(!part_name(&whole).exists());
        std::fs::write(part_name(&whole), [0; 11 * SECTOR_BYTES]).expect("written");
        assert!(Part::open(&whole, 10, &[]).is_err(), "longer than the log");
        std::fs::write(part_name(&whole), [0; SECTOR_BYTES]).expect("written");
        std::fs::hard_link(part_name(&whole), dir.path().join("backup")).expect("a second name");
        let refused = Part::open(&whole, 10, &[]).expect_err("it has two names");
        assert!(refused.to_string().contains("has another name too"), "{refused}");
    }

    #[test]
    fn what_is_no_part_of_the_log_is_kept_and_what_comes_of_another_one_is_not_in_it() {
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
        for (number, what) in
            (1..).zip([&texts[..], &other(0).bytes()[..], &mixed[..], &changed.bytes()[..], &b"text"[..]])
        {
            fs::write(&path, what).expect("written");
            let part = Part::open(&whole, 8, &head).expect("it begins anew");
            assert_eq!(kept(&path, number).as_deref(), Some(what), "{number}");
            assert!((0..8).all(|place| !part.has(place)), "{number}");
            drop(part);
            assert_eq!(fs::read(&path).expect("a part"), [0; 8 * SECTOR_BYTES]);
        }
        // What comes of another session while it is read.
        let mut part = Part::open(&whole, 8, &head).expect("it goes on");
        part.put(0, &sector(0)).expect("room");
        part.put(1, &other(1)).expect("room");
        assert!(part.has(0) && !part.has(1) && part.strange().len() == 1);
        assert_eq!(part.read(1).expect("nothing"), Sector::zeroed());
    }

    #[test]
    fn what_stands_where_the_board_sends_something_else_is_kept_once() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let path = part_name(&whole);
        let mut changed = *sector(1).bytes();
        changed[300] ^= 1;
        let mut in_progress = sector(2);
        in_progress.set_partial(true);
        in_progress.seal(7);
        let there = [*sector(0).bytes(), changed, *in_progress.bytes(), *sector(3).bytes(), changed].concat();
        fs::write(&path, &there).expect("written");
        let mut part = Part::open(&whole, 6, &[]).expect("it goes on");
        assert_eq!((0..6).filter(|place| part.has(*place)).collect::<Vec<_>>(), [0, 3]);
        // The full one has what was in progress, and nothing was at the last place.
        for place in [2, 5] {
            part.put(place, &sector(place as u8)).expect("room");
        }
        assert_eq!(kept(&path, 1), None);
        part.put(1, &sector(1)).expect("room");
        part.put(4, &sector(4)).expect("room");
        let before = [&there[..1024], sector(2).bytes(), &there[1536..], &sector(5).bytes()[..]].concat();
        assert_eq!((kept(&path, 1), kept(&path, 2)), (Some(before), None));
        let all: Vec<u8> = (0..6).flat_map(|number| *sector(number).bytes()).collect();
        assert_eq!(fs::read(&path).expect("there"), all);
        assert!(Part::open(&whole, 6, &[]).is_err(), "this run has it still");
        // What the card has lost since is no less worth keeping.
        drop(part);
        fs::write(&path, in_progress.bytes()).expect("written");
        let mut part = Part::open(&whole, 1, &[]).expect("it goes on");
        part.put(0, &Sector::zeroed()).expect("room");
        assert_eq!(kept(&path, 2), Some(in_progress.bytes().to_vec()));
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

    #[test]
    fn a_sector_in_progress_is_kept_until_the_whole_log_has_what_it_became() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = dir.path().join("00042-s00000007_07.HUM");
        let mut in_progress = sector(1);
        in_progress.set_partial(true);
        in_progress.seal(7);
        assert!(Header::read(in_progress.bytes()).is_ok_and(|header| header.partial));
        let is_kept = |theirs: &Sector| {
            let mut part = Part::open(&whole, 1, &[]).expect("made");
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
