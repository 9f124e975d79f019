//! Small enough to be compared ten thousand times.

use anyhow::{Result, ensure};
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

    /// Indexes of frames that are not among those that were `read`; all of these are frames of the log, in order.
    pub(super) fn missing(&self, read: &[Frame]) -> Result<Vec<usize>> {
        let (mut missing, mut given) = (Vec::new(), read.iter().peekable());
        for (index, frame) in self.frames.iter().enumerate() {
            if given.next_if_eq(&frame).is_none() {
                missing.push(index);
            }
        }
        ensure!(given.peek().is_none(), "a frame came out that never went in: {:?}", given.peek());
        Ok(missing)
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
