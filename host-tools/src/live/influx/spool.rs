//! Points that wait for the database, in a file with a name: what a program that was ended, or killed, has left there is
//! written by the next one.
//!
//! The file is a header and a ring of records. A position counts all bytes that were ever put into the ring; a byte of
//! position `p` lies at `p` modulo the ring's size. The header has the positions of the oldest record and of the end of the
//! newest one, and how many points these have. It is written after a record, so that a kill leaves one behind that end, whole
//! or cut off; what is not sound before it is damage. An empty ring is cut off, so the file is as long as what waited at
//! most at a time.
//!
//! ```text
//! header  "HUMSPOOL"  version u32  0 u32  ring's size u64  position of the oldest u64
//!         the database's number u64  position of the end u64  points u64  the database's address, zeros up to 512 bytes
//! record  length u32  points u32  position u64  CRC-32 of the lines u32  CRC-32 of these u32  lines
//! ```
//! Points go to the database that they were made for and to no other: a file that has points for another one is refused.
//!
//! Numbers are little-endian. Nothing is synced to the disk: a kill loses nothing, a PC that loses its power what its
//! system had not written yet.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use crc::{CRC_32_ISCSI, Crc};

use super::batch::Batch;
use super::target::Database;
use crate::files::{check_only_name, open_in_place, remake_in_place};
use crate::plural::are;
use crate::source::format::SPOOL_MAGIC as MAGIC;

const VERSION: u32 = 4;
const HEADER_BYTES: u64 = 512;
/// Where the database's address begins.
const NAME_AT: usize = 56;
const RECORD_BYTES: usize = 24;
/// Where a head's checksums are: that of the lines, that of what stands before it.
const TEXT_SUM_AT: usize = 16;
const HEAD_SUM_AT: usize = 20;
/// Of all records of all files that we write.
const BATCH_BYTES_MAX: usize = 64 * 1024 * 1024;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// The file, which nobody else opens meanwhile.
#[derive(Debug)]
pub struct Spool {
    file: File,
    path: PathBuf,
    /// The ring's size, and the one that it gets when it is empty or is made larger.
    size: u64,
    limit: u64,
    oldest: u64,
    end: u64,
    points: u64,
    /// Batches that are no longer there.
    removed: u64,
    database: Database,
    damage: Damage,
}

/// What of an earlier program's points cannot be read any more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Points, as far as their number is known.
    pub points: u64,
    /// Bytes of batches that are not whole or not sound.
    pub bytes: u64,
}

/// A record's head.
#[derive(Clone, Copy, Debug)]
struct Head {
    length: usize,
    points: u32,
    text_sum: u32,
}

impl Head {
    const fn bytes(self) -> u64 {
        (RECORD_BYTES + self.length) as u64
    }
}

impl Spool {
    /// Opens or makes the file, with room for `limit` bytes; `None` while another program has it. An error where it has
    /// points for another database.
    pub fn open(path: &Path, limit: u64, database: &Database) -> Result<Option<Self>> {
        let context = || format!("{}: cannot be used for points that wait", path.display());
        let about = path.metadata().ok();
        // A disk or a card has a length of 0, as an empty file has.
        if about.as_ref().is_some_and(|about| !about.is_file()) {
            bail!("{}: is no regular file; nothing was written; name a file", path.display());
        }
        if about.is_some_and(|about| about.permissions().readonly()) {
            bail!("{}: is read-only; make it writable or name another file", path.display());
        }
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let file = match open_in_place(&mut options, path) {
            Err(error) if error.kind() == io::ErrorKind::ResourceBusy => return Ok(None),
            opened => opened.with_context(context)?,
        };
        check_only_name(&file, path)?;
        let path = path.to_owned();
        let mut spool = Self {
            file,
            path,
            size: limit,
            limit,
            oldest: 0,
            end: 0,
            points: 0,
            removed: 0,
            database: database.clone(),
            damage: Damage::default(),
        };
        spool.begin().with_context(context)?;
        Ok(Some(spool))
    }

