//! Which box recorded a log, by the record of its start. That stands at the beginning of each file of a log, in its first group
//! or, where the file was open only then, in the one after it.

use hums_blackbox::record::Boot;
use hums_blackbox::{Entry, GroupDecoder, Record, Step};

/// The groups at the beginning of a file one of which has the record.
pub const HEADING_GROUPS: usize = 2;

/// A board's unique id; zeros where there is no board.
pub type Board = [u8; 12];

/// The board's unique id, by the first record of its start in a group or in the beginning of one.
pub fn board_of(group: &[Step]) -> Option<Board> {
    heading(group).and_then(known)
}

/// The id of a record of a start, where it is a board's.
pub fn known(uid: Board) -> Option<Board> {
    Some(uid).filter(|uid| *uid != [0; 12])
}

/// The id that the first record of a start has, which is zeros where there is no board.
pub fn heading(group: &[Step]) -> Option<Board> {
    find_boot(group, |boot| Some(boot.uid))
}

/// What is wanted of the first record of a start that has it, in a group or in the beginning of one.
pub fn find_boot<T>(group: &[Step], wanted: impl Fn(&Boot<'_>) -> Option<T>) -> Option<T> {
    let mut decoder = Box::new(GroupDecoder::new());
    for step in group {
        decoder.push(&step.header, &step.sector).ok()?;
        while let Some(Ok(entry)) = decoder.next_entry() {
            if let Entry::Record { record: Record::Boot(boot), .. } = entry
                && let Some(found) = wanted(&boot)
            {
                return Some(found);
            }
        }
    }
    None
}
