//! Outputs for a shell and for readers of manuals, from the command line's definition: `hums completions`, `hums
//! man`.

use clap::Args;
use clap_complete::Shell;

const COMPLETIONS_EXAMPLES: &str = "Examples:
  hums completions bash > hums.bash
  hums completions zsh > _hums
  hums completions powershell > hums.ps1

The shell reads it at its start: bash from ~/.local/share/bash-completion/completions/hums, zsh from a folder of its fpath, fish
from ~/.config/fish/completions/hums.fish, PowerShell from a line in $PROFILE.";

/// `hums completions`
#[derive(Args, Clone, Debug)]
#[command(after_help = COMPLETIONS_EXAMPLES)]
pub struct Completions {
    /// The shell that will read the script
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: Shell,
}

const MAN_EXAMPLES: &str = "Examples:
  hums man > hums.1
  hums man decode > hums-decode.1
  hums man box pull > hums-box-pull.1
  hums man | man -l -";

/// `hums man`
#[derive(Args, Clone, Debug)]
#[command(after_help = MAN_EXAMPLES)]
pub struct Man {
    /// Command of hums; without it the page of the whole program
    #[arg(value_name = "COMMAND")]
    pub command: Vec<String>,
}
