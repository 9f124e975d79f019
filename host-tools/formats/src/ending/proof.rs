//! The proof of a log's end.

use hums_blackbox::record::{LastSession, MarkReason, PreviousEnd};
use hums_core::clock::Instant;

use crate::logs::reader::LogSummary;
use crate::plural::count;
use crate::utc::iso8601_ms;

/// The proof of a log's end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Proof {
    /// The last sector has the mark of an orderly end.
    Closed,
    /// The next start found its end here. The time is of arming or take-off if power failed armed or flying:
    /// the last data are then unknown.
    NextStart(Option<Instant>),
    /// It is whole to its last end mark.
    Mark(Instant, MarkReason),
    /// No end mark, or the vehicle was armed or took off after the last one.
    #[default]
    None,
    /// The next start found as many sectors and frames, but others.
    Differs,
    /// Lost sectors, and frames if counted.
    Short {
        /// Missing sectors; 0 if the last one is there in an older copy with fewer frames.
        sectors: u32,
        /// Frames that are missing.
        frames: Option<u32>,
        /// The source.
        by: Teller,
    },
}

/// The source of a log's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Teller {
    /// The next start on the card.
    NextStart,
    /// Its own parity covers sectors once they are on the card.
    Parity,
}

impl Proof {
    /// Proof by the log, and by the next start's record if known.
    pub fn of(summary: &LogSummary, next: Option<&LastSession>) -> Self {
        let next = next.filter(|next| next.has_end() && Some(next.session) == summary.session);
        let sectors = summary.last_number.map_or(0, |last| last.wrapping_add(1));
        let whole = sectors.saturating_sub(u32::from(summary.ends_partial));
        let covered = summary.parity.last.map_or(0, |last| last.saturating_add(1).saturating_sub(whole));
        if let Some(next) = next
            && next.sectors >= sectors
        {
            let counted = (next.found == PreviousEnd::Frames).then_some(next.frames);
            let frames = counted.zip(summary.frames_end).map(|(there, here)| there.wrapping_sub(here));
            let frames = frames.filter(|missing| *missing < 1 << 31);
            // The sector in progress is written again and again: an older copy has fewer frames.
            if next.sectors > sectors || frames.is_some_and(|missing| missing > 0) {
                let by = Teller::NextStart;
                return Self::Short { sectors: (next.sectors - sectors).max(covered), frames, by };
            }
            if frames == Some(0) && summary.check_end.is_some_and(|check| check != next.check) {
                return Self::Differs;
            }
        }
        if covered > 0 {
            return Self::Short { sectors: covered, frames: None, by: Teller::Parity };
        }
        if summary.closed {
            return Self::Closed;
        }
        if next.is_some_and(|next| next.sectors == sectors) {
            return Self::NextStart(summary.marks.moved);
        }
        match summary.marks.last {
            Some((at, why)) if summary.marks.moved.is_none() => Self::Mark(at, why),
            _ => Self::None,
        }
    }

    /// A complete end, up to the last end mark at least.
    pub const fn holds(self) -> bool {
        self.is_whole() || matches!(self, Self::Mark(..))
    }

