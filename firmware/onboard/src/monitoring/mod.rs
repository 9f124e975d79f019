//! The monitor task's body: frames from the queue into the record, the checks and the summary stream.
//!
//! One call of [`Monitoring::drain`] takes one frame through the whole pipeline; [`Monitoring::tick`] does the
//! periodic work every 50 ms.

mod card_notices;
mod figures;
mod happenings;
mod marks;

use embedded_storage::nor_flash::NorFlash;
use hums_blackbox::Writer;
use hums_blackbox::record::{Boot, Fault, FindingRecord, Moment, Note, Record, Stats};
use hums_core::clock::{Instant, Span};
use hums_core::health::{Finding, Level};
use hums_core::observation::Observation;
use hums_core::{Monitor, monitor};
use hums_link::LongTexts;
use hums_link::frame::{Check, Frame};
use hums_link::ids;
use hums_link::request::Port;
use hums_link::sequence::Sequences;
use hums_recorder::status::CardStatus;

use crate::ResetCause;
use crate::companion::Companion;
use crate::journal::{Journal, Logbook};
use crate::notices::{Notice, Notices};
use crate::persist::{Handover, StoreWriter};
use crate::port::PortStatus;
use crate::queues::{FramesOut, MonitorEnds, SummaryRoute, UplinkOut};
use crate::records::RecordedState;
use crate::supervisor::Task;
use card_notices::CardNotices;
use figures::Figures;
pub use figures::Machine;
use happenings::CRITICAL;
pub use happenings::{CELLS_UNKNOWN, PARTS_CHANGED};
use marks::Marks;

/// How often [`Monitoring::tick`] is to be called.
pub const TICK: Span = Span::from_millis(monitor::TICK.as_millis());
/// Maximum time until a sector in progress is given to storage. With the tick's 50 ms a power cut costs less than 200
/// ms, even at a low rate.
const PARTIAL: Span = Span::from_millis(150);
const STATS: Span = Span::from_secs(10);
const USAGE: Span = Span::from_secs(60);

const FAULT_SEVERITY: u8 = 4;

/// The steps of a frame, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Encoding into the record.
    Encode {
        /// Its arrival time.
        at: Instant,
        /// Its message id.
        id: u32,
    },
    /// Observation by the monitor.
    Observe,
    /// Forwarding to the ground station, when it is due.
    Summary,
}

/// The pipeline between the frame queue and the queues of sectors and of GS frames.
pub struct Monitoring<'a> {
    book: Logbook<'a>,
    companion: Companion<'a>,
    sequences: Sequences,
    long_texts: LongTexts,
    identity: Boot<'a>,
    recorded: RecordedState,
    card_notices: CardNotices,
    files: u32,
    figures: Figures<'a>,
    marks: Marks,
    partial_at: Instant,
    stats_at: Instant,
}

impl<'a> Monitoring<'a> {
    /// `identity`: the board's own data, the first record of each file; `cause`: of this start.
    pub fn new(
        monitor: &'a mut Monitor,
        writer: &'a mut Writer,
        identity: Boot<'a>,
        cause: ResetCause,
        card: &'a CardStatus,
        port: &'a PortStatus,
        MonitorEnds { sectors, gs }: MonitorEnds<'a>,
    ) -> Self {
        let companion = Companion::new(monitor.params(), gs);
        let (journal, notices) = (Journal::new(writer, sectors), Notices::new());
        Self {
            companion,
            book: Logbook { monitor, journal, notices, card, cause },
            sequences: Sequences::new(),
            long_texts: LongTexts::new(),
            identity,
            recorded: RecordedState::new(),
            card_notices: CardNotices::new(),
            files: 0,
            figures: Figures::new(port, card),
            marks: Marks::new(),
            partial_at: Instant::ZERO,
            stats_at: Instant::ZERO,
        }
    }

    /// The recorder's identity, and every parameter that is not at its default.
    pub fn start(&mut self, now: Instant) {
        self.recorded.heading(now, &self.identity, &mut self.book);
        self.recorded.usage(now, Moment::Start, &mut self.book);
    }

    fn head_file(&mut self, now: Instant) {
        let Self { book, recorded, identity, files, .. } = self;
        let before = core::mem::replace(files, book.card.read().segments);
        if before != 0 && before != *files {
            recorded.heading(now, identity, book);
            recorded.usage_anew(now, book);
        }
    }

