//! The command line, as clap reads it and `--help` teaches it.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::card::faults::{self, CardOut, Cut, Stall};
use crate::endpoint::Endpoint;
use crate::utc::When;

const ABOUT: &str = "HUMS: an on-board black box and health monitor for drones that speak MAVLink.

The firmware listens at the autopilot's UART, records every frame on an SD card, checks the vehicle's health and sends
a summary to the ground station. This program runs the same pipeline on this PC, and reads the cards.";

const AFTER: &str = "Where bytes come from and go to (SRC, SINK):
  FILE                  a tlog or raw MAVLink bytes, told apart by what is in it
  -                     standard input or output
  udpin:ADDR:PORT       a UDP port of this PC that others send to, e.g. udpin:0.0.0.0:14550
  udpout:ADDR:PORT      a UDP port of another machine
  tcp:ADDR:PORT         a TCP server
  serial:DEVICE:BAUD    a serial port, e.g. serial:/dev/ttyUSB0:921600

Examples:
  hums demo                                                  a recorded flight through all of it
  hums sim --input flight.tlog --sd card.img                 record a flight onto an SD card image
  hums info card.img                                         what is on a card
  hums decode card.img -o out --format tlog,csv              a card's logs for other tools
  hums live --input udpin:0.0.0.0:14550 --open               the vehicle as it flies, in the browser

Exit codes: 0 done; 1 failed; 2 usage; 3 done, but the log has losses or damage (all that could be read was read).
Results go to standard output, everything else to standard error.";

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "hums", version, about = ABOUT, after_help = AFTER, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the firmware's pipeline on this PC: bytes in at the autopilot UART, an SD card image out
    Sim(Sim),
    /// The same with the real Cortex-M4 firmware image, in QEMU
    Emulate(Emulate),
    /// Turn logs into files for other tools: tlog, CSV, JSON lines, line protocol, Parquet, the thesis's tables
    Decode(Decode),
    /// Say what is in a log: sessions, vehicle, frames, gaps, findings, usage, sizes
    Info(Info),
    /// Check everything that can be checked about a log or a card
    Verify(Verify),
    /// Write a page about a flight: plots, map, findings, usage, trend; one HTML file, no network
    Report(Report),
    /// Show the vehicle as it flies, on a page that this program serves: from a link, a recording or a log
    Live(Live),
    /// Write one log file from a recording, without a card's file system
    Pack(Pack),
    /// List, read or set the board's parameters over MAVLink
    Params(Params),
    /// Download the board's logs over MAVLink
    Pull(Pull),
    /// Have the board format a card that it cannot record on
    Format(FormatCard),
    /// Show it: a recorded flight is recorded, decoded and summed up, and played on the dashboard
    Demo(Demo),
}

const SIM_EXAMPLES: &str = "Examples:
  hums sim --input flight.tlog --sd card.img --gs gs.bin
  hums sim --input flight.tlog --sd card.img --json --line-rate 921600
  hums sim --input udpin:0.0.0.0:14550 --sd card.img --gs udpout:127.0.0.1:14551
  hums sim --input flight.tlog --sd card.img --gs udpin:127.0.0.1:14551 --speed real
  hums sim --input flight.tlog --sd card.img --stall 2500@60 --noise 0.001 --seed 7
  hums sim --input flight.tlog --sd card.img --cut-after-writes 1000:torn
  hums sim --input flight.tlog --sd card.img --store store.bin --params hums.param

Raw bytes carry no times: they come as on a line at 115,200 baud. --sd is kept: a second run adds a session to it.";

/// What `sim` and `emulate` share.
#[derive(Args, Clone, Debug)]
pub struct Run {
    /// Where the autopilot's bytes come from: a file (tlog or raw MAVLink), `-`, udpin:, udpout:, tcp: or serial:
    #[arg(long, value_name = "SRC")]
    pub input: Endpoint,
    /// The SD card image (MBR + FAT32); made, 256 MiB and sparse, when missing
    #[arg(long, value_name = "IMAGE")]
    pub sd: PathBuf,
    /// Where the bytes for the ground station go; where somebody is there (udp, tcp, serial), its own are heard too
    #[arg(long, value_name = "SINK")]
    pub gs: Option<Endpoint>,
    /// What the ground station sends, with the times that it has in this file
    #[arg(long, value_name = "SRC")]
    pub gs_input: Option<Endpoint>,
    /// The flash in which counters and parameters outlive power (32 KiB; made when missing); without it all begin anew
    #[arg(long, value_name = "FILE")]
    pub store: Option<PathBuf>,
    /// Set these parameters before the start: `NAME VALUE` or `NAME,VALUE` lines, or a QGroundControl file
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// As fast as possible on a virtual clock (repeatable), or in real time; live inputs are always real
    #[arg(long, value_enum)]
    pub speed: Option<Speed>,
    /// Print the result as one JSON object
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
    /// The wall's clock
    Real,
}

