//! The page of a fleet: one file, from the table of its sessions.

use anyhow::Result;
use serde::Serialize;

use super::page::whole;
use super::{PageJson, PagesJson, Request, SCHEMA, beside, write};
use crate::files::{Inputs, says_directory};
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::plural::count;
use crate::printable::path as shown;

const FILE: &str = "fleet.html";

#[derive(Serialize)]
struct Data<'a, T> {
    version: &'static str,
    fleet: &'a T,
}

/// Writes the page of a fleet, as its program (`fleet.js`) takes it.
///
/// # Errors
/// An option is of recordings, or the page cannot be written.
pub fn page(args: &Request<'_>, fleet: &impl Serialize) -> Result<Outcome> {
    if args.session.is_some() || args.compare || args.system.is_some() || args.map.is_some() {
        return Err(usage(
            "--session, --compare, --system and --map are for recordings: the page of a fleet is of all its sessions",
        ));
    }
    let output = args.output.map_or_else(|| beside(args.inputs), |output| Ok(output.to_owned()))?;
    let path = if says_directory(&output) { output.join(FILE) } else { output };
    let html = whole("fleet", &Data { version: env!("CARGO_PKG_VERSION"), fleet }, None);
    write(
        &path,
        &html,
        &Inputs::of(args.inputs.iter().map(std::path::PathBuf::as_path)).forcing(args.force),
    )?;
    let bytes = html.len() as u64;
    if args.json {
        let pages = vec![PageJson { path, session: None, bytes }];
        output::json(SCHEMA, &PagesJson { pages, skipped: Vec::new() })?;
    } else {
        output::line(&format!("{}: the fleet, {}", shown(&path), count(bytes, "byte")))?;
    }
    Ok(Outcome::Done)
}
