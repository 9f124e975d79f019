//! All checks: each subsystem's table is in a file of its own.

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

/// States that all checks together have: one for each instance.
pub(super) const STATES: usize = {
    let mut states = 0;
    let mut table = 0;
    while table < TABLES.len() {
        let mut check = 0;
        while check < TABLES[table].len() {
            states += TABLES[table][check].instances as usize;
            check += 1;
        }
        table += 1;
    }
    states
};

/// All checks, by subsystem.
pub fn checks() -> impl Iterator<Item = &'static Check> {
    TABLES.iter().copied().flatten()
}

/// The check of this name.
pub fn check_named(name: &str) -> Option<&'static Check> {
    checks().find(|check| check.name == name)
}

/// How many instances a check has; 0 where there is no such check.
pub fn instances(name: &str) -> u8 {
    check_named(name).map_or(0, |check| check.instances)
}
