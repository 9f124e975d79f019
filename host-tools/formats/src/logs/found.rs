//! Found logs and passed-over entries, in bounded lists.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::places::Log;
use crate::files::FileId;
use crate::plural::count;

/// Each takes some hundred bytes. 32 GB have room for 4,096 full segments.
pub(super) const LOGS_MAX: usize = 10_000;
/// Kept remarks.
pub const REMARKS_MAX: usize = 20;
/// Files and images distinguished by file numbers.
const SEEN_MAX: usize = 200_000;
/// Result of a search.
#[derive(Clone, Debug, Default)]
pub struct FoundLogs {
    /// The logs, oldest session first.
    pub logs: Vec<Log>,
    /// One for each image.
    pub images: Vec<Image>,
    /// The first [`REMARKS_MAX`], then one that counts the others.
    pub remarks: Vec<String>,
    remarks_more: u64,
    pub(super) repeats: u64,
    pub(super) logs_more: u64,
    /// There were too many files or folders.
    left_out: bool,
    /// A link, a pipe or an incomplete file.
    passed_over: bool,
    /// Files by device and number: two names of a file are one log.
    seen: BTreeSet<FileId>,
}

impl FoundLogs {
    pub(super) fn remark(&mut self, sentence: String) {
        if self.remarks.len() < REMARKS_MAX {
            self.remarks.push(sentence);
        } else {
            self.remarks_more += 1;
        }
    }

    pub(super) fn pass_over(&mut self, sentence: String) {
        self.passed_over = true;
        self.remark(sentence);
    }

    /// No room, and it may hold a log.
    pub(super) fn leave_out(&mut self, sentence: String) {
        self.left_out = true;
        self.remark(sentence);
    }

    pub(super) fn log(&mut self, log: Log) {
        if self.logs.len() < LOGS_MAX {
            self.logs.push(log);
        } else {
            self.logs_more += 1;
        }
    }

    pub(super) fn add(&mut self, logs: impl IntoIterator<Item = Log>) {
        logs.into_iter().for_each(|log| self.log(log));
    }

    /// Met before, under any name. False without file numbers.
    pub(super) fn is_known(&mut self, path: &Path) -> bool {
        let Ok(identity) = FileId::of(path) else { return false };
        let known = self.seen.contains(&identity);
        self.repeats += u64::from(known);
        if self.seen.len() < SEEN_MAX {
            self.seen.insert(identity);
        }
        known
    }

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

    /// An unread entry may be a log.
    pub fn has_passed_over(&self) -> bool {
        self.passed_over
    }

    /// Whether possible logs were left out.
    pub fn is_cut(&self) -> bool {
        self.left_out || self.logs_more > 0
    }
}

/// A card image's file system.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// The file.
    pub path: PathBuf,
    /// Damage, as sentences.
    pub damage: Vec<String>,
    /// Clusters without a file.
    pub lost_clusters: u64,
    /// Every block was searched, because of damage.
    pub scanned: bool,
    /// Every block was looked at.
    pub searched: bool,
    /// Their sectors may still exist.
    pub deleted_logs: u64,
}

impl Image {
    /// A sentence; `None` without any.
    pub fn lost_words(&self) -> Option<String> {
        // Searched before, without a sector of a log.
        let what = if self.damage.is_empty() && !self.scanned { " (lost space, no data)" } else { "" };
        let number = Some(self.lost_clusters).filter(|number| *number > 0)?;
        Some(format!("{}{what}", belong(number)))
    }

    /// A sentence; `None` without any.
    pub fn not_looked_at(&self) -> Option<String> {
        let deleted = match self.deleted_logs {
            0 => String::new(),
            number => format!(", among them those of {}", count(number, "deleted segment")),
        };
        let words = "sectors that no file names were not looked at";
        (!self.searched).then(|| format!("{words}{deleted}: --salvage does"))
    }
}

pub(super) fn belong(clusters: u64) -> String {
    let verb = if clusters == 1 { "belongs" } else { "belong" };
    format!("{} {verb} to no file", count(clusters, "cluster"))
}