    /// Whether all of the end is proved.
    pub const fn is_whole(self) -> bool {
        matches!(self, Self::Closed | Self::NextStart(None))
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::NextStart(_) => "next_start",
            Self::Mark(..) => "mark",
            Self::None => "none",
            Self::Differs => "differs",
            Self::Short { .. } => "short",
        }
    }

    /// A part of a sentence.
    pub fn words(self, summary: &LogSummary) -> String {
        let moment = |at| moment(summary, at);
        match self {
            Self::Closed => "ended in order".to_owned(),
            Self::NextStart(None) if summary.session.is_none() => {
                "nothing was written into it, as the next start found".to_owned()
            }
            Self::NextStart(None) => "whole to its end, as the next start found it".to_owned(),
            Self::NextStart(Some(moved)) => format!(
                "whole to its end, as the next start found it; armed or in the air since {} when power went: later \
                 data may be missing",
                moment(moved)
            ),
            Self::Mark(at, why) => match seconds_after(summary, at).unwrap_or(0.0) {
                ..0.05 => format!("whole to the {} at {}; its end cannot be proved", why.words(), moment(at)),
                after => format!(
                    "whole to the {} at {}; after it {after:.1} s, whose end cannot be proved",
                    why.words(),
                    moment(at)
                ),
            },
            Self::None if summary.is_cut_by_image => "the image ends here, and the log in it".to_owned(),
            Self::None => {
                let after = |(at, why): (Instant, MarkReason)| {
                    format!(" (the last {} was at {})", why.words(), moment(at))
                };
                let after = summary.marks.last.map_or_else(String::new, after);
                match summary.marks.moved {
                    Some(moved) => format!(
                        "not proved to its end: armed or in the air since {}{after} when power went or the card was pulled",
                        moment(moved)
                    ),
                    None => "not proved to its end: power went or the card was pulled while it recorded".to_owned(),
                }
            }
            Self::Differs => "the next log on the card continues other entries than these: this is another log, or a part of \
                              one"
                .to_owned(),
            Self::Short { sectors, frames, by } => {
                let sectors = Some(sectors).filter(|sectors| *sectors > 0).map(|some| count(some, "sector"));
                let frames = frames.map(|some| count(some, "frame"));
                let by = match by {
                    Teller::NextStart => "the next start found them",
                    Teller::Parity => "its parity covers them",
                };
                match (sectors, frames) {
                    (Some(sectors), Some(frames)) => format!("{sectors} missing at its end, {frames}: {by}"),
                    (Some(all), None) | (None, Some(all)) => format!("{all} missing at its end: {by}"),
                    (None, None) => format!("its end is missing: {by}"),
                }
            }
        }
    }
}

pub(super) fn seconds_after(summary: &LogSummary, at: Instant) -> Option<f64> {
    summary.last.map(|last| last.since(at).as_micros() as f64 / 1e6)
}

fn moment(summary: &LogSummary, at: Instant) -> String {
    let utc = summary.epoch_us.map(|epoch| epoch.saturating_add(at.as_micros()));
    utc.map_or_else(|| crate::utc::moment(at), iso8601_ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_breaks_off_is_told_with_its_likeliest_reason_alone() {
        let words = |moved: Option<u64>| {
            let mut summary = LogSummary::default();
            summary.marks.moved = moved.map(Instant::from_millis);
            Proof::None.words(&summary)
        };
        assert_eq!(words(None), "not proved to its end: power went or the card was pulled while it recorded");
        let flown =
            "not proved to its end: armed or in the air since 0:40.0 when power went or the card was pulled";
        assert_eq!(words(Some(40_000)), flown);
        let summary = LogSummary { is_cut_by_image: true, ..LogSummary::default() };
        assert_eq!(Proof::None.words(&summary), "the image ends here, and the log in it");
    }

    #[test]
    fn an_older_copy_of_the_last_sector_is_a_missing_end() {
        let summary = LogSummary {
            session: Some(7),
            last_number: Some(25),
            frames_end: Some(3047),
            ..LogSummary::default()
        };
        let next = |frames| LastSession {
            found: PreviousEnd::Frames,
            session: 7,
            sectors: 26,
            frames,
            ..LastSession::default()
        };
        let short = Proof::Short { sectors: 0, frames: Some(17), by: Teller::NextStart };
        assert_eq!(Proof::of(&summary, Some(&next(3064))), short);
        assert_eq!(short.words(&summary), "17 frames missing at its end: the next start found them");
        assert_eq!(Proof::of(&summary, Some(&next(3047))), Proof::NextStart(None));
        assert_eq!(
            Proof::of(&summary, Some(&next(3040))),
            Proof::NextStart(None),
            "it counted what it could read"
        );
    }
}
