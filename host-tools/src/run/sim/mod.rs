//! `hums sim`: the firmware's tasks in virtual time.
//!
//! Time jumps from event to event. At equal times the more urgent goes first: reception and monitor, downlink, storage. Only
//! the card takes time ([`crate::card::sim`]): meanwhile everything else goes on.
//!
//! Power-on is the moment of the first input byte.

pub mod both_ports;
mod outside;
mod pipeline;

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::Instant as WallClock;

use anyhow::{Context, Result, bail};
use hums_blackbox::record::{Boot, Stats};
use hums_core::parameters::Params;
use hums_onboard::ResetCause;
use hums_recorder::status::CardReading;
use outside::{Memory, Outside, Slot};
use pipeline::Pipeline;

use super::arrivals::Arrivals;
use super::earlier::EarlierSessions;
use super::ground::Ground;
use super::report::{FINDINGS_MAX, RunReport};
use super::store::FileFlash;
use super::{Prepared, check_request, check_standard_output, check_store, drive, emulate, finish, prepare};
use crate::card::image::is_card;
use crate::card::{Faults, SimCard};
use crate::cli;
use crate::outcome::Outcome;

/// Runs `hums sim`.
pub fn run(run: &cli::Sim) -> Result<Outcome> {
    if let Some(image) = &run.firmware {
        return emulate::run(run, image);
    }
    check_standard_output(run)?;
    // The recorder keeps earlier sessions.
    let prepared = prepare(run, &check_request(run)?, 0)?;
    let Prepared { speed, live, mut arrivals, card: image, flash, earlier, mut ground, gs, entropy } =
        prepared;
    if let Some(step) = run.faults.cut_store_after {
        flash.cut_after(step, run.faults.seed);
    }
    let card = card(image, &run.faults)
        .with_context(|| format!("{}: cannot be read as a card; name another image", run.sd.display()))?;
    let card = card.keeping_logs(!run.overwrite_oldest);
    let mut world = World {
        card: &card,
        flash: &flash,
        gs,
        autopilot: arrivals.take_autopilot(),
        report: RunReport::default(),
        reboots: run.faults.reboot_at_us.clone(),
        boots: 0,
        entropy,
        power_on_us: 0,
        frames_on_card: true,
        overwritten: false,
    };
    world.reboots.sort_unstable();
    let start = WallClock::now();
    while world.power_on(&mut arrivals, &mut ground, |arrivals, ground, machine| {
        drive(arrivals, ground, speed, live, start, machine)
    })? {}
    if let Some(error) = card.take_image_error() {
        bail!("{}: {error}", run.sd.display());
    }
    check_store(run, &flash)?;
    let report = world.settle(&run.sd, &earlier)?;
    finish(run, &arrivals, &ground, &report)
}

fn card(image: File, flags: &cli::FaultFlags) -> std::io::Result<SimCard> {
    let faults = Faults {
        cuts: flags.cut_after_writes.clone(),
        stalls: flags.stall.clone(),
        outs: flags.card_out.clone(),
        write_error: flags.write_error.unwrap_or(0.0),
        seed: flags.seed,
        keeps_table: is_card(&image)?,
    };
    SimCard::new(image, faults)
}

/// A power-on's result.
#[derive(Clone, Copy, Debug)]
pub struct PowerOn {
    /// The pipeline's figures.
    pub stats: Stats,
    /// Frames that were still in memory when it ended.
    pub frames_left: u64,
    /// The state of the card, by storage.
    pub card: CardReading,
}

fn identity(boots: u32) -> Boot<'static> {
    Boot {
        version: env!("CARGO_PKG_VERSION"),
        board: "sim",
        reset_name: ResetCause::PowerOn.name(),
        boots,
        ..Boot::default()
    }
}

struct World<'a> {
    card: &'a SimCard,
    flash: &'a FileFlash,
    gs: Box<dyn Write + Send>,
    autopilot: Box<dyn Write + Send>,
    report: RunReport,
    /// When our own power goes for a moment, sorted.
    reboots: Vec<u64>,
    boots: u32,
    entropy: u32,
    power_on_us: u64,
    /// Every power-on ended in order, with an empty queue.
    frames_on_card: bool,
    /// Segments of this run may be among them.
    overwritten: bool,
}

impl World<'_> {
    /// Whether another one follows.
    fn power_on(
        &mut self,
        arrivals: &mut Arrivals,
        ground: &mut Ground,
        drive: impl FnOnce(&mut Arrivals, &mut Ground, &mut Pipeline<'_, '_>) -> Result<bool>,
    ) -> Result<bool> {
        self.boots += 1;
        let mut memory = Memory::new(&Params::defaults());
        let RunReport { findings, findings_left_out, .. } = &mut self.report;
        let mut keep = |finding| {
            if findings.len() < FINDINGS_MAX {
                findings.push(finding);
            } else {
                *findings_left_out += 1;
            }
        };
        let outside = Outside {
            slot: &Slot { card: self.card, power_on_us: self.power_on_us },
            flash: self.flash,
            gs: &mut *self.gs,
            autopilot: &mut *self.autopilot,
            findings: &mut keep,
            reboot_at_us: self.reboots.first().copied(),
        };
        let mut pipeline =
            Pipeline::new(outside, &mut memory, identity(self.boots), self.entropy.wrapping_add(self.boots));
        pipeline.start()?;
        let ended = drive(arrivals, ground, &mut pipeline)?;
        let mut lost = 0;
        if ended {
            lost = pipeline.finish()?;
        }
        let stats = pipeline.stats();
        self.overwritten |= pipeline.has_overwritten();
        self.report.card_full |= pipeline.is_full();
        self.add(&stats, lost);
        let cut = self.card.is_dead() || self.flash.is_dead();
        self.report.power_cut |= cut;
        // Only the card shows how much of it is there.
        self.frames_on_card &= ended && !cut && lost == 0;
        if ended || cut {
            return Ok(false);
        }
        self.power_on_us = self.reboots.remove(0);
        Ok(true)
    }

    fn add(&mut self, stats: &Stats, lost: u64) {
        let report = &mut self.report;
        report.frames_in += stats.frames_in;
        report.frames_logged += stats.frames_logged.saturating_sub(lost);
        report.frames_lost += stats.frames_lost + lost;
        report.bytes_in += stats.bytes_in;
        report.bytes_not_frames += stats.bytes_not_frames;
        report.bytes_logged += stats.bytes_logged;
        report.queue_bytes_max = report.queue_bytes_max.max(stats.queue_bytes_max);
        report.queue_bytes_capacity = stats.queue_bytes_capacity;
        report.sd_stall_ms_max = report.sd_stall_ms_max.max(stats.sd_stall_ms_max);
        report.gs_frames += stats.gs_frames;
        report.gs_bytes += stats.gs_bytes;
    }

    fn settle(self, card: &Path, earlier: &EarlierSessions) -> Result<RunReport> {
        let mut report = self.report;
        report.blocks_written = self.card.writes();
        let findings = std::mem::take(&mut report.findings);
        let (frames, _) = report.read_card(card, earlier)?;
        // Also those that the card did not take.
        report.findings = findings;
        // Only the card shows which were saved; the first frames may be overwritten.
        if self.overwritten || !self.frames_on_card {
            report.frames_logged = frames.min(report.frames_in);
            report.frames_lost = report.frames_in - report.frames_logged;
        }
        Ok(report)
    }
}
