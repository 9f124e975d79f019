//! Foreign sectors in a log's files.
//!
//! The recorder writes a file from its beginning, so the sector at block `n` has at least the number `n`. A
//! copy of a sector in progress may be one block further. So in a recycled file the older session's sectors
//! follow the newest one.

use hums_blackbox::{Header, SECTOR_BYTES};

/// Foreign sectors in a file, or a file without any own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignSectors {
    /// Index of the file.
    pub file: usize,
    /// No sector of the log.
    pub hollow: bool,
    /// Sectors of other sessions.
    pub sectors: u64,
    /// Block of the first one.
    pub first: u64,
    /// Session of the first one.
    pub session: u32,
}

#[derive(Debug, Default)]
pub(super) struct Strangers(Vec<File>);

#[derive(Clone, Copy, Debug, Default)]
struct File {
    own: bool,
    /// All, and those that a recycled file cannot have.
    others: Option<ForeignSectors>,
    misplaced: Option<ForeignSectors>,
}

impl Strangers {
    pub(super) fn new(files: usize) -> Self {
        Self(vec![File::default(); files])
    }

    pub(super) fn own(&mut self, file: usize) {
        if let Some(file) = self.0.get_mut(file) {
            file.own = true;
        }
    }

    /// A foreign sector, if it is sound.
    pub(super) fn other(&mut self, index: usize, at: u64, block: &[u8; SECTOR_BYTES]) {
        let (Some(file), Ok(header)) = (self.0.get_mut(index), Header::read(block)) else { return };
        let new =
            ForeignSectors { file: index, hollow: false, sectors: 0, first: at, session: header.session };
        file.others.get_or_insert(new).sectors += 1;
        if u64::from(header.number) + u64::from(header.partial) < at {
            file.misplaced.get_or_insert(new).sectors += 1;
        }
    }

    pub(super) fn strange(&self) -> Vec<ForeignSectors> {
        let strange = |(index, file): (usize, &File)| {
            let none = ForeignSectors { file: index, hollow: true, sectors: 0, first: 0, session: 0 };
            let others = ForeignSectors { hollow: true, ..file.others.unwrap_or(none) };
            if file.own { file.misplaced } else { Some(others) }
        };
        self.0.iter().enumerate().filter_map(strange).collect()
    }
}

#[cfg(test)]
mod tests {
    use hums_blackbox::Sector;

    use super::*;

    /// A block is a number, with `p` after it for a copy in progress, `x` before it for another session. `-`
    /// is a block without a sector.
    fn look(files: &[&str]) -> Vec<(usize, bool, u64, u64)> {
        let mut strangers = Strangers::new(files.len());
        for (file, blocks) in files.iter().enumerate() {
            for (at, block) in (0..).zip(blocks.split(' ')) {
                let Ok(number) = block.trim_matches(['x', 'p']).parse::<u32>() else { continue };
                let mut bytes = [0; SECTOR_BYTES];
                bytes[..3].copy_from_slice(&[b'H', 0xb0 | hums_blackbox::VERSION, 1]);
                bytes[11..15].copy_from_slice(&number.to_le_bytes());
                let mut sector = Sector::from_bytes(bytes);
                sector.set_partial(block.ends_with('p'));
                let is_other = block.starts_with('x');
                sector.seal(if is_other { 2 } else { 1 });
                if is_other {
                    strangers.other(file, at, sector.bytes());
                } else {
                    strangers.own(file);
                }
            }
        }
        strangers.strange().iter().map(|one| (one.file, one.hollow, one.sectors, one.first)).collect()
    }

    #[test]
    fn sectors_that_a_recycled_file_cannot_have_are_not_of_the_log() {
        assert_eq!(look(&["0 1 2 x0 x1 x2"]), [(0, false, 3, 3)], "joined");
        assert_eq!(look(&["0 1", "x0 x1 x2"]), [(1, true, 3, 0)]);
        assert_eq!(look(&["0 1 x7 x2 x3"]), [(0, false, 2, 3)]);
        for files in [&["0 1 2p x3 x4"][..], &["0 1 2 2p x4 x5"], &["0 1 x2p x4"], &["0 1 - -", "2 3"]] {
            assert_eq!(look(files), [], "{files:?}");
        }
        assert_eq!(look(&["0 1 - -", "-", "2 3"]), [(1, true, 0, 0)], "an empty file");
    }
}
