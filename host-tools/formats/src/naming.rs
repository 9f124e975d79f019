//! Names of a session's files ([`crate::logs::naming`]).

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use sha2::{Digest as _, Sha256};

use crate::hex::hex;
use crate::logs::Log;
use crate::logs::board::{HEADING_GROUPS, board_of};
use crate::logs::fingerprint::{Fingerprint, Fingerprinter};
use crate::logs::groups::Groups;
use crate::logs::naming::{segment_name, session_name};
use crate::logs::sessions::Sessions;
use crate::source::recording::LogPlace;

/// File systems allow 255 bytes, and at most 55 follow.
const NAME_BYTES_MAX: usize = 190;

/// A log's identity, from headers and first records. The same for a session on a card and its copies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traits {
    /// 32 bits, random on a board.
    session: Option<u32>,
    /// `None` without the record of a start.
    board: Option<[u8; 12]>,
    /// Equal for copies only.
    fingerprint: Fingerprint,
}

impl Traits {
    /// Reads all sectors, or all bytes of another recording.
    pub fn of(place: &LogPlace) -> Result<Self> {
        let Some(log) = place.own() else {
            return Ok(Self { fingerprint: place.fingerprint()?, ..Self::default() });
        };
        let mut groups = Groups::new(log);
        let mut all = Fingerprinter::default();
        let mut board = None;
        let mut headings = HEADING_GROUPS;
        while let Some(group) = groups.next_group()? {
            if headings > 0 {
                headings -= 1;
                board = board.or_else(|| board_of(&group));
            }
            all.add(&group);
        }
        Ok(Self { session: groups.session(), board, fingerprint: all.finish() })
    }

    /// A box's log, by the record of a start.
    pub fn has_board(&self) -> bool {
        self.board.is_some()
    }

    /// The name of the log's files.
    pub fn name(&self, place: &LogPlace) -> String {
        let Some(log) = place.own() else {
            return format!("{}-{}", file_name(place), self.identity());
        };
        session_name(&base(log), self.board.as_ref(), self.session)
    }

    /// The name of a recording in the tables of a fleet, which no other recording has: its [`identity`](Self::identity), and 96
    /// bits of the box, of the vehicle's unique id (for a log without the record of a box's start), or of the bytes of another
    /// recording.
    pub fn unique(&self, place: &LogPlace, vehicle: &str) -> String {
        // Another name of a vehicle is of the log's place, which a copy of the log does not share.
        let uid = vehicle.starts_with("uid-").then(|| Sha256::digest(vehicle.as_bytes()));
        let of_vehicle = || uid.and_then(|hash| hash.first_chunk().copied()).unwrap_or_default();
        let of_bytes = || self.fingerprint.first_chunk().copied().unwrap_or_default();
        let unique: [u8; 12] = match (self.board, place.own()) {
            (Some(board), _) => board,
            (None, Some(_)) => of_vehicle(),
            (None, None) => of_bytes(),
        };
        format!("{}-{}", self.identity(), hex(&unique))
    }

    /// Hash of its sectors' numbers and checksums; of another recording, of all its bytes.
    pub const fn fingerprint(&self) -> [u8; 16] {
        self.fingerprint
    }

    /// The unique id of its box, if it begins with the record of the box's start.
    pub const fn board(&self) -> Option<[u8; 12]> {
        self.board
    }

    /// The session's name in tables and points, and at the end of its files' names. For a HUMS log it is the
    /// number in its sectors, `s1a2b3c4d`; for any other recording a number made from its unpacked bytes, `r1a2b3c4d`.
    pub fn identity(&self) -> String {
        let number = self.session.map(|session| format!("s{session:08x}"));
        let [a, b, c, d, ..] = self.fingerprint;
        number.unwrap_or_else(|| format!("r{:08x}", u32::from_be_bytes([a, b, c, d])))
    }
}

/// The name of a log's files in one command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogFileName {
    /// Name, and index within its session, from 1.
    As(String, u32),
    /// A copy of the log of this index.
    Copy(usize),
}

/// Names one command's logs. Different logs of one session (a shortened copy) differ.
#[derive(Debug, Default)]
pub struct Names {
    /// The indices of logs, by session and content.
    known: BTreeMap<(Option<u32>, [u8; 16]), usize>,
    of_session: BTreeMap<u32, u32>,
    taken: BTreeMap<String, u32>,
}

