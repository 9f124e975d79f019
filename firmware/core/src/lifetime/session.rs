//! What a session, that is a power-on, has counted so far: the one item that is saved again and again in flight, so it
//! is short. At the next start it is added to what was saved of the life before it.
//!
//! Each item that adds up over sessions says which power-on it is *as of*: what was lived before that one began. The
//! session is added to those that are as of the same power-on, and to no other. So whatever item power went at, in the
//! middle of saving them all, each figure is counted once: an item that was not yet saved again still has the session
//! added, and one that was has it in it.
//!
//! Layout, version 1: version, power-on (u32), whether the airframe was heard (u8); the counters in the order of
//! [`UsageCounter::ALL`], times in tenths of a second, counts and half cycles as variable-length numbers (LEB128),
//! amounts and extremes as f32; motors, how many of them, and of each tenths of a second and whole revolutions (u32,
//! variable length); batteries, how many, and the cycles of each (f32); time in ranges, a bit for each range that was
//! entered (5 bytes), and of these tenths of a second, variable length. Version 2 appends the counters that came since, as the
//! others.
//!
//! Of a quad with four ESCs after half an hour that is some 155 bytes; at most [`Session::BYTES`](super::Item::BYTES).

use super::{COUNTERS_V1, Item, Lifetime, Unreadable, counters, motors};
use crate::bytes::{Fields, fields};
use crate::exposure::{BINS, Exposure, NOTHING, Quantity, Tenths};
use crate::usage::{Form, Totals, UsageCounter, Wear};
use crate::vehicle::BATTERIES_MAX;

const RANGE_BYTES: usize = (BINS * Quantity::ALL.len()).div_ceil(8);

/// A session as it was stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Session {
    /// Which power-on it was.
    pub boots: u32,
    /// Whether the airframe was heard.
    pub heard: bool,
    /// What it counted.
    pub totals: Totals,
    battery_cycles: [f64; BATTERIES_MAX],
    exposure: Tenths,
}

impl Session {
    /// What a quad with four ESCs needs after half an hour, generously.
    pub const BYTES_TYPICAL: usize = 160;

    #[cfg(test)]
    pub(super) const fn of(
        boots: u32,
        totals: &Totals,
        battery_cycles: [f64; BATTERIES_MAX],
        exposure: Tenths,
    ) -> Self {
        Self { boots, heard: true, totals: *totals, battery_cycles, exposure }
    }

    /// The session as it stands.
    pub(crate) fn now(
        boots: u32,
        heard: bool,
        totals: &Totals,
        wear: &Wear<'_>,
        exposure: &Exposure,
    ) -> Self {
        let mut battery_cycles = [0.0; BATTERIES_MAX];
        for (to, cycles) in battery_cycles.iter_mut().zip(wear.battery_cycles) {
            *to = *cycles;
        }
        Self { boots, heard, totals: *totals, battery_cycles, exposure: *exposure.session() }
    }

    /// What components wore by it.
    pub(crate) const fn wear(&self) -> Wear<'_> {
        Wear { totals: &self.totals, battery_cycles: &self.battery_cycles }
    }

    pub(crate) const fn exposure(&self) -> &Tenths {
        &self.exposure
    }
}

impl Item for Session {
    const VERSION: u8 = 2;
    const BYTES: usize = 503;
    const SHORT: bool = true;
    const EMPTY: Self = Self {
        boots: 0,
        heard: false,
        totals: Totals::nothing(),
        battery_cycles: [0.0; BATTERIES_MAX],
        exposure: NOTHING,
    };

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        let Self { boots, heard, totals, battery_cycles, exposure } = self;
        let mut was_heard = u8::from(*heard);
        fields!(fields: boots, was_heard);
        *heard = was_heard != 0;
        counters(totals, 0..COUNTERS_V1, fields)?;
        motors(totals, fields)?;
        fields.list(
            battery_cycles,
            |cycles| *cycles > 0.0,
            |fields, cycles| fields.counter(Form::Amount, cycles),
        )?;
        let mut entered = [0_u8; RANGE_BYTES];
        for (place, _) in exposure.iter().flatten().enumerate().filter(|(_, tenths)| **tenths > 0) {
            entered[place / 8] |= 1 << (place % 8);
        }
        fields!(fields: entered);
        let ranges = exposure.iter_mut().flatten().enumerate();
        ranges
            .filter(|(place, _)| entered[place / 8] & 1 << (place % 8) != 0)
            .try_for_each(|(_, tenths)| fields.count(tenths))?;
        counters(totals, COUNTERS_V1..UsageCounter::ALL.len(), fields)
    }
}

impl Lifetime {
    /// Adds the session that was saved last, if it is not in it already.
    pub fn add(&mut self, session: &Session) {
        if session.boots == self.boots {
            self.sessions = self.sessions.saturating_add(u32::from(session.heard));
            self.totals = self.totals.join(&session.totals);
        }
    }
}
