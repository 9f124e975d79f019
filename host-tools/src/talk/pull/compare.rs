//! Whether bytes on this PC are the beginning of a board's log. Logs of two cards have the same names and, often
//! enough, the same lengths: what says that they are one is the content.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use anyhow::{Context as _, Result};
use hums_blackbox::Header;
use hums_link::ftp;

use super::ftp::Ftp;

/// What is compared where the board computes no checksum: the first sector, which names its session by a random number,
/// and the last one.
const SECTOR: u32 = 512;
/// Sectors of a file that are searched for one that is sound.
const LOOK_SECTORS: u32 = 128;

/// What a comparison says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Likeness {
    /// The checksums are equal.
    Same,
    /// The board computes none; the first and the last bytes are equal.
    SameEnds,
    /// It is another log.
    Other,
}

/// Compares the first `bytes` of a file with those of the board's log that is open by this name.
pub(super) fn compare(ftp: &mut Ftp, name: &str, path: &Path, bytes: u32) -> Result<Likeness> {
    let mut file = File::open(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    if bytes == 0 {
        return Ok(Likeness::Same);
    }
    if let Some(theirs) = ftp.checksum(name, bytes)? {
        let ours =
            checksum(&mut file, bytes).with_context(|| format!("{}: cannot be read", path.display()))?;
        return Ok(if ours == theirs { Likeness::Same } else { Likeness::Other });
    }
    for start in [0, bytes.saturating_sub(SECTOR)] {
        let wanted = SECTOR.min(bytes - start);
        let mut ours = vec![0; wanted as usize];
        file.seek(SeekFrom::Start(u64::from(start)))
            .and_then(|_| file.read_exact(&mut ours))
            .with_context(|| format!("{}: cannot be read", path.display()))?;
        let mut theirs = Vec::new();
        while theirs.len() < ours.len() {
            let had = theirs.len() as u32;
            theirs.extend(ftp.piece(start + had, wanted - had)?);
        }
        if ours != theirs {
            return Ok(Likeness::Other);
        }
    }
    Ok(Likeness::SameEnds)
}

/// Whether a file holds sectors of the session that the board's log that is open begins with. A session's number is random.
pub(super) fn is_same_session(ftp: &mut Ftp, path: &Path) -> Result<bool> {
    let mut theirs = Vec::new();
    while theirs.len() < SECTOR as usize {
        let had = theirs.len() as u32;
        theirs.extend(ftp.piece(had, SECTOR - had)?);
    }
    let theirs = theirs.first_chunk().and_then(|sector| Header::read(sector).ok());
    let Some(theirs) = theirs else { return Ok(false) };
    let mut file = File::open(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    let mut sector = [0; SECTOR as usize];
    for _ in 0..LOOK_SECTORS {
        if file.read_exact(&mut sector).is_err() {
            break;
        }
        if let Ok(ours) = Header::read(&sector) {
            return Ok(ours.session == theirs.session);
        }
    }
    Ok(false)
}

fn checksum(file: &mut File, bytes: u32) -> io::Result<u32> {
    let mut rest = file.take(u64::from(bytes));
    let (mut sum, mut buffer) = (0, vec![0; 64 * 1024]);
    loop {
        match rest.read(&mut buffer)? {
            0 if rest.limit() == 0 => return Ok(sum),
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => sum = ftp::checksum(sum, buffer.get(..count).unwrap_or_default()),
        }
    }
}
