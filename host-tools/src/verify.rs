//! `hums info --verify`: each check, its extent and its failures.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use hums_blackbox::record::LossKind;
use serde::Serialize;

use crate::cli;
use crate::colour::{level, warning};
use crate::ending::{
    BlocksJson, EndJson, Ending, SessionBefore, among_words, behind_words, copies_words, made_again_words,
    unprotected_words,
};
use crate::files::Inputs;
use crate::info::each::read_each;
use crate::logs::sessions::Sessions;
use crate::logs::{self, FoundLogs, find::Image};
use crate::loss;
use crate::outcome::Outcome;
use crate::output::{self, JsonList, Schema};
use crate::plural::count;
use crate::printable::{path, word};
use crate::source::find::{besides, not_ours};
use crate::summary::{Contents, Overview};
use crate::table::{Table, left};
use hums_analysis::log_json::images_json;
use hums_analysis::manifest::{Manifest, ReadLog};
use hums_analysis::soundness::Soundness;

const SCHEMA: Schema = Schema::first("hums-info-verify");

/// Runs `hums info --verify`.
pub fn run(args: &cli::Info) -> Result<Outcome> {
    let found = logs::find(&args.inputs, args.salvage).map_err(|error| not_ours(&args.inputs, error))?;
    let read: BTreeSet<PathBuf> = found.paths().map(Path::to_owned).collect();
    let inputs = Inputs::of(&read);
    args.manifest.iter().try_for_each(|to| inputs.refuse(to))?;
    for remark in &found.remarks {
        note!("{remark}");
    }
    let mut ok = !found.is_cut();
    let mut all = Totals::default();
    for folder in args.inputs.iter().filter(|input| input.is_dir()) {
        let (words, is_broken) = besides(folder, &found)?;
        for words in words {
            note!("{words}");
        }
        ok &= !is_broken;
    }
    // Printed as it is made: a folder may have ten thousand logs.
    let begin = || JsonList::begin(SCHEMA, &images_json(&found.images), "logs");
    let mut list = args.json.then(begin).transpose()?;
    for image in &found.images {
        let check = file_system(image);
        all.is_card_damaged |= check.failed > 0;
        if !args.json {
            let rest = image.not_looked_at().map(|words| format!("; {words}")).unwrap_or_default();
            let state = if check.failed > 0 { warning("the file system is damaged") } else { level("ok") };
            print(&format!("Card {}: {state}{rest}", path(&image.path)), &[check], args.verbose)?;
        }
    }
    let mut manifest = Manifest::default();
    manifest.images(&found.images, &args.inputs);
    let failed = verify_each(&found, |overview: &Overview| {
        let log = LogJson::new(overview);
        let (soundness, ending) = (overview.soundness(), Some(&overview.ending));
        let (name, session, copy_of, frames, gaps) = (&overview.ending.name, None, None, 0, 0);
        manifest.log(ReadLog { name, session, frames, gaps, copy_of, soundness, ending, remarks: &[] });
        all.add(overview, log.verdict);
        if let Some(list) = &mut list {
            return list.element(&log);
        }
        print_log(&log, overview, args.verbose)
    })?;
    if !ok || failed > 0 {
        all.worst = Verdict::NotProved;
    }
    let ok = all.worst != Verdict::NotProved && !all.is_damage() && !all.is_card_damaged;
    if let Some(list) = list {
        list.end_with("ok", &ok)?;
    } else {
        let words = all.words(found.has_passed_over());
        output::line(&format!("{}: {words}", count(all.logs, "session")))?;
    }
    if let Some(to) = &args.manifest {
        manifest.write(cli::PROGRAM, to, &args.inputs, &read, &BTreeSet::new(), &inputs)?;
    }
    if failed > 0 {
        bail!("{failed} of {} could not be read", count(found.logs.len() as u64, "log"));
    }
    Ok(Outcome::lossy(!ok))
}

