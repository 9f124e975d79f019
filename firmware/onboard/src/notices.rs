//! Texts of our own that are no findings: recorded at once, and told to the ground station when its budget allows. Those
//! of the protective action and of a mishap are as urgent as a critical finding: the pilot has seconds to cancel the one, and
//! the box may have no more than that to tell where the other was.

use hums_blackbox::record::{Note, Record};
use hums_core::clock::{Instant, Span};
use hums_core::mishap::{Change, Report};
use hums_core::protect::Step;
use hums_link::messages;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::Packet;
use hums_link::text::{Severity, Text};

use crate::journal::Journal;
use crate::queues::{GsIn, SectorsIn};

/// Texts that wait; one more is recorded only.
const WAITING_MAX: usize = 4;
/// How long a restart waits for the vehicle to be known.
const UNKNOWN_MAX: Span = Span::from_secs(5);
/// `MAV_SEVERITY` of what a pilot need not hear of, and whatever is milder.
const INFO: u8 = 6;

/// A text that is still to be told.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Notice {
    /// `MAV_SEVERITY` and the text.
    Text(u8, &'static str),
    /// A step of the protective action.
    Protection(Step),
    /// A mishap began or ended.
    Mishap(Report),
    /// We were restarted: why, and in which task, if it was one.
    Restarted(&'static str, Option<&'static str>),
}

/// Texts that are still to be told.
#[derive(Clone, Debug)]
pub(crate) struct Notices(heapless::Vec<Notice, WAITING_MAX>);

impl Notices {
    pub(crate) const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    /// To be told; where no more can wait, the record has it.
    pub(crate) fn push(&mut self, notice: Notice) {
        let _ = self.0.push(notice);
    }

    /// Records a text of our own, and tells the ground station; `severity` is a `MAV_SEVERITY`.
    pub(crate) fn note(
        &mut self,
        now: Instant,
        severity: u8,
        text: &'static str,
        journal: &mut Journal<'_>,
        sectors: &mut SectorsIn,
    ) {
        journal.record(now, &Record::Note(Note { severity, text }), sectors);
        if severity < INFO {
            self.push(Notice::Text(severity, text));
        }
    }

    /// Tells what is as urgent as the protective action or a mishap, before whatever else waits.
    pub(crate) fn announce(&mut self, notice: Notice) {
        let Self(notices) = self;
        let is_text = |notice: &Notice| !matches!(notice, Notice::Protection(_) | Notice::Mishap(_));
        if notices.is_full() {
            // One less urgent, or the oldest: the record has them all.
            notices.remove(if notices.last().is_some_and(is_text) { WAITING_MAX - 1 } else { 0 });
        }
        let place = notices.iter().position(is_text).unwrap_or(notices.len());
        // There is room.
        let _ = notices.insert(place, notice);
    }

    /// Tells what waits, as far as the budget allows. Nobody knows whose companion we are before the vehicle is known.
    #[inline(never)]
    pub(crate) fn tell(&mut self, now: Instant, is_known: bool, outlet: &mut Outlet, gs: &mut GsIn) {
        while let Some(notice) = self.0.first() {
            // No ground station would show it yet.
            let waits = matches!(notice, Notice::Restarted(..)) && !is_known;
            if waits && now.since(Instant::ZERO) < UNKNOWN_MAX {
                return;
            }
            let (class, packet) = notice.packet();
            if !outlet.send(now, class, &packet, &mut |bytes| gs.tell(bytes)) {
                return;
            }
            self.0.remove(0);
        }
    }
}

impl Notice {
    fn packet(&self) -> (Class, Packet) {
        match self {
            Self::Text(severity, text) => {
                let severity = if *severity < 5 { Severity::Warning } else { Severity::Notice };
                (Class::Finding, messages::status_text(severity, text))
            }
            Self::Restarted(why, task) => {
                let text = match task {
                    Some(task) => Text::new(format_args!("HUMS: restarted after: {why} ({task})")),
                    None => Text::new(format_args!("HUMS: restarted after: {why}")),
                };
                (Class::Finding, messages::status_text(Severity::Warning, text.as_str()))
            }
            Self::Protection(step) => {
                let (severity, text) = step.text();
                let severity = if severity <= 2 { Severity::Critical } else { Severity::Notice };
                (Class::Critical, messages::status_text(severity, &text))
            }
            Self::Mishap(report) => {
                let flies = report.change == Change::FliesOn;
                let severity = if flies { Severity::Notice } else { Severity::Critical };
                let text = Text::new(format_args!("HUMS: {}", report.text()));
                (Class::Critical, messages::status_text(severity, text.as_str()))
            }
        }
    }
}
