//! Playback of a recording or a HUMS log. One reading gives the history, the time line, and copies of the
//! state to go back to. Then it plays at any speed.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant as Wall};

use anyhow::{Context as _, Result};
use hums_core::clock::{Instant, Span};
use hums_link::Frame;

use super::hub::{Hub, PageCommand, PublishedState};
use super::influx::{Figures, Influx};
use super::native::Native;
use super::rate::{PUBLISH, Rate};
use super::recording::{self, Content, OpenedInput};
use super::show::{self, HeadInputs, SourceJson};
use super::spool::{Spool, SpoolWriter, SpooledFrame};
use super::told::{Limits, MonitorRecord};
use super::world::World;
use crate::interrupt;

/// Copies: beyond this every second one goes.
const COPIES_MAX: usize = 128;
/// Vehicles in all copies, some 8 KiB each: 32 copies of eight vehicles.
const COPIED_MAX: usize = 256;
/// The first distance between two.
const COPY_EVERY: Span = Span::from_secs(5);
const SPEEDS: (f64, f64) = (0.1, 64.0);
/// Reports besides frames: a log's parameters and parts.
const TOLD_MAX: usize = 8_192;
const LOOK_EVERY: u64 = 4_096;

#[derive(Debug)]
struct Copy {
    at: Instant,
    offset: u64,
    /// Next report.
    told: usize,
    world: World,
}

/// A read recording.
#[derive(Debug)]
struct LoadedRecording {
    played: PlaybackSource,
    told: Vec<(Instant, MonitorRecord)>,
    told_next: usize,
    copies: Vec<Copy>,
    start: Instant,
    end: Instant,
    frames: u64,
}

#[derive(Debug)]
enum PlaybackSource {
    /// Frames, kept.
    Frames(Spool),
    /// Read again.
    Native(Native),
}

/// Callback after each frame, or entry without frames; `false` ends it.
type Each<'a> = dyn FnMut(Instant, Option<&Frame<'_>>, &mut World) -> bool + 'a;

impl LoadedRecording {
    fn seek(&mut self, offset: u64, told: usize) -> io::Result<()> {
        self.told_next = told;
        match &mut self.played {
            PlaybackSource::Frames(spool) => spool.seek(offset),
            PlaybackSource::Native(native) => native.seek(offset),
        }
    }

    fn go(&mut self, world: &mut World, now: Instant) -> io::Result<()> {
        self.follow(world, now, &mut |_, _, _| true)?;
        world.advance(now, None);
        world.found.clear();
        Ok(())
    }

    fn follow(&mut self, world: &mut World, now: Instant, each: &mut Each<'_>) -> io::Result<()> {
        match &mut self.played {
            PlaybackSource::Frames(spool) => {
                while let Some(SpooledFrame { at, check, bytes }) = spool.next_until(now)? {
                    tell(&self.told, &mut self.told_next, at, world);
                    if let Some(frame) = Frame::again(bytes, check) {
                        world.frame(at, &frame, None);
                        if !each(at, Some(&frame), world) {
                            return Ok(());
                        }
                    }
                }
            }
            PlaybackSource::Native(native) => {
                while let Some((at, entry)) = native.next_until(now)? {
                    world.entry(at, &entry, None);
                    if !each(at, None, world) {
                        return Ok(());
                    }
                }
            }
        }
        tell(&self.told, &mut self.told_next, now, world);
        Ok(())
    }
}

fn copied(copies: &[Copy]) -> usize {
    copies.iter().map(|copy| copy.world.crafts.len()).sum()
}

/// Copies made before a gap was known take it too.
fn keep(told: &mut Vec<(Instant, MonitorRecord)>, copies: &mut [Copy], at: Instant, what: &MonitorRecord) {
    let at = if let MonitorRecord::Missing { from, .. } = what { at.min(*from) } else { at };
    let place = told.partition_point(|(known, _)| *known <= at);
    told.insert(place, (at, what.clone()));
    for copy in copies.iter_mut().filter(|copy| copy.at > at) {
        copy.world.told(at, what, None);
        copy.told += 1;
    }
}

fn tell(told: &[(Instant, MonitorRecord)], next: &mut usize, by: Instant, world: &mut World) {
    while let Some((at, what)) = told.get(*next).filter(|(at, _)| *at <= by) {
        world.told(*at, what, None);
        *next += 1;
    }
}

/// Plays a recording until Ctrl-C.
pub struct Player {
    hub: Arc<Hub>,
    commands: Receiver<PageCommand>,
    limits: Limits,
    source: SourceJson,
    epoch_us: Option<u64>,
    influx: Option<Influx>,
    /// 0 to 1, if the user stopped the reading.
    read_to: Option<f64>,
    rate: Rate,
    /// See [`World::on_the_wire`].
    is_of_box: bool,
    epoch: u64,
    timeline: Arc<str>,
}

