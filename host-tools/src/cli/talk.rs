//! The commands of `hums box`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use hums_core::clock::Span;
use hums_core::component::ComponentKind;
use hums_core::health::Level;

use crate::endpoint::Endpoint;
use crate::names::vocabulary;
use crate::utc::{TimePoint, parse_seconds};

const BOX_EXAMPLES: &str = "Examples:
  hums box pull --link serial:/dev/ttyUSB0:57600 -o logs
  hums box params list --link serial:/dev/ttyUSB0:57600
  hums box replaced motor 3 --serial 4711 --link serial:/dev/ttyUSB0:57600
  hums box setup --board speedybee-f405-v4 --link serial:/dev/ttyUSB0:57600
  hums box report /media/card -o report.json
  hums box card-reader --link serial:/dev/ttyUSB0:57600
  hums box update hums-matek-f405-std.upd --card /media/card
  hums box format-card --yes --link serial:/dev/ttyUSB0:57600";

/// `hums box`
#[derive(Args, Clone, Debug)]
#[command(after_help = BOX_EXAMPLES)]
pub struct BoxArgs {
    /// What to do.
    #[command(subcommand)]
    pub action: BoxAction,
}

/// What to do with the box.
#[derive(Clone, Debug, Subcommand)]
pub enum BoxAction {
    /// Download the box's logs over MAVLink
    Pull(Pull),
    /// List, read or set the box's parameters over MAVLink
    Params(Params),
    /// Report a replaced part to the box, over a link or by a file on its card
    Replaced(Replaced),
    /// Show the box's card to a PC as a read-only USB disk
    CardReader(CardReader),
    /// Check an update of the firmware and copy it to the card
    Update(Update),
    /// Format the box's card, if the box cannot record on it
    FormatCard(FormatCard),
    /// Lead through wiring and the autopilot's settings, and say what is missing before a flight
    Setup(Setup),
    /// Write a file about a box for the maintainers, without places and names
    Report(BoxReport),
}

const PARAMS_EXAMPLES: &str = "Examples:
  hums box params list --link serial:/dev/ttyUSB0:57600
  hums box params get GS_BUDGET BAT_REM_WARN --link udpin:0.0.0.0:14550
  hums box params set GS_BUDGET 1000 --link tcp:192.168.1.5:5760 --system 2
  hums box params sign --key key.txt --link serial:/dev/ttyUSB0:57600

The list is lines of NAME VALUE, which `hums sim --params` reads back.";

/// `hums box params`
#[derive(Args, Clone, Debug)]
#[command(after_help = PARAMS_EXAMPLES)]
pub struct Params {
    /// What to do.
    #[command(subcommand)]
    pub action: ParamsAction,
}

