//! `hums live`.

use std::path::PathBuf;

use clap::Args;

use crate::endpoint::Endpoint;

const LIVE_EXAMPLES: &str = "Examples:
  hums live udpin:0.0.0.0:14550 --open
  hums live serial:/dev/ttyUSB0:57600
  hums live flight.tlog --open
  hums live card.img --session 00001
  hums live udpin:0.0.0.0:14550 --influx http://127.0.0.1:8086 --org drones --bucket hums --token T
  hums live udpin:0.0.0.0:14550 --listen 0.0.0.0:8080

The address to open is printed to standard output. Ctrl-C ends it. A recording or a log is played, and can be paused,
wound back and forth, and played at other speeds. Nothing is sent to the vehicle without --setup.
For a phone or a tablet: --listen 0.0.0.0:8080. The address of this PC in its network is then printed too, and on a terminal
as a code for the phone's camera. Such an address ends with a token; the page shows nothing without it.";

/// `hums live`
#[derive(Args, Clone, Debug)]
#[command(after_help = LIVE_EXAMPLES)]
pub struct Live {
    /// A link (udpin:, udpout:, tcp:, serial:), a recording (tlog or raw MAVLink, `-`), or a log (file, image, folder)
    #[arg(value_name = "SRC")]
    pub input: Endpoint,
    /// Play this session, by the name that `hums info --list` prints; without it the newest
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// Address of the page on this PC; port 0 is any free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:8080")]
    pub listen: String,
    /// Token that the page asks for, in place of a random one; then it is needed on 127.0.0.1 too
    #[arg(long, value_name = "TOKEN")]
    pub listen_token: Option<String>,
    /// Let the page run the bench check of `hums box setup`; N is --port there
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "2")]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=9))]
    pub setup: Option<u8>,
    /// Set these limits before the start: `NAME VALUE` or `NAME,VALUE` lines, or a QGroundControl file
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Show the page in the browser
    #[arg(long)]
    pub open: bool,
    /// Print the addresses as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// Also write every message to this database, as `hums decode --format influx` would: http://ADDR:PORT
    #[arg(long, value_name = "URL", help_heading = "Database")]
    pub influx: Option<String>,
    /// Token of the database of --influx (1.x: USER:PASSWORD); without it `HUMS_INFLUX_TOKEN` in the environment
    #[arg(long, value_name = "T", help_heading = "Database")]
    pub token: Option<String>,
    /// Organisation in the database of --influx; InfluxDB 1.x and VictoriaMetrics have none
    #[arg(long, value_name = "O", help_heading = "Database")]
    pub org: Option<String>,
    /// Bucket or database for the messages of --influx
    #[arg(long, value_name = "B", default_value = "hums", help_heading = "Database")]
    pub bucket: String,
}
