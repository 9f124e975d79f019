//! The card answers nothing for 2.5 s while a line at 921,600 baud delivers frames back to back.

use anyhow::{Context as _, Result, ensure};
use hums::card::Faults;
use hums::card::faults::Stall;
use hums::run::sim::power_on;
use hums_core::params::Params;
use rayon::prelude::*;

use super::card::Card;
use super::stream::{FULL_RATE, Stream};
use super::{Figures, Options};
use crate::flights::{OWN, more, own};

/// When the card stops answering, in seconds, and for how long.
const STALL_AT_S: u64 = 5;
const STALL_MS: u64 = 2_500;
/// What is recorded at least, in seconds: a recording that is shorter comes again from its beginning.
const SECONDS_MIN: f64 = 12.0;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let own = OWN.into_iter().map(own);
    let paths: Vec<_> = if options.short { own.collect() } else { own.chain(more()).collect() };
    let outcomes = paths.par_iter().with_max_len(1).map(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stream = Stream::of_flight(path, FULL_RATE)?;
        let stream = stream.for_seconds(stream.seconds().max(SECONDS_MIN));
        let stall = Stall { from_us: STALL_AT_S * 1_000_000, for_us: STALL_MS * 1_000 };
        let card = Card::new(256)?;
        let device = card.device(Faults { stalls: vec![stall], ..Faults::default() })?;
        let done =
            power_on(&device, &Params::defaults(), 1, stream.chunks(), |_| Ok(())).context(name.clone())?;
        let stats = done.stats;
        // The write that meets it comes a little after it has begun.
        ensure!(stats.sd_stall_ms_max >= STALL_MS - 250, "{name}: the card never stood still");
        ensure!(
            stream.is_signed || stats.frames_lost + done.frames_left == 0,
            "{name}: {} frames lost, queue {} of {} bytes",
            stats.frames_lost,
            stats.queue_bytes_max,
            stats.queue_bytes_capacity
        );
        Ok((name, stream, stats))
    });
    let outcomes = outcomes.collect::<Result<Vec<_>>>()?;
    let mut figures = Figures::default();
    let unsigned: Vec<_> = outcomes.iter().filter(|(_, stream, _)| !stream.is_signed).collect();
    figures.fact("unsigned recordings", unsigned.len());
    figures.fact("frames", unsigned.iter().map(|(.., stats)| stats.frames_in).sum::<u64>());
    figures.fact("frames lost", unsigned.iter().map(|(.., stats)| stats.frames_lost).sum::<u64>());
    figures.head =
        ["recording", "seconds", "frames", "lost", "queue at most", "of"].map(str::to_owned).into();
    for (name, stream, stats) in &outcomes {
        figures.row([
            if stream.is_signed { format!("{name} (signed)") } else { name.clone() },
            format!("{:.1}", stream.seconds()),
            stats.frames_in.to_string(),
            stats.frames_lost.to_string(),
            stats.queue_bytes_max.to_string(),
            stats.queue_bytes_capacity.to_string(),
        ]);
    }
    Ok(figures)
}
