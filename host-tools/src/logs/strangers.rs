//! What of a log's files is not the log's: files with none of its sectors, and sectors of another session that lie where a
//! recycled file cannot have them.
//!
//! The recorder writes a file from its beginning, so the first sector of a file is at block 0, and the sector at block `n`
//! has at least the number `n`; a copy of a sector in progress may lie one block further. When the file is recycled, that
//! is still so of what is left of the older session behind the newer one. A sector with a lower number did not come there
//! that way: logs were joined into one file, or the file was made where a deleted log lay. Nor did sectors with which a
//! file of a log begins, behind a file's beginning: the record of who records stands there (`joined`).
//!
//! Nor does anything else lie between a file's own sectors, or before the first one: each whole sector lies as many blocks
//! behind the one before it as their numbers differ by, or fewer where sectors are missing; only a last copy of a sector in
//! progress may lie one block further, with one block between that is left over. What is further back was put there.

use hums_blackbox::{Header, SECTOR_BYTES, Sector, Step};

use super::board::{Board, board_of};

/// A file of which something is to be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strange {
    /// Which of the log's files.
    pub file: usize,
    /// It holds none of the log's sectors.
    pub hollow: bool,
    /// And none is missing: those before it and behind it follow each other. The card took nothing into it.
    pub passed: bool,
    /// All sectors of the log in it are older than its first one.
    pub older: bool,
    /// Sectors of other sessions: all of a hollow file, otherwise those that a recycled file cannot have.
    pub others: Option<Others>,
    /// The first place where its own sectors lie further back than their numbers say.
    pub shift: Option<Shift>,
}

/// A place in a file from which on its sectors lie too far back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shift {
    /// The block where the first such sector lies.
    pub at: u64,
    /// By how many blocks.
    pub blocks: u64,
}

/// Sectors of other sessions in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Others {
    /// How many there are.
    pub sectors: u64,
    /// The blocks of the file where the first and the last one lie.
    pub first: u64,
    /// See `first`.
    pub last: u64,
    /// The session of the first one.
    pub session: u32,
    /// The unique id of the box that recorded it, where its first sector is there.
    pub board: Option<Board>,
    /// There are sectors of further sessions.
    pub several: bool,
}

impl Others {
    fn add(
        all: &mut Option<Self>,
        at: u64,
        header: &Header,
        block: &[u8; SECTOR_BYTES],
        board: Option<Board>,
    ) {
        let session = header.session;
        let new = Self { sectors: 0, first: at, last: at, session, board, several: false };
        let others = all.get_or_insert(new);
        others.sectors += 1;
        others.last = at;
        others.several |= session != others.session;
        if header.number == 0 && others.first == at && board.is_none() {
            let sector = Sector::from_bytes(*block);
            others.board = board_of(&[Step { header: *header, sector, missing: 0, damaged: 0 }]);
        }
    }

    /// These and others of the same file.
    fn and(self, next: &Self) -> Self {
        let first = if next.first < self.first { *next } else { self };
        Self {
            sectors: self.sectors + next.sectors,
            last: self.last.max(next.last),
            several: self.several || next.several || self.session != next.session,
            ..first
        }
    }
}

/// Looks at the files of a log, block by block.
#[derive(Debug, Default)]
pub(super) struct Strangers {
    files: Vec<File>,
    /// How many places there are from which on sectors lie too far back.
    shifts: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct File {
    /// The highest number of the log's sectors that are in it.
    own: Option<u32>,
    /// The last one of them, and the block where it lies.
    last: Option<(u32, u64)>,
    /// Sectors of other sessions since the last one of the log's.
    between: Option<Others>,
    shift: Option<Shift>,
    /// The number of the first one, and the block where it lies; a copy in the second block counts as in the first one.
    begins: Option<(u32, u64)>,
    /// All sectors of other sessions, and those that a recycled file cannot have.
    others: Option<Others>,
    misplaced: Option<Others>,
}

impl Strangers {
    /// Of a log of so many files.
    pub(super) fn new(files: usize) -> Self {
        Self { files: vec![File::default(); files], shifts: 0 }
    }

