//! The page: one HTML file with its style, its program and its data inside.

use std::fmt::Write as _;

use anyhow::Result;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use hums_blackbox::record::Stats;
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::flights::{Flight, PhaseSpan};
use super::plots::{About, Plot, about};
use super::program::program;
use super::replay::{Point, Replay, Said};
use super::trend::Trend;
use crate::files::Amount;
use crate::info::json::LogJson;
use crate::series::{GridJson, SeriesJson};
use crate::summary::Overview;

const TEMPLATE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/page.css");
/// uPlot 1.6.32, MIT (`src/assets/uPlot.LICENSE`).
const UPLOT: &str = include_str!("../assets/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("../assets/uPlot.min.css");

/// What the page's program draws.
#[derive(Serialize)]
struct Data<'a> {
    version: &'static str,
    log: LogJson,
    epoch_us: Option<u64>,
    grid: GridJson,
    plots: Vec<PlotJson>,
    flights: &'a [Flight],
    phases: &'a [PhaseSpan],
    track: Vec<Point>,
    texts: &'a [Said],
    texts_count: u64,
    stats: Option<StatsJson>,
    trend: &'a Trend,
}

#[derive(Serialize)]
struct PlotJson {
    id: String,
    group: &'static str,
    title: String,
    unit: &'static str,
    decimals: u8,
    /// Counts that only rise: drawn as steps.
    stepped: bool,
    series: Vec<SeriesJson>,
}

#[derive(Serialize)]
struct StatsJson {
    frames_in: u64,
    frames_logged: u64,
    frames_lost: u64,
    bytes_in: u64,
    bytes_not_frames: u64,
    queue_bytes_max: u64,
    queue_bytes_capacity: u64,
    sd_stall_ms_max: u64,
    gs_frames: u64,
    gs_bytes: u64,
    gs_frames_lost: u64,
    autopilot_frames_lost: u64,
    passed_frames_lost: u64,
    requests_refused: u64,
}

impl From<&Stats> for StatsJson {
    fn from(stats: &Stats) -> Self {
        Self {
            frames_in: stats.frames_in,
            frames_logged: stats.frames_logged,
            frames_lost: stats.frames_lost,
            bytes_in: stats.bytes_in,
            bytes_not_frames: stats.bytes_not_frames,
            queue_bytes_max: stats.queue_bytes_max,
            queue_bytes_capacity: stats.queue_bytes_capacity,
            sd_stall_ms_max: stats.sd_stall_ms_max,
            gs_frames: stats.gs_frames,
            gs_bytes: stats.gs_bytes,
            gs_frames_lost: stats.gs_frames_lost,
            autopilot_frames_lost: stats.autopilot_frames_lost,
            passed_frames_lost: stats.passed_frames_lost,
            requests_refused: stats.requests_refused,
        }
    }
}

/// A session's page; `of` is what its name ends with: `s1a2b3c4d`. `amount` is what of its log is on it.
pub fn html(
    log: &Overview,
    replay: &Replay,
    trend: &Trend,
    of: Option<&str>,
    amount: Amount,
) -> Result<String> {
    let data = Data {
        version: env!("CARGO_PKG_VERSION"),
        log: LogJson::new(log),
        epoch_us: log.contents.epoch_us,
        grid: replay.samples.store.grid(),
        plots: plots(replay),
        flights: &replay.flights,
        phases: replay.phases.all(),
        track: replay.track(),
        texts: &replay.texts,
        texts_count: replay.texts_count,
        stats: log.contents.stats.as_ref().map(StatsJson::from),
        trend,
    };
    let program = program();
    let programs = [UPLOT, program.as_str()];
    // Only these two programs may run, whatever else may ever get onto the page.
    let hashes: Vec<String> = programs
        .iter()
        .map(|program| format!("'sha256-{}'", BASE64.encode(Sha256::digest(program))))
        .collect();
    let mut page = TEMPLATE.to_owned();
    for (mark, text) in [
        ("{{scripts}}", hashes.join(" ").as_str()),
        ("{{log}}", of.unwrap_or("unknown")),
        ("{{amount}}", amount.to_string().as_str()),
        ("{{style}}", [UPLOT_STYLE, STYLE].concat().as_str()),
        ("{{uplot}}", UPLOT),
        ("{{program}}", program.as_str()),
        // Last, so that nothing in it is taken for a mark.
        ("{{data}}", harmless(&serde_json::to_string(&data)?).as_str()),
    ] {
        page = page.replacen(mark, text, 1);
    }
    Ok(page)
}

/// JSON that ends no script element and begins none: `<`, `>` and `&` stand in strings only, where an escape is the
/// same; the two line separators are no JavaScript.
fn harmless(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        match c {
            // Writing to a `String` cannot fail.
            '<' | '>' | '&' | '\u{2028}' | '\u{2029}' => drop(write!(out, "\\u{:04x}", c as u32)),
            _ => out.push(c),
        }
    }
    out
}

fn plots(replay: &Replay) -> Vec<PlotJson> {
    let json = |(plot, group, title, unit, decimals, label): About| PlotJson {
        id: format!("{plot:?}"),
        group,
        title: title.to_owned(),
        unit,
        decimals,
        stepped: matches!(plot, Plot::Clips | Plot::EscErrors | Plot::Satellites),
        series: replay.samples.store.plot(plot, decimals, label),
    };
    about(replay.autopilot).into_iter().map(json).filter(|plot| !plot.series.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use hums_core::observation::Autopilot;

    use super::*;

    #[test]
    fn data_ends_no_element() {
        let hostile = "</script><script>alert(1)</script><!-- & \u{2028}";
        let json = serde_json::to_string(hostile).expect("JSON");
        let inside = harmless(&json);
        assert!(!inside.contains(['<', '>', '&', '\u{2028}']), "{inside}");
        assert_eq!(serde_json::from_str::<String>(&inside).expect("JSON"), hostile);
    }

    #[test]
    fn each_mark_of_the_template_stands_once() {
        let program = program();
        for mark in
            ["{{scripts}}", "{{log}}", "{{amount}}", "{{style}}", "{{uplot}}", "{{program}}", "{{data}}"]
        {
            assert_eq!(TEMPLATE.matches(mark).count(), 1, "{mark}");
            assert!(!UPLOT.contains(mark) && !program.contains(mark) && !STYLE.contains(mark), "{mark}");
        }
        for text in [UPLOT, program.as_str()] {
            assert!(!text.contains("</script"), "a program would end early");
        }
    }

    #[test]
    fn every_plot_has_its_place() {
        let about = about(Autopilot::Px4);
        assert!(about.windows(2).all(|pair| pair[0].0 < pair[1].0), "in order and none twice");
        assert_eq!(about.len(), Plot::Load as usize + 1);
    }
}
