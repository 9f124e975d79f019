//! What happened, into the record: take-off and landing, phases of flight, snapshots around critical findings, the
//! protective action; and what somebody did by hand: parameters, components.

use hums_blackbox::record::{Event, Moment, Protection, Record, Snapshot, SnapshotValues, Why};
use hums_core::component::Label;
use hums_core::happening::Happening;
use hums_core::time::Instant;

use super::Monitoring;
use crate::queues::SectorsIn;

/// The number of the event that marks a critical finding. The others are in [`Monitoring::record_happenings`].
pub(super) const CRITICAL: u8 = 8;

/// Who did something: MAVLink system and component id; 0, 0 is the monitor itself.
pub type By = (u8, u8);

impl Monitoring<'_> {
    #[inline(never)]
    pub(super) fn record_happenings(&mut self, now: Instant, sectors: &mut SectorsIn) {
        while let Some(happening) = self.monitor.take_happening() {
            let (number, text) = match happening {
                Happening::Armed => (1, ""),
                Happening::Disarmed => (2, ""),
                Happening::TakeOff => (3, ""),
                Happening::Landing => (4, ""),
                Happening::Phase(phase) => (9, phase.name()),
                Happening::AutopilotReboot => (10, ""),
                Happening::OtherAirframe => (11, "the stored lifetime was another one's"),
                Happening::Protect(step) => {
                    self.record(now, &Record::Protection(Protection::new(&step)), sectors);
                    self.announce(step);
                    continue;
                }
            };
            self.record(now, &Record::Event(Event { number, text }), sectors);
            if happening == Happening::Landing {
                self.record_usage(now, Moment::End, sectors);
            }
        }
        let Self { monitor, writer, losses, .. } = self;
        while let Some(snapshot) = monitor.take_snapshot(now) {
            let mut values = SnapshotValues::default();
            let record = Record::Snapshot(Snapshot::new(&snapshot, &mut values));
            super::write(now, &record, writer, losses, sectors);
        }
    }

    /// Another part is in a component's place, from 0: recorded with what the old one has run. `false` where there is no
    /// such component.
    pub fn replace_component(
        &mut self,
        now: Instant,
        place: usize,
        serial: &str,
        by: By,
        sectors: &mut SectorsIn,
    ) -> bool {
        let Some((_, status)) = self.monitor.component_figures(place) else { return false };
        let used_percent = self.monitor.component_used_percent(place);
        let serial = Label::new(serial);
        let Some(old) = self.monitor.replace_component(place, serial) else { return false };
        let record = super::records::component(&old, place, old.ran(), status, used_percent, Why::Replaced);
        let record = hums_blackbox::record::Component { by, new_serial: serial.as_str(), ..record };
        self.record(now, &Record::Component(record), sectors);
        self.record_component(now, place, Why::Status, sectors);
        true
    }

    /// What the operator calls a component, from 0, and its serial number. `false` where there is no such place.
    pub fn name_component(
        &mut self,
        now: Instant,
        place: usize,
        name: &str,
        serial: &str,
        sectors: &mut SectorsIn,
    ) -> bool {
        let named = self.monitor.name_component(place, Label::new(name), Label::new(serial));
        if named {
            self.record_component(now, place, Why::Named, sectors);
        }
        named
    }
}
