//! Which item is to be saved, and when: soon after power-on (the boot itself counts), at landing and disarming, every
//! quarter of an hour while it changes, and at once where somebody did something by hand.

use super::ItemKey;
use crate::time::{Instant, Span};

/// The first save: late enough for the store to be ready and the vehicle to be heard.
const FIRST: Span = Span::from_secs(10);
/// What a power cut may cost at most; flash sets it: `hums_onboard::persist` has the sums.
pub const EVERY: Span = Span::from_secs(15 * 60);

/// What waits to be saved.
#[derive(Clone, Copy, Debug)]
pub struct Saving {
    /// Items that changed since they were saved, one bit each by [`ItemKey::index`].
    changed: u16,
    /// Of these, the ones whose time has come.
    due: u16,
    next: Instant,
}

const _: () = assert!(ItemKey::COUNT <= 16);

impl Default for Saving {
    fn default() -> Self {
        Self::new()
    }
}

impl Saving {
    /// Nothing to save yet.
    pub const fn new() -> Self {
        Self { changed: 0, due: 0, next: Instant::from_micros(FIRST.as_micros()) }
    }

    const fn bit(key: ItemKey) -> u16 {
        1 << key.index()
    }

    /// The item is no longer what is saved.
    pub(crate) const fn change(&mut self, key: ItemKey) {
        self.changed |= Self::bit(key);
    }

    /// The item is to be saved now: it was changed by hand.
    pub(crate) const fn hurry(&mut self, key: ItemKey) {
        self.change(key);
        self.due |= Self::bit(key);
    }

    /// Whatever changed is to be saved now.
    pub(crate) const fn hurry_all(&mut self) {
        self.due |= self.changed;
    }

    /// The item to be saved next; the same until it is [`Self::saved`].
    pub(crate) fn due(&mut self, now: Instant) -> Option<ItemKey> {
        if now >= self.next {
            self.next = now + EVERY;
            self.hurry_all();
        }
        if self.due == 0 {
            return None;
        }
        ItemKey::ALL.into_iter().find(|key| self.due & Self::bit(*key) != 0)
    }

    /// The item's bytes are on their way.
    pub(crate) const fn saved(&mut self, key: ItemKey) {
        self.changed &= !Self::bit(key);
        self.due &= !Self::bit(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_waits_for_its_time_and_a_hand_does_not() {
        let mut saving = Saving::new();
        saving.change(ItemKey::Lifetime);
        assert_eq!(saving.due(Instant::from_millis(9_999)), None);
        assert_eq!(saving.due(Instant::from_millis(10_000)), Some(ItemKey::Lifetime));
        assert_eq!(saving.due(Instant::from_millis(10_050)), Some(ItemKey::Lifetime), "until it is saved");
        saving.saved(ItemKey::Lifetime);
        assert_eq!(saving.due(Instant::from_millis(10_100)), None);
        saving.change(ItemKey::Lifetime);
        saving.hurry(ItemKey::Component(3));
        assert_eq!(saving.due(Instant::from_millis(20_000)), Some(ItemKey::Component(3)));
        saving.saved(ItemKey::Component(3));
        assert_eq!(saving.due(Instant::from_millis(909_999)), None);
        assert_eq!(saving.due(Instant::from_millis(910_000)), Some(ItemKey::Lifetime));
    }
}
