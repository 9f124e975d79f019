//! The logs of a vehicle that is recorded by arming, of which one power-on makes several.
//!
//! A power-on with some armed times is recorded once, and its files are copied off the card. Then files are taken away,
//! exchanged, given other numbers or joined, and pages of them go wrong; what is left is verified as a folder. *Noticed* is
//! what `hums verify` does not call good. What it calls good is told right where nothing is missing, or only what no log can
//! tell of: whole logs at the power-on's beginning (a full card overwrites the oldest) or end, what follows the newest log's
//! last end mark, and of a disarmed time what lies before the seconds that are kept at least.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use hums::ending::Proof;
use hums::logs::find::find_in;
use hums::logs::{Log, on_card};
use hums::run::sim::power_on;
use hums::summary::Overview;
use hums::verify::{Verdict, verdict, verify_each};
use hums_blackbox::{Header, PAGE_SECTORS};
use hums_core::params::Params;
use rayon::prelude::*;
use tempfile::TempDir;

use super::card::{BLOCK, Card};
use super::figures::{Figures, Labels};
use super::options::Options;
use super::pages::Tally;
use super::record::{Frame, Record};
use super::stream::{FULL_RATE, Stream};
use crate::damage::Random;
use crate::flights::{OWN, own};

/// Seconds of flight, and seconds that the vehicle waits disarmed after it: the ring's files are of 5 s and more.
const FLIGHTS: [(f64, f64); 4] = [(6.0, 14.0), (5.0, 2.0), (6.0, 19.0), (5.0, 9.0)];
/// What is kept of the time before an arming, in seconds.
const BEFORE_S: u32 = 5;

/// What it prints.
pub(super) const LABELS: Labels = Labels {
    facts: &[
        "damages",
        "of them noticed: `verify` does not call all of it good",
        "of them called good, and what is said is so",
        "missed, or told wrong",
    ],
    columns: &["damage", "how often", "noticed", "told", "missed", "most frames lost"],
};

pub(super) fn run(options: &Options) -> Result<Figures> {
    let mut figures = Figures::new(&LABELS);
    // Of each kind one in each flight at least.
    let share = options.runs(2_000, 40).div_ceil(OWN.len() as u64);
    let outcomes = OWN.into_par_iter().enumerate().with_max_len(1).map(|(index, flight)| {
        let subject = Subject::record(flight).context(flight)?;
        Ok(subject.damage_often(share, options.seed.wrapping_add(index as u64)))
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let all = Tally::tabulate(&mut figures, Kind::ALL.map(Kind::name), |kind| {
        outcomes.iter().map(move |(tallies, _)| &tallies[kind])
    });
    figures.fact("damages", all.damages);
    figures.fact("of them noticed: `verify` does not call all of it good", all.noticed);
    figures.fact("of them called good, and what is said is so", all.told);
    figures.fact("missed, or told wrong", all.missed);
    let misses: Vec<_> =
        outcomes.iter().flat_map(|(_, misses)| misses).take(10).map(String::as_str).collect();
    ensure!(all.missed == 0, "{}\nthe first ones:\n{}", figures.text(), misses.join("\n"));
    Ok(figures)
}

/// What can happen to the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    FileGone,
    LogGone,
    Exchanged,
    Renumbered,
    Elsewhere,
    Joined,
    Copied,
    Erased,
    PageCopied,
    PageTwice,
}

impl Kind {
    const ALL: [Self; 10] = [
        Self::FileGone,
        Self::LogGone,
        Self::Exchanged,
        Self::Renumbered,
        Self::Elsewhere,
        Self::Joined,
        Self::Copied,
        Self::Erased,
        Self::PageCopied,
        Self::PageTwice,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::FileGone => "a file taken away",
            Self::LogGone => "a log taken away",
            Self::Exchanged => "two files exchanged",
            Self::Renumbered => "a file under another number of its log",
            Self::Elsewhere => "a file as another log's",
            Self::Joined => "a file joined to another one",
            Self::Copied => "a file there twice",
            Self::Erased => "a page erased or zeroed",
            Self::PageCopied => "a page in the place of another one",
            Self::PageTwice => "a page there twice",
        }
    }
}

type Files = BTreeMap<String, Vec<u8>>;

/// A power-on's files, and what they hold.
struct Subject {
    dir: TempDir,
    files: Files,
    logs: Vec<Vec<Frame>>,
}

