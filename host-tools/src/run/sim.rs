//! `hums sim`: the bodies of the firmware's tasks on this PC, in virtual time.
//!
//! A discrete-event simulation: time jumps from one event to the next. At equal times the more urgent task goes first,
//! as on the board: reception and monitor, then the downlink, then storage. Only the card takes time (see
//! [`crate::card::sim`]): while it is busy everything else goes on, and the sector queue fills.
//!
//! Power-on is the moment of the first input byte.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::Instant as WallClock;

use anyhow::{Context, Result, bail};
use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use hums_blackbox::record::{Boot, Stats};
use hums_blackbox::{Header, Writer};
use hums_core::Monitor;
use hums_core::params::{ParamError, Params};
use hums_core::time::{Instant, Span};
use hums_onboard::monitoring::TICK;
use hums_onboard::port::PortReading;
use hums_onboard::queues::{Ends, GS_FRAME_BYTES_MAX, Queues};
use hums_onboard::{Monitoring, PortStatus, Reception, Service, Storage};
use hums_recorder::{CardDevice, CardStatus, HeldBlocks};

use super::arrivals::Arrivals;
use super::report::{Finding, Report};
use super::{Machine, check_standard_output, drive, open_sink, pace, prepare_card};
use crate::card::sim::CardError;
use crate::card::{Faults, SimCard};
use crate::cli;
use crate::endpoint::Endpoint;
use crate::logs;
use crate::outcome::{Outcome, usage};
use crate::source::Chunk;

/// The ground station's port, in baud: a telemetry radio.
const GS_BAUD: u64 = 57_600;
/// A line that is silent for this long will not finish the frame it began.
const SILENCE: Span = Span::from_millis(20);
/// How soon storage looks again after it found no card.
const NO_CARD_RETRY: Span = Span::from_millis(100);
/// How long the end of a run waits for a card that is out, before what waits for it is lost.
const CARD_PATIENCE: Span = Span::from_secs(5);

/// Runs `hums sim`.
pub fn run(args: &cli::Sim) -> Result<Outcome> {
    let run = &args.run;
    check_standard_output(run)?;
    let (speed, live) = pace(run)?;
    let params = read_params(run.params.as_deref())?;
    let (mut arrivals, image) = Arrivals::open(run, args.tap.as_deref(), || {
        prepare_card(&run.sd, run.faults.card_size, run.faults.seed)
    })?;
    let earlier = logs::on_card(&run.sd).len();
    let card = card(image, &run.faults).with_context(|| format!("{}: cannot be used", run.sd.display()))?;
    let mut world = World {
        card: &card,
        gs: open_sink(run.gs.as_ref())?,
        report: Report::default(),
        reboots: run.faults.reboot_at.clone(),
        boots: 0,
        entropy: run.faults.seed as u32,
        power_on_us: 0,
        frames_on_card: true,
        overwritten: false,
    };
    world.reboots.sort_unstable();
    let start = WallClock::now();
    while world
        .power_on(&mut arrivals, &params, |arrivals, machine| drive(arrivals, speed, live, start, machine))?
    {
    }
    if let Some(error) = card.take_image_error() {
        bail!("{}: {error}", run.sd.display());
    }
    world.gs.flush().context("--gs: cannot be written")?;
    if let Some(remark) = arrivals.remark() {
        eprintln!("hums: {remark}");
    }
    let report = world.settle(&run.sd, earlier)?;
    report.print(run.json, run.gs == Some(Endpoint::Standard))
}

fn card(image: File, flags: &cli::FaultFlags) -> std::io::Result<SimCard> {
    let faults = Faults {
        cuts: flags.cut_after_writes.clone(),
        stalls: flags.stall.clone(),
        outs: flags.card_out.clone(),
        write_error: flags.write_error.unwrap_or(0.0),
        seed: flags.seed,
    };
    SimCard::new(image, faults)
}

