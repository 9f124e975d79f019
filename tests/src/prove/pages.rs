//! Damage of whole pages of a log, and lost ends.
//!
//! A recorded log is changed in one of the ways of `Kind`.
//!
//! *Noticed* means that `hums info --verify` does not call it good; that includes lossless repair by parity. A
//! cut behind an end mark looks like a power cut. It is *told* if `verify` names the mark up to which the log is
//! whole, and all of it is.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context as _, Result, ensure};
use hums::ending::Proof;
use hums::logs::fat::Extent;
use hums::logs::{Log, Piece, on_card};
use hums::summary::Overview;
use hums::verify::{Verdict, verdict};
use hums_blackbox::parity::{COLUMNS, Parity, STRETCH_SECTORS};
use hums_blackbox::{BODY_BYTES, Header, PAGE_SECTORS, Sector};
use tempfile::TempDir;

use super::card::{BLOCK, Card};
use super::figures::Figures;
use super::record::Record;
use super::stream::{FULL_RATE, Stream};
use crate::damage::Random;
use crate::flights::own;

/// Space as in a segment that is not full.
const SPACE_BLOCKS: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Cut,
    CutAtSector,
    Erased,
    /// All blocks from a page on.
    ErasedToTheEnd,
    Spliced,
    /// At once or behind some space.
    Joined,
    /// One page is also in the place of another one.
    Copied,
    /// One page is there twice, and later ones are moved back.
    Inserted,
    Swapped,
    /// A page of another session.
    Stale,
    /// With a valid check.
    Altered,
    /// A sector is lost, and a source of its parity altered with a valid check.
    ParityAltered,
}

impl Kind {
    /// All kinds of damage.
    pub(super) const ALL: [Self; 12] = [
        Self::Cut,
        Self::CutAtSector,
        Self::Erased,
        Self::ErasedToTheEnd,
        Self::Spliced,
        Self::Joined,
        Self::Copied,
        Self::Inserted,
        Self::Swapped,
        Self::Stale,
        Self::Altered,
        Self::ParityAltered,
    ];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Cut => "cut at any byte",
            Self::CutAtSector => "cut behind any sector",
            Self::Erased => "a page erased or zeroed",
            Self::ErasedToTheEnd => "everything from a page on erased or zeroed",
            Self::Spliced => "spliced with another log",
            Self::Joined => "joined with all of another log",
            Self::Copied => "a page in the place of another one",
            Self::Inserted => "a page there twice",
            Self::Swapped => "two pages exchanged",
            Self::Stale => "a page of another session",
            Self::Altered => "a sector altered, and its check too",
            Self::ParityAltered => "a sector lost, and parity of it altered, and its check too",
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub(super) damages: u64,
    /// `verify` does not call it good.
    pub(super) noticed: u64,
    /// Whole up to an end mark, and it is.
    pub(super) told: u64,
    pub(super) repaired: u64,
    /// Read as the other session: its sector is the first one.
    pub(super) other: u64,
    pub(super) missed: u64,
    pub(super) lost_max: u64,
    pub(super) frames: u64,
}

impl Tally {
    pub(super) fn add(&mut self, other: &Self) {
        self.damages += other.damages;
        self.noticed += other.noticed;
        self.told += other.told;
        self.repaired += other.repaired;
        self.other += other.other;
        self.missed += other.missed;
        self.lost_max = self.lost_max.max(other.lost_max);
        self.frames += other.frames;
    }

    /// A row for each kind, and the total.
    pub(super) fn tabulate<'a, I: Iterator<Item = &'a Self>>(
        figures: &mut Figures,
        kinds: impl IntoIterator<Item = &'static str>,
        of: impl Fn(usize) -> I,
    ) -> Self {
        let mut all = Self::default();
        for (kind, name) in kinds.into_iter().enumerate() {
            let mut sum = Self::default();
            of(kind).for_each(|one| sum.add(one));
            all.add(&sum);
            figures.row(&[&name, &sum.damages, &sum.noticed, &sum.told, &sum.missed, &sum.lost_max]);
        }
        all
    }
}

pub(super) struct Outcome {
    pub(super) tallies: Vec<(Kind, Tally)>,
    /// Each miss in words.
    pub(super) misses: Vec<String>,
}

