//! Items that outlive power: totals over an airframe's life, and its components, as bytes for a store.
//!
//! Counters of earlier sessions are saved once, at the beginning of a session. The session's own counters are one
//! short item ([`Session`]) that is saved often.
//!
//! An item is a version byte and then fields, little endian. A later version only appends: each reads
//! the items of the other, with zero in missing fields. The store guards the bytes (a checksum, two
//! copies); decoding only keeps figures in their ranges.
//!
//! Figures keep their precision over the life of an airframe:
//!
//! - times are tenths of a second in 32 bits (119,000 hours), rounded once a session;
//! - counts have 32 bits;
//! - amounts (distance, charge, energy, revolutions) have double precision: after 10,000 hours at 10,000 rpm, a
//!   millionth of a revolution.

mod saving;
mod session;

pub use saving::{EVERY, EVERY_ARMED, Room, Saving};
pub use session::Session;

use crate::bytes::{Fields, fields};
pub use crate::bytes::{Item, Unreadable};
use crate::component::{COMPONENTS_MAX, Component};
use crate::health::exceedance::Exceedances;
use crate::usage::Totals;
use crate::vehicle::BATTERIES_MAX;

/// The longest item. Each has its own length.
pub const ITEM_BYTES_MAX: usize = 512;

const _: () = assert!(Lifetime::BYTES <= ITEM_BYTES_MAX && Exceedances::BYTES <= ITEM_BYTES_MAX);
const _: () = assert!(Component::BYTES <= ITEM_BYTES_MAX && Session::BYTES <= ITEM_BYTES_MAX);

/// The kind of a stored item. The numbers are stored and never change meaning; 2 and 4 are retired; a store that has them keeps them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ItemKey {
    /// 1: [`Lifetime`].
    Lifetime,
    /// 3: [`Exceedances`].
    Exceedances,
    /// 16 to 23: a [`Component`], by its place from 0.
    Component(u8),
    /// 24: a [`Session`], saved after and restored after all others: it is added to them.
    Session,
}

impl ItemKey {
    /// All keys, by number.
    pub fn all() -> impl Iterator<Item = Self> {
        let components = (0..COMPONENTS_MAX as u8).map(Self::Component);
        [Self::Lifetime, Self::Exceedances].into_iter().chain(components).chain([Self::Session])
    }

    /// The stored number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Lifetime => 1,
            Self::Exceedances => 3,
            Self::Component(place) => 16 + place,
            Self::Session => 24,
        }
    }

    /// The key of a stored number; `None` for an item that this version does not know.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::all().find(|key| key.number() == number)
    }
}

state! {
    /// The identity of an airframe.
    #[derive(Eq)]
    pub struct Airframe {
        /// MAVLink system id; 0 unknown.
        pub system: u8,
        /// The autopilot's unique id; 0 unknown.
        pub uid: u64,
    }
}

impl Airframe {
    /// Whether `self` and `other` are certainly different airframes. If both have a unique id, it decides; otherwise
    /// the system id, which can be set.
    pub const fn differs(self, other: Self) -> bool {
        if self.uid != 0 && other.uid != 0 {
            self.uid != other.uid
        } else {
            self.system != 0 && other.system != 0 && self.system != other.system
        }
    }

    /// The ids of both, `later` first.
    pub const fn learn(self, later: Self) -> Self {
        Self {
            system: if later.system == 0 { self.system } else { later.system },
            uid: if later.uid == 0 { self.uid } else { later.uid },
        }
    }
}

state! {
    /// Totals over an airframe's life. The stored form is as of the beginning of power-on [`Self::boots`]; the stored
    /// [`Session`] of that power-on is added to it.
    pub struct Lifetime {
        /// Whose life it is.
        pub airframe: Airframe,
        /// Power-ons of this monitor.
        pub boots: u32,
        /// Power-ons in which the airframe was heard.
        pub sessions: u32,
        /// Last known cells of its batteries: 0 not known, plus 128 if they were not confirmed since. They confirm a
        /// count, and prove none.
        pub cells: [u8; BATTERIES_MAX],
        /// Every counter of usage.
        pub totals: Totals,
    }
}

/// Version, system id, unique id, boots, sessions, cells of each battery, totals.
impl Item for Lifetime {
    const VERSION: u8 = 3;
    const BYTES: usize = 479;

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        let Self { airframe, boots, sessions, cells, totals } = self;
        fields!(fields: airframe.system, airframe.uid, boots, sessions, cells, totals);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usage::{Form, MotorTotals, UsageCounter};

    fn life(cells: [u8; BATTERIES_MAX], value: fn(Form) -> f64, motor: (f64, f64)) -> Lifetime {
        let airframe = Airframe { system: 3, uid: 0x0102_0304_0506_0708 };
        let mut lifetime =
            Lifetime { airframe, boots: 40_000, sessions: 39_000, cells, ..Lifetime::default() };
        for counter in UsageCounter::ALL {
            lifetime.totals.set(*counter, value(counter.form()));
        }
        for of in &mut lifetime.totals.motors {
            (of.seconds, of.revolutions) = motor;
        }
        lifetime
    }

