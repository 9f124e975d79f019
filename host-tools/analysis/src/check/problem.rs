//! Level changes of one check and part, together.

use std::collections::BTreeMap;

use hums_core::clock::{Instant, Span};
use hums_core::health::{Alarm, Level, Side, Subsystem, checks, root_cause};

use crate::part;
use crate::source::told::Finding;
use crate::utc::moment;

/// Further ones are counted.
pub const LISTED_MAX: usize = 10_000;
/// Parts of 140 possible ones; a log may name any.
const FOLLOWED_MAX: usize = 1_000;

pub(super) const IMPACT: &str = "impact";
/// Stillness before a box finds an impact.
const LIES_STILL: Span = Span::from_secs(1);

/// Details of a problem: there are 32 sensors.
const DETAILS_MAX: usize = 32;

/// One check and part, at a warning or worse.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// Stable name.
    pub check: String,
    /// Which one of several, from 0.
    pub instance: u8,
    /// The worst level.
    pub level: Level,
    /// First at that level.
    pub at: Instant,
    /// Changes from good.
    pub times: u32,
    /// Time at a warning or worse, without gaps.
    pub lasted: Span,
    /// It was still so at the end.
    pub lasting: bool,
    /// The value at that time.
    pub onset: f32,
    /// The worst value that is known.
    pub value: f32,
    /// The limit of the worst level.
    pub limit: f32,
    /// The unit of both.
    pub unit: String,
    /// Names of parts.
    pub details: Vec<String>,
    /// The detail that the verdict begins with.
    pub event: Option<String>,
    /// Last reception, for a radio gap's mishap.
    pub unheard_from: Option<Instant>,
    /// Check with as bad an alarm at each finding.
    pub because: Option<String>,
}

impl Problem {
    /// Order within a level: mishap and precursors first, due parts last, otherwise by time.
    pub(super) fn order(&self, mishaps: &[Instant]) -> (bool, bool, Instant) {
        (!self.is_mishap() && !self.leads_to(mishaps), part::is_due(&self.check), self.at)
    }

    pub(super) fn is_mishap(&self) -> bool {
        self.subsystem == Subsystem::Mishap && self.level == Level::Critical
    }

    /// Propulsion or attitude, shortly before a mishap.
    pub(super) fn leads_to(&self, mishaps: &[Instant]) -> bool {
        let is_of_flight = matches!(self.subsystem, Subsystem::Propulsion | Subsystem::Attitude);
        is_of_flight && mishaps.iter().any(|at| self.at <= *at && at.since(self.at) <= LEADS)
    }
}

/// Time from a precursor to a mishap.
const LEADS: Span = Span::from_secs(10);

/// Mishaps' starts; for a radio gap, the last reception.
pub(super) fn mishaps(problems: &[Problem]) -> Vec<Instant> {
    let mishaps = problems.iter().filter(|problem| problem.is_mishap());
    mishaps.map(|problem| problem.unheard_from.unwrap_or(problem.at)).collect()
}

/// Stale means unknown.
pub(super) const fn rank(level: Level) -> u8 {
    match level {
        Level::Critical => 2,
        Level::Warning => 1,
        Level::Ok | Level::Advisory | Level::Stale => 0,
    }
}

/// The side of the limit on which a check's value is bad.
pub fn side(check: &str) -> Side {
    checks().find(|known| known.name == check).map_or(Side::Above, |check| check.limits.side)
}

/// Ignores `NaN`.
fn worse(known: f32, value: f32, check: &str) -> f32 {
    match side(check) {
        Side::Above => known.max(value),
        Side::Below => known.min(value),
    }
}

/// `NaN` for an impact in a radio gap, which the monitor reports just beyond the limit.
fn measured(check: &str, value: f32, limit: f32) -> f32 {
    let is_least = check == IMPACT && value.to_bits() == limit.next_up().to_bits();
    if is_least { f32::NAN } else { value }
}

/// Start with the sum of gaps until then.
type Since = (Instant, Span);

#[derive(Debug, Default)]
pub(super) struct Problems {
    /// The changes, up to [`LISTED_MAX`].
    pub findings: Vec<Finding>,
    /// Number of findings.
    pub findings_count: u64,
    open: BTreeMap<(String, u8), OpenProblem>,
    /// Found by a box, perhaps late ([`began`]).
    of_box: bool,
}

#[derive(Debug)]
struct OpenProblem {
    problem: Problem,
    /// Wrong again, with the sum of gaps.
    since: Option<Since>,
    /// Its level now.
    level: Level,
    /// Now, and once.
    unexplained: bool,
    alone: bool,
}

