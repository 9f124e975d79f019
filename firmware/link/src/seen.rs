//! History of a line: the known messages that each system has sent with our definition, and each system's `crc_extra`
//! for unknown messages. Bounded; strict when full.

/// Most distinguished systems; further ones share the last place.
const SYSTEMS: usize = 4;
/// Words of 32 messages each: room for 512 known messages, and all.xml has 392.
const WORDS: usize = 16;
/// Unknown (system, id) pairs that are remembered.
const EXTRAS: usize = 64;
/// A free place in the table of extras. Id `0xff_ffff` of system 255 looks the same, and is always "seen once".
const FREE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExtraState {
    /// Never seen.
    None,
    Once(u8),
    Confirmed(u8),
    Full,
}

#[derive(Debug)]
pub(crate) struct VerifiedMessages {
    systems: [u8; SYSTEMS],
    systems_used: u8,
    /// One bit for each known message, by its index in the dialect's table.
    verified: [[u32; WORDS]; SYSTEMS],
    /// System in the high byte, message id below.
    keys: [u32; EXTRAS],
    extras: [u8; EXTRAS],
    confirmed: u64,
}

impl VerifiedMessages {
    pub(crate) const fn new() -> Self {
        Self {
            systems: [0; SYSTEMS],
            systems_used: 0,
            verified: [[0; WORDS]; SYSTEMS],
            keys: [FREE; EXTRAS],
            extras: [0; EXTRAS],
            confirmed: 0,
        }
    }

    pub(crate) fn verified(&mut self, system: u8, index: usize) {
        let place = self.place_of(system).unwrap_or_else(|| {
            let used = usize::from(self.systems_used);
            if used < SYSTEMS {
                self.systems[used] = system;
                self.systems_used += 1;
            }
            used.min(SYSTEMS - 1)
        });
        if let Some(word) = self.verified[place].get_mut(index / 32) {
            *word |= 1 << (index % 32);
        }
    }

    /// With a valid checksum. In the shared last place: by any of its systems.
    pub(crate) fn was_verified(&self, system: u8, index: usize) -> bool {
        // The last place is empty until a system has it.
        let place = self.place_of(system).unwrap_or(SYSTEMS - 1);
        self.verified[place].get(index / 32).is_none_or(|word| word & (1 << (index % 32)) != 0)
    }

    pub(crate) fn extra(&self, system: u8, id: u32) -> ExtraState {
        match self.keys.iter().position(|&key| key == key_of(system, id)) {
            Some(at) if self.confirmed & (1 << at) != 0 => ExtraState::Confirmed(self.extras[at]),
            Some(at) => ExtraState::Once(self.extras[at]),
            None if self.place_for_new().is_some() => ExtraState::None,
            None => ExtraState::Full,
        }
    }

    /// A pair seen once may be chance: in a full table it gives way.
    pub(crate) fn learn(&mut self, system: u8, id: u32, extra: u8) {
        let key = key_of(system, id);
        let known = self.keys.iter().position(|&other| other == key);
        if let Some(at) = known
            && self.extras[at] == extra
        {
            self.confirmed |= 1 << at;
        } else if let Some(at) = known.or_else(|| self.place_for_new()) {
            self.keys[at] = key;
            self.extras[at] = extra;
            self.confirmed &= !(1 << at);
        }
    }

    fn place_of(&self, system: u8) -> Option<usize> {
        self.systems[..usize::from(self.systems_used)].iter().position(|&other| other == system)
    }

    fn place_for_new(&self) -> Option<usize> {
        let once = (!self.confirmed).trailing_zeros() as usize;
        self.keys.iter().position(|&key| key == FREE).or((once < EXTRAS).then_some(once))
    }
}

const fn key_of(system: u8, id: u32) -> u32 {
    let [a, b, c, _] = id.to_le_bytes();
    u32::from_le_bytes([a, b, c, system])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dialect_fits() {
        assert!(hums_dialect::messages().len() <= 32 * WORDS);
    }

    #[test]
    fn systems_are_told_apart_until_places_run_out() {
        let mut seen = VerifiedMessages::new();
        for system in 1..=5 {
            assert!(!seen.was_verified(1, 7) || system > 1);
            seen.verified(system, usize::from(system));
        }
        assert!(seen.was_verified(1, 1) && !seen.was_verified(1, 2) && !seen.was_verified(2, 1));
        // 5 shares the place of 4, and so does any later one: strict, never lenient.
        assert!(seen.was_verified(4, 5) && seen.was_verified(5, 4) && seen.was_verified(9, 5));
    }

    #[test]
    fn an_extra_is_confirmed_by_its_second_sight() {
        let mut seen = VerifiedMessages::new();
        assert_eq!(seen.extra(1, 50_000), ExtraState::None);
        seen.learn(1, 50_000, 3);
        assert_eq!(seen.extra(1, 50_000), ExtraState::Once(3));
        seen.learn(1, 50_000, 4);
        assert_eq!(seen.extra(1, 50_000), ExtraState::Once(4));
        seen.learn(1, 50_000, 4);
        assert_eq!(seen.extra(1, 50_000), ExtraState::Confirmed(4));
        assert_eq!(seen.extra(2, 50_000), ExtraState::None);
    }

    #[test]
    fn extras_of_several_ids_are_confirmed_each_by_itself_and_another_extra_begins_anew() {
        let mut seen = VerifiedMessages::new();
        seen.learn(1, 50_000, 3);
        seen.learn(1, 50_001, 5);
        seen.learn(1, 50_001, 5);
        assert_eq!(
            (seen.extra(1, 50_000), seen.extra(1, 50_001)),
            (ExtraState::Once(3), ExtraState::Confirmed(5))
        );
        seen.learn(1, 50_001, 6);
        assert_eq!(
            (seen.extra(1, 50_000), seen.extra(1, 50_001)),
            (ExtraState::Once(3), ExtraState::Once(6))
        );
    }

    #[test]
    fn a_full_table_keeps_what_is_confirmed_and_takes_nothing_new() {
        let mut seen = VerifiedMessages::new();
        for id in 0..EXTRAS as u32 {
            seen.learn(1, 60_000 + id, 1);
            seen.learn(1, 60_000 + id, 1);
        }
        assert_eq!(seen.extra(1, 70_000), ExtraState::Full);
        seen.learn(1, 70_000, 1);
        assert_eq!(seen.extra(1, 70_000), ExtraState::Full);
        assert_eq!(seen.extra(1, 60_000), ExtraState::Confirmed(1));
    }

    #[test]
    fn chance_sights_give_way_when_the_table_is_full() {
        let mut seen = VerifiedMessages::new();
        for id in 0..EXTRAS as u32 {
            seen.learn(1, 60_000 + id, 1);
        }
        seen.learn(1, 70_000, 1);
        assert_eq!(seen.extra(1, 70_000), ExtraState::Once(1));
    }
}
