//! `hums share`: a copy of a log without where and who, for a bug report or a question in public.
//!
//! * Frames of a link become a tlog with the fields in `fields.txt`, the parameters in `parameters.txt`, and texts made of the words in `words.txt`.
//! * An autopilot's own log becomes a ULog of its observations, by the rules of `moved.rs`.
//! * Places move so that the first one is in the middle of the Atlantic, altitudes so that the first of each field is 0, pressure so that the
//!   first is standard pressure, and times so that the first is the beginning of 2020. Relative motion, heights and durations stay.

mod moved;
mod rules;

use crate::mavlink::ids::{GLOBAL_POSITION_INT, PARAM_VALUE, STATUSTEXT};
use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_core::observation::Source;
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::Packet;
use hums_link::{Check, Frame};

use crate::args;
use crate::context::Context;
use crate::files::{Inputs, says_directory};
use crate::format::{SingleFile, Totals, Writer as _};
use crate::formats::ulog::{Ulog, Words};
use crate::names::message_name;
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::plural::count;
use crate::printable;
use crate::source::find::find;
use crate::source::item::{Item, Needs};
use crate::source::recording::LogPlace;
use crate::story::{HeldObservation, Story, StoryEntry};
use moved::{Displacement, SHARED_UTC_US};
use rules::{Rule, Rules};

const PART_ITEMS: usize = 4_096;
const REMOVED_MAX: usize = 2_000;
const RECORDS: &str = "records of the board";
/// With places, identities or texts.
const OBSERVATIONS: &str = "observations";
const TEXTS: &str = "texts";
const PARAMETERS: &str = "parameters";

/// The rules of texts, for other files that people give away.
#[derive(Default)]
pub struct TextRules(Rules);

impl TextRules {
    /// Whether a text names neither place nor person.
    pub fn keeps(&self, text: &str) -> bool {
        self.0.keeps_text(text)
    }
}

/// Runs `hums share`.
pub fn run(args: &args::Share) -> Result<Outcome> {
    let (share, lossy) = copy(args)?;
    share.told(args).iter().try_for_each(|line| output::line(&printable::word(line)))?;
    Ok(Outcome::lossy(lossy))
}

/// Returns what was removed, and whether the recording has damage.
fn copy(args: &args::Share) -> Result<(Share, bool)> {
    let found = find(std::slice::from_ref(&args.input), false)?;
    found.tell();
    let wanted = found.name_of(args.session.as_deref())?;
    let mut places =
        found.places.iter().filter(|place| wanted.as_ref().is_none_or(|name| *name == place.name));
    let (Some(place), None) = (places.next(), places.next()) else {
        return Err(usage(format!(
            "{}: has {}; name one by --session NAME",
            args.input.display(),
            count(found.places.len(), "log")
        )));
    };
    if place.is_standard() || says_directory(&args.output) {
        return Err(usage("share reads a file and writes a file; name both"));
    }
    let inputs = Inputs::of([args.input.as_path()].into_iter().chain(found.paths())).forcing(args.force);
    let context = Context { inputs: Arc::new(inputs), ..Context::default() };
    let mut share = Share::default();
    let lossy = if place.open()?.format.is_of_link() || place.own().is_some() {
        share.link(place, &context, args)?
    } else {
        share.own(place, &context, args)?
    };
    Ok((share, lossy))
}

#[derive(Default)]
struct Share {
    rules: Rules,
    moved: Displacement,
    /// Removed messages, fields, parameters and texts, with their numbers.
    removed: BTreeMap<String, u64>,
    /// All messages, parameters and texts by the same names.
    seen: BTreeMap<String, u64>,
    removed_others: u64,
    kept: u64,
    systems: BTreeMap<u8, u8>,
}

impl Share {
    fn see(&mut self, what: &str) {
        if let Some(number) = self.seen.get_mut(what) {
            *number += 1;
        } else if self.seen.len() < REMOVED_MAX {
            self.seen.insert(what.to_owned(), 1);
        }
    }

    fn remove(&mut self, what: &str) {
        if let Some(number) = self.removed.get_mut(what) {
            *number += 1;
        } else if self.removed.len() < REMOVED_MAX {
            self.removed.insert(what.to_owned(), 1);
        } else {
            self.removed_others += 1;
        }
    }

    /// Returns whether the recording has damage.
    fn link(&mut self, place: &LogPlace, context: &Context, args: &args::Share) -> Result<bool> {
        let mut file = SingleFile::open(context, &args.output)?;
        let want = Needs { frames: true, ..Needs::default() };
        let (mut bytes, mut lossy) = (Vec::new(), false);
        let summary = place.open()?.read(want, &mut |at, item| {
            match item {
                Item::Frame(frame) => {
                    if let Some(frame) = self.frame(at, frame, &mut bytes) {
                        let utc_us = SHARED_UTC_US.saturating_add(at.as_micros());
                        file.write(&utc_us.to_be_bytes())?;
                        file.write(frame)?;
                        self.kept += 1;
                    }
                }
                Item::Record(_) => {
                    self.see(RECORDS);
                    self.remove(RECORDS);
                }
                Item::Gap(gap) => lossy |= gap.cause.is_damage(),
                _ => {}
            }
            Ok(())
        })?;
        file.finish()?;
        Ok(lossy || summary.ending.is_some_and(|ending| !ending.is_sound()))
    }

