//! Problems for people: one check together, effects under their cause, the worst first.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use hums_core::health::Level;

use super::problem::{Problem, mishaps};

/// A cause with its effects.
#[derive(Debug)]
pub struct Group<'a> {
    /// One check and level; at least one.
    pub members: Vec<&'a Problem>,
    /// Effects by check and level, in order of time.
    pub effects: Vec<Vec<&'a Problem>>,
    /// A warning with a critical effect.
    pub is_raised: bool,
}

impl<'a> Group<'a> {
    /// Its first problem.
    pub fn first(&self) -> Option<&'a Problem> {
        self.members.first().copied()
    }

    /// The cause, or an effect.
    pub fn is_critical(&self) -> bool {
        self.is_raised || is_critical(&self.members)
    }
}

/// Problems by their causes, in this order:
/// - critical before warnings;
/// - a mishap first, then its precursors (also warnings);
/// - parts that are due last;
/// - otherwise by time.
pub fn grouped(problems: &[Problem]) -> Vec<Group<'_>> {
    let alike = alike(problems);
    let causes: Vec<_> = alike.iter().map(|one| cause(one, &alike)).collect();
    let mut groups: Vec<Group<'_>> = Vec::new();
    for (one, _) in alike.iter().zip(&causes).filter(|(_, cause)| cause.is_none()) {
        let check = check_of(one);
        let explained =
            || alike.iter().zip(&causes).filter(|(_, cause)| **cause == Some(check)).map(|(one, _)| one);
        groups.push(Group {
            members: one.clone(),
            effects: {
                let mut effects: Vec<_> = explained().cloned().collect();
                effects.sort_by_key(|effect| effect.first().map(|problem| problem.at));
                effects
            },
            is_raised: !is_critical(one) && explained().any(|one| is_critical(one)),
        });
    }
    let mishaps = mishaps(problems);
    groups.sort_by_key(|group| {
        let leads = group.first().is_some_and(|problem| problem.leads_to(&mishaps));
        (Reverse(group.is_critical() || leads), group.first().map(|problem| problem.order(&mishaps)))
    });
    // The first group keeps the effects.
    let mut seen = BTreeSet::new();
    for group in &mut groups {
        if !seen.insert(check_of(&group.members)) {
            (group.effects, group.is_raised) = (Vec::new(), false);
        }
    }
    groups
}

pub(super) fn is_critical(problems: &[&Problem]) -> bool {
    problems.first().is_some_and(|first| first.level == Level::Critical)
}

fn check_of<'a>(alike: &[&'a Problem]) -> &'a str {
    alike.first().map_or("", |problem| &problem.check)
}

fn cause<'a>(one: &[&'a Problem], all: &[Vec<&'a Problem>]) -> Option<&'a str> {
    let explains = |one: &[&'a Problem]| {
        let cause = one.first()?.because.as_deref()?;
        let of_all = one.iter().all(|problem| problem.because.as_deref() == Some(cause));
        all.iter().find(|other| of_all && check_of(other) == cause)
    };
    let mut cause = explains(one)?;
    // A circle has no beginning.
    for _ in all {
        match explains(cause) {
            Some(deeper) => cause = deeper,
            None => return Some(check_of(cause)),
        }
    }
    None
}

fn alike(problems: &[Problem]) -> Vec<Vec<&Problem>> {
    let mut alike: Vec<Vec<&Problem>> = Vec::new();
    for problem in problems {
        let same = |one: &&mut Vec<&Problem>| {
            one.first().is_some_and(|first| first.check == problem.check && first.level == problem.level)
        };
        match alike.iter_mut().find(same) {
            Some(one) => one.push(problem),
            None => alike.push(vec![problem]),
        }
    }
    alike
}