    #[inline(never)]
    fn tell_before(&mut self, now: Instant) {
        let Some(before) = self.book.card.take_before() else { return };
        self.identity.before = before;
        self.book.journal.record(now, &Record::Boot(self.identity));
    }

    /// Records the end of the previous boot, with a note on the time before it. Tells the ground station as soon as
    /// the vehicle is known. To be called after [`Self::start`].
    pub fn fault(&mut self, now: Instant, fault: &Fault<'_>, before: &str) {
        let journal = &mut self.book.journal;
        journal.record(now, &Record::Fault(*fault));
        journal.record(now, &Record::Note(Note { severity: FAULT_SEVERITY, text: before }));
        let task = Task::ALL.into_iter().map(Task::name).find(|name| *name == fault.task);
        self.book.notices.push(Notice::Restarted(restart_words(fault), task));
    }

    /// Records a text of ours, and sends it to the ground station; `severity` is a `MAV_SEVERITY`.
    pub fn note(&mut self, now: Instant, severity: u8, text: &'static str) {
        self.book.note(now, severity, text);
    }

    /// Takes one frame from the queue through the pipeline; `false` if there is none.
    pub fn drain(&mut self, frames: &mut FramesOut) -> bool {
        self.drain_in_steps(frames, &mut |_| {})
    }

    /// As [`Self::drain`], with a call at each step, for measurements.
    pub fn drain_in_steps(&mut self, frames: &mut FramesOut, begin: &mut impl FnMut(Step)) -> bool {
        frames.take(|at_micros, message, bytes| {
            self.frame(Instant::from_micros(at_micros), message, bytes, begin);
        })
    }

    fn frame(&mut self, at: Instant, message: Option<u16>, bytes: &[u8], begin: &mut impl FnMut(Step)) {
        let Self { book, companion, .. } = self;
        let frame = Frame::from_queue(bytes, message);
        begin(Step::Encode { at, id: frame.as_ref().map_or(0, Frame::id) });
        if let Some(frame) = frame.filter(|frame| frame.id() == ids::SETUP_SIGNING) {
            companion.withhold(at, &frame, &mut book.journal);
        } else if !companion.stopped() {
            book.journal.frame(at, bytes, message.is_some());
        }
        begin(Step::Observe);
        let Some(frame) = frame else { return };
        // A frame that is not verified by its checksum is recorded but not observed.
        if frame.check() == Check::Unverified {
            companion.pass_down(at, &frame, book);
            return;
        }
        self.observe(at, &frame);
        self.companion.heard(at, &frame, &mut self.book);
        begin(Step::Summary);
        self.companion.ways.forward(at, &frame);
    }

    #[inline(never)]
    fn observe(&mut self, at: Instant, frame: &Frame<'_>) {
        self.sequences.frame(at, frame);
        let Self { book, long_texts, .. } = self;
        long_texts.frame(at, frame, &mut |source, alert| {
            book.monitor.observe(at.into(), source, &Observation::Alert(alert));
        });
        if let Some((source, observation)) = hums_link::observe(frame) {
            book.monitor.observe(at.into(), source, &observation);
        }
    }

    /// `false` if there is none.
    pub fn uplink(&mut self, now: Instant, uplink: &mut UplinkOut) -> bool {
        uplink.take(|number, message, bytes| {
            let Self { book, companion, identity, .. } = self;
            let Some(port) = Port::ALL.get(number as usize).copied() else { return };
            // If the autopilot carries our stream, the radio's port has no user.
            if port == Port::Gs && companion.ways.queues.route() == SummaryRoute::Autopilot {
                return;
            }
            if let Some(frame) = Frame::from_queue(bytes, message) {
                companion.uplink(now, (port, &frame), book);
            }
            companion.answer(now, book.monitor, identity);
        })
    }

