//! All checks; each subsystem's table is in a file of its own.

use super::check::Check;
use super::{attitude, computer, engine, link, mishap, navigation, power, propulsion, recorder, structure};

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

const CHECKS_COUNT: usize = COUNTS.0;
pub(super) const STATES: usize = COUNTS.1;

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

/// A state takes 20 bytes of RAM for each instance of a check, so their number is a decision.
pub(super) const STATES_MAX: usize = 500;
const _: () = assert!(
    STATES <= STATES_MAX,
    "too many states: lower `instances` of a check, or raise STATES_MAX and budgets.toml"
);
const _: () = assert!(CHECKS_COUNT <= u8::MAX as usize, "the number of a check has 8 bits");

/// All checks, by subsystem.
pub fn checks() -> impl ExactSizeIterator<Item = &'static Check> + Clone {
    CHECKS.iter()
}

/// Of each state its check, by its place in [`CHECKS`], and the instance.
static SLOTS: [(u8, u8); STATES] = {
    let mut slots = [(0, 0); STATES];
    let (mut check, mut slot) = (0, 0);
    while check < CHECKS_COUNT {
        let mut instance = 0;
        while instance < CHECKS[check].instances {
            slots[slot] = (check as u8, instance);
            (instance, slot) = (instance + 1, slot + 1);
        }
        check += 1;
    }
    slots
};

pub(super) fn slots() -> impl Iterator<Item = (u16, &'static Check, u8)> + Clone {
    (0..).zip(&SLOTS).map(|(slot, (check, instance))| (slot, &CHECKS[usize::from(*check)], *instance))
}

pub(super) fn check_of(slot: u16) -> Option<(&'static Check, u8)> {
    let (check, instance) = *SLOTS.get(usize::from(slot))?;
    Some((CHECKS.get(usize::from(check))?, instance))
}

pub(super) fn slot_of(name: &str, instance: u8) -> Option<u16> {
    slots().find(|(_, check, number)| *number == instance && check.name == name).map(|(slot, ..)| slot)
}

/// The check of this name.
pub fn check_named(name: &str) -> Option<&'static Check> {
    checks().find(|check| check.name == name)
}

/// The number of instances of a check; 0 for an unknown name.
pub fn instances(name: &str) -> u8 {
    check_named(name).map_or(0, |check| check.instances)
}
