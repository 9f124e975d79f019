//! `hums demo`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::endpoint::Endpoint;

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
    /// Overwrite outputs that exist
    #[arg(long)]
    pub force: bool,
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
