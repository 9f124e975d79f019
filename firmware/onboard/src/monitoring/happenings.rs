//! What happened, into the record: take-off and landing, phases of flight, snapshots around critical findings, the
//! protective action.

use hums_blackbox::record::{Event, Lost, Moment, Protection, Record, Resting, Snapshot, SnapshotValues};
use hums_core::happening::Happening;
use hums_core::time::Instant;

use super::marks::Marks;
use crate::journal::Logbook;
use crate::notices::Notices;
use crate::queues::SectorsIn;
use crate::records::Recorded;

/// The number of the event that marks a critical finding. The others are in [`record`].
pub(super) const CRITICAL: u8 = 8;

#[inline(never)]
pub(super) fn record(
    now: Instant,
    book: &mut Logbook<'_>,
    recorded: &mut Recorded,
    notices: &mut Notices,
    marks: &mut Marks,
    sectors: &mut SectorsIn,
) {
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
                book.journal.record(now, &Record::Protection(Protection::new(&step)), sectors);
                notices.announce(step);
                continue;
            }
        };
        book.journal.record(now, &Record::Event(Event { number, text }), sectors);
        match happening {
            Happening::Armed | Happening::TakeOff => marks.moves(),
            Happening::Landing => {
                recorded.usage(now, Moment::End, book, sectors);
                marks.rests(Resting::Landed);
            }
            Happening::Disarmed if !book.monitor.flight().airborne() => marks.rests(Resting::Disarmed),
            _ => {}
        }
    }
    let Logbook { monitor, journal, .. } = book;
    journal.lose(now, Lost::Records, u64::from(monitor.take_happenings_lost()));
    while let Some(snapshot) = monitor.take_snapshot(now) {
        let mut values = SnapshotValues::default();
        journal.record(now, &Record::Snapshot(Snapshot::new(&snapshot, &mut values)), sectors);
    }
}