impl Player {
    /// The state for the pages, and their requests.
    pub fn new(
        name: &str,
        limits: Limits,
        hub: Arc<Hub>,
        commands: Receiver<PageCommand>,
        influx: Option<Influx>,
    ) -> Self {
        let source = SourceJson {
            name: name.to_owned(),
            recording: true,
            phase: "reading",
            speed: 1.0,
            ..SourceJson::default()
        };
        let (rate, timeline) = (Rate::default(), Arc::default());
        let (epoch_us, read_to, is_of_box) = (None, None, false);
        Self { hub, commands, limits, source, epoch_us, influx, read_to, rate, is_of_box, epoch: 0, timeline }
    }

    /// Returns points to write; an unreadable recording shows on the page too.
    pub fn run(mut self, mut opened: OpenedInput) -> Result<Option<Influx>> {
        let mut loaded =
            self.load(&mut opened).with_context(|| format!("{}: cannot be read", self.source.name))?;
        drop(opened);
        self.read_to = interrupt::requested().then_some(self.source.progress);
        self.write(&mut loaded)?;
        self.play(&mut loaded)?;
        Ok(self.influx)
    }

    fn world(&self) -> World {
        World::new(self.limits.clone()).on_the_wire(self.is_of_box)
    }

    /// Reads it through.
    fn load(&mut self, opened: &mut OpenedInput) -> Result<LoadedRecording> {
        self.is_of_box = opened.is_of_box();
        let mut world = self.world();
        let mut writer = SpoolWriter::new()?;
        let (mut copies, mut copy_every, mut told) = (Vec::new(), COPY_EVERY, Vec::new());
        let (mut start, mut end, mut frames) = (None, Instant::ZERO, 0_u64);
        let mut shown = Wall::now();
        let Self { hub, source, epoch_us, influx, .. } = self;
        // `Ctrl-C` ends a long reading.
        let ending = recording::each(opened, &mut |at, epoch, progress, content| -> io::Result<bool> {
            *epoch_us = epoch.or(*epoch_us);
            source.progress = progress;
            if start.is_none() {
                start = Some(at);
                world.begin(at);
            }
            let native = matches!(content, Content::Entry(_));
            let frame = match content {
                Content::Frame(frame) => Some(frame),
                Content::Entry(_) => None,
                Content::Told(what) => {
                    if told.len() < TOLD_MAX {
                        world.told(at, what, Some(&mut hub.histories()));
                        keep(&mut told, &mut copies, at, what);
                    }
                    return Ok(!interrupt::requested());
                }
            };
            let due = copies.last().is_none_or(|copy: &Copy| at.since(copy.at) >= copy_every);
            if due {
                // Several rounds: later vehicles enlarge later copies.
                while copies.len() >= COPIES_MAX || copied(&copies) + world.crafts.len() > COPIED_MAX {
                    let mut odd = false;
                    copies.retain(|_| {
                        odd = !odd;
                        odd
                    });
                    copy_every = copy_every + copy_every;
                }
                let offset = if native { frames } else { writer.offset() };
                copies.push(Copy { at, offset, told: told.len(), world: world.clone() });
            }
            if let Some(frame) = frame {
                writer.push(SpooledFrame { at, check: frame.check(), bytes: frame.bytes() })?;
                world.frame(at, frame, Some(&mut hub.histories()));
            } else if let Content::Entry(entry) = content {
                world.entry(at, entry, Some(&mut hub.histories()));
            }
            world.found.clear();
            frames += 1;
            end = end.max(at);
            if frames.is_multiple_of(LOOK_EVERY) && shown.elapsed() >= PUBLISH {
                shown = Wall::now();
                let around = HeadInputs { source, epoch_us: None, frames_s: 0.0, influx: None };
                let (head, _) = show::all(&World::new(Limits::default()), Instant::ZERO, &around);
                hub.publish(PublishedState { head, ..PublishedState::default() });
            }
            Ok(!interrupt::requested())
        })?;
        source.log_end = ending.map(|ending| ending.words());
        if let Some(influx) = influx {
            influx.know(&world);
        }
        let start = start.unwrap_or_default();
        (self.source.start_s, self.source.end_s) = (start.as_secs_f64(), end.as_secs_f64());
        self.timeline = timeline(hub);
        self.rate = Rate::default();
        let played = match opened.native() {
            Some(native) => PlaybackSource::Native(native),
            None => PlaybackSource::Frames(writer.finish()?),
        };
        Ok(LoadedRecording { played, told, told_next: 0, copies, start, end, frames })
    }

