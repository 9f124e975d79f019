//! A file that is there already, compared with what would be written in its place.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use crate::outcome::Differs;

/// What is compared at once.
const BUFFER_BYTES: usize = 16 * 1024;

/// A file that is compared, byte after byte.
#[derive(Debug)]
pub(super) struct There {
    file: File,
    path: PathBuf,
    buffer: Vec<u8>,
}

/// How a file relates to another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Likeness {
    /// Both have the same bytes.
    Equal,
    /// It is the beginning of the other one, or empty.
    Beginning,
    /// Neither.
    Other,
}

impl There {
    /// The file at `path`, to be compared from byte `at` on.
    pub(super) fn open(path: &Path, at: u64) -> io::Result<Self> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(at))?;
        Ok(Self { file, path: path.to_owned(), buffer: vec![0; BUFFER_BYTES] })
    }

    /// Compares the next bytes; [`Differs`] inside the error where they are others.
    pub(super) fn compare(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.next(bytes)? {
            Likeness::Equal => Ok(()),
            Likeness::Beginning | Likeness::Other => Err(io::Error::other(Differs::new(&self.path))),
        }
    }

    /// How the next bytes of the file relate to these.
    fn next(&mut self, bytes: &[u8]) -> io::Result<Likeness> {
        for bytes in bytes.chunks(BUFFER_BYTES) {
            let there = self.buffer.get_mut(..bytes.len()).unwrap_or_default();
            let mut filled = 0;
            while let Some(rest) = there.get_mut(filled..).filter(|rest| !rest.is_empty()) {
                match self.file.read(rest) {
                    Ok(0) => break,
                    Ok(got) => filled += got,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
            if there.get(..filled) != bytes.get(..filled) {
                return Ok(Likeness::Other);
            }
            if filled < bytes.len() {
                return Ok(Likeness::Beginning);
            }
        }
        Ok(Likeness::Equal)
    }

    /// Nothing more comes: the file must be at its end.
    pub(super) fn end(&mut self) -> io::Result<()> {
        match self.file.read(&mut [0])? {
            0 => Ok(()),
            _ => Err(io::Error::other(Differs::new(&self.path))),
        }
    }
}

/// How the file `there` relates to the file `new`.
pub(super) fn likeness(there: &Path, new: &Path) -> io::Result<Likeness> {
    let (mut there, mut new) = (There::open(there, 0)?, File::open(new)?);
    let mut bytes = vec![0; 64 * 1024];
    loop {
        let got = new.read(&mut bytes)?;
        let bytes = bytes.get(..got).unwrap_or_default();
        if bytes.is_empty() {
            return Ok(if there.end().is_ok() { Likeness::Equal } else { Likeness::Other });
        }
        match there.next(bytes)? {
            Likeness::Equal => {}
            unlike => return Ok(unlike),
        }
    }
}
