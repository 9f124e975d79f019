//! Sessions of many vehicles, made of the repository's recordings: stretches of them with another vehicle's id, place and time.
//!
//! A stretch is copied; only frames that tell vehicle, place or time are changed, and get a new checksum.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};
use hums_dialect::{crc, message};

use crate::flights::own;

const RECORDINGS: [&str; 3] = ["ap_quad_guided.tlog", "ap_quad_faults.tlog", "px4_hil_quad_low.tlog"];
/// Stretches of a recording begin so far apart: after take-off, in different phases of flight.
const BEGIN_US: u64 = 60_000_000;
const APART_US: u64 = 30_000_000;
const STRETCHES: u64 = 4;
pub(super) const VEHICLES: u64 = 10_000;
/// 2026-01-01.
const FIRST_DAY_US: u64 = 1_767_225_600_000_000;
const DAY_US: u64 = 86_400_000_000;

const HEADER: usize = 10;
const STAMP: usize = 8;
const SYSTEM_TIME: u32 = 2;
const GPS_RAW_INT: u32 = 24;
const GLOBAL_POSITION_INT: u32 = 33;
const AUTOPILOT_VERSION: u32 = 148;

/// A stretch of a recording: entries of a tlog, times from its beginning.
pub(super) struct Stretch {
    bytes: Vec<u8>,
    /// Offsets of entries.
    entries: Vec<usize>,
    begin_us: u64,
    /// System and component of the autopilot.
    sender: [u8; 2],
}

fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at + N)?.try_into().ok()
}

fn id(entry: &[u8]) -> u32 {
    number(entry, STAMP + 7).map_or(0, |[low, middle, high]| u32::from_le_bytes([low, middle, high, 0]))
}

impl Stretch {
    /// All stretches of this length in seconds.
    pub(super) fn all(seconds: u64) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for name in RECORDINGS {
            let recording = fs::read(own(name)).with_context(|| name.to_owned())?;
            let first = number(&recording, 0).map_or(0, u64::from_be_bytes);
            for stretch in 0..STRETCHES {
                let from_us = first + BEGIN_US + stretch * APART_US;
                all.push(Self::of(&recording, from_us, from_us + 1_000_000 * seconds));
            }
        }
        Ok(all)
    }

    /// MAVLink 2 without signatures, as these recordings are.
    fn of(recording: &[u8], from_us: u64, to_us: u64) -> Self {
        let mut stretch = Self { bytes: Vec::new(), entries: Vec::new(), begin_us: from_us, sender: [1, 1] };
        let mut at = 0;
        while let (Some(time), Some(length)) = (number(recording, at), recording.get(at + STAMP + 1)) {
            let end = at + STAMP + HEADER + usize::from(*length) + 2;
            let Some(entry) = recording.get(at..end) else { break };
            let is_version = id(entry) == AUTOPILOT_VERSION;
            if (from_us..to_us).contains(&u64::from_be_bytes(time)) && !is_version {
                stretch.entries.push(stretch.bytes.len());
                stretch.bytes.extend_from_slice(entry);
            }
            at = end;
        }
        stretch
    }

    /// Writes session `index` of the fleet, on its day. Returns the number of its frames.
    pub(super) fn write(&self, index: u64, day: u64, path: &Path) -> Result<u64> {
        let vehicle = index % VEHICLES;
        // Sessions of a day begin within eight hours.
        let begin_us = FIRST_DAY_US + day * DAY_US + 8 * 3_600_000_000 + index * 7_919_000 % 28_800_000_000;
        let mut bytes = Vec::with_capacity(self.bytes.len() + 64);
        let uid = 0x1_0000 + vehicle;
        bytes.extend(begin_us.to_be_bytes());
        bytes.extend([0xfd, 16, 0, 0, 0, self.sender[0], self.sender[1], 148, 0, 0]);
        bytes.extend([0; 8]);
        bytes.extend(uid.to_le_bytes());
        seal(&mut bytes, 0);
        let degrees = [vehicle % 100, vehicle / 100].map(|place| (place as i32 - 50) * 1_000_000);
        for (number, at) in self.entries.iter().enumerate() {
            let end = self.entries.get(number + 1).copied().unwrap_or(self.bytes.len());
            let begin = bytes.len();
            bytes.extend_from_slice(self.bytes.get(*at..end).unwrap_or_default());
            bytes.truncate(bytes.len() - 2);
            let id = bytes.get(begin..).map_or(0, id);
            if let Some(time) = bytes.get_mut(begin..begin + STAMP) {
                let at_us = u64::from_be_bytes(time.try_into().unwrap_or_default());
                time.copy_from_slice(&(at_us - self.begin_us + begin_us).to_be_bytes());
            }
            let payload = bytes.get_mut(begin + STAMP + HEADER..).unwrap_or_default();
            match id {
                SYSTEM_TIME => {
                    if let Some(utc) = payload.get_mut(..8) {
                        utc.copy_from_slice(&begin_us.to_le_bytes());
                    }
                }
                GPS_RAW_INT => moved(payload, 8, degrees),
                GLOBAL_POSITION_INT => moved(payload, 4, degrees),
                _ => {}
            }
            seal(&mut bytes, begin);
        }
        fs::write(path, bytes).with_context(|| path.display().to_string())?;
        Ok(self.entries.len() as u64 + 1)
    }
}

/// Adds to a latitude, and the longitude behind it.
fn moved(payload: &mut [u8], at: usize, by: [i32; 2]) {
    for (place, by) in payload.get_mut(at..).unwrap_or_default().chunks_exact_mut(4).zip(by) {
        let old = number(place, 0).map_or(0, i32::from_le_bytes);
        place.copy_from_slice(&old.wrapping_add(by).to_le_bytes());
    }
}

fn seal(bytes: &mut Vec<u8>, begin: usize) {
    let entry = bytes.get(begin..).unwrap_or_default();
    let extra = message(id(entry)).map_or(0, |message| message.crc_extra);
    let frame = entry.get(STAMP + 1..).unwrap_or_default();
    let crc = crc::step(crc::update(crc::START, frame), extra);
    bytes.extend(crc.to_le_bytes());
}
