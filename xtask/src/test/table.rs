//! What the tests' own runners said, and the table at the end of the run.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

/// What a step prints before the name of something that it does not test here.
pub(super) const NOT_TESTED: &str = "NOT TESTED: ";

/// What the runners of one step said.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(super) struct Tally {
    /// Tests and campaigns that ran.
    pub(super) ran: u64,
    /// Why something was not tested, and how many tests that concerns (0: it is no test that a runner counts).
    pub(super) not_tested: BTreeMap<String, u64>,
}

impl Tally {
    /// Reads the output of a step: libtest's closing lines and its ignored tests, the campaigns' lines, and what
    /// begins with [`NOT_TESTED`].
    pub(super) fn of(output: &str) -> Self {
        let mut tally = Self::default();
        for line in output.lines() {
            if let Some(result) = line.strip_prefix("test result: ") {
                tally.ran += number_before(result, " passed") + number_before(result, " failed");
            } else if let Some(what) = line.strip_prefix(NOT_TESTED) {
                tally.not_tested.entry(what.to_owned()).or_default();
            } else if let Some(why) = ignored(line) {
                *tally.not_tested.entry(why.to_owned()).or_default() += 1;
            } else if line.contains(" held in ") {
                tally.ran += 1;
            }
        }
        tally
    }
}

/// The number that stands before a word.
fn number_before(text: &str, word: &str) -> u64 {
    let before = text.split(word).next().filter(|before| before.len() < text.len());
    before.and_then(|before| before.rsplit(' ').next()?.parse().ok()).unwrap_or(0)
}

/// Why a test was ignored, from libtest's line about it.
fn ignored(line: &str) -> Option<&str> {
    let (_, outcome) = line.strip_prefix("test ")?.split_once(" ... ignored")?;
    Some(outcome.strip_prefix(", ").unwrap_or("ignored without a reason"))
}

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    Passed,
    Failed,
    /// Another one failed while it ran.
    Stopped,
    /// Another one failed before it began.
    NotRun,
    /// What it needs is missing on this machine.
    Missing,
}

/// A line of the table.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) name: &'static str,
    pub(super) end: End,
    pub(super) took: Duration,
    pub(super) tally: Tally,
}

/// The table; `also` is what else was not tested.
pub(super) fn text(rows: &[Row], took: Duration, also: &[String]) -> String {
    let mut text = format!("{:<16} {:>8} {:>7}\n", "step", "seconds", "tests");
    let mut not_tested: BTreeMap<&str, u64> = also.iter().map(|what| (what.as_str(), 0)).collect();
    let mut ran = 0;
    for row in rows {
        let seconds = match row.end {
            End::NotRun | End::Missing => "-".to_owned(),
            _ => format!("{:.1}", row.took.as_secs_f64()),
        };
        let tests = if row.tally.ran == 0 { "-".to_owned() } else { row.tally.ran.to_string() };
        let end = match row.end {
            End::Passed => "",
            End::Failed => "  FAILED",
            End::Stopped => "  stopped",
            End::NotRun => "  not run",
            End::Missing => "  not run: what it needs is missing",
        };
        let _ = writeln!(text, "{:<16} {seconds:>8} {tests:>7}{end}", row.name);
        ran += row.tally.ran;
        for (what, count) in &row.tally.not_tested {
            *not_tested.entry(what).or_default() += count;
        }
        if matches!(row.end, End::NotRun | End::Missing | End::Stopped) {
            not_tested.entry(row.name).or_default();
        }
    }
    let _ = writeln!(text, "{:<16} {:>8.1} {ran:>7}", "in all", took.as_secs_f64());
    let words: Vec<String> = not_tested
        .iter()
        .map(|(what, count)| match count {
            0 => (*what).to_owned(),
            1 => format!("{what} (1 test)"),
            _ => format!("{what} ({count} tests)"),
        })
        .collect();
    let words = if words.is_empty() { "nothing".to_owned() } else { words.join("; ") };
    let _ = writeln!(text, "not tested here: {words}");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "running 3 tests
test round_trip::a_flight ... ok
test round_trip::further ... ignored, further recordings (HUMS_FLIGHTS is not set)
test usage::further ... ignored, further recordings (HUMS_FLIGHTS is not set)
test result: ok. 12 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.01s
test result: FAILED. 3 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.01s
noise held in 2.1 s, seed 1
NOT TESTED: advisories, because their database cannot be fetched here
";

    #[test]
    fn tests_are_counted_by_their_runners_lines_and_ignored_ones_are_told_with_their_reason() {
        let tally = Tally::of(OUTPUT);
        assert_eq!(tally.ran, 17);
        let told: Vec<(&str, u64)> = tally.not_tested.iter().map(|(what, n)| (what.as_str(), *n)).collect();
        assert_eq!(
            told,
            [
                ("advisories, because their database cannot be fetched here", 0),
                ("further recordings (HUMS_FLIGHTS is not set)", 2),
            ]
        );
    }

    #[test]
    fn the_table_ends_with_what_was_not_tested() {
        let row =
            |name, end, output| Row { name, end, took: Duration::from_secs(2), tally: Tally::of(output) };
        let rows =
            [row("unit", End::Passed, OUTPUT), row("browser", End::Missing, ""), row("fmt", End::Passed, "")];
        let text = text(&rows, Duration::from_secs(5), &[]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "unit                  2.0      17");
        assert_eq!(lines[3], "fmt                   2.0       -");
        assert_eq!(lines[4], "in all                5.0      17");
        assert_eq!(
            lines[5],
            "not tested here: advisories, because their database cannot be fetched here; browser; further recordings \
             (HUMS_FLIGHTS is not set) (2 tests)"
        );
    }

    #[test]
    fn a_run_that_left_nothing_out_says_so() {
        assert!(text(&[], Duration::ZERO, &[]).ends_with("not tested here: nothing\n"));
    }
}
