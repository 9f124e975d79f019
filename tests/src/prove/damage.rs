//! Bit errors anywhere in a log; [`super::pages`] has whole pages and ends.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result, ensure};
use hums::logs::{Log, on_card};
use hums_blackbox::{Header, Sector};
use rayon::prelude::*;

use super::card::{BLOCK, Card, blocks_of};
use super::figures::Figures;
use super::options::Options;
use super::pages;
use super::record::Record;
use super::stream::{FULL_RATE, Stream};
use crate::damage::Random;
use crate::flights::{OWN, own};

/// Seconds at full rate: a dozen groups, so that ten thousand readings take minutes.
const SECONDS: f64 = 15.0;
/// A sector.
const BURST_BITS_MAX: u64 = 8 * BLOCK as u64;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let mut figures =
        Figures::with(&["damage", "cases", "noticed", "reported", "missed", "frames lost, at most"]);
    bits(options, &mut figures)?;
    whole_pages(options, &mut figures)?;
    Ok(figures)
}

fn bits(options: &Options, figures: &mut Figures) -> Result<()> {
    let share = options.runs(10_000, 200).div_ceil(OWN.len() as u64);
    let outcomes = OWN.into_par_iter().enumerate().with_max_len(1).map(|(index, flight)| {
        let subject = Subject::record(flight)?;
        let seed = options.seed.wrapping_add(index as u64);
        let on_card = subject.damage_often(share, false, seed).context(flight)?;
        let in_memory = subject.damage_often(share, true, seed.wrapping_add(1_000)).context(flight)?;
        Ok((on_card, in_memory))
    });
    let (outcomes, in_memory): (Vec<_>, Vec<_>) = outcomes.collect::<Result<Vec<_>>>()?.into_iter().unzip();
    let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    let (errors, noticed) = (sum(|one| one.single + one.bursts), sum(|one| one.noticed));
    figures.fact("bit errors", errors);
    figures.fact("single bits", sum(|one| one.single));
    figures.fact("bursts of 2 to 4096 bits", sum(|one| one.bursts));
    figures.fact("noticed", noticed);
    figures.fact("frames lost", outcomes.iter().map(|one| one.lost_max).max().unwrap_or(0));
    figures.fact("frames decoded, all correct", sum(|one| one.frames));
    let sum = |of: fn(&Outcome) -> u64| in_memory.iter().map(of).sum::<u64>();
    figures.fact("bit errors in memory, before the sector's checksum", sum(|one| one.single));
    figures.fact("noticed", sum(|one| one.noticed));
    figures.fact("without effect", sum(|one| one.harmless));
    let lost_max = in_memory.iter().map(|one| one.lost_max).max().unwrap_or(0);
    figures.fact("frames lost by one of them, at most", lost_max);
    figures.fact("frames decoded after them, all correct", sum(|one| one.frames));
    ensure!(noticed == errors, "{} of {errors} errors in bits were not noticed", errors - noticed);
    Ok(())
}

fn whole_pages(options: &Options, figures: &mut Figures) -> Result<()> {
    let logs: Vec<_> =
        OWN.into_iter().flat_map(|flight| [(flight, true), (flight, false)]).zip(1..).collect();
    let subjects = logs
        .into_par_iter()
        .with_max_len(1)
        .map(|((flight, closed), boots)| pages::Subject::record(flight, closed, boots).context(flight));
    let subjects = subjects.collect::<Result<Vec<_>>>()?;
    let share = options.runs(12_960, 288).div_ceil(subjects.len() as u64);
    let outcomes = subjects.par_iter().enumerate().with_max_len(1).map(|(index, subject)| {
        let other = &subjects[(index + 2) % subjects.len()];
        subject.damage_often(other, share, options.seed.wrapping_add(index as u64))
    });
    let outcomes: Vec<_> = outcomes.collect();
    let all = pages::Tally::tabulate(figures, pages::Kind::ALL.map(pages::Kind::name), |kind| {
        outcomes.iter().map(move |one| &one.tallies[kind].1)
    });
    figures.fact("damaged pages and ends", all.damages);
    figures.fact("noticed by `info --verify`", all.noticed);
    figures.fact("read as the other session, and reported", all.other);
    figures.fact("reported as complete up to the named end mark", all.told);
    figures.fact("rebuilt from parity without a loss, and noticed by `info --verify`", all.repaired);
    figures.fact("missed or wrong", all.missed);
    figures.fact("frames decoded after these, all correct", all.frames);
    let misses: Vec<_> = outcomes.iter().flat_map(|one| &one.misses).take(10).map(String::as_str).collect();
    ensure!(all.missed == 0, "{}\nthe first ones:\n{}", figures.text(), misses.join("\n"));
    ensure!(all.noticed + all.told == all.damages, "they do not add up:\n{}", figures.text());
    Ok(())
}

#[derive(Default)]
struct Outcome {
    noticed: u64,
    /// Not noticed, and all frames came out.
    harmless: u64,
    single: u64,
    bursts: u64,
    lost_max: u64,
    frames: u64,
}

struct Subject {
    card: Card,
    log: Log,
    /// Blocks in order, each with its group.
    blocks: Vec<(u32, usize)>,
    whole: Record,
}