impl OpenProblem {
    fn end(&mut self, at: Instant, gaps: Span) {
        if let Some(since) = self.since.take() {
            self.problem.lasted = self.problem.lasted + lasted(since, at, gaps);
            self.alone |= self.unexplained;
        }
    }
}

impl Problems {
    pub(super) fn of_box() -> Self {
        Self { of_box: true, ..Self::default() }
    }

    /// `gaps`: sum until then.
    pub(super) fn take(&mut self, finding: &Finding, gaps: Span) {
        let value = measured(&finding.check, finding.value, finding.limit);
        let finding = &Finding { value, ..finding.clone() };
        self.findings_count += 1;
        if self.findings.len() < LISTED_MAX {
            self.findings.push(finding.clone());
        }
        let key = (finding.check.clone(), finding.instance);
        let known = self.open.contains_key(&key);
        let bad = rank(finding.level) > 0;
        if !known && (!bad || self.open.len() >= FOLLOWED_MAX) {
            return;
        }
        let new = || Problem {
            subsystem: finding.subsystem,
            check: finding.check.clone(),
            instance: finding.instance,
            level: finding.level,
            at: finding.at,
            times: 0,
            lasted: Span::ZERO,
            lasting: false,
            onset: finding.value,
            value: f32::NAN,
            limit: finding.limit,
            unit: finding.unit.clone(),
            details: Vec::new(),
            event: None,
            unheard_from: None,
            because: None,
        };
        let followed = self.open.entry(key).or_insert_with(|| OpenProblem {
            problem: new(),
            since: None,
            level: finding.level,
            unexplained: true,
            alone: false,
        });
        followed.level = finding.level;
        let OpenProblem { problem, since, unexplained, .. } = followed;
        if rank(finding.level) > rank(problem.level) {
            (problem.level, problem.at) = (finding.level, finding.at);
            (problem.onset, problem.limit) = (finding.value, finding.limit);
        }
        if bad {
            problem.value = worse(problem.value, finding.value, &finding.check);
            if since.is_none() {
                problem.times += 1;
                *since = Some((finding.at, gaps));
                *unexplained = true;
            }
            self.explain();
        } else {
            followed.end(finding.at, gaps);
        }
    }

    fn explain(&mut self) {
        let open = || {
            self.open
                .values()
                .filter_map(|followed| Some((followed.since?.0, &followed.problem, followed.level)))
        };
        let since_of = |since, check| {
            if self.of_box {
                began(check, since, open().map(|(since, problem, _)| (since, &*problem.check)))
            } else {
                since
            }
        };
        let alarms: Vec<Alarm> = open()
            .filter_map(|(since, problem, level)| {
                Alarm::of(&problem.check, problem.instance, level, since_of(since, &problem.check).into())
            })
            .collect();
        for followed in self.open.values_mut().filter(|followed| followed.unexplained) {
            let Some((since, _)) = followed.since else { continue };
            let Problem { check, instance, .. } = &followed.problem;
            let effect = Alarm::of(check, *instance, followed.level, since.into());
            if let Some(cause) = effect.and_then(|effect| root_cause(&effect, alarms.iter().copied())) {
                // Of the first alarm at the worst level.
                if followed.problem.because.is_none() || followed.problem.at >= since {
                    followed.problem.because = Some(cause.check.name.to_owned());
                }
                followed.unexplained = false;
            }
        }
    }

    pub(super) fn peak(&mut self, check: &str, instance: u8, value: f32) {
        if let Some(OpenProblem { problem, .. }) = self.open.get_mut(&(check.to_owned(), instance)) {
            problem.value = worse(problem.value, measured(check, value, problem.limit), check);
        }
    }

    pub(super) fn is_open(&self, check: &str) -> bool {
        self.open.get(&(check.to_owned(), 0)).is_some_and(|followed| followed.since.is_some())
    }

    pub(super) fn is_in_mishap(&self) -> bool {
        self.open.values().any(|followed| {
            let OpenProblem { problem, since, level, .. } = followed;
            problem.subsystem == Subsystem::Mishap && since.is_some() && *level == Level::Critical
        })
    }

    pub(super) fn open_since(&self, check: &str) -> Option<Instant> {
        self.open.get(&(check.to_owned(), 0)).and_then(|followed| followed.since.map(|(since, _)| since))
    }

    pub(super) fn detail(&mut self, check: &str, name: &str) {
        let known = self.open.get_mut(&(check.to_owned(), 0)).filter(|followed| followed.since.is_some());
        let Some(OpenProblem { problem, .. }) = known else { return };
        if problem.details.len() < DETAILS_MAX && !problem.details.iter().any(|known| known == name) {
            problem.details.push(name.to_owned());
        }
    }