struct Damage {
    kind: Kind,
    what: String,
    bytes: Vec<u8>,
    /// Their groups' rest is lost too.
    touched: Vec<usize>,
}

impl Damage {
    /// Damage of up to eight changed sectors in a row, which parity repairs.
    fn is_one_page(&self) -> bool {
        matches!(self.kind, Kind::Erased | Kind::Copied | Kind::Stale) && self.touched.len() <= COLUMNS
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.kind.name(), self.what)
    }
}

pub(super) struct Subject {
    dir: TempDir,
    /// Sectors, some space, and the parity of a closed log.
    bytes: Vec<u8>,
    sectors: usize,
    /// The number of each sector's group, from 0.
    group_of: Vec<usize>,
    has_parity: bool,
    whole: Record,
}

impl Subject {
    /// Flies and rests twice; `closed`: in order, else power failed at rest. `boots` distinguishes its session.
    pub(super) fn record(flight: &str, closed: bool, boots: u32) -> Result<Self> {
        let card = Card::new(64)?;
        let stream = Stream::of_flight(&own(flight), FULL_RATE)?;
        // Ends before its first parity: missing sectors would be reported before any damage.
        let stream = stream.flying_and_resting(if closed {
            &[(9.0, 1.5), (4.0, 1.5)]
        } else {
            &[(5.0, 1.5), (2.0, 1.5)]
        })?;
        let done = card.record(&stream, boots)?;
        ensure!(done.stats.frames_lost == 0, "frames were lost");
        let log = on_card(&card.path()).pop().context("no log")?;
        let (mut bytes, mut parity) = (Vec::new(), Vec::new());
        let mut blocks = log.blocks();
        while let Some(block) = blocks.next_block()? {
            if Header::read(block).is_ok() {
                bytes.extend_from_slice(block);
            } else if Parity::read(block).is_some() {
                parity.extend_from_slice(block);
            }
        }
        ensure!(!parity.is_empty(), "there is no parity");
        if !closed {
            bytes.truncate(bytes.len() - BLOCK);
        }
        let sectors = bytes.len() / BLOCK;
        bytes.resize(bytes.len() + SPACE_BLOCKS * BLOCK, 0);
        if closed {
            bytes.extend(parity);
        }
        let mut group_of = Vec::new();
        for block in bytes.as_chunks::<BLOCK>().0.iter().take(sectors) {
            let header = Header::read(block).ok().context("a copy among the sectors")?;
            ensure!(header.number as usize == group_of.len(), "sector {} is out of order", header.number);
            let begun = group_of.last().map_or(0, |group| group + usize::from(header.starts_group()));
            group_of.push(begun);
        }
        let dir = tempfile::tempdir()?;
        let mut subject =
            Self { dir, bytes, sectors, group_of, has_parity: closed, whole: Record::default() };
        let log = subject.log(&subject.bytes)?;
        let (whole, overview) = (Record::of(&log)?, Overview::verified(&log)?);
        let expected = if closed { Verdict::Holds } else { Verdict::ToMark };
        ensure!(verdict(&overview) == expected, "before any damage: {:?}", overview.ending.words());
        ensure!(whole.summary.marks.count >= 1, "{} end marks", whole.summary.marks.count);
        subject.whole = whole;
        Ok(subject)
    }

    fn path(&self) -> PathBuf {
        self.dir.path().join("00001_00.HUM")
    }

    fn log(&self, bytes: &[u8]) -> Result<Log> {
        fs::write(self.path(), bytes)?;
        let extents = vec![Extent { start: 0, length: bytes.len() as u64 }];
        let pieces = vec![Piece { path: self.path(), extents }];
        Ok(Log {
            name: "00001".into(),
            files: vec!["00001_00.HUM".into()],
            pieces,
            session: None,
            left_over: false,
        })
    }

    /// All kinds in turn; the first misses in words.
    pub(super) fn damage_often(&self, other: &Self, count: u64, seed: u64) -> Outcome {
        let mut random = Random::new(seed);
        let tallies = Kind::ALL.into_iter().map(|kind| (kind, Tally::default())).collect();
        let mut outcome = Outcome { tallies, misses: Vec::new() };
        for index in 0..count {
            let place = index as usize % outcome.tallies.len();
            let (kind, tally) = &mut outcome.tallies[place];
            let damage = self.damage(*kind, other, &mut random);
            tally.damages += 1;
            if let Err(error) = self.judge(&damage, tally) {
                tally.missed += 1;
                outcome.misses.push(format!("{damage}: {error:#}"));
            }
        }
        outcome
    }

