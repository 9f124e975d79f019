//! The checker of the vehicle's health in a log, as rows: `HUMS_CHECKED`, one row a log. If the recorder ran
//! no checks, also `HUMS_FINDING` with the findings of this program.

use hums_core::clock::Instant;
use hums_core::health::Level;

use super::row::{Cell, Row, count, single, text};
use crate::check::judged::{JudgedBy, Judgement, TOO_LITTLE};
use crate::check::problem::{Problem, problems};
use crate::source::item::ColumnType;
use crate::source::told::Finding;
use crate::states;
use crate::summary::Contents;

/// Word for the monitor on board, as `checked_by` in `hums info --json`.
pub const BOARD: &str = "board";
const HUMS: &str = "hums";
const NOBODY: &str = "nobody";

/// This program's findings in a recording whose recorder ran no checks.
#[derive(Clone, Debug)]
pub struct Checked {
    by: &'static str,
    verdict: &'static str,
    pub(crate) findings: Vec<Finding>,
    count: u64,
    judged: u64,
    not_judged: u64,
    is_timeless: bool,
}

impl Checked {
    /// From a judged recording; `None` if the monitor on board checked it.
    pub fn new(judged: Judgement) -> Option<Self> {
        if judged.by == JudgedBy::Board {
            return None;
        }
        let (by, verdict) = (if judged.worst().is_some() { HUMS } else { NOBODY }, judged.verdict());
        let Judgement { findings, findings_count: count, judged, not_judged, is_timeless, .. } = judged;
        let (judged, not_judged) = (judged.len() as u64, not_judged.len() as u64);
        Some(Self { by, verdict, findings, count, judged, not_judged, is_timeless })
    }

    /// The reason for missing findings, as a part of a sentence; `None` if it was checked.
    pub fn not_checked(&self) -> Option<&'static str> {
        let why = if self.is_timeless {
            "not checked: it has no times"
        } else {
            "not checked: no autopilot was heard in it"
        };
        (self.by == NOBODY).then_some(why)
    }

    /// Its findings, each with its row.
    pub fn rows(&self) -> impl Iterator<Item = (&Finding, Row)> {
        self.findings.iter().map(|finding| (finding, finding_row(finding, self.by)))
    }

    /// The row of the log; for a part of it, of the findings in that part.
    pub fn row(&self, part: Option<&dyn Fn(Instant) -> bool>) -> Row {
        let (verdict, findings) = match part.filter(|_| self.by == HUMS) {
            None => (self.verdict, self.count),
            Some(is_wanted) => {
                let mut part = FindingCount::default();
                let wanted = self.findings.iter().filter(|finding| is_wanted(finding.at));
                wanted.for_each(|finding| part.add(finding.level));
                // A log with too little judged has too little in every part.
                let is_judged = part.verdict() != Level::Ok.name() || self.verdict != TOO_LITTLE;
                (if is_judged { part.verdict() } else { TOO_LITTLE }, part.count)
            }
        };
        row(self.by, verdict, findings, count(self.judged), count(self.not_judged))
    }
}

/// The findings of a log's own monitor, or of a part of a log, counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct FindingCount {
    count: u64,
    /// The worst level, by its number; a stopped input does not count.
    worst: u8,
}

impl FindingCount {
    /// Counts a finding of this level.
    pub fn add(&mut self, level: Level) {
        self.count += 1;
        if level != Level::Stale {
            self.worst = self.worst.max(level as u8);
        }
    }

    /// Adds the count of the next group.
    pub fn and(&mut self, next: Self) {
        self.count += next.count;
        self.worst = self.worst.max(next.worst);
    }

    fn verdict(self) -> &'static str {
        match Level::ALL.get(usize::from(self.worst)) {
            Some(level @ (Level::Warning | Level::Critical)) => level.name(),
            _ => Level::Ok.name(),
        }
    }

    /// The row of the log. The record does not name the checks that its monitor could not judge.
    pub fn row(&self) -> Row {
        let unknown = || Cell::Unknown(ColumnType::Unsigned);
        row(BOARD, self.verdict(), self.count, unknown(), unknown())
    }
}

fn row(by: &str, verdict: &str, findings: u64, judged: Cell, not_judged: Cell) -> Row {
    Row::new(
        "HUMS_CHECKED",
        vec![
            ("checked_by", text(by)),
            ("verdict", text(verdict)),
            ("findings", count(findings)),
            ("judged", judged),
            ("not_judged", not_judged),
        ],
    )
}

/// A finding, and who found it.
pub fn finding_row(finding: &Finding, by: &str) -> Row {
    Row::new(
        "HUMS_FINDING",
        vec![
            ("at[s]", Cell::Time(finding.at)),
            ("subsystem", text(finding.subsystem.name())),
            ("check", text(finding.check.as_str())),
            ("instance", count(finding.instance)),
            ("level", text(finding.level.name())),
            ("previous", text(finding.previous.name())),
            ("value", single(finding.value)),
            ("limit", single(finding.limit)),
            ("unit", text(finding.unit.as_str())),
            ("checked_by", text(by)),
        ],
    )
}

/// The problems of a log, worst first, with their worst values.
pub(crate) fn problems_of(contents: &Contents) -> Vec<Problem> {
    let peaks = contents.exceedances.iter();
    let peaks = peaks.map(|((check, instance), line)| (check.as_str(), *instance, line.session.peak));
    problems(&contents.findings, contents.checked_by() == "board", peaks)
}

/// A finding with its level: `critical: battery 1 cell low, 3.4 V (limit 3.5 V)`.
pub fn finding_words(finding: &Finding) -> String {
    let level = if finding.is_bad() { format!("{}: ", finding.level.name()) } else { String::new() };
    level + &states::finding_words(finding)
}