    /// Every [`TICK`]; findings are recorded, sent, and given to `findings`.
    pub fn tick(&mut self, now: Instant, findings: &mut impl FnMut(&Finding)) {
        let Logbook { journal, card, .. } = &mut self.book;
        if card.take_group_wanted() && !journal.restart() {
            card.want_group();
        }
        self.tell_before(now);
        self.head_file(now);
        self.figures.count(now, &mut self.book);
        self.card_notices.tick(now, &mut self.book);
        self.check(now, findings);
        let Self { book, recorded, marks, .. } = self;
        happenings::record(now, book, recorded, marks);
        recorded.vehicle(now, book);
        recorded.clock(now, book);
        book.journal.record_losses(now, false);
        if now.since(self.stats_at) >= STATS {
            self.stats_at = now;
            self.record_stats(now);
        }
        if now.since(self.recorded.usage_at()) >= USAGE {
            self.recorded.usage(now, Moment::Periodic, &mut self.book);
        }
        self.marks.tick(now, &mut self.book.journal);
        // Unless full sectors keep storage busy anyway.
        if now.since(self.partial_at) >= PARTIAL && self.book.journal.sectors().is_empty() {
            self.partial_at = now;
            self.book.journal.partial();
        }
        self.talk(now);
    }

    #[inline(never)]
    fn talk(&mut self, now: Instant) {
        let Self { book, companion, figures, identity, .. } = self;
        let own = figures.own(now, book, companion);
        companion.ways.summarise(now, |summary, mut tell| {
            let is_known = book.monitor.vehicle().source.is_some();
            book.notices.tell(now, is_known, &mut summary.outlet, &mut tell);
            summary.own = own;
            summary.tick(now, book.monitor, &mut tell);
        });
        companion.converse(now, book);
        companion.answer(now, book.monitor, identity);
    }

    /// Ends the record in order: all open data is written. The queues then hold the data that storage must write
    /// before a power-off.
    pub fn finish(&mut self, now: Instant) {
        let Self { book, figures, recorded, .. } = self;
        figures.count(now, book);
        book.journal.record_losses(now, true);
        recorded.usage(now, Moment::End, book);
        self.record_stats(now);
        self.book.journal.finish();
    }

    /// Whether a station wants the card-reader mode. The board then calls [`Self::finish`], and restarts.
    pub fn wants_card_reader(&mut self, now: Instant) -> bool {
        self.companion.wants_card_reader(now, self.book.monitor)
    }

    /// The monitor.
    pub const fn monitor(&self) -> &Monitor {
        self.book.monitor
    }

    /// The monitor, to restore, save and set its values.
    pub const fn monitor_mut(&mut self) -> &mut Monitor {
        self.book.monitor
    }

    /// Ground station's port, autopilot's port, baud.
    pub const fn bauds(&self) -> (u32, u32) {
        self.companion.bauds()
    }

    /// Recorded with the others, and sent.
    pub const fn set_machine(&mut self, machine: Machine) {
        self.figures.machine = machine;
    }

    /// The pipeline's figures since power-on.
    pub fn stats(&self) -> Stats {
        self.figures.stats(&self.book, &self.companion)
    }

    /// At power-on, before the first frame is sent.
    pub fn restore_signing<F: NorFlash>(&mut self, store_writer: &mut StoreWriter<'_, F>) {
        self.companion.restore(store_writer);
    }

    /// Hands over items of the signing key at every tick and at the end; whether none is left.
    pub fn save_signing(&mut self, now: Instant, handover: &mut Handover<'_>) -> bool {
        self.companion.save(now, handover)
    }

    #[inline(never)]
    fn check(&mut self, now: Instant, findings: &mut impl FnMut(&Finding)) {
        let Self { book, companion, sequences, figures, .. } = self;
        let link = sequences.reading(now, book.monitor.vehicle().source);
        let recorder = figures.recorder(now, companion.stopped(), book);
        let Logbook { monitor, journal, .. } = book;
        monitor.tick(now.into(), &link, &recorder, &mut |finding| {
            journal.record(now, &Record::Finding(FindingRecord::new(now, finding)));
            if finding.level == Level::Critical {
                journal.event(now, CRITICAL, finding.check);
            }
            companion.ways.summarise(now, |summary, mut tell| summary.finding(now, finding, &mut tell));
            findings(finding);
        });
    }

    #[inline(never)]
    fn record_stats(&mut self, now: Instant) {
        let stats = Record::Stats(self.stats());
        self.book.journal.record(now, &stats);
    }
}

fn restart_words(fault: &Fault<'_>) -> &'static str {
    match fault.kind {
        1 => "panic",
        2 if fault.message == "stack overflow" => "stack overflow",
        2 => "processor fault",
        3 => "watchdog",
        _ => "supply low",
    }
}
