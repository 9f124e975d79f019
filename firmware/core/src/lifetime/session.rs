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
//! Of a quad with four ESCs after half an hour that is some 155 bytes; at most [`Session::BYTES_MAX`].

use super::{COUNTERS_V1, ITEM_BYTES_MAX, Lifetime};
use crate::bytes::{Put, Take, Unreadable, amount, tenths};
use crate::exposure::{BINS, Exposure, Quantity, Tenths};
use crate::observation::MOTORS_MAX;
use crate::usage::{Form, Totals, UsageCounter, Wear};
use crate::vehicle::BATTERIES_MAX;

const VERSION: u8 = 2;
/// Bytes of a variable-length number of 32 bits.
const VARIABLE_MAX: usize = 5;
const RANGES: usize = BINS * Quantity::ALL.len();
const RANGE_BYTES: usize = RANGES.div_ceil(8);

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

    /// The longest stored form.
    pub const BYTES_MAX: usize = {
        let mut bytes = 1 + 4 + 1;
        let mut place = 0;
        while place < UsageCounter::ALL.len() {
            bytes += match UsageCounter::ALL[place].form() {
                Form::Tenths | Form::Count | Form::Halves => VARIABLE_MAX,
                Form::Amount | Form::Highest | Form::Lowest => 4,
            };
            place += 1;
        }
        bytes
            + (1 + 2 * VARIABLE_MAX * MOTORS_MAX)
            + (1 + 4 * BATTERIES_MAX)
            + (RANGE_BYTES + VARIABLE_MAX * RANGES)
    };

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

    /// Writes the stored form; gives its length.
    pub fn encode(&self, out: &mut [u8]) -> usize {
        let mut put = Put::new(out);
        put.u8(VERSION).u32(self.boots).u8(u8::from(self.heard));
        let (first, later) = UsageCounter::ALL.split_at(COUNTERS_V1);
        self.put_counters(first, &mut put);
        let motors = &self.totals.motors;
        let used = motors.iter().rposition(|motor| motor.seconds > 0.0).map_or(0, |last| last + 1);
        put.u8(used as u8);
        for motor in &motors[..used] {
            put.variable(tenths(motor.seconds)).variable(motor.revolutions as u32);
        }
        let used = self.battery_cycles.iter().rposition(|cycles| *cycles > 0.0).map_or(0, |last| last + 1);
        put.u8(used as u8);
        for cycles in &self.battery_cycles[..used] {
            put.f32(*cycles as f32);
        }
        let mut entered = [0; RANGE_BYTES];
        for (place, _) in self.exposure.iter().flatten().enumerate().filter(|(_, tenths)| **tenths > 0) {
            entered[place / 8] |= 1 << (place % 8);
        }
        put.bytes(&entered);
        for tenths in self.exposure.iter().flatten().filter(|tenths| **tenths > 0) {
            put.variable(*tenths);
        }
        self.put_counters(later, &mut put);
        put.len()
    }

    fn put_counters(&self, counters: &[UsageCounter], put: &mut Put<'_>) {
        for counter in counters {
            let value = self.totals.raw(*counter);
            match counter.form() {
                Form::Tenths => put.variable(tenths(value)),
                Form::Count => put.variable(value as u32),
                Form::Halves => put.variable((2.0 * value) as u32),
                Form::Amount | Form::Highest | Form::Lowest => put.f32(value as f32),
            };
        }
    }

    /// Reads the stored form, of this version or a later one.
    pub fn decode(stored: &[u8]) -> Result<Self, Unreadable> {
        let mut take = Take::new(stored);
        let version = take.u8()?;
        if version == 0 {
            return Err(Unreadable);
        }
        let (boots, heard) = (take.u32()?, take.u8()? != 0);
        let mut totals = Totals::nothing();
        let (first, later) = UsageCounter::ALL.split_at(COUNTERS_V1);
        take_counters(first, &mut totals, &mut take)?;
        let used = usize::from(take.u8()?);
        for motor in totals.motors.get_mut(..used).ok_or(Unreadable)? {
            motor.seconds = f64::from(take.variable()?) / 10.0;
            motor.revolutions = f64::from(take.variable()?);
        }
        let mut battery_cycles = [0.0; BATTERIES_MAX];
        let used = usize::from(take.u8()?);
        for cycles in battery_cycles.get_mut(..used).ok_or(Unreadable)? {
            *cycles = amount(f64::from(take.f32()?));
        }
        let entered: [u8; RANGE_BYTES] = take.array()?;
        let mut exposure: Tenths = [[0; BINS]; Quantity::ALL.len()];
        for (place, tenths) in exposure.iter_mut().flatten().enumerate() {
            if entered[place / 8] & (1 << (place % 8)) != 0 {
                *tenths = take.variable()?;
            }
        }
        if version >= VERSION {
            take_counters(later, &mut totals, &mut take)?;
        }
        Ok(Self { boots, heard, totals, battery_cycles, exposure })
    }
}

