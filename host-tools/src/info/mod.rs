//! `hums info`: what is in a log or a recording, for people and as JSON.

pub mod json;
pub mod text;
mod wear;

use anyhow::{Result, bail};

use crate::check;
use crate::cli;
use crate::followed::Followed;
use crate::logs::side_by_side::side_by_side;
use crate::outcome::Outcome;
use crate::output;
use crate::plural::count;
use crate::source::find::{find, sessions_of};
use crate::summary::Overview;
use json::{LogJson, images_json};
use text::{image_text, text};

/// Runs `hums info`.
pub fn run(args: &cli::Info) -> Result<Outcome> {
    let found = find(&args.inputs, args.salvage)?.of_system(args.system)?;
    for remark in &found.remarks {
        note!("{remark}");
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    let mut list = None;
    if args.json {
        list = Some(output::JsonList::begin("images", &images_json(&found.images), "logs")?);
    } else {
        for image in &found.images {
            output::line(&image_text(image))?;
        }
    }
    let mut followed = Followed::new(sessions_of(&found.places));
    let mut done = |overview: &Overview| {
        outcome = outcome.and(Outcome::lossy(!overview.is_sound()));
        if let Some(list) = &mut list {
            return list.element(&LogJson::new(overview));
        }
        output::line(text(overview).trim_end())?;
        output::line("")
    };
    let (mut failed, is_one) = (0_u64, found.places.len() == 1);
    side_by_side(&found.places, check::overview, |overview| match overview {
        Ok(overview) => followed.push(overview).iter().try_for_each(&mut done),
        Err(error) if is_one => Err(error),
        Err(error) => {
            failed += 1;
            note!("{error:#}");
            Ok(())
        }
    })?;
    followed.finish().try_for_each(|overview| done(&overview))?;
    if let Some(list) = list {
        list.end()?;
    } else if found.places.is_empty() {
        output::line("no log is on it")?;
    }
    if failed > 0 {
        bail!("{failed} of {} could not be read", count(found.places.len() as u64, "log"));
    }
    Ok(outcome)
}
