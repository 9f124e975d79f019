//! `--influx`: points to a database as they come, named and tagged as `hums decode --format influx` does.
//!
//! The thread that follows the vehicle makes the lines and puts them into batches; another one writes these
//! ([`writer`]). A database that is away costs nothing: batches wait in memory, beyond a limit in a file
//! ([`queue`]), and are written when it is back.

pub mod queue;
pub mod target;
pub mod writer;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Wall};

use anyhow::Result;
use hums_blackbox::Record;
use hums_blackbox::record::{FindingRecord, Moment, USAGE_ENTRIES_MAX, Usage};
use hums_core::time::{Instant, Span};
use hums_link::{Frame, observe};
use serde::Serialize;

use self::queue::{Batch, Queue};
use self::target::Target;
use super::world::World;
use crate::decode::influx::{Clock, Lines, Tags};
use crate::decode::record::rows;
use crate::mavlink::frame::{Peek, peek};
use crate::mavlink::values::Payload;

/// A batch is given away when it has this many bytes, far less than any database refuses.
const BATCH_BYTES: usize = 256 * 1024;
/// Or when its first point is this old.
const BATCH_AGE: Duration = Duration::from_millis(250);
/// How often the usage counters are written.
const USAGE_EVERY: Span = Span::from_secs(10);
/// How long is waited for the database at the end.
const LAST_WAIT: Duration = Duration::from_secs(15);

/// What became of the points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait, in memory or in the file.
    pub waiting: u64,
    /// Bytes of them that are in the file.
    pub spilled_bytes: u64,
    /// The database refuses them for what they are.
    pub rejected: u64,
    /// Neither memory nor the file took them.
    pub lost: u64,
    /// What the database said last when it did not take a batch; empty while all is well.
    pub trouble: String,
}

/// The side that makes points.
pub struct Influx {
    session: String,
    tags: BTreeMap<u8, Tags>,
    messages: Clock,
    quantities: Clock,
    batch: Batch,
    begun: Option<Wall>,
    usage_at: Instant,
    queue: Arc<Queue>,
    writer: Option<JoinHandle<()>>,
}

impl Influx {
    /// Starts writing to a database; `session` tags every point.
    pub fn start(target: Target, session: String) -> Result<Self> {
        let queue = Arc::new(Queue::new()?);
        let writer = writer::start(target, Arc::clone(&queue))?;
        Ok(Self {
            session,
            tags: BTreeMap::new(),
            messages: Clock::default(),
            quantities: Clock::default(),
            batch: Batch::default(),
            begun: None,
            usage_at: Instant::ZERO,
            queue,
            writer: Some(writer),
        })
    }

    /// The tags of a system's points: of a vehicle its own; whoever else speaks is tagged with the first vehicle, as a
    /// log's points are with the one whose log it is.
    fn tags(&mut self, system: u8, world: &World) -> Tags {
        let owner = world.crafts.get_key_value(&system).or_else(|| world.crafts.first_key_value());
        let Some((&owner, craft)) = owner else { return Tags::new(&self.session, "unknown") };
        let session = &self.session;
        let tags = self.tags.entry(owner).or_insert_with(|| {
            let uid =
                craft.monitor.vehicle().identity.get().map(|identity| identity.uid).filter(|uid| *uid != 0);
            let vehicle = uid.map_or_else(|| format!("system-{owner}"), |uid| format!("uid-{uid:016x}"));
            Tags::new(session, &vehicle)
        });
        tags.clone()
    }

    /// Points for a frame that the world has taken.
    pub fn frame(&mut self, at: Instant, epoch_us: u64, frame: &Frame<'_>, world: &World) {
        let tags = self.tags(frame.system(), world);
        if let Peek::Frame(raw) = peek(frame.bytes()) {
            let verified = frame.check() == hums_link::Check::Verified;
            let message = raw.message().filter(|_| verified);
            let payload = message.map(|message| Payload::new(message, raw.payload));
            let mut lines = Lines::default();
            lines.frame(&tags, at, &raw, payload.as_ref());
            self.put(&lines, epoch_us, false);
        }
        let Some((source, observation)) = observe(frame) else { return };
        let Some(craft) = world.crafts.get(&source.system) else { return };
        if craft.monitor.vehicle().source == Some(source) || craft.told_by_part(source, &observation) {
            let mut lines = Lines::default();
            lines.observed(&tags, at, &craft.reference, &observation);
            self.put(&lines, epoch_us, true);
        }
    }

    /// Points for the findings that the world has made.
    pub fn found(&mut self, epoch_us: u64, world: &World) {
        for (system, finding) in &world.found {
            let tags = self.tags(*system, world);
            let mut lines = Lines::default();
            for row in rows(&Record::Finding(FindingRecord::from(finding))) {
                lines.row(&tags, finding.at, &row);
            }
            self.put(&lines, epoch_us, false);
        }
        self.give_away_when_old();
    }

    /// Points for the usage counters, when it is their turn.
    pub fn usage(&mut self, at: Instant, epoch_us: u64, world: &World) {
        if at.since(self.usage_at) < USAGE_EVERY {
            return;
        }
        self.usage_at = at;
        for (system, craft) in &world.crafts {
            let tags = self.tags(*system, world);
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
        clock.write(lines, Some(epoch_us), &mut self.batch.text);
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
        if self.batch.points > 0 {
            self.queue.put(std::mem::take(&mut self.batch));
        }
    }

    /// What became of the points so far.
    pub fn figures(&mut self) -> Figures {
        self.give_away_when_old();
        let mut figures = self.queue.figures();
        figures.waiting += self.batch.points;
        figures
    }

    /// Gives away what is left and waits for the database, for a while; what became of all points.
    pub fn finish(mut self) -> Figures {
        self.give_away();
        self.queue.close(Wall::now() + LAST_WAIT);
        if let Some(writer) = self.writer.take() {
            // A panic of the writer shows in the figures: its points still wait.
            let _ = writer.join();
        }
        self.queue.figures()
    }
}