/// Where the box is.
#[derive(Args, Clone, Debug)]
pub struct Link {
    /// Link to the box: udpin:, udpout:, tcp: or serial:
    #[arg(long, value_name = "SRC")]
    pub link: Endpoint,
    /// Sign messages with the key in this file: 64 hexadecimal digits, or a passphrase (as in Mission Planner)
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// MAVLink system id of the vehicle. Needed only if several vehicles are on the link
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub system: Option<u8>,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

/// What to do with parameters.
#[derive(Clone, Debug, Subcommand)]
pub enum ParamsAction {
    /// List all parameters, in the box's order
    List {
        /// The address of the box.
        #[command(flatten)]
        at: Link,
    },
    /// Read some parameters
    Get {
        /// Names of parameters, for instance `GS_BUDGET`
        #[arg(required = true, value_name = "NAME")]
        names: Vec<String>,
        /// The address of the box.
        #[command(flatten)]
        at: Link,
    },
    /// Send the box the signing key of --key, over the port that the parameter `SIGN_PORT` trusts
    Sign {
        /// The address of the box.
        #[command(flatten)]
        at: Link,
        /// Remove the box's signing key
        #[arg(long)]
        remove: bool,
    },
    /// Set a parameter; fails if the box keeps another value
    Set {
        /// Name of the parameter
        #[arg(value_name = "NAME")]
        name: String,
        /// Value of the parameter; rounded to single precision, with a message
        #[arg(value_name = "VALUE", allow_negative_numbers = true)]
        value: f64,
        /// The address of the box.
        #[command(flatten)]
        at: Link,
    },
}

const PULL_EXAMPLES: &str = "Examples:
  hums box pull --link serial:/dev/ttyUSB0:57600 -o logs
  hums box pull --link udpin:0.0.0.0:14550 -o logs --last 1
  hums box pull --link tcp:192.168.1.5:5760 -o logs 00001_00.HUM
  hums box pull --link serial:/dev/ttyUSB0:57600 -o logs --around critical
  hums box pull --link serial:/dev/ttyUSB0:57600 -o logs --around 4:20 --span 60

Names of files say whose log it is: 00001-box3f0042000d51373435363338-s1a2b3c4d_00.HUM. One that is there already is left if it
is the same by its checksum, and checked as a new one is. A download that was cut off (.NAME.pull.hums-part) goes on
where it stopped, once the box has confirmed that what is there is the beginning of its log. With --around a part of a log comes, NAME.part.HUM, which every command reads and calls a part;
one that exists is not overwritten. Exit code 3: a log came as it is on the card, and has damage there;
with --around, something of the moment, or of what was searched for the finding, could not be read: the words say what.";

/// `hums box pull`
#[derive(Args, Clone, Debug)]
#[command(after_help = PULL_EXAMPLES)]
pub struct Pull {
    /// The address of the box.
    #[command(flatten)]
    pub at: Link,
    /// The directory for the logs; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Names of log files on the box; without names all of them
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// Only the newest N logs, each with all of its files
    #[arg(long, value_name = "N", conflicts_with = "around")]
    pub last: Option<usize>,
    /// Only the newest log's part around a time (4:20, or UTC) or the latest finding (`critical`, `warning`, a check)
    #[arg(long, value_name = "TIME|FINDING")]
    pub around: Option<LogMoment>,
    /// With --around: seconds before and after that moment
    #[arg(long, value_name = "S", default_value = "30", value_parser = span, requires = "around")]
    pub span: Span,
}

fn span(text: &str) -> Result<Span, String> {
    let micros = parse_seconds(text).ok_or_else(|| format!("`{text}` is no number of seconds"))?;
    Ok(Span::from_micros(micros))
}

/// A moment of a log.
#[derive(Clone, Debug, PartialEq)]
pub enum LogMoment {
    /// A time.
    Time(TimePoint),
    /// The latest finding of this level, or a worse one.
    Level(Level),
    /// The latest finding of this check.
    Check(String),
}

impl std::str::FromStr for LogMoment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "critical" => return Ok(Self::Level(Level::Critical)),
            "warning" => return Ok(Self::Level(Level::Warning)),
            check if vocabulary(check).is_some() => return Ok(Self::Check(check.to_owned())),
            _ => {}
        }
        text.parse().map(Self::Time).map_err(|_| {
            format!(
                "`{text}` is no time (4:20, 260.8, 2026-11-21T10:13:42Z) and no finding: critical, warning, or the name of a check as \
                 docs/health.md has it"
            )
        })
    }
}

const REPLACED_EXAMPLES: &str = "Examples:
  hums box replaced motor 3 --serial 4711 --link serial:/dev/ttyUSB0:57600
  hums box replaced battery 1 --serial B7 --link udpin:0.0.0.0:14550
  hums box replaced airframe --serial 2 --card /media/card

The vehicle must be disarmed. The log records the old part's figures, and the new part begins at zero. With --card a line in the
card's PARAMS.TXT does it at the next start of the box, once: the box compares the serial number with that of the part that it knows.";

