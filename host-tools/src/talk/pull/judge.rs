//! Verifies the downloaded logs as `hums info --verify` does with their folder, in one reading and by the
//! same function. All of its checks count if all logs of the board were requested.
//!
//! A log that was not requested is not missing. If files of a session were left out, the rest count as logs
//! of their own, without their neighbours.

use std::path::{Path, PathBuf};
use std::slice;

use anyhow::Result;
use serde::Serialize;

use super::session::{Place, place};
use crate::ending::EndJson;
use crate::logs::{self, Log};
use crate::outcome::Outcome;
use crate::plural::count;
use crate::summary::Overview;
use crate::verify::{Extent, failed, rest_of_group, verify_each};

/// A log that came, or was there already.
#[derive(Debug, Serialize)]
pub(super) struct LogJson {
    /// As the board calls it.
    pub(super) name: String,
    pub(super) path: PathBuf,
    /// It was not there already.
    pub(super) is_new: bool,
    /// `hums info --verify` finds no fault with the requested logs of its session that follow each other. The
    /// end of the last one is proved, or was not requested.
    pub(super) whole: bool,
    /// The end of the last one, as far as known.
    pub(super) end: Option<EndJson>,
}

impl LogJson {
    /// The download; the other fields are for [`judge`].
    pub(super) const fn new(name: String, path: PathBuf, is_new: bool) -> Self {
        Self { name, path, is_new, whole: false, end: None }
    }
}

/// The requested logs of a board: some ranges, each from one log to another.
#[derive(Debug)]
pub(super) struct Asked(Vec<(Place, Place)>);

impl Asked {
    /// All from this one to that one.
    pub(super) fn between(first: Place, last: Place) -> Self {
        Self(vec![(first, last)])
    }

    /// These.
    pub(super) fn named(names: &[String]) -> Self {
        Self(names.iter().filter_map(|name| place(name)).map(|place| (place, place)).collect())
    }

    /// Whether this one was.
    pub(super) fn has(&self, wanted: Place) -> bool {
        self.0.iter().any(|(first, last)| (first..=last).contains(&&wanted))
    }

    /// Whether any of a log's files was.
    fn has_log(&self, session: u32) -> bool {
        self.0.iter().any(|(first, last)| (first.session..=last.session).contains(&session))
    }

    /// The part of a session in these files, on a board with these logs.
    fn extent(&self, files: &[String], board: &[Place]) -> Extent {
        let ends = files.first().and_then(|file| place(file)).zip(files.last().and_then(|file| place(file)));
        let Some((first, last)) = ends else { return Extent::ALL };
        let is_left_out = |other: &Place| other.session == last.session && *other > last && !self.has(*other);
        let before = first.segment.checked_sub(1).map(|segment| Place { segment, ..first });
        Extent {
            from_start: before.is_none_or(|before| self.has(before)),
            to_end: !board.iter().any(is_left_out),
            follows: first.session.checked_sub(1).is_none_or(|session| self.has_log(session)),
        }
    }

    /// The files of a log, split at the files that were left out.
    fn parted(&self, log: Log) -> Vec<Log> {
        let Log { name, files, pieces, session, left_over } = log;
        let mut parts: Vec<Log> = Vec::new();
        for (file, piece) in files.into_iter().zip(pieces) {
            let between = |last: &Log| {
                let (before, here) = (place(last.files.last()?)?, place(&file)?);
                let mut between = before.segment + 1..here.segment;
                (!between.is_empty()).then(|| between.any(|segment| self.has(Place { segment, ..here })))
            };
            match parts.last_mut().filter(|last| between(last) != Some(false)) {
                Some(last) => {
                    last.files.push(file);
                    last.pieces.push(piece);
                }
                None => parts.push(Log {
                    name: name.clone(),
                    files: vec![file],
                    pieces: vec![piece],
                    session,
                    left_over,
                }),
            }
        }
        parts
    }
}

