//! Any file as a log or an image of a card: found logs are readable to their end.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use hums::logs::{self, find};
use hums::summary::Overview;
use hums_blackbox::{SECTOR_BYTES, Sector};
use hums_recorder::format::BLOCKS_MIN;

use crate::card::Card;
use crate::file::with_file;

/// The card's block of the input: among its first clusters.
const BLOCK: u32 = 4_096;

/// The first byte selects the kind of file, the others are its bytes:
/// - bit 0: sectors get a valid check;
/// - bit 1: every block is examined;
/// - bits 2 to 4 all set: the bytes are put on a card.
pub fn check(data: &[u8]) {
    let Some((&mode, bytes)) = data.split_first() else { return };
    let mut bytes = bytes.to_vec();
    if mode & 1 != 0 {
        for block in bytes.as_chunks_mut::<SECTOR_BYTES>().0 {
            let session = u32::from_le_bytes([block[7], block[8], block[9], block[10]]);
            let mut sector = Sector::from_bytes(*block);
            sector.seal(session);
            *block = *sector.bytes();
        }
    }
    let salvage = mode & 2 != 0;
    if mode & 0x1c == 0x1c {
        with_file(&[], |path| {
            put_on_card(path, &bytes).expect("a sparse file");
            look(path, salvage);
        });
    } else {
        with_file(&bytes, |path| look(path, salvage));
    }
}

fn put_on_card(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::options().write(true).open(path)?;
    file.set_len(u64::from(BLOCKS_MIN) * 512)?;
    let mut blocks = Card::formatted().blocks();
    for (number, part) in (BLOCK..).zip(bytes.chunks(512)) {
        let mut block = [0; 512];
        block[..part.len()].copy_from_slice(part);
        blocks.insert(number, block);
    }
    for (number, block) in blocks {
        file.seek(SeekFrom::Start(u64::from(number) * 512))?;
        file.write_all(&block)?;
    }
    Ok(())
}

fn look(path: &Path, salvage: bool) {
    find::look(path).expect("it can be read");
    let length = path.metadata().expect("it is there").len();
    let Ok(found) = logs::find(&[path.to_owned()], salvage) else { return };
    let names: BTreeSet<&str> = found.logs.iter().map(|log| log.name.as_str()).collect();
    assert_eq!(names.len(), found.logs.len(), "names are unique");
    for log in &found.logs {
        let overview = Overview::verified(log).expect("it can be read");
        let blocks = overview.ending.summary.blocks;
        assert_eq!(blocks.blocks, log.bytes().div_ceil(512), "each block is accounted for");
        assert!(log.bytes() <= length);
        assert!(overview.contents.frames() <= overview.ending.summary.frames);
    }
}
