//! The flights to judge: the labelled ones of the repository, given folders, recordings of `HUMS_FLIGHTS`.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums::source::find::find;
use hums::source::recording::LogPlace;

use super::labels::{self, FILE, Label};
use super::options::{Flights, Known};
use super::real;
use crate::flights;

const DEPTH_MAX: usize = 4;

#[derive(Debug)]
pub(super) struct Set {
    pub(super) name: String,
    pub(super) known: Known,
    pub(super) flights: Vec<(LogPlace, Option<Label>)>,
}

impl Set {
    pub(super) fn is_labelled(&self) -> bool {
        self.flights.iter().any(|(_, label)| label.is_some())
    }
}

pub(super) fn find_all(options: &Flights) -> Result<(Vec<Set>, Vec<real::Set>)> {
    let mut reals = Vec::new();
    let mut sets = vec![
        repository("labelled, ArduPilot", "tests/labelled")?,
        repository("labelled, PX4", "tests/labelled/px4")?,
        repository("first recordings", "tests/flights")?,
    ];
    for (folder, known) in &options.folders {
        match real::find(folder, *known)? {
            Some(set) => reals.push(set),
            None => sets.push(given(folder, *known)?),
        }
    }
    if options.short {
        return Ok((sets, reals));
    }
    let unlabelled = flights::more().into_iter().filter(|path| !has_labels_beside(path));
    let flights: Vec<_> = unlabelled.map(|path| (LogPlace::file(&path), None)).collect();
    if !flights.is_empty() {
        sets.push(Set { name: "further recordings".to_owned(), known: Known::Seen, flights });
    }
    sets.sort_by_key(|set| !set.is_labelled());
    Ok((sets, reals))
}

fn repository(name: &str, folder: &str) -> Result<Set> {
    let flights = labelled(&flights::root().join(folder))?;
    Ok(Set { name: name.to_owned(), known: Known::Yes, flights })
}

fn has_labels_beside(path: &Path) -> bool {
    path.parent().is_some_and(|folder| folder.join(FILE).is_file())
}

/// Every `labels.json` in and below it, or all its recordings.
fn given(folder: &Path, known: Known) -> Result<Set> {
    let mut found = Vec::new();
    below(folder, 0, &mut found)?;
    found.sort();
    let name = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = name.file_name().map_or_else(|| "given".into(), |name| name.to_string_lossy().into_owned());
    let mut flights = Vec::new();
    for folder in &found {
        flights.append(&mut labelled(folder)?);
    }
    if found.is_empty() {
        let recordings = find(&[folder.to_owned()], false)?;
        flights = recordings.places.into_iter().map(|place| (place, None)).collect();
    }
    if flights.is_empty() {
        bail!("{}: no flight is in there", folder.display());
    }
    Ok(Set { name, known, flights })
}

/// Folders with labels.
fn below(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<()> {
    if folder.join(FILE).is_file() {
        found.push(folder.to_owned());
    }
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.is_dir() && depth < DEPTH_MAX {
            below(&path, depth + 1, found)?;
        }
    }
    Ok(())
}

fn labelled(folder: &Path) -> Result<Vec<(LogPlace, Option<Label>)>> {
    let labels = labels::read(folder)?;
    Ok(labels.into_iter().map(|label| (LogPlace::file(&folder.join(&label.file)), Some(label))).collect())
}
