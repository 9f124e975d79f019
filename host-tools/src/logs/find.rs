//! Finds the logs in files, card images, raw devices and folders, by what is in them.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::card::{image, whole_file};
use super::folder::directory;
pub use super::found::{Found, Image, REMARKS_MAX};
pub use super::look::{Content, look};
use super::places::Log;
use crate::files::is_seekable;

/// Finds all logs in `inputs`; with `salvage` by looking at every block of an image, whatever its file system says. An
/// error where one of them has none.
pub fn find(inputs: &[PathBuf], salvage: bool) -> Result<Found> {
    search(inputs, salvage, |input| bail!("{}: no log of HUMS is in there", input.display()))
}

/// The same of one folder, which may have none.
pub fn find_in(folder: &Path, salvage: bool) -> Result<Found> {
    search(&[folder.to_owned()], salvage, |_| Ok(()))
}

fn search(inputs: &[PathBuf], salvage: bool, none: impl Fn(&Path) -> Result<()>) -> Result<Found> {
    let mut found = Found::default();
    for input in inputs {
        let before = found.logs.len();
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        let passed_over = found.logs_more + found.repeats;
        check_seekable(input, &about)?;
        if about.is_dir() {
            directory(input, salvage, &mut found)?;
        } else if found.is_known(input) {
            found.remark(format!("{}: was named or found already; it is read once", input.display()));
            continue;
        } else {
            named_file(input, salvage, &mut found)?;
        }
        if found.logs.len() == before
            && found.logs_more + found.repeats == passed_over
            && !found.images.iter().any(|image| &image.path == input)
        {
            none(input)?;
        }
        if inputs.len() > 1 {
            let stem =
                input.file_stem().or(input.file_name()).map_or("input".into(), |stem| stem.to_string_lossy());
            for log in found.logs.iter_mut().skip(before) {
                if log.name != stem {
                    log.name = format!("{stem}/{}", log.name);
                }
            }
        }
    }
    make_names_unique(&mut found.logs);
    found.finish();
    Ok(found)
}

/// Refuses what cannot be read from any place: a pipe may never have another end, and a terminal waits for ever. To be
/// called before a file is opened.
pub fn check_seekable(path: &Path, about: &Metadata) -> Result<()> {
    if !about.is_dir() && !is_seekable(about) {
        bail!(
            "{}: is a pipe, a socket, a terminal or the like, and a log is read from any place; copy it into a file first",
            path.display()
        );
    }
    Ok(())
}

/// A file that the user named: it must be something.
fn named_file(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    match look(path)? {
        Content::Log => found.log(whole_file(path)?),
        Content::Image => image(path, salvage, found)?,
        Content::Empty => bail!("{}: is empty", path.display()),
        Content::Newer(version) => bail!(
            "{}: is a log of format version {version}, which this program is too old for; take a newer hums",
            path.display()
        ),
        Content::Mavlink => bail!(
            "{}: is a recording of MAVLink, not a log of HUMS; `hums pack` makes it one, `hums sim` records it",
            path.display()
        ),
        Content::Other => {
            bail!("{}: is neither a log of HUMS nor an image of an SD card (MBR + FAT32)", path.display())
        }
    }
    Ok(())
}

/// Two cards both have a session 1: the later ones get a number.
fn make_names_unique(logs: &mut [Log]) {
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    for log in logs {
        let count = seen.entry(log.name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            log.name = format!("{}-{count}", log.name);
        }
    }
}
