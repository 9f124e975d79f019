//! Foreign recordings, judged by hand: by the values, the mode, the pilot's actions, the autopilot's texts.
//! `verdicts.json` identifies one by its name and the beginning of its SHA-256. True: the vehicle crashed or was
//! about to, the autopilot reports the same, or a value exceeds its autopilot's published limit. One verdict is for
//! all alarms of a check in a recording.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde::Deserialize;
use sha2::{Digest as _, Sha256};

const JUDGED: &str = include_str!("verdicts.json");

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "lowercase")]
pub(super) enum Flown {
    Vehicle,
    /// A simulator, with sensors or without.
    Simulator,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "lowercase")]
pub(super) enum Verdict {
    True,
    False,
    #[serde(skip)]
    Unknown,
}

impl Verdict {
    pub(super) const ALL: [Self; 3] = [Self::True, Self::False, Self::Unknown];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::False => "false",
            Self::Unknown => "not known",
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Word {
    verdict: Verdict,
    why: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Recording {
    file: String,
    /// The first sixteen digits.
    sha256: String,
    pub(super) flown: Flown,
    alarms: BTreeMap<String, Word>,
}

impl Recording {
    /// The verdict on a check's alarms, and why.
    pub(super) fn of(&self, check: &str) -> (Verdict, &str) {
        self.alarms.get(check).map_or((Verdict::Unknown, ""), |word| (word.verdict, &word.why))
    }
}

fn all() -> Result<Vec<Recording>> {
    serde_json::from_str(JUDGED).context("verdicts.json")
}

/// The verdict on a recording, by name and content.
pub(super) fn find(path: &Path) -> Result<Option<Recording>> {
    let name = path.file_name().unwrap_or_default();
    let Some(known) = all()?.into_iter().find(|known| name == known.file.as_str()) else { return Ok(None) };
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let digits = Sha256::digest(bytes).iter().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}");
        digits
    });
    Ok(Some(known).filter(|known| digits.starts_with(&known.sha256)))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use hums::names::vocabulary;

    use super::*;

    #[test]
    fn each_recording_is_listed_once_with_checks_that_there_are_and_a_reason() {
        let all = all().unwrap();
        let names: BTreeSet<&str> = all.iter().map(|one| one.file.as_str()).collect();
        assert_eq!(names.len(), all.len());
        for one in &all {
            assert!(
                one.sha256.len() == 16 && one.sha256.bytes().all(|digit| digit.is_ascii_hexdigit()),
                "{}",
                one.file
            );
            for (check, word) in &one.alarms {
                assert!(vocabulary(check).is_some() && !word.why.is_empty(), "{}: {check}", one.file);
            }
        }
    }

    #[test]
    fn another_file_of_the_same_name_is_not_known() {
        let known = all().unwrap().remove(0);
        let folder = std::env::temp_dir().join(format!("hums-verdicts-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join(&known.file);
        fs::write(&path, b"something else").unwrap();
        assert!(find(&path).unwrap().is_none());
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(known.of("no_such_check").0, Verdict::Unknown);
    }
}
