//! Logs found and entries passed over: bounded lists; entries beyond them are counted.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::places::Log;
use crate::files::FileId;
use crate::plural::count;

/// Logs that are kept: each takes some hundred bytes. A card of 32 GB has room for 4,096 full segments.
pub(super) const LOGS_MAX: usize = 10_000;
/// Remarks that are kept.
pub const REMARKS_MAX: usize = 20;
/// Maximum number of log files and images distinguished by their file numbers.
const SEEN_MAX: usize = 200_000;
/// Result of a search.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// The logs, oldest session first.
    pub logs: Vec<Log>,
    /// Facts from the file systems of the images, one entry for each image.
    pub images: Vec<Image>,
    /// Entries passed over, as sentences: the first [`REMARKS_MAX`], then one that counts the others.
    pub remarks: Vec<String>,
    remarks_more: u64,
    /// Files that were found a second time.
    pub(super) repeats: u64,
    /// Logs beyond [`LOGS_MAX`].
    pub(super) logs_more: u64,
    /// Files or folders were not looked into, because there were too many.
    left_out: bool,
    /// An entry of a folder was not read: a link, a pipe, or an incomplete file.
    passed_over: bool,
    /// Files that were looked at, by device and number: one that has two names is one log.
    seen: BTreeSet<FileId>,
}

impl Found {
    /// Something was passed over.
    pub(super) fn remark(&mut self, sentence: String) {
        if self.remarks.len() < REMARKS_MAX {
            self.remarks.push(sentence);
        } else {
            self.remarks_more += 1;
        }
    }

    /// Passes over an entry of a folder; it may be a log.
    pub(super) fn pass_over(&mut self, sentence: String) {
        self.passed_over = true;
        self.remark(sentence);
    }

    /// Something was left out for want of room, and may hold a log.
    pub(super) fn leave_out(&mut self, sentence: String) {
        self.left_out = true;
        self.remark(sentence);
    }

    /// Adds a log, as far as there is room.
    pub(super) fn log(&mut self, log: Log) {
        if self.logs.len() < LOGS_MAX {
            self.logs.push(log);
        } else {
            self.logs_more += 1;
        }
    }

    /// Adds logs, as far as there is room.
    pub(super) fn add(&mut self, logs: impl IntoIterator<Item = Log>) {
        logs.into_iter().for_each(|log| self.log(log));
    }

    /// Whether this file was met before, under this name or another one. Always false if the system has no
    /// file numbers.
    pub(super) fn is_known(&mut self, path: &Path) -> bool {
        let Ok(identity) = FileId::of(path) else { return false };
        let known = self.seen.contains(&identity);
        self.repeats += u64::from(known);
        if self.seen.len() < SEEN_MAX {
            self.seen.insert(identity);
        }
        known
    }

    /// Adds remarks about omitted entries.
    pub(super) fn finish(&mut self) {
        if self.logs_more > 0 {
            self.remarks.push(format!(
                "{} logs beyond {LOGS_MAX} are left out: name fewer files or folders at once",
                self.logs_more
            ));
        }
        if self.remarks_more > 0 {
            self.remarks.push(format!("and {} more were passed over", self.remarks_more));
        }
    }

    /// Whether an entry that may be a log was not read: not damaged, but the result is incomplete.
    pub fn has_passed_over(&self) -> bool {
        self.passed_over
    }

    /// Whether logs, or entries that may hold one, were left out.
    pub fn is_cut(&self) -> bool {
        self.left_out || self.logs_more > 0
    }
}

/// A card image's file system.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// The file.
    pub path: PathBuf,
    /// Damage, as sentences; empty for a sound file system.
    pub damage: Vec<String>,
    /// Clusters that belong to no file.
    pub lost_clusters: u64,
    /// The logs were found by searching every block, because the file system is damaged.
    pub scanned: bool,
    /// Every block was looked at.
    pub searched: bool,
    /// Deleted segments whose sectors may still exist.
    pub deleted_logs: u64,
}

impl Image {
    /// Words about clusters that belong to no file.
    pub fn lost_words(&self) -> Option<String> {
        // In a sound file system they were searched, and hold no sector of a log.
        let what = if self.damage.is_empty() && !self.scanned { " (lost space, no data)" } else { "" };
        let number = Some(self.lost_clusters).filter(|number| *number > 0)?;
        Some(format!("{}{what}", belong(number)))
    }

    /// Words about the blocks that were not searched.
    pub fn not_looked_at(&self) -> Option<String> {
        let deleted = match self.deleted_logs {
            0 => String::new(),
            number => format!(", among them those of {}", count(number, "deleted segment")),
        };
        let words = "sectors that no file names were not looked at";
        (!self.searched).then(|| format!("{words}{deleted}: --salvage does"))
    }
}

/// Words for clusters that belong to no file.
pub(super) fn belong(clusters: u64) -> String {
    let verb = if clusters == 1 { "belongs" } else { "belong" };
    format!("{} {verb} to no file", count(clusters, "cluster"))
}
