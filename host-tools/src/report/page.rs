//! The page: one HTML file with its style, its program and its data inside.

use std::fmt::Write as _;

use anyhow::Result;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use hums_blackbox::record::Stats;
use hums_core::observation::Autopilot;
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use super::replay::{Flight, PhaseSpan, Plot, Replay, Text, TrackPoint};
use super::series::{GridJson, SeriesJson};
use super::trend::Trend;
use crate::info::json::LogJson;
use crate::summary::Overview;

const TEMPLATE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/page.css");
const PROGRAM: &str = include_str!("assets/page.js");
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
    track: &'a [TrackPoint],
    texts: &'a [Text],
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
        }
    }
}

/// A session's page.
pub fn html(log: &Overview, replay: &Replay, trend: &Trend) -> Result<String> {
    let data = Data {
        version: env!("CARGO_PKG_VERSION"),
        log: LogJson::new(log),
        epoch_us: log.contents.epoch_us,
        grid: replay.store.grid(),
        plots: plots(replay),
        flights: &replay.flights,
        phases: &replay.phases,
        track: &replay.track,
        texts: &replay.texts,
        texts_count: replay.texts_count,
        stats: log.contents.stats.as_ref().map(StatsJson::from),
        trend,
    };
    let programs = [UPLOT, PROGRAM];
    // Only these two programs may run, whatever else may ever get onto the page.
    let hashes: Vec<String> = programs
        .iter()
        .map(|program| format!("'sha256-{}'", BASE64.encode(Sha256::digest(program))))
        .collect();
    let mut page = TEMPLATE.to_owned();
    for (mark, text) in [
        ("{{scripts}}", hashes.join(" ").as_str()),
        ("{{style}}", [UPLOT_STYLE, STYLE].concat().as_str()),
        ("{{uplot}}", UPLOT),
        ("{{program}}", PROGRAM),
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

/// Group, title, unit, decimals and the lines' names of a plot.
type About = (Plot, &'static str, &'static str, &'static str, u8, fn(u8) -> String);

fn named(names: &[&str], line: u8) -> String {
    names.get(usize::from(line)).map_or_else(|| format!("{}", line + 1), |name| (*name).to_owned())
}

/// The plots, in the order of the page.
fn about(autopilot: Autopilot) -> Vec<About> {
    let motor = |line: u8| format!("Motor {}", line + 1);
    let battery = |line: u8| if line == 0 { "Battery".into() } else { format!("Battery {}", line + 1) };
    let px4 = autopilot == Autopilot::Px4;
    let axes: fn(u8) -> String = if px4 {
        |line| named(&["Coning", "Gyro, high frequency", "Accelerometer, high frequency"], line)
    } else {
        |line| named(&["Forward", "Right", "Down"], line)
    };
    let (vibration, estimator) = if px4 { ("PX4 metrics", "test ratio") } else { ("m/s\u{b2}", "variance") };
    vec![
        (Plot::Height, "Motion", "Height above home", "m", 2, |_| "Height".into()),
        (Plot::Speed, "Motion", "Speed", "m/s", 2, |line| named(&["Ground", "Air", "GNSS"], line)),
        (Plot::Vertical, "Motion", "Climb rate", "m/s", 2, |_| "Climb".into()),
        (Plot::Attitude, "Motion", "Attitude", "\u{b0}", 1, |line| named(&["Roll", "Pitch"], line)),
        (Plot::PackVolts, "Battery", "Voltage", "V", 3, battery),
        (Plot::CellVolts, "Battery", "Cells", "V", 3, |line| format!("Cell {}", line + 1)),
        (Plot::PackAmperes, "Battery", "Current", "A", 2, battery),
        (Plot::PackPercent, "Battery", "Remaining", "%", 0, battery),
        (Plot::MotorRpm, "Motors", "Speed", "rpm", 0, motor),
        (Plot::MotorAmperes, "Motors", "Current", "A", 2, motor),
        (Plot::MotorVolts, "Motors", "Voltage", "V", 2, motor),
        (Plot::MotorCelsius, "Motors", "ESC temperature", "\u{b0}C", 1, motor),
        (Plot::EscErrors, "Motors", "ESC errors", "count", 0, motor),
        (Plot::SpeedSensors, "Motors", "Speed sensors", "rpm", 0, |line| format!("Sensor {}", line + 1)),
        (Plot::Engine, "Motors", "Engine", "", 1, |line| {
            named(&["Speed (rpm)", "Load (%)", "Fuel flow", "Cylinder head (\u{b0}C)"], line)
        }),
        (Plot::Vibration, "Structure", "Vibration", vibration, 3, axes),
        (Plot::Clips, "Structure", "Clipped samples", "count", 0, |line| {
            format!("Accelerometer {}", line + 1)
        }),
        (Plot::Estimator, "Navigation", "Estimator", estimator, 3, |line| {
            named(&["Velocity", "Horizontal position", "Vertical position", "Compass"], line)
        }),
        (Plot::Satellites, "Navigation", "Satellites and fix", "", 0, |line| {
            named(&["Satellites", "Fix type", "Satellites, 2nd receiver", "Fix type, 2nd receiver"], line)
        }),
        (Plot::Dilution, "Navigation", "GNSS accuracy", "", 2, |line| {
            named(&["HDOP", "Horizontal accuracy (m)", "HDOP, 2nd", "Accuracy, 2nd (m)"], line)
        }),
        (Plot::Link, "Link", "Signal strength", "device units", 0, |line| {
            named(&["RC", "Radio", "Radio, far end", "Noise", "Noise, far end"], line)
        }),
        (Plot::Frames, "Link", "Frames", "per second", 0, |line| {
            named(&["Received", "Missing by the sender's count"], line)
        }),
        (Plot::Temperature, "Computer", "Temperatures", "\u{b0}C", 1, |line| {
            named(
                &[
                    "Air",
                    "Inertial sensor",
                    "Processor",
                    "",
                    "Battery",
                    "Battery 2",
                    "Battery 3",
                    "Battery 4",
                ],
                line,
            )
        }),
        (Plot::Load, "Computer", "Autopilot load", "%", 1, |_| "Load".into()),
    ]
}

fn plots(replay: &Replay) -> Vec<PlotJson> {
    let json = |(plot, group, title, unit, decimals, label): About| PlotJson {
        id: format!("{plot:?}"),
        group,
        title: title.to_owned(),
        unit,
        decimals,
        stepped: matches!(plot, Plot::Clips | Plot::EscErrors | Plot::Satellites),
        series: replay.store.plot(plot, decimals, label),
    };
    about(replay.autopilot).into_iter().map(json).filter(|plot| !plot.series.is_empty()).collect()
}

#[cfg(test)]
mod tests {
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
        for mark in ["{{scripts}}", "{{style}}", "{{uplot}}", "{{program}}", "{{data}}"] {
            assert_eq!(TEMPLATE.matches(mark).count(), 1, "{mark}");
            assert!(!UPLOT.contains(mark) && !PROGRAM.contains(mark) && !STYLE.contains(mark), "{mark}");
        }
        for text in [UPLOT, PROGRAM] {
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
