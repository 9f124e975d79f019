//! Power cuts at any block write.
//!
//! A session is recorded once, with every block write kept. Then the writes are replayed up to a random one, that one
//! whole or in part. Decoded frames are compared with the sent ones, in order, with their arrival times.

pub(super) mod careless;

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result, ensure};
use hums::card::Faults;
use hums::card::faults::CardOut;
use hums::card::sim::Written;
use hums::logs::fat::CardFile;
use hums::logs::{Log, on_card};
use hums::run::sim::both_ports::power_on;
use hums_blackbox::Cause;
use rayon::prelude::*;

use super::card::{BLOCK, Card, blocks_of};
use super::figures::Figures;
use super::options::Options;
use super::record::Record;
use super::stream::{FULL_RATE, Stream};
use crate::damage::Random;
use crate::flights::own;

/// A directory entry.
const ENTRY: usize = 32;
/// Loss once the log has begun.
const LOSS_MAX_US: u64 = 200_000;
/// The card is opened, the previous session searched, the first segment made.
const BEGIN_MAX_US: u64 = 300_000;

/// Bytes that are old or new together: half an entry of the FAT would damage any file system of this kind.
const WORD: usize = 4;

/// Found within a second; the waiting sectors half a second later.
const CATCH_UP_US: u64 = 1_500_000;

struct Scenario {
    name: &'static str,
    flight: &'static str,
    card_mib: u64,
    earlier: u32,
    seconds: f64,
    baud: u64,
    /// Seconds.
    out: Option<(f64, f64)>,
}

const PX4: &str = "px4_hil_quad_low.tlog";
const GUIDED: &str = "ap_quad_guided.tlog";
const FAULTS: &str = "ap_quad_faults.tlog";
const SIGNED: &str = "ap_quad_signed.raw";

const NEW_CARD: Scenario = Scenario {
    name: "the first session on a card",
    flight: GUIDED,
    card_mib: 64,
    earlier: 0,
    seconds: 20.0,
    baud: FULL_RATE,
    out: None,
};
const LATER: Scenario = Scenario { name: "a session after others", earlier: 3, ..NEW_CARD };
const FULL: Scenario = Scenario { name: "a session on a full card", card_mib: 34, earlier: 18, ..NEW_CARD };
const SPLIT: Scenario =
    Scenario { name: "a log that is split", card_mib: 34, earlier: 2, seconds: 110.0, ..NEW_CARD };
const SPLIT_FULL: Scenario = Scenario { name: "a log that is split on a full card", earlier: 18, ..SPLIT };
const SLOW: Scenario = Scenario { name: "a session at 57,600 baud", baud: 57_600, seconds: 50.0, ..LATER };
const RETURN: Scenario =
    Scenario { name: "a card that was taken out and put back", out: Some((5.0, 6.5)), ..LATER };

const SCENARIOS: &[Scenario] = &[
    NEW_CARD,
    Scenario { flight: SIGNED, ..NEW_CARD },
    LATER,
    Scenario { flight: PX4, ..LATER },
    Scenario { flight: FAULTS, ..LATER },
    SLOW,
    Scenario { flight: PX4, ..SLOW },
    FULL,
    Scenario { flight: PX4, ..FULL },
    Scenario { flight: SIGNED, ..FULL },
    Scenario { flight: PX4, ..SPLIT },
    Scenario { flight: SIGNED, ..SPLIT },
    Scenario { flight: PX4, ..SPLIT_FULL },
    Scenario { flight: SIGNED, ..SPLIT_FULL },
    RETURN,
    Scenario { flight: PX4, ..RETURN },
    Scenario { flight: FAULTS, ..RETURN },
];