/// Parameters from a file of `NAME VALUE` lines; commas and tabs separate as well, `#` begins a comment.
fn read_params(path: Option<&Path>) -> Result<Params> {
    let mut params = Params::defaults();
    let Some(path) = path else { return Ok(params) };
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("--params {}: cannot be read", path.display()))?;
    for (index, line) in text.lines().enumerate() {
        let place = format!("--params {}, line {}", path.display(), index + 1);
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
        let Some(name) = words.next() else { continue };
        let value = words.next().and_then(|word| word.parse().ok());
        let (Some(value), None) = (value, words.next()) else {
            return Err(usage(format!("{place}: wants NAME VALUE, for instance CELL_WARN 3.6")));
        };
        match params.set(name, value) {
            Ok(()) => {}
            Err(ParamError::UnknownName) => {
                return Err(usage(format!("{place}: there is no parameter {name}")));
            }
            Err(ParamError::OutOfRange { min, max }) => {
                return Err(usage(format!("{place}: {name} takes {min} to {max}, not {value}")));
            }
        }
    }
    Ok(params)
}

/// What outlives a power-on: the card, the ground station, and what is told at the end.
struct World<'a> {
    card: &'a SimCard,
    gs: Box<dyn Write + Send>,
    report: Report,
    /// When our own power goes for a moment, sorted.
    reboots: Vec<u64>,
    boots: u32,
    entropy: u32,
    power_on_us: u64,
    /// The writer's counts tell what is on the card: every power-on ended in order.
    frames_on_card: bool,
    /// Old segments were overwritten, so that the card no longer holds all that was logged.
    overwritten: bool,
}

impl World<'_> {
    /// One power-on, until the input ends or power goes; whether there is another one after it.
    fn power_on(
        &mut self,
        arrivals: &mut Arrivals,
        params: &Params,
        drive: impl FnOnce(&mut Arrivals, &mut Pipeline<'_, '_>) -> Result<bool>,
    ) -> Result<bool> {
        self.boots += 1;
        let (card_status, port_status) = (CardStatus::new(), PortStatus::new());
        let held = HeldBlocks::new();
        let mut queues = Box::new(Queues::new());
        let mut writer = Box::new(Writer::new());
        let mut monitor = Box::new(Monitor::new(*params));
        let identity = Boot {
            version: env!("CARGO_PKG_VERSION"),
            board: "sim",
            reset_name: "power-on",
            boots: self.boots,
            ..Boot::default()
        };
        let reboot_at = self.reboots.first().copied();
        let entropy = self.entropy.wrapping_add(self.boots);
        let mut pipeline = Pipeline {
            card: self.card,
            slot_status: &card_status,
            ends: queues.split(),
            reception: Reception::new(&port_status),
            monitoring: Monitoring::new(&mut monitor, &mut writer, identity, &card_status, &port_status),
            storage: Storage::new(Slot(self.card), &card_status, &held, entropy),
            gs: &mut *self.gs,
            findings: &mut self.report.findings,
            power_on_us: self.power_on_us,
            reboot_at_us: reboot_at,
            now: Instant::ZERO,
            tick_at: Instant::ZERO + TICK,
            storage_at: Some(Instant::ZERO),
            gs_at: Instant::ZERO,
            silent_at: None,
        };
        pipeline.start()?;
        let ended = drive(arrivals, &mut pipeline)?;
        let mut lost = 0;
        if ended {
            lost = pipeline.finish()?;
        }
        let mut stats = pipeline.stats();
        catch_up(&mut stats, port_status.read());
        self.overwritten |= card_status.read().segments_overwritten > 0;
        self.add(&stats, lost);
        if ended {
            return Ok(false);
        }
        self.frames_on_card = false;
        if self.card.is_dead() {
            self.report.power_cut = true;
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

    /// The report, with what the card itself tells.
    fn settle(self, card: &Path, earlier: usize) -> Result<Report> {
        let mut report = self.report;
        report.blocks_written = self.card.writes();
        let findings = std::mem::take(&mut report.findings);
        let frames = report.read_card(card, earlier)?;
        // What the monitor said at the time, also where the card did not take it.
        report.findings = findings;
        if !self.frames_on_card && !self.overwritten {
            // Power went while frames were in memory: only the card tells which made it.
            report.frames_logged = frames.min(report.frames_in);
            report.frames_lost = report.frames_in - report.frames_logged;
        }
        Ok(report)
    }
}

/// The monitor adds up the port's counters at each tick; power may have gone since the last one.
fn catch_up(stats: &mut Stats, port: PortReading) {
    for (sum, counter) in [
        (&mut stats.frames_in, port.frames),
        (&mut stats.bytes_in, port.bytes),
        (&mut stats.bytes_not_frames, port.bytes_not_frames),
    ] {
        // The counter is the sum modulo 2^32, and ahead of it.
        *sum += u64::from(counter.wrapping_sub(*sum as u32));
    }
}

/// The slot that the card is in, as the recorder sees it.
struct Slot<'a>(&'a SimCard);

