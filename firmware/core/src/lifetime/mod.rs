//! What outlives power: totals over an airframe's life, its baselines, and its components, as items of bytes that a
//! store keeps.
//!
//! Counters of the life before this session are saved once, at its beginning; what the session itself has counted is one
//! short item of its own ([`Session`]), saved often.
//!
//! An item is a version byte and then fields, little endian. A later version only appends, so version n reads what
//! n + 1 wrote, and n + 1 reads what n wrote with nothing counted in what is missing. The store guards the bytes (a
//! checksum, two copies); what is decoded here is checked again only so far as no figure can be nonsense.
//!
//! Figures lose nothing over the life of an airframe: times are kept to a tenth of a second in 32 bits (119,000 hours;
//! the rounding of a session is not added up within it, and is as often up as down), counts in 32 bits, amounts
//! (distance, charge, energy, revolutions) in double precision, which at 10,000 hours of 10,000 rpm, 6e9 revolutions,
//! still resolves a millionth of one.

mod saving;
mod session;

pub use saving::{EVERY, EVERY_ARMED, Room, Saving};
pub use session::Session;

use crate::baseline::Baselines;
use crate::bytes::{Put, Take, Unreadable, amount, tenths};
use crate::component::{COMPONENTS_MAX, Component};
use crate::exposure::Exposure;
use crate::health::exceedance::Exceedances;
use crate::usage::{Form, Totals, UsageCounter};
use crate::vehicle::BATTERIES_MAX;

/// The longest item. Each has its own length.
pub const ITEM_BYTES_MAX: usize = 512;

const _: () = assert!(Lifetime::BYTES <= ITEM_BYTES_MAX);
const _: () = assert!(Baselines::BYTES <= ITEM_BYTES_MAX);
const _: () = assert!(Exceedances::BYTES <= ITEM_BYTES_MAX);
const _: () = assert!(Exposure::BYTES <= ITEM_BYTES_MAX);
const _: () = assert!(Component::BYTES <= ITEM_BYTES_MAX);

/// What a stored item is. The numbers are stored and never change meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ItemKey {
    /// 1: [`Lifetime`].
    Lifetime,
    /// 2: [`Baselines`].
    Baselines,
    /// 3: [`Exceedances`].
    Exceedances,
    /// 4: [`Exposure`].
    Exposure,
    /// 16 to 23: a [`Component`], by its place from 0.
    Component(u8),
    /// 24: a [`Session`], saved after and restored after all others: it is added to them.
    Session,
}

impl ItemKey {
    /// How many keys there are.
    pub const COUNT: usize = Self::ALL.len();

    const COMPONENT_FIRST: u8 = 16;
    const SESSION: u8 = 24;

    /// All keys, by number.
    pub const ALL: [Self; 5 + COMPONENTS_MAX] = {
        let mut all = [Self::Session; 5 + COMPONENTS_MAX];
        all[0] = Self::Lifetime;
        (all[1], all[2], all[3]) = (Self::Baselines, Self::Exceedances, Self::Exposure);
        let mut place = 0;
        while place < COMPONENTS_MAX {
            all[4 + place] = Self::Component(place as u8);
            place += 1;
        }
        all
    };

    /// The stored number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Lifetime => 1,
            Self::Baselines => 2,
            Self::Exceedances => 3,
            Self::Exposure => 4,
            Self::Component(place) => Self::COMPONENT_FIRST + place,
            Self::Session => Self::SESSION,
        }
    }

    /// The key of a stored number; `None` for an item that this version does not know.
    pub const fn from_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::Lifetime),
            2 => Some(Self::Baselines),
            3 => Some(Self::Exceedances),
            4 => Some(Self::Exposure),
            Self::SESSION => Some(Self::Session),
            _ => match number.checked_sub(Self::COMPONENT_FIRST) {
                Some(place) if (place as usize) < COMPONENTS_MAX => Some(Self::Component(place)),
                _ => None,
            },
        }
    }

    /// A number from 0 without gaps.
    const fn index(self) -> usize {
        match self {
            Self::Lifetime => 0,
            Self::Baselines => 1,
            Self::Exceedances => 2,
            Self::Exposure => 3,
            Self::Component(place) => 4 + place as usize,
            Self::Session => 4 + COMPONENTS_MAX,
        }
    }
}

/// Which airframe it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Airframe {
    /// MAVLink system id; 0 unknown.
    pub system: u8,
    /// The autopilot's unique id; 0 unknown.
    pub uid: u64,
}