#[derive(Default)]
struct Totals {
    logs: u64,
    worst: Verdict,
    soundness: Soundness,
    /// Sectors that were rebuilt, and missing ones with parity: a card is damaged, and no frame is lost.
    made_again: u64,
    unprotected: u64,
    without_earlier: Option<String>,
    is_card_damaged: bool,
}

impl Totals {
    fn add(&mut self, overview: &Overview, verdict: Verdict) {
        let ending = &overview.ending;
        self.worst = self.worst.max(verdict);
        self.soundness = self.soundness.max(overview.soundness());
        self.made_again += ending.made_again();
        self.unprotected += ending.unprotected();
        self.logs += u64::from(ending.is_counted());
        if ending.is_without_earlier() {
            self.without_earlier.get_or_insert_with(|| ending.name.clone());
        }
    }

    /// Lost by a card.
    const fn is_damage(&self) -> bool {
        self.made_again + self.unprotected > 0
    }

    fn words(&self, has_passed_over: bool) -> String {
        let all = self.without_earlier.is_none() && !has_passed_over;
        let words = match (self.worst, self.is_damage(), all) {
            (Verdict::Holds, false, true) if !self.is_card_damaged => "everything holds",
            (Verdict::Holds, false, true) => "all that was found holds",
            (Verdict::Holds, false, false) => "all that was read holds",
            (Verdict::Holds, true, true) => "nothing is lost",
            (Verdict::Holds, true, false) => "nothing is lost of what was read",
            (Verdict::ToMark, ..) => "whole to the last end marks; what came after them cannot be proved",
            (Verdict::NotProved, ..) if self.soundness >= Soundness::NotProved => self.soundness.words(),
            // A failed check of a card, or an unreadable log, is in no log's state.
            (Verdict::NotProved, ..) => "a check failed or a log could not be read: see above",
        };
        let earlier = self.without_earlier.as_ref();
        let damage = "the file system is damaged".to_owned();
        let more = [
            self.is_card_damaged.then_some(damage),
            made_again_words(self.made_again),
            unprotected_words(self.unprotected),
            earlier.map(|first| format!("the logs before {} were not read", word(first))),
            has_passed_over.then(|| "what was passed over was not read".to_owned()),
        ];
        let parts = [words.to_owned()].into_iter().chain(more.into_iter().flatten());
        parts.collect::<Vec<_>>().join("; ")
    }
}

/// Hands each log on in order. Returns the number of unreadable ones, which are reported.
pub fn verify_each(found: &FoundLogs, done: impl FnMut(&Overview) -> Result<()>) -> Result<u64> {
    let named = found.logs.iter().map(|log| (log.name.as_str(), log));
    read_each(&found.logs, Sessions::of(named), Overview::verified, false, done)
}

/// A log's verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Nothing is missing, nor at its end.
    #[default]
    Holds,
    /// Up to the last end mark; the rest as far as it goes.
    ToMark,
    /// A check failed, or no proof of a landing, disarming or orderly end.
    NotProved,
}

/// Needs [`Overview::verified`]; never good with rebuilt sectors.
pub fn verdict(log: &Overview) -> Verdict {
    let log = LogJson::new(log);
    if log.ok { log.verdict } else { Verdict::NotProved }
}

const INTACT: &str = "sectors intact";

/// Failed checks with reasons; needs [`Overview::verified`].
pub fn failed(log: &Overview) -> Vec<(&'static str, String)> {
    let judged = LogJson::new(log);
    let failed = judged.checks.into_iter().filter(|check| check.failed > 0);
    let mut failed: Vec<_> = failed
        .map(|check| match check.detail.as_str() {
            "" => (check.name, format!("{} failed", check.failed)),
            detail => (check.name, format!("{} failed; {detail}", check.failed)),
        })
        .collect();
    if failed.is_empty() && !judged.ok {
        failed.push(("log", log.faults().join("; ")));
    }
    failed
}

