//! The causes of a log's findings.

use std::collections::BTreeMap;

use hums_core::clock::Instant;
use hums_core::health::{Alarm, Level, root_cause};

use super::problem::began;
use crate::source::told::Finding;

struct Open<'a> {
    since: Instant,
    level: Level,
    check: &'a str,
    instance: u8,
    unexplained: Vec<usize>,
}

impl Open<'_> {
    fn alarm(&self, since: Instant) -> Option<Alarm> {
        Alarm::of(self.check, self.instance, self.level, since.into())
    }
}

/// The explaining check; `None` without a cause. Findings are in order.
pub fn causes(findings: &[Finding]) -> Vec<Option<String>> {
    let mut causes = vec![None; findings.len()];
    let mut open: BTreeMap<(&str, u8), Open<'_>> = BTreeMap::new();
    for (place, finding) in findings.iter().enumerate() {
        let key = (finding.check.as_str(), finding.instance);
        let level = finding.level;
        if !matches!(level, Level::Warning | Level::Critical | Level::Stale) {
            open.remove(&key);
            continue;
        }
        let one = open.entry(key).or_insert_with(|| Open {
            since: finding.at,
            level,
            check: &finding.check,
            instance: finding.instance,
            unexplained: Vec::new(),
        });
        one.level = level;
        one.unexplained.push(place);
        // The consequence may be seen first.
        let since = |one: &Open<'_>| {
            let others = open.values().map(|other| (other.since, other.check));
            began(one.check, one.since, others)
        };
        let alarms: Vec<Alarm> = open.values().filter_map(|one| one.alarm(since(one))).collect();
        for one in open.values_mut().filter(|one| !one.unexplained.is_empty()) {
            let effect = one.alarm(one.since);
            if let Some(cause) = effect.and_then(|effect| root_cause(&effect, alarms.iter().copied())) {
                for place in one.unexplained.drain(..) {
                    if let Some(known) = causes.get_mut(place) {
                        *known = Some(cause.check.name.to_owned());
                    }
                }
            }
        }
    }
    causes
}

#[cfg(test)]
mod tests {
    use hums_core::health::Subsystem;

    use super::*;

    fn finding(at_s: u64, check: &str, level: &str) -> Finding {
        Finding {
            at: Instant::from_millis(at_s * 1000),
            subsystem: Subsystem::Navigation,
            check: check.to_owned(),
            instance: 0,
            level: Level::ALL.into_iter().find(|known| known.name() == level).expect("a level"),
            previous: Level::Ok,
            value: 1.0,
            worst: None,
            limit: 1.0,
            unit: String::new(),
        }
    }

    #[test]
    fn a_finding_names_its_cause_while_that_is_so_and_when_it_was_seen_a_little_later() {
        let findings = [
            finding(1, "gps_fix", "critical"),
            finding(2, "ekf_failsafe", "critical"),
            finding(3, "ekf_failsafe", "ok"),
            finding(4, "gps_fix", "ok"),
            finding(5, "ekf_failsafe", "critical"),
            finding(9, "gps_fix", "critical"),
            finding(20, "ekf_failsafe", "ok"),
            finding(21, "gps_fix", "ok"),
            finding(30, "ekf_failsafe", "critical"),
            finding(50, "gps_fix", "critical"),
        ];
        let causes = causes(&findings);
        let explained: Vec<usize> =
            (0..).zip(&causes).filter_map(|(at, cause)| cause.as_ref().map(|_| at)).collect();
        assert_eq!(explained, [1, 4], "the last one had stood for twenty seconds: {causes:?}");
        assert_eq!(causes[1].as_deref(), Some("gps_fix"));
    }

    #[test]
    fn a_mishap_explains_what_begins_with_it_and_nothing_from_before() {
        let findings = [
            finding(10, "airspeed_alert", "warning"),
            finding(11, "sinking", "critical"),
            finding(12, "ekf_test_ratio", "warning"),
            finding(20, "sinking", "ok"),
            finding(20, "ekf_test_ratio", "ok"),
            finding(30, "compass_heading", "warning"),
            finding(32, "clipping", "warning"),
            // A second after rest.
            finding(33, "impact", "critical"),
        ];
        let causes = causes(&findings);
        let explained: Vec<Option<&str>> = causes.iter().map(Option::as_deref).collect();
        let none = None;
        let expected = [none, none, Some("sinking"), none, none, none, Some("impact"), none];
        assert_eq!(explained, expected);
    }
}