impl BlockDevice for Slot<'_> {
    type Error = CardError;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> Result<(), CardError> {
        self.0.read(blocks, start)
    }

    fn write(&self, blocks: &[Block], start: BlockIdx) -> Result<(), CardError> {
        self.0.write(blocks, start)
    }

    fn num_blocks(&self) -> Result<BlockCount, CardError> {
        self.0.num_blocks()
    }
}

impl CardDevice for Slot<'_> {}

/// The tasks of one power-on.
struct Pipeline<'a, 'w> {
    card: &'a SimCard,
    slot_status: &'a CardStatus,
    ends: Ends<'a>,
    reception: Reception<'a>,
    monitoring: Monitoring<'a>,
    storage: Storage<'a, Slot<'a>>,
    gs: &'w mut (dyn Write + Send),
    findings: &'w mut Vec<Finding>,
    /// When this power-on was, in microseconds since the first input byte.
    power_on_us: u64,
    reboot_at_us: Option<u64>,
    /// Since this power-on, as all that follow.
    now: Instant,
    tick_at: Instant,
    /// When storage goes on; `None` while it waits for a sector.
    storage_at: Option<Instant>,
    /// When the GS port can take the next frame.
    gs_at: Instant,
    /// When the line counts as silent.
    silent_at: Option<Instant>,
}

/// What happens next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Event {
    Silence,
    Tick,
    Storage,
}

impl Machine for Pipeline<'_, '_> {
    fn arrive(&mut self, chunk: &Chunk) -> Result<bool> {
        if self.reboot_at_us.is_some_and(|at| chunk.at_us >= at) {
            return Ok(false);
        }
        let at = Instant::from_micros(chunk.at_us.saturating_sub(self.power_on_us));
        if !self.advance(at)? {
            return Ok(false);
        }
        if !chunk.bytes.is_empty() {
            self.reception.bytes(self.now, &chunk.bytes, &mut self.ends.frames_in);
            self.silent_at = Some(self.now + SILENCE);
            self.drain()?;
        }
        Ok(!self.card.is_dead())
    }
}

impl Pipeline<'_, '_> {
    fn start(&mut self) -> Result<()> {
        self.monitoring.start(self.now, &mut self.ends.sectors_in);
        self.after_monitor()
    }

    /// Lets time go on to `to`, with everything that happens on the way, and at `to` itself. `false`: power went.
    fn advance(&mut self, to: Instant) -> Result<bool> {
        while let Some((at, event)) = self.next_event().filter(|(at, _)| *at <= to) {
            self.now = self.now.max(at);
            match event {
                Event::Silence => {
                    self.silent_at = None;
                    self.reception.idle(self.now, &mut self.ends.frames_in);
                    self.drain()?;
                }
                Event::Tick => {
                    self.tick_at = self.tick_at + TICK;
                    self.tick()?;
                }
                Event::Storage => self.storage(),
            }
            if self.card.is_dead() {
                return Ok(false);
            }
        }
        self.now = self.now.max(to);
        self.send_gs()?;
        Ok(true)
    }

