//! Which box recorded a log, by the record of its start. That stands at the beginning of each file of a log, in its first group
//! or, where the file was open only then, in the one after it.

use hums_blackbox::{Entry, GroupDecoder, Record, Step};

/// The groups at the beginning of a file one of which has the record.
pub const HEADING_GROUPS: usize = 2;

/// The board's unique id, by the first record of its start in a group or in the beginning of one.
pub fn board_of(group: &[Step]) -> Option<[u8; 12]> {
    heading(group).filter(|uid| *uid != [0; 12])
}

/// The id that the first record of a start has, which is zeros where there is no board.
pub(super) fn heading(group: &[Step]) -> Option<[u8; 12]> {
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
