//! The manifest of a reading: files read and made, by SHA-256; repairs and losses. Others can prove later that they have the
//! same files, with `sha256sum`, which also reads the manifest for people.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, Result};
use serde::Serialize;

use crate::ending::Ending;
use crate::files::{Inputs, Output, digest, settle};
use crate::hex::hex;
use crate::log_json::{ImageJson, image_text};
use crate::logs::find::Image;
use crate::logs::sessions::copy_words;
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable::{path as shown, word};
use crate::soundness::Soundness;
use crate::utc::iso8601;

const SCHEMA: Schema = Schema::first("hums-manifest");

/// A manifest in the making.
#[derive(Debug, Default, Serialize)]
pub struct Manifest {
    /// Version and commit of hums.
    program: &'static str,
    /// By this computer's clock.
    made_utc: String,
    /// Each file that was read.
    inputs: Vec<FileJson>,
    /// The file systems of cards among them.
    images: Vec<ImageJson>,
    /// In words.
    #[serde(skip)]
    cards: Vec<String>,
    /// Each file that was made.
    outputs: Vec<FileJson>,
    logs: Vec<LogJson>,
}

#[derive(Debug, Serialize)]
struct FileJson {
    /// Its name from the given path on.
    file: String,
    bytes: u64,
    sha256: String,
}

/// A log, and what it lacks.
#[derive(Debug, Serialize)]
struct LogJson {
    name: String,
    /// Number of its sectors, hexadecimal; of other programs' recordings `r` and a number made of the bytes.
    session: Option<String>,
    /// Messages, for an autopilot's log.
    frames: u64,
    /// Damaged or lost places.
    gaps: u64,
    /// The original, if the log is a copy.
    copy_of: Option<String>,
    /// `null` for recordings of other programs.
    frames_missing: Option<u64>,
    /// From parity.
    sectors_rebuilt: Option<u64>,
    /// A word; empty if the log is whole.
    lacks: &'static str,
    /// Sentences.
    faults: Vec<String>,
}

/// A log that was read.
#[derive(Clone, Copy, Debug)]
pub struct ReadLog<'a> {
    /// Its name.
    pub name: &'a str,
    /// For a recording of another program, as are frames and gaps.
    pub session: Option<&'a str>,
    /// Frames or messages.
    pub frames: u64,
    /// Damaged or lost places.
    pub gaps: u64,
    /// The original, if it is a copy.
    pub copy_of: Option<&'a str>,
    /// Damage and losses.
    pub soundness: Soundness,
    /// Recordings of other programs have none.
    pub ending: Option<&'a Ending>,
    /// Sentences on its faults.
    pub remarks: &'a [String],
}

impl Manifest {
    /// Adds a log that was read.
    pub fn log(&mut self, log: ReadLog<'_>) {
        let ReadLog { name, session, frames, gaps, copy_of, soundness, ending, remarks } = log;
        let summary = ending.map(|ending| &ending.summary);
        let faults = ending.map_or_else(Vec::new, Ending::faults);
        let number = summary.and_then(|summary| summary.session).map(|session| format!("{session:08x}"));
        self.logs.push(LogJson {
            name: name.to_owned(),
            session: number.or_else(|| session.map(str::to_owned)),
            frames: summary.map_or(frames, |summary| summary.frames),
            gaps: summary.map_or(gaps, |summary| summary.gaps),
            copy_of: copy_of.or(ending.and_then(|ending| ending.again.as_deref())).map(str::to_owned),
            frames_missing: summary.map(|summary| summary.frames_missing),
            sectors_rebuilt: ending.map(Ending::made_again),
            lacks: soundness.words(),
            faults: faults.into_iter().chain(remarks.iter().cloned()).collect(),
        });
    }

    /// Adds the file systems of cards, named from the `given` paths on.
    pub fn images(&mut self, images: &[Image], given: &[PathBuf]) {
        for image in images {
            let name = name_below(&image.path, given);
            self.images.push(ImageJson::of(image, &name));
            self.cards.push(image_text(image, &name));
        }
    }