impl Subject {
    /// Records a power-on with as many armed times as there are in [`FLIGHTS`].
    fn record(flight: &str) -> Result<Self> {
        let card = Card::new(64)?;
        let stream = Stream::of_flight(&own(flight), FULL_RATE)?.flying_and_resting(&FLIGHTS)?;
        let mut params = Params::defaults();
        for (name, value) in [("REC_MODE", 1.0), ("REC_BEFORE", BEFORE_S as f32), ("REC_AFTER", 0.0)] {
            params.set(name, value).map_err(|error| anyhow::anyhow!("{name}: {error:?}"))?;
        }
        let done = power_on(
            &card.device(hums::card::Faults::default())?,
            &params,
            1,
            &mut std::io::sink(),
            stream.chunks(),
            |_| Ok(()),
        )?;
        ensure!(done.stats.frames_lost == 0, "frames were lost");
        let files = on_card(&card.path()).iter().map(files_of).collect::<Result<Vec<_>>>()?.concat();
        let dir = tempfile::tempdir()?;
        let mut subject = Self { dir, files: files.into_iter().collect(), logs: Vec::new() };
        let (worst, logs, _) = subject.read(&subject.files)?;
        ensure!(
            worst == Verdict::Holds && logs.len() >= FLIGHTS.len(),
            "before any damage: {worst:?}, {} logs",
            logs.len()
        );
        subject.logs = logs;
        Ok(subject)
    }

    /// What `verify` says of these files, what each log gives, and up to when the last one is proved.
    fn read(&self, files: &Files) -> Result<(Verdict, Vec<Vec<Frame>>, Option<u64>)> {
        let folder = self.dir.path().join("card");
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir(&folder)?;
        for (name, bytes) in files {
            fs::write(folder.join(name), bytes)?;
        }
        let found = find_in(&folder, false)?;
        let (mut worst, mut proved, mut counted) = (Verdict::Holds, None, Vec::new());
        verify_each(&found, |overview: &Overview| {
            worst = worst.max(verdict(overview));
            counted.push(overview.ending.is_counted());
            proved = match overview.ending.proof {
                Proof::Mark(at, _) => Some(at.as_millis()),
                _ => None,
            };
            Ok(())
        })?;
        let logs = found.logs.iter().zip(counted).filter(|(_, counted)| *counted);
        let logs = logs.map(|(log, _)| Ok(Record::of(log)?.frames)).collect::<Result<_>>()?;
        Ok((worst, logs, proved))
    }

    /// So many damages, of all kinds in turn; the misses in words.
    fn damage_often(&self, count: u64, seed: u64) -> (Vec<Tally>, Vec<String>) {
        let mut random = Random::new(seed);
        let (mut tallies, mut misses) = (vec![Tally::default(); Kind::ALL.len()], Vec::new());
        for index in 0..count {
            let place = index as usize % tallies.len();
            let Some((files, what)) = self.damage(Kind::ALL[place], &mut random) else { continue };
            let tally = &mut tallies[place];
            tally.damages += 1;
            if let Err(error) = self.judge(&files, Kind::ALL[place], tally) {
                tally.missed += 1;
                misses.push(format!("{}: {what}: {error:#}", Kind::ALL[place].name()));
            }
        }
        (tallies, misses)
    }

    /// The files with this damage, and where it is; `None` where it would change nothing.
    fn damage(&self, kind: Kind, random: &mut Random) -> Option<(Files, String)> {
        let names: Vec<&String> = self.files.keys().collect();
        let mut pick = || names[random.below(names.len() as u64) as usize].clone();
        let (one, two) = (pick(), pick());
        let mut files = self.files.clone();
        let mut what = format!("{one}, {two}");
        match kind {
            Kind::FileGone => drop(files.remove(&one)),
            Kind::LogGone => files.retain(|name, _| name[..5] != one[..5]),
            Kind::Exchanged => {
                let (first, second) = (files[&one].clone(), files[&two].clone());
                files.insert(one, second);
                files.insert(two, first);
            }
            Kind::Renumbered | Kind::Elsewhere | Kind::Copied => {
                let segment = format!("{:02}", random.below(60));
                let log = format!("{:05}", 1 + random.below(self.logs.len() as u64 + 3));
                let name = if kind == Kind::Elsewhere {
                    format!("{log}_{}", if random.chance(0.5) { "00" } else { &one[6..8] })
                } else {
                    format!("{}_{segment}", &one[..5])
                };
                let bytes = files[&one].clone();
                if kind != Kind::Copied {
                    files.remove(&one);
                }
                what = format!("{one} as {name}");
                files.insert(format!("{name}.HUM"), bytes);
            }
            Kind::Joined => {
                // Behind all of a log: within it nobody knows what follows.
                let one =
                    names.iter().rev().find(|name| name[..5] == one[..5]).map_or(one, |last| (*last).clone());
                what = format!("{two} behind {one}");
                let behind = files[&two].clone();
                let space = random.below(2) as usize * random.below(64) as usize * BLOCK;
                let all = files.get_mut(&one)?;
                all.resize(all.len() + space, 0);
                all.extend(behind);
            }
            Kind::Erased | Kind::PageCopied | Kind::PageTwice => {
                let bytes = files.get_mut(&one)?;
                what = format!("{one}: {}", page(kind, bytes, random));
            }
        }
        (files != self.files).then_some((files, what))
    }