pub(super) fn run(options: &Options) -> Result<Figures> {
    let runs = options.runs(10_000, 96);
    let share = runs.div_ceil(SCENARIOS.len() as u64);
    // The split takes minutes of recording.
    let chosen: Vec<_> =
        (0..).zip(SCENARIOS).filter(|(_, one)| !options.short || one.seconds < 60.0).collect();
    let outcomes = chosen.into_par_iter().with_max_len(1).map(|(index, scenario)| {
        let seed = options.seed.wrapping_add(index);
        let what = || format!("{} ({}), seed {}", scenario.name, scenario.flight, options.seed);
        Session::record(scenario).and_then(|session| session.cut_often(share, seed)).with_context(what)
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    let mut figures = Figures::with(&["scenario", "flight", "block writes", "cuts", "torn", "worst ms"]);
    figures.fact("cuts", sum(|one| one.cuts));
    figures.fact("cuts in the middle of a block (torn)", sum(|one| one.torn));
    figures.fact("cuts at the FAT or the directory", sum(|one| one.metadata));
    figures.fact("files of earlier sessions compared", sum(|one| one.files));
    figures.fact("frames decoded, all correct", sum(|one| one.frames));
    let worst = outcomes.iter().map(|one| one.loss_us_max).max().unwrap_or(0);
    figures.fact("largest loss by a cut, ms (200 allowed)", worst / 1000);
    let begun = outcomes.iter().map(|one| one.begin_us_max).max().unwrap_or(0);
    figures.fact("largest loss before the log began, ms (300 allowed)", begun / 1000);
    for (one, scenario) in
        outcomes.iter().zip(SCENARIOS.iter().filter(|one| !options.short || one.seconds < 60.0))
    {
        let worst_ms = one.loss_us_max / 1000;
        figures.row(&[&scenario.name, &scenario.flight, &one.writes, &one.cuts, &one.torn, &worst_ms]);
    }
    Ok(figures)
}

#[derive(Default)]
struct Outcome {
    writes: u64,
    cuts: u64,
    torn: u64,
    metadata: u64,
    files: u64,
    frames: u64,
    loss_us_max: u64,
    /// Before the log had begun.
    begin_us_max: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Tear {
    Whole,
    /// The bytes before this one.
    Before(usize),
    /// The bytes from this one on.
    From(usize),
}

impl Tear {
    fn by_chance(random: &mut Random, piece: usize) -> Self {
        let pieces = (BLOCK / piece) as u64;
        let at = if random.chance(0.5) { BLOCK / 2 } else { piece * (1 + random.below(pieces - 1)) as usize };
        if random.chance(0.5) { Self::Before(at) } else { Self::From(at) }
    }

    fn apply(self, old: &[u8; BLOCK], new: &[u8; BLOCK]) -> [u8; BLOCK] {
        let mut block = *new;
        match self {
            Self::Whole => {}
            Self::Before(at) => block[at..].copy_from_slice(&old[at..]),
            Self::From(at) => block[..at].copy_from_slice(&old[..at]),
        }
        block
    }
}

struct Session {
    card: Card,
    before: Vec<u8>,
    files: Vec<CardFile>,
    overwritten: BTreeSet<String>,
    /// The earlier session's file of a block.
    owners: BTreeMap<u32, usize>,
    trace: Vec<Written>,
    logs: BTreeSet<String>,
    sealed_as: u32,
    arrivals_us: Vec<u64>,
    hashes: Vec<u64>,
    data_start: u32,
    /// Out of the slot, and until the waiting sectors were written.
    out_us: Option<(u64, u64)>,
}

impl Session {
    fn record(scenario: &Scenario) -> Result<Self> {
        let card = Card::new(scenario.card_mib)?;
        let earlier = Stream::of_flight(&own(GUIDED), FULL_RATE)?.for_seconds(0.3);
        for boots in 1..=scenario.earlier {
            card.record(&earlier, boots)?;
        }
        let (before, files) = (card.content()?, card.walk()?.files);
        let logs_before: BTreeSet<_> = on_card(&card.path()).into_iter().map(|log| log.name).collect();
        let stream = Stream::of_flight(&own(scenario.flight), scenario.baud)?.for_seconds(scenario.seconds);

        let micros = |seconds: f64| (seconds * 1e6) as u64;
        let out = scenario.out.map(|(from, to)| CardOut { from_us: micros(from), to_us: micros(to) });
        let device = card.device(Faults { outs: out.into_iter().collect(), ..Faults::default() })?;
        device.start_trace();
        let boots = scenario.earlier + 1;
        let done = power_on(&device, boots, stream.chunks())?;
        ensure!(done.stats.frames_lost == 0 && done.frames_left == 0, "frames were lost: {:?}", done.stats);
        let trace = device.take_trace();
        ensure!(trace.len() > 200, "only {} block writes", trace.len());

        let after: BTreeSet<_> = card.walk()?.files.into_iter().map(|file| file.path).collect();
        let gone = files.iter().filter(|file| !after.contains(&file.path));
        let overwritten = gone.map(|file| file.path.clone()).collect();
        let logs: Vec<Log> =
            on_card(&card.path()).into_iter().filter(|log| !logs_before.contains(&log.name)).collect();
        let first = logs.first().context("the session left no log")?;
        let sealed_as = Record::of(first)?.summary.session.context("the session's log is empty")?;
        let mut owners = BTreeMap::new();
        for (index, file) in files.iter().enumerate() {
            owners.extend(blocks_of(&file.extents).map(|block| (block, index)));
        }
        let device = hums::card::ReadOnlyImage::new(std::fs::File::open(card.path())?)?;
        let layout =
            hums_recorder::layout::Layout::read(&device).map_err(|error| anyhow::anyhow!("{error}"))?;
        let session = Self {
            before,
            files,
            overwritten,
            owners,
            logs: logs.into_iter().map(|log| log.name).collect(),
            sealed_as,
            arrivals_us: stream.arrivals_us(),
            hashes: stream.hashes(),
            data_start: layout.data_start,
            out_us: out.map(|out| (out.from_us, out.to_us + CATCH_UP_US)),
            trace,
            card,
        };
        session.rewind()?;
        Ok(session)
    }

    fn rewind(&self) -> Result<()> {
        self.trace
            .iter()
            .try_for_each(|write| self.card.write_block(write.block, &self.block_before(write.block)))
    }

    fn block_before(&self, block: u32) -> [u8; BLOCK] {
        let at = block as usize * BLOCK;
        self.before[at..at + BLOCK].try_into().expect("a whole block")
    }

    fn is_metadata(&self, write: &Written) -> bool {
        // Its further clusters are few and written at the same moments.
        write.block <= self.data_start
    }

    /// Parts that are old or new together. A torn directory entry is a name that no system accepts; the log is then
    /// found by its sectors.
    fn piece(&self, write: usize) -> usize {
        if self.trace.get(write).is_some_and(|write| self.is_metadata(write)) { ENTRY } else { WORD }
    }

    /// Half of them torn, either way.
    fn choose(&self, count: u64, seed: u64) -> Vec<(usize, Tear)> {
        let mut random = Random::new(seed);
        let mut cuts: Vec<_> = (0..count)
            .map(|index| {
                let write = random.below(self.trace.len() as u64) as usize;
                (
                    write,
                    if index % 2 == 0 {
                        Tear::Whole
                    } else {
                        Tear::by_chance(&mut random, self.piece(write))
                    },
                )
            })
            .collect();
        // Writes of the file system are few: the directory's, and evenly chosen ones of the FAT, whole and torn.
        let all = (0..self.trace.len()).filter(|index| self.is_metadata(&self.trace[*index]));
        let (directory, fat): (Vec<_>, Vec<_>) =
            all.partition(|index| self.trace[*index].block == self.data_start);
        let wanted = (count as usize / 8).max(2);
        let evenly = |writes: &[usize]| {
            let chosen = wanted.min(writes.len());
            (0..chosen).map(|index| writes[index * writes.len() / chosen]).collect::<Vec<_>>()
        };
        for write in [evenly(&directory), evenly(&fat)].concat() {
            cuts.push((write, Tear::Whole));
            cuts.push((write, Tear::by_chance(&mut random, self.piece(write))));
        }
        cuts.sort_unstable();
        cuts
    }

    fn cut_often(mut self, count: u64, seed: u64) -> Result<Outcome> {
        let mut outcome = Outcome { writes: self.trace.len() as u64, ..Outcome::default() };
        let mut done = 0;
        for (index, tear) in self.choose(count, seed) {
            for write in &self.trace[done..index] {
                self.card.write_block(write.block, &write.bytes)?;
            }
            done = index;
            let write = self.trace[index].clone();
            let old = self.card.read_block(write.block)?;
            self.card.write_block(write.block, &tear.apply(&old, &write.bytes))?;
            let what = || format!("cut at write {index}, {tear:?}, block {}", write.block);
            let behind = write.block + 1..=write.block + write.behind;
            let held: Vec<_> =
                behind.clone().map(|block| self.card.read_block(block)).collect::<Result<_>>()?;
            behind.clone().try_for_each(|block| self.card.write_block(block, &[0; BLOCK]))?;
            self.look(index, &mut outcome).with_context(what)?;
            self.card.write_block(write.block, &old)?;
            behind.zip(&held).try_for_each(|(block, held)| self.card.write_block(block, held))?;
            outcome.cuts += 1;
            outcome.torn += u64::from(tear != Tear::Whole);
            outcome.metadata += u64::from(self.is_metadata(&write));
        }
        Ok(outcome)
    }

    fn look(&mut self, cut: usize, outcome: &mut Outcome) -> Result<()> {
        self.card.check()?;
        outcome.files += self.earlier_files(cut)?;
        let (frames, known_us) = self.decode()?;
        outcome.frames += frames;
        let cut_us = self.trace[cut].at_us;
        let given = self.arrivals_us.partition_point(|at| *at <= cut_us);
        let given_us = given.checked_sub(1).map_or(0, |last| self.arrivals_us[last]);
        // Waiting sectors are in memory only.
        let out = self.out_us.filter(|(from, to)| (*from..*to).contains(&cut_us));
        let due_us = out.map_or(given_us, |(from, _)| given_us.min(from));
        let loss_us = due_us.saturating_sub(known_us);
        let begun = known_us > 0;
        let max = if begun { &mut outcome.loss_us_max } else { &mut outcome.begin_us_max };
        *max = loss_us.max(*max);
        ensure!(
            loss_us <= if begun { LOSS_MAX_US } else { BEGIN_MAX_US },
            "at {cut_us} us, the last frame came at {given_us} and the last one in the log at {known_us}"
        );
        Ok(())
    }

    /// Unchanged, unless overwritten. Returns the compared ones.
    fn earlier_files(&self, cut: usize) -> Result<u64> {
        let walk = self.card.walk()?;
        ensure!(walk.damage.is_empty(), "{:?}", walk.damage);
        let now: BTreeMap<_, _> = walk.files.iter().map(|file| (file.path.as_str(), file)).collect();
        let mut same = vec![false; self.files.len()];
        for (index, file) in self.files.iter().enumerate() {
            same[index] = now.get(file.path.as_str()) == Some(&file);
            ensure!(same[index] || self.overwritten.contains(&file.path), "{} is gone or changed", file.path);
        }
        // Only written blocks can differ.
        let written: BTreeSet<_> = self.trace[..=cut].iter().map(|write| write.block).collect();
        for block in written {
            if let Some(owner) = self.owners.get(&block).filter(|owner| same[**owner]) {
                let path = &self.files[*owner].path;
                ensure!(self.card.read_block(block)? == self.block_before(block), "{path} was written to");
            }
        }
        Ok(same.iter().filter(|same| **same).count() as u64)
    }

    /// Returns the frames' number and the last arrival. Each equals the sent one.
    fn decode(&self) -> Result<(u64, u64)> {
        let (mut count, mut next, mut last_us) = (0, 0, 0);
        for log in on_card(&self.card.path()).iter().filter(|log| self.logs.contains(&log.name)) {
            let record = Record::of(log)?;
            if record.summary.session != Some(self.sealed_as) {
                // Without a sector it has the overwritten log's content.
                continue;
            }
            let mut gaps = record.gaps.iter().peekable();
            for (index, frame) in record.frames.iter().enumerate() {
                while let Some((_, gap)) = gaps.next_if(|(before, _)| *before == index) {
                    let is_wanted = gap.from.is_none() && gap.cause == Cause::Disarmed;
                    ensure!(is_wanted, "a gap before the cut: {gap:?}");
                    next = gap.frames.context("a gap of unknown length")? as usize;
                }
                let arrival_us = *self.arrivals_us.get(next).context("more frames than went in")?;
                ensure!(self.hashes[next] == frame.hash, "frame {next} is not the one that went in");
                ensure!(frame.at_ms.abs_diff(arrival_us / 1000) <= 1, "frame {next} came at another time");
                next += 1;
                last_us = arrival_us;
            }
            count += record.frames.len() as u64;
        }
        Ok((count, last_us))
    }
}
