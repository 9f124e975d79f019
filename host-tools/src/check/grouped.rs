//! What was wrong, as people read it: the parts of one check together, under each cause what it explains, and first what matters most.

use std::cmp::Reverse;

use hums_core::health::Level;

use super::problem::Problem;

/// A cause with what it explains.
#[derive(Debug)]
pub struct Group<'a> {
    /// Problems of one check and one level, which differ in the part alone; never none.
    pub members: Vec<&'a Problem>,
    /// What they explain: of each check and level the problems.
    pub effects: Vec<Vec<&'a Problem>>,
    /// It is a warning, and what it explains became critical.
    pub is_raised: bool,
}

impl<'a> Group<'a> {
    /// The first of its problems.
    pub fn first(&self) -> Option<&'a Problem> {
        self.members.first().copied()
    }

    /// Whether it, or what it explains, is critical.
    pub fn is_critical(&self) -> bool {
        self.is_raised || is_critical(&self.members)
    }
}

/// Problems by their causes: what is critical before warnings, there a mishap before all else and parts that are due behind it, then what came
/// first.
pub fn grouped(problems: &[Problem]) -> Vec<Group<'_>> {
    let alike = alike(problems);
    let (mut causes, effects): (Vec<_>, Vec<_>) = alike.iter().partition(|one| cause(one, &alike).is_none());
    let explained = |one: &[&Problem]| -> Vec<_> {
        let check = check_of(one);
        effects.iter().filter(|effect| cause(effect, &alike) == Some(check)).copied().cloned().collect()
    };
    let is_raised = |one: &[&Problem]| !is_critical(one) && explained(one).iter().any(|one| is_critical(one));
    causes.sort_by_key(|one| {
        let is_critical = is_critical(one) || is_raised(one);
        (Reverse(is_critical), one.first().map(|first| first.order()))
    });
    let mut groups: Vec<Group<'_>> = Vec::new();
    for one in causes {
        // The first of a check's groups has what it explains.
        let is_first = groups.iter().all(|group| check_of(&group.members) != check_of(one));
        groups.push(Group {
            members: one.clone(),
            effects: if is_first { explained(one) } else { Vec::new() },
            is_raised: is_first && is_raised(one),
        });
    }
    groups
}

/// All of a check and level have one level.
pub(super) fn is_critical(problems: &[&Problem]) -> bool {
    problems.first().is_some_and(|first| first.level == Level::Critical)
}

/// The check of problems that are alike.
fn check_of<'a>(alike: &[&'a Problem]) -> &'a str {
    alike.first().map_or("", |problem| &problem.check)
}

/// The check that explains all of some problems that are alike, and is explained by none; `None` where there is none among these.
fn cause<'a>(one: &[&'a Problem], all: &[Vec<&'a Problem>]) -> Option<&'a str> {
    let explains = |one: &[&'a Problem]| {
        let cause = one.first()?.because.as_deref()?;
        let of_all = one.iter().all(|problem| problem.because.as_deref() == Some(cause));
        all.iter().find(|other| of_all && check_of(other) == cause)
    };
    let mut cause = explains(one)?;
    // No more steps than there are: a circle has no beginning.
    for _ in all {
        match explains(cause) {
            Some(deeper) => cause = deeper,
            None => return Some(check_of(cause)),
        }
    }
    None
}

/// Problems of one check and level together; in the order of the first of each.
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
