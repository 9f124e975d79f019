//! A flight through the whole system.

use std::ffi::OsStr;
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

/// Vibration, lost satellites, jammed GPS, a sagging battery.
const FLIGHT: &str = "tests/flights/ap_quad_faults.tlog";

/// Lines of the verdict: with the demo's other output 25 lines.
const VERDICT_LINES_MAX: usize = 12;

const DONE_WITH_LOSSES: i32 = 3;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// A tlog or a raw recording; without it one with faults
    #[arg(long, value_name = "FILE")]
    flight: Option<PathBuf>,
    /// On this PC, without the firmware
    #[arg(long)]
    pc: bool,
    /// Not the live page, which plays the flight on a terminal until Ctrl-C
    #[arg(long)]
    no_dashboard: bool,
}

impl Options {
    /// The path as typed in the user's folder; commands run at the root.
    fn flight(&self) -> Result<PathBuf> {
        let own = || Ok(repo::root().join(FLIGHT));
        self.flight.as_ref().map_or_else(own, |path| Ok(std::path::absolute(path)?))
    }
}

/// In CI it must run the firmware, and end. The shortest recording's beginning is enough: the step `chip` flies the demo's
/// flight.
pub(crate) fn as_test() -> Result<()> {
    const SHORT: &str = "tests/flights/px4_hil_quad_low.tlog";
    const BYTES: usize = 120_000;
    let beginning = fs::read(repo::root().join(SHORT))?.into_iter().take(BYTES).collect::<Vec<u8>>();
    let flight = repo::target().join("beginning.tlog");
    fs::write(&flight, beginning)?;
    let options = Options { flight: Some(flight), pc: false, no_dashboard: true };
    fly(&options, Some(&firmware::image_of(firmware::default_board())), Duration::ZERO)
}

pub(crate) fn run(options: &Options) -> Result<()> {
    eprintln!("building hums and the firmware: some minutes the first time");
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

fn fly(options: &Options, image: Option<&Path>, built: Duration) -> Result<()> {
    let folder = repo::target().join("demo");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;

    let (card, page) = (folder.join("card.img"), folder.join("report.html"));
    let hums = || Shell::new(hums::program());
    let firmware = image.into_iter().flat_map(|image| [OsStr::new("--firmware"), image.as_os_str()]);
    let recording = Instant::now();
    let flight = options.flight()?;
    let sim = hums().args(["sim", "--json"]).args(firmware).arg(&flight).arg("--sd").arg(&card);
    let json = done(sim).context("hums sim failed; its messages are above")?;
    let recorded = recording.elapsed();
    done(hums().args(["report", "-o"]).arg(&page).arg(&card)).context("the report cannot be made")?;
    let (verdict, _) = hums().arg("check").arg(&card).output_and_code()?;

    println!("\n$ hums check {}", repo::shown(&card));
    shortened(&verdict).for_each(|line| println!("{line}"));
    let run: serde_json::Value =
        serde_json::from_str(&json).context("the output of hums --json is not JSON")?;
    let figure = |key: &str| run.get(key).map_or_else(|| "?".to_owned(), ToString::to_string);
    let by = if image.is_some() {
        "the firmware's image on a model of its chip"
    } else {
        "the firmware's pipeline on this PC"
    };
    let (built, recorded) = (built.as_secs(), recorded.as_secs());
    println!(
        "\nrecorded by  {by}: {} frames in, {} logged, {} lost",
        figure("frames_in"),
        figure("frames_logged"),
        figure("frames_lost")
    );
    println!("the flight   {}", repo::shown(&flight));
    println!("it took      {built} s to build, {recorded} s to record");
    println!("the report   {}", repo::shown(&page));
    println!("the card     {}", repo::shown(&card));
    if run.get("frames_lost").and_then(serde_json::Value::as_u64) != Some(0) {
        bail!("the simulated box lost frames; the report above has the times");
    }
    let program = repo::shown(&hums::program());
    println!("try next     {program} YOUR_LOG");
    println!("             {program} live --open {}", repo::shown(&card));
    if !options.no_dashboard && std::io::stdout().is_terminal() {
        println!("it plays     until Ctrl-C, at");
        return hums().args(["live", "--listen", "127.0.0.1:0"]).arg(card).run();
    }
    Ok(())
}

/// Verdict, vehicle, worst finding: two paragraphs.
fn shortened(verdict: &str) -> impl Iterator<Item = &str> {
    verdict.split("\n\n").take(2).flat_map(str::lines).take(VERDICT_LINES_MAX)
}

/// Losses, or an end in the air, are no failure.
fn done(command: Shell) -> Result<String> {
    match command.output_and_code()? {
        (text, 0 | DONE_WITH_LOSSES) => Ok(text),
        (_, code) => bail!("hums ended with exit code {code}; its messages are above"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flight_is_one_of_the_repository_or_named_from_where_the_user_is() {
        let flight = |flight: Option<&str>| {
            Options { flight: flight.map(PathBuf::from), pc: false, no_dashboard: true }.flight().unwrap()
        };
        assert!(flight(None).is_file());
        assert_eq!(flight(Some("mine.tlog")), std::env::current_dir().unwrap().join("mine.tlog"));
    }
}