/// Faults; each run is repeatable.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Faults (each may be given several times)")]
pub struct FaultFlags {
    /// Power goes at the N-th 512-byte block write (torn: half of that block is old); the run ends there
    #[arg(long, value_name = "N[:torn]")]
    pub cut_after_writes: Vec<Cut>,
    /// Power goes at the N-th word that is written to the store, or sector that is erased; the run ends there
    #[arg(long, value_name = "N", overrides_with = "cut_store_after")]
    pub cut_store_after: Option<u64>,
    /// The card answers nothing for MS milliseconds from T seconds on
    #[arg(long, value_name = "MS@T")]
    pub stall: Vec<Stall>,
    /// The card is out of its slot from T to T seconds
    #[arg(long, value_name = "T..T")]
    pub card_out: Vec<CardOut>,
    /// Each block write fails with this probability
    #[arg(long, value_name = "P", value_parser = faults::probability, overrides_with = "write_error")]
    pub write_error: Option<f64>,
    /// The size of the card image that is made, in MiB
    #[arg(long, value_name = "MIB", overrides_with = "card_size")]
    pub card_size: Option<u64>,
    /// Each byte from the autopilot is damaged with this probability
    #[arg(long, value_name = "P", value_parser = faults::probability, overrides_with = "noise")]
    pub noise: Option<f64>,
    /// Ignore the recorded times: feed the bytes back to back at this rate
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1..), overrides_with = "line_rate")]
    pub line_rate: Option<u32>,
    /// Our own power goes for a moment T seconds after the first byte; the card stays
    #[arg(long, value_name = "T", value_parser = at)]
    pub reboot_at: Vec<u64>,
    /// Which of the possible random faults happen
    #[arg(long, value_name = "N", default_value_t = 0, overrides_with = "seed")]
    pub seed: u64,
}

fn at(text: &str) -> Result<u64, String> {
    faults::seconds(text).ok_or_else(|| format!("`{text}` is no time: seconds since the first byte"))
}

/// `hums sim`
#[derive(Args, Clone, Debug)]
#[command(after_help = SIM_EXAMPLES)]
pub struct Sim {
    /// The run.
    #[command(flatten)]
    pub run: Run,
    /// Also write the bytes as they arrived at the UART, noise and all, to this file
    #[arg(long, value_name = "FILE")]
    pub tap: Option<PathBuf>,
}

const EMULATE_EXAMPLES: &str = "Examples:
  hums emulate --input flight.tlog --sd card.img
  hums emulate --input flight.tlog --sd card.img --json --firmware target/thumbv7em-none-eabihf/firmware/hums-firmware

Needs qemu-system-arm 8.0 or later. Inside the source tree a missing firmware image is built first.";

/// What the firmware understands of `--provoke`.
fn provoked(text: &str) -> Result<String, String> {
    let (what, at_s) = text.split_once('@').unwrap_or((text, "0"));
    let (what, task) = what.split_once(':').unwrap_or((what, "downlink"));
    let one_of = |word: &str, known: &[&str]| {
        known.contains(&word).then_some(()).ok_or(format!("{word} is none of {}", known.join(", ")))
    };
    one_of(what, &["panic", "bus-fault", "overflow", "spin", "silence", "supply"])?;
    one_of(task, &["reception", "monitor", "downlink", "storage"])?;
    if what == "silence" && task != "downlink" {
        return Err(format!("{task} has no place where it could wait for ever: only downlink has; or spin"));
    }
    at_s.parse::<u32>().map_err(|_| format!("{at_s} is no whole number of seconds"))?;
    Ok(text.to_owned())
}