    /// Vehicle and date are known now.
    fn write(&mut self, loaded: &mut LoadedRecording) -> io::Result<()> {
        let Some(influx) = &mut self.influx else { return Ok(()) };
        let epoch_us = self.epoch_us.unwrap_or(0);
        let mut world = World::new(self.limits.clone()).on_the_wire(self.is_of_box);
        world.begin(loaded.start);
        let (end, mut given_to) = (loaded.end, loaded.start);
        loaded.follow(&mut world, end, &mut |at, frame, world| {
            if let Some(frame) = frame {
                influx.frame(at, epoch_us, frame, world);
            }
            influx.found(epoch_us, world);
            influx.usage(at, epoch_us, world);
            world.found.clear();
            given_to = at;
            !interrupt::requested()
        })?;
        let name = &self.source.name;
        let [given, end_s] = [given_to, end].map(Instant::as_secs_f64);
        if self.read_to.is_some() {
            influx.leave_out(format!("{name}: was interrupted; its points go to {given:.1} s"));
        } else if given_to < end {
            influx.leave_out(format!(
                "{name}: its points go to {given:.1} s of {end_s:.1} s, where it was ended"
            ));
        }
        loaded.seek(0, 0)
    }

    fn play(&mut self, loaded: &mut LoadedRecording) -> Result<()> {
        let mut world = self.world();
        world.begin(loaded.start);
        let mut now = loaded.start;
        self.source.phase = if loaded.frames == 0 { "ended" } else { "playing" };
        if loaded.frames == 0 {
            "there is no frame in it".clone_into(&mut self.source.words);
        }
        let (mut before, mut turn) = (Wall::now(), Wall::now());
        while !interrupt::requested() {
            let wait = turn.saturating_duration_since(Wall::now());
            match self.commands.recv_timeout(wait) {
                Ok(command) => {
                    self.obey(command, loaded, &mut world, &mut now)?;
                    before = Wall::now();
                    // Seen at once.
                    self.publish(&world, now);
                    continue;
                }
                Err(RecvTimeoutError::Timeout) => {}
                // The hub lives as long as we do.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(PUBLISH),
            }
            let passed = before.elapsed();
            before = Wall::now();
            turn = (turn + PUBLISH).max(before);
            if self.source.phase == "playing" {
                // After sleep, or on a slow PC, playback goes on from its place.
                let passed_us = passed.min(Duration::from_millis(250)).as_micros() as f64 * self.source.speed;
                now = (now + Span::from_micros(passed_us as u64)).min(loaded.end);
                loaded.go(&mut world, now)?;
                if now >= loaded.end {
                    self.source.phase = "ended";
                }
            }
            self.publish(&world, now);
        }
        Ok(())
    }

    fn obey(
        &mut self,
        command: PageCommand,
        loaded: &mut LoadedRecording,
        world: &mut World,
        now: &mut Instant,
    ) -> Result<()> {
        match command {
            PageCommand::Pause if self.source.phase == "playing" => self.source.phase = "paused",
            PageCommand::Play => {
                if self.source.phase == "ended" {
                    self.seek(loaded.start, loaded, world, now)?;
                }
                self.source.phase = "playing";
            }
            PageCommand::Speed(to) if to.is_finite() => {
                self.source.speed = to.clamp(SPEEDS.0, SPEEDS.1);
            }
            PageCommand::Seek(to) if to.is_finite() => {
                let to = Instant::from_micros((to.max(0.0) * 1e6) as u64).clamp(loaded.start, loaded.end);
                self.seek(to, loaded, world, now)?;
                if self.source.phase == "ended" && to < loaded.end {
                    self.source.phase = "paused";
                }
            }
            // Nothing to pause, an invalid time, or a command for a link.
            _ => {}
        }
        Ok(())
    }

    /// A time from the last copy before it, or from here if nearer.
    fn seek(
        &mut self,
        to: Instant,
        loaded: &mut LoadedRecording,
        world: &mut World,
        now: &mut Instant,
    ) -> Result<()> {
        let copy = loaded.copies.iter().rev().find(|copy| copy.at <= to);
        if to < *now {
            self.epoch += 1;
        }
        match copy {
            Some(copy) if to < *now || copy.at > *now => {
                *world = copy.world.clone();
                let (offset, told) = (copy.offset, copy.told);
                loaded.seek(offset, told)?;
            }
            None => {
                *world = self.world();
                world.begin(loaded.start);
                loaded.seek(0, 0)?;
            }
            Some(_) => {}
        }
        *now = to;
        loaded.go(world, to)?;
        self.rate.jump(world.frames);
        Ok(())
    }

    fn publish(&mut self, world: &World, now: Instant) {
        self.rate.count(world.frames);
        let around = HeadInputs {
            source: &self.source,
            epoch_us: self.epoch_us,
            frames_s: self.rate.frames_s,
            influx: self.influx.as_mut().map(Influx::figures) as Option<Figures>,
        };
        let (head, crafts) = show::all(world, now, &around);
        let aside = Arc::clone(&self.timeline);
        self.hub.publish(PublishedState { epoch: self.epoch, now, head, aside, crafts });
    }
}

/// Findings and events.
fn timeline(hub: &Hub) -> Arc<str> {
    let marks: std::collections::BTreeMap<u8, _> =
        hub.histories().iter().map(|(system, history)| (*system, history.marks())).collect();
    serde_json::json!({ "t": "timeline", "marks": marks }).to_string().into()
}
