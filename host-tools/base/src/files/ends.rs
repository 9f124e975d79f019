//! The identity of a recording: its content, or the part of it that is quickly read.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use sha2::{Digest as _, Sha256};

/// Bytes at each end of a file that identify it, with its length: recordings differ at their beginning and end.
const END_BYTES: u64 = 256 * 1024;

/// Adds a file's length and its two ends to a digest.
pub fn add_ends(hash: &mut Sha256, path: &Path) -> io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    hash.update(length.to_le_bytes());
    for start in [0, length.saturating_sub(END_BYTES)] {
        file.seek(SeekFrom::Start(start))?;
        let mut bytes = Vec::new();
        file.by_ref().take(END_BYTES).read_to_end(&mut bytes)?;
        hash.update(&bytes);
    }
    Ok(())
}

/// A digest of all bytes of a file.
pub fn digest(path: &Path) -> io::Result<[u8; 32]> {
    digest_of(File::open(path)?)
}

/// A digest of all bytes to the end.
pub fn digest_of(mut bytes: impl io::Read) -> io::Result<[u8; 32]> {
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; 64 * 1024]);
    loop {
        match bytes.read(&mut buffer)? {
            0 => return Ok(hash.finalize().into()),
            got => hash.update(buffer.get(..got).unwrap_or_default()),
        }
    }
}

/// The first 32 bits of a digest.
pub fn short(hash: Sha256) -> u32 {
    hash.finalize().first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes))
}
