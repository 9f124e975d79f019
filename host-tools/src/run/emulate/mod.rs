//! `hums sim --firmware`: the image that is flashed, on the model of its chip (`docs/chip.md`).

mod board;

use std::collections::VecDeque;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use board::EmulatedBoard;
use hums_sdcard::Medium;
use stm32f405_model::image::Image;

use super::report::{CardLogs, RunReport};
use super::{Prepared, check_request, check_standard_output, check_store, drive, finish, prepare};
use crate::card::image::is_card;
use crate::cli;
use crate::files::read_short;
use crate::outcome::Outcome;
use crate::plural::count;

/// A release's ELF file with symbols has 8 MB.
const IMAGE_FILE_BYTES_MAX: u64 = 32 << 20;

pub(super) fn run(run: &cli::Sim, firmware: &Path) -> Result<Outcome> {
    check_standard_output(run)?;
    let request = check_request(run)?;
    let (wired, image) = image(firmware)?;
    let Prepared { speed, live, mut arrivals, card, flash, earlier, mut ground, gs, entropy } =
        prepare(run, &request, u64::MAX)?;
    flash.prepare()?;
    let mut reboots = VecDeque::from(run.faults.reboot_at_us.clone());
    reboots.make_contiguous().sort_unstable();
    let unread = || format!("{}: cannot be read", run.sd.display());
    let (is_card, medium) = (is_card(&card).with_context(unread)?, Medium::load(&card).with_context(unread)?);
    let table = medium.get(0);
    let mut board = EmulatedBoard::new(
        (wired, image),
        entropy,
        &medium,
        &flash.bytes(),
        (gs, arrivals.take_autopilot()),
        reboots,
    );
    let flown = drive(&mut arrivals, &mut ground, speed, live, Instant::now(), &mut board)
        .and_then(|_| board.settle());
    if is_card && medium.get(0) != table {
        bail!(
            "{}: was formatted by a command in this run; the file stays as it was before",
            run.sd.display()
        );
    }
    // Also after an early end.
    medium.save(&card).with_context(|| format!("{}: cannot be written", run.sd.display()))?;
    flash.set(board.store());
    check_store(run, &flash)?;
    flown?;
    if let Some((times, first_s)) = board.resets() {
        note!("the board reset itself {}, first at {first_s:.3} s", count(times, "time"));
    }
    let mut report = RunReport::default();
    let (frames, on_card) = report.read_card(&run.sd, &earlier)?;
    tell(&mut report, &board, frames, &on_card);
    report.blocks_written = medium.writes();
    if run.costs {
        report.cycles = Some(board.stage_cycles().context("--costs needs an ELF file of this version's")?);
        report.stack_by_urgency = Some(board.stack_by_urgency());
        report.busy_percent_max = Some(board.busy_percent_max());
    }
    finish(run, &arrivals, &ground, &report)
}

fn tell(report: &mut RunReport, board: &EmulatedBoard, frames: u64, on_card: &CardLogs) {
    let (came, went) = board.traffic();
    report.frames_in = came.frames;
    report.frames_logged = frames.min(came.frames);
    report.frames_lost = report.frames_in - report.frames_logged;
    report.bytes_in = came.bytes;
    report.bytes_not_frames = came.bytes_not_frames;
    report.gs_frames = went.frames;
    report.gs_bytes = went.bytes;
    report.bytes_logged = on_card.bytes;
    if let Some(stats) = &on_card.stats {
        report.queue_bytes_max = stats.queue_bytes_max;
        report.queue_bytes_capacity = stats.queue_bytes_capacity;
        report.sd_stall_ms_max = stats.sd_stall_ms_max;
        report.stack_bytes_max = Some(stats.stack_bytes_max);
        report.stack_bytes = Some(stats.stack_bytes_capacity);
    }
}

fn image(path: &Path) -> Result<(&'static hums_boards::Board, Image)> {
    let file = read_short(path, IMAGE_FILE_BYTES_MAX)?;
    let image = Image::parse(&file)
        .map_err(|why| anyhow!("{}: is no firmware image of the STM32F405: {why}", path.display()))?;
    let name = image.pieces.iter().find_map(|(_, bytes)| hums_boards::name_in(bytes));
    let name = name.with_context(|| format!("{}: does not name its board", path.display()))?;
    let board = hums_boards::find(name).map_err(|why| anyhow!("{}: {why}", path.display()))?;
    Ok((board, image))
}
