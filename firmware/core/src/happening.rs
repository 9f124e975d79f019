//! What happened besides findings: to be recorded, and told where a pilot should hear of it.

use crate::flight::Phase;
use crate::{mishap, protect};

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Happening {
    /// The motors may turn.
    Armed,
    /// The motors may not turn any more.
    Disarmed,
    /// It left the ground.
    TakeOff,
    /// It was in the air when it was first heard: we were started, or started again, in the air.
    FlightResumed,
    /// The flight is over: it is back on the ground, or disarmed.
    Landing,
    /// It does something else now, for a second at least.
    Phase(Phase),
    /// The autopilot restarted.
    AutopilotReboot,
    /// The lifetime that was stored is that of another airframe; a new one begins.
    OtherAirframe,
    /// Another system on the autopilot's port is the vehicle from now on.
    OtherVehicle,
    /// How many cells the vehicle's battery has is not known: no alarm comes from the voltage of its cells.
    CellsUnknown,
    /// A mishap began, ended, or was seen on the bench.
    Mishap(mishap::Change),
    /// A step of the protective action.
    Protect(protect::Step),
}

/// Happenings that wait to be taken: the steps of one tick are far fewer.
const WAITING_MAX: usize = 8;

/// Happenings in order.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Happenings {
    waiting: [Option<Happening>; WAITING_MAX],
    lost: u16,
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

    /// How many found no place since this was asked last.
    pub(crate) const fn take_lost(&mut self) -> u16 {
        core::mem::replace(&mut self.lost, 0)
    }
}