/// `hums emulate`
#[derive(Args, Clone, Debug)]
#[command(after_help = EMULATE_EXAMPLES)]
pub struct Emulate {
    /// The run.
    #[command(flatten)]
    pub run: Run,
    /// The firmware image (ELF) of the emulated board; otherwise the one that the source tree built
    #[arg(long, value_name = "ELF")]
    pub firmware: Option<PathBuf>,
    /// What is to go wrong, once, in the firmware itself: panic, bus-fault, overflow (of the stack), spin, silence or
    /// supply; in reception, monitor, downlink (the default) or storage; from some second on (0)
    #[arg(long, value_name = "WHAT[:TASK][@SECONDS]", value_parser = provoked)]
    pub provoke: Option<String>,
    /// Count the instructions of each stage of the pipeline, for `instructions` in the JSON
    #[arg(long)]
    pub costs: bool,
}

const DECODE_EXAMPLES: &str = "Examples:
  hums decode card.img -o flight.tlog --format tlog
  hums decode card.img -o out --format tlog,csv,jsonl
  hums decode cards/ -o out --format csv --message ATTITUDE --message GPS_RAW_INT
  hums decode 00042.hum -o - --format jsonl --from 60 --to 2026-11-21T10:20:00Z | head
  hums decode cards/ -o fleet --format parquet
  hums decode card.img -o - --format influx | curl --data-binary @- http://localhost:8086/write?db=hums

Where files go: -o names the file where there is one log and one format of a single file (tlog, jsonl, influx), unless
it is a directory; otherwise it is a directory with OUT/LOG.tlog, OUT/LOG.jsonl, OUT/LOG.lp and, for tables,
OUT/LOG/ATTITUDE.csv, OUT/LOG/thesis/flightvalues.csv, OUT/vehicle=V/date=D/session=S/ATTITUDE.parquet and so on.
`-o -` is standard output.
Times: boot time counts from the monitor's power-on; UTC is known for a whole session once any frame told it.";

/// `hums decode`
#[derive(Args, Clone, Debug)]
#[command(after_help = DECODE_EXAMPLES)]
pub struct Decode {
    /// Logs, card images, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR")]
    pub inputs: Vec<PathBuf>,
    /// Look at every block of an image: finds logs that were deleted, and what is left of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// The file or directory to write
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// What to write, several with commas
    #[arg(long, value_enum, value_delimiter = ',', required = true)]
    pub format: Vec<Format>,
    /// Leave out what is earlier: seconds since the session's start, or UTC as 2026-11-21T10:13:42Z
    #[arg(long, value_name = "T")]
    pub from: Option<When>,
    /// Leave out what is later
    #[arg(long, value_name = "T")]
    pub to: Option<When>,
    /// Only these MAVLink messages, by name; HUMS records and gaps stay
    #[arg(long, value_name = "NAME")]
    pub message: Vec<String>,
}

/// What to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A ground station's log: opens in Mission Planner, QGroundControl, MAVProxy, pymavlink
    Tlog,
    /// A table for each message type, units in the header
    Csv,
    /// An object a line, in order of time
    Jsonl,
    /// Line protocol, with the reference system's measurement HUMS
    Influx,
    /// Typed columns by vehicle, date and session, for `DuckDB`, Spark, pandas
    Parquet,
    /// The reference system's four tables, a row a second
    Thesis,
}

const INFO_EXAMPLES: &str = "Examples:
  hums info card.img
  hums info --json 00042_00.HUM";

/// `hums info`
#[derive(Args, Clone, Debug)]
#[command(after_help = INFO_EXAMPLES)]
pub struct Info {
    /// Logs, card images, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR")]
    pub inputs: Vec<PathBuf>,
    /// Look at every block of an image: finds logs that were deleted, and what is left of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    pub json: bool,
}

const VERIFY_EXAMPLES: &str = "Examples:
  hums verify card.img
  hums verify --json card.img

Checks the file system's structures, every sector's checksum and number, every group's decoding, every frame's own
checksum and the order of times. Exit code 3 means damage or losses were found.";

/// `hums verify`
#[derive(Args, Clone, Debug)]
#[command(after_help = VERIFY_EXAMPLES)]
pub struct Verify {
    /// Logs, card images, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR")]
    pub inputs: Vec<PathBuf>,
    /// Look at every block of an image: finds logs that were deleted, and what is left of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    pub json: bool,
}

const REPORT_EXAMPLES: &str = "Examples:
  hums report card.img -o report.html
  hums report card.img -o pages/
  hums report card.img --session 00042 -o report.html

