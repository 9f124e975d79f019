//! A group's entries, encoded in each requested format by many threads at once.

use hums_blackbox::{Gap, Record};
use hums_core::clock::Instant;
use hums_link::Frame;

use super::checked::FindingCount;
use super::context::Context;
use super::format::{Entry, GroupEncoder};
use super::record::{gap_row, rows};
use super::row::Row;
use super::story::{HeldObservation, Story, StoryEntry};
use crate::mavlink::values::Payload;
use crate::source::item::Item;
use crate::source::parts::ItemCollector;
use crate::source::told::Finding;

/// One group in each format.
pub struct CollectedGroup<'a> {
    context: &'a Context,
    /// By format.
    pub parts: Vec<Box<dyn GroupEncoder>>,
    /// For outputs that are made in order.
    pub story: Story,
    /// Frames written.
    pub frames: u64,
    /// Records written.
    pub records: u64,
    /// Findings of the log's own monitor, wanted or not.
    pub on_board: FindingCount,
    /// Rows of tables without room for their names.
    pub rows_left_out: u64,
}

impl<'a> CollectedGroup<'a> {
    /// Empty.
    pub fn new(context: &'a Context) -> Self {
        Self {
            context,
            parts: context.formats.parts(),
            story: Story::default(),
            frames: 0,
            records: 0,
            on_board: FindingCount::default(),
            rows_left_out: 0,
        }
    }

    fn frame(&mut self, at: Instant, frame: &Frame<'_>) {
        if !self.context.selection.has_id(frame.id()) {
            return;
        }
        self.frames += 1;
        let (known, utc_us) = (Payload::of(frame), self.context.epochs.utc_us(at));
        let entry = Entry { at, utc_us, frame, known: known.as_ref() };
        self.parts.iter_mut().for_each(|part| part.frame(self.context, &entry));
    }

    /// Adds rows of the monitor's own.
    pub fn rows(&mut self, at: Instant, rows: &[Row]) {
        for row in rows {
            self.records += 1;
            self.parts.iter_mut().for_each(|part| part.row(self.context, at, row));
        }
    }

    /// Adds a finding, besides its row.
    pub fn finding(&mut self, finding: &Finding) {
        self.parts.iter_mut().for_each(|part| part.finding(self.context, finding));
    }

    /// Adds a gap.
    pub fn gap(&mut self, gap: &Gap) {
        let from = gap.from.unwrap_or(Instant::ZERO);
        if self.context.selection.overlaps(gap, &self.context.epochs) {
            self.rows(from, &[gap_row(gap)]);
        }
    }
}

impl ItemCollector for CollectedGroup<'_> {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        // Always: later items depend on the vehicle's earlier state.
        if let Item::Observation(source, observation) = item {
            self.story.observed.push(HeldObservation { at, source, observation: *observation });
        }
        if !self.context.selection.has_time(at, &self.context.epochs) {
            return;
        }
        match item {
            Item::Frame(frame) => self.frame(at, frame),
            Item::Row(row) => match self.context.tables.row(row) {
                Some(row) => self.rows(at, &[row]),
                None => self.rows_left_out += 1,
            },
            Item::Record(record) => {
                if let Record::Finding(finding) = record {
                    self.on_board.add(finding.level);
                    self.finding(&Finding::from(finding));
                }
                self.rows(at, &rows(record));
            }
            // Without need they would only make the parts smaller.
            item if self.context.formats.has_words() => self.story.said.extend(StoryEntry::of(at, &item)),
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        let parts = self.parts.iter().map(|part| part.held_bytes()).sum::<usize>();
        parts + self.story.held_bytes()
    }
}
