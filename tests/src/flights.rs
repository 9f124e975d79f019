//! The recorded flights and pymavlink's results on them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde_json::Value;
use sha2::{Digest as _, Sha256};

use crate::frames::{self, Frame, Seeds};

/// The recordings of the repository: ArduPilot, ArduPilot signed, ArduPilot with faults, PX4.
pub const OWN: [&str; 4] =
    ["ap_quad_guided.tlog", "ap_quad_signed.raw", "ap_quad_faults.tlog", "px4_hil_quad_low.tlog"];

/// The repository's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// A recording of the repository.
pub fn own(name: &str) -> PathBuf {
    root().join("tests/flights").join(name)
}

/// Recordings below `HUMS_FLIGHTS`, without the repository's.
///
/// # Panics
///
/// There is none: a test without input is not a success.
pub fn further() -> Vec<PathBuf> {
    let found = more();
    assert!(!found.is_empty(), "HUMS_FLIGHTS names no folder of recordings");
    found
}

/// Recordings below `HUMS_FLIGHTS`; none if it is not set.
pub fn more() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os("HUMS_FLIGHTS").filter(|folder| !folder.is_empty()) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    collect(Path::new(&folder), &mut found);
    found.sort();
    assert!(!found.is_empty(), "HUMS_FLIGHTS names a folder without recordings: {}", folder.display());
    found
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "tlog" || kind == "raw") {
            let name = path.file_name().unwrap_or_default();
            if OWN.iter().all(|own| name != *own) {
                found.push(path);
            }
        }
    }
}

/// Pymavlink's result on one recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// A tlog, with times; else a port's raw bytes.
    pub is_tlog: bool,
    /// Verified frames.
    pub frames: u64,
    /// The same per message id.
    pub frames_by_id: BTreeMap<u32, u64>,
    /// Bytes outside frames and, in a tlog, outside their times.
    pub bytes_other: u64,
    /// SHA-256 over those frames, in order.
    pub sha256: String,
}

/// A manifest of recordings.
#[derive(Debug)]
pub struct Manifest {
    flights: BTreeMap<String, Found>,
    /// Pymavlink's checksum seeds.
    pub seeds: Seeds,
}

impl Manifest {
    /// Output of `tests/oracle/manifest.py`.
    pub fn parse(text: &str) -> Self {
        let json: Value = serde_json::from_str(text).expect("the manifest is JSON");
        let flights = json["flights"].as_object().expect("flights").iter();
        let flights = flights.map(|(name, flight)| {
            let found = Found {
                is_tlog: flight["kind"] == "tlog",
                frames: flight["frames"].as_u64().expect("frames"),
                frames_by_id: numbers(&flight["frames_by_id"]),
                bytes_other: flight["bytes_other"].as_u64().expect("bytes_other"),
                sha256: flight["sha256"].as_str().expect("sha256").to_owned(),
            };
            (name.clone(), found)
        });
        let seeds = numbers(&json["crc_extra"]).into_iter().map(|(id, seed)| (id, seed as u8)).collect();
        Self { flights: flights.collect(), seeds }
    }

    /// The repository's manifest.
    pub fn own() -> &'static Self {
        static OWN: OnceLock<Manifest> = OnceLock::new();
        OWN.get_or_init(|| {
            Self::parse(&fs::read_to_string(own("manifest.json")).expect("tests/flights/manifest.json"))
        })
    }

    /// The entry of this recording.
    pub fn found(&self, path: &Path) -> &Found {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.flights.get(&*name).unwrap_or_else(|| panic!("the manifest has no {name}"))
    }

    /// Frames of a recording by its kind in the manifest.
    pub fn frames_of<'a>(&self, path: &Path, data: &'a [u8]) -> Vec<Frame<'a>> {
        if self.found(path).is_tlog {
            frames::of_tlog(data, &self.seeds, false)
        } else {
            frames::of_raw(data, &self.seeds)
        }
    }
}

fn numbers(object: &Value) -> BTreeMap<u32, u64> {
    let entries = object.as_object().expect("an object of numbers").iter();
    entries.map(|(key, value)| (key.parse().expect("an id"), value.as_u64().expect("a number"))).collect()
}

/// Exactly pymavlink's frames.
#[track_caller]
pub fn assert_found(found: &Found, frames: &[Frame<'_>]) {
    let mut frames_by_id = BTreeMap::new();
    let mut digest = Sha256::new();
    for frame in frames.iter().filter(|frame| frame.verified) {
        *frames_by_id.entry(frame.id).or_insert(0) += 1;
        digest.update(frame.bytes);
    }
    assert_eq!(frames_by_id, found.frames_by_id, "frames per message id");
    let mut hex = String::new();
    for byte in digest.finalize() {
        write!(hex, "{byte:02x}").unwrap();
    }
    assert_eq!(hex, found.sha256, "SHA-256 over all frames in their order");
}

/// Bytes at the UART: without a tlog's times.
pub fn stream(is_tlog: bool, data: &[u8], frames: &[Frame<'_>]) -> Vec<u8> {
    if is_tlog { frames.iter().flat_map(|frame| frame.bytes).copied().collect() } else { data.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manifest_is_of_the_recordings_as_they_lie_here() {
        for name in OWN {
            let path = own(name);
            let data = fs::read(&path).unwrap();
            let manifest = Manifest::own();
            assert_found(manifest.found(&path), &manifest.frames_of(&path, &data));
        }
    }
}
