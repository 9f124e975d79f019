//! Any file through the reader of logs: reading ends, and counts each block by kind.

use hums_blackbox::{Header, SECTOR_BYTES, Sector};

use crate::log;

/// The first byte's lowest bit selects whether checks are corrected, so that the content is reached; the others are
/// the file.
pub fn check(data: &[u8]) {
    let Some((&mode, file)) = data.split_first() else { return };
    let mut blocks: Vec<[u8; SECTOR_BYTES]> = file.as_chunks().0.to_vec();
    if mode & 1 != 0 {
        for block in &mut blocks {
            let session = u32::from_le_bytes([block[7], block[8], block[9], block[10]]);
            let mut sector = Sector::from_bytes(*block);
            sector.seal(session);
            *block = *sector.bytes();
        }
    }
    // Each block completes at most its own number of entries, and ends or begins at most one gap.
    let said: u64 =
        blocks.iter().filter_map(|block| Some(u64::from(Header::read(block).ok()?.entries()))).sum();
    let items_max = said + 2 * blocks.len() as u64 + 4;
    let mut items = 0;
    let end = log::read(&blocks, |_| {
        items += 1;
        assert!(items <= items_max, "more items than there can be");
    });
    let seen = end.blocks;
    let ours = seen.sectors + seen.superseded + seen.misplaced + seen.damaged;
    let kinds = ours + seen.stale + seen.unsound + seen.empty + seen.erased + seen.foreign;
    assert_eq!((seen.blocks, kinds), (blocks.len() as u64, blocks.len() as u64));
}
