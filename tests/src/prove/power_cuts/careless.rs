//! Power cuts with a card that loses acknowledged blocks, or spoils others.
//!
//! For the recorder each acknowledged block is a barrier; these cards break that:
//!
//! - one writes the last blocks in any order, so that any of them may be missing;
//! - one has lost a single acknowledged block;
//! - one spoils the whole flash page of the last block.
//!
//! Each is examined by `fsck.vfat`, by the readers behind `hums info --verify`, and by the recorder, which starts on
//! it again.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

use anyhow::{Context as _, Result, ensure};
use hums::ending::SessionBefore;
use hums::followed::EndResolver;
use hums::logs::sessions::Sessions;
use hums::logs::{FoundLogs, find};
use hums::run::sim::both_ports::power_on;
use hums::summary::Overview;
use hums::verify::{Verdict, verdict};
use hums_blackbox::Header;
use hums_recorder::status::CardState;
use rayon::prelude::*;

use super::{BLOCK, FULL, GUIDED, LATER, NEW_CARD, PX4, Scenario, Session};
use crate::damage::Random;
use crate::flights::own;
use crate::prove::card::blocks_of;
use crate::prove::figures::Figures;
use crate::prove::options::Options;
use crate::prove::record::Record;
use crate::prove::stream::{FULL_RATE, Stream};

/// A write cache, in any order.
const CACHE_BLOCKS_MAX: u64 = 64;
/// 4 and 16 KiB of flash.
const PAGE_BLOCKS: [u32; 2] = [8, 32];
/// Recording time of the next power-on, in seconds.
const NEXT_S: f64 = 0.3;
/// No earlier session has it.
const NEXT_BOOTS: u32 = 1_000;

const SHORT: Scenario = Scenario { seconds: 10.0, ..LATER };
const SCENARIOS: &[Scenario] = &[
    SHORT,
    Scenario { seconds: 10.0, ..FULL },
    Scenario { seconds: 10.0, ..NEW_CARD },
    Scenario { flight: PX4, card_mib: 300, ..SHORT },
];
/// Cases that are described in words.
const NOTES_MAX: usize = 40;
const SCENARIOS_SHORT: usize = 2;

const COLUMNS: [&str; 11] = [
    "card fault",
    "cuts",
    "`fsck.vfat` complains",
    "sectors of earlier sessions spoiled",
    "part of an earlier session lost",
    "of these without a report",
    "frames lost outside spoiled groups",
    "next power-on: recorded completely",
    "next power-on: not recorded, and the box reports why",
    "sectors of the session before overwritten: the oldest file's new name was lost",
    "other readable sectors of earlier sessions overwritten",
];

pub(in crate::prove) fn run(options: &Options) -> Result<Figures> {
    let scenarios = if options.short { &SCENARIOS[..SCENARIOS_SHORT] } else { SCENARIOS };
    let share = options.runs(3_000, 36).div_ceil(scenarios.len() as u64);
    let outcomes = scenarios.par_iter().enumerate().with_max_len(1).map(|(index, scenario)| {
        let what = || format!("{} ({}), seed {}", scenario.name, scenario.flight, options.seed);
        let seed = options.seed.wrapping_add(index as u64);
        Subject::record(scenario).and_then(|subject| subject.cut_often(share, seed)).with_context(what)
    });
    let (mut counts, mut notes) = ([[0; COLUMNS.len() - 1]; Fault::ALL.len() + 1], Vec::new());
    for outcome in outcomes.collect::<Result<Vec<_>>>()? {
        for (fault, tally) in outcome.tallies.iter().enumerate() {
            for (column, number) in tally.numbers().into_iter().enumerate() {
                counts[fault][column] += number;
                counts[Fault::ALL.len()][column] += number;
            }
        }
        notes.extend(outcome.notes);
    }
    notes.iter().take(NOTES_MAX).for_each(|note| eprintln!("careless-cards: {note}"));
    let mut figures = Figures::with(&COLUMNS);
    for (name, counts) in Fault::ALL.map(Fault::name).iter().chain(&["all"]).zip(&counts) {
        let cells: Vec<&dyn Display> =
            std::iter::once(name as &dyn Display).chain(counts.iter().map(|count| count as _)).collect();
        figures.row(&cells);
    }
    let [.., untold, beyond, _, _, _, written_over] = counts[Fault::ALL.len()];
    ensure!(beyond == 0, "more was lost than was spoiled:\n{}", figures.text());
    ensure!(untold == 0, "earlier sessions lost something and nothing tells:\n{}", figures.text());
    // Rarely the recorder cannot know: see docs/cards.md.
    ensure!(
        !options.short || written_over == 0,
        "the next power-on wrote over earlier sessions:\n{}",
        figures.text()
    );
    Ok(figures)
}

