//! Fingerprints: equal for logs with the same sectors.

use anyhow::Result;
use sha2::{Digest as _, Sha256};

use super::groups::{Group, Groups};
use super::places::Log;

/// Hash of every sector's number and checksum: equal for copies only.
pub type Fingerprint = [u8; 16];

/// Takes groups in order.
#[derive(Debug, Default)]
pub struct Fingerprinter(Sha256);

impl Fingerprinter {
    /// Takes the next group.
    pub fn add(&mut self, group: &Group) {
        for step in group {
            self.0.update(step.header.number.to_le_bytes());
            self.0.update(step.sector.bytes().last_chunk::<4>().unwrap_or(&[0; 4]));
        }
    }

    /// The hash of all sectors.
    pub fn finish(self) -> Fingerprint {
        self.0.finalize().first_chunk().copied().unwrap_or_default()
    }
}

/// Reads a log's sectors without decoding them.
pub fn fingerprint(log: &Log) -> Result<Fingerprint> {
    let (mut groups, mut all) = (Groups::new(log), Fingerprinter::default());
    while let Some(group) = groups.next_group()? {
        all.add(&group);
    }
    Ok(all.finish())
}