/// `hums box replaced`
#[derive(Args, Clone, Debug)]
#[command(after_help = REPLACED_EXAMPLES)]
#[command(group = clap::ArgGroup::new("where").args(["link", "card"]).required(true))]
pub struct Replaced {
    /// The kind of part: airframe, battery, motor, propeller, esc, card, engine, other
    #[arg(value_name = "PART", value_parser = kind)]
    pub part: ComponentKind,
    /// Number of the part among those of its kind, from 1 (`CMPn_NUMBER`)
    #[arg(value_name = "N", default_value_t = 0)]
    pub number: u8,
    /// The serial number of the new part
    #[arg(long, value_name = "S")]
    pub serial: Option<String>,
    /// Link to the box: udpin:, udpout:, tcp: or serial:
    #[arg(long, value_name = "SRC")]
    pub link: Option<Endpoint>,
    /// Sign messages with the key in this file: 64 hexadecimal digits, or a passphrase (as in Mission Planner)
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// MAVLink system id of the vehicle. Needed only if several vehicles are on the link
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub system: Option<u8>,
    /// The root of the box's card, in place of a link
    #[arg(long, value_name = "DIR")]
    pub card: Option<PathBuf>,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

fn kind(text: &str) -> Result<ComponentKind, String> {
    let known = || ComponentKind::ALL.into_iter().filter(|kind| *kind != ComponentKind::None);
    known().find(|kind| kind.name() == text).ok_or_else(|| {
        let names: Vec<&str> = known().map(ComponentKind::name).collect();
        format!("there is no such kind of part: {}", names.join(", "))
    })
}

const FORMAT_EXAMPLES: &str = "Examples:
  hums box format-card --yes --link serial:/dev/ttyUSB0:57600

Only a card that the box cannot use as it is (exFAT, no partition table, another file system, a damaged one), and
only while the vehicle is disarmed.";

/// `hums box format-card`
#[derive(Args, Clone, Debug)]
#[command(after_help = FORMAT_EXAMPLES)]
pub struct FormatCard {
    /// The address of the box.
    #[command(flatten)]
    pub at: Link,
    /// Confirm that all files on the card are erased
    #[arg(long)]
    pub yes: bool,
}

const CARD_READER_EXAMPLES: &str = "Examples:
  hums box card-reader --link serial:/dev/ttyUSB0:57600
  hums box card-reader --link udpin:0.0.0.0:14550

Only while the vehicle is disarmed. The box ends its log and restarts as a USB disk that cannot be written. It records again
after the disk is ejected, after power is switched, and after 10 minutes without a PC.";

/// `hums box card-reader`
#[derive(Args, Clone, Debug)]
#[command(after_help = CARD_READER_EXAMPLES)]
pub struct CardReader {
    /// The address of the box.
    #[command(flatten)]
    pub at: Link,
}

const SETUP_EXAMPLES: &str = "Examples:
  hums box setup --board speedybee-f405-v4 --link serial:/dev/ttyUSB0:57600
  hums box setup --link udpin:0.0.0.0:14550 --port 1
  hums box setup --link serial:/dev/ttyACM0:115200 --set --undo before.param
  hums box setup --link serial:/dev/ttyACM0:115200 --restore before.param

The autopilot answers over its own USB or radio link, or through the box while its GS_PASS is 1. The last line is `ready to fly`, or
what is missing (exit code 4).";

/// `hums box setup`
#[derive(Args, Clone, Debug)]
#[command(after_help = SETUP_EXAMPLES)]
pub struct Setup {
    /// The address of the box.
    #[command(flatten)]
    pub at: Link,
    /// Name of the box's board: show its pads, and check that the image is for it (docs/boards.md)
    #[arg(long, value_name = "NAME")]
    pub board: Option<String>,
    /// The autopilot's telemetry port with the box: `TELEM n` of PX4 (1 to 4), `SERIALn` of ArduPilot
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=9))]
    pub port: u8,
    /// Set the autopilot's parameters that differ, after writing their values to the file of --undo
    #[arg(long, requires = "undo")]
    pub set: bool,
    /// With --set: a new file for the present values
    #[arg(long, value_name = "FILE", requires = "set")]
    pub undo: Option<PathBuf>,
    /// Set the values of a file that --undo wrote, and nothing else
    #[arg(long, value_name = "FILE", conflicts_with_all = ["set", "json"])]
    pub restore: Option<PathBuf>,
}

impl Setup {
    /// For the page.
    pub const fn of_page(link: Endpoint, port: u8) -> Self {
        let at = Link { link, key: None, system: None, json: true };
        Self { at, board: None, port, set: false, undo: None, restore: None }
    }
}

const UPDATE_EXAMPLES: &str = "Examples:
  hums box update hums-matek-f405-std.upd --card /media/card

Checks the signature, and board and version by the newest log on the card. The file becomes HUMS.UPD, and an earlier one that
wrote the newest log HUMS.OLD. The box installs it on the ground (docs/update.md).";

/// `hums box update`
#[derive(Args, Clone, Debug)]
#[command(after_help = UPDATE_EXAMPLES)]
pub struct Update {
    /// The update file, `hums-BOARD.upd`, of a release for the box's board
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Root folder of the box's card, mounted on this PC
    #[arg(long, value_name = "DIR")]
    pub card: PathBuf,
    /// Accept an update that is older than the newest log's version, or that was replaced
    #[arg(long)]
    pub older: bool,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

const REPORT_EXAMPLES: &str = "Examples:
  hums box report /media/card -o report.json
  hums box report --link serial:/dev/ttyUSB0:57600 -o report.json

The file has the box's starts, chip id, faults, losses, figures, parameters and harmless texts. It has no place, vehicle, person
or key. Attach it to a report about a board that you tried.";

/// `hums box report`
#[derive(Args, Clone, Debug)]
#[command(after_help = REPORT_EXAMPLES)]
#[command(group = clap::ArgGroup::new("source").args(["inputs", "link"]).required(true))]
pub struct BoxReport {
    /// A card, an image or logs of the box
    #[arg(value_name = "PATH")]
    pub inputs: Vec<PathBuf>,
    /// Link to the box: udpin:, udpout:, tcp: or serial:
    #[arg(long, value_name = "SRC")]
    pub link: Option<Endpoint>,
    /// MAVLink system id of the vehicle. Needed only if several vehicles are on the link
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub system: Option<u8>,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    pub force: bool,
}
