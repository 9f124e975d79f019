//! What a command makes, told by its content: `--replace` replaces nothing else, and of that nothing that may be an
//! original, or has something behind it.

use std::fs::File;
use std::io::{self, Read as _, Seek as _};
use std::path::Path;

use super::amount::Amount;

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
    /// Its content tells.
    Told {
        /// Of which log (`s1a2b3c4d`), by its beginning; `None`: of nobody knows what.
        of: fn(&[u8]) -> Option<String>,
        /// Whether all of the file was made of that one, to its end.
        all: fn(File, &str) -> io::Result<bool>,
        /// How much of it is in the file, where its beginning tells that.
        amount: fn(&[u8]) -> Option<Amount>,
    },
    /// Its content does not tell: others make such files too.
    Unknown,
}

/// What a file that is there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// It was made of the same log, and has so much of it, where that is known.
    Same(Option<Amount>),
    /// Of that kind, and perhaps an original, or made of another log.
    Kind,
    /// Anything else.
    Other,
}

impl Kind {
    /// What the file at `path`, which is no link, is where this kind is to be made of the log `of`. A file whose name tells
    /// the log was made of it: nothing but this program names files so.
    pub(super) fn found(&self, path: &Path, of: Option<&str>) -> io::Result<Found> {
        let mut file = File::open(path)?;
        let mut start = Vec::new();
        file.by_ref().take(LOOK_BYTES).read_to_end(&mut start)?;
        if !(self.is)(&start) {
            return Ok(Found::Other);
        }
        let is_named = of.is_some_and(|of| is_named_after(path, of));
        Ok(match self.origin {
            Origin::Ours => Found::Same(None),
            Origin::Told { of: told, all, amount } => {
                let told = told(&start);
                let is_same = is_named || of.is_some() && told.as_deref() == of;
                file.rewind()?;
                if is_same && all(file, &told.unwrap_or_default())? {
                    Found::Same(amount(&start))
                } else {
                    Found::Kind
                }
            }
            Origin::Unknown if is_named => Found::Same(None),
            Origin::Unknown => Found::Kind,
        })
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
