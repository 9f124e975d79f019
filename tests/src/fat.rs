//! A card's file system by dosfstools and mtools.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use rustix::fs::{SeekFrom as Place, seek};
use rustix::io::Errno;

use crate::child;

const SECTOR: u64 = 512;

fn partition(image: &mut File) -> (u64, u64) {
    let mut table = [0; 512];
    image.read_exact(&mut table).unwrap();
    assert_eq!(table[510..], [0x55, 0xAA], "no partition table");
    let number = |at: usize| u64::from(u32::from_le_bytes(table[at..at + 4].try_into().unwrap()));
    (number(0x1BE + 8) * SECTOR, number(0x1BE + 12) * SECTOR)
}

/// `fsck.vfat -n` finds only effects of a power cut: clusters without a file, their share of the free count, the mark
/// of a card in use.
///
/// # Panics
///
/// Anything else is found.
#[track_caller]
pub fn assert_clean(image: &Path) {
    let dir = tempfile::tempdir().unwrap();
    let copy = dir.path().join("partition");
    extract(image, &copy);
    let odd = complaints(&copy);
    assert!(odd.is_empty(), "fsck.vfat says: {odd:#?}");
}

/// Complaints of `fsck.vfat -n`, beyond effects of a power cut.
///
/// # Panics
///
/// If it does not run.
pub fn complaints(partition: &Path) -> Vec<String> {
    let outcome = child::run(Command::new(fsck()).arg("-n").arg(partition), Duration::from_mins(1));
    let text = outcome.text();
    let mut odd: Vec<String> = text.lines().filter(|line| !harmless(line)).map(str::to_owned).collect();
    if !matches!(outcome.code, Some(0 | 1)) {
        odd.push(format!("it ended with {:?}: {text} {}", outcome.code, outcome.stderr));
    }
    odd
}

/// The card's file system for mtools.
///
/// # Panics
/// It has no partition.
pub fn drive(image: &Path) -> String {
    let (start, _) = partition(&mut File::open(image).unwrap());
    format!("{}@@{start}", image.display())
}

/// Copies the card's files with mtools.
///
/// # Panics
#[track_caller]
pub fn copy_files(image: &Path, folder: &Path) {
    let mut command = Command::new("mcopy");
    command.args(["-s", "-n", "-i", &drive(image)]).arg("::/").arg(folder);
    let outcome = child::run(&mut command, Duration::from_mins(1));
    assert_eq!(outcome.code, Some(0), "mcopy: {}", outcome.stderr);
}

fn harmless(line: &str) -> bool {
    let line = line.trim();
    line.is_empty()
        || [
            "fsck.fat ",
            "Reclaiming unconnected clusters",
            "Reclaimed ",
            "Free cluster summary wrong",
            "Free cluster summary uninitialized",
            "Auto-correcting",
            "Leaving filesystem unchanged",
            "Dirty bit is set",
            "Automatically removing dirty bit",
        ]
        .iter()
        .any(|start| line.starts_with(start))
        || line.contains(" files, ") && line.ends_with("clusters")
}

fn fsck() -> PathBuf {
    let places = ["/usr/sbin/fsck.vfat", "/sbin/fsck.vfat", "/usr/bin/fsck.vfat"];
    let found = places.iter().map(PathBuf::from).find(|path| path.is_file());
    found.expect("fsck.vfat is missing: `cargo xtask setup` installs dosfstools")
}

/// Returns the partition's start in the image, bytes. Both are nearly all holes: only data are read.
pub(crate) fn extract(image: &Path, to: &Path) -> u64 {
    let mut from = File::open(image).unwrap();
    let (start, length) = partition(&mut from);
    let mut out = File::create(to).unwrap();
    out.set_len(length).unwrap();
    let (mut at, end) = (start, start + length);
    loop {
        let data = match seek(&from, Place::Data(at)) {
            Ok(data) if data < end => data,
            Ok(_) | Err(Errno::NXIO) => break,
            Err(why) => panic!("{}: {why}", image.display()),
        };
        at = seek(&from, Place::Hole(data)).unwrap().min(end);
        from.seek(SeekFrom::Start(data)).unwrap();
        out.seek(SeekFrom::Start(data - start)).unwrap();
        io::copy(&mut (&from).take(at - data), &mut out).unwrap();
    }
    start
}
