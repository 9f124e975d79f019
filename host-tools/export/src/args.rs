//! The command lines of this crate's commands, as clap reads them and `--help` teaches them.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};

use crate::endpoint::without_slash;
use crate::format::Format;
use crate::formats::{FORMATS, find};
use crate::utc::TimePoint;

const DECODE_EXAMPLES: &str = "Examples:
  hums decode card.img --session 00001 -o 00001.tlog --format tlog
  hums decode card.img -o out --format tlog,csv,jsonl
  hums decode cards/ -o some --format csv --message ATTITUDE --message GPS_RAW_INT
  hums decode 00001_00.HUM -o - --format jsonl --from 60 --to 2026-11-21T10:20:00Z | head
  hums decode cards/ -o fleet --format parquet
  hums decode card.img -o s3://bucket/fleet --format parquet
  hums decode card.img --session 00001 -o - --format influx | curl --data-binary @- http://localhost:8428/write
  hums decode card.img -o out --format tlog --split flights
  hums decode flight.tlog -o found.tlog --format tlog --findings
  hums decode flight.tlog -o flight.hum --format hum

Where files go: -o names the file where there is one log and one format of a single file (all but csv, parquet and
thesis), unless it is a directory; otherwise it is a directory with OUT/LOG.tlog, OUT/LOG.jsonl, OUT/LOG.lp and, for tables,
OUT/LOG/ATTITUDE.csv, OUT/LOG.thesis/flightvalues.csv, OUT/ATTITUDE/date=D/bucket=B/SESSION.parquet and so on.
LOG names the log, the box and the session: 00001-box3f0042000d51373435363338-s1a2b3c4d. `-o -` is standard output.
An output that exists is overwritten with --force only, once all of the new one is written. An output that is an input,
and a folder that holds another session's tables, are refused.
Times: boot time counts from the box's power-on; UTC is known for a whole session once any frame told it.";

/// A name with a slash behind it is that file.
pub fn input() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(without_slash)
}

fn offset(text: &str) -> Result<f64, String> {
    const WEEK_S: f64 = 604_800.0;
    let offset = text.parse::<f64>().map_err(|error| error.to_string())?;
    if offset.abs() <= WEEK_S { Ok(offset) } else { Err("an offset is at most a week, 604800 s".to_owned()) }
}

/// `hums decode`
#[derive(Args, Clone, Debug)]
#[command(after_help = DECODE_EXAMPLES)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Decode {
    /// Logs, card images, recordings of any kind that `hums check` reads, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// Search every block of an image for deleted logs and remains of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// Only this session of a card or folder, by the name that `hums info --list` prints
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// The file or directory to write, or an address in object storage (docs/fleet.md)
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Formats of the output, separated by commas
    #[arg(long, value_parser = format(), value_delimiter = ',', required = true)]
    pub format: Vec<&'static Format>,
    /// First moment: seconds since power-on (260.8), minutes (4:20.8), or UTC (2026-11-21T10:13:42Z)
    #[arg(long, value_name = "T")]
    pub from: Option<TimePoint>,
    /// Last moment: seconds since power-on (260.8), minutes (4:20.8), or UTC (2026-11-21T10:13:42Z)
    #[arg(long, value_name = "T")]
    pub to: Option<TimePoint>,
    /// Write separate files for each flight; the time on the ground between two is cut in its middle
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with_all = ["from", "to"])]
    pub split: Option<Split>,
    /// Write the findings into a tlog, as texts of the box at their times, for programs that show texts
    #[arg(long)]
    pub findings: bool,
    /// Write a manifest of the files read and made: SHA-256, repairs, losses; as JSON if FILE ends in .json
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// For srt: start of the video, seconds after the log's; negative if it is earlier
    #[arg(
        long,
        value_name = "SECONDS",
        default_value = "0",
        hide_default_value = true,
        allow_negative_numbers = true,
        value_parser = offset
    )]
    pub offset: f64,
    /// For parquet and influx: name of the vehicle for logs without a unique id of the autopilot
    #[arg(long, value_name = "NAME")]
    pub vehicle: Option<String>,
    /// Only these messages, by name; HUMS records and gaps stay
    #[arg(long, value_name = "NAME")]
    pub message: Vec<String>,
    /// Overwrite outputs that exist
    #[arg(long)]
    pub force: bool,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

/// The place of a cut into several files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Split {
    /// Between its flights
    Flights,
}

fn format() -> impl TypedValueParser<Value = &'static Format> {
    let values = FORMATS.iter().map(|format| PossibleValue::new(format.about.name).help(format.about.help));
    PossibleValuesParser::new(values).try_map(|name| find(&name).ok_or("is no format"))
}

const SHARE_EXAMPLES: &str = "Examples:
  hums share flight.tlog -o shared.tlog
  hums share card.img --session 00001 -o shared.tlog
  hums share flight.ulg -o shared.ulg

A recording of a link becomes a tlog, an autopilot's own log a ULog. The output lists the data that was moved and removed.
Look at the copy before you publish it: docs/decode.md lists the data that remain.";

/// `hums share`
#[derive(Args, Clone, Debug)]
#[command(after_help = SHARE_EXAMPLES)]
pub struct Share {
    /// One log, or a card image with --session
    #[arg(value_name = "LOG|IMAGE", value_parser = input())]
    pub input: PathBuf,
    /// Only this session of a card or folder, by the name that `hums info --list` prints
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Overwrite a file that exists
    #[arg(long)]
    pub force: bool,
}

const LOGBOOK_EXAMPLES: &str = "Examples:
  hums logbook cards/ -o logbook.csv
  hums logbook cards/ -o logbook.csv -o logbook.html --force
  hums logbook flight.tlog -o flight.json
  hums logbook cards/ -o flights/

The ending of -o says what to write: .csv, .html (a page to print), .json (one flight for GUTMA's exchange), or a folder (such a
file for each flight). A CSV that exists is continued: its flights stay, and so do the cells that people wrote (pilot, remarks,
columns of their own). With a CSV in the same call, page and JSON have these cells too. docs/logbook.md";

/// `hums logbook`
#[derive(Args, Clone, Debug)]
#[command(after_help = LOGBOOK_EXAMPLES)]
pub struct Logbook {
    /// Cards, card images, logs, recordings, or directories with such
    #[arg(required = true, value_name = "CARD|LOG|DIR", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// The file to write, or a folder; may be given several times
    #[arg(short, long, value_name = "OUT", required = true)]
    pub output: Vec<PathBuf>,
    /// Name of the aircraft for logs without a unique id of the autopilot
    #[arg(long, value_name = "NAME")]
    pub vehicle: Option<String>,
    /// Overwrite pages and JSON that exist
    #[arg(long)]
    pub force: bool,
}

const COMPACT_EXAMPLES: &str = "Examples:
  hums compact fleet
  hums compact s3://bucket/fleet

The folder is that of hums decode --format parquet. Sessions of one date and bucket share a file for each table afterwards, sorted by
vehicle and session. New sessions may be added at any time; run it again for them. docs/fleet.md";

/// `hums compact`
#[derive(Args, Clone, Debug)]
#[command(after_help = COMPACT_EXAMPLES)]
pub struct Compact {
    /// The folder of the tables, or its address in object storage (docs/fleet.md)
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}
