//! The results, as `docs/diagnosis.md`, by one run on one commit.

use super::alarms::{self, BY_CHECK};
use super::faults::{self, BY_CLASS, EACH, SETS};
use super::judged::Judged;
use super::real::{self, RATES, Results};
use super::summary;

pub(super) const HEAD: &str = "\
# Diagnosis: found faults, delays and false alarms

For fleet owners, safety engineers and maintainers. Afterwards you know how many known faults the box reports, how soon, and how often an
alarm is false. The box's monitor judged these recordings with default limits, on a PC. No box was in the vehicles.

* A fault is **reported** if a check rises to warning or critical while the fault lasts. Its **cause is named** if one of these checks is
  of the failed part (`tests/src/prove/diagnosis/causes.rs`). Faults that no message shows are not counted.
* An alarm is **false** if nothing was wrong: without a fault, before it, or in weather that the autopilot resists. Each rise counts.
* **Known** flights were there when the limits were chosen: their figures show only that nothing got worse. All others were judged once, and measure the box: the checks of one commit ran over flights on which no limit was chosen.
* **Real flights** are public logs of [ArduPilot](real-flights.csv) and [PX4](real-flights-px4.csv), [labelled by hand](../tests/real-flights/README.md). All of them are known now. Before that, the three newest sets, of other owners, were judged once:
  * `judged-2` (124 recordings, 23 owners, by 429211c), `judged-3` (34, 12, by e97cc274) and `judged-4` (26, 6, by ddc1fde): 2.7, 4.0 and 0 false warnings an armed hour, 3.6, 1.3 and 9.6 false criticals, 14, 27 and 24 needless findings; the failed part first in 14 of 31, 3 of 14 and 7 of 11 faults. All criticals of `judged-4` were of one kind on one vehicle, and that is mended; its PX4 recordings are all of one owner.
  * **So expect of ArduPilot 1.5 false warnings and 3 false criticals an armed hour (7 and 14 in 4.7 h; at most 2.8 and 4.7), of PX4 10 and 8 (8 and 6 in 0.8 h; at most 18 and 15), of both some 20 needless texts an hour, and the failed part first in 24 of 56 faults.** The table is of the checks since: it is no measure.