    /// Finds what an earlier program has left.
    fn begin(&mut self) -> Result<()> {
        let bytes = self.file.metadata()?.len();
        if bytes == 0 {
            // In one write: a kill leaves an empty file or a header.
            return Ok(self.write_header()?);
        }
        let mut header = [0; HEADER_BYTES as usize];
        self.file.seek(SeekFrom::Start(0))?;
        Read::by_ref(&mut self.file)
            .take(HEADER_BYTES)
            .read_exact(header.get_mut(..bytes.min(HEADER_BYTES) as usize).unwrap_or_default())?;
        if !header.starts_with(MAGIC) {
            bail!("it is another file; name one that is not there yet");
        }
        if bytes < HEADER_BYTES {
            return self.begin_anew(&header, bytes);
        }
        if u32_at(&header, 8) != VERSION {
            bail!("it is of another version of this program; move it away, or name another file");
        }
        (self.size, self.oldest) = (u64_at(&header, 16), u64_at(&header, 24));
        let (told_end, told_points) = (u64_at(&header, 40), u64_at(&header, 48));
        self.end = self.oldest;
        let is_possible = |end: u64| {
            self.size >= RECORD_BYTES as u64
                && end < i64::MAX as u64
                && (self.oldest..=end).contains(&told_end)
        };
        if !self.oldest.checked_add(self.size).is_some_and(is_possible) {
            bail!("its header is damaged; move it away, or name another one");
        }
        let damaged_bytes = self.look_through(bytes, told_end, told_points)?;
        // Also where its first record is damaged: an empty one has its header only.
        if bytes > HEADER_BYTES && u64_at(&header, 32) != self.database.number {
            let name = header.get(NAME_AT..).unwrap_or_default().split(|byte| *byte == 0).next();
            bail!(
                "{} in it for another database, {}: write these there first, or name another file",
                are(self.points, "point"),
                String::from_utf8_lossy(name.unwrap_or_default())
            );
        }
        if damaged_bytes > 0 || self.has_more(bytes, told_end)? {
            return self
                .write_anew(told_end, true)
                .context("what is sound in it cannot be written anew, without what is damaged");
        }
        if self.damage.bytes > 0 {
            self.forget_cut_off()?;
        }
        if self.is_empty() {
            return Ok(self.reset()?);
        }
        if self.size < self.limit
            && let Err(error) = self.write_anew(told_end, false)
        {
            note!(
                "{}: cannot be made larger ({error}): its limit stays {} bytes until nothing waits in it",
                self.path.display(),
                self.size
            );
        }
        Ok(())
    }

    /// Begins anew where not even the header is whole: it has lost its end, or it is an empty one, of an earlier version too.
    fn begin_anew(&mut self, header: &[u8], bytes: u64) -> Result<()> {
        // What is missing of a header is zero here.
        let (version, points) = (u32_at(header, 8), u64_at(header, 48));
        let told_empty = bytes >= NAME_AT as u64 && u64_at(header, 40) == u64_at(header, 24) && points == 0;
        if (1..VERSION).contains(&version) || told_empty {
            return Ok(self.reset()?);
        }
        self.damage = Damage { points, bytes };
        self.write_anew(0, true).context("it has lost its end, and cannot be kept")
    }

    /// Finds what waits and what of it is damaged; gives how many bytes of batches that were whole are.
    fn look_through(&mut self, file_bytes: u64, told_end: u64, told_points: u64) -> Result<u64> {
        let (mut points, mut before_end) = (0, 0);
        let damaged_bytes = self.each_sound(told_end, |at, head, _| {
            points += u64::from(head.points);
            before_end += if at < told_end { u64::from(head.points) } else { 0 };
            Ok(())
        })?;
        self.points = points;
        self.damage = self.cut_off(file_bytes, told_end)?;
        if damaged_bytes > 0 {
            self.damage.bytes += damaged_bytes;
            self.damage.points += told_points.saturating_sub(before_end);
        }
        Ok(damaged_bytes)
    }

    /// What a kill or a full disk has cut off behind the newest batch, as far as that is known: it is none.
    fn cut_off(&mut self, file_bytes: u64, told_end: u64) -> io::Result<Damage> {
        let at = self.end.max(told_end);
        let head = self.head(at)?;
        // In the ring's first lap nothing else can lie there.
        let bytes = if at < self.size {
            file_bytes.saturating_sub(HEADER_BYTES + at)
        } else {
            head.map_or(0, Head::bytes) + file_bytes.saturating_sub(HEADER_BYTES + self.size)
        };
        Ok(Damage { points: head.map_or(0, |head| head.points.into()), bytes })
    }

