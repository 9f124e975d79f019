//! Texts of our own that are no findings: recorded at once, and told to the ground station when its budget allows.

use hums_blackbox::record::{Note, Record};
use hums_core::time::Instant;
use hums_link::encode::Severity;
use hums_link::messages;
use hums_link::outlet::Class;

use super::Monitoring;
use crate::queues::{GsIn, SectorsIn};

/// Texts that wait; one more is recorded only.
const WAITING_MAX: usize = 4;
/// `MAV_SEVERITY` of what a pilot need not hear of, and whatever is milder.
const INFO: u8 = 6;

/// Texts that are still to be told.
pub(crate) type Notices = heapless::Vec<(u8, &'static str), WAITING_MAX>;

impl Monitoring<'_> {
    /// Records a text of our own, and tells the ground station; `severity` is a `MAV_SEVERITY`.
    pub fn note(&mut self, now: Instant, severity: u8, text: &'static str, sectors: &mut SectorsIn) {
        self.record(now, &Record::Note(Note { severity, text }), sectors);
        if severity < INFO {
            // Full: the record has it.
            let _ = self.notices.push((severity, text));
        }
    }

    /// Tells what waits, as far as the budget allows.
    pub(super) fn tell_notices(&mut self, now: Instant, gs: &mut GsIn) {
        let Self { notices, summary, .. } = self;
        while let Some((severity, text)) = notices.first() {
            let severity = if *severity < 5 { Severity::Warning } else { Severity::Notice };
            let packet = messages::status_text(severity, text);
            if !summary.outlet.send(now, Class::Finding, &packet, &mut |bytes| gs.tell(bytes)) {
                return;
            }
            notices.remove(0);
        }
    }
}
