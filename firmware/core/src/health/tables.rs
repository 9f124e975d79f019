//! All checks: each subsystem's table is in a file of its own.

use super::check::{Check, Part, When};
use super::{attitude, computer, engine, link, mishap, navigation, power, propulsion, recorder, structure};
use crate::cause::{Cause, Causes};

pub(super) const TABLES: [&[Check]; 10] = [
    power::CHECKS,
    propulsion::CHECKS,
    engine::CHECKS,
    structure::CHECKS,
    navigation::CHECKS,
    link::CHECKS,
    computer::CHECKS,
    attitude::CHECKS,
    recorder::CHECKS,
    mishap::CHECKS,
];

/// Checks in all tables together, and states that they have: one for each instance.
const COUNTS: (usize, usize) = {
    let (mut rows, mut states) = (0, 0);
    let mut table = 0;
    while table < TABLES.len() {
        let mut check = 0;
        while check < TABLES[table].len() {
            states += TABLES[table][check].instances as usize;
            check += 1;
        }
        rows += check;
        table += 1;
    }
    (rows, states)
};

/// How many checks there are.
const CHECKS_COUNT: usize = COUNTS.0;
/// States that all checks together have: one for each instance.
pub(super) const STATES: usize = COUNTS.1;

/// All checks, by subsystem.
static CHECKS: [Check; CHECKS_COUNT] = {
    let mut all = [TABLES[0][0]; CHECKS_COUNT];
    let (mut table, mut count) = (0, 0);
    while table < TABLES.len() {
        let mut check = 0;
        while check < TABLES[table].len() {
            all[count] = TABLES[table][check];
            (check, count) = (check + 1, count + 1);
        }
        table += 1;
    }
    all
};

/// The first state of each check.
static FIRST_STATES: [u8; CHECKS_COUNT] = {
    let mut first = [0; CHECKS_COUNT];
    let mut place = 1;
    while place < CHECKS_COUNT {
        first[place] = first[place - 1] + CHECKS[place - 1].instances;
        place += 1;
    }
    first
};

/// A set of checks by their places: a bit each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places([u32; CHECKS_COUNT.div_ceil(u32::BITS as usize)]);

const _: () = assert!(CHECKS_COUNT <= STATES && STATES <= u8::MAX as usize);

/// The checks whose value is from each part.
static OF_PART: [Places; Part::COUNT] = {
    let mut of_part = [Places::NONE; Part::COUNT];
    let mut place = 0;
    while place < CHECKS_COUNT {
        of_part[CHECKS[place].part as usize].add(place as u8);
        place += 1;
    }
    of_part
};

/// The checks that apply at each time.
static OF_WHEN: [Places; When::ALL.len()] = {
    let mut of_when = [Places::NONE; When::ALL.len()];
    let mut place = 0;
    while place < CHECKS_COUNT {
        of_when[CHECKS[place].when as usize].add(place as u8);
        place += 1;
    }
    of_when
};

/// The checks that may rest: of parts that are [told](Part::TOLD), and of what the autopilot says.
pub(super) static MAY_REST: Places = {
    let mut may_rest = Places::NONE;
    let mut place = 0;
    while place < CHECKS_COUNT {
        if (Part::TOLD | 1 << Part::Alert as u16) >> CHECKS[place].part as u8 & 1 != 0 {
            may_rest.add(place as u8);
        }
        place += 1;
    }
    may_rest
};

/// The place of the check of what the autopilot says, by [`Cause`].
static OF_CAUSE: [u8; Cause::COUNT] = {
    let mut of_cause = [0; Cause::COUNT];
    let mut cause = 0;
    while cause < Cause::COUNT {
        let name = Cause::ALL[cause].check();
        while !is_same(CHECKS[of_cause[cause] as usize].name, name) {
            of_cause[cause] += 1;
        }
        cause += 1;
    }
    of_cause
};

const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut at = 0;
    while at < one.len() && at < other.len() && one[at] == other[at] {
        at += 1;
    }
    at == one.len() && at == other.len()
}

/// Kinds of checks: those that have their value from one of some parts, and apply at one of some times. A bit each; in bytes, so that
/// they fit in beside another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kinds {
    parts: [u8; 2],
    times: u8,
}

