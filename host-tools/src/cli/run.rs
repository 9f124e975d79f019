//! `hums sim`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::card::faults::{self, CardOut, Cut, Stall};
use crate::endpoint::Endpoint;
use crate::utc::parse_seconds;

const SIM_EXAMPLES: &str = "Examples:
  hums sim flight.tlog --sd card.img --gs gs.bin
  hums sim flight.tlog --sd card.img --json --line-rate 921600
  hums sim udpin:0.0.0.0:14550 --sd card.img --gs udpout:127.0.0.1:14551
  hums sim flight.tlog --sd card.img --gs udpin:127.0.0.1:14551 --speed real
  hums sim flight.tlog --sd card.img --stall 2500@60 --noise 0.001 --seed 7
  hums sim flight.tlog --sd card.img --cut-after-writes 1000:torn
  hums sim flight.tlog --sd card.img --store store.bin --params hums.param
  hums sim flight.tlog --sd card.img --firmware hums-olimex-stm32-h405.elf

Raw bytes carry no times: they come as on a line at 115,200 baud. A file without a MAVLink frame is refused before anything
is written. The image of --sd is kept: a second run adds a session to it; a file that is no card is refused. Where --gs or --tap fails the recording goes on (exit code 3).
A file of --gs or --tap must be new, or empty.
With --firmware a second of flight takes some 0.15 s; `cargo xtask firmware` builds an image and prints its path.";

/// `hums sim`
#[derive(Args, Clone, Debug)]
#[command(after_help = SIM_EXAMPLES)]
pub struct Sim {
    /// Where the autopilot's bytes come from: a file (tlog or raw MAVLink, also as .gz), `-`, udpin:, udpout:, tcp: or serial:
    #[arg(value_name = "SRC")]
    pub input: Endpoint,
    /// The SD card image (MBR + FAT32); a missing one is made, of 256 MiB and sparse
    #[arg(long, value_name = "IMAGE")]
    pub sd: PathBuf,
    /// Output for the ground station; a UDP, TCP or serial link also receives its messages
    #[arg(long, value_name = "SINK")]
    pub gs: Option<Endpoint>,
    /// A recording of the ground station's messages, each sent at its time
    #[arg(long, value_name = "SRC")]
    pub gs_input: Option<Endpoint>,
    /// File of the flash with counters and parameters (32 KiB; made when missing); without it all begin at zero
    #[arg(long, value_name = "FILE")]
    pub store: Option<PathBuf>,
    /// Set these parameters before the start: `NAME VALUE` or `NAME,VALUE` lines, or a QGroundControl file
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Speed of time: `max` on a virtual clock (repeatable), or real time; live inputs are always real
    #[arg(long, value_enum)]
    pub speed: Option<Speed>,
    /// Overwrite the oldest sessions if the card is full, as on a vehicle
    #[arg(long)]
    pub overwrite_oldest: bool,
    /// Also write the bytes of the UART, with their noise, to this file
    #[arg(long, value_name = "FILE")]
    pub tap: Option<PathBuf>,
    /// Run this firmware image (ELF, DFU or raw) on a model of its board's chip, instead of the pipeline on this PC
    #[arg(long, value_name = "IMAGE", conflicts_with_all = ["cut_after_writes", "cut_store_after", "stall", "card_out", "write_error"])]
    pub firmware: Option<PathBuf>,
    /// With --firmware: measure cycles, stack and load of each stage on the model (in the output of --json)
    #[arg(long)]
    pub costs: bool,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// What to put in the way
    #[command(flatten)]
    pub faults: FaultFlags,
}

/// How fast time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// A virtual clock, as fast as the machine goes
    Max,
    /// As long as it took
    Real,
}

/// Faults; each run is repeatable.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Faults (each may be given several times)")]
pub struct FaultFlags {
    /// Cut the power at the N-th 512-byte block write (torn: half of that block stays old); the run ends there
    #[arg(long, value_name = "N[:torn]")]
    pub cut_after_writes: Vec<Cut>,
    /// Cut the power at the N-th word that is written to the store, or sector that is erased there; the run ends there
    #[arg(long, value_name = "N", overrides_with = "cut_store_after")]
    pub cut_store_after: Option<u64>,
    /// Let the card not answer for MS milliseconds from T seconds on
    #[arg(long, value_name = "MS@T")]
    pub stall: Vec<Stall>,
    /// Take the card out of its slot from T to T seconds
    #[arg(long, value_name = "T..T")]
    pub card_out: Vec<CardOut>,
    /// Let each block write fail with this probability
    #[arg(long, value_name = "P", value_parser = faults::probability, overrides_with = "write_error")]
    pub write_error: Option<f64>,
    /// Size of a new card image, MiB
    #[arg(long, value_name = "MIB", overrides_with = "card_size")]
    pub card_size: Option<u64>,
    /// Damage each byte from the autopilot with this probability
    #[arg(long, value_name = "P", value_parser = faults::probability, overrides_with = "noise")]
    pub noise: Option<f64>,
    /// Ignore the recorded times: feed the bytes back to back at this rate
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1..), overrides_with = "line_rate")]
    pub line_rate: Option<u32>,
    /// Cut the board's own power for a moment, T seconds after the first byte; the card stays in its slot
    #[arg(long = "reboot-at", value_name = "T", value_parser = micros)]
    pub reboot_at_us: Vec<u64>,
    /// Seed of the random faults: the same number gives the same faults
    #[arg(long, value_name = "N", default_value_t = 0, overrides_with = "seed")]
    pub seed: u64,
}

fn micros(text: &str) -> Result<u64, String> {
    parse_seconds(text).ok_or_else(|| format!("`{text}` is no time: seconds since the first byte"))
}
