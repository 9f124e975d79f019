//! `hums completions` and `hums man`, from the command line's definition.

use std::io::Write as _;

use anyhow::Result;
use clap::CommandFactory as _;

use crate::cli::{self, Cli};
use crate::outcome::{Outcome, usage};
use crate::output::Stdout;

/// Runs `hums completions`.
pub fn completions(args: &cli::Completions) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "hums", &mut script);
    print(&script)
}

/// Runs `hums man`.
pub fn man(args: &cli::Man) -> Result<Outcome> {
    let mut page = Cli::command();
    page.build();
    for name in &args.command {
        let Some(command) = page.find_subcommand(name).filter(|_| name != "help") else {
            return Err(usage(format!("{name}: is no command of hums; hums --help lists them")));
        };
        page = command.clone();
    }
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    print(&text)
}

fn print(text: &[u8]) -> Result<Outcome> {
    let mut out = Stdout::default();
    out.write_all(text)?;
    out.flush()?;
    Ok(Outcome::Done)
}
