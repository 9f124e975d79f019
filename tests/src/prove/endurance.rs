//! A day on a small card.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use hums::card::Faults;
use hums::logs::on_card;
use hums::run::sim::both_ports::power_on;
use hums::source::Chunk;

use super::card::Card;
use super::figures::Figures;
use super::memory::held_bytes;
use super::options::Options;
use super::record::Record;
use super::stream::Stream;
use crate::flights::{OWN, own};

/// 20 kB/s.
const BAUD: u64 = 200_000;

struct Form {
    card_mib: u64,
    seconds: u64,
    looks: u64,
    flights: &'static [&'static str],
}

const LONG: Form = Form { card_mib: 64, seconds: 24 * 3600, looks: 24, flights: &OWN };
/// The smallest card and the least compressible flight: full after an hour and a half.
const SHORT: Form = Form { card_mib: 34, seconds: 6_500, looks: 4, flights: &["px4_hil_quad_low.tlog"] };
/// Milliseconds, at any moment.
const BEHIND_MS_MAX: u64 = 200;
/// One segment of sixteen is being overwritten, and the file system takes some.
const KEPT_MIN: f64 = 0.8;
/// Bytes since the second look: the list of looks, a file's name.
const GROWTH_BYTES_MAX: usize = 64 << 10;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let form = if options.short { &SHORT } else { &LONG };
    let (seconds, looks) = (options.runs(form.seconds, form.seconds), form.looks);
    let open = |flight: &&str| Stream::of_flight(&own(flight), BAUD);
    let streams = form.flights.iter().map(open).collect::<Result<Vec<_>>>()?;
    let mut card = Card::new(form.card_mib)?;
    let device = card.device(Faults::default())?;
    let mut seen = Vec::new();
    let path = card.path();
    let chunks = Day::new(&streams, seconds).inspect(|chunk| {
        if chunk.at_us >= (seen.len() as u64 + 1) * seconds * 1_000_000 / looks {
            let about = look(&path, form, chunk.at_us);
            seen.push(about.with_context(|| format!("after {} s", chunk.at_us / 1_000_000)));
        }
    });
    let done = power_on(&device, 1, chunks)?;
    let seen = seen.into_iter().collect::<Result<Vec<_>>>()?;
    card.check()?;
    let last = look(&path, form, seconds * 1_000_000).context("at the end")?;
    ensure!(done.stats.frames_lost == 0, "{} frames lost", done.stats.frames_lost);
    ensure!(done.card.segments_overwritten > 0, "the card never became full");
    // Data cached for later readings is there by then.
    let early = seen.get(1).context("looked too rarely")?.held_bytes;
    let late = seen.iter().skip(2).map(|about| about.held_bytes).max().unwrap_or(early);
    ensure!(late <= early + GROWTH_BYTES_MAX, "memory grew from {early} to {late} bytes");

    let mut figures = Figures::default();
    figures.fact("simulated hours", format!("{:.1}", seconds as f64 / 3600.0));
    figures.fact("frames", done.stats.frames_in);
    figures.fact("frames lost", done.stats.frames_lost);
    figures.fact("MAVLink, MB", done.stats.bytes_in / 1_000_000);
    figures.fact("log, MB", done.stats.bytes_logged / 1_000_000);
    figures.fact("segments", done.card.segments);
    figures.fact("segments that replaced an older one", done.card.segments_overwritten);
    figures.fact(
        "block writes of the log, commands",
        format!("{}, {}", done.card.blocks_written, done.card.writes),
    );
    figures.fact("inspections of the card", seen.len() + 1);
    figures.fact("newest data on the card, minutes, at least", {
        let kept = seen.iter().filter(|about| about.is_full).chain([&last]);
        kept.map(|about| about.kept_ms / 60_000).min().unwrap_or(0)
    });
    figures.fact(
        "delay from line to card, ms, at most",
        seen.iter().map(|about| about.behind_ms).max().unwrap_or(0),
    );
    figures.fact("bytes allocated at the second inspection, and at most later", format!("{early}, {late}"));
    figures.fact("`fsck.vfat -n` at the end", "clean");
    Ok(figures)
}

struct Day<'a> {
    streams: &'a [Stream],
    next: usize,
    chunks: Box<dyn Iterator<Item = Chunk> + 'a>,
    begin_us: u64,
    last_us: u64,
    end_us: u64,
}

impl<'a> Day<'a> {
    fn new(streams: &'a [Stream], seconds: u64) -> Self {
        let chunks = Box::new(std::iter::empty());
        Self { streams, next: 0, chunks, begin_us: 0, last_us: 0, end_us: seconds * 1_000_000 }
    }
}

impl Iterator for Day<'_> {
    type Item = Chunk;

    fn next(&mut self) -> Option<Chunk> {
        let chunk = loop {
            if let Some(chunk) = self.chunks.next() {
                break chunk;
            }
            self.begin_us = self.last_us;
            self.chunks = Box::new(self.streams.get(self.next % self.streams.len())?.chunks());
            self.next += 1;
        };
        self.last_us = self.begin_us + chunk.at_us;
        (self.last_us < self.end_us).then_some(Chunk { at_us: self.last_us, ..chunk })
    }
}

struct About {
    kept_ms: u64,
    behind_ms: u64,
    is_full: bool,
    held_bytes: usize,
}

fn look(path: &Path, form: &Form, now_us: u64) -> Result<About> {
    let held_bytes = held_bytes().context("this program does not count what it allocates")?;
    let logs = on_card(path);
    let log = logs.last().context("no log")?;
    let record = Record::of(log)?;
    let holes: Vec<_> = record.gaps.iter().filter(|(_, gap)| gap.from.is_some()).collect();
    ensure!(holes.is_empty(), "holes: {holes:?}");
    let is_full = !record.gaps.is_empty();
    let (first, last) =
        (record.frames.first().context("no frames")?, record.frames.last().context("no frames")?);
    let behind_ms = (now_us / 1000).saturating_sub(last.at_ms);
    ensure!(behind_ms <= BEHIND_MS_MAX, "the log is {behind_ms} ms behind");
    let kept = record.summary.blocks.sectors as f64 * 512.0 / (form.card_mib << 20) as f64;
    ensure!(!is_full || kept >= KEPT_MIN, "only {kept:.2} of the card holds the newest data");
    Ok(About { kept_ms: last.at_ms - first.at_ms, behind_ms, is_full, held_bytes })
}