    fn judge(&self, files: &Files, kind: Kind, tally: &mut Tally) -> Result<()> {
        let (verdict, logs, proved) = self.read(files)?;
        let given: Vec<Frame> = logs.iter().flatten().copied().collect();
        let all = self.logs.concat();
        tally.lost_max = tally.lost_max.max(all.len().saturating_sub(given.len()) as u64);
        if kind == Kind::Joined {
            ensure!(
                given.len() <= all.len(),
                "{} frames are given out, and there are {}",
                given.len(),
                all.len()
            );
        }
        if verdict == Verdict::NotProved {
            tally.noticed += 1;
            return Ok(());
        }
        let mut rest = given.iter().peekable();
        for (index, log) in self.logs.iter().enumerate() {
            let missing: Vec<bool> = log.iter().map(|frame| rest.next_if_eq(&frame).is_none()).collect();
            let lost = missing.iter().filter(|missing| **missing).count();
            let are_gone = |others: &[Vec<Frame>]| {
                others.iter().all(|other| other.last().is_none_or(|last| !given.contains(last)))
            };
            let is_last = are_gone(&self.logs[index + 1..]);
            if lost == log.len() {
                ensure!(
                    is_last || are_gone(&self.logs[..index]),
                    "log {} is gone, and nothing says so",
                    index + 1
                );
            } else if lost > 0 {
                let at_end = missing.iter().rev().take_while(|missing| **missing).count() == lost;
                let at_begin = missing.iter().take_while(|missing| **missing).count() == lost;
                let kept_ms =
                    log.last().zip(log.get(lost)).map_or(0, |(last, first)| last.at_ms - first.at_ms);
                let is_told = match proved {
                    Some(to) if at_end && is_last => log[log.len() - lost].at_ms >= to,
                    _ => at_begin && kept_ms >= u64::from(BEFORE_S) * 1000,
                };
                ensure!(is_told, "{lost} frames of log {} are missing, and nothing says so", index + 1);
            }
        }
        ensure!(rest.next().is_none(), "a frame came out that never went in, twice or out of its order");
        tally.told += 1;
        Ok(())
    }
}

/// A page of a file goes wrong; which, in words.
fn page(kind: Kind, bytes: &mut Vec<u8>, random: &mut Random) -> String {
    let sectors = bytes.len() / BLOCK;
    let length = [1, 8, PAGE_SECTORS][random.below(3) as usize].min(sectors);
    let [one, two] = [(); 2].map(|()| random.below((sectors - length + 1) as u64) as usize);
    let copy = bytes[one * BLOCK..(one + length) * BLOCK].to_vec();
    match kind {
        Kind::PageCopied => bytes[two * BLOCK..][..copy.len()].copy_from_slice(&copy),
        Kind::PageTwice => drop(bytes.splice(two * BLOCK..two * BLOCK, copy)),
        _ => bytes[one * BLOCK..][..length * BLOCK].fill(if random.chance(0.5) { 0xff } else { 0 }),
    }
    format!("{length} of {sectors} sectors from {one} on, {two}")
}

/// The files of a log as they are on the card, without what is set aside behind the last sector.
fn files_of(log: &Log) -> Result<Vec<(String, Vec<u8>)>> {
    let of = |(file, piece): (&String, &hums::logs::Piece)| {
        let one = Log { pieces: vec![piece.clone()], ..log.clone() };
        let (mut blocks, mut bytes, mut end, mut base) = (one.blocks(), Vec::new(), 0, None);
        while let Some(block) = blocks.next_block()? {
            let at = (bytes.len() / BLOCK) as u32;
            bytes.extend_from_slice(block);
            // What the file held before lies in another order.
            if let Ok(header) = Header::read(block)
                && *base.get_or_insert(header.number) + at == header.number
            {
                end = bytes.len();
            }
        }
        bytes.truncate(end);
        let name = Path::new(file).file_name().map(PathBuf::from).context("a name")?;
        Ok((name.display().to_string(), bytes))
    };
    log.files.iter().zip(&log.pieces).map(of).collect()
}
