//! `hums box report`: what a maintainer needs about a box, without where and who.
//!
//! The records of `KEPT`, from a card, a log or the newest log of a box on a link. Other records have places, vehicles or
//! persons. Texts pass the rules of `hums share`.

use std::collections::{BTreeMap, VecDeque};
use std::io::Write as _;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::Record;
use hums_core::clock::Instant;
use serde::Serialize;
use serde_json::Value;

use super::{Client, pull};
use crate::cli::{self, Link};
use crate::decode::{record, share};
use crate::files::{Inputs, Output, settle};
use crate::logs::Log;
use crate::outcome::Outcome;
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable;
use crate::source::find::{FoundRecordings, find};
use crate::source::item::Item;
use crate::summary::Overview;

const SCHEMA: Schema = Schema::first("hums-box-report");
const KEPT: [(&str, usize); 6] = [
    ("HUMS_BOOT", 100),
    ("HUMS_FAULT", 100),
    ("HUMS_LOSS", 500),
    ("HUMS_NOTE", 500),
    ("HUMS_PARAM", 800),
    ("HUMS_STATS", 1),
];
const LOGS_MAX: usize = 20;

#[derive(Debug, Serialize)]
struct ReportJson {
    /// Version and commit of `hums`.
    program: &'static str,
    /// For the owner: what was tried, and what happened.
    remarks: &'static str,
    /// The newest last.
    logs: Vec<LogJson>,
}

#[derive(Debug, Default, Serialize)]
struct LogJson {
    /// Number on the card.
    name: String,
    /// The missing part of the log; empty for a whole one.
    lacks: &'static str,
    /// In order of time.
    records: Vec<RecordJson>,
    /// Texts that may name a place or a person.
    texts_removed: u64,
    /// Older records beyond the limit of their table.
    records_left_out: u64,
}

#[derive(Debug, Serialize)]
struct RecordJson {
    /// Time.
    time_s: f64,
    /// Table, as in `--format jsonl`.
    record: &'static str,
    /// Its columns.
    fields: Value,
}

/// Runs `hums box report`.
pub fn run(args: &cli::BoxReport) -> Result<Outcome> {
    let found = if args.inputs.is_empty() { None } else { Some(find(&args.inputs, false)?) };
    let inputs = Inputs::of(found.iter().flat_map(FoundRecordings::paths)).forcing(args.force);
    inputs.refuse(&args.output)?;
    let mut logs = Vec::new();
    if let Some(found) = &found {
        found.tell();
        let all: Vec<&Log> = found.places.iter().filter_map(|place| place.own()).collect();
        if all.is_empty() {
            bail!("no log of a HUMS box is in there; name a card, an image or a log");
        }
        for log in all.get(all.len().saturating_sub(LOGS_MAX)..).unwrap_or_default() {
            logs.push(LogJson::of(log)?);
        }
    }
    if let Some(link) = &args.link {
        let at = Link { link: link.clone(), key: None, system: args.system, json: true };
        let newest = pull::newest(Client::connect(&at)?, pull::WHOLE_GROUP, |newest| {
            let pieces = newest.begin.pieces.iter().chain(&newest.end.pieces).cloned().collect();
            LogJson::of(&Log { pieces, ..newest.end.clone() })
        })?;
        logs.push(newest.context("the box has no log with data: is a card in its slot?")?);
    }
    let records: u64 = logs.iter().map(|log| log.records.len() as u64).sum();
    let remarks = "what was tried, on which board and autopilot, and what happened:";
    let report = output::json_text(SCHEMA, &ReportJson { program: cli::PROGRAM, remarks, logs })?;
    let mut file = Output::create(&args.output, &inputs)?;
    settle(file.write_all(printable::json(&report).as_bytes()), &args.output)?;
    file.finish()?;
    let path = args.output.display();
    output::line(&format!(
        "{path}: {}; read it, add what happened, and attach it",
        count(records, "record")
    ))?;
    Ok(Outcome::Done)
}

impl LogJson {
    fn of(log: &Log) -> Result<Self> {
        let name = log.name.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
        let mut this = Self { name, ..Self::default() };
        let mut kept = BTreeMap::new();
        let rules = share::TextRules::default();
        let overview = Overview::told(log, None, &mut |at, item| {
            if let Item::Record(record) = item {
                this.take(at, record, &rules, &mut kept);
            }
            Ok(())
        })?;
        this.records = kept.into_values().flatten().collect();
        this.records.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        this.lacks = overview.soundness().words();
        Ok(this)
    }

    fn take(
        &mut self,
        at: Instant,
        record: &Record<'_>,
        rules: &share::TextRules,
        kept: &mut BTreeMap<&'static str, VecDeque<RecordJson>>,
    ) {
        for row in record::rows(record) {
            let Some((table, max)) = KEPT.iter().find(|(table, _)| *table == row.table) else { continue };
            if matches!(record, Record::Note(note) if !rules.keeps(note.text)) {
                self.texts_removed += 1;
                continue;
            }
            let mut fields = Vec::new();
            row.push_json_object(&mut fields);
            let fields = serde_json::from_slice(&fields).unwrap_or_default();
            let records = kept.entry(table).or_default();
            records.push_back(RecordJson { time_s: at.as_secs_f64(), record: table, fields });
            if records.len() > *max {
                records.pop_front();
                // Earlier figures are in the newest ones.
                self.records_left_out += u64::from(*max > 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use hums_blackbox::record::{Loss, LossKind, Stats};

    use super::*;

    #[test]
    fn each_table_keeps_its_newest_records() {
        let (mut log, mut kept, rules) = (LogJson::default(), BTreeMap::new(), share::TextRules::default());
        let at = Instant::from_millis;
        log.take(at(0), &Record::Stats(Stats::default()), &rules, &mut kept);
        for ms in 1..=502 {
            let loss = Loss { what: LossKind::QueueFull, count: 1, from: at(ms), to: at(ms) };
            log.take(at(ms), &Record::Loss(loss), &rules, &mut kept);
        }
        let losses = &kept["HUMS_LOSS"];
        assert_eq!((losses.len(), losses[0].time_s, losses[499].time_s), (500, 0.003, 0.502));
        assert_eq!((kept["HUMS_STATS"].len(), log.records_left_out), (1, 2));
    }
}
