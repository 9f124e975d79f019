//! What a command makes, told by its content: `--replace` replaces nothing else, and of that nothing that may be an
//! original.

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
    /// What tells that this program made it.
    pub origin: Origin,
}

/// What tells that a file was made by this program, and of which log.
#[derive(Clone, Copy, Debug)]
pub enum Origin {
    /// Nothing else makes such files, and nothing original is in them.
    Ours,
    /// Its beginning tells of which log it was made (`s1a2b3c4d`); `None`: of nobody knows what.
    Told(fn(&[u8]) -> Option<String>),
    /// Its content does not tell: others make such files too.
    Unknown,
}

/// What a file that is there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// It was made of the same log.
    Same,
    /// Of that kind, and perhaps an original, or made of another log.
    Kind,
    /// Anything else.
    Other,
}

impl Kind {
    /// What the file at `path` is, where this kind is to be made of the log `of`. A file whose name tells the log was made
    /// of it: nothing but this program names files so.
    pub(super) fn found(&self, path: &Path, of: Option<&str>) -> io::Result<Found> {
        let mut start = Vec::new();
        File::open(path)?.take(LOOK_BYTES).read_to_end(&mut start)?;
        if !(self.is)(&start) {
            return Ok(Found::Other);
        }
        let same = match self.origin {
            Origin::Ours => true,
            _ if of.is_some_and(|of| is_named_after(path, of)) => true,
            Origin::Told(told) => of.is_some() && told(&start).as_deref() == of,
            Origin::Unknown => false,
        };
        Ok(if same { Found::Same } else { Found::Kind })
    }
}

/// Whether a name has the log's identity at its end, before the endings: `00001-s1a2b3c4d.tlog`, `00001-s1a2b3c4d-2.tlog`.
fn is_named_after(path: &Path, of: &str) -> bool {
    let name = path.file_name().map_or_else(Default::default, |name| name.to_string_lossy());
    let after = name.rsplit_once(&format!("-{of}")).map(|(_, after)| after);
    after.is_some_and(|after| {
        let number =
            after.strip_prefix('-').map(|after| after.trim_start_matches(|c: char| c.is_ascii_digit()));
        number.unwrap_or(after).starts_with('.')
    })
}