With a directory for -o each session gets a page, named after it; otherwise the newest gets one. The page compares with
the sessions before on the same card.";

/// `hums report`
#[derive(Args, Clone, Debug)]
#[command(after_help = REPORT_EXAMPLES)]
pub struct Report {
    /// Logs, card images, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR")]
    pub inputs: Vec<PathBuf>,
    /// The page to write, or a directory for a page a session
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Only this session, by the name that `hums info` gives
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
}

const LIVE_EXAMPLES: &str = "Examples:
  hums live --input udpin:0.0.0.0:14550 --open
  hums live --input serial:/dev/ttyUSB0:57600
  hums live --input flight.tlog --open
  hums live --input card.img --session 00042
  hums live --input udpin:0.0.0.0:14550 --influx http://127.0.0.1:8086 --org drones --bucket hums --token T
  hums live --input udpin:0.0.0.0:14550 --listen 192.168.1.5:8080

The address to open is printed to standard output. Ctrl-C ends it. A recording or a log is played, and can be paused,
sought and played at other speeds. Nothing is sent to the vehicle. With --listen on an address that other machines reach,
a token is made and stands in the printed address; the page shows nothing without it.";

/// `hums live`
#[derive(Args, Clone, Debug)]
#[command(after_help = LIVE_EXAMPLES)]
pub struct Live {
    /// A link (udpin:, udpout:, tcp:, serial:), a recording (tlog or raw MAVLink, `-`), or a log (file, image, folder)
    #[arg(long, value_name = "SRC")]
    pub input: Endpoint,
    /// Of several sessions this one, by the name that `hums info` gives; otherwise the newest
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// Where the page is served; port 0 is any free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:8080")]
    pub listen: String,
    /// The page's token instead of one that is made; then asked for on 127.0.0.1 too
    #[arg(long, value_name = "TOKEN")]
    pub listen_token: Option<String>,
    /// Set these limits before the start: `NAME VALUE` or `NAME,VALUE` lines, or a QGroundControl file
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Show the page in the browser
    #[arg(long)]
    pub open: bool,
    /// Also write every message to this database, as `hums decode --format influx` would: http://ADDR:PORT
    #[arg(long, value_name = "URL", help_heading = "Database")]
    pub influx: Option<String>,
    /// Its token (1.x: USER:PASSWORD); otherwise the environment's `HUMS_INFLUX_TOKEN`
    #[arg(long, value_name = "T", help_heading = "Database")]
    pub token: Option<String>,
    /// Its organisation: `InfluxDB` 2 or 3; without it `InfluxDB` 1.x and `VictoriaMetrics`
    #[arg(long, value_name = "O", help_heading = "Database")]
    pub org: Option<String>,
    /// Its bucket or database
    #[arg(long, value_name = "B", default_value = "hums", help_heading = "Database")]
    pub bucket: String,
}

const PACK_EXAMPLES: &str = "Examples:
  hums pack flight.tlog -o flight.hum
  hums decode flight.hum -o back.tlog --format tlog";

/// `hums pack`
#[derive(Args, Clone, Debug)]
#[command(after_help = PACK_EXAMPLES)]
pub struct Pack {
    /// A tlog or raw MAVLink bytes
    #[arg(value_name = "TLOG")]
    pub input: Endpoint,
    /// The log file to write
    #[arg(short, long, value_name = "LOG")]
    pub output: PathBuf,
}

const PARAMS_EXAMPLES: &str = "Examples:
  hums params list --link serial:/dev/ttyUSB0:57600
  hums params get GS_BUDGET BAT_REM_WARN --link udpin:0.0.0.0:14550
  hums params set GS_BUDGET 1000 --link tcp:192.168.1.5:5760
  hums params sign --key key.txt --link serial:/dev/ttyUSB0:57600

The list is lines of NAME VALUE, which `hums sim --params` reads back.";

/// `hums params`
#[derive(Args, Clone, Debug)]
#[command(after_help = PARAMS_EXAMPLES)]
pub struct Params {
    /// What to do.
    #[command(subcommand)]
    pub action: ParamsAction,
}

/// Where the board is.
#[derive(Args, Clone, Debug)]
pub struct Link {
    /// Where the board is: udpin:, udpout:, tcp: or serial:
    #[arg(long, value_name = "SRC")]
    pub link: Endpoint,
    /// Sign what is sent with the key in this file: 64 hexadecimal digits, or a passphrase as Mission Planner takes it
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
}

