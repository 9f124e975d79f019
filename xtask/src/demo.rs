//! A recorded flight through the whole system, and its results.

use std::fs;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::firmware;
use crate::hums;
use crate::repo;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// A quadcopter's flight with faults that the monitor finds: vibration, satellites lost, GPS jammed, a battery that sags.
const FLIGHT: &str = "tests/flights/ap_quad_faults.tlog";

/// `hums` did all it could, and there are losses to report.
const DONE_WITH_LOSSES: i32 = 3;

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Options {
    flight: PathBuf,
    /// On this PC, without the firmware.
    pc: bool,
    /// At the end, until Ctrl-C.
    dashboard: bool,
}

impl Options {
    pub(crate) fn parse(words: &[&str]) -> Result<Self> {
        let dashboard = std::io::stdout().is_terminal();
        let mut options = Self { flight: repo::root().join(FLIGHT), pc: false, dashboard };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match *word {
                "--pc" => options.pc = true,
                "--no-dashboard" => options.dashboard = false,
                "--flight" => {
                    let Some(flight) = words.next() else {
                        bail!("--flight wants a tlog or a raw recording")
                    };
                    // As typed in the user's folder: the commands themselves run at the root.
                    options.flight = std::path::absolute(flight)?;
                }
                other => bail!("demo takes --flight FILE, --pc and --no-dashboard, not {other}"),
            }
        }
        Ok(options)
    }
}

/// In CI the demo must run the firmware, and end. Program and firmware are there already. The shortest recording: the demo's own flight
/// is what the step `chip` flies, by the same program and image, and compares frame by frame.
pub(crate) fn as_test() -> Result<()> {
    const SHORT: &str = "tests/flights/px4_hil_quad_low.tlog";
    let flight = repo::root().join(SHORT);
    let options = Options { flight, pc: false, dashboard: false };
    fly(&options, Some(&firmware::image_of(firmware::default_board())), Duration::ZERO)
}

pub(crate) fn run(options: &Options) -> Result<()> {
    let start = Instant::now();
    let outcome = setup::ensure(&[Need::Linker, Need::FirmwareTarget], false);
    let flashed = !options.pc && outcome.has(Need::FirmwareTarget);
    if !flashed && !options.pc {
        eprintln!("\nNo firmware here (what to type is above): the same pipeline runs on this PC instead.\n");
    }
    let program = || hums::build().map(drop);
    let image = if flashed {
        firmware::build_beside([firmware::default_board()], program)?;
        Some(firmware::image_of(firmware::default_board()))
    } else {
        program()?;
        None
    };
    fly(options, image.as_deref(), start.elapsed())
}

/// Records the flight with the firmware in `image`, or on this PC without one, and shows the results.
fn fly(options: &Options, image: Option<&Path>, built: Duration) -> Result<()> {
    let folder = repo::target().join("demo");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;

    let (card, gs, figures) = (folder.join("card.img"), folder.join("gs.bin"), folder.join("run.json"));
    let pipeline = match image {
        Some(image) => Shell::new(hums::program()).arg("sim").arg("--firmware").arg(image),
        None => Shell::new(hums::program()).arg("sim"),
    };
    let recording = Instant::now();
    let json = record(pipeline, &options.flight, &card, &gs)?;
    fs::write(&figures, &json)?;
    let recorded = recording.elapsed();
    let decoded = folder.join("decoded");
    decode(&card, &decoded)?;

    println!();
    Shell::new(hums::program()).arg("info").arg(&card).run()?;
    let run: serde_json::Value = serde_json::from_str(&json).context("what hums --json printed")?;
    show_figures(&run);
    println!("{:<30} {}", "the flight", repo::shown(&options.flight));
    let by = if image.is_some() {
        "the image that is flashed, on a model of its chip"
    } else {
        "this PC, with the firmware's pipeline"
    };
    println!("{:<30} {by}", "recorded by");
    for (label, path) in [
        ("the SD card's image", &card),
        ("the decoded log", &decoded),
        ("what the ground station got", &gs),
        ("all figures of the run", &figures),
    ] {
        println!("{label:<30} {}", repo::shown(path));
    }
    let (built, recorded) = (built.as_secs(), recorded.as_secs());
    println!("{:<30} {built} s to build, {recorded} s to record", "it took");
    if run.get("frames_lost").and_then(serde_json::Value::as_u64) != Some(0) {
        bail!("frames were lost");
    }
    if options.dashboard {
        println!("{:<30} until Ctrl-C, at", "the dashboard plays it");
        return Shell::new(hums::program())
            .args(["live", "--listen", "127.0.0.1:0", "--input"])
            .arg(card)
            .run();
    }
    let program = repo::shown(&hums::program());
    println!("{:<30} {program} live --open --input {}", "the dashboard", repo::shown(&card));
    Ok(())
}

fn show_figures(run: &serde_json::Value) {
    println!();
    for (label, key) in [
        ("frames in", "frames_in"),
        ("frames logged", "frames_logged"),
        ("frames lost", "frames_lost"),
        ("bytes in", "bytes_in"),
        ("bytes logged", "bytes_logged"),
        ("frames to the ground station", "gs_frames"),
    ] {
        println!("{label:<30} {:>10}", run.get(key).map_or_else(|| "?".to_owned(), ToString::to_string));
    }
    println!();
}

/// Runs the flight through a pipeline; returns its figures.
fn record(pipeline: Shell, flight: &Path, card: &Path, gs: &Path) -> Result<String> {
    let (json, code) = pipeline
        .args(["--json".as_ref(), "--input".as_ref(), flight.as_os_str()])
        .args(["--sd".as_ref(), card.as_os_str(), "--gs".as_ref(), gs.as_os_str()])
        .output_and_code()?;
    if code != 0 && code != DONE_WITH_LOSSES {
        bail!("the recording failed with exit code {code}");
    }
    Ok(json)
}

fn decode(card: &Path, to: &Path) -> Result<()> {
    Shell::new(hums::program()).arg("decode").arg(card).arg("-o").arg(to).args(["--format", "tlog,csv"]).run()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flight_of_the_demo_is_in_the_repository() {
        assert!(Options::parse(&[]).unwrap().flight.is_file());
    }

    #[test]
    fn a_flight_is_named_from_where_the_user_is() {
        let options = Options::parse(&["--flight", "mine.tlog", "--pc"]).unwrap();
        assert_eq!(options.flight, std::env::current_dir().unwrap().join("mine.tlog"));
        assert!(options.pc);
    }
}
