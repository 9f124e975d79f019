//! The page: one HTML file with its style, its program and its data inside.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use hums_core::clock::Instant;
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::flights::Flight;
use super::replay::{MissingPart, Replay};
use super::tiles::Tiles;
use super::trend::Trend;
use crate::counters::{self, Counters};
use crate::log_json::LogJson;
use crate::page::history::{Cursor, HistoryPart};
use crate::page::json::embedded;
use crate::page::program::{STYLE, UPLOT, program};
use crate::page::spectrum::SpectrumJson;
use crate::summary::{JudgedChecks, Overview};

const TEMPLATE: &str = include_str!("../page/assets/report.html");

#[derive(Serialize)]
struct Data<'a> {
    version: &'static str,
    log: LogJson,
    epoch_us: Option<u64>,
    flight: Option<HistoryPart>,
    flights: &'a [Flight],
    /// The gaps.
    missing: &'a [MissingPart],
    /// Number of checks with a critical problem, and with a warning.
    critical: usize,
    warning: usize,
    verdict: &'a str,
    texts_count: u64,
    /// Number of checks with data, and of all; `null` if nothing was judged.
    judged: Option<(usize, usize)>,
    /// Too few for a clean result to mean anything.
    little: bool,
    tells_flight: bool,
    /// When and how, as a sentence.
    ends_in_air: Option<(f64, String)>,
    counters: Counters,
    /// The time covered by the counters, if it is not the whole.
    counted: Option<String>,
    /// The recorder's reports about itself count until this time, if the recording goes on.
    counted_until_s: Option<f64>,
    /// The airframe's life is without this session.
    life_before: bool,
    stats: Option<BTreeMap<&'static str, u64>>,
    /// Spectra of the inertial sensor.
    spectra: &'a [SpectrumJson],
    trend: &'a Trend,
    /// The flight before of the same airframe.
    before: Option<&'a PreviousRecording>,
}

/// The recording before of the same airframe.
#[derive(Debug, Serialize)]
pub struct PreviousRecording {
    /// Its name.
    pub name: String,
    /// The autopilot's parameters as they were at its end.
    pub values: Vec<(String, f64)>,
}

/// A session's page.
pub fn html(
    log: &Overview,
    replay: &Replay,
    trend: &Trend,
    before: Option<&PreviousRecording>,
    tiles: Option<&Tiles>,
) -> String {
    let data = Data {
        version: env!("CARGO_PKG_VERSION"),
        log: LogJson::new(log),
        epoch_us: log.contents.epoch_us,
        flight: replay.history.since(0, &mut Cursor::default(), Instant::from_micros(u64::MAX)),
        flights: &replay.flights,
        missing: &replay.missing,
        critical: replay.found.0,
        warning: replay.found.1,
        verdict: &replay.verdict,
        texts_count: replay.texts_count,
        judged: replay.judged.map(|checks| (checks.judged, checks.all)),
        little: replay.judged.is_some_and(JudgedChecks::is_little),
        tells_flight: replay.tells_flight,
        ends_in_air: replay.ends_in_air.map(|end| (end.at.as_secs_f64(), end.to_string())),
        counted: log.counted_words(),
        counted_until_s: log.counted_until().map(Instant::as_secs_f64),
        life_before: log.contents.is_life_before(),
        counters: counters::of(&log.contents.usage, &log.contents.lifetime),
        stats: log.contents.stats.as_ref().map(|stats| stats.named().collect()),
        spectra: &replay.spectra,
        trend,
        before,
    };
    whole("report", &data, tiles)
}

/// A self-contained page: the program of `entry`, and its data. With `tiles` it asks their server for images, and no other.
pub fn whole(entry: &str, data: &impl Serialize, tiles: Option<&Tiles>) -> String {
    let program = program(entry);
    let programs = [UPLOT, program.as_str()];
    fill(
        TEMPLATE,
        &[
            ("{{images}}", &tiles.map(Tiles::policy).unwrap_or_default()),
            ("{{scripts}}", &policy(&programs)),
            ("{{tiles}}", &tiles.map(Tiles::element).unwrap_or_default()),
            ("{{style}}", &STYLE.concat()),
            ("{{uplot}}", UPLOT),
            ("{{program}}", &program),
            // Last, so that nothing in it looks like a mark.
            ("{{data}}", &embedded(data)),
        ],
    )
}

/// The programs that may run, for a page's policy: no others, whatever else may get onto the page.
pub(crate) fn policy(programs: &[&str]) -> String {
    let hashes: Vec<String> = programs
        .iter()
        .map(|program| format!("'sha256-{}'", BASE64.encode(Sha256::digest(program))))
        .collect();
    hashes.join(" ")
}

pub(crate) fn fill(template: &str, texts: &[(&str, &str)]) -> String {
    texts.iter().fold(template.to_owned(), |page, (mark, text)| page.replacen(mark, text, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::browser;

    #[test]
    fn each_mark_of_a_template_stands_once() {
        let programs = ["report", "compare", "check", "worker"].map(program);
        let texts: Vec<&str> = programs.iter().map(String::as_str).chain([UPLOT]).chain(STYLE).collect();
        for template in [TEMPLATE, browser::TEMPLATE] {
            for mark in template.split("{{").skip(1).filter_map(|rest| rest.split("}}").next()) {
                let mark = &format!("{{{{{mark}}}}}");
                assert_eq!(template.matches(mark).count(), 1, "{mark}");
                assert!(!texts.iter().any(|text| text.contains(mark)), "{mark}");
            }
        }
        assert!(!texts.iter().any(|text| text.contains("</script")), "a program would end early");
    }
}