const _: () = assert!(Part::COUNT <= u16::BITS as usize && When::ALL.len() <= u8::BITS as usize);

impl Kinds {
    /// None.
    pub(super) const NONE: Self = Self { parts: [0; 2], times: 0 };

    /// All of them: for assertions.
    pub(super) const ALL: Self = Self { parts: [u8::MAX; 2], times: u8::MAX };

    /// Those of these parts, at times that `are_now`.
    pub(super) fn of(parts: u16, are_now: [bool; When::ALL.len()]) -> Self {
        let times = are_now.into_iter().rev().fold(0, |times, is_now| times << 1 | u8::from(is_now));
        Self { parts: parts.to_le_bytes(), times }
    }

    pub(super) const fn of_check(check: &Check) -> Self {
        Self { parts: (1_u16 << check.part as u8).to_le_bytes(), times: 1 << check.when as u8 }
    }

    pub(super) fn has(self, check: &Check) -> bool {
        self.and(Self::of_check(check)) == self
    }

    /// The parts and the times of both.
    pub(super) fn and(self, other: Self) -> Self {
        let parts = u16::from_le_bytes(self.parts) | u16::from_le_bytes(other.parts);
        Self { parts: parts.to_le_bytes(), times: self.times | other.times }
    }

    /// The checks of these kinds.
    pub(super) fn places(self) -> Places {
        let of_parts = Places::of_parts(u16::from_le_bytes(self.parts));
        of_parts.within(Places::union(&OF_WHEN, self.times.into()))
    }
}

impl Places {
    /// None.
    pub(super) const NONE: Self = Self([0; _]);

    /// Adds the check at a place.
    pub(super) const fn add(&mut self, place: u8) {
        self.0[place as usize / 32] |= 1 << (place % 32);
    }

    /// The checks whose value is from these parts, a bit each.
    pub(super) fn of_parts(parts: u16) -> Self {
        Self::union(&OF_PART, parts.into())
    }

    /// The checks of what the autopilot says is wrong with these.
    pub(super) fn of_causes(causes: Causes) -> Self {
        causes.each().fold(Self::NONE, |mut places, cause| {
            places.add(OF_CAUSE[cause as usize]);
            places
        })
    }

    /// Those of these that are among others.
    pub(super) fn within(self, others: Self) -> Self {
        let mut both = self;
        both.0.iter_mut().zip(others.0).for_each(|(both, others)| *both &= others);
        both
    }

    /// These and others.
    pub(super) fn and(self, others: Self) -> Self {
        let mut all = self;
        all.0.iter_mut().zip(others.0).for_each(|(all, others)| *all |= others);
        all
    }

    /// These but for others.
    pub(super) fn without(self, others: Self) -> Self {
        let mut left = self;
        left.0.iter_mut().zip(others.0).for_each(|(left, others)| *left &= !others);
        left
    }

    /// Whether there are none.
    pub(super) fn is_empty(self) -> bool {
        self.0.iter().all(|word| *word == 0)
    }

    /// All of those sets whose bit is set.
    fn union(sets: &[Self], bits: u32) -> Self {
        let set = sets.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 != 0);
        set.fold(Self::NONE, |all, (_, set)| all.and(*set))
    }

    /// The checks, in their order: the place of each, and its first state.
    pub(super) fn checks(self) -> impl Iterator<Item = (u8, &'static Check, usize)> {
        let (mut word, mut left) = (0, self.0[0]);
        core::iter::from_fn(move || {
            while left == 0 {
                word += 1;
                left = *self.0.get(word)?;
            }
            let place = word * u32::BITS as usize + left.trailing_zeros() as usize;
            left &= left - 1;
            let (check, first) = (CHECKS.get(place)?, FIRST_STATES.get(place)?);
            Some((place as u8, check, usize::from(*first)))
        })
    }
}

/// All checks, by subsystem.
pub fn checks() -> impl ExactSizeIterator<Item = &'static Check> + Clone {
    CHECKS.iter()
}

/// The check of this name.
pub fn check_named(name: &str) -> Option<&'static Check> {
    checks().find(|check| check.name == name)
}

/// How many instances a check has; 0 where there is no such check.
pub fn instances(name: &str) -> u8 {
    check_named(name).map_or(0, |check| check.instances)
}
