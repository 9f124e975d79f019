//! The box that recorded a log, from the record of its start. The record is at the beginning of each file of
//! a log. It is in the first group, or in the second one if the file was opened later.

use hums_blackbox::{Entry, GroupDecoder, Record, Step};

/// Number of groups at the beginning of a file, one with the record.
pub const HEADING_GROUPS: usize = 2;

/// A board's unique id; zeros without a board.
pub type Board = [u8; 12];

/// The board's unique id, by the first record of its start in a group or in the beginning of one.
pub fn board_of(group: &[Step]) -> Option<Board> {
    heading(group).and_then(known)
}

/// The id in a record of a start, if it is a board's.
pub fn known(uid: Board) -> Option<Board> {
    Some(uid).filter(|uid| *uid != [0; 12])
}

/// The id in the first record of a start in a group or its beginning; zeros without a board.
pub fn heading(group: &[Step]) -> Option<Board> {
    let mut decoder = Box::new(GroupDecoder::new());
    for step in group {
        decoder.push(&step.header, &step.sector).ok()?;
        while let Some(Ok(entry)) = decoder.next_entry() {
            if let Entry::Record { record: Record::Boot(boot), .. } = entry {
                return Some(boot.uid);
            }
        }
    }
    None
}