fn take_counters(
    counters: &[UsageCounter],
    totals: &mut Totals,
    take: &mut Take<'_>,
) -> Result<(), Unreadable> {
    for counter in counters {
        let value = match counter.form() {
            Form::Tenths => f64::from(take.variable()?) / 10.0,
            Form::Count => f64::from(take.variable()?),
            Form::Halves => f64::from(take.variable()?) / 2.0,
            Form::Amount | Form::Highest => amount(f64::from(take.f32()?)),
            Form::Lowest => {
                Some(f64::from(take.f32()?)).filter(|value| *value >= 0.0).unwrap_or(f64::INFINITY)
            }
        };
        totals.set(*counter, value);
    }
    Ok(())
}

const _: () = assert!(Session::BYTES_MAX <= ITEM_BYTES_MAX);

impl Lifetime {
    /// Adds the session that was saved last, if it is not in it already.
    pub fn add(&mut self, session: &Session) {
        if session.boots == self.boots {
            self.sessions = self.sessions.saturating_add(u32::from(session.heard));
            self.totals = self.totals.join(&session.totals);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half an hour of a quad.
    fn half_an_hour() -> Session {
        let mut totals = Totals::nothing();
        for counter in UsageCounter::ALL {
            let value = match counter.form() {
                Form::Tenths => 1_800.5,
                Form::Count => 1.0,
                Form::Halves => 120.5,
                Form::Amount | Form::Highest | Form::Lowest => 14.25,
            };
            totals.set(*counter, value);
        }
        for motor in &mut totals.motors[..4] {
            (motor.seconds, motor.revolutions) = (1_790.0, 150_000.0);
        }
        let mut exposure = [[0; BINS]; Quantity::ALL.len()];
        for ranges in &mut exposure {
            (ranges[2], ranges[3]) = (12_000, 6_000);
        }
        Session { boots: 70_000, heard: true, totals, battery_cycles: [0.0, 0.5, 0.0, 0.0], exposure }
    }

    #[test]
    fn half_an_hour_of_a_quad_reads_back_and_is_as_short_as_the_sums_say() {
        let mut stored = [0; Session::BYTES_MAX];
        let length = half_an_hour().encode(&mut stored);
        assert_eq!(Session::decode(&stored[..length]), Ok(half_an_hour()));
        assert!(length <= Session::BYTES_TYPICAL, "{length}");
        for cut in 0..length {
            assert_eq!(Session::decode(&stored[..cut]), Err(Unreadable), "{cut}");
        }
        // Version 1 lacks the last counter, one byte here and five at most.
        (stored[0], stored[length - 1]) = (1, 0);
        let first = &stored[..Session::BYTES_MAX - VARIABLE_MAX];
        let sum = first.iter().fold(0_u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
        assert_eq!(sum, 2_790_154_667, "a published layout never changes");
        let mut read = Session::decode(&stored[..length - 1]).expect("version 1 reads");
        read.totals.set(UsageCounter::Mishaps, 1.0);
        assert_eq!(read, half_an_hour());
    }

    #[test]
    fn the_longest_session_fits() {
        let mut session = half_an_hour();
        session.boots = u32::MAX;
        for counter in UsageCounter::ALL {
            session.totals.set(*counter, f64::MAX);
        }
        for motor in &mut session.totals.motors {
            (motor.seconds, motor.revolutions) = (f64::MAX, f64::MAX);
        }
        session.battery_cycles = [f64::MAX; BATTERIES_MAX];
        session.exposure = [[u32::MAX; BINS]; Quantity::ALL.len()];
        let mut stored = [0; Session::BYTES_MAX];
        assert_eq!(session.encode(&mut stored), Session::BYTES_MAX);
        let read = Session::decode(&stored).expect("readable");
        read.totals.for_each(|number, value| assert!(value.is_finite() && value >= 0.0, "{number} {value}"));
    }

    #[test]
    fn no_stored_bytes_make_nonsense() {
        for byte in 0..=255 {
            if let Ok(session) = Session::decode(&[byte; Session::BYTES_MAX]) {
                session
                    .totals
                    .for_each(|number, value| assert!(value.is_finite() && value >= 0.0, "{number}"));
            }
        }
    }

    #[test]
    fn a_session_is_added_once() {
        let mut life = Lifetime { boots: 70_000, sessions: 9, ..Lifetime::new() };
        life.totals.set(UsageCounter::Flights, 10.0);
        let mut merged = Lifetime { boots: 70_001, ..life };
        life.add(&half_an_hour());
        merged.add(&half_an_hour());
        assert_eq!((life.sessions, life.totals.raw(UsageCounter::Flights) as u32), (10, 11));
        assert_eq!(
            (merged.sessions, merged.totals.raw(UsageCounter::Flights) as u32),
            (9, 10),
            "it is in it"
        );
    }
}