    /// This block of a file is a sector of the log.
    pub(super) fn own(&mut self, file: usize, at: u64, block: &[u8; SECTOR_BYTES]) {
        let sector = Sector::from_bytes(*block);
        let (number, is_partial) = (sector.number(), sector.is_partial());
        let follows = self.files.get(file).is_some_and(|file| file.own.is_none()) && {
            let before =
                self.files.get(..file).and_then(|files| files.iter().filter_map(|file| file.own).max());
            before.map_or(0, |before| before.wrapping_add(1)) == number
        };
        let Some(file) = self.files.get_mut(file) else { return };
        let between = file.between.take();
        let blocks = match file.last {
            // What is left over of this session, or lies where others belong, is behind its file's newest sector.
            Some((last, _)) if number < last => 0,
            Some((last, there)) => (at - there).saturating_sub(u64::from(number - last)),
            // A first one that does not follow the last one of the file before may have been another file's second one.
            None if follows || between.is_some() => at,
            None => 0,
        };
        if blocks > u64::from(is_partial) {
            self.shifts += 1;
            file.shift.get_or_insert(Shift { at, blocks });
            if let Some(between) = between {
                file.misplaced = Some(file.misplaced.map_or(between, |all| all.and(&between)));
            }
        }
        file.begins.get_or_insert((number, at.saturating_sub(u64::from(is_partial))));
        file.own = file.own.max(Some(number));
        file.last = Some((number, at));
    }

    /// How many places there are from which on sectors of the log lie too far back.
    pub(super) const fn shifts(&self) -> u64 {
        self.shifts
    }

    /// This block of a file is a sector of another session, if it is sound; `joined` where another file was joined to this one
    /// before it.
    pub(super) fn other(&mut self, file: usize, at: u64, block: &[u8; SECTOR_BYTES], joined: Option<Board>) {
        let (Some(file), Ok(header)) = (self.files.get_mut(file), Header::read(block)) else { return };
        if file.own.is_none() {
            Others::add(&mut file.others, at, &header, block, None);
        }
        if joined.is_some() || u64::from(header.number) + u64::from(header.partial) < at {
            let board = joined.filter(|board| *board != [0; 12]);
            Others::add(&mut file.misplaced, at, &header, block, board);
        } else {
            Others::add(&mut file.between, at, &header, block, None);
        }
    }

    /// The files of which something is to be told, of a log whose first sector has this number, before which none is missing
    /// where `is_first`.
    pub(super) fn strange(&self, first: u32, is_first: bool) -> Vec<Strange> {
        let strange = |(index, file): (usize, &File)| {
            let (hollow, older) = (file.own.is_none(), file.own.is_some_and(|highest| highest < first));
            let others = if hollow { file.others } else { file.misplaced };
            let begins = file.begins.filter(|(number, at)| is_first && *number == first && *at > 0);
            let shift = file.shift.or_else(|| begins.map(|(_, at)| Shift { at, blocks: at }));
            let is_strange = hollow || older || others.is_some() || shift.is_some();
            let passed = hollow && self.is_passed(index, first, is_first);
            is_strange.then_some(Strange { file: index, hollow, passed, older, others, shift })
        };
        self.files.iter().enumerate().filter_map(strange).collect()
    }

    /// Whether the log's sectors go on behind this file, of which it has none, where they end before it.
    fn is_passed(&self, index: usize, first: u32, is_first: bool) -> bool {
        let (before, behind) = self.files.split_at(index.min(self.files.len()));
        let end = before.iter().filter_map(|file| file.own).max();
        // A copy of the sector in progress is there, and the sector itself is in the next file.
        let follows = |next: u32| match end {
            Some(end) => next == end || next == end.wrapping_add(1),
            None => next == first && (is_first || first == 0),
        };
        let next = behind.iter().find_map(|file| file.begins);
        next.is_some_and(|(number, _)| follows(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is strange in a log of these files of one session, and how many places there are from which on sectors lie too far
    /// back. A block is a number, `p` behind it for a copy of a sector in progress, `x` before it for another session; `-` is
    /// none of a log.
    fn look(files: &[&str], first: u32) -> (Vec<Strange>, u64) {
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
                    strangers.other(file, at, sector.bytes(), None);
                } else {
                    strangers.own(file, at, sector.bytes());
                }
            }
        }
        (strangers.strange(first, true), strangers.shifts())
    }