fn print_log(log: &LogJson, overview: &Overview, verbose: bool) -> Result<()> {
    let (ending, lacks) = (&overview.ending, overview.soundness().words());
    let files = ending.files.join(", ");
    let state = if lacks.is_empty() { level("ok") } else { warning(lacks) };
    let (sectors, frames) = (ending.summary.blocks.sectors, overview.contents.frames());
    let of = format!("{}, {}", count(sectors, "sector"), count(frames, "frame"));
    let end = if lacks.is_empty() { format!("; {}", ending.words()) } else { String::new() };
    let head = format!("Session {} ({}): {state}; {of}{end}", word(&log.name), word(&files));
    print(&head, &log.checks, verbose)?;
    for words in came_damaged(&overview.contents).into_iter().chain(ending.aside()) {
        output::line(&format!("  {}", word(&words)))?;
    }
    Ok(())
}

/// The failed checks, or all of them if `verbose`.
fn print(head: &str, checks: &[Check], verbose: bool) -> Result<()> {
    output::line(head)?;
    let mut table = Table::new(2, [left(6), left(17), left(0)]);
    for Check { name, checked, failed, detail } in checks.iter().filter(|check| verbose || check.failed > 0) {
        let verdict = level(match *name {
            _ if *failed == 0 => "ok",
            INTACT => "rebuilt",
            _ => "FAILED",
        });
        let detail = if detail.is_empty() { String::new() } else { format!("; {detail}") };
        let words = format!("{checked} checked, {failed} failed{detail}");
        table.row([verdict.to_string(), (*name).to_owned(), words]);
    }
    let text = table.text();
    if text.is_empty() { Ok(()) } else { output::line(&text) }
}

#[derive(Debug, Serialize)]
struct LogJson {
    name: String,
    /// All checks hold, and the log is complete at least to its last end mark.
    ok: bool,
    /// The log ended in order.
    closed: bool,
    /// The original, if the log is a copy.
    copy_of: Option<String>,
    /// Sectors outside of any file: deleted, without a name, or partly overwritten.
    left_over: bool,
    end: EndJson,
    blocks: BlocksJson,
    checks: Vec<Check>,
    #[serde(skip)]
    verdict: Verdict,
}

#[derive(Debug, Serialize)]
struct Check {
    name: &'static str,
    /// Number of checked things.
    checked: u64,
    /// Number of failed things.
    failed: u64,
    detail: String,
}

fn file_system(image: &Image) -> Check {
    let mut detail = image.damage.clone();
    detail.extend(image.lost_words());
    Check { name: "file system", checked: 1, failed: image.damage.len() as u64, detail: detail.join("; ") }
}

