//! `hums report`: one page for each session, whole in itself: no network, no file beside it.
//!
//! [`replay`] reads the log in order: [`samples`] keeps what the vehicle told, so that a page of hours stays below a few
//! megabytes, [`flights`] finds flights and phases with the firmware's own rules, [`frames`] counts; [`trend`] compares
//! with the sessions before on the same card; [`page`] puts the numbers, as JSON, beside the program that draws them
//! (`program`, from the modules in `assets/`), which [`plots`] tells what to draw.
//!
//! Nothing that a vehicle sent becomes markup: text goes into the page as data, and only as text onto it. The page's
//! own policy lets no other script run and loads nothing.

pub mod flights;
pub mod frames;
pub mod page;
pub mod plots;
mod program;
pub mod replay;
pub mod samples;
pub mod trend;

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Result, bail};

use crate::check;
use crate::cli;
use crate::decode::side_by_side::side_by_side;
use crate::files::{Inputs, Output, appended, inside, make_parent, says_directory, settle};
use crate::logs::{self, Log};
use crate::outcome::{Outcome, usage};
use crate::output;

/// Runs `hums report`.
pub fn run(args: &cli::Report) -> Result<Outcome> {
    let found = logs::find(&args.inputs, false)?;
    for remark in &found.remarks {
        eprintln!("hums: {remark}");
    }
    let mut outcome = Outcome::lossy(found.images.iter().any(|image| !image.damage.is_empty()));
    let mut overviews = Vec::new();
    side_by_side(&found.logs, check::overview, |overview| {
        overviews.push(overview?);
        Ok(())
    })?;
    let wanted = wanted(args, &found.logs)?;
    let inputs = Inputs::of(args.inputs.iter().map(PathBuf::as_path).chain(found.paths()));
    for &index in &wanted.sessions {
        let (Some(log), Some(overview)) = (found.logs.get(index), overviews.get(index)) else { continue };
        let earlier = overviews.get(..index).unwrap_or_default();
        let path = wanted.path(log);
        make_parent(&path)?;
        let mut file = Output::create(&path, &inputs)?;
        let html = page::html(overview, &replay::Replay::of(log)?, &trend::of(overview, earlier))?;
        settle(file.write_all(html.as_bytes()), &path)?;
        file.finish()?;
        output::line(&format!("{}: session {}, {} bytes", path.display(), log.name, html.len()))?;
        outcome = outcome.and(Outcome::lossy(overview.is_lossy()));
    }
    if wanted.sessions.len() < found.logs.len() && args.session.is_none() {
        eprintln!(
            "hums: this is the newest of {} sessions; -o DIR/ writes a page for each, --session NAME one of them",
            found.logs.len()
        );
    }
    Ok(outcome)
}

/// Which sessions get a page, and where.
struct Wanted {
    sessions: Vec<usize>,
    output: PathBuf,
    directory: bool,
}

fn wanted(args: &cli::Report, logs: &[Log]) -> Result<Wanted> {
    let Some(last) = logs.len().checked_sub(1) else {
        bail!("no log is in there, so there is nothing to report")
    };
    let directory = says_directory(&args.output);
    let sessions = match &args.session {
        Some(name) => {
            let Some(index) = logs.iter().position(|log| log.name == *name) else {
                let names: Vec<&str> = logs.iter().map(|log| log.name.as_str()).collect();
                return Err(usage(format!(
                    "--session {name}: there is no such session; there is {}",
                    names.join(", ")
                )));
            };
            vec![index]
        }
        None if directory => (0..logs.len()).collect(),
        None => vec![last],
    };
    Ok(Wanted { sessions, output: args.output.clone(), directory })
}

impl Wanted {
    fn path(&self, log: &Log) -> PathBuf {
        if !self.directory {
            return self.output.clone();
        }
        appended(&inside(&self.output, &log.name), "html")
    }
}
