//! Events for the record.

use hums_blackbox::record::{LossKind, MarkReason, Moment, Protection, Record};
use hums_core::clock::Instant;
use hums_core::happening::Happening;
use hums_core::mishap::MishapChange;

use super::marks::Marks;
use crate::journal::Logbook;
use crate::notices::{self, Notice};
use crate::records::RecordedState;

/// `MAV_SEVERITY_WARNING`
const WARNING: u8 = 4;
/// The text of a change of propellers, battery or payload.
pub const PARTS_CHANGED: &str = "baselines anew";
/// An unknown number of cells.
pub const CELLS_UNKNOWN: &str = "HUMS: cells not known, set BAT_CELLS";
/// The number of the event that marks a critical finding. The others are in [`record`].
pub(super) const CRITICAL: u8 = 8;

#[inline(never)]
pub(super) fn record(now: Instant, book: &mut Logbook<'_>, recorded: &mut RecordedState, marks: &mut Marks) {
    while let Some(happening) = book.monitor.take_happening() {
        let (number, text) = match happening {
            Happening::Armed => (1, ""),
            Happening::Disarmed => (2, ""),
            Happening::TakeOff => (3, ""),
            Happening::Landing => (4, ""),
            Happening::FlightResumed => (14, ""),
            Happening::Phase(phase) => (9, phase.name()),
            Happening::AutopilotReboot => (10, ""),
            Happening::OtherAirframe => (11, "the stored lifetime was another one's"),
            Happening::OtherVehicle => (13, "another system on the port is the vehicle"),
            Happening::Protect(step) => {
                book.journal.record(now, &Record::Protection(Protection::new(&step)));
                book.notices.announce(Notice::Protection(step));
                continue;
            }
            Happening::CellsUnknown => {
                book.note(now, WARNING, CELLS_UNKNOWN);
                continue;
            }
            Happening::Mishap(change) => {
                mishap(now, change, book, marks);
                continue;
            }
        };
        book.journal.event(now, number, text);
        match happening {
            Happening::Armed | Happening::TakeOff | Happening::FlightResumed => marks.moves(),
            Happening::Landing => {
                recorded.usage(now, Moment::End, book);
                marks.rests(MarkReason::Landed);
            }
            Happening::Disarmed if !book.monitor.flight().airborne() => marks.rests(MarkReason::Disarmed),
            _ => {}
        }
    }
    let Logbook { monitor, journal, .. } = book;
    journal.lose(now, LossKind::Records, u64::from(monitor.take_happenings_lost()));
}

fn mishap(now: Instant, change: MishapChange, book: &mut Logbook<'_>, marks: &mut Marks) {
    let number = match change {
        MishapChange::Began(_) => 15,
        MishapChange::Down => 16,
        MishapChange::FliesOn | MishapChange::FliesAgain => 17,
        MishapChange::OnBench(kind) => {
            return book.journal.event(now, 18, kind.name());
        }
    };
    let report = book.monitor.flight().report(change);
    let text = notices::of_mishap(&report);
    book.journal.event(now, number, text.as_str());
    // The beginning is reported as a finding.
    if !matches!(change, MishapChange::Began(_)) {
        book.notices.announce(Notice::Mishap(report));
    }
    marks.at_once(MarkReason::Mishap);
}