    /// Whether more lies behind the newest batch than one that was cut off: another file's, that was joined on.
    fn has_more(&mut self, file_bytes: u64, told_end: u64) -> io::Result<bool> {
        let at = self.end.max(told_end);
        let one = self.head(at)?.map_or(RECORD_BYTES as u64 - 1, Head::bytes);
        let allowed = at.saturating_add(one).min(self.size);
        Ok(file_bytes.saturating_sub(HEADER_BYTES) > allowed)
    }

    /// So that it is told once.
    fn forget_cut_off(&mut self) -> io::Result<()> {
        if self.end < self.size {
            return self.file.set_len(HEADER_BYTES + self.end);
        }
        self.write_ring(self.end, &[0; RECORD_BYTES])
    }

    /// Writes what waits anew, with a ring as large as the limit or as what waits, beside the file; it takes its place when it is
    /// whole. The old file is kept aside, or goes. Until then a kill leaves that one.
    fn write_anew(&mut self, told_end: u64, keep: bool) -> Result<()> {
        let path = self.path.canonicalize()?;
        let (damage, mut new) = (self.damage, None);
        remake_in_place(&path, keep, |file| {
            new = Some(self.copy_to(file.try_clone()?, told_end)?);
            Ok(())
        })?;
        let path = std::mem::take(&mut self.path);
        if let Some(new) = new {
            *self = Self { path, damage, ..new };
        }
        Ok(())
    }

    /// All that waits and is sound, in a new file.
    fn copy_to(&mut self, file: File, told_end: u64) -> Result<Self> {
        let mut new = Self {
            file,
            path: PathBuf::new(),
            size: self.limit.max(self.size),
            limit: self.limit.max(self.size),
            oldest: 0,
            end: 0,
            points: 0,
            removed: 0,
            database: self.database.clone(),
            damage: Damage::default(),
        };
        new.reset()?;
        self.each_sound(told_end, |_, head, text| {
            new.put(&Batch { text, points: u64::from(head.points) })?;
            Ok(())
        })?;
        new.limit = self.limit;
        Ok(new)
    }

    /// Hands out each sound batch that waits, with its position; gives how many bytes before the end that the header tells are of
    /// none. The end is behind the last one that is sound.
    fn each_sound(
        &mut self,
        told_end: u64,
        mut take: impl FnMut(u64, Head, Vec<u8>) -> Result<()>,
    ) -> Result<u64> {
        let (mut at, mut damaged_bytes) = (self.oldest, 0);
        self.end = at;
        loop {
            if let Some((head, text)) = self.record(at)? {
                take(at, head, text)?;
                at += head.bytes();
                self.end = at;
            } else if at < told_end {
                let next = self.next_sound(at + 1)?.unwrap_or(told_end);
                damaged_bytes += next - at;
                at = next;
            } else {
                return Ok(damaged_bytes);
            }
        }
    }

    /// The next position at which a sound record begins.
    fn next_sound(&mut self, from: u64) -> io::Result<Option<u64>> {
        const PIECE_BYTES: u64 = 64 * 1024;
        let until = self.oldest + self.size;
        let mut piece = Vec::new();
        let mut at = from;
        while at < until {
            // The position lies 8 bytes behind a record's beginning.
            let (place, row) = self.place(at + 8);
            let bytes = row.min(PIECE_BYTES);
            piece.clear();
            self.file.seek(SeekFrom::Start(place))?;
            Read::by_ref(&mut self.file).take(bytes).read_to_end(&mut piece)?;
            for (position, word) in (at..until).zip(piece.windows(8)) {
                if word == position.to_le_bytes() && self.record(position)?.is_some() {
                    return Ok(Some(position));
                }
            }
            // A word may go on in the next piece, and at the ring's end at its beginning: that one is looked at by itself.
            let looked_at = bytes.saturating_sub(7).max(1);
            if looked_at == 1 && self.record(at)?.is_some() {
                return Ok(Some(at));
            }
            at += looked_at;
        }
        Ok(None)
    }

