//! What tells whether two logs hold the same sectors, wherever they lie.

use std::vec;

use anyhow::Result;
use hums_blackbox::Step;
use sha2::{Digest as _, Sha256};

use super::groups::{Group, Groups};
use super::places::Log;

/// Of every sector's number and checksum: equal of copies only.
pub type Fingerprint = [u8; 16];

/// Makes the fingerprint of groups in their order.
#[derive(Debug, Default)]
pub struct Fingerprinter(Sha256);

impl Fingerprinter {
    /// Takes the next group.
    pub fn add(&mut self, group: &Group) {
        for step in group {
            self.0.update(step.header.number.to_le_bytes());
            // A sector's last four bytes are its checksum.
            self.0.update(step.sector.bytes().last_chunk::<4>().unwrap_or(&[0; 4]));
        }
    }

    /// Of all that was taken.
    pub fn finish(self) -> Fingerprint {
        self.0.finalize().first_chunk().copied().unwrap_or_default()
    }
}

/// Reads a log's sectors, and decodes none.
pub fn fingerprint(log: &Log) -> Result<Fingerprint> {
    let (mut groups, mut all) = (Groups::new(log), Fingerprinter::default());
    while let Some(group) = groups.next_group()? {
        all.add(&group);
    }
    Ok(all.finish())
}

/// How many sectors `long` has more than `short`, where all of `short` is the beginning of it; none where it is not. The last sector of
/// `short` may be an older copy of one that was in progress.
pub fn longer_by(short: &Log, long: &Log) -> Result<Option<u32>> {
    let (mut short, mut long) = (Steps::of(short), Steps::of(long));
    let (mut same, mut is_older) = (0_u32, false);
    while let Some(one) = short.next()? {
        let Some(other) = long.next()? else { return Ok(None) };
        let is_same = one.sector.bytes().last_chunk::<4>() == other.sector.bytes().last_chunk();
        if is_older || one.header.number != other.header.number || !is_same && !one.header.partial {
            return Ok(None);
        }
        is_older = !is_same;
        same += u32::from(is_same);
    }
    let mut more = 0;
    while long.next()?.is_some() {
        more += 1;
    }
    Ok(Some(more).filter(|more| same > 0 && *more > 0))
}

/// A log's sectors one by one.
struct Steps<'a> {
    groups: Groups<'a>,
    group: vec::IntoIter<Step>,
}

impl<'a> Steps<'a> {
    fn of(log: &'a Log) -> Self {
        Self { groups: Groups::new(log), group: Vec::new().into_iter() }
    }

    fn next(&mut self) -> Result<Option<Step>> {
        loop {
            if let Some(step) = self.group.next() {
                return Ok(Some(step));
            }
            let Some(group) = self.groups.next_group()? else { return Ok(None) };
            self.group = group.into_iter();
        }
    }
}
