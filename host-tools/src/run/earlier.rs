//! Sessions on a card before a run. A full card overwrites the oldest: a surprise on a PC. So a flag must allow a run on a card
//! that may become full. Overwritten logs are reported.

use std::path::Path;

use anyhow::Result;
use hums_recorder::card::SEGMENT_BYTES_MAX;

use crate::cli;
use crate::endpoint::Endpoint;
use crate::logs::sessions::first_session;
use crate::logs::{Card, Log, segment_name};
use crate::outcome::usage;
use crate::source::input::Input;

const SEGMENTS_MIN: u64 = 16;

/// Name on the card, number in its sectors, number of files.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Session {
    name: String,
    of_sectors: Option<u32>,
    files: usize,
}

impl Session {
    fn of(log: &Log) -> Self {
        Self { name: log.name.clone(), of_sectors: first_session(log), files: log.files.len() }
    }

    fn is(&self, other: &Self) -> bool {
        self.name == other.name && self.of_sectors == other.of_sectors
    }
}

/// Sessions before a run.
#[derive(Clone, Debug, Default)]
pub struct EarlierSessions {
    sessions: Vec<Session>,
    allowed: bool,
}

impl EarlierSessions {
    /// Looks at a card. A usage error if a session may be overwritten; `unknown`: bytes of an input without a length.
    pub fn of(run: &cli::Sim, unknown: u64) -> Result<Self> {
        // An unreadable card has no session to lose.
        let Some(card) = Card::of(&run.sd) else {
            return Ok(Self { sessions: Vec::new(), allowed: run.overwrite_oldest });
        };
        if let Some(damage) = card.damage.as_ref().filter(|_| !run.overwrite_oldest) {
            return Err(usage(format!(
                "{}: the card's file system is damaged ({damage}), so the run may overwrite logs; name another image, or add --overwrite-oldest",
                run.sd.display()
            )));
        }
        let sessions: Vec<Session> = card.logs.iter().map(Session::of).collect();
        let oldest = oldest(&card.logs).filter(|_| !run.overwrite_oldest);
        if let Some(oldest) = oldest.filter(|_| !has_room(&card, run, unknown)) {
            return Err(usage(format!(
                "{}: the card is full or may become so, and the run would overwrite its oldest session ({}); name another image, or add --overwrite-oldest",
                run.sd.display(),
                oldest.name
            )));
        }
        Ok(Self { sessions, allowed: run.overwrite_oldest })
    }

    /// Whether a log was there before the run.
    pub fn has(&self, log: &Log) -> bool {
        let log = Session::of(log);
        self.sessions.iter().any(|session| session.is(&log))
    }

    /// Gone, or with fewer files.
    pub fn overwritten(&self, after: &[Log]) -> Vec<String> {
        let after: Vec<Session> = after.iter().map(Session::of).collect();
        let is_whole =
            |session: &&Session| after.iter().any(|after| after.is(session) && after.files >= session.files);
        self.sessions
            .iter()
            .filter(|session| !is_whole(session))
            .map(|session| session.name.clone())
            .collect()
    }

    /// Whether sessions may be overwritten.
    pub const fn is_allowed(&self) -> bool {
        self.allowed
    }
}

/// The session that a full recorder overwrites. It sees only the root directory: logs in folders are copies.
fn oldest(logs: &[Log]) -> Option<&Log> {
    let is_segment = |file: &String| !file.contains('/') && segment_name(Path::new(file)).is_some();
    logs.iter().find(|log| log.files.iter().any(is_segment))
}

/// As much as the input, and a new segment for each start. Writing errors may use up any room.
fn has_room(card: &Card, run: &cli::Sim, unknown: u64) -> bool {
    if run.faults.write_error.is_some_and(|probability| probability > 0.0) {
        return false;
    }
    let read = match &run.input {
        Endpoint::File(path) => Input::bytes_of(path),
        _ => unknown,
    };
    let starts = 1 + run.faults.reboot_at_us.len() + run.faults.card_out.len();
    let segment = (card.all / SEGMENTS_MIN).min(u64::from(SEGMENT_BYTES_MAX));
    let begun = segment.saturating_mul(starts as u64);
    card.free >= begun.saturating_add(read.saturating_sub(segment))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_in_folders_of_a_card_is_not_what_a_recorder_overwrites() {
        let log = |name: &str, files: &[&str]| Log {
            name: name.to_owned(),
            files: files.iter().map(|file| (*file).to_owned()).collect(),
            pieces: Vec::new(),
            session: None,
            left_over: false,
        };
        let mut logs = vec![
            log("00001", &["BACKUP/00001_00.HUM"]),
            log("00014", &["BACKUP/00014_00.HUM", "00014_00.HUM"]),
            log("00015", &["00015_00.HUM"]),
            log("COPY_HUM", &["COPY.HUM"]),
        ];
        assert_eq!(oldest(&logs).map(|log| log.name.as_str()), Some("00014"));
        logs.drain(1..3);
        assert!(oldest(&logs).is_none());
    }
}