    #[test]
    fn what_lies_between_a_files_own_sectors_was_put_there() {
        for (files, others, shift) in [
            (&["0 1 2 x40 x41 3 4"][..], Some((2, 3, 4)), Some((5, 2))),
            (&["0 1 2 x40 3 4"], Some((1, 3, 3)), Some((4, 1))),
            (&["0 1 2 x40 x41 2p"], Some((2, 3, 4)), Some((5, 3))),
            (&["0 1 x40 x41 2p"], Some((2, 2, 3)), Some((4, 2))),
            (&["0 1", "x40 x41 2 3"], Some((2, 0, 1)), Some((2, 2))),
            (&["0 1", "x40 x41 12 13"], Some((2, 0, 1)), Some((2, 2))),
            (&["0 x40 1 2 x41 3 x50 x51"], Some((2, 1, 4)), Some((2, 1))),
            (&["0 1 2 - - 3 4"], None, Some((5, 2))),
            (&["- - 0 1"], None, Some((2, 2))),
            (&["0 1", "- 2 3"], None, Some((1, 1))),
        ] {
            let (strange, shifts) = look(files, 0);
            let one = strange.first().expect("it is strange");
            let told = one.others.map(|others| (others.sectors, others.first, others.last));
            assert_eq!((strange.len(), told), (1, others), "{files:?}");
            assert_eq!(one.shift.map(|shift| (shift.at, shift.blocks)), shift, "{files:?}");
            assert!(shifts > 0, "{files:?}");
        }
        // The first sector of a log that was recorded by arming, before which there is none.
        let (strange, _) = look(&["- - 70 71"], 70);
        assert_eq!(strange.first().and_then(|one| one.shift), Some(Shift { at: 2, blocks: 2 }));
    }

    #[test]
    fn a_file_into_which_the_card_took_nothing_lies_between_sectors_that_follow_each_other() {
        let passed = |files: &[&str], first| -> Vec<bool> {
            look(files, first).0.iter().map(|strange| strange.hollow && strange.passed).collect()
        };
        assert_eq!(passed(&["0 1 2", "- -", "3 4"], 0), [true]);
        assert_eq!(passed(&["0 1 2p", "-", "-", "2 3"], 0), [true, true], "the sector in progress once more");
        assert_eq!(passed(&["-", "0 1"], 0), [true], "the log begins behind it");
        assert_eq!(passed(&["-", "70 71"], 70), [true], "by arming");
        assert_eq!(passed(&["0 1 2", "- -", "4 5"], 0), [false], "one is missing");
        assert_eq!(passed(&["0 1 2", "- -"], 0), [false], "nothing tells what was in it");
    }

    #[test]
    fn what_a_recorder_leaves_in_a_recycled_file_is_where_it_can_be() {
        for files in [
            // A power cut: the copies of the sector in progress are at its own place or the next one.
            &["0 1 2p x3 x4"][..],
            &["0 1 2p 2p x4 x5"],
            &["0 1 x2 2p x4 x5"],
            &["0 1 2 2p x4 x5"],
            &["x0 0p x2 x3"],
            &["- 0p x2 x3"],
            // Sectors that are missing, and what the ring of a vehicle that is recorded by arming writes anew.
            &["0 1 x2 x3 4 5"],
            &["0 1 - - 4 5"],
            &["0 1 2", "3 4 5 x30"],
            &["120 121 20 21 22 23p x90", "60 61 62"],
            &["0 1", "- 12 13"],
        ] {
            assert_eq!(look(files, 0), (Vec::new(), 0), "{files:?}");
        }
    }
}