impl Airframe {
    /// Whether `self` and `other` are certainly not the same. The unique id decides where both have one, because a
    /// system id can be set; the system id otherwise.
    pub const fn differs(self, other: Self) -> bool {
        if self.uid != 0 && other.uid != 0 {
            self.uid != other.uid
        } else {
            self.system != 0 && other.system != 0 && self.system != other.system
        }
    }

    /// What is known of it, `later` first.
    pub const fn learn(self, later: Self) -> Self {
        Self {
            system: if later.system == 0 { self.system } else { later.system },
            uid: if later.uid == 0 { self.uid } else { later.uid },
        }
    }
}

/// Totals over an airframe's life. Stored, they are as of the beginning of power-on [`Self::boots`], to which the stored
/// [`Session`] of that power-on is added.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lifetime {
    /// Whose life it is.
    pub airframe: Airframe,
    /// Power-ons of this monitor.
    pub boots: u32,
    /// Power-ons in which the airframe was heard.
    pub sessions: u32,
    /// Cells of its batteries as they were known last; 0 not known; with 128 added where they were not known since. They confirm, and
    /// prove nothing.
    pub cells: [u8; BATTERIES_MAX],
    /// Every counter of usage.
    pub totals: Totals,
}

/// Counters of version 1: the first of [`UsageCounter::ALL`]. A later version's are appended at the item's end.
const COUNTERS_V1: usize = 32;
/// Version 2 appends the counters that came since.
const VERSION: u8 = 2;

impl Lifetime {
    /// Length of the stored form: version, system id, unique id, boots, sessions, counters in the order of
    /// [`UsageCounter::ALL`] as their [`Form`] says, then seconds (tenths, u32) and revolutions (f64) of each motor, then (since version 2) the
    /// counters after the first 32, and the cells of each battery.
    pub const BYTES: usize = {
        let mut bytes = 1 + 1 + 8 + 4 + 4 + crate::observation::MOTORS_MAX * (4 + 8) + BATTERIES_MAX;
        let mut place = 0;
        while place < UsageCounter::ALL.len() {
            bytes += UsageCounter::ALL[place].form().bytes();
            place += 1;
        }
        bytes
    };

    /// Nothing lived yet.
    pub const fn new() -> Self {
        Self {
            airframe: Airframe { system: 0, uid: 0 },
            boots: 0,
            sessions: 0,
            cells: [0; BATTERIES_MAX],
            totals: Totals::nothing(),
        }
    }

    /// Writes the stored form.
    pub fn encode(&self, out: &mut [u8; Self::BYTES]) {
        let mut put = Put::new(out);
        put.u8(VERSION).u8(self.airframe.system).u64(self.airframe.uid).u32(self.boots).u32(self.sessions);
        for counter in &UsageCounter::ALL[..COUNTERS_V1] {
            put_counter(&mut put, counter.form(), self.totals.raw(*counter));
        }
        for motor in &self.totals.motors {
            put.u32(tenths(motor.seconds)).f64(motor.revolutions);
        }
        for counter in &UsageCounter::ALL[COUNTERS_V1..] {
            put_counter(&mut put, counter.form(), self.totals.raw(*counter));
        }
        put.bytes(&self.cells);
    }

    /// Reads the stored form, of this version or a later one.
    pub fn decode(stored: &[u8]) -> Result<Self, Unreadable> {
        let mut take = Take::new(stored);
        let mut lifetime = Self::new();
        let version = take.u8()?;
        if version == 0 {
            return Err(Unreadable);
        }
        lifetime.airframe = Airframe { system: take.u8()?, uid: take.u64()? };
        (lifetime.boots, lifetime.sessions) = (take.u32()?, take.u32()?);
        for counter in &UsageCounter::ALL[..COUNTERS_V1] {
            let value = take_counter(&mut take, counter.form())?;
            lifetime.totals.set(*counter, value);
        }
        for motor in &mut lifetime.totals.motors {
            motor.seconds = f64::from(take.u32()?) / 10.0;
            motor.revolutions = amount(take.f64()?);
        }
        for counter in UsageCounter::ALL[COUNTERS_V1..].iter().filter(|_| version >= VERSION) {
            let value = take_counter(&mut take, counter.form())?;
            lifetime.totals.set(*counter, value);
        }
        if version >= VERSION {
            lifetime.cells = take.array()?;
        }
        Ok(lifetime)
    }
}

fn put_counter(put: &mut Put<'_>, form: Form, value: f64) {
    match form {
        Form::Tenths => put.u32(tenths(value)),
        Form::Count => put.u32(value as u32),
        Form::Halves => put.u32((2.0 * value) as u32),
        Form::Amount => put.f64(value),
        Form::Highest | Form::Lowest => put.f32(value as f32),
    };
}

