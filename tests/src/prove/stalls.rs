//! The card answers nothing for 2.5 s while a line at 921,600 baud delivers frames back to back: the repository's recordings, and
//! in the long form those below `HUMS_FLIGHTS`.

use anyhow::{Context as _, Result, ensure};
use hums::card::Faults;
use hums::card::faults::Stall;
use hums::run::sim::both_ports::power_on;
use hums_blackbox::record::Stats;
use rayon::prelude::*;

use super::card::Card;
use super::figures::Figures;
use super::options::Options;
use super::stream::{FULL_RATE, Stream};
use crate::flights::{OWN, more, own};

/// Seconds: the first for the short form, all for the long one.
const STALLS_AT_S: [u64; 7] = [5, 2, 3, 4, 6, 7, 8];
const STALL_MS: u64 = 2_500;
/// Seconds; shorter recordings are repeated.
const SECONDS_MIN: f64 = 12.0;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let further = if options.short { Vec::new() } else { more() };
    let paths: Vec<_> = OWN.into_iter().map(own).chain(further).collect();
    let moments = if options.short { &STALLS_AT_S[..1] } else { &STALLS_AT_S };
    let outcomes = paths.par_iter().with_max_len(1).map(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stream = Stream::of_flight(path, FULL_RATE)?;
        let stream = stream.for_seconds(stream.seconds().max(SECONDS_MIN));
        let all =
            moments.iter().map(|at_s| stall(&stream, *at_s).with_context(|| format!("{name}, at {at_s} s")));
        let all = all.collect::<Result<Vec<Stats>>>()?;
        let worst = all.into_iter().max_by_key(|stats| (stats.frames_lost, stats.queue_bytes_max));
        Ok((name, stream, worst.context("no stall")?))
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let is_lossy = |(_, stream, stats): &&(String, Stream, Stats)| !stream.is_signed && stats.frames_lost > 0;
    let lossy: Vec<_> =
        outcomes.iter().filter(is_lossy).map(|(name, _, stats)| (name, stats.frames_lost)).collect();
    ensure!(lossy.is_empty(), "frames lost of {} of {} recordings: {lossy:?}", lossy.len(), outcomes.len());
    let mut figures =
        Figures::with(&["recording", "seconds", "frames", "lost, at most", "queue, at most", "queue size"]);
    let unsigned: Vec<_> = outcomes.iter().filter(|(_, stream, _)| !stream.is_signed).collect();
    figures.fact("unsigned recordings", unsigned.len());
    figures.fact("one stall of 2.5 s a run, from second", seconds_of(moments));
    figures.fact("frames", unsigned.iter().map(|(.., stats)| stats.frames_in).sum::<u64>());
    figures.fact("frames lost", unsigned.iter().map(|(.., stats)| stats.frames_lost).sum::<u64>());
    for (name, stream, stats) in &outcomes {
        let name = if stream.is_signed { format!("{name} (signed)") } else { name.clone() };
        let seconds = format!("{:.1}", stream.seconds());
        let (lost, queued, size) = (stats.frames_lost, stats.queue_bytes_max, stats.queue_bytes_capacity);
        figures.row(&[&name, &seconds, &stats.frames_in, &lost, &queued, &size]);
    }
    Ok(figures)
}

fn seconds_of(moments: &[u64]) -> String {
    let mut moments = moments.to_vec();
    moments.sort_unstable();
    moments.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// The card stalls once.
fn stall(stream: &Stream, at_s: u64) -> Result<Stats> {
    let stall = Stall { from_us: at_s * 1_000_000, for_us: STALL_MS * 1_000 };
    let card = Card::new(256)?;
    let device = card.device(Faults { stalls: vec![stall], ..Faults::default() })?;
    let done = power_on(&device, 1, stream.chunks())?;
    let stats = done.stats;
    // The write begins a little before it.
    ensure!(stats.sd_stall_ms_max >= STALL_MS - 250, "the card never stood still");
    ensure!(done.frames_left == 0, "{} frames are left", done.frames_left);
    Ok(stats)
}
