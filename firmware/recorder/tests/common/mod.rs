//! A card in memory.
#![allow(dead_code, missing_docs, unreachable_pub, reason = "each test file uses its own part of this")]

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use hums_recorder::format::format;
use hums_recorder::{Block, Buffers, CardDevice};

/// Blocks of a mebibyte.
pub const MIB_BLOCKS: u32 = 2048;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Broken;

impl std::fmt::Display for Broken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("broken")
    }
}

impl std::error::Error for Broken {}

pub type Blocks = BTreeMap<u32, [u8; 512]>;

type Write = (u32, [u8; 512]);

/// A sparse card that keeps a journal of its writes.
#[derive(Clone)]
pub struct MemCard {
    pub size: u32,
    pub blocks: Rc<RefCell<Blocks>>,
    pub journal: Rc<RefCell<Vec<Write>>>,
    pub broken: Rc<Cell<bool>>,
    /// Write commands, of however many blocks.
    pub writes: Rc<Cell<u32>>,
    /// Blocks that were read.
    pub reads: Rc<Cell<u32>>,
    /// After this many more blocks one write fails.
    pub fail_after: Rc<Cell<Option<u32>>>,
    /// After this many more read commands one fails.
    pub fail_read_after: Rc<Cell<Option<u32>>>,
    /// Blocks with this name are written, but reported as refused.
    pub unsaid: Rc<Cell<Option<[u8; 11]>>>,
    /// This many write commands are refused from now on.
    pub refusals: Rc<Cell<u32>>,
    /// This many of a thousand block writes are refused, at random.
    pub refused_permille: Rc<Cell<u64>>,
    random: Rc<Cell<u64>>,
    /// No log of an earlier power-on is overwritten.
    pub keeps_logs: Rc<Cell<bool>>,
}

impl MemCard {
    pub fn new(size: u32) -> Self {
        Self::with(size, Blocks::new())
    }

    pub fn with(size: u32, blocks: Blocks) -> Self {
        let blocks = Rc::new(RefCell::new(blocks));
        Self {
            size,
            blocks,
            journal: Rc::default(),
            broken: Rc::default(),
            writes: Rc::default(),
            reads: Rc::default(),
            fail_after: Rc::default(),
            fail_read_after: Rc::default(),
            unsaid: Rc::default(),
            refusals: Rc::default(),
            refused_permille: Rc::default(),
            random: Rc::default(),
            keeps_logs: Rc::default(),
        }
    }

    pub fn formatted(size: u32) -> Self {
        let card = Self::new(size);
        format(&card, 0x1234_5678).expect("a card of this size can be formatted");
        card.journal.borrow_mut().clear();
        card
    }
}

impl CardDevice for MemCard {
    type Error = Broken;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), Broken> {
        self.reads.set(self.reads.get() + blocks.len() as u32);
        let left = self.fail_read_after.get();
        self.fail_read_after.set(left.and_then(|left| left.checked_sub(1)));
        if left == Some(0) {
            return Err(Broken);
        }
        for (at, block) in (start..).zip(blocks) {
            if self.broken.get() || at >= self.size {
                return Err(Broken);
            }
            *block = self.blocks.borrow().get(&at).copied().unwrap_or([0; 512]);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: u32) -> Result<(), Broken> {
        self.writes.set(self.writes.get() + 1);
        if let Some(left) = self.refusals.get().checked_sub(1) {
            self.refusals.set(left);
            return Err(Broken);
        }
        for (at, block) in (start..).zip(blocks) {
            if self.broken.get() || at >= self.size {
                return Err(Broken);
            }
            let random = self.random.get().wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            self.random.set(random);
            if (random >> 33) % 1000 < self.refused_permille.get() {
                return Err(Broken);
            }
            match self.fail_after.get() {
                Some(0) => {
                    self.fail_after.set(None);
                    return Err(Broken);
                }
                left => self.fail_after.set(left.map(|left| left - 1)),
            }
            self.journal.borrow_mut().push((at, *block));
            self.blocks.borrow_mut().insert(at, *block);
            if let Some(name) = self.unsaid.get()
                && block.as_chunks::<32>().0.iter().any(|entry| entry.starts_with(&name))
            {
                return Err(Broken);
            }
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<u32, Broken> {
        Ok(self.size)
    }

    fn keeps_logs(&self) -> bool {
        self.keeps_logs.get()
    }
}

/// A parity buffer for the whole test run.
pub fn held() -> &'static Buffers {
    Box::leak(Box::new(Buffers::new()))
}