    /// Hashes all files, and writes the manifest: JSON if its name ends in `.json`, otherwise text. Files are named from
    /// the `given` paths on. Outputs may be folders.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn write(
        mut self,
        program: &'static str,
        to: &Path,
        given: &[PathBuf],
        inputs: &BTreeSet<PathBuf>,
        outputs: &BTreeSet<PathBuf>,
        refuse: &Inputs,
    ) -> Result<()> {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        (self.program, self.made_utc) = (program, iso8601(since_1970.as_micros() as u64));
        self.inputs =
            inputs.iter().map(|path| hashed(path, &name_below(path, given))).collect::<Result<_>>()?;
        for output in outputs {
            self.outputs.extend(below(output, given)?);
        }
        refuse.refuse(to)?;
        let mut file = Output::create(to, refuse)?;
        let is_json = to.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        let text = if is_json { output::json_text(SCHEMA, &self)? } else { self.text(to) };
        settle(file.write_all(text.as_bytes()), to)?;
        file.finish()?;
        output::aside(&format!(
            "{}: SHA-256 of {} read and {} made",
            shown(to),
            count(self.inputs.len() as u64, "file"),
            count(self.outputs.len() as u64, "file")
        ));
        Ok(())
    }

    fn text(&self, to: &Path) -> String {
        let Self { program, made_utc, inputs, outputs, cards, logs, .. } = self;
        let name = to.file_name().map(Path::new).map(shown).unwrap_or_default();
        let mut text = format!(
            "Made by {program} at {made_utc} by this computer's clock.\n\
             To compare files with their SHA-256 below: sha256sum --check {name}\n"
        );
        for (title, files) in [("Files read", inputs), ("Files made", outputs)] {
            if !files.is_empty() {
                let _ = writeln!(text, "\n{title}");
            }
            for FileJson { file, sha256, .. } in files {
                let _ = writeln!(text, "{sha256}  {file}");
            }
        }
        text.push('\n');
        for line in cards.iter().cloned().chain(logs.iter().flat_map(LogJson::lines)) {
            let _ = writeln!(text, "{line}");
        }
        text
    }
}

impl LogJson {
    /// A sentence, and one for each fault.
    fn lines(&self) -> Vec<String> {
        let session = self.session.as_deref().map_or_else(String::new, |of| format!(" (session {of})"));
        let state = match (&self.copy_of, self.lacks) {
            (Some(of), _) => copy_words(of),
            (None, "") => "nothing is missing or damaged".to_owned(),
            (None, lacks) => lacks.to_owned(),
        };
        let line = format!("Log {}{session}: {}; {state}", word(&self.name), count(self.frames, "message"));
        let faults = self.faults.iter().map(|fault| format!("  {}", word(fault)));
        std::iter::once(line).chain(faults).collect()
    }
}

/// Files below, or itself, by name.
fn below(output: &Path, given: &[PathBuf]) -> Result<Vec<FileJson>> {
    let roots: Vec<PathBuf> = given.iter().cloned().chain([output.to_owned()]).collect();
    let mut files = Vec::new();
    let mut waiting = vec![output.to_owned()];
    while let Some(path) = waiting.pop() {
        if path.is_dir() {
            let context = || format!("{}: cannot be read", path.display());
            for entry in path.read_dir().with_context(context)? {
                waiting.push(entry.with_context(context)?.path());
            }
        } else {
            files.push(hashed(&path, &name_below(&path, &roots))?);
        }
    }
    files.sort_by(|one, other| one.file.cmp(&other.file));
    Ok(files)
}

fn name_below(file: &Path, given: &[PathBuf]) -> PathBuf {
    let name = given.iter().find_map(|of| {
        let rest = file.strip_prefix(of).ok()?;
        let is_below = of.is_relative() && !of.components().any(|part| part == Component::ParentDir);
        let base = if is_below { of.as_path() } else { Path::new(of.file_name()?) };
        Some(base.components().chain(rest.components()).filter(|part| *part != Component::CurDir).collect())
    });
    name.unwrap_or_else(|| file.file_name().map_or_else(PathBuf::new, PathBuf::from))
}

fn hashed(path: &Path, name: &Path) -> Result<FileJson> {
    let context = || format!("{}: cannot be read", path.display());
    let bytes = fs::metadata(path).with_context(context)?.len();
    let digest = digest(path).with_context(context)?;
    Ok(FileJson { file: name.display().to_string(), bytes, sha256: hex(&digest) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_named_from_the_given_path_on_without_this_computers_folders() {
        for (file, given, name) in [
            ("logs/a/x.tlog", "logs", "logs/a/x.tlog"),
            ("./logs/x.tlog", "./logs", "logs/x.tlog"),
            ("./x.tlog", ".", "x.tlog"),
            ("a/x.tlog", "a/x.tlog", "a/x.tlog"),
            ("/home/me/logs/a/x.tlog", "/home/me/logs", "logs/a/x.tlog"),
            ("/home/me/x.tlog", "/home/me/x.tlog", "x.tlog"),
            ("../logs/a/x.tlog", "../logs", "logs/a/x.tlog"),
            ("/home/me/y.tlog", "z", "y.tlog"),
        ] {
            assert_eq!(
                name_below(Path::new(file), &[PathBuf::from(given)]),
                Path::new(name),
                "{file} {given}"
            );
        }
    }
}
