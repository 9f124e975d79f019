//! A ground station's log: every frame bit for bit, UTC before it. Gaps are in a table beside it.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;
use hums_blackbox::{Cause, Gap};

use crate::context::Context;
use crate::files::{Output, appended, settle};
use crate::findings::Texts;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, SingleFile, Totals, Writer};
use crate::made::OutputFile;
use crate::plural::count;
use crate::record::gap_row;
use crate::story::Story;

/// The open tlog.
pub(super) struct Tlog {
    file: SingleFile,
    gaps: Option<SingleFile>,
    /// Gaps of a tlog that is not a file and so has no table beside it.
    gaps_left_out: u64,
    texts: Option<Texts>,
    texts_count: u64,
}

#[derive(Default)]
pub(super) struct Records(Vec<u8>);

impl GroupEncoder for Records {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let utc = entry.utc_us.unwrap_or_else(|| entry.at.as_micros());
        self.0.extend_from_slice(&utc.to_be_bytes());
        self.0.extend_from_slice(entry.frame.bytes());
    }

    fn held_bytes(&self) -> usize {
        self.0.len()
    }
}

impl Tlog {
    fn gaps_path(&self) -> Option<PathBuf> {
        self.file.path().map(|path| appended(path, "gaps.csv"))
    }
}

impl Writer for Tlog {
    const ABOUT: FormatDetails = FormatDetails {
        has_records: false,
        is_of_frames: true,
        omits: "the box's records, findings (with `--findings` as texts)",
        ..FormatDetails::new(
            "tlog",
            "A ground station's log: opens in Mission Planner, QGroundControl, MAVProxy, pymavlink",
            Files::One("tlog"),
        )
    };
    type Encoder = Records;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        let texts = Texts::of(context);
        let texts_count = texts.as_ref().map_or(0, Texts::count);
        let tlog =
            Self { file: SingleFile::open(context, path)?, gaps: None, gaps_left_out: 0, texts, texts_count };
        if let Some(path) = tlog.gaps_path() {
            Output::check(&path, &context.inputs)?;
        }
        Ok(tlog)
    }

    fn part(&mut self, _: &Context, part: Records, _: &Story) -> Result<()> {
        match &mut self.texts {
            Some(texts) => self.file.write(&texts.among(&part.0)),
            None => self.file.write(&part.0),
        }
    }

    fn gap(&mut self, context: &Context, gap: &Gap) -> Result<()> {
        if !context.selection.overlaps(gap, &context.epochs) {
            return Ok(());
        }
        let Some(path) = self.gaps_path() else {
            self.gaps_left_out += 1;
            return Ok(());
        };
        let row = gap_row(gap);
        let first = self.gaps.is_none();
        let file = match &mut self.gaps {
            Some(file) => file,
            none => none.insert(SingleFile::open(context, &path)?),
        };
        let mut line = Vec::new();
        if first {
            line.extend_from_slice(gaps_header().as_bytes());
            line.push(b'\n');
        }
        for (place, (_, cell)) in row.cells.iter().enumerate() {
            if place > 0 {
                line.push(b',');
            }
            cell.push_csv(&mut line);
        }
        line.push(b'\n');
        file.write(&line)
    }

    fn finish(mut self, context: &Context, totals: Totals) -> Result<Finished> {
        let mut finished = Finished::default();
        if self.gaps_left_out > 0 {
            let gaps = count(self.gaps_left_out, "gap");
            finished.remarks.push(format!(
                "{gaps} without a table: beside what is no file there is no place for one; name a file"
            ));
        }
        // An empty tlog would look like a log without any messages.
        if totals.frames == 0 && context.selection.is_part() {
            let words = "no frame of what was asked for is in it, so no tlog was written";
            finished.remarks.push(words.to_owned());
            return Ok(finished);
        }
        // Old gaps beside a tlog without gaps would look like its own.
        if let Some(path) = self.gaps_path().filter(|path| self.gaps.is_none() && path.exists()) {
            settle(fs::remove_file(&path), &path)?;
        }
        if let Some(mut texts) = self.texts.take() {
            self.file.write(&texts.rest())?;
        }
        let gaps = self.gaps.map(SingleFile::finish).transpose()?;
        let (frames, findings) = ((totals.frames, "frame"), (self.texts_count, "finding"));
        let counts: &[_] = if self.texts_count > 0 { &[frames, findings] } else { &[frames] };
        finished.made.push(OutputFile::of(self.file.finish()?, "tlog", counts));
        finished.made.extend(gaps.map(|path| OutputFile::with_words(path, "gaps", "gaps".to_owned())));
        Ok(finished)
    }
}

fn gaps_header() -> String {
    let nothing = Gap {
        from: None,
        to: None,
        cause: Cause::Missing,
        sectors_lost: 0,
        sectors_skipped: 0,
        frames: None,
    };
    gap_row(&nothing).cells.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(",")
}
