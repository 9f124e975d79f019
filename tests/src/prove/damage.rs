//! Bits flip anywhere in a log.
//!
//! A log is recorded once, and read: every frame that went in comes out. Then a bit, or a burst of some, is flipped in
//! the image, the log is read, and the bits are put back: what comes out is compared with what came out before.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result, ensure};
use hums::logs::{Log, on_card};
use hums_blackbox::Header;
use rayon::prelude::*;

use super::card::{BLOCK, Card};
use super::figures::{Figures, Labels};
use super::options::Options;
use super::record::Record;
use super::stream::{FULL_RATE, Stream};
use crate::damage::Random;
use crate::flights::{OWN, own};

/// Seconds of each recording, at full rate: a dozen groups, so that ten thousand readings take minutes.
const SECONDS: f64 = 15.0;
/// The longest burst, in bits: a sector.
const BURST_BITS_MAX: u64 = 8 * BLOCK as u64;

/// What it prints.
pub(super) const LABELS: Labels = Labels {
    facts: &[
        "errors",
        "of them single bits",
        "of them bursts of 2 to 4096 bits",
        "noticed",
        "frames lost at most, of one group",
        "frames given out, all of them right",
    ],
    columns: &["flight", "sectors", "groups", "frames", "errors", "frames lost on average"],
};

pub(super) fn run(options: &Options) -> Result<Figures> {
    let share = options.runs(10_000, 200).div_ceil(OWN.len() as u64);
    let outcomes = OWN.into_par_iter().enumerate().with_max_len(1).map(|(index, flight)| {
        Subject::record(flight)?.damage_often(share, options.seed.wrapping_add(index as u64)).context(flight)
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    let mut figures = Figures::new(&LABELS);
    figures.fact("errors", sum(|one| one.single + one.bursts));
    figures.fact("of them single bits", sum(|one| one.single));
    figures.fact("of them bursts of 2 to 4096 bits", sum(|one| one.bursts));
    figures.fact("noticed", sum(|one| one.single + one.bursts));
    figures.fact(
        "frames lost at most, of one group",
        outcomes.iter().map(|one| one.lost_max).max().unwrap_or(0),
    );
    figures.fact("frames given out, all of them right", sum(|one| one.frames));
    for (flight, one) in OWN.iter().zip(&outcomes) {
        let errors = one.single + one.bursts;
        figures.row([
            (*flight).to_owned(),
            one.sectors.to_string(),
            one.groups.to_string(),
            one.whole.to_string(),
            errors.to_string(),
            format!("{:.0}", one.lost as f64 / errors.max(1) as f64),
        ]);
    }
    Ok(figures)
}

#[derive(Default)]
struct Outcome {
    sectors: u64,
    groups: u64,
    whole: u64,
    single: u64,
    bursts: u64,
    lost: u64,
    lost_max: u64,
    frames: u64,
}

struct Subject {
    card: Card,
    log: Log,
    /// The blocks that hold sectors, in order, each with its group's number.
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
        let all = log.pieces.iter().flat_map(|piece| &piece.extents).flat_map(|extent| {
            let first = (extent.start / BLOCK as u64) as u32;
            first..first + (extent.length / BLOCK as u64) as u32
        });
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

    fn damage_often(self, count: u64, seed: u64) -> Result<Outcome> {
        let mut random = Random::new(seed);
        let mut outcome = Outcome {
            sectors: self.blocks.len() as u64,
            groups: self.whole.groups.len() as u64,
            whole: self.whole.frames.len() as u64,
            ..Outcome::default()
        };
        for index in 0..count {
            let bit = random.below(self.blocks.len() as u64 * 8 * BLOCK as u64);
            let length = if index % 2 == 0 { 1 } else { 2 + random.below(BURST_BITS_MAX - 1) };
            let before = self.flip(bit, length, &mut random)?;
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

    /// Flips the first and the last bit of the burst and those between by chance; gives the blocks as they were.
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

    fn judge(&self, damaged: &Record, touched: &BTreeSet<usize>, outcome: &mut Outcome) -> Result<()> {
        ensure!(
            !damaged.gaps.is_empty()
                || damaged.summary.blocks.damaged > 0
                || damaged.summary.blocks.foreign > 0,
            "not noticed"
        );
        // What came out is what was there, in its order; what is missing is known by its place.
        let mut missing = Vec::new();
        let mut given = damaged.frames.iter().peekable();
        for (index, frame) in self.whole.frames.iter().enumerate() {
            if given.next_if_eq(&frame).is_none() {
                missing.push(index);
            }
        }
        ensure!(given.peek().is_none(), "a frame came out that never went in: {:?}", given.peek());
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
        outcome.lost += missing.len() as u64;
        outcome.lost_max = outcome.lost_max.max(missing.len() as u64);
        outcome.frames += damaged.frames.len() as u64;
        Ok(())
    }
}
