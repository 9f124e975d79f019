//! Finds the logs in files, card images, raw devices and folders, by content.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::card::{image, whole_file};
use super::folder::{Segments, directory, sessions};
pub use super::found::{FoundLogs, Image, REMARKS_MAX};
pub use super::look::{Content, look};
use super::naming::{is_part, make_unique, name_after, segment_or_part};
use super::places::Log;
use crate::files::{is_seekable, why_unread};

/// With `salvage` every block of an image is searched, and its file system ignored. An input without a log is
/// an error.
pub fn find(inputs: &[PathBuf], salvage: bool) -> Result<FoundLogs> {
    search(inputs, salvage, |input| {
        bail!("{}: has no log of HUMS; name a card or .HUM file", input.display())
    })
}

/// Finds logs in a folder, which may have none.
pub fn find_in(folder: &Path, salvage: bool) -> Result<FoundLogs> {
    search(&[folder.to_owned()], salvage, |_| Ok(()))
}

fn search(inputs: &[PathBuf], salvage: bool, none: impl Fn(&Path) -> Result<()>) -> Result<FoundLogs> {
    let mut found = FoundLogs::default();
    // By folder.
    let mut segments = BTreeMap::<PathBuf, Segments>::new();
    for input in inputs {
        let before = found.logs.len();
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        let passed_over = found.logs_more + found.repeats;
        check_seekable(input, &about)?;
        // As the shell names it.
        if let Some(why) = why_unread(input).filter(|_| about.is_dir() && inputs.len() > 1) {
            found.remark(format!("{}: {why}", input.display()));
            continue;
        }
        if about.is_dir() {
            directory(input, salvage, &mut found)?;
        } else if found.is_known(input) {
            found.remark(format!("{}: was named or found already; it is read once", input.display()));
            continue;
        } else {
            let images = found.images.len();
            named_file(input, salvage, &mut found)?;
            if let (Some(name), true) =
                (segment_or_part(input), images == found.images.len() && before < found.logs.len())
                && let Some(log) = found.logs.pop()
            {
                segments.entry(folder_of(input)).or_default().push((!is_part(input), name, log));
                continue;
            }
        }
        if found.logs.len() == before
            && found.logs_more + found.repeats == passed_over
            && !found.images.iter().any(|image| &image.path == input)
        {
            none(input)?;
        }
        if inputs.len() > 1 {
            name_after(input, found.logs.iter_mut().skip(before).map(|log| &mut log.name));
        }
    }
    found.add(as_in_folders(segments));
    make_unique(found.logs.iter_mut().map(|log| &mut log.name));
    found.finish();
    Ok(found)
}

/// Refuses inputs without random access before they are opened: a pipe may never have another end.
pub fn check_seekable(path: &Path, about: &Metadata) -> Result<()> {
    if !about.is_dir() && !is_seekable(about) {
        bail!("{}: is a pipe, a socket, a terminal or the like; copy it into a file first", path.display());
    }
    Ok(())
}

fn named_file(path: &Path, salvage: bool, found: &mut FoundLogs) -> Result<()> {
    match look(path)? {
        Content::Log => found.log(whole_file(path)?),
        Content::Image => image(path, salvage, found)?,
        Content::Empty => bail!("{}: is empty; copy it from its card again", path.display()),
        Content::Unread(unread) => bail!("{}: {unread}", path.display()),
        Content::Mavlink => bail!(
            "{}: is a recording of MAVLink, not a log of HUMS; `hums decode --format hum` makes it one, `hums sim` records it",
            path.display()
        ),
        Content::Other => {
            bail!("{}: is neither a log of HUMS nor an image of an SD card (MBR + FAT32)", path.display())
        }
    }
    Ok(())
}

/// The folder of a file, in one spelling.
fn folder_of(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

/// As a folder with just these segments. Those of one folder are of one card.
fn as_in_folders(segments: BTreeMap<PathBuf, Segments>) -> Vec<Log> {
    let (mut logs, mut prefixes) = (Vec::<Log>::new(), BTreeMap::<String, u32>::new());
    let is_one = segments.len() == 1;
    for (folder, mut segments) in segments {
        let name = folder.file_name().map_or_else(Default::default, |name| name.to_string_lossy());
        let count = prefixes.entry(name.to_string()).or_default();
        *count += 1;
        let prefix = match count {
            _ if is_one => String::new(),
            1 => format!("{name}/"),
            count => format!("{name}-{count}/"),
        };
        segments.sort_by(|(is_whole, one, _), (other_is, other, _)| (is_whole, one).cmp(&(other_is, other)));
        logs.extend(sessions(segments, &prefix));
    }
    logs
}

#[cfg(test)]
mod tests {
    use hums_blackbox::Sector;

    use super::*;

    #[test]
    fn segments_that_are_named_one_by_one_are_the_logs_of_their_sessions() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = |name: &str| dir.path().join(name);
        for name in ["00003_01.HUM", "00003_00.HUM", "00004_00.HUM", "other.hum"] {
            let mut bytes = [0; 512];
            bytes[..2].copy_from_slice(&[0x48, 0xb3]);
            let mut sector = Sector::from_bytes(bytes);
            sector.seal(7);
            fs::write(path(name), sector.bytes()).expect("room");
        }
        let names = ["00003_01.HUM", "other.hum", "00004_00.HUM", "00003_00.HUM"].map(path);
        let found = find(&names, false).expect("four files");
        let logs: Vec<_> = found.logs.iter().map(|log| (log.name.as_str(), log.files.clone())).collect();
        let shown = |name: &str| path(name).display().to_string();
        assert_eq!(
            logs,
            [
                ("other", vec![shown("other.hum")]),
                ("00003", vec![shown("00003_00.HUM"), shown("00003_01.HUM")]),
                ("00004", vec![shown("00004_00.HUM")]),
            ]
        );
    }

    #[test]
    fn the_logs_of_a_box_are_in_the_order_of_their_numbers_and_not_of_their_random_sessions() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut bytes = [0; 512];
        bytes[..2].copy_from_slice(&[0x48, 0xb3]);
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(7);
        let names = [
            "00001-s0000000c_00.HUM",
            "00001-s0000000c_01.HUM",
            "00002-s0000000b_00.HUM",
            "00003-s0000000a_00.HUM",
            "00001-box3f0042000d51373435363338-s0000000f_00.HUM",
            "00002-box3f0042000d51373435363338-s0000000e_00.HUM",
        ]
        .map(|name| dir.path().join(name));
        for path in &names {
            fs::write(path, sector.bytes()).expect("room");
        }
        let files = |paths: &[PathBuf]| -> Vec<String> {
            find(paths, false).expect("logs").logs.into_iter().flat_map(|log| log.files).collect()
        };
        let wanted: Vec<String> = names.iter().map(|path| path.display().to_string()).collect();
        assert_eq!(files(&[dir.path().to_owned()]), wanted);
        assert_eq!(files(&names), wanted);
    }
}
