//! Which item is to be saved, and when.
//!
//! | what | when |
//! |---|---|
//! | everything that changed | 10 s after power-on (the boot itself counts), at landing and disarming, every quarter of an hour, at the end |
//! | the session's counters | armed, every two minutes as well; in a power-on of more than an hour, every thirtieth of it |
//! | what somebody changed by hand | at once |
//!
//! Totals of earlier sessions do not change. So after the first save only the session's counters (160 bytes for a
//! quad) and exceedances are saved again. In T hours armed the counters are saved 30 (1 + ln T) times: 30 in one
//! hour, 63 in three, 81 in five and a half. The flash sets this limit; `hums_onboard::persist` has the sums.

use super::ItemKey;
use crate::time::{BootMs, Millis};

/// The first save: late enough for the store to be ready and the vehicle to be heard.
const FIRST: Millis = Millis::from_secs(10);
/// The longest time until a change is saved.
pub const EVERY: Millis = Millis::from_secs(15 * 60);
/// The longest time until counters are saved in flight, in the first hour of a power-on; a power cut loses no more.
pub const EVERY_ARMED: Millis = Millis::from_secs(2 * 60);
const EVERY_PART: u64 = 30;

/// Whether the store has room to spare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Room {
    /// As much as is needed.
    #[default]
    Enough,
    /// Only what landing and disarming need: nothing is saved by time alone.
    Reserve,
}

state! {
    /// The items that wait to be saved.
    pub struct Saving {
        /// Items that changed since they were saved, one bit each by [`ItemKey::number`].
        changed: u32 = Self::bit(ItemKey::Lifetime),
        /// Of these, the ones whose time has come.
        due: u32,
        next: BootMs = BootMs::from_millis(FIRST.as_millis()),
        session_at: BootMs,
    }
}

impl Saving {
    const fn bit(key: ItemKey) -> u32 {
        1 << key.number()
    }

    pub(crate) const fn change(&mut self, key: ItemKey) {
        self.changed |= Self::bit(key);
    }

    pub(crate) const fn hurry(&mut self, key: ItemKey) {
        self.change(key);
        self.due |= Self::bit(key);
    }

    pub(crate) const fn hurry_all(&mut self) {
        self.due |= self.changed;
    }

    /// The next item to save; it stays the next one until it is [`Self::saved`].
    pub(crate) fn due(&mut self, now: BootMs, armed: bool, room: Room) -> Option<ItemKey> {
        if room == Room::Enough {
            if !self.next.is_after(now) {
                self.next = now + EVERY;
                self.hurry_all();
            }
            let every = EVERY_ARMED.max(Millis::from_millis(now.as_millis() / EVERY_PART));
            if armed && now.since(self.session_at) >= every {
                self.due |= self.changed & Self::bit(ItemKey::Session);
            }
        }
        if self.due == 0 {
            return None;
        }
        let due = ItemKey::all().find(|key| self.due & Self::bit(*key) != 0);
        if due == Some(ItemKey::Session) {
            self.session_at = now;
        }
        due
    }

    pub(crate) const fn saved(&mut self, key: ItemKey) {
        self.changed &= !Self::bit(key);
        self.due &= !Self::bit(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Option<ItemKey> = None;

    fn take(saving: &mut Saving, at_s: u64, armed: bool) -> Vec<ItemKey> {
        let mut keys = Vec::new();
        while let Some(key) = saving.due(BootMs::from_millis(at_s * 1_000), armed, Room::Enough) {
            saving.saved(key);
            keys.push(key);
        }
        keys
    }

    #[test]
    fn a_change_waits_for_its_time_and_a_hand_does_not() {
        let mut saving = Saving::default();
        assert_eq!(saving.due(BootMs::from_millis(9_999), false, Room::Enough), NOTHING);
        let first = Some(ItemKey::Lifetime);
        assert_eq!(saving.due(BootMs::from_millis(10_000), false, Room::Enough), first);
        assert_eq!(saving.due(BootMs::from_millis(10_050), false, Room::Enough), first, "until it is saved");
        assert_eq!(take(&mut saving, 11, false), [ItemKey::Lifetime]);
        saving.change(ItemKey::Exceedances);
        saving.hurry(ItemKey::Component(3));
        assert_eq!(take(&mut saving, 20, false), [ItemKey::Component(3)]);
        assert_eq!(take(&mut saving, 909, false), []);
        assert_eq!(take(&mut saving, 910, false), [ItemKey::Exceedances]);
    }

    #[test]
    fn armed_the_session_is_saved_every_two_minutes_and_in_a_long_one_every_thirtieth_of_it() {
        let mut saving = Saving::default();
        let mut times_s = Vec::new();
        for at_s in 0..20_000 {
            saving.change(ItemKey::Session);
            if take(&mut saving, at_s, true).contains(&ItemKey::Session) {
                times_s.push(at_s);
            }
        }
        for pair in times_s.windows(2) {
            assert!(pair[1] - pair[0] <= 120.max(pair[1] / 30 + 1), "{pair:?}");
        }
        // 30 (1 + ln 5.6), and one each quarter of an hour.
        assert!((80..=110).contains(&times_s.len()), "{}", times_s.len());
    }

    #[test]
    fn what_is_left_for_the_landing_is_not_used_by_time_alone() {
        let mut saving = Saving::default();
        take(&mut saving, 10, true);
        saving.change(ItemKey::Session);
        let at = BootMs::from_millis(2_000_000);
        assert_eq!(saving.due(at, true, Room::Reserve), NOTHING);
        saving.hurry_all();
        assert_eq!(saving.due(at, true, Room::Reserve), Some(ItemKey::Session));
    }
}
