//! The open files of a log, in all requested formats.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use anyhow::{Result, bail};
use hums_analysis::soundness::Soundness;
use hums_core::clock::Instant;

use super::checked::{Checked, FindingCount};
use super::collect::CollectedGroup;
use super::context::Context;
use super::destination::Destination;
use super::format::{AnyWriter, Files, Finished, Totals, Way};
use super::story::StoryEntry;
use crate::outcome::ExistingOutput;
use crate::plural::count;
use crate::source::item;
use crate::source::parts::PartReceiver;

/// The open files of one log.
pub struct Writers<'a> {
    context: &'a Context,
    files: Vec<Box<dyn AnyWriter>>,
    /// Texts and parameters of a log of ours, whose parts have none.
    said: Rc<RefCell<Vec<StoryEntry>>>,
    frames: u64,
    records: u64,
    on_board: FindingCount,
    rows_left_out: u64,
    /// The state of the recording, by its gaps.
    lacks: Soundness,
    /// The vehicle's name.
    pub vehicle: String,
}

impl<'a> Writers<'a> {
    /// Opens the files that are always written; a table is opened for its first row. `fleet` is the folder of the tables of
    /// all sessions. The error is no [`ExistingOutput`] if only some of the outputs exist: the log must not be skipped.
    pub fn new(context: &'a Context, destination: &Destination, fleet: &Path) -> Result<Self> {
        let (mut files, mut existing) = (Vec::new(), None);
        for (about, way) in context.formats.ways() {
            let Way::Parts { open, .. } = way else { continue };
            let path = match about.files {
                Files::Fleet(_) => fleet.to_owned(),
                files => destination.path(files).unwrap_or_else(|| PathBuf::from("-")),
            };
            match open(context, &path) {
                Ok(file) => files.push(file),
                Err(error) if error.is::<ExistingOutput>() => existing = Some(error),
                Err(error) => return Err(error),
            }
        }
        match existing {
            Some(error) if files.is_empty() => return Err(error),
            Some(error) => bail!("{error:#}; other outputs of this log are missing"),
            None => {}
        }
        Ok(Self {
            context,
            files,
            said: Rc::default(),
            frames: 0,
            records: 0,
            on_board: FindingCount::default(),
            rows_left_out: 0,
            lacks: Soundness::Whole,
            vehicle: context.identity.vehicle.clone(),
        })
    }

    /// The place for texts and parameters that are read in order, beside the parts.
    pub fn said(&self) -> Rc<RefCell<Vec<StoryEntry>>> {
        self.said.clone()
    }

    /// The log was read up to this time. Writes its checker, and this program's findings, from an earlier
    /// reading or this one. Returns the reason if it was not checked, as a part of a sentence.
    pub fn checked(
        &mut self,
        last: Option<Instant>,
        checked: Option<&Checked>,
    ) -> Result<Option<&'static str>> {
        let context = self.context;
        let checked = context.checked.as_ref().or(checked);
        if !context.formats.has_records() {
            return Ok(None);
        }
        let mut collected = CollectedGroup::new(context);
        for (finding, row) in checked.iter().flat_map(|checked| checked.rows()) {
            if context.selection.has_time(finding.at, &context.epochs) {
                collected.rows(finding.at, &[row]);
                collected.finding(finding);
            }
        }
        let is_wanted = |at| context.selection.has_time(at, &context.epochs);
        let part: Option<&dyn Fn(Instant) -> bool> =
            if context.selection.has_limits() { Some(&is_wanted) } else { None };
        let row = checked.map_or_else(|| self.on_board.row(), |checked| checked.row(part));
        collected.rows(last.unwrap_or(Instant::ZERO), &[row]);
        self.put(collected)?;
        Ok(checked.and_then(Checked::not_checked))
    }

    fn put(&mut self, mut collected: CollectedGroup<'_>) -> Result<()> {
        self.frames += collected.frames;
        self.records += collected.records;
        self.on_board.and(collected.on_board);
        self.rows_left_out += collected.rows_left_out;
        collected.story.said.append(&mut self.said.borrow_mut());
        for (writer, part) in self.files.iter_mut().zip(collected.parts) {
            writer.part(self.context, part, &collected.story)?;
        }
        Ok(())
    }

    /// Whether only the beginnings of files were written.
    pub fn is_empty(&self) -> bool {
        let has_records = self.context.formats.has_records() && self.records > 0;
        self.frames == 0 && !has_records && self.files.iter().all(|writer| writer.is_empty())
    }

    /// The state of the recording, by its gaps.
    pub fn lacks(&self) -> Soundness {
        self.lacks
    }

    /// Rows that were left out.
    pub fn rows_left_out(&self) -> u64 {
        self.rows_left_out
    }

    /// The log is complete: the files get their names. Returns the outputs.
    pub fn finish(self) -> Result<Finished> {
        let totals = Totals { frames: self.frames, records: self.records, vehicle: self.vehicle };
        let mut all = Finished::default();
        if self.rows_left_out > 0 {
            let rows = count(self.rows_left_out, "row");
            all.remarks.push(format!(
                "{rows} left out: the names of its tables take more room than any autopilot's"
            ));
        }
        // Made of quantities: a reader may expect more in it.
        let about = self.context.formats.about().filter(|about| about.has_observations);
        for about in about.filter(|about| !about.omits.is_empty()) {
            all.remarks.push(format!("{} cannot hold {}", about.name, about.omits));
        }
        for writer in self.files {
            let Finished { made, remarks } = writer.finish(self.context, totals.clone())?;
            all.made.extend(made);
            all.remarks.extend(remarks);
        }
        Ok(all)
    }
}

impl<'a> PartReceiver<CollectedGroup<'a>> for Writers<'a> {
    fn gap(&mut self, gap: &item::Gap) -> Result<()> {
        self.lacks = self.lacks.max(Soundness::of_gap(gap));
        let gap = &gap.to_own();
        let mut collected = CollectedGroup::new(self.context);
        collected.gap(gap);
        for writer in &mut self.files {
            writer.gap(self.context, gap)?;
        }
        self.put(collected)
    }

    fn part(&mut self, collected: CollectedGroup<'a>) -> Result<()> {
        self.put(collected)
    }
}