    /// The next event; of several at once the most urgent.
    fn next_event(&self) -> Option<(Instant, Event)> {
        let silence = self.silent_at.map(|at| (at, Event::Silence));
        let storage = self.storage_at.map(|at| (at, Event::Storage));
        let events = [silence, Some((self.tick_at, Event::Tick)), storage];
        // `min_by_key` keeps the first of equals.
        events.into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    fn drain(&mut self) -> Result<()> {
        let Ends { frames_out, sectors_in, gs_in, .. } = &mut self.ends;
        while self.monitoring.drain(frames_out, sectors_in, gs_in) {}
        self.after_monitor()
    }

    fn tick(&mut self) -> Result<()> {
        let Self { monitoring, ends, findings, power_on_us, now, .. } = self;
        monitoring.tick(*now, &mut ends.sectors_in, &mut ends.gs_in, &mut |finding| {
            let value = f64::from(finding.value);
            findings.push(Finding {
                subsystem: finding.subsystem.name().to_owned(),
                check: finding.check.to_owned(),
                instance: finding.instance,
                level: finding.level.name().to_owned(),
                time_s: (power_on_us.saturating_add(finding.at.as_micros())) as f64 / 1e6,
                value: value.is_finite().then_some(value),
                unit: finding.unit.to_owned(),
            });
        });
        self.after_monitor()
    }

    /// The monitor may have left work for the others.
    fn after_monitor(&mut self) -> Result<()> {
        if self.storage_at.is_none() && !self.ends.sectors_out.is_empty() {
            self.storage_at = Some(self.now);
        }
        self.send_gs()
    }

    /// What the GS port can have sent by now.
    fn send_gs(&mut self) -> Result<()> {
        let mut frame = [0; GS_FRAME_BYTES_MAX];
        while self.gs_at <= self.now {
            let Some(length) = self.ends.gs_out.take(&mut frame) else { break };
            let bits = length as u64 * 10;
            self.gs_at = self.now.max(self.gs_at) + Span::from_micros(bits * 1_000_000 / GS_BAUD);
            let bytes = frame.get(..length).unwrap_or_default();
            if let Err(error) = self.gs.write_all(bytes).and_then(|()| self.gs.flush()) {
                if crate::output::is_reader_gone(&error) {
                    return Err(crate::outcome::ReaderGone.into());
                }
                return Err(error).context("--gs: cannot be written");
            }
        }
        Ok(())
    }

    /// Storage does one thing, and is busy for as long as the card took.
    fn storage(&mut self) {
        let begin_us = self.power_on_us.saturating_add(self.now.as_micros());
        self.card.set_clock(begin_us);
        let service = self.storage.service(self.now, &mut self.ends.sectors_out);
        let took = Span::from_micros(self.card.clock().saturating_sub(begin_us));
        self.slot_status.note_stall_ms(u32::try_from(took.as_millis()).unwrap_or(u32::MAX));
        self.storage_at = match service {
            Service::Idle if self.ends.sectors_out.is_empty() => None,
            Service::Wrote | Service::Idle => Some(self.now + took),
            Service::NoCard => Some(self.now + took + NO_CARD_RETRY),
        };
    }

    /// The input has ended: the record is closed and written out. Gives the frames that found no card.
    fn finish(&mut self) -> Result<u64> {
        self.reception.idle(self.now, &mut self.ends.frames_in);
        self.drain()?;
        let Ends { sectors_in, gs_in, .. } = &mut self.ends;
        self.monitoring.finish(self.now, sectors_in, gs_in);
        let patience = self.now + CARD_PATIENCE;
        while !self.ends.sectors_out.is_empty() && !self.card.is_dead() {
            let at = self.storage_at.unwrap_or(self.now).max(self.now);
            if at > patience && !self.ends.sectors_out.is_empty() && self.slot_is_empty() {
                break;
            }
            self.now = at;
            self.storage();
        }
        self.storage.finish();
        // The port sends what it has, at its pace.
        self.now = self.now.max(self.gs_at);
        for _ in 0..1000 {
            self.send_gs()?;
            self.now = self.now.max(self.gs_at);
        }
        Ok(self.left_in_queue())
    }

    fn slot_is_empty(&self) -> bool {
        self.slot_status.read().state != hums_recorder::CardState::Recording
    }

    /// Frames in sectors that are still queued; copies of a sector in progress hold none of their own.
    fn left_in_queue(&mut self) -> u64 {
        let mut frames = 0;
        while let Some(sector) = self.ends.sectors_out.oldest() {
            let mut sealed = *sector;
            sealed.seal(0);
            if let Ok(header) = Header::read(sealed.bytes())
                && !header.partial
            {
                frames += u64::from(header.frames);
            }
            self.ends.sectors_out.drop_oldest();
        }
        frames
    }

    fn stats(&self) -> Stats {
        self.monitoring.stats(&self.ends.gs_in)
    }
}
