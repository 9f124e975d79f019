//! The monitor task's body: frames from the queue into the record, the checks and the summary stream.
//!
//! Less urgent than reception, whose frames wait up to 16 ms for it; more urgent than anything that waits for a device.
//! One call of [`Monitoring::drain`] takes one frame through the whole pipeline; [`Monitoring::tick`] every 50 ms does
//! what time alone asks for.

mod figures;
mod happenings;
mod notices;
mod records;
mod slot;

use hums_blackbox::record::{
    Boot, Event, Fault, FindingRecord, Lost, Moment, Note, Parameter, Record, Vehicle as VehicleRecord,
};
use hums_blackbox::{Sector, SectorSink, Writer};
use hums_core::health::{Finding, Level};
use hums_core::time::{Instant, Span};
use hums_core::{Monitor, monitor};
use hums_link::frame::{Check, Frame};
use hums_link::sequence::Sequences;
use hums_link::summary::Summary;
use hums_recorder::status::{CardReading, CardStatus};

use crate::companion::Companion;
use crate::keeping::Keeping;
use crate::loss::Losses;
use crate::port::{PortReading, PortStatus};
use crate::queues::{FramesOut, GsIn, SectorsIn};
use crate::supervisor::Task;
pub use happenings::By;

pub use figures::Machine;
use figures::Sums;
use happenings::CRITICAL;
use notices::{Notice, Notices};
use slot::Told;

/// How often [`Monitoring::tick`] is to be called.
pub const TICK: Span = monitor::TICK;
/// A sector in progress is given to storage at least this often.
const PARTIAL: Span = Span::from_millis(200);
/// How often the recorder's statistics are recorded.
const STATS: Span = Span::from_secs(10);
/// How often usage is recorded.
const USAGE: Span = Span::from_secs(60);

/// The `MAV_SEVERITY` of a restart after a fault.
const FAULT_SEVERITY: u8 = 4;

/// What the board knows of itself: what the first record of a log says.
pub type Identity<'a> = Boot<'a>;

/// What happens to a frame, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Into the record.
    Encode {
        /// When it came.
        at: Instant,
        /// Which message it is.
        id: u32,
    },
    /// Into what the monitor knows.
    Observe,
    /// On to the ground station, where it is its turn.
    Summary,
}

/// The pipeline between the frame queue and the queues of sectors and of GS frames.
pub struct Monitoring<'a> {
    /// Lent, as the writer is: either is too large to be moved over the firmware's stack.
    pub(crate) monitor: &'a mut Monitor,
    writer: &'a mut Writer,
    pub(crate) summary: Summary,
    pub(crate) companion: Companion,
    sequences: Sequences,
    pub(crate) card: &'a CardStatus,
    port: &'a PortStatus,
    pub(crate) identity: Identity<'a>,
    /// The vehicle as it was recorded last.
    vehicle: VehicleRecord,
    /// UTC of power-on as it was recorded last, microseconds since 1970.
    epoch_micros: Option<u64>,
    losses: Losses,
    notices: Notices,
    slot: Told,
    keeping: Keeping,
    port_before: PortReading,
    card_before: CardReading,
    sums: Sums,
    machine: Machine,
    /// Frames that found no room in the sector queue.
    refused: u64,
    queue_sectors_max: usize,
    partial_at: Instant,
    stats_at: Instant,
    usage_at: Instant,
}

impl<'a> Monitoring<'a> {
    /// Before the first frame.
    pub fn new(
        monitor: &'a mut Monitor,
        writer: &'a mut Writer,
        identity: Identity<'a>,
        card: &'a CardStatus,
        port: &'a PortStatus,
    ) -> Self {
        Self {
            summary: Summary::new(monitor.params()),
            companion: Companion::new(monitor.params()),
            monitor,
            writer,
            sequences: Sequences::new(),
            card,
            port,
            identity,
            vehicle: VehicleRecord::default(),
            epoch_micros: None,
            losses: Losses::new(),
            notices: Notices::new(),
            slot: Told::new(),
            keeping: Keeping::new(),
            port_before: PortReading::default(),
            card_before: card.read(),
            sums: Sums::default(),
            machine: Machine::default(),
            refused: 0,
            queue_sectors_max: 0,
            partial_at: Instant::ZERO,
            stats_at: Instant::ZERO,
            usage_at: Instant::ZERO,
        }
    }

    /// Writes what a log begins with: who records, and every parameter that is not at its default.
    pub fn start(&mut self, now: Instant, sectors: &mut SectorsIn) {
        self.keep(now, sectors);
        self.heading(now, sectors);
        self.record_usage(now, Moment::Start, sectors);
    }

