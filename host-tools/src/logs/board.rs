//! Which box recorded a log, by the first of its records.

use hums_blackbox::{Entry, GroupDecoder, Record, Step};

/// The board's unique id, by the record of its start, which is the first of a session.
pub fn board_of(first: &Step) -> Option<[u8; 12]> {
    let mut decoder = Box::new(GroupDecoder::new());
    decoder.push(&first.header, &first.sector).ok()?;
    while let Some(Ok(entry)) = decoder.next_entry() {
        if let Entry::Record { record: Record::Boot(boot), .. } = entry {
            return Some(boot.uid).filter(|uid| *uid != [0; 12]);
        }
    }
    None
}
