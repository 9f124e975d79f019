//! The latest value of a quantity, with its time.

use crate::time::{BootMs, Millis};

/// The latest value, or nothing yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latest<T> {
    slot: Option<(BootMs, T)>,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self { slot: None }
    }
}

impl<T> Latest<T> {
    /// Replaces the value.
    pub fn set(&mut self, at: BootMs, value: T) {
        self.slot = Some((at, value));
    }

    /// The value, however old.
    pub fn get(&self) -> Option<&T> {
        self.slot.as_ref().map(|(_, value)| value)
    }

    /// When it was set.
    pub fn at(&self) -> Option<BootMs> {
        self.slot.as_ref().map(|(at, _)| *at)
    }

    /// The value, if it is younger than `limit`.
    pub fn within(&self, now: BootMs, limit: Millis) -> Option<&T> {
        self.slot.as_ref().filter(|(at, _)| now.since(*at) <= limit).map(|(_, value)| value)
    }

    /// A figure of the value, however old.
    pub fn read(&self, figure: impl FnOnce(&T) -> Option<f32>) -> Option<Reading> {
        let (at, value) = self.slot.as_ref()?;
        Some(Reading { at: *at, value: figure(value)? })
    }
}

/// A value and when it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// When it was measured.
    pub at: BootMs,
    /// In the unit of the caller. NaN counts as not measured.
    pub value: f32,
}

impl Reading {
    /// A value that was measured at `at`; `None` if either is missing.
    pub fn new(at: Option<BootMs>, value: Option<f32>) -> Option<Self> {
        Some(Self { at: at?, value: value? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_ages() {
        let mut latest = Latest::default();
        assert_eq!(latest.within(BootMs::ZERO, Millis::from_secs(9)), None);
        latest.set(BootMs::from_millis(100), 7);
        assert_eq!(latest.within(BootMs::from_millis(600), Millis::from_millis(500)), Some(&7));
        assert_eq!(latest.within(BootMs::from_millis(601), Millis::from_millis(500)), None);
        assert_eq!(latest.get(), Some(&7));
    }
}
