//! The mapping's fields, found once for a subscription.

use super::format::{Layout, Number};
use super::message::words;

#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    number: Number,
    offset: u32,
    count: u32,
}

/// `fields`: names with spaces between.
pub(super) fn slots(layout: &Layout, fields: &str) -> Vec<Option<Slot>> {
    let slot = |name: &str| {
        let field = layout.fields.iter().find(|field| field.name == name)?;
        Some(Slot { number: field.number, offset: field.offset, count: field.array.unwrap_or(1) })
    };
    fields.split(' ').map(slot).collect()
}

/// Values by place in `Topic::fields`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a> {
    slots: &'a [Option<Slot>],
    data: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn new(slots: &'a [Option<Slot>], data: &'a [u8]) -> Self {
        Self { slots, data }
    }

    /// `None` if this version of PX4 lacks it.
    pub(super) fn element(&self, field: usize, element: usize) -> Option<f64> {
        let slot = (*self.slots.get(field)?)?;
        if element >= slot.count as usize {
            return None;
        }
        let bytes = slot.number.bytes();
        let at = slot.offset as usize + element * bytes;
        let bytes = self.data.get(at..at + bytes)?;
        slot.number.value(bytes)?.number()
    }

    pub(super) fn get(&self, field: usize) -> Option<f64> {
        self.element(field, 0)
    }

    pub(super) fn finite(&self, field: usize) -> Option<f32> {
        self.get(field).map(|value| value as f32).filter(|value| value.is_finite())
    }

    /// An integer that is not negative.
    pub(super) fn count(&self, field: usize) -> Option<u64> {
        self.get(field).filter(|value| *value >= 0.0).map(|value| value as u64)
    }

    pub(super) fn byte(&self, field: usize) -> Option<u8> {
        self.count(field).and_then(|value| u8::try_from(value).ok())
    }

    /// `false` without one.
    pub(super) fn flag(&self, field: usize) -> bool {
        self.get(field).is_some_and(|value| value != 0.0)
    }

    /// All or none.
    pub(super) fn vector<const N: usize>(&self, field: usize) -> Option<[f32; N]> {
        let mut vector = [0.0; N];
        for (element, value) in vector.iter_mut().enumerate() {
            *value =
                self.element(field, element).map(|value| value as f32).filter(|value| value.is_finite())?;
        }
        Some(vector)
    }

    pub(super) fn words(&self, field: usize) -> Option<&'a str> {
        let slot = (*self.slots.get(field)?)?;
        let at = slot.offset as usize;
        let bytes = self.data.get(at..at + slot.count as usize)?;
        (slot.number == Number::CHAR).then(|| words(bytes))
    }
}
