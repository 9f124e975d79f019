//! `--influx`: points named and tagged as by `hums decode --format influx`.
//!
//! The vehicle's thread makes batches, another writes them ([`writer`]). They wait in bounded memory ([`queue`]).

pub mod batch;
mod figures;
pub mod names;
pub mod queue;
pub mod target;
pub mod writer;

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Wall};

use anyhow::Result;
use hums_blackbox::Record;
use hums_blackbox::record::{FindingRecord, Moment, USAGE_ENTRIES_MAX, Usage};
use hums_core::clock::{Instant, Span};
use hums_link::{Frame, observe};

use self::batch::Batch;
pub use self::figures::Figures;
use self::names::Names;
use self::queue::Queue;
use self::target::Target;
use super::world::World;
use crate::decode::formats::influx::{Clock, Lines};
use crate::decode::record::rows;
use crate::interrupt;
use crate::mavlink::values::Payload;
use crate::source::epochs::Epochs;

/// Far less than any database refuses.
const BATCH_BYTES: usize = 256 * 1024;
/// Or when its first point is this old.
const BATCH_AGE: Duration = Duration::from_millis(250);
const USAGE_EVERY: Span = Span::from_secs(10);
const LOOK: Duration = Duration::from_millis(20);
const LAST_WAIT: Duration = Duration::from_secs(15);

/// The side that makes points.
pub struct Influx {
    names: Names,
    messages: Clock,
    quantities: Clock,
    batch: Batch,
    begun: Option<Wall>,
    usage_at: Instant,
    queue: Arc<Queue>,
    writer: Option<JoinHandle<()>>,
    left_out: String,
}

impl Influx {
    /// `session` tags each point; a `patient` one waits for a slow database.
    pub fn start(target: Target, session: String, patient: bool) -> Result<Self> {
        let queue = Arc::new(Queue::new(patient));
        let writer = writer::start(target, Arc::clone(&queue))?;
        Self::new(queue, Some(writer), session)
    }

    fn new(queue: Arc<Queue>, writer: Option<JoinHandle<()>>, session: String) -> Result<Self> {
        Ok(Self {
            names: Names::new(session)?,
            messages: Clock::default(),
            quantities: Clock::default(),
            batch: Batch::default(),
            begun: None,
            usage_at: Instant::ZERO,
            queue,
            writer,
            left_out: String::new(),
        })
    }

    /// All vehicles, before a recording's first point.
    pub fn know(&mut self, world: &World) {
        self.names.know(world);
    }

    /// The world took the frame before.
    pub fn frame(&mut self, at: Instant, epoch_us: u64, frame: &Frame<'_>, world: &World) {
        let tags = self.names.tags(frame.system(), world);
        let mut lines = Lines::default();
        lines.frame(&tags, at, frame, Payload::of(frame).as_ref());
        self.put(&lines, epoch_us, false);
        let Some((source, observation)) = observe(frame) else { return };
        let Some(craft) = world.crafts.get(&source.system) else { return };
        if craft.monitor.vehicle().source == Some(source) || craft.told_by_part(source, &observation) {
            let mut lines = Lines::default();
            lines.observed(&tags, at, &craft.reference, &observation);
            self.put(&lines, epoch_us, true);
        }
    }

    /// Points for findings.
    pub fn found(&mut self, epoch_us: u64, world: &World) {
        for (at, system, finding) in &world.found {
            let tags = self.names.tags(*system, world);
            let mut lines = Lines::default();
            for row in rows(&Record::Finding(FindingRecord::new(*at, finding))) {
                lines.row(&tags, *at, &row);
            }
            self.put(&lines, epoch_us, false);
        }
        self.give_away_when_old();
        self.settle(world);
    }

    /// When it is their turn.
    pub fn usage(&mut self, at: Instant, epoch_us: u64, world: &World) {
        if at.since(self.usage_at) < USAGE_EVERY {
            return;
        }
        self.usage_at = at;
        for (system, craft) in &world.crafts {
            let tags = self.names.tags(*system, world);
            let mut counters = Vec::new();
            craft.monitor.for_each_counter(|number, value| counters.push((number, value as f32)));
            let mut lines = Lines::default();
            for part in counters.chunks(USAGE_ENTRIES_MAX) {
                for row in rows(&Record::Usage(Usage::new(Moment::Periodic, part))) {
                    lines.row(&tags, at, &row);
                }
            }
            self.put(&lines, epoch_us, false);
        }
    }

    fn put(&mut self, lines: &Lines, epoch_us: u64, quantities: bool) {
        if lines.is_empty() {
            return;
        }
        let clock = if quantities { &mut self.quantities } else { &mut self.messages };
        clock.write(lines, &Epochs::of(Some(epoch_us)), &mut self.batch.text);
        self.batch.points += lines.len() as u64;
        self.begun.get_or_insert_with(Wall::now);
        if self.batch.text.len() >= BATCH_BYTES {
            self.give_away();
        }
    }

