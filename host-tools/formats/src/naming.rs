//! Names of a session's files ([`crate::logs::naming`]).

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use sha2::{Digest as _, Sha256};

use crate::files::Folder;
use crate::hex::hex;
use crate::logs::Log;
use crate::logs::board::{HEADING_GROUPS, board_of};
use crate::logs::fingerprint::{Fingerprint, Fingerprinter};
use crate::logs::groups::Groups;
use crate::logs::naming::{ends_with_identity, segment_name, session_name};
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

/// Removes our own outputs from the inputs, with remarks: a second `hums decode * -o .` gets those of the first. A
/// single input is kept.
pub fn without_made(inputs: &[PathBuf]) -> (Vec<PathBuf>, Vec<String>) {
    let (made, others): (Vec<&PathBuf>, Vec<&PathBuf>) = inputs.iter().partition(|input| is_made(input));
    if others.is_empty() {
        return (inputs.to_vec(), Vec::new());
    }
    let remark =
        |path: &&PathBuf| format!("{}: was made by hums of a recording, and is passed over", path.display());
    (others.into_iter().cloned().collect(), made.iter().map(remark).collect())
}

/// An output of this program other than a recording, by name or stamp.
pub fn is_made(path: &Path) -> bool {
    let name = path.file_name().map_or_else(Default::default, |name| name.to_string_lossy());
    if path.is_dir() {
        return Folder::is_ours(path) || name == ".hums-fleet" || is_table(path);
    }
    if name.ends_with(".html") && says_report(path) {
        return true;
    }
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let gaps = name.strip_suffix(".tlog.gaps.csv");
    let other = || name.rsplit_once('.').filter(|(_, ending)| !RECORDINGS.contains(ending));
    gaps.or_else(|| Some(other()?.0)).is_some_and(ends_with_identity)
}

/// Whether a folder is a table of a fleet: it has a folder for each date and nothing else.
fn is_table(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    let mut names = entries.filter_map(|entry| Some(entry.ok()?.file_name())).peekable();
    names.peek().is_some() && names.all(|name| name.to_string_lossy().starts_with("date="))
}

/// `decode` makes some of them.
const RECORDINGS: [&str; 6] = ["hum", "tlog", "raw", "bin", "log", "ulg"];

/// A report by its head: the table of a folder's pages has no session in its name.
fn says_report(path: &Path) -> bool {
    head(path).windows(GENERATOR.len()).any(|part| part == GENERATOR)
}

/// Empty if unreadable.
fn head(path: &Path) -> Vec<u8> {
    let mut head = Vec::new();
    // Bytes before an error count.
    let _ = File::open(path).and_then(|file| file.take(1_024).read_to_end(&mut head));
    head
}

const GENERATOR: &[u8] = b"name=\"generator\" content=\"hums report\"";

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
    fn outputs_are_known_by_their_names_and_recordings_are_not_taken_for_them() {
        for made in [
            "00001-box3f-s1a2b3c4d.jsonl",
            "log-s1a2b3c4d-2.lp",
            "log-s1a2b3c4d.kml",
            "a.tlog-r00112233.tlog.gaps.csv",
        ] {
            assert!(is_made(Path::new(made)), "{made}");
        }
        for other in [
            "log-s1a2b3c4d.hum",
            "log-s1a2b3c4d.tlog",
            "log-s1a2b3c4d.ulg",
            "log-s1a2b3c4.jsonl",
            "notes.jsonl",
            "x.html",
        ] {
            assert!(!is_made(Path::new(other)), "{other}");
        }
    }

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
