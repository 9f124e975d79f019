//! Texts of our own besides findings: recorded at once, and sent to the ground station when its budget allows.
//!
//! Texts of the protective action and of a mishap are as urgent as a critical finding. The pilot has seconds to
//! cancel an action, and after a mishap the box may have only seconds to send its place.

use hums_blackbox::record::{Note, Record};
use hums_core::clock::{Instant, Span};
use hums_core::mishap::{MishapChange, Report};
use hums_core::protect::Step;
use hums_link::messages;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::Packet;
use hums_link::statustext::{Severity, Text};

use crate::journal::Journal;
use crate::queues::SectorsIn;

const WAITING_MAX: usize = 4;
/// Time that a restart's text waits for a known vehicle.
const UNKNOWN_MAX: Span = Span::from_secs(5);
/// `MAV_SEVERITY` of texts that a pilot need not see, and of milder ones.
const INFO: u8 = 6;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Notice {
    /// `MAV_SEVERITY` and the text.
    Text(u8, &'static str),
    Protection(Step),
    Mishap(Report),
    Restarted(&'static str, Option<&'static str>),
}

#[derive(Clone, Debug)]
pub(crate) struct Notices(heapless::Vec<Notice, WAITING_MAX>);

impl Notices {
    pub(crate) const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    pub(crate) fn push(&mut self, notice: Notice) {
        let _ = self.0.push(notice);
    }

    /// `severity` is a `MAV_SEVERITY`.
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

    /// A text of the protective action or a mishap, before all others.
    pub(crate) fn announce(&mut self, notice: Notice) {
        let Self(notices) = self;
        let is_text = |notice: &Notice| !matches!(notice, Notice::Protection(_) | Notice::Mishap(_));
        if notices.is_full() {
            // Drops a less urgent one, or the oldest: the record has them all.
            notices.remove(if notices.last().is_some_and(is_text) { WAITING_MAX - 1 } else { 0 });
        }
        let place = notices.iter().position(is_text).unwrap_or(notices.len());
        // There is room.
        let _ = notices.insert(place, notice);
    }

    /// As far as the budget allows; our system is unknown before the vehicle is.
    #[inline(never)]
    pub(crate) fn tell(
        &mut self,
        now: Instant,
        is_known: bool,
        outlet: &mut Outlet,
        out: &mut impl FnMut(&[u8]),
    ) {
        while let Some(notice) = self.0.first() {
            // No ground station would show it yet.
            let waits = matches!(notice, Notice::Restarted(..)) && !is_known;
            if waits && now.since(Instant::ZERO) < UNKNOWN_MAX {
                return;
            }
            let (class, packet) = notice.packet();
            if !outlet.send(now, class, &packet, out) {
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
                let flies = report.change == MishapChange::FliesOn;
                let severity = if flies { Severity::Notice } else { Severity::Critical };
                let text = Text::new(format_args!("HUMS: {}", report.text()));
                (Class::Critical, messages::status_text(severity, text.as_str()))
            }
        }
    }
}
