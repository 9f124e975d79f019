//! Texts of our own that are no findings: recorded at once, and told to the ground station when its budget allows. Those
//! of the protective action are as urgent as a critical finding: the pilot has seconds to cancel it.

use hums_blackbox::record::{Note, Record};
use hums_core::protect::Step;
use hums_core::time::{Instant, Span};
use hums_link::messages;
use hums_link::outlet::Class;
use hums_link::text::{Severity, Text};

use super::Monitoring;
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
    /// We were restarted: why, and in which task, if it was one.
    Restarted(&'static str, Option<&'static str>),
}

/// Texts that are still to be told.
pub(crate) type Notices = heapless::Vec<Notice, WAITING_MAX>;

impl Monitoring<'_> {
    /// Records a text of our own, and tells the ground station; `severity` is a `MAV_SEVERITY`.
    pub fn note(&mut self, now: Instant, severity: u8, text: &'static str, sectors: &mut SectorsIn) {
        self.record(now, &Record::Note(Note { severity, text }), sectors);
        if severity < INFO {
            // Full: the record has it.
            let _ = self.notices.push(Notice::Text(severity, text));
        }
    }

    /// Tells what the protective action does, before whatever else waits.
    pub(super) fn announce(&mut self, step: Step) {
        let notices = &mut self.notices;
        let is_text = |notice: &Notice| !matches!(notice, Notice::Protection(_));
        if notices.is_full() {
            // One less urgent, or the oldest: the record has them all.
            notices.remove(if notices.last().is_some_and(is_text) { WAITING_MAX - 1 } else { 0 });
        }
        let place = notices.iter().position(is_text).unwrap_or(notices.len());
        // There is room.
        let _ = notices.insert(place, Notice::Protection(step));
    }

    /// Tells what waits, as far as the budget allows.
    #[inline(never)]
    pub(super) fn tell_notices(&mut self, now: Instant, gs: &mut GsIn) {
        let Self { notices, summary, monitor, .. } = self;
        while let Some(notice) = notices.first() {
            let (class, packet) = match notice {
                Notice::Text(severity, text) => {
                    let severity = if *severity < 5 { Severity::Warning } else { Severity::Notice };
                    (Class::Finding, messages::status_text(severity, text))
                }
                Notice::Restarted(why, task) => {
                    // Until then nobody knows whose companion we are, and no ground station would show it.
                    if monitor.vehicle().source.is_none() && now.since(Instant::ZERO) < UNKNOWN_MAX {
                        return;
                    }
                    let text = match task {
                        Some(task) => Text::new(format_args!("HUMS: restarted after: {why} ({task})")),
                        None => Text::new(format_args!("HUMS: restarted after: {why}")),
                    };
                    (Class::Finding, messages::status_text(Severity::Warning, text.as_str()))
                }
                Notice::Protection(step) => {
                    let (severity, text) = step.text();
                    let severity = if severity <= 2 { Severity::Critical } else { Severity::Notice };
                    (Class::Critical, messages::status_text(severity, &text))
                }
            };
            if !summary.outlet.send(now, class, &packet, &mut |bytes| gs.tell(bytes)) {
                return;
            }
            notices.remove(0);
        }
    }
}
