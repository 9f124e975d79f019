//! `hums info`, for people and as JSON.

pub mod due;
pub mod each;
mod list;
mod number;
mod text;
mod usage;
mod wear;

use anyhow::Result;

use crate::cli;
use crate::files::Inputs;
use crate::outcome::{Outcome, usage};
use crate::output::{self, JsonList, Schema};
use crate::source::find::find_each;
use crate::verify;
use each::each;
use hums_analysis::log_json::{LogJson, image_text, images_json};
use text::text;

const SCHEMA: Schema = Schema::first("hums-info");

/// Runs `hums info`.
pub fn run(args: &cli::Info) -> Result<Outcome> {
    if let Some(to) = &args.manifest {
        Inputs::of(&args.inputs).refuse(to)?;
        if args.list || args.session.is_some() || args.system.is_some() {
            return Err(usage("--manifest is for --verify, which reads all sessions and prints no list"));
        }
    }
    if args.verify || args.manifest.is_some() {
        return verify::run(args);
    }
    if args.verbose {
        return Err(usage("-v is for --verify"));
    }
    if args.list {
        return list::run(args);
    }
    let found = find_each(&args.inputs, args.salvage)?.of_system(args.system)?;
    let wanted = args.session.as_deref().map(|name| found.session(name)).transpose()?;
    let mut list =
        args.json.then(|| JsonList::begin(SCHEMA, &images_json(&found.images), "logs")).transpose()?;
    if list.is_none() {
        found.images.iter().try_for_each(|image| output::line(&image_text(image, &image.path)))?;
    }
    let outcome = each(&found, wanted, |overview| {
        if let Some(list) = &mut list {
            return list.element(&LogJson::new(overview));
        }
        output::line(text(overview).trim_end())?;
        output::line("")
    })?;
    if let Some(list) = list {
        list.end()?;
    } else if found.places.is_empty() && found.failed.is_empty() {
        output::line("no log is on it")?;
    }
    outcome.end()
}
