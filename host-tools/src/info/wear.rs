//! Exceedances and wear, for people.

use std::fmt::Write as _;

use hums_core::clock::Instant;
use hums_core::health::exceedance::Crossings;

use crate::names::check_name;
use crate::plural::count;
use crate::printable::word;
use crate::states::{ShownValue, quantity, shown};
use crate::summary::Overview;
use crate::table::{Table, left, right};
use crate::utc::moment;
use hums_analysis::log_json::finite;

pub(super) fn text(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    let columns = [left(35), left(8), right(8), right(7), right(9), right(7), left(0)];
    let mut table = Table::new(2, columns);
    table.heading(["exceeded", "of", "warnings", "for", "criticals", "for", "worst"]);
    for ((check, instance), line) in &contents.exceedances {
        for (of, crossings) in [("session", &line.session), ("life", &line.lifetime)] {
            // A check made here is of this recording alone.
            if of == "session" && !crossings.happened() || of == "life" && contents.checked_here {
                continue;
            }
            let Crossings { warnings, criticals, warning_tenths, critical_tenths, peak } = *crossings;
            let seconds = |tenths: u32| moment(Instant::from_millis(u64::from(tenths) * 100));
            let worst = match shown(check, peak, f32::NAN) {
                ShownValue::State(state) => state.unwrap_or_default().to_owned(),
                ShownValue::Quantity(peak, _) => {
                    peak.map_or_else(String::new, |peak| quantity(peak, &line.unit))
                }
            };
            table.row([
                format!("  {}", word(&check_name(check, &[*instance]))),
                of.to_owned(),
                warnings.to_string(),
                seconds(warning_tenths),
                criticals.to_string(),
                seconds(critical_tenths),
                word(worst.trim_end()).into_owned(),
            ]);
        }
    }
    if !contents.exceedances.is_empty() {
        let _ = write!(text, "{table}");
    }
    if !contents.components.is_empty() {
        text.push_str("  components\n");
    }
    for (place, line) in &contents.components {
        let (name, limit) = contents.part(*place, line);
        let limit = limit.map_or_else(String::new, |limit| format!(" of {limit}"));
        let used = finite(line.used_percent)
            .map_or_else(|| "no limit".to_owned(), |percent| format!("{percent:.1} % used{limit}"));
        let (hours, motor_hours) = (line.figures.flight_s / 3_600.0, line.figures.motor_s / 3_600.0);
        let _ = writeln!(
            text,
            "    {place} {}: {}, {used}; {hours:.2} h in the air, {motor_hours:.2} h turning, {}, {:.2} cycles",
            word(format!("{name} {}", line.serial).trim_end()),
            line.status,
            count(line.figures.flights as u64, "flight"),
            line.figures.cycles
        );
    }
}