impl LogJson {
    fn new(log: &Overview) -> Self {
        let (ending, contents) = (&log.ending, &log.contents);
        let summary = &ending.summary;
        let (blocks, lost) = (summary.blocks, summary.marks.lost);
        let check = |name, checked, failed, detail: String| Check { name, checked, failed, detail };
        let unverified: u64 = contents
            .messages
            .iter()
            .filter(|message| matches!(message.id, Some((_, false))))
            .map(|message| message.amount.count)
            .sum::<u64>()
            + contents.other_messages.count;
        let gaps = || contents.gaps.iter();
        // Unknown numbers count as one.
        let missing: u64 = gaps().map(|gap| u64::from(loss::sectors_lost(gap).unwrap_or(1))).sum();
        let useless: u64 = gaps().map(|gap| u64::from(gap.sectors_skipped)).sum();
        let frames_missing = summary.frames_missing + summary.gaps_uncounted;
        let uncounted = match summary.gaps_uncounted {
            0 => String::new(),
            gaps => format!("{} of which nothing tells how many: one each at least", count(gaps, "gap")),
        };
        let mut checks = vec![
            check("sector checksums", blocks.sectors + blocks.damaged, blocks.damaged, String::new()),
            check("sector sequence", blocks.sectors, missing, gaps_detail(log)),
            check("group decoding", summary.groups, useless, newer(log)),
            check("frames complete", contents.frames(), contents.not_frames, String::new()),
            check(
                "frame checksums",
                contents.frames() - unverified,
                contents.bad_frames,
                format!(
                    "{unverified} frames of definitions that the monitor does not know are kept as they came"
                ),
            ),
            check("frames missing", contents.frames() + frames_missing, frames_missing, uncounted),
            check(
                "times in order",
                contents.frames() + contents.records,
                summary.entries_fell + summary.times_fell,
                String::new(),
            ),
            check("recorder losses", contents.frames() + lost, lost, losses_detail(log)),
        ];
        checks.extend(ends(log));
        let copy_of = ending.again.clone();
        let is_told_only = ending.aside().is_some();
        if is_told_only {
            checks = beside_copy(ending);
        }
        let holds = checks.iter().all(|check| check.failed == 0) && ending.unproved().is_empty();
        let verdict = match (holds, ending.proof.is_whole() || is_told_only) {
            (true, true) => Verdict::Holds,
            (true, false) => Verdict::ToMark,
            (false, _) => Verdict::NotProved,
        };
        let weakened = weakened(log);
        let ok = holds && weakened.iter().all(|check| check.failed == 0);
        checks.extend(weakened);
        let end = EndJson::new(ending);
        let blocks = BlocksJson::new(&blocks);
        let (name, closed) = (ending.name.clone(), summary.closed);
        Self { name, ok, closed, copy_of, left_over: ending.left_over, end, blocks, checks, verdict }
    }
}

fn beside_copy(ending: &Ending) -> Vec<Check> {
    let (besides, files) = (ending.besides(), ending.files.len() as u64);
    let check =
        Check { name: "files", checked: files, failed: besides.len() as u64, detail: besides.join("; ") };
    Some(check).filter(|check| check.failed > 0).into_iter().collect()
}

fn weakened(log: &Overview) -> Vec<Check> {
    let (ending, summary) = (&log.ending, &log.ending.summary);
    let check = |name, checked, failed, words: &str| Check {
        name,
        checked,
        failed,
        detail: if failed > 0 { words.to_owned() } else { String::new() },
    };
    let sectors = summary.blocks.sectors;
    let intact = check(INTACT, sectors, ending.made_again(), "made again from parity, without a loss");
    if ending.aside().is_some() {
        return Some(intact).filter(|intact| intact.failed > 0).into_iter().collect();
    }
    let words = "parity is missing: what the card loses of these files cannot be made again";
    // A log packed on a PC has no parity.
    let written = if summary.marks.has_boot { summary.parity.written } else { 0 };
    vec![intact, check("sectors protected", written, ending.unprotected(), words)]
}

fn ends(log: &Overview) -> [Check; 7] {
    let ending = &log.ending;
    let summary = &ending.summary;
    let blocks = &summary.blocks;
    let check = |name, checked, failed, detail: String| Check { name, checked, failed, detail };
    let behind = match behind_words(&summary.behind) {
        words if words.is_empty() => "nothing behind its last sector".to_owned(),
        words => format!("behind its last sector: {words}"),
    };
    let among = among_words(summary);
    let among = if among.is_empty() { among } else { format!("; before it: {among}") };
    let (before_checked, before_failed, before) = match ending.before {
        SessionBefore::NotNamed => (0, 0, "it names none".to_owned()),
        SessionBefore::NotLookedFor(number) => {
            (0, 0, format!("session {number:05} is not among what was read"))
        }
        SessionBefore::There => (1, 0, String::new()),
        SessionBefore::Gone(_) => (1, 1, ending.before.gone().unwrap_or_default()),
    };
    let strange = ending.strange();
    let holds = ending.proof.holds() && ending.noise().is_none();
    let parity = &summary.parity;
    [
        check("parity", parity.columns, parity.contradicted, ending.contradicted().unwrap_or_default()),
        check("sector places", blocks.sectors + blocks.misplaced, blocks.misplaced, copies_words(blocks)),
        check("files", ending.files.len() as u64, strange.len() as u64, strange.join("; ")),
        check("chain", summary.groups, summary.unchained, String::new()),
        check("end marks", summary.marks.count, summary.marks.wrong, String::new()),
        check("end", 1, u64::from(!holds), format!("{}; {behind}{among}", ending.words())),
        check("session before", before_checked, before_failed, before),
    ]
}

