//! The way of a vehicle over ground, and the places of its findings: for maps.

use std::fmt::Write as _;

use anyhow::Result;
use hums_analysis::track::{Point, Track};
use hums_core::clock::{Instant, Span};
use hums_core::units::Position;

use crate::context::Context;
use crate::format::GroupEncoder;
use crate::motion::{Fix, Motion};
use crate::plural::count;
use crate::source::told::Finding;
use crate::story::Story;
use crate::utc::iso8601;

const FINDINGS_MAX: usize = 10_000;
/// The distance between two places: five a second.
const EVERY: Span = Span::from_millis(200);

/// After this time without a place the track begins again.
const SILENCE: Span = Span::from_secs(5);

#[derive(Default)]
pub(crate) struct CollectedFindings(pub(crate) Vec<Finding>);

impl GroupEncoder for CollectedFindings {
    fn finding(&mut self, _: &Context, finding: &Finding) {
        self.0.push(finding.clone());
    }

    fn held_bytes(&self) -> usize {
        2 * size_of::<Finding>() * self.0.len()
    }
}

#[derive(Default)]
pub(crate) struct Journey {
    motion: Motion,
    next: Instant,
    /// Places for findings, which may come after their time.
    track: Track,
    findings: Vec<Finding>,
    findings_left_out: u64,
    pub(crate) fixes: u64,
}

impl Journey {
    /// `each` gets the places of the wanted time, and whether the track begins again with it.
    pub(crate) fn take(
        &mut self,
        context: &Context,
        findings: CollectedFindings,
        story: &Story,
        mut each: impl FnMut(Instant, Fix, bool) -> Result<()>,
    ) -> Result<()> {
        for finding in findings.0 {
            if self.findings.len() < FINDINGS_MAX {
                self.findings.push(finding);
            } else {
                self.findings_left_out += 1;
            }
        }
        for observed in &story.observed {
            let at = observed.at;
            let own = self.motion.observe(observed);
            if !own || at < self.next || !context.selection.has_time(at, &context.epochs) {
                continue;
            }
            let Some(fix) = self.motion.fix_by(&observed.observation) else { continue };
            let Fix { latitude_deg, longitude_deg, altitude_m, .. } = fix;
            self.track.push(at, Position { latitude_deg, longitude_deg }, Some(altitude_m));
            let begins = self.fixes > 0 && at.since(self.next) > SILENCE;
            self.next = at + EVERY;
            self.fixes += 1;
            each(at, fix, begins)?;
        }
        Ok(())
    }

    /// Each finding with its place.
    pub(crate) fn placed(&self) -> impl Iterator<Item = (&Point, &Finding)> {
        let points = self.track.points();
        self.findings.iter().filter_map(move |finding| {
            let after = points.partition_point(|point| point.at <= finding.at);
            Some((points.get(after.saturating_sub(1))?, finding))
        })
    }

    /// What the file cannot hold of this log, as sentences; `name` is the format's.
    pub(crate) fn remarks(&self, name: &str) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.fixes == 0 {
            remarks.push(format!("no position is in the log, so the {name} has no track"));
        }
        let placeless = if self.track.points().is_empty() { self.findings.len() as u64 } else { 0 };
        let left_out = self.findings_left_out + placeless;
        if left_out > 0 {
            remarks.push(format!("{} without a place in the {name}", count(left_out, "finding")));
        }
        remarks
    }
}

/// Text in XML, without the characters that XML cannot hold.
pub(crate) fn push_xml(out: &mut String, text: &str) {
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'.. => {
                out.push(character);
            }
            _ => out.push('\u{fffd}'),
        }
    }
}

pub(crate) fn push_element(out: &mut String, name: &str, text: &str) {
    let _ = write!(out, "<{name}>");
    push_xml(out, text);
    let _ = write!(out, "</{name}>");
}

/// UTC, if known.
pub(crate) fn utc(context: &Context, at: Instant) -> Option<String> {
    context.epochs.utc_us(at).map(iso8601)
}
