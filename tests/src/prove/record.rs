//! Small enough to be compared ten thousand times.

use anyhow::Result;
use hums::logs::Log;
use hums::logs::reader::{EntryCollector, GroupReceiver, LogSummary, read};
use hums_blackbox::{Entry, Gap};

use super::stream::hash;

/// A decoded frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Frame {
    pub(super) at_ms: u64,
    pub(super) hash: u64,
}

#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    pub(super) frames: Vec<Frame>,
    pub(super) groups: Vec<usize>,
    pub(super) gaps: Vec<(usize, Gap)>,
    pub(super) summary: LogSummary,
}

impl Record {
    /// Reads a log.
    pub(super) fn of(log: &Log) -> Result<Self> {
        let mut record = Self::default();
        record.summary = read(log, Group::default, &mut record, |_| {})?;
        Ok(record)
    }
}

#[derive(Default)]
struct Group(Vec<Frame>);

impl EntryCollector for Group {
    fn entry(&mut self, entry: &Entry<'_>) {
        if let Entry::Frame { at, bytes, .. } = entry {
            self.0.push(Frame { at_ms: at.as_millis(), hash: hash(bytes) });
        }
    }

    fn held_bytes(&self) -> usize {
        0
    }
}

impl GroupReceiver<Group> for Record {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        self.gaps.push((self.frames.len(), *gap));
        Ok(())
    }

    fn group(&mut self, group: Group) -> Result<()> {
        self.groups.push(self.frames.len());
        self.frames.extend(group.0);
        Ok(())
    }
}