/// What to do with parameters.
#[derive(Clone, Debug, Subcommand)]
pub enum ParamsAction {
    /// All of them, in the board's order
    List {
        /// Where the board is.
        #[command(flatten)]
        at: Link,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Some of them
    Get {
        /// Names, for instance `GS_BUDGET`
        #[arg(required = true, value_name = "NAME")]
        names: Vec<String>,
        /// Where the board is.
        #[command(flatten)]
        at: Link,
    },
    /// Give the board the key of --key, over the port that its `SIGN_PORT` trusts
    Sign {
        /// Where the board is.
        #[command(flatten)]
        at: Link,
        /// Take the key away
        #[arg(long)]
        remove: bool,
    },
    /// Set one; fails where the board keeps another value
    Set {
        /// The name
        #[arg(value_name = "NAME")]
        name: String,
        /// The value
        #[arg(value_name = "VALUE", allow_negative_numbers = true)]
        value: f32,
        /// Where the board is.
        #[command(flatten)]
        at: Link,
    },
}

const PULL_EXAMPLES: &str = "Examples:
  hums pull --link serial:/dev/ttyUSB0:57600 -o logs
  hums pull --link udpin:0.0.0.0:14550 -o logs --last 1
  hums pull --link tcp:192.168.1.5:5760 -o logs 00042_00.HUM

A file that is there already with the same length is left; one that was begun (NAME.part) is gone on with.";

/// `hums pull`
#[derive(Args, Clone, Debug)]
#[command(after_help = PULL_EXAMPLES)]
pub struct Pull {
    /// Where the board is.
    #[command(flatten)]
    pub at: Link,
    /// The directory for the logs; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Only these, by name
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// Only the newest so many
    #[arg(long, value_name = "N")]
    pub last: Option<usize>,
}

const FORMAT_EXAMPLES: &str = "Examples:
  hums format --yes --link serial:/dev/ttyUSB0:57600

Only a card that the board cannot use as it is (exFAT, no partition table, another file system, a damaged one), and
only while the vehicle is disarmed.";

/// `hums format`
#[derive(Args, Clone, Debug)]
#[command(after_help = FORMAT_EXAMPLES)]
pub struct FormatCard {
    /// Where the board is.
    #[command(flatten)]
    pub at: Link,
    /// Everything on the card may be lost
    #[arg(long)]
    pub yes: bool,
}

const DEMO_EXAMPLES: &str = "Examples:
  hums demo
  hums demo --input flight.tlog --dir demo
  hums demo --dashboard never

On a terminal it ends with the dashboard, which plays the card and runs until Ctrl-C.";

/// `hums demo`
#[derive(Args, Clone, Debug)]
#[command(after_help = DEMO_EXAMPLES)]
pub struct Demo {
    /// The flight; otherwise one of the source tree's own
    #[arg(long, value_name = "SRC")]
    pub input: Option<Endpoint>,
    /// Where to put the card image and what is decoded from it
    #[arg(long, value_name = "DIR", default_value = "hums-demo")]
    pub dir: PathBuf,
    /// Whether it ends with the dashboard
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = Dashboard::Auto)]
    pub dashboard: Dashboard,
}

/// Whether the demo ends with the dashboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Dashboard {
    /// Where standard output is a terminal
    Auto,
    /// Wherever it goes
    Always,
    /// Not at all
    Never,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_example_of_every_help_is_a_command_line() {
        let mut examples = 0;
        let mut root = Cli::command();
        let helps: Vec<String> = std::iter::once(root.render_long_help().to_string())
            .chain(Cli::command().get_subcommands_mut().map(|command| command.render_long_help().to_string()))
            .collect();
        for help in &helps {
            assert!(help.contains("Examples:"), "{help}");
            for line in help.lines().filter_map(|line| line.strip_prefix("  hums ")) {
                // A remark stands after three spaces, and a pipe is the shell's.
                let line =
                    line.split("   ").next().unwrap_or_default().split(" | ").next().unwrap_or_default();
                let words = std::iter::once("hums").chain(line.split_whitespace());
                assert!(Cli::try_parse_from(words).is_ok(), "hums {line}");
                examples += 1;
            }
        }
        assert!(examples >= 20, "{examples} examples");
    }

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
