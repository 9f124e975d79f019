//! Events besides findings: for the record, and for the pilot if they have a text.

use crate::flight::Phase;
use crate::{mishap, protect};

/// An event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Happening {
    /// The motors may turn.
    Armed,
    /// The motors may not turn any more.
    Disarmed,
    /// It left the ground.
    TakeOff,
    /// The vehicle was in the air at first contact: the monitor started, or restarted, in flight.
    FlightResumed,
    /// The flight is over: it is back on the ground, or disarmed.
    Landing,
    /// The phase changed, for a second at least.
    Phase(Phase),
    /// The autopilot restarted.
    AutopilotReboot,
    /// The stored lifetime belongs to another airframe; a new one begins.
    OtherAirframe,
    /// Another system on the autopilot's port became the vehicle.
    OtherVehicle,
    /// The number of cells is unknown: cell voltage raises no alarm.
    CellsUnknown,
    /// A mishap began, ended, or was seen on the bench.
    Mishap(mishap::MishapChange),
    /// A step of the protective action.
    Protect(protect::Step),
}

/// Events that wait to be taken: one tick makes far fewer.
const WAITING_MAX: usize = 8;

/// Events in order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Happenings {
    waiting: [Option<Happening>; WAITING_MAX],
    pub(crate) lost: u16,
}

impl Happenings {
    pub(crate) fn push(&mut self, happening: Happening) {
        match self.waiting.iter_mut().find(|place| place.is_none()) {
            Some(place) => *place = Some(happening),
            None => self.lost = self.lost.saturating_add(1),
        }
    }

    pub(crate) fn take(&mut self) -> Option<Happening> {
        self.waiting.rotate_left(1);
        self.waiting[WAITING_MAX - 1].take()
    }
}