    /// Explains the first occurrence, whose time is shown.
    pub(super) fn event(&mut self, check: &str, words: &str) {
        self.detail(check, words);
        if let Some(OpenProblem { problem, .. }) = self.open.get_mut(&(check.to_owned(), 0))
            && problem.times == 1
        {
            problem.event.get_or_insert_with(|| words.to_owned());
        }
    }

    pub(super) fn unheard(&mut self, check: &str, from: Instant, to: Instant) {
        self.detail(check, &format!("not heard, between {} and {}", moment(from), moment(to)));
        if let Some(OpenProblem { problem, .. }) = self.open.get_mut(&(check.to_owned(), 0)) {
            problem.unheard_from = Some(from);
        }
    }

    pub(super) fn name_parts(&mut self, due: impl Fn(Subsystem) -> Option<(String, Option<String>)>) {
        for OpenProblem { problem, .. } in self.open.values_mut().filter(|of| part::is_due(&of.problem.check))
        {
            problem.details.extend(due(problem.subsystem).map(|due| part::due_words(&due)));
        }
    }

    pub(super) fn drop_checks(&mut self, out: impl Fn(&str) -> bool) {
        let before = self.findings.len();
        self.findings.retain(|finding| !out(&finding.check));
        self.findings_count -= (before - self.findings.len()) as u64;
        self.open.retain(|(check, _), _| !out(check));
    }

    pub(super) fn break_off(&mut self, at: Instant, gaps: Span) {
        self.open.values_mut().for_each(|followed| followed.end(at, gaps));
    }

    /// The recording ends.
    pub(super) fn end(&mut self, at: Instant, gaps: Span) {
        for followed in self.open.values_mut() {
            followed.problem.lasting |= followed.since.is_some();
            followed.end(at, gaps);
        }
    }

    pub(super) fn all(mut self) -> (u64, Vec<Finding>, Vec<Problem>) {
        let (count, mut findings) = (self.findings_count, std::mem::take(&mut self.findings));
        // An impact is reported after the vehicle lies still.
        findings.sort_by_key(|finding| finding.at);
        let problems = self.worst_first();
        give_worst(&mut findings, &problems);
        (count, findings, problems)
    }

    pub(super) fn worst_first(self) -> Vec<Problem> {
        let mut problems: Vec<_> = self
            .open
            .into_values()
            .map(|OpenProblem { problem, alone, .. }| Problem {
                because: problem.because.clone().filter(|_| !alone),
                ..problem
            })
            .collect();
        worst_first(&mut problems);
        problems
    }
}

/// Sorts by [`Problem::order`] within a level.
pub(super) fn worst_first(problems: &mut [Problem]) {
    let mishaps = mishaps(problems);
    problems.sort_by_key(|problem| (std::cmp::Reverse(rank(problem.level)), problem.order(&mishaps)));
}

/// The problems from a log's findings, worst first. The findings are by a box or by this program; `peaks` are worst
/// values by check and part.
pub fn problems<'a>(
    findings: &[Finding],
    of_box: bool,
    peaks: impl IntoIterator<Item = (&'a str, u8, f32)>,
) -> Vec<Problem> {
    let mut problems = if of_box { Problems::of_box() } else { Problems::default() };
    for finding in findings {
        problems.take(finding, Span::ZERO);
    }
    for (check, instance, value) in peaks {
        problems.peak(check, instance, value);
    }
    problems.worst_first()
}

pub(super) fn give_worst(findings: &mut [Finding], problems: &[Problem]) {
    for problem in problems {
        let is_it = |of: &&mut Finding| {
            (of.at, of.level, of.instance) == (problem.at, problem.level, problem.instance)
                && of.check == problem.check
        };
        if let Some(finding) = findings.iter_mut().find(is_it) {
            finding.worst = problem.value.is_finite().then_some(problem.value);
        }
    }
}

/// Start of a problem that a box found at this time, while others are `open` since theirs. In an ongoing
/// mishap it finds an impact at once.
pub fn began<'a>(
    check: &str,
    found_at: Instant,
    mut open: impl Iterator<Item = (Instant, &'a str)>,
) -> Instant {
    let is_mishap = |name| checks().any(|check| check.name == name && check.subsystem == Subsystem::Mishap);
    if check == IMPACT && !open.any(|(since, other)| since < found_at && is_mishap(other)) {
        Instant::from_micros(found_at.as_micros().saturating_sub(LIES_STILL.as_micros()))
    } else {
        found_at
    }
}

/// Duration without gaps.
fn lasted((from, before): Since, at: Instant, gaps: Span) -> Span {
    let between = gaps.as_micros().saturating_sub(before.as_micros());
    Span::from_micros(at.since(from).as_micros().saturating_sub(between))
}

#[cfg(test)]
pub(super) mod tests;
