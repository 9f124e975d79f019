//! Names of the files of a log.
//!
//! On a card it is just the number: `00042_07.HUM`. Elsewhere it also has the board's id and the session:
//! `00042-box3f0042000d51373435363338-s1a2b3c4d_07.HUM`

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hums_recorder::LogName;

use super::board::Board;
use crate::hex::hex;

const SESSION_DIGITS: usize = 8;

/// The name on the card, board and session. A packed log has no board.
pub fn session_name(on_card: &str, board: Option<&Board>, session: Option<u32>) -> String {
    let board = board.map_or_else(String::new, |board| format!("-box{}", hex(board)));
    let session = session.map_or_else(String::new, |session| format!("-s{session:08x}"));
    format!("{on_card}{board}{session}")
}

/// Session and segment by a file's name. Sorted, a box's segments are together, by number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SegmentName {
    /// Box and session, `box3f0042000d51373435363338-s1a2b3c4d`; empty in a name from a card.
    pub of: String,
    /// Number on its card.
    pub session: u32,
    /// The segment within the session.
    pub segment: u32,
}

impl Ord for SegmentName {
    fn cmp(&self, other: &Self) -> Ordering {
        self.recorder()
            .cmp(other.recorder())
            .then(self.session.cmp(&other.session))
            .then_with(|| self.of.cmp(&other.of))
            .then(self.segment.cmp(&other.segment))
    }
}

impl PartialOrd for SegmentName {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl SegmentName {
    /// The first segment of its session.
    pub fn first(&self) -> Self {
        Self { segment: 0, ..self.clone() }
    }

    /// The box, if it is in the name: logs of one box are read as one card's.
    pub fn recorder(&self) -> &str {
        self.of.rsplit_once('-').map_or("", |(recorder, _)| recorder)
    }

    /// The log for people: `00042`, after the box if known.
    pub fn log(&self) -> String {
        match self.recorder() {
            "" => format!("{:05}", self.session),
            recorder => format!("{recorder}/{:05}", self.session),
        }
    }
}

/// Segment by a file's name, in any case, also without the ending.
pub fn segment_name(path: &Path) -> Option<SegmentName> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    let (base, extension) = name.split_once('.').unwrap_or((&name, "hum"));
    let of = || {
        let (number, rest) = base.split_once('-')?;
        let (of, segment) = rest.rsplit_once('_')?;
        is_of_session(of).then(|| (format!("{number}_{segment}"), of.to_owned()))
    };
    let (base, of) = of().unwrap_or_else(|| (base.to_owned(), String::new()));
    let extension = extension.to_ascii_uppercase();
    let LogName { session, segment } = LogName::from_short(base.as_bytes(), extension.as_bytes())?;
    Some(SegmentName { of, session, segment })
}

const PART: &str = ".part";

/// Path of a part, made by `hums box pull --around`: `00042-s1a2b3c4d_07.part.HUM`.
pub fn part_name(whole: &Path) -> PathBuf {
    whole.with_extension("part.HUM")
}

/// Segment by a file's name, or by the name of a part of it.
pub fn segment_or_part(path: &Path) -> Option<SegmentName> {
    let whole = |stem: &str| Some(path.with_file_name(stem.get(..stem.len().checked_sub(PART.len())?)?));
    let part = path.file_stem().filter(|_| is_part(path)).and_then(|stem| whole(stem.to_str()?));
    segment_name(part.as_deref().unwrap_or(path))
}

/// A part of a log, by the file's name.
pub fn is_part(path: &Path) -> bool {
    let is_hum = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hum"));
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().to_ascii_lowercase());
    is_hum && stem.is_some_and(|stem| stem.ends_with(PART))
}

/// Names of one of several inputs' logs begin with its own: each card has a session 1.
pub fn name_after<'a>(input: &Path, names: impl Iterator<Item = &'a mut String>) {
    let stem = input.file_stem().or(input.file_name()).map_or("input".into(), |stem| stem.to_string_lossy());
    for name in names.filter(|name| **name != stem) {
        *name = format!("{stem}/{name}");
    }
}

/// Gives a number to each name that occurred before.
pub fn make_unique<'a>(names: impl Iterator<Item = &'a mut String>) {
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    for name in names {
        let count = seen.entry(name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            *name = format!("{name}-{count}");
        }
    }
}

fn is_of_session(of: &str) -> bool {
    let session = match of.rsplit_once('-') {
        Some((recorder, session)) if recorder.starts_with("box") => session,
        Some(_) => return false,
        None => of,
    };
    let digits = session.strip_prefix('s').unwrap_or_default();
    digits.len() == SESSION_DIGITS && digits.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_known_by_its_name_and_is_no_segment() {
        let part = part_name(Path::new("logs/00042-s1a2b3c4d_07.HUM"));
        assert_eq!(part, Path::new("logs/00042-s1a2b3c4d_07.part.HUM"));
        assert!(is_part(&part) && is_part(Path::new("a.PART.hum")) && segment_name(&part).is_none());
        let of = |path: &Path| Some(segment_or_part(path)?.of);
        assert_eq!((of(&part), of(Path::new("a.part.hum"))), (Some("s1a2b3c4d".to_owned()), None));
        for other in ["00042-s1a2b3c4d_07.HUM", "a.part", "part.HUM", "a.part.tlog"] {
            assert!(!is_part(Path::new(other)), "{other}");
        }
    }

    #[test]
    fn a_segment_is_known_by_its_name_on_the_card_and_by_the_name_of_its_session() {
        let board = Some(&[0x3f; 12]);
        for (name, of, log) in [
            (session_name("00042", None, None), "", "00042"),
            (session_name("00042", None, Some(7)), "s00000007", "00042"),
            (
                session_name("00042", board, Some(0x1a2b_3c4d)),
                "box3f3f3f3f3f3f3f3f3f3f3f3f-s1a2b3c4d",
                "box3f3f3f3f3f3f3f3f3f3f3f3f/00042",
            ),
        ] {
            for ending in ["_07.HUM", "_07.hum", "_07"] {
                let name = segment_name(Path::new(&format!("{name}{ending}"))).expect("a segment");
                assert_eq!((name.of.as_str(), name.session, name.segment), (of, 42, 7), "{ending}");
                assert_eq!(name.log(), log);
            }
        }
        for other in [
            "00042-s1a2b3c4d.hum",
            "00042-x_07.HUM",
            "00042-a-s1a2b3c4d_07.HUM",
            "42_07.HUM",
            "00042_07.tlog",
        ] {
            assert_eq!(segment_name(Path::new(other)), None, "{other}");
        }
    }
}