/// The card's fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// Any of the last blocks may be missing.
    Reordered,
    /// One acknowledged block is missing.
    Forgotten,
    /// Noise, zeros or ones around the last block.
    Spoiled,
}

impl Fault {
    const ALL: [Self; 3] = [Self::Reordered, Self::Forgotten, Self::Spoiled];

    const fn name(self) -> &'static str {
        match self {
            Self::Reordered => "some of the last 2 to 64 blocks lost",
            Self::Forgotten => "one acknowledged block lost",
            Self::Spoiled => "the page of 4 or 16 KiB around the last block is spoiled",
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    cuts: u64,
    complaints: u64,
    /// The fault itself changed sectors of earlier sessions.
    spoiled: u64,
    /// Fewer frames of an earlier session than before.
    less: u64,
    /// Of them those without any report.
    untold: u64,
    /// Lost although none of the session's sectors was spoiled.
    beyond: u64,
    recorded: u64,
    said_why: u64,
    /// In a file that the session had taken over: the card lost the new name, so the file counts as the oldest.
    name_lost: u64,
    written_over: u64,
}

impl Tally {
    /// In the order of the columns.
    fn numbers(&self) -> [u64; COLUMNS.len() - 1] {
        let Self { cuts, complaints, spoiled, less, untold, beyond, .. } = *self;
        let Self { recorded, said_why, name_lost, written_over, .. } = *self;
        [cuts, complaints, spoiled, less, untold, beyond, recorded, said_why, name_lost, written_over]
    }
}

struct Outcome {
    tallies: [Tally; Fault::ALL.len()],
    /// Unreported losses, and overwritten sectors, in words.
    notes: Vec<String>,
}

type Blocks = BTreeMap<u32, [u8; BLOCK]>;

#[derive(Clone, Copy)]
struct Kept {
    session: u32,
    /// Index.
    file: usize,
}

struct Subject {
    session: Session,
    kept: BTreeMap<u32, Kept>,
    frames: BTreeMap<u32, usize>,
    next: Stream,
    /// A faultless card, where it differs from the earlier content.
    now: Blocks,
    name: &'static str,
    notes: Vec<String>,
}

impl Subject {
    fn record(scenario: &Scenario) -> Result<Self> {
        let session = Session::record(scenario)?;
        let frames = frames_by_session(&find(&[session.card.path()], false)?)?;
        let mut sealed_as = BTreeMap::new();
        let mut kept = BTreeMap::new();
        for (index, file) in session.files.iter().enumerate() {
            for block in blocks_of(&file.extents) {
                let Ok(header) = Header::read(&session.block_before(block)) else { continue };
                if *sealed_as.entry(index).or_insert(header.session) == header.session {
                    kept.insert(block, Kept { session: header.session, file: index });
                }
            }
        }
        ensure!(kept.is_empty() == (scenario.earlier == 0), "{} sectors of earlier sessions", kept.len());
        let next = Stream::of_flight(&own(GUIDED), FULL_RATE)?.for_seconds(NEXT_S);
        Ok(Self { session, kept, frames, next, now: Blocks::new(), name: scenario.name, notes: Vec::new() })
    }

    /// Half of them at writes of the file system.
    fn choose(&self, count: u64, random: &mut Random) -> Vec<(usize, Fault)> {
        let trace = &self.session.trace;
        let metadata: Vec<_> =
            (0..trace.len()).filter(|index| self.session.is_metadata(&trace[*index])).collect();
        let mut cuts: Vec<_> = (0..count)
            .map(|index| {
                let fault = Fault::ALL[index as usize % Fault::ALL.len()];
                let any = random.below(trace.len() as u64) as usize;
                let at = if random.chance(0.5) {
                    metadata[random.below(metadata.len() as u64) as usize]
                } else {
                    any
                };
                let further =
                    if fault == Fault::Spoiled { 0 } else { random.below(CACHE_BLOCKS_MAX) as usize };
                ((at + further).min(trace.len() - 1), fault)
            })
            .collect();
        cuts.sort_unstable_by_key(|(at, _)| *at);
        cuts
    }