impl Names {
    /// Names the log of this index.
    pub fn name(&mut self, index: usize, log: &LogPlace, traits: &Traits) -> LogFileName {
        if let Some(first) = self.known.get(&(traits.session, traits.fingerprint)) {
            return LogFileName::Copy(*first);
        }
        self.known.insert((traits.session, traits.fingerprint), index);
        // Without a session, the bytes name it, uniquely.
        let nth = traits.session.map_or(1, |session| {
            let count = self.of_session.entry(session).or_default();
            *count += 1;
            *count
        });
        let name = traits.name(log);
        let of_name = self.taken.entry(name.clone()).or_default();
        *of_name += 1;
        LogFileName::As(if *of_name > 1 { format!("{name}-{of_name}") } else { name }, nth)
    }
}

/// Names one command's logs; copies have none.
pub fn names(logs: &[(&LogPlace, Traits)], sessions: &Sessions) -> Vec<LogFileName> {
    let mut names = Names::default();
    let original = |log: &LogPlace| {
        let of = sessions.again(&log.name)?;
        logs.iter().position(|(other, _)| other.name == of)
    };
    let name = |(index, (log, traits)): (usize, &(&LogPlace, Traits))| match original(log) {
        Some(of) => LogFileName::Copy(of),
        None => names.name(index, log, traits),
    };
    logs.iter().enumerate().map(name).collect()
}

fn file_name(place: &LogPlace) -> String {
    let name = place.path().and_then(Path::file_name);
    name.map_or_else(|| "recording".to_owned(), |name| cut(name.to_string_lossy().into_owned()))
}

fn cut(mut name: String) -> String {
    let end = (0..=NAME_BYTES_MAX.min(name.len())).rev().find(|at| name.is_char_boundary(*at));
    name.truncate(end.unwrap_or(0));
    name
}

fn base(log: &Log) -> String {
    let file = log.files.first().map_or(log.name.as_str(), String::as_str);
    let path = Path::new(file);
    let stem = path.file_stem().map_or_else(|| "log".to_owned(), |stem| stem.to_string_lossy().into_owned());
    segment_name(path).map_or_else(|| cut(stem), |segment| format!("{:05}", segment.session))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_as_long_as_it_may_be_leaves_room_for_what_follows() {
        let file = "ö".repeat(125) + ".hum";
        let log = Log {
            name: file.clone(),
            files: vec![file.clone()],
            pieces: Vec::new(),
            session: None,
            left_over: false,
        };
        let traits = Traits { session: Some(u32::MAX), board: Some([0xFF; 12]), fingerprint: [0; 16] };
        let name = traits.name(&LogPlace::log(file, log));
        assert!(name.starts_with("öö") && name.ends_with("-sffffffff"), "{name}");
        assert!(name.len() + "-10.tlog.gaps.csv".len() <= 255, "{}", name.len());
    }

    #[test]
    fn copies_are_known_and_other_logs_of_a_session_get_other_names() {
        let log = |name: &str| {
            let log = Log {
                name: name.to_owned(),
                files: vec![format!("somewhere/{name}_00.HUM")],
                pieces: Vec::new(),
                session: None,
                left_over: false,
            };
            LogPlace::log(name.to_owned(), log)
        };
        let traits = |session, fingerprint, board| Traits {
            session: Some(session),
            board,
            fingerprint: [fingerprint; 16],
        };
        let (first, second) = (log("00001"), log("00002"));
        let logs = [
            (&first, traits(0x1a2b_3c4d, 1, None)),
            (&first, traits(0x1a2b_3c4d, 1, None)),
            (&first, traits(0x1a2b_3c4d, 2, None)),
            (&second, traits(5, 3, Some([0x3f; 12]))),
        ];
        let named = names(&logs, &Sessions::default());
        assert_eq!(
            named,
            [
                LogFileName::As("00001-s1a2b3c4d".to_owned(), 1),
                LogFileName::Copy(0),
                LogFileName::As("00001-s1a2b3c4d-2".to_owned(), 2),
                LogFileName::As("00002-box3f3f3f3f3f3f3f3f3f3f3f3f-s00000005".to_owned(), 1),
            ]
        );
    }
}
