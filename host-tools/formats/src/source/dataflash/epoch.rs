//! UTC at the log's time zero, by the autopilot's GPS.

const DIFFERS_US: u64 = 1_500_000;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Epoch {
    known_us: Option<u64>,
    /// Different from the reported one.
    other_us: Option<u64>,
}

impl Epoch {
    /// Returns a new value; it must come twice: one damaged bit moves the date by years.
    pub(super) fn take(&mut self, epoch_us: u64) -> Option<u64> {
        let is_near = |other: Option<u64>| other.is_some_and(|other| other.abs_diff(epoch_us) < DIFFERS_US);
        if is_near(self.known_us) {
            self.other_us = None;
            return None;
        }
        if self.known_us.is_some() && !is_near(self.other_us) {
            self.other_us = Some(epoch_us);
            return None;
        }
        *self = Self { known_us: Some(epoch_us), other_us: None };
        Some(epoch_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;
    const YEAR: u64 = 365 * 24 * 3600 * SECOND;

    #[test]
    fn one_wrong_time_does_not_move_the_date_and_two_that_agree_do() {
        let mut epoch = Epoch::default();
        let now = 56 * YEAR;
        assert_eq!(epoch.take(now), Some(now), "the first one");
        assert_eq!(epoch.take(now + 8 * YEAR), None, "a damaged bit");
        assert_eq!(epoch.take(now + SECOND), None, "as before, with the receiver's delay");
        assert_eq!(epoch.take(now + 8 * YEAR), None, "another damaged one, not right after the first");
        assert_eq!(epoch.take(now - YEAR), None, "two that do not agree");
        let set = now - YEAR + SECOND;
        assert_eq!(epoch.take(set), Some(set), "the receiver knows better now");
        assert_eq!((epoch.take(set), epoch.take(now)), (None, None));
    }

    #[test]
    fn a_wrong_first_time_is_put_right_by_two_others() {
        let mut epoch = Epoch::default();
        assert_eq!(epoch.take(YEAR), Some(YEAR));
        assert_eq!([epoch.take(56 * YEAR), epoch.take(56 * YEAR + SECOND)], [None, Some(56 * YEAR + SECOND)]);
    }
}
