//! Damaged bytes on the line.

use anyhow::{Result, ensure};
use hums::logs::on_card;
use rayon::prelude::*;

use super::card::Card;
use super::figures::Figures;
use super::options::Options;
use super::record::Record;
use super::stream::{Stream, hash};
use crate::damage;
use crate::flights::{OWN, own};

const PROBABILITIES: [f64; 5] = [0.000_01, 0.000_1, 0.001, 0.003, 0.01];
/// Far below the recorder's limit: only the noise matters.
const BAUD: u64 = 230_400;
/// Whole frames under one false frame of 280 bytes: none is shorter than 17 with its header.
const HIDDEN_MAX: usize = 16;
/// Two causes, each with a chance of 1 in 65,536: a damaged frame whose checksum fits, and a damaged header that
/// makes a candidate within a frame.
const INVENTED_MAX: f64 = 1.0 / 2_000.0;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let rounds = options.runs(8, 1);
    let seconds = if options.short { 10.0 } else { 60.0 };
    let cases: Vec<_> = OWN
        .into_iter()
        .flat_map(|flight| PROBABILITIES.map(|probability| (flight, probability)))
        .flat_map(|(flight, probability)| (0..rounds).map(move |round| (flight, probability, round)))
        .collect();
    let outcomes = cases.par_iter().with_max_len(1).map(|(flight, probability, round)| {
        let stream = Stream::of_flight(&own(flight), BAUD)?.for_seconds(seconds);
        let seed = options
            .seed
            .wrapping_add(*round)
            .wrapping_mul(1_000_003)
            .wrapping_add((probability * 1e6) as u64);
        record(stream, *probability, seed).map(|outcome| (*probability, outcome))
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let mut figures = Figures::with(&[
        "probability for a byte",
        "frames",
        "damaged",
        "undamaged, recorded",
        "undamaged, under a false frame",
        "damaged, checksum fits by chance",
    ]);
    figures.fact("runs", outcomes.len());
    figures.fact("frames", outcomes.iter().map(|(_, one)| one.frames).sum::<u64>());
    figures.fact(
        "undamaged frames that were not recorded",
        outcomes.iter().map(|(_, one)| one.missing).sum::<u64>(),
    );
    for probability in PROBABILITIES {
        let of = |figure: fn(&Outcome) -> u64| {
            let these = outcomes.iter().filter(|(this, _)| this.to_bits() == probability.to_bits());
            these.map(|(_, one)| figure(one)).sum::<u64>()
        };
        let (damaged, recorded) = (of(|one| one.frames - one.whole), of(|one| one.whole - one.missing));
        let [frames, missing, invented] =
            [of(|one| one.frames), of(|one| one.missing), of(|one| one.invented)];
        figures.row(&[&probability, &frames, &damaged, &recorded, &missing, &invented]);
    }
    Ok(figures)
}

struct Outcome {
    frames: u64,
    whole: u64,
    missing: u64,
    invented: u64,
}

fn record(mut stream: Stream, probability: f64, seed: u64) -> Result<Outcome> {
    let clean = stream.bytes.clone();
    damage::noise(&mut stream.bytes, probability, seed);
    let is_whole = |place: &&std::ops::Range<usize>| {
        let covered = place.start..place.start + covered(&clean[(*place).clone()]);
        stream.bytes[covered.clone()] == clean[covered]
    };
    let whole: Vec<u64> =
        stream.frames.iter().filter(is_whole).map(|place| hash(&stream.bytes[place.clone()])).collect();
    let card = Card::new(256)?;
    let done = card.record(&stream, 1)?;
    ensure!(done.stats.frames_lost == 0, "frames were lost: {:?}", done.stats);
    let Some(log) = on_card(&card.path()).pop() else { anyhow::bail!("no log") };
    let record = Record::of(&log)?;
    ensure!(record.gaps.is_empty(), "gaps: {:?}", record.gaps);
    let (missing, invented) = compare(&whole, &record);
    // Only a false frame, valid by chance, hides a whole one.
    ensure!(
        missing <= 3 * invented,
        "{missing} whole frames are missing, {invented} were made up, seed {seed}"
    );
    ensure!(
        invented as f64 <= 3.0 + stream.frames.len() as f64 * INVENTED_MAX,
        "{invented} frames that never went in, seed {seed}"
    );
    let (whole, missing, invented) = (whole.len() as u64, missing as u64, invented as u64);
    Ok(Outcome { frames: stream.frames.len() as u64, whole, missing, invented })
}

/// Missing whole frames, and false ones; both in order.
fn compare(whole: &[u64], record: &Record) -> (usize, usize) {
    let (mut next, mut missing, mut invented) = (0, 0, 0);
    for frame in &record.frames {
        let ahead = whole.get(next..(next + HIDDEN_MAX + 1).min(whole.len())).unwrap_or_default();
        match ahead.iter().position(|hash| *hash == frame.hash) {
            Some(hidden) => {
                missing += hidden;
                next += hidden + 1;
            }
            None => invented += 1,
        }
    }
    (missing + whole.len() - next, invented)
}

/// Checksum included. The signature needs the key.
fn covered(frame: &[u8]) -> usize {
    let is_signed = frame[0] == 0xFD && frame[2] & 1 == 1;
    if is_signed { frame.len() - 13 } else { frame.len() }
}
