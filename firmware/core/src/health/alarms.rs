//! The standing alarms: their onsets, and the alarm that explains each.

use super::finding::Level;
use super::suppression::Alarm;
use super::tables::STATES;
use crate::time::{BootMs, Millis};

/// Alarms that are kept. One more is reported, explains nothing and is not explained. The square of this number bounds the search
/// for causes at each change of a level. The worst step takes as long as 21 usual ones (46 us on a PC).
pub(super) const ALARMS_MAX: usize = 32;

/// An explained alarm is reported by itself if it lasts this long after its cause ended or fell below it. A disturbed
/// estimator needs some seconds to settle.
pub(super) const OUTLIVES: Millis = Millis::from_secs(8);

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OpenAlarm {
    slot: u16,
    level: Level,
    since: BootMs,
    /// The state whose alarm explains it, and when that ended or fell below this one.
    pub(super) cause: Option<u16>,
    cause_ended: Option<BootMs>,
}

impl OpenAlarm {
    pub(super) fn alarm(&self) -> Option<Alarm> {
        Alarm::at(self.slot, self.level, self.since)
    }
}

state! {
    /// All of them.
    pub(super) struct Alarms {
        standing: [Option<OpenAlarm>; ALARMS_MAX] = [None; ALARMS_MAX],
        /// The states that are stale because of a silent link, a bit each.
        silenced: [u32; STATES.div_ceil(32)] = [0; STATES.div_ceil(32)],
        /// The state whose alarm explains these, and when that ended.
        silence: Option<u16>,
        silence_ended: Option<BootMs>,
    }
}

impl Alarms {
    pub(super) fn iter(&self) -> impl Iterator<Item = &OpenAlarm> + Clone {
        self.standing.iter().flatten()
    }

    /// A state's level changes. A rise is an onset of its own, with no cause yet. From now on an effect outlives this alarm if that no longer
    /// explains it at its new level.
    pub(super) fn change(&mut self, slot: u16, level: Level, now: BootMs) {
        let is_alarm = level.alarm() > 0;
        for known in self.standing.iter_mut().flatten() {
            let explains = is_alarm && level as u8 >= known.level as u8;
            if known.cause == Some(slot) && known.cause_ended.is_none() && !explains {
                known.cause_ended = Some(now);
            }
        }
        if self.silence == Some(slot) {
            self.silence_ended = (!is_alarm).then_some(now);
        }
        self.set_silenced(slot, false);
        let of = |slot: Option<u16>| {
            move |place: &Option<OpenAlarm>| place.as_ref().map(|known| known.slot) == slot
        };
        let mut places = self.standing.iter();
        let place = places.clone().position(of(Some(slot))).or_else(|| places.position(of(None)));
        let Some(place) = place.and_then(|place| self.standing.get_mut(place)) else { return };
        *place = match *place {
            _ if !is_alarm => None,
            Some(known) if (level as u8) < known.level as u8 => Some(OpenAlarm { level, ..known }),
            _ => Some(OpenAlarm { slot, level, since: now, cause: None, cause_ended: None }),
        };
    }

    pub(super) fn of(&self, slot: u16) -> Option<&OpenAlarm> {
        self.iter().find(|known| known.slot == slot)
    }

    pub(super) fn cause(&self, slot: u16) -> Option<u16> {
        let known = self.of(slot)?;
        known.cause.filter(|_| known.cause_ended.is_none())
    }

    pub(super) fn unexplained(&self, place: usize) -> Option<Alarm> {
        let known = self.standing.get(place)?.as_ref()?;
        if known.cause.is_none() || known.cause_ended.is_some() { known.alarm() } else { None }
    }

    pub(super) fn explain(&mut self, place: usize, cause: Option<u16>) {
        if let Some(known) = self.standing.get_mut(place).and_then(Option::as_mut) {
            (known.cause, known.cause_ended) = (cause, None);
        }
    }

    pub(super) fn outliving(&self, place: usize, now: BootMs) -> Option<u16> {
        let known = self.standing.get(place)?.as_ref()?;
        (now.since(known.cause_ended?) >= OUTLIVES).then_some(known.slot)
    }

    fn set_silenced(&mut self, slot: u16, is: bool) {
        if let Some(word) = self.silenced.get_mut(usize::from(slot / 32)) {
            let bit = 1 << (slot % 32);
            *word = if is { *word | bit } else { *word & !bit };
        }
    }

    pub(super) fn silence(&mut self, slot: u16, cause: u16) {
        (self.silence, self.silence_ended) = (Some(cause), None);
        self.set_silenced(slot, true);
    }

    /// A state that is stale still when its silence is over for [`OUTLIVES`]; each once.
    pub(super) fn outliving_silence(&mut self, now: BootMs) -> Option<u16> {
        if now.since(self.silence_ended?) < OUTLIVES {
            return None;
        }
        let (word, bits) = (0..).zip(&self.silenced).find(|(_, bits)| **bits != 0)?;
        let slot = word * 32 + bits.trailing_zeros() as u16;
        self.set_silenced(slot, false);
        Some(slot)
    }
}
