//! Output of `hums sim`: counters, and findings in the newest logs.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use hums_analysis::log_json::FindingJson;
use hums_blackbox::record::Stats;
use serde::{Serialize, Serializer};

use super::earlier::EarlierSessions;
use crate::endpoint::Endpoint;
use crate::logs;
use crate::outcome::Outcome;
use crate::output::{self, Schema};
use crate::plural::count;
use crate::source::told::Finding;
use crate::summary::Overview;
use crate::utc::moment;

const SCHEMA: Schema = Schema::first("hums-run");

/// The object of `--json`; its names are a contract.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport {
    /// Frames received.
    pub frames_in: u64,
    /// Frames on the card.
    pub frames_logged: u64,
    /// Frames not on the card.
    pub frames_lost: u64,
    /// Bytes received.
    pub bytes_in: u64,
    /// Bytes outside frames.
    pub bytes_not_frames: u64,
    /// Bytes of log on the card.
    pub bytes_logged: u64,
    /// Blocks of 512 bytes, file system included.
    pub blocks_written: u64,
    /// Largest fill of the sector queue.
    pub queue_bytes_max: u64,
    /// Size of the sector queue.
    pub queue_bytes_capacity: u64,
    /// Longest call of the card.
    pub sd_stall_ms_max: u64,
    /// Frames sent to the ground station.
    pub gs_frames: u64,
    /// Bytes sent to the ground station.
    pub gs_bytes: u64,
    /// At most 10,000, up to `unit`; times since the first byte.
    #[serde(serialize_with = "findings")]
    pub findings: Vec<Finding>,
    /// Further findings.
    #[serde(skip_serializing_if = "is_none")]
    pub findings_left_out: u64,
    /// Counters (`docs/usage.md`).
    pub usage: serde_json::Map<String, serde_json::Value>,
    /// Files of this run on the card.
    pub log_files: Vec<String>,
    /// Earlier sessions that were overwritten.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub overwritten: Vec<String>,
    /// Allowed by the command line.
    #[serde(skip)]
    pub may_overwrite: bool,
    /// No room in the end, and no session to overwrite.
    #[serde(skip)]
    pub card_full: bool,
    /// Power failed as the command line asked.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub power_cut: bool,
    /// With `--firmware`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stack_bytes_max: Option<u64>,
    /// With `--firmware`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stack_bytes: Option<u64>,
    /// Largest stack by urgency, with `--firmware --costs`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stack_by_urgency: Option<serde_json::Value>,
    /// Cycles of the processor by stage, with `--firmware --costs`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<serde_json::Value>,
    /// In the worst second but the first, with `--firmware --costs`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub busy_percent_max: Option<f64>,
}

/// A run's logs.
#[derive(Clone, Copy, Debug, Default)]
pub struct CardLogs {
    /// Bytes of log.
    pub bytes: u64,
    /// A stretch of unknown length counts as one.
    pub frames_missing: u64,
    /// The recorder's last figures, if any.
    pub stats: Option<Stats>,
}

/// Kept: a run may go on for days.
pub const FINDINGS_MAX: usize = 10_000;

fn is_none(count: &u64) -> bool {
    *count == 0
}

fn findings<S: Serializer>(findings: &[Finding], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(findings.iter().map(|finding| FindingJson::new(finding, None)))
}

impl RunReport {
    /// Logs of this run, and those that it overwrote. Returns frames and bytes of the run's logs, and the recorder's
    /// last figures.
    pub fn read_card(&mut self, card: &Path, earlier: &EarlierSessions) -> Result<(u64, CardLogs)> {
        let mut frames = 0;
        let mut on_card = CardLogs::default();
        // The counters have the losses.
        let logs = logs::on_card(card);
        if !logs.is_empty() {
            self.overwritten = earlier.overwritten(&logs);
            self.may_overwrite = earlier.is_allowed();
        }
        for log in logs.iter().filter(|log| !earlier.has(log)) {
            let overview = Overview::of(log)?;
            frames += overview.contents.frames();
            let summary = &overview.ending.summary;
            on_card.frames_missing += summary.frames_missing + summary.gaps_uncounted;
            on_card.bytes += overview.log_bytes();
            on_card.stats = overview.contents.stats.or(on_card.stats);
            self.log_files.extend(log.files.iter().cloned());
            self.usage =
                overview.contents.usage.iter().map(|(name, value)| (name.clone(), (*value).into())).collect();
            self.findings.extend(overview.contents.findings);
        }
        Ok((frames, on_card))
    }

    /// A deliberate power cut is no loss.
    pub fn print(&self, json: bool, quiet: bool) -> Result<Outcome> {
        if json {
            output::json(SCHEMA, self)?;
        } else if quiet {
            output::aside(&self.text());
        } else {
            output::line(&self.text())?;
        }
        if self.card_full {
            note!(
                "the card is full, and earlier sessions were kept: name another image, or add --overwrite-oldest"
            );
        }
        if !self.overwritten.is_empty() {
            note!(
                "the card had no room: earlier sessions were overwritten, in whole or in part: {}",
                self.overwritten.join(", ")
            );
        }
        Ok(Outcome::lossy(self.frames_lost > 0 || !self.overwritten.is_empty() && !self.may_overwrite))
    }

    /// A remark about an input without any frame.
    pub fn remark(&self, input: &Endpoint) -> Option<String> {
        (self.bytes_in > 0 && self.frames_in == 0).then(|| {
            format!(
                "{input}: not one MAVLink frame was in {} bytes; is it a recording of MAVLink?",
                self.bytes_in
            )
        })
    }

    fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "frames   {} in, {} logged, {} lost",
            self.frames_in, self.frames_logged, self.frames_lost
        );
        let _ = writeln!(text, "bytes    {} in, {} of no frame", self.bytes_in, self.bytes_not_frames);
        let _ = writeln!(
            text,
            "card     {} of log, {} written",
            count(self.bytes_logged, "byte"),
            count(self.blocks_written, "block")
        );
        let (most, capacity) = (self.queue_bytes_max, self.queue_bytes_capacity);
        let _ = writeln!(
            text,
            "queue    {most} of {capacity} bytes at most; card slowest {} ms",
            self.sd_stall_ms_max
        );
        let (frames, bytes) = (count(self.gs_frames, "frame"), count(self.gs_bytes, "byte"));
        let _ = writeln!(text, "ground   {frames}, {bytes}");
        if self.power_cut {
            let _ = writeln!(text, "power    was cut, as asked");
        }
        for finding in &self.findings {
            let level = if finding.is_unjudged() { "ended" } else { finding.level.name() };
            let (at, subsystem, check) = (moment(finding.at), finding.subsystem.name(), &finding.check);
            let name = finding.name();
            let _ = writeln!(text, "finding  {at:>9}  {level:<8}  {subsystem}: {name} [{check}]");
        }
        if self.findings_left_out > 0 {
            let _ = writeln!(text, "finding  and {} more, which the log has", self.findings_left_out);
        }
        for (name, value) in &self.usage {
            let _ = writeln!(text, "usage    {name:<24} {:>12.3}", value.as_f64().unwrap_or_default());
        }
        let _ = write!(text, "files    {}", self.log_files.join(", "));
        text
    }
}
