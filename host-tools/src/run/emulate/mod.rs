//! `hums emulate`: the firmware image of the emulated board, in QEMU.

mod board;

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use board::{Board, Earlier, Fixed};
use serde::Deserialize;

use super::earlier::EarlierSessions;
use super::qemu;
use super::report::Report;
use super::{
    arrivals::Arrivals, check_standard_output, drive, ground, pace, params, paths, prepare_card, salt, store,
};
use crate::cli;
use crate::endpoint::Endpoint;
use crate::outcome::{Outcome, usage};

/// The environment variable that names the image as `--firmware` does.
const FIRMWARE_VARIABLE: &str = "HUMS_FIRMWARE";
/// Where a build in the source tree leaves the image.
const IMAGES: [&str; 2] =
    ["target/firmware/hums-emulated.elf", "target/thumbv7em-none-eabihf/firmware/hums-firmware"];

/// Runs `hums emulate`.
pub fn run(args: &cli::Emulate) -> Result<Outcome> {
    let run = &args.run;
    check_flags(run)?;
    check_standard_output(run)?;
    let (speed, live) = pace(run)?;
    let inputs = paths::inputs(run, None, args.firmware.as_deref())?;
    qemu::check()?;
    let firmware = firmware(args.firmware.as_deref())?;
    let params = params::read(run.params.as_deref())?;
    let dir = tempfile::Builder::new().prefix("hums-").tempdir().context("no temporary directory")?;
    // The board's flash is a file in any case; without --store it ends with the run.
    let store = run.store.clone().unwrap_or_else(|| dir.path().join("store"));
    // Open, so that no other run uses them.
    let (mut arrivals, _in_use) = Arrivals::open(run, None, || {
        run.store.as_deref().map_or(Ok(()), store::check)?;
        let card = prepare_card(&run.sd, run.faults.card_size, run.faults.seed)?;
        Ok((card, store::open(Some(&store), &params)?))
    })?;
    let earlier = EarlierSessions::of(run, &params)?;
    let mut reboots = VecDeque::from(run.faults.reboot_at_us.clone());
    reboots.make_contiguous().sort_unstable();
    let (mut ground, gs) = ground::open(run, &inputs)?;
    let entropy = salt::salt(run, &mut arrivals)?;
    let mut board = Board::start(Fixed {
        entropy,
        firmware,
        card: run.sd.clone(),
        store,
        gs: Arc::new(Mutex::new(gs)),
        autopilot: Arc::new(Mutex::new(arrivals.take_autopilot())),
        costs: args.costs,
        provoke: args.provoke.clone(),
        reboots,
    })?;
    drive(&mut arrivals, &mut ground, speed, live, Instant::now(), &mut board)?;
    let (json, before) = board.finish()?;
    ground.finish()?;
    if let Some(remark) = arrivals.remark() {
        note!("{remark}");
    }
    let counters: Counters = serde_json::from_str(&json)
        .with_context(|| format!("the firmware's counters are not understood: {json}"))?;
    let mut report = counters.into_report();
    let frames = report.read_card(&run.sd, &earlier)?;
    before.add_to(&mut report, frames);
    if let Some(remark) = report.remark(&run.input) {
        note!("{remark}");
    }
    report.print(run.json, run.gs == Some(Endpoint::Standard))
}

impl Earlier {
    /// What came in before the last start, and what of it is on the card, which alone knows that.
    fn add_to(&self, report: &mut Report, frames_on_card: u64) {
        if self.starts == 0 {
            return;
        }
        report.frames_in += self.frames_in;
        report.bytes_in += self.bytes_in;
        report.bytes_not_frames += self.bytes_not_frames;
        report.blocks_written += self.blocks_written;
        report.frames_logged = frames_on_card.min(report.frames_in);
        report.frames_lost = report.frames_in - report.frames_logged;
    }
}

/// Faults of the card are the simulated card's: the emulated board writes to the image file itself.
fn check_flags(run: &cli::Run) -> Result<()> {
    let faults = &run.faults;
    let given = [
        ("--cut-after-writes", !faults.cut_after_writes.is_empty()),
        ("--cut-store-after", faults.cut_store_after.is_some()),
        ("--stall", !faults.stall.is_empty()),
        ("--card-out", !faults.card_out.is_empty()),
        ("--write-error", faults.write_error.is_some()),
    ];
    for (flag, given) in given {
        if given {
            return Err(usage(format!(
                "{flag} works with hums sim only: the emulated board writes to the image file itself"
            )));
        }
    }
    Ok(())
}

