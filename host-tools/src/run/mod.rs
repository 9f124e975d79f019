//! `hums sim`: a recording goes in at the UART and comes out on a card.
//!
//! Two machines get the same bytes at the same times ([`arrivals`]) and report alike ([`report`]): [`sim`] runs the
//! tasks on this PC, `emulate` the image on its chip's model.

pub mod arrivals;
mod earlier;
mod emulate;
pub mod ground;
mod paths;
pub mod report;
mod salt;
pub mod sim;
mod store;

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use hums_core::parameters::ParamSpec;

use crate::card::image;
use crate::card::{Faults, SimCard};
use crate::cli::{Sim, Speed};
use crate::endpoint::Endpoint;
use crate::files::Inputs;
use crate::interrupt;
use crate::outcome::{Outcome, usage};
use crate::params;
use crate::source::Chunk;
use arrivals::Arrivals;
use earlier::EarlierSessions;
use ground::Ground;
use report::RunReport;
use store::FileFlash;

/// Step in real time, while nothing arrives.
const STEP: Duration = Duration::from_millis(20);

/// A machine that receives the bytes.
pub trait Machine {
    /// Bytes at the chunk's time. `false`: the run is over (power went).
    fn arrive(&mut self, chunk: &Chunk) -> Result<bool>;

    /// Bytes of the ground station.
    fn hear(&mut self, chunk: &Chunk) -> Result<bool>;
}

fn drive(
    arrivals: &mut Arrivals,
    ground: &mut Ground,
    speed: Speed,
    live: bool,
    start: Instant,
    machine: &mut impl Machine,
) -> Result<bool> {
    let pace = speed == Speed::Real && !live;
    if pace {
        interrupt::watch();
    }
    let mut now_us = 0;
    while let Some(chunk) = arrivals.next_arrival()? {
        let due = Duration::from_micros(chunk.at_us);
        while pace && !interrupt::requested() {
            let elapsed = start.elapsed();
            if elapsed >= due {
                break;
            }
            std::thread::sleep(STEP.min(due.saturating_sub(elapsed)));
            now_us =
                chunk.at_us.min(u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)).max(now_us);
            if !hear(ground, now_us, machine)? {
                arrivals.put_back(chunk);
                return Ok(false);
            }
            if !machine.arrive(&Chunk { at_us: now_us, bytes: Vec::new() })? {
                arrivals.put_back(chunk);
                return Ok(false);
            }
        }
        if pace && interrupt::requested() {
            arrivals.break_off();
            return Ok(true);
        }
        now_us = chunk.at_us;
        if !hear(ground, now_us, machine)? || !machine.arrive(&chunk)? {
            arrivals.put_back(chunk);
            return Ok(false);
        }
    }
    Ok(true)
}

/// Sent by now.
fn hear(ground: &mut Ground, now_us: u64, machine: &mut impl Machine) -> Result<bool> {
    while let Some(chunk) = ground.until(now_us)? {
        if !machine.hear(&chunk)? {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether the input is live.
fn pace(run: &Sim) -> Result<(Speed, bool)> {
    let live = run.input.is_live();
    match run.speed {
        Some(Speed::Max) if live => {
            Err(usage(format!("--speed max: {} comes in its own time; leave --speed out", run.input)))
        }
        Some(speed) => Ok((speed, live)),
        None => Ok((if live { Speed::Real } else { Speed::Max }, live)),
    }
}

/// Makes a missing one.
fn prepare_card(path: &Path, size_mib: Option<u64>, seed: u64) -> Result<File> {
    let context = || format!("{}: cannot be formatted", path.display());
    let file = image::open_or_make(path, size_mib, |file| {
        let card =
            SimCard::new(file.try_clone().with_context(context)?, Faults::default()).with_context(context)?;
        // Repeatable to the byte.
        let volume_id = (seed as u32).wrapping_mul(0x9e37_79b9) ^ 0x4855_4d53;
        hums_recorder::format::format(&card, volume_id).map_err(|error| {
            let why = card.take_image_error().map_or_else(|| format!("{error:?}"), |error| error.to_string());
            anyhow::anyhow!("{}: {why}", context())
        })
    })?;
    // Shows the recorder's reaction.
    if let Some(words) = image::check(&file, path)? {
        note!("{}: {words}", path.display());
    }
    Ok(file)
}

/// A run before the first byte: all is open.
struct Prepared {
    speed: Speed,
    live: bool,
    arrivals: Arrivals,
    card: File,
    flash: FileFlash,
    earlier: EarlierSessions,
    ground: Ground,
    gs: Box<dyn Write + Send>,
    entropy: u32,
}

/// Refused before anything is opened.
type Request = (Inputs, Vec<(&'static ParamSpec, f32)>);

fn check_request(run: &Sim) -> Result<Request> {
    let inputs = paths::inputs(run)?;
    if run.costs && run.firmware.is_none() {
        return Err(usage("--costs measures a firmware image: give one with --firmware"));
    }
    Ok((inputs, params::read(run.params.as_deref())?))
}

fn prepare(run: &Sim, (inputs, params): &Request, unknown: u64) -> Result<Prepared> {
    let (speed, live) = pace(run)?;
    let (mut arrivals, (card, flash)) = Arrivals::open(run, inputs, || {
        run.store.as_deref().map_or(Ok(()), store::check)?;
        let card = prepare_card(&run.sd, run.faults.card_size, run.faults.seed)?;
        Ok((card, store::open(run.store.as_deref(), params)?))
    })?;
    let earlier = EarlierSessions::of(run, unknown)?;
    let (ground, gs) = ground::open(run, inputs)?;
    let entropy = salt::salt(run, &mut arrivals)?;
    Ok(Prepared { speed, live, arrivals, card, flash, earlier, ground, gs, entropy })
}

/// Remarks and the report.
fn finish(run: &Sim, arrivals: &Arrivals, ground: &Ground, report: &RunReport) -> Result<Outcome> {
    let beside = ground.finish().and(arrivals.finish());
    for remark in arrivals.remark().into_iter().chain(report.remark(&run.input)) {
        note!("{remark}");
    }
    let outcome = report.print(run.json, run.gs == Some(Endpoint::Standard))?;
    Ok(outcome.and(beside).and(Outcome::lossy(arrivals.is_damaged())))
}

fn check_store(run: &Sim, flash: &FileFlash) -> Result<()> {
    match (flash.take_error(), &run.store) {
        (Some(error), Some(store)) => bail!("--store {}: {error}", store.display()),
        _ => Ok(()),
    }
}

fn check_standard_output(run: &Sim) -> Result<()> {
    if run.gs == Some(Endpoint::Standard) && run.json {
        return Err(usage("--gs - and --json both want standard output; give --gs a file"));
    }
    Ok(())
}