    fn damage(&self, kind: Kind, other: &Self, random: &mut Random) -> Damage {
        let sectors = self.sectors as u64;
        let page = [1, 8, PAGE_SECTORS][random.below(3) as usize];
        let pages = self.sectors.div_ceil(page) as u64;
        let one = random.below(pages) as usize * page;
        let two = random.below(pages) as usize * page;
        let value = if random.chance(0.5) { 0xff } else { 0 };
        let ends = |at: usize| (at + page).min(self.sectors);
        let mut bytes = self.bytes.clone();
        let mut touched: Vec<usize> = Vec::new();
        let what = match kind {
            Kind::Cut | Kind::CutAtSector => {
                // Whole sectors, or within one.
                let at = match kind {
                    Kind::Cut => random.below(sectors * BLOCK as u64) as usize,
                    _ => random.below(sectors) as usize * BLOCK,
                };
                bytes.truncate(at);
                touched.extend(at / BLOCK..self.sectors);
                format!("at byte {at} of {}", self.sectors * BLOCK)
            }
            Kind::Erased => {
                fill(&mut bytes, one..ends(one), value);
                touched.extend(one..ends(one));
                format!("sectors {one} to {} are {value:#04x}", ends(one))
            }
            Kind::ErasedToTheEnd => {
                fill(&mut bytes, one..self.sectors, value);
                touched.extend(one..self.sectors);
                format!("sectors from {one} on are {value:#04x}")
            }
            Kind::Spliced => {
                let at = 1 + random.below(sectors - 1) as usize;
                bytes.truncate(at * BLOCK);
                bytes.extend(other.bytes.iter().skip(at * BLOCK));
                touched.extend(at..self.sectors);
                format!("at sector {at} of {} and {}", self.sectors, other.sectors)
            }
            Kind::Joined => self.join(&mut bytes, other, random),
            Kind::Copied => {
                let to = two.min(self.sectors.saturating_sub(page));
                bytes.copy_within(one * BLOCK..ends(one) * BLOCK, to * BLOCK);
                touched.extend(to..to + ends(one) - one);
                format!("sectors {one} to {} in the place of {to}", ends(one))
            }
            Kind::Inserted => {
                let copy = bytes[one * BLOCK..ends(one) * BLOCK].to_vec();
                bytes.splice(two * BLOCK..two * BLOCK, copy);
                format!("sectors {one} to {} before sector {two} as well", ends(one))
            }
            Kind::Swapped => {
                let length = (ends(one) - one).min(ends(two) - two);
                for at in 0..length * BLOCK {
                    bytes.swap(one * BLOCK + at, two * BLOCK + at);
                }
                touched.extend((one..one + length).chain(two..two + length));
                format!("{length} sectors of {one} and {two}")
            }
            Kind::Stale => {
                let end = ends(one).min(other.sectors);
                let one = one.min(end);
                bytes[one * BLOCK..end * BLOCK].copy_from_slice(&other.bytes[one * BLOCK..end * BLOCK]);
                touched.extend(one..end);
                format!("sectors {one} to {end} are another session's")
            }
            Kind::Altered | Kind::ParityAltered => {
                let (lost, what) = self.alter(kind, &mut bytes, value, random).unwrap_or_default();
                touched.extend(lost);
                what
            }
        };
        Damage { kind, what, bytes, touched }
    }

    /// Packed logs end with their last sector; a card's files have free blocks behind it.
    fn join(&self, bytes: &mut Vec<u8>, other: &Self, random: &mut Random) -> String {
        let space = random.below(SPACE_BLOCKS as u64 + 1) as usize;
        bytes.truncate((self.sectors + space) * BLOCK);
        bytes.extend(&other.bytes);
        format!("{} sectors behind {} and {space} blocks of zeros", other.sectors, self.sectors)
    }

