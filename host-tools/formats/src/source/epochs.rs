//! UTC of a recording's power-ons.

use hums_core::clock::Instant;

use super::item::Item;

const PARTS_MAX: usize = 10_000;

/// UTC at time zero of each part, microseconds since 1970; a restart begins a part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Epochs {
    first_us: Option<u64>,
    /// Start and UTC.
    later: Vec<(Instant, Option<u64>)>,
}

impl Epochs {
    /// One clock, with this UTC at time zero.
    pub fn of(epoch_us: Option<u64>) -> Self {
        Self { first_us: epoch_us, later: Vec::new() }
    }

    /// The next item.
    pub fn take(&mut self, at: Instant, item: &Item<'_>) {
        match item {
            Item::Epoch(epoch_us) => self.epoch(*epoch_us),
            Item::Restart | Item::Joint => self.restart(at),
            _ => {}
        }
    }

    fn epoch(&mut self, epoch_us: u64) {
        let part = self.later.last_mut().map_or(&mut self.first_us, |(_, epoch_us)| epoch_us);
        *part = Some(epoch_us);
    }

    fn restart(&mut self, at: Instant) {
        if self.later.len() < PARTS_MAX {
            self.later.push((at, None));
        } else if let Some((_, epoch_us)) = self.later.last_mut() {
            *epoch_us = None;
        }
    }

    /// Parts with unknown UTC, and all.
    pub fn untold(&self) -> (usize, usize) {
        let parts = std::iter::once(self.first_us).chain(self.later.iter().map(|(_, epoch_us)| *epoch_us));
        (parts.filter(Option::is_none).count(), 1 + self.later.len())
    }

    /// Microseconds since 1970, by the clock of that part.
    pub fn utc_us(&self, at: Instant) -> Option<u64> {
        let part = self.later.iter().rev().find(|(from, _)| *from <= at);
        let epoch_us = part.map_or(self.first_us, |(_, epoch_us)| *epoch_us)?;
        Some(epoch_us.saturating_add(at.as_micros()))
    }

    /// UTC at time zero, if the recording has one clock.
    pub fn whole(&self) -> Option<u64> {
        self.first_us.filter(|_| self.later.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_told_by_the_clock_of_its_own_part() {
        let at = Instant::from_millis;
        let mut epochs = Epochs::default();
        epochs.epoch(1_000_000);
        assert_eq!((epochs.utc_us(at(2_000)), epochs.whole()), (Some(3_000_000), Some(1_000_000)));
        epochs.restart(at(10_000));
        assert_eq!(epochs.utc_us(at(9_000)), Some(10_000_000));
        assert_eq!((epochs.utc_us(at(10_000)), epochs.whole()), (None, None));
        epochs.epoch(50_000_000);
        assert_eq!(
            (epochs.utc_us(at(9_000)), epochs.utc_us(at(11_000))),
            (Some(10_000_000), Some(61_000_000))
        );
    }
}