    /// 10,000 hours of hard work.
    fn old() -> Lifetime {
        let value = |form| match form {
            Form::Tenths => 36_000_000.3,
            Form::Count => 123_456.0,
            Form::Halves => 4_000_000.5,
            Form::Amount => 123_456_789.123_456,
            Form::Highest | Form::Lowest => 14.25,
        };
        let mut old = life([6, 3, 0, 0], value, (36_000_000.7, 6e9 + 0.001));
        old.totals.ranges = [[360_000_000; 8]; 5];
        old
    }

    fn half_an_hour() -> Session {
        let value = |form| match form {
            Form::Tenths => 1_800.5,
            Form::Count => 1.0,
            Form::Halves => 120.5,
            Form::Amount | Form::Highest | Form::Lowest => 14.25,
        };
        let mut totals = life([0; BATTERIES_MAX], value, (1_790.0, 150_000.0)).totals;
        totals.motors[4..].fill(MotorTotals::default());
        totals.battery_cycles = [0.0, 0.5, 0.0, 0.0];
        totals.ranges = [[0, 0, 12_000, 6_000, 0, 0, 0, 0]; 5];
        Session { boots: 70_000, heard: true, totals }
    }

    fn longest() -> Session {
        let mut totals = life([0; BATTERIES_MAX], |_| f64::MAX, (f64::MAX, f64::MAX)).totals;
        (totals.battery_cycles, totals.ranges) = ([f64::MAX; BATTERIES_MAX], [[u32::MAX; 8]; 5]);
        Session { boots: u32::MAX, heard: true, totals }
    }

    fn stored(item: impl Item) -> Vec<u8> {
        let mut out = [0xEE; ITEM_BYTES_MAX];
        let length = item.encode(&mut out);
        out[..length].to_vec()
    }

    fn sum(stored: &[u8]) -> u32 {
        stored.iter().fold(0, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)))
    }

    fn reads_back<T: Item + Copy + PartialEq + core::fmt::Debug>(item: T) -> Vec<u8> {
        let known = stored(item);
        assert_eq!(T::decode(&known), Ok(item));
        let mut later = known.clone();
        later[0] += 1;
        later.extend([0xEE; 9]);
        assert_eq!(T::decode(&later), Ok(item), "of a later version");
        for cut in 0..known.len() {
            assert_eq!(T::decode(&known[..cut]), Err(Unreadable), "{cut}");
        }
        later[0] = 0;
        assert_eq!(T::decode(&later), Err(Unreadable));
        known
    }

    #[test]
    fn what_was_lived_reads_back_to_the_last_digit_and_is_as_long_as_the_sums_say() {
        assert_eq!(reads_back(old()).len(), Lifetime::BYTES);
        reads_back(Lifetime::default());
        assert!(reads_back(half_an_hour()).len() <= Session::BYTES_TYPICAL);
        assert_eq!(stored(longest()).len(), Session::BYTES);
    }

    #[test]
    fn a_layout_never_changes() {
        assert_eq!((sum(&stored(old())), sum(&stored(half_an_hour()))), (3_972_496_611, 3_526_647_728));
    }

    #[test]
    fn no_stored_bytes_make_nonsense() {
        for byte in 0..=255 {
            let life = Lifetime::decode(&[byte; ITEM_BYTES_MAX]).map(|life| life.totals);
            let session = Session::decode(&[byte; ITEM_BYTES_MAX]).map(|session| session.totals);
            for totals in [life, session, Session::decode(&stored(longest())).map(|session| session.totals)] {
                let sane =
                    |number, value: f64| assert!(value.is_finite() && value >= 0.0, "{number} {value}");
                if let Ok(totals) = totals {
                    totals.for_each(sane);
                }
            }
        }
    }

    #[test]
    fn a_session_is_added_once() {
        for (boots, sum) in [(70_000, (10, 11)), (70_001, (9, 10))] {
            let mut life = Lifetime { boots, sessions: 9, ..Lifetime::default() };
            life.totals.set(UsageCounter::Flights, 10.0);
            life.add(&half_an_hour());
            assert_eq!((life.sessions, life.totals.raw(UsageCounter::Flights) as u32), sum);
        }
    }

    #[test]
    fn keys_have_numbers_of_their_own() {
        let known = (0..=255).filter_map(ItemKey::from_number);
        assert!(known.eq(ItemKey::all()), "each number is one key's");
        for key in ItemKey::all() {
            assert_eq!(ItemKey::from_number(key.number()), Some(key));
        }
        assert_eq!((ItemKey::Lifetime.number(), ItemKey::Component(7).number()), (1, 23));
    }

    #[test]
    fn an_airframe_is_told_by_its_unique_id_before_its_system_id() {
        let seen = |system, uid| Airframe { system, uid };
        assert!(!seen(1, 7).differs(seen(2, 7)), "its system id was set anew");
        assert!(seen(1, 7).differs(seen(1, 8)));
        assert!(seen(1, 0).differs(seen(2, 8)));
        assert!(!seen(1, 0).differs(seen(1, 8)));
        assert!(!Airframe::default().differs(seen(1, 8)));
    }
}