    /// Returns the covered sector to lose, and the place. Without parity nothing contradicts it.
    fn alter(
        &self,
        kind: Kind,
        bytes: &mut [u8],
        value: u8,
        random: &mut Random,
    ) -> Option<(std::ops::Range<usize>, String)> {
        let parity = self.sectors + SPACE_BLOCKS;
        let (first, end) =
            if kind == Kind::Altered { (0, self.sectors) } else { (parity, bytes.len() / BLOCK) };
        let at = first + random.below(self.has_parity.then_some(end - first)? as u64) as usize;
        let covers = Parity::read(&block_at(bytes, at));
        let byte = BLOCK - 4 - BODY_BYTES + random.below(BODY_BYTES as u64) as usize;
        bytes[at * BLOCK + byte] ^= 1 << random.below(8);
        let mut block = block_at(bytes, at);
        let told = if let Some(one) = covers {
            one.sum.seal(&mut block, one.session, one.last);
            let rows = one.last % STRETCH_SECTORS / COLUMNS as u32;
            let lost = one.last as usize - COLUMNS * random.below(u64::from(rows) + 1) as usize;
            fill(bytes, lost..lost + 1, value);
            (lost..lost + 1, format!("sector {lost}, and byte {byte} of {:?} up to {}", one.sum, one.last))
        } else {
            let mut sector = Sector::from_bytes(block);
            sector.seal(sector.session());
            block = *sector.bytes();
            (0..0, format!("byte {byte} of sector {at}"))
        };
        bytes[at * BLOCK..(at + 1) * BLOCK].copy_from_slice(&block);
        Some(told)
    }

    fn judge(&self, damage: &Damage, tally: &mut Tally) -> Result<()> {
        if damage.bytes == self.bytes {
            tally.damages -= 1;
            return Ok(());
        }
        let log = self.log(&damage.bytes)?;
        let (read, overview) = (Record::of(&log)?, Overview::verified(&log)?);
        let verdict = verdict(&overview);
        tally.frames += read.frames.len() as u64;
        if read.summary.session.is_some() && read.summary.session != self.whole.summary.session {
            // The first sector decides between two sessions.
            ensure!(
                verdict == Verdict::NotProved && overview.ending.summary.blocks.stale > 0,
                "not told apart"
            );
            tally.other += 1;
            tally.noticed += 1;
            return Ok(());
        }
        if damage.kind == Kind::Altered {
            // Its content may be anything.
            ensure!(verdict == Verdict::NotProved, "{verdict:?} is said: {}", overview.ending.words());
            tally.noticed += 1;
            return Ok(());
        }
        let missing = self.whole.missing(&read.frames)?;
        tally.lost_max = tally.lost_max.max(missing.len() as u64);
        let touched: BTreeSet<_> = damage.touched.iter().map(|sector| self.group_of[*sector]).collect();
        let group = |index: &usize| self.whole.groups.partition_point(|first| first <= index) - 1;
        if let Some(lost) = missing.iter().find(|index| !touched.contains(&group(index))) {
            anyhow::bail!("frame {lost} of group {} is lost, which was not touched", group(lost));
        }
        let repaired = overview.ending.summary.blocks.repaired;
        if missing.is_empty() && repaired > 0 {
            tally.repaired += 1;
        } else if damage.is_one_page() && self.has_parity {
            anyhow::bail!("{} frames are missing, of one page of 4 KiB at most", missing.len());
        }
        let is_lost = !missing.is_empty() && matches!(damage.kind, Kind::Erased | Kind::ErasedToTheEnd);
        match (verdict, overview.ending.proof) {
            (Verdict::NotProved, _) => tally.noticed += 1,
            _ if self.has_parity && is_lost => {
                anyhow::bail!("{verdict:?} is said, and its parity tells of more")
            }
            (Verdict::ToMark, Proof::Mark(at, _)) => {
                let to = at.as_millis();
                let first = missing.first().map(|index| self.whole.frames[*index].at_ms);
                ensure!(
                    first.is_none_or(|first| first >= to),
                    "whole to {to} ms is said, {first:?} is missing"
                );
                tally.told += 1;
            }
            _ => anyhow::bail!("{verdict:?} is said: {}", overview.ending.words()),
        }
        Ok(())
    }
}

fn block_at(bytes: &[u8], at: usize) -> [u8; BLOCK] {
    bytes.as_chunks().0[at]
}

fn fill(bytes: &mut [u8], sectors: std::ops::Range<usize>, value: u8) {
    bytes[sectors.start * BLOCK..sectors.end * BLOCK].fill(value);
}