    fn cut_often(mut self, count: u64, seed: u64) -> Result<Outcome> {
        let mut random = Random::new(seed);
        let mut tallies = [Tally::default(); Fault::ALL.len()];
        let mut done = 0;
        for (cut, fault) in self.choose(count, &mut random) {
            for write in &self.session.trace[done..=cut] {
                self.session.card.write_block(write.block, &write.bytes)?;
                self.now.insert(write.block, write.bytes);
            }
            done = done.max(cut + 1);
            let wrong = self.wrong(cut, fault, &mut random);
            for (block, bytes) in &wrong {
                self.session.card.write_block(*block, bytes)?;
            }
            let what = format!("{}: cut at write {cut}, {fault:?}", self.name);
            let tally = &mut tallies[fault as usize];
            let before = *tally;
            let written = self.look(&wrong, tally).with_context(|| what.clone())?;
            if tally.untold > before.untold {
                self.notes.push(format!("{what}: less of an earlier session, and nothing tells"));
            }
            if tally.written_over > before.written_over {
                let sectors = tally.written_over - before.written_over;
                self.notes.push(format!("{what}: {sectors} readable sectors were written over"));
            }
            for block in wrong.keys().chain(&written) {
                self.session.card.write_block(*block, &self.at(*block, &Blocks::new()))?;
            }
        }
        Ok(Outcome { tallies, notes: self.notes })
    }

    /// Faulty or correct.
    fn at(&self, block: u32, wrong: &Blocks) -> [u8; BLOCK] {
        let known = wrong.get(&block).or_else(|| self.now.get(&block));
        known.copied().unwrap_or_else(|| self.session.block_before(block))
    }

    fn wrong(&self, cut: usize, fault: Fault, random: &mut Random) -> Blocks {
        match fault {
            Fault::Reordered => {
                let cached = 2 + random.below(CACHE_BLOCKS_MAX - 1) as usize;
                let first = (cut + 1).saturating_sub(cached);
                let mut wrong = Blocks::new();
                for write in &self.session.trace[first..=cut] {
                    let before = wrong.entry(write.block).or_insert_with(|| self.earlier(write.block, first));
                    if random.chance(0.5) {
                        *before = write.bytes;
                    }
                }
                wrong
            }
            Fault::Forgotten => {
                let trace = &self.session.trace[..=cut];
                // Half of the file system's; the others among the last.
                let metadata: Vec<_> =
                    (0..=cut).filter(|index| self.session.is_metadata(&trace[*index])).collect();
                let last = cut - random.below(CACHE_BLOCKS_MAX.min(cut as u64 + 1)) as usize;
                let any = random.below(metadata.len() as u64) as usize;
                let lost = metadata.get(any).copied().filter(|_| random.chance(0.5)).unwrap_or(last);
                let block = trace[lost].block;
                let later = trace[lost + 1..].iter().rev().find(|write| write.block == block);
                let bytes = later.map_or_else(|| self.earlier(block, lost), |write| write.bytes);
                Blocks::from([(block, bytes)])
            }
            Fault::Spoiled => {
                let blocks = PAGE_BLOCKS[random.below(2) as usize];
                let first = self.session.trace[cut].block / blocks * blocks;
                let kind = random.below(3);
                let mut page = |_| match kind {
                    0 => random.bytes(BLOCK).try_into().expect("a block"),
                    1 => [0; BLOCK],
                    _ => [0xFF; BLOCK],
                };
                (first..first + blocks).map(|block| (block, page(block))).collect()
            }
        }
    }

    fn earlier(&self, block: u32, before: usize) -> [u8; BLOCK] {
        let write = self.session.trace[..before].iter().rev().find(|write| write.block == block);
        write.map_or_else(|| self.session.block_before(block), |write| write.bytes)
    }

    /// Returns the blocks of the next power-on.
    fn look(&mut self, wrong: &Blocks, tally: &mut Tally) -> Result<BTreeSet<u32>> {
        tally.cuts += 1;
        tally.complaints += u64::from(self.session.card.check().is_err());
        self.read(wrong, tally)?;
        self.record_again(wrong, tally)
    }

    fn read(&self, wrong: &Blocks, tally: &mut Tally) -> Result<()> {
        // Overwritten in normal operation, and changed by the fault.
        let (mut made_room, mut spoiled) = (BTreeSet::new(), BTreeSet::new());
        for (block, kept) in &self.kept {
            let before = self.session.block_before(*block);
            if self.at(*block, &Blocks::new()) != before {
                made_room.insert(kept.session);
            } else if self.at(*block, wrong) != before {
                spoiled.insert(kept.session);
            }
        }
        tally.spoiled += u64::from(!spoiled.is_empty());
        for (index, file) in self.session.files.iter().enumerate() {
            let of_file = self.kept.values().find(|kept| kept.file == index);
            made_room.extend(
                of_file.filter(|_| self.session.overwritten.contains(&file.path)).map(|kept| kept.session),
            );
        }
        // Reported with an error.
        let Ok(found) = find(&[self.session.card.path()], false) else {
            tally.less += u64::from(!self.frames.is_empty());
            return Ok(());
        };
        let now = frames_by_session(&found)?;
        let mut less = BTreeSet::new();
        for (session, frames) in self.frames.iter().filter(|(session, _)| !made_room.contains(session)) {
            let missing = frames.saturating_sub(now.get(session).copied().unwrap_or(0));
            if missing > 0 {
                less.insert(*session);
                tally.beyond += if spoiled.contains(session) { 0 } else { missing as u64 };
            }
        }
        if !less.is_empty() {
            tally.less += 1;
            tally.untold += u64::from(!tells(&found, &less)?);
        }
        Ok(())
    }