fn take_counter(take: &mut Take<'_>, form: Form) -> Result<f64, Unreadable> {
    Ok(match form {
        Form::Tenths => f64::from(take.u32()?) / 10.0,
        Form::Count => f64::from(take.u32()?),
        Form::Halves => f64::from(take.u32()?) / 2.0,
        Form::Amount => amount(take.f64()?),
        Form::Highest => amount(f64::from(take.f32()?)),
        Form::Lowest => {
            let value = f64::from(take.f32()?);
            if value >= 0.0 { value } else { f64::INFINITY }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What version 2 appends: a later version appends its own.
    const V2_BYTES: usize = 4 + BATTERIES_MAX;
    const _: () = assert!(UsageCounter::ALL.len() == COUNTERS_V1 + 1, "a later version appends its counters");

    /// 10,000 hours of hard work.
    fn old() -> Lifetime {
        let mut lifetime = Lifetime {
            airframe: Airframe { system: 3, uid: 0x0102_0304_0506_0708 },
            boots: 40_000,
            sessions: 39_000,
            cells: [6, 3, 0, 0],
            ..Lifetime::new()
        };
        for counter in UsageCounter::ALL {
            let value = match counter.form() {
                Form::Tenths => 36_000_000.3,
                Form::Count => 123_456.0,
                Form::Halves => 4_000_000.5,
                Form::Amount => 123_456_789.123_456,
                Form::Highest | Form::Lowest => 14.25,
            };
            lifetime.totals.set(*counter, value);
        }
        for motor in &mut lifetime.totals.motors {
            (motor.seconds, motor.revolutions) = (36_000_000.7, 6e9 + 0.001);
        }
        lifetime
    }

    #[test]
    fn ten_thousand_hours_read_back_to_the_last_digit() {
        let mut stored = [0; Lifetime::BYTES];
        old().encode(&mut stored);
        assert_eq!(Lifetime::decode(&stored), Ok(old()));
        let mut empty = [0xFF; Lifetime::BYTES];
        Lifetime::new().encode(&mut empty);
        assert_eq!(Lifetime::decode(&empty), Ok(Lifetime::new()));
    }

    #[test]
    fn the_stored_layout_of_version_1_stays_what_it_is() {
        let mut stored = [0; Lifetime::BYTES];
        old().encode(&mut stored);
        assert_eq!(stored.len(), 306 + V2_BYTES);
        assert_eq!(stored[0], 2);
        stored[0] = 1;
        let stored = &stored[..306];
        assert_eq!(stored[..14], [1, 3, 8, 7, 6, 5, 4, 3, 2, 1, 0x40, 0x9C, 0, 0]);
        let sum = stored.iter().fold(0_u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
        assert_eq!(sum, 1_761_518_064, "a published layout never changes");
        let mut read = Lifetime::decode(stored).expect("version 1 reads");
        assert!(read.totals.raw(UsageCounter::Mishaps) <= 0.0, "what it did not know is not counted");
        assert_eq!(read.cells, [0; BATTERIES_MAX]);
        read.totals.set(UsageCounter::Mishaps, 123_456.0);
        read.cells = old().cells;
        assert_eq!(read, old());
    }

    #[test]
    fn a_later_version_reads_and_a_cut_one_does_not() {
        let mut stored = [0xEE; Lifetime::BYTES + 9];
        let (known, _) = stored.split_first_chunk_mut().expect("long enough");
        old().encode(known);
        stored[0] = 3;
        assert_eq!(Lifetime::decode(&stored), Ok(old()));
        for cut in 0..Lifetime::BYTES {
            assert_eq!(Lifetime::decode(&stored[..cut]), Err(Unreadable), "{cut}");
        }
        stored[0] = 0;
        assert_eq!(Lifetime::decode(&stored), Err(Unreadable));
    }

    #[test]
    fn no_stored_bytes_make_nonsense() {
        let lifetime = Lifetime::decode(&[0xFF; Lifetime::BYTES]).expect("long enough");
        lifetime
            .totals
            .for_each(|number, value| assert!(value.is_finite() && value >= 0.0, "{number} {value}"));
    }

    #[test]
    fn keys_have_numbers_of_their_own() {
        let known = (0..=255).filter_map(ItemKey::from_number);
        assert!(known.eq(ItemKey::ALL), "each number is one key's");
        for (index, key) in ItemKey::ALL.into_iter().enumerate() {
            assert_eq!(ItemKey::from_number(key.number()), Some(key));
            assert_eq!(key.index(), index);
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
