//! What a command makes, told by its content: `--replace` replaces nothing else.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// How much of a file is looked at.
const LOOK_BYTES: u64 = 64 * 1024;

/// A kind of output.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// What it is, for people: `a tlog`.
    pub words: &'static str,
    /// Whether a file that begins with these bytes (64 KiB, or all that it has) is one.
    pub is: fn(&[u8]) -> bool,
}

impl Kind {
    /// Whether a file is of this kind.
    pub(super) fn has(&self, path: &Path) -> io::Result<bool> {
        let mut start = Vec::new();
        File::open(path)?.take(LOOK_BYTES).read_to_end(&mut start)?;
        Ok((self.is)(&start))
    }
}