    /// What an earlier program has left here and cannot be read.
    pub const fn damage(&self) -> Damage {
        self.damage
    }

    /// The same of a file whose points come to this one.
    pub const fn lose(&mut self, damage: Damage) {
        self.damage.points += damage.points;
        self.damage.bytes += damage.bytes;
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether nothing waits in it.
    pub const fn is_empty(&self) -> bool {
        self.oldest == self.end
    }

    /// How many points wait in it.
    pub const fn points(&self) -> u64 {
        self.points
    }

    /// How many bytes wait in it.
    pub const fn bytes(&self) -> u64 {
        self.end - self.oldest
    }

    /// Whether a batch fits without the loss of an older one.
    pub const fn has_room(&self, batch: &Batch) -> bool {
        self.bytes() + (RECORD_BYTES + batch.text.len()) as u64 <= self.room()
    }

    /// How many bytes may wait in it: its ring is as large as an earlier program's limit until it is empty, where that was
    /// higher, or where it could not be made larger.
    const fn room(&self) -> u64 {
        if self.size < self.limit { self.size } else { self.limit }
    }

    /// Whether an earlier program has left more in it than the limit allows. Nothing is added before that has become less.
    pub const fn is_over_limit(&self) -> bool {
        self.bytes() > self.limit
    }

    /// The number of the oldest batch, by which it is told from all others that were ever there.
    pub const fn number(&self) -> u64 {
        self.removed
    }

    /// Adds a batch; where it does not fit, the oldest ones go. Where an earlier program has left more than the limit allows,
    /// that stays and the batch goes. How many points went.
    pub fn put(&mut self, batch: &Batch) -> io::Result<u64> {
        let head = Head {
            length: batch.text.len(),
            points: u32::try_from(batch.points).map_err(|_| io::ErrorKind::InvalidInput)?,
            text_sum: CRC.checksum(&batch.text),
        };
        if self.is_over_limit() {
            return Ok(batch.points);
        }
        if head.bytes() > self.room() || head.length > BATCH_BYTES_MAX {
            return Err(io::Error::other("a batch is larger than the whole file may be"));
        }
        let mut lost = 0;
        while self.bytes() + head.bytes() > self.room() {
            let before = self.points;
            self.drop_oldest()?;
            lost += before - self.points;
        }
        let mut bytes = Vec::with_capacity(head.bytes() as usize);
        bytes.extend((head.length as u32).to_le_bytes());
        bytes.extend(head.points.to_le_bytes());
        bytes.extend(self.end.to_le_bytes());
        bytes.extend(head.text_sum.to_le_bytes());
        bytes.extend(CRC.checksum(&bytes).to_le_bytes());
        bytes.extend(&batch.text);
        if let Err(error) = self.write_ring(self.end, &bytes) {
            if self.end < self.size {
                // A part of a record is none, and would look like a lost one later. Where that fails too, it does.
                let _ = self.file.set_len(HEADER_BYTES + self.end);
            }
            return Err(error);
        }
        self.end += head.bytes();
        self.points += batch.points;
        // Where that fails it is found behind the end.
        let _ = self.write_header();
        Ok(lost)
    }

    /// The oldest batch.
    pub fn oldest(&mut self) -> io::Result<Option<Batch>> {
        if self.is_empty() {
            return Ok(None);
        }
        match self.record(self.oldest)? {
            Some((head, text)) => Ok(Some(Batch { text, points: u64::from(head.points) })),
            None => Err(io::ErrorKind::InvalidData.into()),
        }
    }

    /// The oldest batch is no longer needed.
    pub fn drop_oldest(&mut self) -> io::Result<()> {
        let Some(head) = self.head(self.oldest)? else { return Err(io::ErrorKind::InvalidData.into()) };
        self.removed += 1;
        self.oldest += head.bytes();
        self.points = self.points.saturating_sub(u64::from(head.points));
        if self.is_empty() { self.reset() } else { self.write_header() }
    }

    /// Forgets all of it, where it cannot be read; how many points are lost.
    pub fn forget(&mut self) -> u64 {
        let lost = std::mem::take(&mut self.points);
        self.oldest = self.end;
        self.removed += 1;
        // What stays there does not follow a record any longer, and is written over.
        let _ = self.reset();
        lost
    }

    /// Empty: the disk gets its room back. A kill after any of these steps leaves an empty one too.
    fn reset(&mut self) -> io::Result<()> {
        (self.oldest, self.points) = (self.end, 0);
        self.write_header()?;
        self.file.set_len(HEADER_BYTES)?;
        (self.size, self.oldest, self.end) = (self.limit, 0, 0);
        self.write_header()
    }

    fn write_header(&mut self) -> io::Result<()> {
        let mut header = [0; HEADER_BYTES as usize];
        header[..8].copy_from_slice(MAGIC);
        header[8..12].copy_from_slice(&VERSION.to_le_bytes());
        header[16..24].copy_from_slice(&self.size.to_le_bytes());
        header[24..32].copy_from_slice(&self.oldest.to_le_bytes());
        header[32..40].copy_from_slice(&self.database.number.to_le_bytes());
        header[40..48].copy_from_slice(&self.end.to_le_bytes());
        header[48..NAME_AT].copy_from_slice(&self.points.to_le_bytes());
        header.iter_mut().skip(NAME_AT).zip(self.database.name.bytes()).for_each(|(to, from)| *to = from);
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(&header)
    }

    /// The head of the record at a position, if one can be there.
    fn head(&mut self, position: u64) -> io::Result<Option<Head>> {
        let mut bytes = [0; RECORD_BYTES];
        if !self.read_ring(position, &mut bytes)? || u64_at(&bytes, 8) != position {
            return Ok(None);
        }
        let (before, sum) = bytes.split_at(HEAD_SUM_AT);
        if CRC.checksum(before) != u32_at(sum, 0) {
            return Ok(None);
        }
        let head = Head {
            length: u32_at(&bytes, 0) as usize,
            points: u32_at(&bytes, 4),
            text_sum: u32_at(&bytes, TEXT_SUM_AT),
        };
        let fits = head.length <= BATCH_BYTES_MAX && position - self.oldest + head.bytes() <= self.size;
        Ok(Some(head).filter(|_| fits))
    }

    /// The record at a position, if a sound one is there.
    fn record(&mut self, position: u64) -> io::Result<Option<(Head, Vec<u8>)>> {
        let Some(head) = self.head(position)? else { return Ok(None) };
        let mut bytes = vec![0; RECORD_BYTES + head.length];
        if !self.read_ring(position, &mut bytes)? {
            return Ok(None);
        }
        let text = bytes.split_off(RECORD_BYTES);
        let sound = CRC.checksum(&text) == head.text_sum;
        Ok(sound.then_some((head, text)))
    }

    /// Where a position lies, and how many bytes follow it in a row.
    const fn place(&self, position: u64) -> (u64, u64) {
        let at = position % self.size;
        (HEADER_BYTES + at, self.size - at)
    }

    fn write_ring(&mut self, position: u64, bytes: &[u8]) -> io::Result<()> {
        let (at, row) = self.place(position);
        let (first, rest) = bytes.split_at(bytes.len().min(usize::try_from(row).unwrap_or(usize::MAX)));
        self.file.seek(SeekFrom::Start(at))?;
        self.file.write_all(first)?;
        if !rest.is_empty() {
            self.file.seek(SeekFrom::Start(HEADER_BYTES))?;
            self.file.write_all(rest)?;
        }
        Ok(())
    }

    /// `false` where the file ends before.
    fn read_ring(&mut self, position: u64, bytes: &mut [u8]) -> io::Result<bool> {
        let (at, row) = self.place(position);
        let first = bytes.len().min(usize::try_from(row).unwrap_or(usize::MAX));
        let (first, rest) = bytes.split_at_mut(first);
        for (at, part) in [(at, first), (HEADER_BYTES, rest)] {
            self.file.seek(SeekFrom::Start(at))?;
            match self.file.read_exact(part) {
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
                result => result?,
            }
        }
        Ok(true)
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|word| word.first_chunk()).map_or(0, |word| u32::from_le_bytes(*word))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..at + 8).and_then(|word| word.first_chunk()).map_or(0, |word| u64::from_le_bytes(*word))
}

#[cfg(test)]
mod tests;