    /// What each file of a log says of itself: one that is read alone, because those before it made room, misses
    /// nothing but their time.
    fn heading(&mut self, now: Instant, sectors: &mut SectorsIn) {
        let boot = Record::Boot(self.identity);
        self.record(now, &boot, sectors);
        let params = *self.monitor.params();
        for (spec, value) in params.iter() {
            // Bit for bit: only a value that was set differs from its default.
            if value.to_bits() != spec.default.to_bits() {
                let parameter =
                    Parameter { name: spec.name, value: f64::from(value), changed: false, by: (0, 0) };
                self.record(now, &Record::Parameter(parameter), sectors);
            }
        }
        self.vehicle = VehicleRecord::default();
    }

    /// What of the record is to be kept, by whether the vehicle is armed.
    fn keep(&mut self, now: Instant, sectors: &mut SectorsIn) {
        let Self { keeping, monitor, card, writer, .. } = self;
        let armed = monitor.vehicle().armed();
        keeping.tick(now, monitor.params(), armed, card, writer, sectors);
        if self.keeping.takes_new_file(self.card) {
            self.heading(now, sectors);
            // All of it, also what was recorded before.
            self.usage_at = Instant::ZERO;
            self.record_usage(now, Moment::Periodic, sectors);
        }
    }

    /// Records how the boot before this one ended, with a word on what came before, and tells the ground station as soon
    /// as the vehicle is known. To be called after [`Self::start`].
    pub fn fault(&mut self, now: Instant, fault: &Fault<'_>, before: &str, sectors: &mut SectorsIn) {
        self.record(now, &Record::Fault(*fault), sectors);
        self.record(now, &Record::Note(Note { severity: FAULT_SEVERITY, text: before }), sectors);
        let task = Task::ALL.into_iter().map(Task::name).find(|name| *name == fault.task);
        // There is room: nothing was told yet.
        let _ = self.notices.push(Notice::Restarted(restart_words(fault), task));
    }

    /// Takes one frame from the queue through the pipeline; `false` when there is none.
    pub fn drain(&mut self, frames: &mut FramesOut, sectors: &mut SectorsIn, gs: &mut GsIn) -> bool {
        self.drain_in_steps(frames, sectors, gs, &mut |_| {})
    }

    /// As [`Self::drain`], and says which step begins, for whoever measures what each costs.
    pub fn drain_in_steps(
        &mut self,
        frames: &mut FramesOut,
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
        begin: &mut impl FnMut(Step),
    ) -> bool {
        frames.take(|at_micros, verified, bytes| {
            self.frame(Instant::from_micros(at_micros), verified, bytes, sectors, gs, begin);
        })
    }

    fn frame(
        &mut self,
        at: Instant,
        verified: bool,
        bytes: &[u8],
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
        begin: &mut impl FnMut(Step),
    ) {
        let whole = Frame::again(bytes, Check::Unverified);
        begin(Step::Encode { at, id: whole.as_ref().map_or(0, Frame::id) });
        let key = whole.filter(|frame| frame.id() == crate::secure::SETUP);
        if let Some(frame) = key {
            self.withhold(at, &frame, sectors);
        } else if !self.companion.stopped && self.writer.frame(at, bytes, verified, sectors).is_err() {
            self.refused += 1;
            self.losses.count(at, Lost::QueueFull, 1);
        }
        begin(Step::Observe);
        // What is not ours by its checksum is recorded but not believed.
        let check = if verified { Check::Verified } else { Check::Unverified };
        let Some(frame) = Frame::again(bytes, check) else { return };
        if !verified {
            self.pass_down(at, &frame, gs);
            return;
        }
        self.observe(at, &frame);
        self.heard(at, &frame, sectors, gs);
        begin(Step::Summary);
        self.summary.frame(at, &frame, &mut |bytes| gs.tell(bytes));
    }

    /// Not within its caller: an observation is not to lie on the stack below a conversation.
    #[inline(never)]
    fn observe(&mut self, at: Instant, frame: &Frame<'_>) {
        self.sequences.frame(at, frame);
        if let Some((source, observation)) = hums_link::observe(frame) {
            self.monitor.observe(at, source, &observation);
        }
    }