    /// No readable sector is overwritten.
    fn record_again(&self, wrong: &Blocks, tally: &mut Tally) -> Result<BTreeSet<u32>> {
        let card = &self.session.card;
        let names = || card.walk().map(|walk| walk.files.into_iter().map(|file| (file.name, file.path))).ok();
        let before: BTreeMap<_, _> = names().into_iter().flatten().collect();
        let device = card.device(hums::card::Faults::default())?;
        device.start_trace();
        let done = power_on(&device, NEXT_BOOTS, self.next.chunks())?;
        let written: BTreeSet<_> = device.take_trace().into_iter().map(|write| write.block).collect();
        let after: BTreeMap<_, _> = names().into_iter().flatten().collect();

        if matches!(done.card.state, CardState::Recording | CardState::Finished) {
            ensure!(self.is_recorded()?, "the next session is not as it was recorded: {:?}", done.card);
            tally.recorded += 1;
        } else {
            let why = done.card.state;
            ensure!(!matches!(why, CardState::Unknown | CardState::Absent), "the box says {why:?}");
            ensure!(
                done.stats.frames_lost > 0 || done.frames_left > 0,
                "{why:?}, and no frame counts as lost"
            );
            tally.said_why += 1;
        }

        // Only the oldest files may be overwritten.
        let gone: Vec<_> = before.iter().filter(|(name, _)| !after.contains_key(name)).collect();
        ensure!(gone.iter().zip(&before).all(|(gone, oldest)| *gone == oldest), "not the oldest: {gone:?}");
        let made_room: BTreeSet<_> = gone.into_iter().map(|(_, path)| path.as_str()).collect();
        for block in written.iter().filter(|block| self.is_readable(**block, wrong, &made_room)) {
            let is_name_lost = self.owner(*block).is_some_and(|path| made_room.contains(path));
            *(if is_name_lost { &mut tally.name_lost } else { &mut tally.written_over }) += 1;
        }
        Ok(written)
    }

    fn is_readable(&self, block: u32, wrong: &Blocks, made_room: &BTreeSet<&str>) -> bool {
        let Ok(header) = Header::read(&self.at(block, wrong)) else { return false };
        if header.session == self.session.sealed_as {
            return true;
        }
        let kept = self.kept.get(&block).filter(|kept| kept.session == header.session);
        let path = kept.map(|kept| self.session.files[kept.file].path.as_str());
        path.is_some_and(|path| !made_room.contains(path) && !self.session.overwritten.contains(path))
    }

    fn owner(&self, block: u32) -> Option<&str> {
        self.session.owners.get(&block).map(|file| self.session.files[*file].path.as_str())
    }

    fn is_recorded(&self) -> Result<bool> {
        let hashes = self.next.hashes();
        for log in find(&[self.session.card.path()], false)?.logs.iter().rev() {
            let record = Record::of(log)?;
            if record.frames.iter().map(|frame| frame.hash).eq(hashes.iter().copied()) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

fn frames_by_session(found: &FoundLogs) -> Result<BTreeMap<u32, usize>> {
    let mut frames = BTreeMap::new();
    for log in &found.logs {
        let record = Record::of(log)?;
        if let Some(session) = record.summary.session {
            *frames.entry(session).or_default() += record.frames.len();
        }
    }
    Ok(frames)
}

/// Reported for the card, the log, or the log after.
fn tells(found: &FoundLogs, less: &BTreeSet<u32>) -> Result<bool> {
    if found.images.iter().any(|image| !image.damage.is_empty()) {
        return Ok(true);
    }
    let logs = found.logs.iter().map(|log| (log.name.as_str(), log));
    let (mut followed, mut overviews) = (EndResolver::new(Sessions::of(logs)), Vec::new());
    for log in &found.logs {
        overviews.extend(followed.push(Overview::verified(log)?));
    }
    overviews.extend(followed.finish());
    let told = |log: &Overview| {
        let is_it = log.ending.summary.session.is_some_and(|session| less.contains(&session));
        matches!(log.ending.before, SessionBefore::Gone(_)) || is_it && verdict(log) == Verdict::NotProved
    };
    Ok(overviews.iter().any(told))
}