* **Simulator flights** are the repository's [labelled flights](../tests/labelled/README.md) and the sets SITL A to M. No check knows a label.
* Bounds (\"at least\", \"at most\") are exact, 95 %. Delays are seconds after the fault. Hours are in the air; of real flights they are armed. [health.md](health.md) explains the checks.

`cargo xtask prove diagnosis` prints these tables and each fault; `--write` writes this page. With `FOLDER` it also judges the folder's flights: those of
`labels*.csv` (`tests/src/prove/diagnosis/real.rs` has the columns) or of [our labels](../tests/real-flights/README.md), those of each `labels.json`, or all. `--unseen FOLDER` counts them as not known.
`HUMS_FLIGHTS` names a folder of recordings without labels. `cargo xtask test` fails if fewer faults of the repository's flights are found, or more alarms are false.
";

/// No table shows these.
const LIMITS: &str = "\
## Known limits

| fault | not reported, or late, because |
|---|---|
| faults of real vehicles | a simulator has no loose screws, worn bearings, water or wrong propellers; its faults begin at once, one at a time |
| faults without a message | the box reads messages only: PX4 sends STATUSTEXT only to a ground station; logs of ground stations have low rates |
| wear | judged only against three earlier flights; 30 real flights with cut propellers: [usage.md](usage.md#baselines) |
| a fall in a radio gap | it is judged by `hums check`, not by the box |
| short twists | 28 to 39 rad/s2 for 0.6 s lean a vehicle by 4 to 13 degrees, as gusts do |
| GPS velocity | noise or an offset of 1.6 to 3 m/s; a receiver 0.5 to 0.9 s late; a position that drifts by 1 m/s |
| gyros, accelerometers | gyros: noise of one of several, 43 to 59 deg/s, which messages have filtered, and biases that are alike in all; accelerometers: a bias below 1 m/s2, or 1.6 m/s2 on wings |
| weak motors, control surfaces | 83 to 86 %; on Y6 frames; 60 to 75 % in wind of 9 m/s, where a quadrotor leans by 25 to 45 degrees; an aileron or elevator with 25 to 34 % of its way, or trimmed away |
| magnetic anomalies, vibration | a field of 300 to 490 mG: the estimator's ratio stays below 0.65; a rise of vibration to 6 m/s2; up to 11 m/s2 on wings, 18 to 24 m/s2 on octocopters and helicopters on fast legs |
| batteries, barometers | a drop of 1.4 to 1.5 V of a pack; two barometers that freeze at once |
| delays over 1 s | radio control 1 s and ground station 5 s (the autopilot waits), links 3.5 s, cell voltage 5 s, drifts until 8 m |
| hard landings | shocks of normal landings reach 12 g (377 public landings): no limit parts them from impacts. If the estimate drifts, such a vehicle counts as in the air until it is disarmed |
| right part first, of real vehicles | 52 of 131 known causes come later or never: no check for motors without power (2) and for two motors at their upper end (3), a touch of the ground in flight, a computer that burns, oscillation; an estimator, a compass or a supply doubts before the cause is known; of crashes the first text is often the tilt, half a second before the impact; crashes after a true text of vibration, battery or thrust; a battery that no text and no voltage shows as empty; tests on a bench (4), a gap of the radio, a recording that ends with the fault |
| false on real vehicles | criticals: battery failsafes of an autopilot that measures the supply of its board (5) or nothing (2), and texts of an empty battery at each take-off of one vehicle (7); the roll of an estimator that has failed before pressure or forces show it (3); a barometer that runs away (1), and one that is blamed for its receiver (1); a crash that an autopilot reports after a flight, while it stands (1); hard landings (2) and disarming after one (1); a receiver, blamed for an accelerometer that clips (1); a current sensor that always says 1.05 A (1). Of the warnings: a motor in a manoeuvre or in wind (6), rates of vehicles carried by hand (2), GPS spoofing of one vehicle (3), compasses after fast yaws (2) and while motion capture is lost (1), thrust while a switch stops the motors (2) |
| vehicles that were tried | real ones, in armed hours: quadrotors 13, rovers 0.9, planes 0.7, octorotors 0.3, VTOLs 0.2, submarines 0.2, hexarotors and helicopters 0.04 each; no tricopter, no boat. Of the class *attitude* 8 of 9 faults of simulators were not reported (short twists) |
| flags of SYS_STATUS | a sensor that the autopilot never called healthy since the box's start is not reported: it may be broken, or not fitted |

## Sets that were held out

Each set was flown after the limits were chosen, and judged once by the checks of that commit. Limits have been chosen since with all but K and M. Most are not in the repository. Of the
simulated faults 763 of 850 were reported (90 %). \"By the data\": so many are false after a comparison with the data. From set `O` on no critical of a simulator was, in 39.4 hours.

| flights | flown by | faults | reported | cause named | median s | hours | false warnings | false criticals |
|---|---|---|---|---|---|---|---|---|
| frozen-3, 4, 5, at 24a2872, 30f3dc3, 7140a18 | ArduPilot, PX4 | -, -, 28 | -, -, 20 | -, -, 7 | 2.1 | 90.16 | 60 | 11 |
| JUDGE, at df5dde0 | ArduPilot, PX4 | 39 | 29 | 28 | 1.4 | 3.85 | 68, of ArduPilot's 36 by the data 2 | 5 |
| SITL-21 B and C | ArduPilot | 71 | 60 | 53 | 1.2, 1.8 | 5.78 | 5, by the data 1 | 0 |
| D, at 4c5b11a; E | ArduPilot | 100, 31 | 89, 29 | 86, 28 | 1.3, 1.4 | 4.71 | 10, 9 of one upset; 0 | 7, all of that upset; 0 |
| F, at 1939d40 | ArduPilot | 49 | 46 | 46 | 1.0 | 1.12 | 5, by the data 3 | 2, by the data 0 |
| I, J; K, M; N | ArduPilot | -; 26; - | -; 26; - | -; 26; - | 1.1 | 8.84; 2.27; 18.4 armed | 1; 0; 3 | 0; 0; 3 |
| O, P; Q, R | ArduPilot | 73; 126 | 63; 117 | 61; 114 | 1.0; 1.1 | 8.94; 18.85 | 3; 7, by the data 0 | 0; 6, by the data 0 |
| S, T; UA, UP | PX4; ArduPilot, PX4 | 48; 114 | 45; 107 | 41; 102 | 1.0; 1.2 | 3.47; 2.34 | 23; 9 | 0 |
| U to X | ArduPilot, PX4 | 145 | 132 | 120 | 0.6, 1.6 | 5.80 | 4, by the data 0 | 1, by the data 0 |
| 41, 88, 100, 44 recordings, at d9bdda6, 5569e89, ea3e47e, be9d315 | real vehicles | 11, 20, 7 crashes | 7, 16, 5 | - | - | 1.5, 1.6, 0.39, 0.35 | 7, 1, 2, 6 | 7, 19 (17 of one vehicle that stood), 1, 7 |
| 149, 124, 34, 26 recordings, at 91f7cbc, 429211c, e97cc274, ddc1fde | real vehicles | -, 31, 14, 11 | - | -, 14, 3, 7 first | - | 4.62, 3.30, 1.51, 0.63 armed | 15, 9, 6, 0 | 11, 12, 2, 6 |
";

pub(super) fn text(real: &[Results], judged: &[Judged]) -> String {
    [
        RATES.section(&real::rates(real, judged)),
        summary::section(judged),
        SETS.section(&faults::sets(judged)),
        BY_CLASS.section(&faults::by_class(judged)),
        BY_CHECK.section(&alarms::by_check(judged)),
        LIMITS.to_owned(),
    ]
    .join("\n")
}

/// Each fault, wrong count and alarm without labels: printed, not in the page.
pub(super) fn details(real: &[Results], judged: &[Judged]) -> String {
    let wrong = alarms::wrong_counts(judged);
    [
        format!("## Flights, landings, mishaps: wrong of\n\n{}\n", wrong.join("\n")),
        real::EACH.section(&real::each(real)),
        EACH.section(&faults::each(judged)),
    ]
    .join("\n")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::flights::root;

    #[test]
    fn the_document_is_of_the_tables_that_the_judge_prints() {
        let text = fs::read_to_string(root().join("docs/diagnosis.md")).unwrap();
        assert!(
            text.starts_with(HEAD) && text.ends_with(LIMITS),
            "`cargo xtask prove diagnosis --write` writes it"
        );
        for line in
            [&RATES, &SETS, &BY_CLASS, &BY_CHECK].into_iter().flat_map(super::super::table::Form::lines)
        {
            assert!(text.lines().any(|of_page| of_page == line), "{line}");
        }
        assert!(text.contains(summary::TITLE));
        assert_eq!(text.lines().filter(|line| line.starts_with("Commit ")).count(), 1, "one commit");
        assert!(text.lines().count() <= 150, "one page");
    }

    /// `--write` deletes text that no table or constant has.
    #[test]
    fn the_document_has_no_text_by_hand() {
        let text = fs::read_to_string(root().join("docs/diagnosis.md")).unwrap();
        let made = text.strip_prefix(HEAD).unwrap().strip_suffix(LIMITS).unwrap();
        let forms = [&RATES, &SETS, &BY_CLASS, &BY_CHECK];
        for line in made.lines().filter(|line| !line.starts_with("| ") && !line.starts_with("|---")) {
            let is_made = line.is_empty()
                || line.starts_with("Commit ")
                || line == summary::TITLE
                || line.starts_with("* ")
                || forms.iter().any(|form| line == form.about || line == form.lines()[0]);
            assert!(is_made, "{line}");
        }
        assert_eq!(made.lines().filter(|line| line.starts_with("|---")).count(), forms.len(), "tables");
    }
}