/// Judges logs together and prints faults and missing proofs; `board` are the board's logs that are not
/// empty.
pub(super) fn judge(board: &[String], asked: &Asked, pulled: &mut [LogJson]) -> Result<Outcome> {
    let board: Vec<Place> = board.iter().filter_map(|name| place(name)).collect();
    let (mut outcome, mut paths) = (Outcome::Done, Vec::new());
    for log in &*pulled {
        match logs::find(slice::from_ref(&log.path), false) {
            Ok(_) => paths.push(log.path.clone()),
            Err(error) => {
                note!("{error:#}");
                outcome = Outcome::Losses;
            }
        }
    }
    let mut found = logs::find(&paths, false)?;
    for remark in &found.remarks {
        note!("{remark}");
    }
    found.logs = std::mem::take(&mut found.logs).into_iter().flat_map(|log| asked.parted(log)).collect();
    let unread = verify_each(&found, |overview| {
        outcome = outcome.and(tell(overview, asked.extent(&overview.ending.files, &board), pulled));
        Ok(())
    })?;
    Ok(outcome.and(Outcome::lossy(unread > 0)))
}

/// Prints the faults and missing proofs of a log that was read.
fn tell(overview: &Overview, extent: Extent, pulled: &mut [LogJson]) -> Outcome {
    let ending = &overview.ending;
    let failed = failed(overview, extent);
    let rest = rest_of_group(overview, extent);
    let outcome = Outcome::lossy(!failed.is_empty() || rest.is_some());
    let is_of = |log: &&mut LogJson| {
        let mut names = ending.files.iter().map(|file| Path::new(file).file_name());
        names.any(|name| name == log.path.file_name())
    };
    if extent.follows && ending.is_without_earlier() {
        note!("{}: the logs that were recorded before it on this card did not come", ending.name);
    }
    let mut last = None;
    for log in pulled.iter_mut().filter(is_of) {
        log.whole = outcome == Outcome::Done;
        last = Some(log);
    }
    let Some(last) = last else { return outcome };
    if let (Some(sectors), Some(first)) = (rest, ending.files.first()) {
        note!(
            "{first}: begins with the rest of a group, {}, that can be read only with the file before it, which was not asked for",
            count(sectors, "sector")
        );
    }
    for (check, why) in &failed {
        note!("{}: {check}: {why}; `hums info --verify` says more", last.name);
    }
    if extent.to_end {
        last.end = Some(EndJson::new(ending));
        if failed.is_empty() && !ending.proof.is_whole() && ending.aside().is_none() {
            note!("{}: {}", last.name, ending.words());
            last.whole = false;
        }
    }
    outcome
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::compare::heading_here;
    use super::super::tests::packed;
    use super::*;
    use crate::logs::Piece;

    const NAME: &str = "00001_00.HUM";
    const SECTOR: usize = 512;
    const GROUP: usize = 64 * SECTOR;

    /// Judges these bytes as the board's log of this name, which the board has besides others.
    fn judged(bytes: &[u8], name: &str, others: &[&str]) -> (Outcome, bool) {
        let dir = tempfile::tempdir().expect("a folder");
        let came = dir.path().join("came");
        fs::write(&came, bytes).expect("written");
        let own = heading_here(&came, name, bytes.len() as u32).expect("it reads").name;
        let path = dir.path().join(own);
        fs::rename(&came, &path).expect("renamed");
        let all: Vec<String> = [name].iter().chain(others).map(|name| (*name).to_owned()).collect();
        let mut logs = [LogJson::new(name.to_owned(), path, true)];
        let outcome = judge(&all, &Asked::named(&all[..1]), &mut logs).expect("it reads");
        (outcome, logs[0].whole)
    }

    const HOLDS: (Outcome, bool) = (Outcome::Done, true);
    const FAILS: (Outcome, bool) = (Outcome::Losses, false);

    #[test]
    fn a_log_is_whole_where_verify_says_so() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = packed(dir.path(), "px4_hil_quad_low.tlog");
        let cut = &whole[..80 * SECTOR];
        assert_eq!(judged(&whole, NAME, &[]), HOLDS);
        assert_eq!(judged(cut, NAME, &[]), FAILS, "it has no end");
        assert_eq!(judged(&[cut, &[0x5a; 4096]].concat(), NAME, &[]), FAILS);
        assert_eq!(judged(cut, NAME, &["00001_01.HUM"]), HOLDS, "its end is in another one");
        assert_eq!(judged(b"no log at all", NAME, &[]), FAILS);
    }

    #[test]
    fn what_a_recycled_file_held_before_is_no_damage_and_what_is_in_the_middle_is() {
        let dir = tempfile::tempdir().expect("a folder");
        let new = packed(dir.path(), "px4_hil_quad_low.tlog");
        let old = packed(dir.path(), "ap_quad_guided.tlog");
        let first = |bytes: &[u8]| judged(bytes, NAME, &[]);
        assert_eq!(first(&[&new[..], &old[new.len()..]].concat()), HOLDS);
        // A further segment does not begin with the session's first sector; a first one does.
        let further = |bytes: &[u8]| judged(bytes, "00001_01.HUM", &[NAME]);
        assert_eq!(further(&new[2 * GROUP..]), HOLDS);
        assert_eq!(first(&new[2 * GROUP..]), FAILS);
        // A file that begins in the middle of a group: that group can be read only with the file before.
        let middle = 2 * GROUP + 55 * SECTOR;
        assert_eq!(further(&new[middle..]), FAILS);
        let extent = Extent { from_start: false, ..Extent::ALL };
        let read = |bytes: &[u8]| {
            let path = dir.path().join("00001_01.HUM");
            fs::write(&path, bytes).expect("written");
            let log = logs::find(&[path], false).expect("a log").logs.remove(0);
            let overview = Overview::verified(&log).expect("it reads");
            (rest_of_group(&overview, extent), failed(&overview, extent))
        };
        assert_eq!(read(&new[middle..]), (Some(9), Vec::new()), "nothing else is wrong with it");
        // A lost first sector of a group is another matter.
        let mut lost = new[2 * GROUP..].to_vec();
        lost[..SECTOR].fill(0);
        let (rest, failed) = read(&lost);
        assert!(rest.is_none() && failed.iter().any(|(check, _)| *check == "group decoding"), "{failed:?}");
        let middle = new.len() / 1024 * SECTOR;
        for spoiled in [&old[middle..middle + GROUP], &vec![0; GROUP]] {
            let mut mixed = new.clone();
            mixed[middle..middle + GROUP].copy_from_slice(spoiled);
            assert_eq!(first(&mixed), FAILS);
            assert_eq!(further(&mixed[2 * GROUP..]), FAILS);
            // The damage is at its beginning, which was requested.
            let mut begins_later = new[2 * GROUP..].to_vec();
            begins_later[..GROUP].copy_from_slice(spoiled);
            assert_eq!(further(&begins_later), FAILS);
        }
    }

    #[test]
    fn what_was_not_asked_for_parts_a_log_and_what_did_not_come_does_not() {
        let board = ["00001_00.HUM", "00001_01.HUM", "00001_02.HUM", "00001_03.HUM", "00002_04.HUM"];
        let named = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let places: Vec<Place> = board.iter().filter_map(|name| place(name)).collect();
        let parts = |asked: &Asked, came: &[&str]| -> Vec<_> {
            let piece = |_: &&str| Piece { path: PathBuf::new(), extents: Vec::new() };
            let pieces = came.iter().map(piece).collect();
            let log =
                Log { name: "00001".to_owned(), files: named(came), pieces, session: None, left_over: false };
            let part = |log: Log| {
                let Extent { from_start, to_end, follows } = asked.extent(&log.files, &places);
                (log.files.len(), from_start, to_end, follows)
            };
            asked.parted(log).into_iter().map(part).collect()
        };
        let some = ["00001_00.HUM", "00001_02.HUM", "00001_03.HUM"];
        let from = |first| Asked::between(place(first).expect("a place"), Place::MAX);
        let all = || Asked::between(Place::default(), Place::MAX);
        assert_eq!(parts(&all(), &some), [(3, true, true, true)]);
        assert_eq!(parts(&from(some[0]), &some[1..]), [(2, true, true, false)]);
        assert_eq!(parts(&from(some[1]), &some[1..]), [(2, false, true, false)]);
        assert_eq!(
            parts(&Asked::named(&named(&some)), &some),
            [(1, true, false, false), (2, false, true, false)]
        );
        assert_eq!(parts(&Asked::named(&named(&board[..4])), &some), [(3, true, true, false)]);
        assert_eq!(parts(&Asked::named(&named(&board[..2])), &board[..2]), [(2, true, false, false)]);
        let later = ["00002_04.HUM"];
        assert_eq!(parts(&Asked::named(&named(&later)), &later), [(1, false, true, false)]);
        assert_eq!(parts(&Asked::named(&named(&board[3..])), &later), [(1, false, true, true)]);
        assert_eq!(parts(&all(), &["x"]), [(1, true, true, true)]);
    }
}