impl Subject {
    fn record(flight: &str) -> Result<Self> {
        let card = Card::new(64)?;
        let stream = Stream::of_flight(&own(flight), FULL_RATE)?.for_seconds(SECONDS);
        let done = card.record(&stream, 1)?;
        ensure!(done.stats.frames_lost == 0, "frames were lost");
        let log = on_card(&card.path()).pop().context("no log")?;
        let whole = Record::of(&log)?;
        ensure!(whole.gaps.is_empty() && whole.summary.blocks.damaged == 0, "damaged before any damage");
        let came_out: Vec<_> = whole.frames.iter().map(|frame| frame.hash).collect();
        ensure!(came_out == stream.hashes(), "what came out is not what went in");
        let all = log.pieces.iter().flat_map(|piece| blocks_of(&piece.extents));
        let (mut blocks, mut group) = (Vec::new(), 0);
        for block in all {
            let bytes = card.read_block(block)?;
            if let Ok(header) = Header::read(&bytes) {
                group += usize::from(header.starts_group());
                blocks.push((block, group));
            }
        }
        ensure!(group == whole.groups.len(), "{group} groups begin, {} were read", whole.groups.len());
        Ok(Self { card, log, blocks, whole })
    }

    /// `in_memory`: before the sectors got their checksums.
    fn damage_often(&self, count: u64, in_memory: bool, seed: u64) -> Result<Outcome> {
        let mut random = Random::new(seed);
        let mut outcome = Outcome::default();
        for index in 0..count {
            let bit = random.below(self.blocks.len() as u64 * 8 * BLOCK as u64);
            let length = if in_memory || index % 2 == 0 { 1 } else { 2 + random.below(BURST_BITS_MAX - 1) };
            let before = self.flip(bit, length, &mut random)?;
            if in_memory {
                before.iter().try_for_each(|(block, _)| self.seal(*block))?;
            }
            let damaged = Record::of(&self.log)?;
            let touched: BTreeSet<_> = before.iter().map(|(block, _)| block).collect();
            let groups: BTreeSet<_> = self
                .blocks
                .iter()
                .filter(|(block, _)| touched.contains(block))
                .map(|(_, group)| *group)
                .collect();
            self.judge(&damaged, &groups, &mut outcome)
                .with_context(|| format!("{length} bits from bit {bit} on"))?;
            before.iter().try_for_each(|(block, bytes)| self.card.write_block(*block, bytes))?;
            if length == 1 {
                outcome.single += 1;
            } else {
                outcome.bursts += 1;
            }
        }
        Ok(outcome)
    }

    /// Returns the original blocks.
    fn flip(&self, bit: u64, length: u64, random: &mut Random) -> Result<Vec<(u32, [u8; BLOCK])>> {
        let bits_of_block = 8 * BLOCK as u64;
        let mut before: Vec<(u32, [u8; BLOCK])> = Vec::new();
        for at in bit..bit + length {
            let Some(&(block, _)) = self.blocks.get((at / bits_of_block) as usize) else { break };
            let first_or_last = at == bit || at + 1 == bit + length;
            if !first_or_last && random.chance(0.5) {
                continue;
            }
            let mut bytes = self.card.read_block(block)?;
            if before.last().is_none_or(|(last, _)| *last != block) {
                before.push((block, bytes));
            }
            let at = (at % bits_of_block) as usize;
            bytes[at / 8] ^= 1 << (at % 8);
            self.card.write_block(block, &bytes)?;
        }
        Ok(before)
    }

    fn seal(&self, block: u32) -> Result<()> {
        let mut sector = Sector::from_bytes(self.card.read_block(block)?);
        sector.seal(self.whole.summary.session.context("no session")?);
        self.card.write_block(block, sector.bytes())
    }

    fn judge(&self, damaged: &Record, touched: &BTreeSet<usize>, outcome: &mut Outcome) -> Result<()> {
        let blocks = &damaged.summary.blocks;
        let is_noticed =
            !damaged.gaps.is_empty() || blocks.damaged > 0 || blocks.foreign > 0 || blocks.repaired > 0;
        outcome.noticed += u64::from(is_noticed);
        let missing = self.whole.missing(&damaged.frames)?;
        outcome.harmless += u64::from(!is_noticed && missing.is_empty());
        let group = |index: &usize| self.whole.groups.partition_point(|first| first <= index);
        let groups: BTreeSet<_> = missing.iter().map(group).collect();
        ensure!(
            groups.is_subset(touched),
            "frames of the groups {groups:?} are lost, {touched:?} were damaged"
        );
        if let (Some(first), Some(last)) = (missing.first(), missing.last()) {
            let (from, to) = (self.whole.frames[*first].at_ms, self.whole.frames[*last].at_ms);
            let told = damaged.gaps.iter().any(|(_, gap)| {
                gap.from.is_none_or(|at| at.as_millis() <= from)
                    && gap.to.is_none_or(|at| at.as_millis() >= to)
            });
            ensure!(
                told,
                "frames from {from} to {to} ms are missing, which no gap tells: {:?}",
                damaged.gaps
            );
        }
        outcome.lost_max = outcome.lost_max.max(missing.len() as u64);
        outcome.frames += damaged.frames.len() as u64;
        Ok(())
    }
}