/// The image: as named, as built, or built now.
pub(crate) fn firmware(named: Option<&Path>) -> Result<PathBuf> {
    let variable = std::env::var_os(FIRMWARE_VARIABLE).map(PathBuf::from);
    if let Some(path) = named.map(Path::to_owned).or(variable) {
        if !path.is_file() {
            bail!(
                "{}: there is no such firmware image; `cargo xtask firmware --board emulated` builds one",
                path.display()
            );
        }
        if !is_arm_elf(&path) {
            bail!("{}: is no firmware image (an ELF file for ARM)", path.display());
        }
        return Ok(std::path::absolute(path)?);
    }
    let Some(tree) = source_tree() else {
        bail!(
            "no firmware image: this is not inside the source tree of hums. There, type\n  \
             cargo xtask firmware --board emulated\nand name what it prints here with --firmware"
        );
    };
    if let Some(image) = IMAGES.iter().map(|image| tree.join(image)).find(|image| image.is_file()) {
        return Ok(image);
    }
    build(&tree)
}

fn is_arm_elf(path: &Path) -> bool {
    let mut head = [0; 20];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    // Magic, and the machine's number at offset 18: 40 is ARM.
    read.is_ok() && head.starts_with(b"\x7fELF") && head.ends_with(&[40, 0])
}

fn build(tree: &Path) -> Result<PathBuf> {
    note!("no firmware image yet: building it (cargo xtask firmware --board emulated)");
    let output = Command::new("cargo")
        .args(["xtask", "firmware", "--board", "emulated"])
        .current_dir(tree)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .context("cargo cannot be started")?;
    let printed = String::from_utf8_lossy(&output.stdout);
    let image = printed.lines().last().map(PathBuf::from).filter(|image| image.is_file());
    match image {
        Some(image) if output.status.success() => Ok(image),
        _ => bail!("the firmware was not built; see what `cargo xtask firmware --board emulated` says above"),
    }
}

/// The source tree around the working directory or around this program.
pub fn source_tree() -> Option<PathBuf> {
    let here = std::env::current_dir().ok();
    let program = std::env::current_exe().ok();
    let starts = here.iter().chain(&program);
    let is_tree =
        |dir: &&Path| dir.join("firmware/app/Cargo.toml").is_file() && dir.join("xtask/Cargo.toml").is_file();
    starts.flat_map(|start| start.ancestors()).find(is_tree).map(Path::to_owned)
}

/// What the firmware prints at its end. What it does not know is zero.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Counters {
    frames_in: u64,
    frames_logged: u64,
    frames_lost: u64,
    bytes_in: u64,
    bytes_not_frames: u64,
    bytes_logged: u64,
    blocks_written: u64,
    queue_bytes_max: u64,
    queue_bytes_capacity: u64,
    sd_stall_ms_max: u64,
    gs_frames: u64,
    gs_bytes: u64,
    stack_bytes_max: Option<u64>,
    stack_bytes: Option<u64>,
    stack_by_urgency: Option<serde_json::Value>,
    instructions: Option<serde_json::Value>,
}

impl Counters {
    fn into_report(self) -> Report {
        Report {
            frames_in: self.frames_in,
            frames_logged: self.frames_logged,
            frames_lost: self.frames_lost,
            bytes_in: self.bytes_in,
            bytes_not_frames: self.bytes_not_frames,
            bytes_logged: self.bytes_logged,
            blocks_written: self.blocks_written,
            queue_bytes_max: self.queue_bytes_max,
            queue_bytes_capacity: self.queue_bytes_capacity,
            sd_stall_ms_max: self.sd_stall_ms_max,
            gs_frames: self.gs_frames,
            gs_bytes: self.gs_bytes,
            stack_bytes_max: self.stack_bytes_max,
            stack_bytes: self.stack_bytes,
            stack_by_urgency: self.stack_by_urgency,
            instructions: self.instructions,
            ..Report::default()
        }
    }
}
