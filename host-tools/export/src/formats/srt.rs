//! Subtitles for a video of the flight, one cue a second.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;

use crate::checked::finding_words;
use crate::context::Context;
use crate::format::{Files, Finished, FormatDetails, SingleFile, Totals, Writer};
use crate::journey::{CollectedFindings, utc};
use crate::made::OutputFile;
use crate::mavlink::values::Scalar;
use crate::reference::{Quantity, Reference};
use crate::source::told::Finding;
use crate::story::Story;

const SECOND_US: i64 = 1_000_000;
const SHOWN_US: i64 = 5 * SECOND_US;

/// The open file.
pub(super) struct Srt {
    file: SingleFile,
    reference: Reference,
    /// The beginning of the video, microseconds of the log; known with the log's first observation.
    begin_us: Option<i64>,
    next_us: i64,
    findings: Vec<Finding>,
    cues: u64,
}

impl Srt {
    fn cue(&mut self, context: &Context, now_us: i64) -> Result<()> {
        let from_us = now_us - self.begin_us.unwrap_or(0);
        let Ok(at_us) = u64::try_from(now_us) else { return Ok(()) };
        let at = Instant::from_micros(at_us);
        if from_us < 0 || !context.selection.has_time(at, &context.epochs) {
            return Ok(());
        }
        self.cues += 1;
        let time = utc(context, at).and_then(|utc| Some(utc.get(11..19)?.to_owned()));
        let mut words = vec![time.unwrap_or_else(|| format!("{} s", at_us / SECOND_US as u64))];
        let value = |quantity| {
            self.reference.value(at, quantity).map(Scalar::as_f64).filter(|value| value.is_finite())
        };
        let height = self.reference.vehicle().global.get().map(|global| global.relative_altitude.0);
        words.extend(height.map(|height| format!("height {height:.1} m")));
        let speed = value(Quantity::GroundSpeed).or_else(|| value(Quantity::GnssSpeed));
        words.extend(speed.map(|speed| format!("speed {speed:.1} m/s")));
        let battery = [(Quantity::BatteryPercent, 0, "%"), (Quantity::BatteryVolts, 1, "V")];
        let battery =
            battery.map(|(quantity, decimals, unit)| Some(format!("{:.decimals$} {unit}", value(quantity)?)));
        let battery: Vec<String> = battery.into_iter().flatten().collect();
        if !battery.is_empty() {
            words.push(format!("battery {}", battery.join(" ")));
        }
        let mut out = String::new();
        let _ = writeln!(
            out,
            "{}\n{} --> {}\n{}",
            self.cues,
            time_of(from_us),
            time_of(from_us + SECOND_US),
            words.join("  ")
        );
        let shown = self.findings.iter().filter(|finding| {
            let since_us = now_us + SECOND_US - finding.at.as_micros() as i64;
            (1..=SHOWN_US).contains(&since_us)
        });
        shown.for_each(|finding| {
            let _ = writeln!(out, "{}", finding_words(finding));
        });
        out.push('\n');
        self.file.write(out.as_bytes())
    }
}

/// `00:01:02,345`
fn time_of(us: i64) -> String {
    let ms = us / 1000;
    format!("{:02}:{:02}:{:02},{:03}", ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
}

impl Writer for Srt {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        needs_identity: true,
        omits: "all but time, height, speed, battery and findings",
        ..FormatDetails::new(
            "srt",
            "Subtitles for a video: time, height, speed, battery, findings",
            Files::One("srt"),
        )
    };
    type Encoder = CollectedFindings;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        // Those of this program are known before; those of a board come in order.
        let findings = context.checked.iter().flat_map(|checked| &checked.findings).cloned().collect();
        let file = SingleFile::open(context, path)?;
        Ok(Self { file, reference: Reference::default(), begin_us: None, next_us: 0, findings, cues: 0 })
    }

    fn part(&mut self, context: &Context, part: CollectedFindings, story: &Story) -> Result<()> {
        if context.checked.is_none() {
            self.findings.extend(part.0);
        }
        for observed in &story.observed {
            let at_us = observed.at.as_micros() as i64;
            if self.begin_us.is_none() {
                let begin_us = at_us.saturating_add((context.offset_s * SECOND_US as f64) as i64);
                self.begin_us = Some(begin_us);
                self.next_us = begin_us.max(at_us);
            }
            // A silence has no cue: its end begins the next one.
            if at_us - self.next_us > 10 * SECOND_US {
                self.next_us += (at_us - self.next_us) / SECOND_US * SECOND_US;
            }
            while self.next_us + SECOND_US <= at_us {
                self.cue(context, self.next_us)?;
                self.next_us += SECOND_US;
            }
            self.reference.observe(observed.at, observed.source, &observed.observation);
        }
        let old_us = self.next_us - 2 * SHOWN_US;
        if context.checked.is_none() {
            self.findings.retain(|finding| finding.at.as_micros() as i64 > old_us);
        }
        Ok(())
    }

    fn is_empty(&self) -> bool {
        self.cues == 0
    }

    fn finish(mut self, context: &Context, _: Totals) -> Result<Finished> {
        if self.begin_us.is_some() {
            self.cue(context, self.next_us)?;
        }
        Ok(OutputFile::of(self.file.finish()?, "srt", &[(self.cues, "subtitle")]).into())
    }
}
