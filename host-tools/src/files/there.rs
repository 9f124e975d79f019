//! A file that is there already, compared with what would be written in its place.

use std::fs::{self, File};
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom};
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
        for bytes in bytes.chunks(BUFFER_BYTES) {
            let there = self.buffer.get_mut(..bytes.len()).unwrap_or_default();
            match self.file.read_exact(there) {
                Ok(()) if there == bytes => {}
                Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(error),
                _ => return Err(io::Error::other(Differs(self.path.clone()))),
            }
        }
        Ok(())
    }

    /// Nothing more comes: the file must be at its end.
    pub(super) fn end(&mut self) -> io::Result<()> {
        match self.file.read(&mut [0])? {
            0 => Ok(()),
            _ => Err(io::Error::other(Differs(self.path.clone()))),
        }
    }
}

/// How the file `there` relates to the file `new`.
pub(super) fn likeness(there: &Path, new: &Path) -> io::Result<Likeness> {
    let (length, length_new) = (fs::metadata(there)?.len(), fs::metadata(new)?.len());
    if length > length_new {
        return Ok(Likeness::Other);
    }
    let (mut there, mut new) = (BufReader::new(File::open(there)?), File::open(new)?.take(length));
    let mut ours = vec![0; 64 * 1024];
    let mut theirs = ours.clone();
    loop {
        let got = new.read(&mut ours)?;
        let (Some(ours), Some(theirs)) = (ours.get(..got), theirs.get_mut(..got)) else {
            return Ok(Likeness::Other);
        };
        if got == 0 {
            return Ok(if length == length_new { Likeness::Equal } else { Likeness::Beginning });
        }
        there.read_exact(theirs)?;
        if ours != theirs {
            return Ok(Likeness::Other);
        }
    }
}