fn gaps_detail(log: &Overview) -> String {
    match log.ending.summary.gaps {
        0 => String::new(),
        gaps => count(gaps, "gap"),
    }
}

fn newer(log: &Overview) -> String {
    let blocks = &log.ending.summary.blocks;
    if blocks.newer_version > 0 {
        let newer = count(blocks.newer_version, "sector");
        return format!("{newer} of a newer format version, or sealed: take a newer hums");
    }
    if blocks.older_version > 0 {
        return format!("{} of an older format version", count(blocks.older_version, "sector"));
    }
    if log.needs_newer_program() { "some need a newer hums".to_owned() } else { String::new() }
}

/// Input in no log, so it does not count against it.
fn came_damaged(contents: &Contents) -> Option<String> {
    let of =
        |what: LossKind| contents.losses.get(what.name()).map(|loss| loss.count).filter(|count| *count > 0);
    let frames = of(LossKind::DamagedFrames).map(|frames| count(frames, "damaged frame"));
    let bytes = of(LossKind::NotFrames).map(|bytes| format!("{} of no frame", count(bytes, "byte")));
    let what = frames.into_iter().chain(bytes).collect::<Vec<_>>().join(" and ");
    (!what.is_empty()).then(|| {
        format!("besides {what} came over the line, before the recorder: no damage of the log (hums info says when)")
    })
}

fn losses_detail(log: &Overview) -> String {
    log.contents.losses.values().map(loss::told).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use hums_blackbox::Sector;

    use super::*;

    #[test]
    fn logs_that_lost_nothing_do_not_name_what_failed() {
        let totals = |soundness| {
            let (worst, without_earlier, is_card_damaged) = (Verdict::NotProved, None, false);
            let (made_again, unprotected) = (0, 0);
            Totals { logs: 1, worst, soundness, made_again, unprotected, without_earlier, is_card_damaged }
        };
        let found = Totals { worst: Verdict::Holds, is_card_damaged: true, ..totals(Soundness::Whole) };
        assert_eq!(found.words(false), "all that was found holds; the file system is damaged");
        let words = |soundness| totals(soundness).words(false);
        for soundness in [Soundness::Whole, Soundness::Repaired, Soundness::Unprotected] {
            assert_eq!(words(soundness), "a check failed or a log could not be read: see above");
        }
        for soundness in [Soundness::NotProved, Soundness::NotFrames, Soundness::Lossy, Soundness::Damaged] {
            assert_eq!(words(soundness), soundness.words());
        }
    }

    #[test]
    fn a_log_that_cannot_be_read_keeps_no_other_from_being_read() {
        let dir = tempfile::tempdir().expect("a folder");
        for name in ["00001_00.HUM", "00002_00.HUM", "00003_00.HUM"] {
            let mut bytes = [0; 512];
            bytes[..2].copy_from_slice(&[0x48, 0xb3]);
            let mut sector = Sector::from_bytes(bytes);
            sector.seal(7);
            fs::write(dir.path().join(name), sector.bytes()).expect("room");
        }
        let found = logs::find(&[dir.path().to_owned()], false).expect("three logs");
        fs::remove_file(dir.path().join("00002_00.HUM")).expect("it is there");
        let mut names = Vec::new();
        let done = |log: &Overview| {
            names.push(log.ending.name.clone());
            Ok(())
        };
        assert_eq!(verify_each(&found, done).expect("two logs"), 1);
        assert_eq!(names, ["00001", "00003"]);
    }
}
