//! Any bytes on a card, through the reader of its file system. Each found file is on the card and found once; damage
//! is reported in bounded text.
//!
//! The input is a list of changes to a small formatted card: place, offset (two bytes), length, and the bytes. A
//! place is one of the important blocks: the partition table, the volume's first blocks, its FAT, its first clusters.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::sync::OnceLock;

use hums::logs::fat::{ReadAt, Volume};
use hums_recorder::format::{BLOCKS_MIN, format};
use hums_recorder::layout::Layout;
use hums_recorder::{Block, CardDevice};

const BLOCK: u64 = 512;
/// Maximum sentences about damage: twenty, one about segments left out, one with the count of the others.
const DAMAGE_MAX: usize = 22;

/// A card in memory; blocks that were never written are zeros.
#[derive(Clone, Debug, Default)]
pub struct Card {
    blocks: RefCell<BTreeMap<u32, [u8; 512]>>,
}

impl Card {
    /// The smallest card that can be FAT32, formatted.
    ///
    /// # Panics
    /// If that fails, which is impossible.
    pub fn formatted() -> Self {
        static FORMATTED: OnceLock<BTreeMap<u32, [u8; 512]>> = OnceLock::new();
        let blocks = FORMATTED.get_or_init(|| {
            let card = Self::default();
            format(&card, 0x1234_5678).expect("it is large enough");
            let mut blocks = card.blocks.into_inner();
            blocks.retain(|_, bytes| *bytes != [0; 512]);
            blocks
        });
        Self { blocks: RefCell::new(blocks.clone()) }
    }

    /// Applies the input's changes to the card.
    pub fn change(&mut self, mut data: &[u8]) {
        let layout = Layout::read(&Self::formatted()).expect("it was just formatted");
        while let [place, low, high, length, rest @ ..] = data {
            let (bytes, rest) = rest.split_at(usize::from(*length).min(rest.len()));
            data = rest;
            let block = block_at(&layout, *place);
            let offset = usize::from(u16::from_le_bytes([*low, *high])) % 512;
            let content = self.blocks.get_mut().entry(block).or_insert([0; 512]);
            for (to, from) in content.iter_mut().skip(offset).zip(bytes) {
                *to = *from;
            }
        }
    }

    /// Each block that is not only zeros.
    pub fn blocks(&self) -> BTreeMap<u32, [u8; 512]> {
        self.blocks.borrow().clone()
    }
}

/// The block of a place in the input.
pub fn block_at(layout: &Layout, place: u8) -> u32 {
    match u32::from(place) {
        0 => 0,
        1 => layout.start,
        2 => layout.info,
        place @ 3..8 => layout.fat_start + place - 3,
        place => layout.data_start + place - 8,
    }
}

impl CardDevice for Card {
    type Error = io::Error;

    fn read(&self, blocks: &mut [Block], start: u32) -> io::Result<()> {
        let held = self.blocks.borrow();
        for (number, block) in (start..).zip(blocks) {
            *block = held.get(&number).copied().unwrap_or([0; 512]);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: u32) -> io::Result<()> {
        let written = (start..).zip(blocks).map(|(number, block)| (number, *block));
        self.blocks.borrow_mut().extend(written);
        Ok(())
    }

    fn num_blocks(&self) -> io::Result<u32> {
        Ok(BLOCKS_MIN)
    }
}

impl ReadAt for Card {
    fn read_at(&self, start: u64, buffer: &mut [u8]) -> io::Result<()> {
        buffer.fill(0);
        let end = start + buffer.len() as u64;
        let blocks = (start / BLOCK) as u32..end.div_ceil(BLOCK) as u32;
        for (&number, content) in self.blocks.borrow().range(blocks) {
            let at = u64::from(number) * BLOCK;
            let skip = start.saturating_sub(at) as usize;
            let to = buffer.iter_mut().skip(at.saturating_sub(start) as usize);
            to.zip(content.iter().skip(skip)).for_each(|(to, from)| *to = *from);
        }
        Ok(())
    }
}

/// Takes the input as changes to a card.
pub fn check(data: &[u8]) {
    let mut card = Card::formatted();
    card.change(data);
    let Ok(layout) = Layout::read(&card) else { return };
    let walk = Volume::new(&card, layout).and_then(Volume::walk).expect("memory");
    assert!(walk.damage.len() <= DAMAGE_MAX, "{} sentences", walk.damage.len());
    assert!(walk.lost_clusters <= u64::from(layout.clusters));
    let end = u64::from(layout.data_start + layout.clusters * layout.cluster_blocks) * BLOCK;
    let mut taken: Vec<(u64, u64)> = Vec::new();
    for file in &walk.files {
        let held: u64 = file.extents.iter().map(|extent| extent.length).sum();
        assert!(held <= file.size, "{}: {held} of {} bytes", file.path, file.size);
        assert!(held == file.size || !walk.damage.is_empty(), "{}: not told", file.path);
        let extents = file.extents.iter().filter(|extent| extent.length > 0);
        taken.extend(extents.map(|extent| (extent.start, extent.start + extent.length)));
    }
    taken.sort_unstable();
    assert!(taken.windows(2).all(|pair| pair[0].1 <= pair[1].0), "bytes of two files: {taken:?}");
    assert!(taken.iter().all(|(_, last)| *last <= end), "beyond the card: {taken:?}");
}
