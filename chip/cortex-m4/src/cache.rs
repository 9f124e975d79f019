//! Decoded instructions by address: each is decoded once.

use crate::op::Op;

/// 256 KiB of code without a conflict.
const ENTRIES: usize = 1 << 17;
/// Entries are discarded by page.
const PAGE_BITS: u32 = 8;

/// A decoded instruction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// The address; bit 0 is set for an instruction in an IT block.
    pub(crate) tag: u32,
    pub(crate) op: Op,
    /// 2 or 4 bytes.
    pub(crate) bytes: u8,
    /// Cycles without wait states: see [`crate::timing`].
    pub(crate) cycles: u8,
    pub(crate) writes: u8,
}

const EMPTY: Entry = Entry { tag: u32::MAX, op: Op::Undefined, bytes: 2, cycles: 1, writes: 0x1F };

pub(crate) struct Cache {
    entries: Box<[Entry; ENTRIES]>,
    pages: Box<[u64; 1 << 9]>,
}

impl Default for Cache {
    fn default() -> Self {
        let boxed = vec![EMPTY; ENTRIES].into_boxed_slice().try_into();
        Cache { entries: boxed.unwrap_or_else(|_| unreachable!()), pages: Box::new([0; 1 << 9]) }
    }
}

#[inline]
fn page(address: u32) -> (usize, u64) {
    let page = (address >> PAGE_BITS & 0xFFF) | address >> 29 << 12;
    ((page >> 6) as usize & 511, 1 << (page & 63))
}

impl Cache {
    #[inline(always)]
    pub(crate) fn get(&self, tag: u32) -> &Entry {
        &self.entries[(tag >> 1) as usize & (ENTRIES - 1)]
    }

    pub(crate) fn put(&mut self, entry: Entry) {
        for address in [entry.tag, entry.tag.wrapping_add(u32::from(entry.bytes) - 1)] {
            let (word, bit) = page(address);
            self.pages[word] |= bit;
        }
        self.entries[(entry.tag >> 1) as usize & (ENTRIES - 1)] = entry;
    }

    #[inline(always)]
    pub(crate) fn stored(&mut self, address: u32) {
        let (word, bit) = page(address);
        if self.pages[word] & bit != 0 {
            self.forget(address, 4);
        }
    }

    /// Pages of these bytes, also an instruction that reaches into them from the page before.
    pub(crate) fn forget(&mut self, address: u32, bytes: u32) {
        let first = address >> PAGE_BITS;
        let last = address.saturating_add(bytes.max(1) - 1) >> PAGE_BITS;
        for number in first..=last {
            let start = number << PAGE_BITS;
            let (word, bit) = page(start);
            if self.pages[word] & bit == 0 {
                continue;
            }
            for offset in 0..=1 << (PAGE_BITS - 1) {
                let tag = start.wrapping_sub(2).wrapping_add(offset * 2);
                let entry = &mut self.entries[(tag >> 1) as usize & (ENTRIES - 1)];
                if entry.tag & !1 == tag {
                    *entry = EMPTY;
                }
            }
            // Bits stay set: another region's page may share them.
        }
    }

    pub(crate) fn clear(&mut self) {
        self.entries.fill(EMPTY);
        self.pages.fill(0);
    }
}
