//! The texts that a box in the vehicle had sent to the pilot.

use std::collections::BTreeMap;

use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::health::{self, Level};
use hums_core::parameters::Params;
use hums_link::summary::Summary;
use hums_link::vocabulary::said;
use hums_link::{Check, Frame, ids};

/// The severity of a critical text.
const CRITICAL: u8 = 2;

/// A text of a finding, in the words of its cause if that is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Told {
    /// When it was sent.
    pub at: Instant,
    /// When the finding whose words it has got its level.
    pub since: Instant,
    /// The check whose words it has.
    pub check: String,
    /// Which one of several.
    pub instance: u8,
    /// A warning or critical.
    pub level: Level,
}

/// The box's selection of texts, as in the vehicle.
pub(super) struct Radio {
    summary: Summary,
    /// By the beginning of its text, each alarm's last rise.
    known: BTreeMap<String, (Instant, &'static str, u8)>,
    frames: Vec<Vec<u8>>,
    told: Vec<Told>,
}

impl Radio {
    pub(super) fn new(params: &Params) -> Self {
        let (known, frames, told) = (BTreeMap::new(), Vec::new(), Vec::new());
        Self { summary: Summary::new(params), known, frames, told }
    }

    /// `since` is of the recording, `now` of the monitor.
    pub(super) fn finding(&mut self, now: Instant, since: Instant, finding: &health::Finding) {
        if matches!(finding.level, Level::Warning | Level::Critical)
            && let Some(words) = said(finding.check)
        {
            let begins = words.alarm_of(finding.instance, finding.feeds).to_string();
            self.known.insert(begins, (since, finding.check, finding.instance));
        }
        self.summary.finding(now, finding, &mut |frame: &[u8]| self.frames.push(frame.to_vec()));
    }

    /// `at` is of the recording, `now` of the monitor.
    pub(super) fn tick(&mut self, now: Instant, at: Instant, monitor: &Monitor) {
        self.summary.tick(now, monitor, &mut |frame: &[u8]| self.frames.push(frame.to_vec()));
        for frame in self.frames.drain(..) {
            let text = Frame::again(&frame, Check::Verified).filter(|frame| frame.id() == ids::STATUSTEXT);
            let Some([severity, text @ ..]) = text.as_ref().map(Frame::payload) else { continue };
            let text = String::from_utf8_lossy(text);
            let words = text.trim_start_matches("HUMS: ").trim_start_matches("cause: ");
            // The longest: one may begin as another one does.
            let fits = self.known.iter().filter(|(begins, _)| words.starts_with(begins.as_str()));
            if let Some((_, (since, check, instance))) = fits.max_by_key(|(begins, _)| begins.len()) {
                let level = if *severity <= CRITICAL { Level::Critical } else { Level::Warning };
                let (since, check, instance) = (*since, (*check).to_owned(), *instance);
                self.told.push(Told { at, since, check, instance, level });
            }
        }
    }

    pub(super) fn end(self) -> Vec<Told> {
        self.told
    }
}
