//! The alarms that stand: since when each does, and which other one explains it.

use crate::time::{Instant, Span};

/// Alarms that are kept. One more is reported, and explains nothing.
pub(super) const ALARMS_MAX: usize = 32;

/// An explained alarm that goes on for so long after its cause ended is reported by itself: what a cause disturbed needs
/// some seconds to settle.
pub(super) const OUTLIVES: Span = Span::from_secs(8);

/// An alarm, by the number of its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing {
    pub(super) slot: u16,
    pub(super) since: Instant,
    /// The state whose alarm explains it, and when that ended.
    cause: Option<u16>,
    cause_ended: Option<Instant>,
}

/// All of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alarms([Option<Standing>; ALARMS_MAX]);

impl Alarms {
    pub(super) const NONE: Self = Self([None; ALARMS_MAX]);

    pub(super) fn iter(&self) -> impl Iterator<Item = &Standing> + Clone {
        self.0.iter().flatten()
    }

    /// Since when a state has an alarm, which begins now if it had none.
    pub(super) fn begin(&mut self, slot: u16, now: Instant) -> Instant {
        if let Some(known) = self.iter().find(|known| known.slot == slot) {
            return known.since;
        }
        if let Some(free) = self.0.iter_mut().find(|place| place.is_none()) {
            *free = Some(Standing { slot, since: now, cause: None, cause_ended: None });
        }
        now
    }

    /// A state has an alarm no longer.
    pub(super) fn end(&mut self, slot: u16, now: Instant) {
        for place in &mut self.0 {
            match place {
                Some(ended) if ended.slot == slot => *place = None,
                Some(explained) if explained.cause == Some(slot) && explained.cause_ended.is_none() => {
                    explained.cause_ended = Some(now);
                }
                _ => {}
            }
        }
    }

    /// The state that explains an alarm and still has its own.
    pub(super) fn cause(&self, slot: u16) -> Option<u16> {
        let known = self.iter().find(|known| known.slot == slot)?;
        known.cause.filter(|_| known.cause_ended.is_none())
    }

    /// A state explains an alarm, or none does.
    pub(super) fn explain(&mut self, slot: u16, cause: Option<u16>) {
        if let Some(known) = self.0.iter_mut().flatten().find(|known| known.slot == slot) {
            (known.cause, known.cause_ended) = (cause, None);
        }
    }

    /// The alarm in a place, if it has outlived its cause: it is explained no longer once that is reported.
    pub(super) fn outliving(&self, place: usize, now: Instant) -> Option<u16> {
        let known = self.0.get(place)?.as_ref()?;
        (now.since(known.cause_ended?) >= OUTLIVES).then_some(known.slot)
    }
}