    /// What time alone asks for, every [`TICK`]. Each finding is recorded, told to the GS, and given to `findings`.
    pub fn tick(
        &mut self,
        now: Instant,
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
        findings: &mut impl FnMut(&Finding),
    ) {
        if self.card.take_group_wanted() && !self.writer.restart(sectors) {
            self.card.want_group();
        }
        self.keep(now, sectors);
        self.count_losses(now, sectors);
        self.tell_slot(now, sectors);
        self.check(now, sectors, gs, findings);
        self.record_happenings(now, sectors);
        self.record_vehicle(now, sectors);
        self.record_clock(now, sectors);
        self.losses_to_record(now, false, sectors);
        if now.since(self.stats_at) >= STATS {
            self.stats_at = now;
            self.record_stats(now, sectors, gs);
        }
        if now.since(self.usage_at) >= USAGE {
            self.record_usage(now, Moment::Periodic, sectors);
        }
        self.partial(now, sectors);
        self.tell_notices(now, gs);
        self.summary.own = self.own_figures();
        self.summary.tick(now, self.monitor, &mut |bytes| gs.tell(bytes));
        self.converse(now, sectors, gs);
    }

    /// Ends the record in order: everything that is still open is written. The queues then hold what storage has to
    /// write before the power may go.
    pub fn finish(&mut self, now: Instant, sectors: &mut SectorsIn, gs: &GsIn) {
        self.count_losses(now, sectors);
        self.losses_to_record(now, true, sectors);
        self.record_usage(now, Moment::End, sectors);
        self.record_stats(now, sectors, gs);
        sectors.with_reserve(|sink| self.writer.finish(sink));
    }

    /// What the monitor knows.
    pub const fn monitor(&self) -> &Monitor {
        self.monitor
    }

    /// What the monitor knows, to be changed: what is restored, saved, set.
    pub const fn monitor_mut(&mut self) -> &mut Monitor {
        self.monitor
    }

    // Not within the tick: what one of these takes of the stack is not to lie below what another takes.

    #[inline(never)]
    fn check(
        &mut self,
        now: Instant,
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
        findings: &mut impl FnMut(&Finding),
    ) {
        let link = self.sequences.reading(now, self.monitor.vehicle().source);
        let recorder = self.recorder_status(now, sectors);
        let Self { monitor, writer, summary, losses, .. } = self;
        monitor.tick(now, &link, &recorder, &mut |finding| {
            write(now, &Record::Finding(FindingRecord::from(finding)), writer, losses, sectors);
            if finding.level == Level::Critical {
                // Marks the place for whoever looks through the record.
                let event = Record::Event(Event { number: CRITICAL, text: finding.check });
                write(now, &event, writer, losses, sectors);
            }
            summary.finding(now, finding, &mut |bytes| gs.tell(bytes));
            findings(finding);
        });
    }

    #[inline(never)]
    fn losses_to_record(&mut self, now: Instant, all: bool, sectors: &mut SectorsIn) {
        let Self { losses, writer, .. } = self;
        losses.flush(now, all, |loss| {
            sectors.with_reserve(|sink| writer.record(now, &Record::Loss(*loss), sink)).is_ok()
        });
    }

    /// Writes a record, from the reserve if need be; a record that still finds no room is a counted loss.
    pub(crate) fn record(&mut self, now: Instant, record: &Record<'_>, sectors: &mut SectorsIn) -> bool {
        write(now, record, self.writer, &mut self.losses, sectors)
    }

    #[inline(never)]
    fn record_stats(&mut self, now: Instant, sectors: &mut SectorsIn, gs: &GsIn) {
        let stats = Record::Stats(self.stats(gs));
        self.record(now, &stats, sectors);
    }

    /// Gives storage a copy of the sector in progress, unless full sectors keep it busy anyway.
    #[inline(never)]
    fn partial(&mut self, now: Instant, sectors: &mut SectorsIn) {
        if now.since(self.partial_at) < PARTIAL || !sectors.is_empty() {
            return;
        }
        self.partial_at = now;
        let mut copy = Sector::zeroed();
        if self.writer.partial(&mut copy) {
            sectors.put(&copy);
        }
    }
}

/// As [`Monitoring::record`], where the monitor is in use.
fn write(
    now: Instant,
    record: &Record<'_>,
    writer: &mut Writer,
    losses: &mut Losses,
    sectors: &mut SectorsIn,
) -> bool {
    let written = sectors.with_reserve(|sink| writer.record(now, record, sink)).is_ok();
    if !written {
        losses.count(now, Lost::Records, 1);
    }
    written
}

/// How a start ended, in words for a pilot.
fn restart_words(fault: &Fault<'_>) -> &'static str {
    match fault.kind {
        1 => "panic",
        2 if fault.message == "stack overflow" => "stack overflow",
        2 => "processor fault",
        3 => "watchdog",
        _ => "supply low",
    }
}