    fn give_away_when_old(&mut self) {
        if self.begun.is_some_and(|begun| begun.elapsed() >= BATCH_AGE) {
            self.give_away();
        }
    }

    fn give_away(&mut self) {
        self.begun = None;
        if self.batch.points > 0
            && let Some(batch) = self.names.pass(std::mem::take(&mut self.batch))
        {
            self.queue.put(batch);
        }
    }

    fn settle(&mut self, world: &World) {
        if self.names.is_waiting() {
            self.give_away();
            let settled = self.names.settle(world);
            self.give_settled(settled.as_ref());
        }
    }

    /// Hands on points in parts that a database takes.
    fn give_settled(&self, settled: Option<&Batch>) {
        let mut part = Batch::default();
        for line in settled.into_iter().flat_map(|all| all.text.split_inclusive(|byte| *byte == b'\n')) {
            part.text.extend_from_slice(line);
            part.points += 1;
            if part.text.len() >= BATCH_BYTES {
                self.queue.put(std::mem::take(&mut part));
            }
        }
        if part.points > 0 {
            self.queue.put(part);
        }
    }

    /// Counts of the points so far.
    pub fn figures(&mut self) -> Figures {
        self.give_away_when_old();
        let mut figures = self.queue.figures();
        figures.waiting += self.batch.points + self.names.points_waiting();
        figures
    }

    /// Notes the part of the recording without points.
    pub fn leave_out(&mut self, words: String) {
        self.left_out = words;
    }

    /// Waits for the database a while, or until the user stops again. Returns the counts.
    pub fn finish(mut self) -> Figures {
        self.give_away();
        let settled = self.names.end();
        self.give_settled(settled.as_ref());
        self.queue.close(Wall::now() + LAST_WAIT);
        // After a writer's panic its points still wait.
        while self.writer.as_ref().is_some_and(|writer| !writer.is_finished())
            && !interrupt::requested_again()
        {
            std::thread::sleep(LOOK);
        }
        Figures { left_out: std::mem::take(&mut self.left_out), ..self.queue.figures() }
    }
}

#[cfg(test)]
mod tests {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::packet::Packet;

    use super::*;
    use crate::live::told::Limits;
    use crate::mavlink::ids::{AUTOPILOT_VERSION, HEARTBEAT};

    const UID: u64 = 0x0031_002a_3035_510a;

    fn heartbeat() -> Packet {
        Packet::new(HEARTBEAT).u8(4, 2).u8(5, 3).u8(7, 3).u8(8, 3)
    }

    /// `AUTOPILOT_VERSION`
    fn version() -> Packet {
        Packet::new(AUTOPILOT_VERSION).u32(8, UID as u32).u32(12, (UID >> 32) as u32)
    }

    fn fly(packets: &[Packet], know: bool) -> Vec<String> {
        let queue = Arc::new(Queue::new(false));
        let mut influx = Influx::new(Arc::clone(&queue), None, "s1".to_owned()).expect("random numbers");
        let mut encoder = Encoder::of(1, 1);
        let frames: Vec<Vec<u8>> =
            packets.iter().map(|packet| encoder.frame(&mut [0; FRAME_BYTES_MAX], packet).to_vec()).collect();
        let mut world = World::new(Limits::default());
        if know {
            let mut whole = World::new(Limits::default());
            for bytes in &frames {
                whole.frame(Instant::from_millis(1), &Frame::parse(bytes).expect("a frame"), None);
            }
            influx.know(&whole);
        }
        for (number, bytes) in (1..).zip(&frames) {
            let (at, frame) = (Instant::from_millis(number * 100), Frame::parse(bytes).expect("a frame"));
            world.frame(at, &frame, None);
            influx.frame(at, 0, &frame, &world);
            influx.found(0, &world);
        }
        influx.finish();
        let mut lines = Vec::new();
        while let Some(batch) = queue.take() {
            let text = String::from_utf8(batch.text).expect("text");
            assert_eq!(text.lines().count() as u64, batch.points);
            lines.extend(text.lines().map(str::to_owned));
            queue.done(queue::Delivery { written: batch.points, ..queue::Delivery::default() });
        }
        lines
    }

    #[test]
    fn points_before_the_unique_id_have_it_too_as_those_of_decode() {
        for know in [false, true] {
            let lines = fly(&[heartbeat(), heartbeat(), version(), heartbeat()], know);
            assert!(lines.len() >= 4, "{lines:?}");
            let tag = format!("vehicle=uid-{UID:016x}");
            assert!(lines.iter().all(|line| line.contains(&tag)), "{lines:#?}");
        }
    }

    #[test]
    fn a_vehicle_that_never_tells_is_named_by_its_system() {
        let lines = fly(&[heartbeat(), heartbeat()], false);
        assert!(lines.len() >= 2 && lines.iter().all(|line| line.contains("vehicle=system-1")), "{lines:#?}");
    }
}
