//! What of a log's files is not the log's: files with none of its sectors, and sectors of another session that lie where a
//! recycled file cannot have them.
//!
//! The recorder writes a file from its beginning, so the first sector of a file is at block 0, and the sector at block `n`
//! has at least the number `n`; a copy of a sector in progress may lie one block further. When the file is recycled, that
//! is still so of what is left of the older session behind the newer one. A sector with a lower number did not come there
//! that way: logs were joined into one file, or the file was made where a deleted log lay. Nor did sectors with which a
//! file of a log begins, behind a file's beginning: the record of who records stands there (`joined`).

use hums_blackbox::{Header, SECTOR_BYTES, Sector, Step};

use super::board::{Board, board_of};

/// A file of which something is to be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strange {
    /// Which of the log's files.
    pub file: usize,
    /// It holds none of the log's sectors.
    pub hollow: bool,
    /// All sectors of the log in it are older than its first one.
    pub older: bool,
    /// Sectors of other sessions: all of a hollow file, otherwise those that a recycled file cannot have.
    pub others: Option<Others>,
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
}

/// Looks at the files of a log, block by block.
#[derive(Debug, Default)]
pub(super) struct Strangers {
    files: Vec<File>,
}

#[derive(Clone, Copy, Debug, Default)]
struct File {
    /// The highest number of the log's sectors that are in it.
    own: Option<u32>,
    /// All sectors of other sessions, and those that a recycled file cannot have.
    others: Option<Others>,
    misplaced: Option<Others>,
}

impl Strangers {
    /// Of a log of so many files.
    pub(super) fn new(files: usize) -> Self {
        Self { files: vec![File::default(); files] }
    }

    /// This block of a file is a sector of the log.
    pub(super) fn own(&mut self, file: usize, block: &[u8; SECTOR_BYTES]) {
        if let Some(file) = self.files.get_mut(file) {
            file.own = file.own.max(Some(Sector::from_bytes(*block).number()));
        }
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
        }
    }

    /// The files of which something is to be told, of a log whose first sector has this number.
    pub(super) fn strange(&self, first: u32) -> Vec<Strange> {
        let strange = |(index, file): (usize, &File)| {
            let (hollow, older) = (file.own.is_none(), file.own.is_some_and(|highest| highest < first));
            let others = if hollow { file.others } else { file.misplaced };
            (hollow || older || others.is_some()).then_some(Strange { file: index, hollow, older, others })
        };
        self.files.iter().enumerate().filter_map(strange).collect()
    }
}