    fn frame<'a>(&mut self, at: Instant, frame: &Frame<'_>, out: &'a mut Vec<u8>) -> Option<&'a [u8]> {
        let name = message_name(frame.id());
        self.see(&name);
        let known = frame.check() == Check::Verified;
        let Some(fields) = self.rules.fields(frame.id()).filter(|_| known) else {
            self.remove(&name);
            return None;
        };
        let fields = fields.to_vec();
        let mut payload = frame.payload().to_vec();
        payload.resize(usize::from(u8::MAX) + 1, 0);
        let text = |field: &str| {
            let place = fields.iter().find(|place| place.name == field)?;
            let bytes = payload.get(place.at..place.at + place.size)?;
            let text = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
            Some(String::from_utf8_lossy(text).into_owned())
        };
        let is_secret = match frame.id() {
            STATUSTEXT => !self.rules.keeps_text(&text("text").unwrap_or_default()),
            PARAM_VALUE => !self.rules.keeps_parameter(&text("param_id").unwrap_or_default()),
            _ => false,
        };
        if is_secret {
            self.remove(&name);
            return None;
        }
        let value =
            |place: &rules::FieldRule| payload.get(place.at..place.at + place.size).unwrap_or_default();
        let degrees = |rule| {
            let place = fields.iter().find(|place| place.rule == Some(rule))?;
            Some(i32::from_le_bytes(*value(place).first_chunk()?))
        };
        // A receiver without a fix reports a default place; this message comes once the autopilot knows its place.
        if frame.id() == GLOBAL_POSITION_INT
            && let (Some(latitude), Some(longitude)) = (degrees(Rule::Latitude), degrees(Rule::Longitude))
        {
            self.moved.begin(f64::from(latitude) / 1e7, f64::from(longitude) / 1e7);
        }
        let mut packet = Packet::new(frame.id());
        for place in &fields {
            let bytes = value(place);
            match place.rule {
                Some(rule) => {
                    packet = packet.bytes(place.at, &self.moved.field(at, frame.id(), place, rule, bytes));
                }
                None if bytes.iter().any(|byte| *byte != 0) => self.remove(&format!("{name}.{}", place.name)),
                None => {}
            }
        }
        let system = self.system(frame.system());
        let mut encoder = Encoder::of(system, frame.component());
        encoder.set_sequence(frame.sequence());
        let mut buffer = [0; FRAME_BYTES_MAX];
        out.clear();
        out.extend_from_slice(encoder.frame(&mut buffer, &packet));
        Some(out)
    }

    fn system(&mut self, system: u8) -> u8 {
        let next = (self.systems.len() as u8).wrapping_add(1);
        *self.systems.entry(system).or_insert(next)
    }

    /// Returns whether the recording has damage.
    fn own(&mut self, place: &LogPlace, context: &Context, args: &args::Share) -> Result<bool> {
        let mut file = Ulog::open(context, &args.output)?;
        let (mut story, mut lossy) = (Story::default(), false);
        let want = Needs { observations: true, ..Needs::default() };
        place.open()?.read(want, &mut |at, item| {
            match &item {
                Item::Observation(..) => self.see(OBSERVATIONS),
                Item::Text(_) => self.see(TEXTS),
                Item::Parameter(_) => self.see(PARAMETERS),
                _ => {}
            }
            match item {
                Item::Observation(source, observation) => match self.moved.observation(observation) {
                    Some(observation) => {
                        self.kept += 1;
                        let source = Source { system: self.system(source.system), ..source };
                        story.observed.push(HeldObservation { at, source, observation });
                    }
                    None => self.remove(OBSERVATIONS),
                },
                Item::Text(text) if !self.rules.keeps_text(text.words) => self.remove(TEXTS),
                Item::Parameter(told) if !self.rules.keeps_parameter(told.name) => self.remove(PARAMETERS),
                Item::Gap(gap) => lossy |= gap.cause.is_damage(),
                item => story.said.extend(StoryEntry::of(at, &item)),
            }
            if story.observed.len() >= PART_ITEMS {
                file.part(context, Words::default(), &std::mem::take(&mut story))?;
            }
            Ok(())
        })?;
        file.part(context, Words::default(), &story)?;
        file.finish(context, Totals::default())?;
        self.remove("all messages of the log that are not in the copy's topics (docs/decode.md#ulog)");
        Ok(lossy)
    }

    /// The lines that the user gets.
    fn told(&self, args: &args::Share) -> Vec<String> {
        let times = if self.seen.contains_key(OBSERVATIONS) {
            "without times of day; `hums check` may find less in the copy"
        } else {
            "times to 2020"
        };
        let mut lines = vec![
            format!("{}: {} kept", args.output.display(), count(self.kept, "message")),
            format!(
                "moved: places to the Atlantic, altitudes to sea level, pressure to 1013.25 hPa, {times}"
            ),
        ];
        lines.extend(self.removed.iter().map(|(what, number)| {
            // A field is in as many messages as there are of its name.
            let all = self.seen.get(what).or_else(|| self.seen.get(what.split('.').next()?));
            let of = all.map_or_else(String::new, |all| format!("{number} of {all} "));
            format!("removed: {of}{what}")
        }));
        if self.removed_others > 0 {
            lines.push(format!("removed: {} of further names", count(self.removed_others, "message")));
        }
        lines.push(
            "stays: the magnetic field, wind, temperature and the shape of the track; docs/decode.md says what they tell"
                .to_owned(),
        );
        lines
    }
}

#[cfg(test)]
mod tests;
