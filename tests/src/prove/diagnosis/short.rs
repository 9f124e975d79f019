//! For every change: a floor for found faults, a ceiling for false alarms. A commit that improves a check tightens
//! the limits; a commit that eases one gives the reason.

use anyhow::{Result, ensure};
use hums_core::health::Level;

use super::judged::judge_all;
use super::options::Flights;
use super::outcome::count;
use super::sets::find_all;

/// Reported faults among the visible ones, and those with a named cause.
const TOLD_MIN: usize = 71;
const NAMED_MIN: usize = 69;
/// False alarms in the air and on the ground. The third warning and the critical repeat a failsafe of PX4 before the
/// labelled fault (p39).
const WARNINGS_MAX: usize = 3;
const CRITICAL_MAX: usize = 1;
const GROUND_MAX: usize = 0;
/// Flights with wrong counts.
const MISCOUNTED_MAX: usize = 0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sums {
    faults: usize,
    told: usize,
    named: usize,
    warnings: usize,
    critical: usize,
    ground: usize,
    counted: usize,
    miscounted: usize,
}

pub(super) fn run() -> Result<String> {
    let mut sums = Sums::default();
    let (sets, _) = find_all(&Flights::short())?;
    for set in sets.iter().filter(|set| set.is_labelled()) {
        for one in judge_all(set)?.outcomes {
            if let Some(fault) = one.fault.filter(|fault| fault.visible) {
                sums.faults += 1;
                sums.told += usize::from(fault.told.is_some());
                sums.named += usize::from(fault.named.is_some());
            }
            sums.warnings += count(&one.alarms, Level::Warning, true) as usize;
            sums.critical += count(&one.alarms, Level::Critical, true) as usize;
            if let Some((truth, counted)) = one.counts {
                sums.counted += 1;
                sums.miscounted += usize::from(truth != counted);
            }
            sums.ground += one.alarms.iter().filter(|it| !it.in_air).count();
        }
    }
    sums.check()?;
    Ok(sums.text())
}

impl Sums {
    fn text(&self) -> String {
        let Self { faults, told, named, warnings, critical, ground, counted, miscounted } = self;
        format!(
            "* faults, reported, cause named: {faults}, {told} (at least {TOLD_MIN}), {named} (at least {NAMED_MIN})\n\
             * false warnings and criticals in the air: {warnings} (at most {WARNINGS_MAX}), {critical} (at most {CRITICAL_MAX})\n\
             * false alarms on the ground: {ground} (at most {GROUND_MAX})\n\
             * flights, landings and mishaps counted: in {counted} flights, wrong in {miscounted} (at most {MISCOUNTED_MAX})\n"
        )
    }

    fn check(&self) -> Result<()> {
        const SHOWS: &str = "cargo xtask prove diagnosis shows which";
        let finds = self.told >= TOLD_MIN && self.named >= NAMED_MIN;
        ensure!(finds, "fewer faults are found than before; {SHOWS}\n{}", self.text());
        let is_quiet =
            self.warnings <= WARNINGS_MAX && self.critical <= CRITICAL_MAX && self.ground == GROUND_MAX;
        ensure!(is_quiet, "more false alarms than before; {SHOWS}\n{}", self.text());
        let counts = self.miscounted == MISCOUNTED_MAX;
        ensure!(counts, "more flights are counted wrong than before; {SHOWS}\n{}", self.text());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_gets_worse_fails_and_says_how() {
        let good = Sums {
            faults: 72,
            told: TOLD_MIN,
            named: NAMED_MIN,
            warnings: WARNINGS_MAX,
            critical: CRITICAL_MAX,
            ground: GROUND_MAX,
            counted: 86,
            miscounted: MISCOUNTED_MAX,
        };
        assert!(good.check().is_ok());
        for (worse, said) in [
            (Sums { told: TOLD_MIN - 1, ..good }, "fewer faults"),
            (Sums { named: NAMED_MIN - 1, ..good }, "fewer faults"),
            (Sums { warnings: WARNINGS_MAX + 1, ..good }, "more false alarms"),
            (Sums { critical: CRITICAL_MAX + 1, ..good }, "more false alarms"),
            (Sums { ground: GROUND_MAX + 1, ..good }, "more false alarms"),
            (Sums { miscounted: MISCOUNTED_MAX + 1, ..good }, "counted wrong"),
        ] {
            let error = format!("{:#}", worse.check().unwrap_err());
            assert!(error.contains(said) && error.contains("at least"), "{error}");
        }
    }
}
