//! Assembler: puts the blocks of a medium in order as sectors. It drops stale blocks, selects among copies of a sector, and
//! reports missing sectors.
//!
//! The recorder writes partial copies of an unfinished sector alternately to its own block and the next one. So the fullest of
//! adjacent copies counts, and one sector is held back.
//!
//! A card may also misplace a page. So a jump ahead is accepted only if the next [`PAGE_SECTORS`] sectors continue from it. If
//! the skipped numbers follow after all, the sectors ahead of them are dropped as misplaced.

use heapless::Deque;

use crate::parity::Parity;
use crate::sector::{Header, NotASector, SECTOR_BYTES, Sector, VERSION};

/// Sectors of the largest page that a card may put in the wrong place: 16 KiB.
pub const PAGE_SECTORS: usize = 32;

/// A page, and one sector more, which decides.
const AHEAD_MAX: usize = PAGE_SECTORS + 1;

macro_rules! block_counts {
    ($($(#[$doc:meta])+ $name:ident,)+) => {
        /// Counts of blocks of 512 bytes.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct BlockCounts {
            $($(#[$doc])+ pub $name: u64,)+
        }

        impl BlockCounts {
            /// Counts since `before`.
            #[must_use]
            pub const fn since(&self, before: &Self) -> Self {
                Self { $($name: self.$name - before.$name,)+ }
            }
        }
    };
}

block_counts! {
    /// All blocks.
    blocks,
    /// Sectors given out.
    sectors,
    /// Copies of a sector in progress that a fuller one supersedes, and sectors from before the log's first one, which
    /// its file held before.
    superseded,
    /// Complete sectors of this session that are duplicates or misplaced.
    misplaced,
    /// Blocks apparently of this session with a wrong checksum: torn or damaged.
    damaged,
    /// Valid sectors of another session, left from an earlier file.
    stale,
    /// Blocks that begin like a sector, have a wrong checksum and apparently belong to an older session or to none.
    unsound,
    /// Parity sectors of this session, sound or not; those of others are stale.
    parity,
    /// Sectors rebuilt from parity, also counted by their kind.
    repaired,
    /// All zeros.
    empty,
    /// All ones: erased.
    erased,
    /// Any other block, for example a sector of another format version.
    foreign,
    /// Blocks of an older format version, which this build does not read, also counted as foreign.
    older_version,
    /// Blocks of a newer version, or sealed ones.
    newer_version,
}

/// A sector in order.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Its header.
    pub header: Header,
    /// The sector.
    pub sector: Sector,
    /// Numbers missing before this sector.
    pub missing: u32,
    /// Invalid or misplaced blocks between the previous sector and this one.
    pub damaged: u32,
}

/// Orders the sectors of one session. After each block, [`Self::next`] returns the sectors known to be in order.
#[derive(Debug, Default)]
pub struct Assembler {
    session: Option<u32>,
    held: Option<Step>,
    out: Option<Step>,
    /// Sectors after a jump of the number, until the log is known to continue with them.
    ahead: Deque<Step, AHEAD_MAX>,
    /// The log continues with them; they are being returned.
    believed: bool,
    /// Earlier files of the log are lost, so the first file does not begin with number 0.
    late: bool,
    ended: bool,
    first_number: Option<u32>,
    last_number: Option<u32>,
    bad_blocks: u32,
    bad_own: u32,
    counts: BlockCounts,
    at_last: BlockCounts,
}

impl Assembler {
    /// An assembler for the session of the first sound sector.
    pub fn new() -> Self {
        Self::default()
    }

    /// An assembler for this session only.
    pub fn for_session(session: u32) -> Self {
        Self { session: Some(session), ..Self::default() }
    }

    /// A log whose first files are gone, by the names of the others. So its first file does not begin with number 0,
    /// and lower numbers in it are old: the recorder reused a file of this session.
    #[must_use]
    pub fn beginning_late(self) -> Self {
        Self { late: true, ..self }
    }

    /// Starts another file of the log: sectors ahead in the first file are accepted. Call [`Self::next`] until it gives `None`
    /// before the next block.
    pub fn begin_file(&mut self) {
        self.believed |= self.late && !self.has_begun();
    }

    const fn has_begun(&self) -> bool {
        self.held.is_some() || self.last_number.is_some()
    }

    /// Takes the next block. Before each block, call [`Self::next`] until it returns `None`.
    pub fn feed(&mut self, block: &[u8; SECTOR_BYTES]) {
        self.counts.blocks += 1;
        let header = match Header::read(block) {
            Ok(header) => header,
            Err(error) => return self.count(error, block),
        };
        if *self.session.get_or_insert(header.session) != header.session {
            self.counts.stale += 1;
            return;
        }
        let sector = Sector::from_bytes(*block);
        self.place(Step { header, sector, missing: 0, damaged: 0 });
    }

    /// Takes a block of zeros, which is only counted.
    pub const fn skip_empty(&mut self) {
        self.counts.blocks += 1;
        self.counts.empty += 1;
    }

    /// Takes a block that belongs to another file, which counts among all blocks only.
    pub const fn pass_over(&mut self) {
        self.counts.blocks += 1;
    }

    /// The fullest of its number; `None`: feed the next block.
    #[expect(clippy::should_implement_trait, reason = "it goes on after `None`")]
    pub fn next(&mut self) -> Option<Step> {
        loop {
            if let Some(step) = self.out.take() {
                self.given(&step.header);
                return Some(step);
            }
            if self.believed
                && let Some(step) = self.ahead.pop_front()
            {
                self.hold(step);
                continue;
            }
            self.believed = false;
            if !self.ended {
                return None;
            }
            let step = self.held.take()?;
            self.given(&step.header);
            return Some(step);
        }
    }

    /// Ends the input: [`Self::next`] returns the remaining sectors.
    pub const fn end(&mut self) {
        self.ended = true;
        self.believed = true;
    }

    fn place(&mut self, mut step: Step) {
        let number = step.header.number;
        let last = self.held.as_ref().map(|held| held.header.number).or(self.last_number);
        match last {
            Some(last) if number <= last => self.behind(&step, last),
            _ if number == last.map_or(0, |last| last.wrapping_add(1)) => {
                self.drop_ahead();
                step.damaged = core::mem::take(&mut self.bad_blocks);
                self.reached();
                self.hold(step);
            }
            _ => self.jumped(step),
        }
    }

    fn behind(&mut self, step: &Step, last: u32) {
        let number = step.header.number;
        let before_all = self.first_number.is_none_or(|first| number < first);
        if step.header.partial || before_all {
            self.counts.superseded += 1;
        } else if let Some(held) = &self.held
            && number == last
            && held.header.partial
        {
            self.counts.superseded += 1;
        } else {
            self.counts.misplaced += 1;
        }
        if let Some(held) = self.held.as_mut().filter(|held| held.header.number == number) {
            replace(held, step);
            if self.ahead.is_empty() {
                self.reached();
            }
        }
    }

    fn jumped(&mut self, mut step: Step) {
        // Before the first output, only a log that begins at number 0 has known places: lower numbers in a ring's
        // oldest file are old.
        let number = step.header.number;
        let is_in_place = !self.late && u64::from(number) + 1 == self.counts.blocks;
        let begun = self.has_begun();
        // The recorder rewrites a file only with other files between its old and its new sectors.
        let first = self.ahead.front().map(|first| first.header.number);
        let is_left_over = step.header.partial || first.is_none_or(|first| number.saturating_add(1) < first);
        match self.ahead.back_mut() {
            Some(last) if last.header.number > number && !begun && !is_in_place => {
                let counts = &mut self.counts;
                *(if is_left_over { &mut counts.superseded } else { &mut counts.misplaced }) += 1;
                return;
            }
            Some(last) if last.header.number == number => {
                let is_copy = last.header.partial || step.header.partial;
                let counts = &mut self.counts;
                *(if is_copy { &mut counts.superseded } else { &mut counts.misplaced }) += 1;
                replace(last, &step);
                return;
            }
            Some(last) if last.header.number > step.header.number => self.drop_ahead(),
            _ => {}
        }
        step.damaged = core::mem::take(&mut self.bad_blocks);
        self.reached();
        // There is room: a full row is given out or dropped before the next block.
        let _ = self.ahead.push_back(step);
        self.believed = self.ahead.is_full();
    }

    fn drop_ahead(&mut self) {
        while let Some(step) = self.ahead.pop_front() {
            self.counts.misplaced += 1;
            self.bad_blocks = self.bad_blocks.saturating_add(step.damaged).saturating_add(1);
        }
    }

    const fn reached(&mut self) {
        self.bad_own = 0;
        self.at_last = self.counts;
    }

    fn hold(&mut self, mut step: Step) {
        let number = step.header.number;
        let last = self.held.as_ref().map(|held| held.header.number).or(self.last_number);
        step.missing = last.map_or(u32::from(step.header.since_first), |last| number - last - 1);
        self.first_number.get_or_insert(number);
        self.out = self.held.replace(step);
    }

    const fn given(&mut self, header: &Header) {
        self.last_number = Some(header.number);
        self.counts.sectors += 1;
        self.at_last.sectors += 1;
    }

    /// Kinds of the blocks after the last sector.
    pub const fn behind_last(&self) -> BlockCounts {
        self.counts.since(&self.at_last)
    }

    /// Blocks since the last sector that were sectors of this session and fail their check. Old contents of a file may follow its
    /// last sector; they are not damage.
    pub const fn damaged_since(&self) -> u32 {
        self.bad_own
    }

    /// Counts so far.
    pub const fn counts(&self) -> BlockCounts {
        self.counts
    }

    /// The session, once it is known.
    pub const fn session(&self) -> Option<u32> {
        self.session
    }

    /// Whether a block that fails its check was of this session: it names the session or the next number, or one bit of its
    /// first two bytes is wrong.
    fn is_own(&self, block: &[u8; SECTOR_BYTES]) -> bool {
        let Some(session) = self.session else { return true };
        let sector = Sector::from_bytes(*block);
        let last = self.held.as_ref().map(|held| held.header.number).or(self.last_number);
        let is_next = last.is_none_or(|last| sector.number().wrapping_sub(last) <= 1);
        sector.session() == session
            || is_next
            || (0..16).any(|bit| {
                let mut block = *block;
                block[bit / 8] ^= 1 << (bit % 8);
                Header::read(&block).is_ok_and(|header| header.session == session)
            })
    }

    fn count(&mut self, error: NotASector, block: &[u8; SECTOR_BYTES]) {
        if Parity::begins(block) {
            let is_own = self.session == Some(Sector::from_bytes(*block).session());
            *(if is_own { &mut self.counts.parity } else { &mut self.counts.stale }) += 1;
            return;
        }
        let is_own = matches!(error, NotASector::Foreign | NotASector::Damaged) && self.is_own(block);
        self.bad_own = self.bad_own.saturating_add(u32::from(is_own));
        match error {
            NotASector::Empty => self.counts.empty += 1,
            NotASector::Erased => {
                self.counts.erased += 1;
                self.bad_blocks = self.bad_blocks.saturating_add(1);
            }
            NotASector::Foreign => {
                self.counts.foreign += 1;
                self.bad_blocks = self.bad_blocks.saturating_add(1);
            }
            NotASector::OtherVersion(version) if version < VERSION => {
                self.counts.foreign += 1;
                self.counts.older_version += 1;
            }
            NotASector::OtherVersion(_) | NotASector::Sealed => {
                self.counts.foreign += 1;
                self.counts.newer_version += 1;
            }
            NotASector::Damaged => {
                if is_own {
                    self.counts.damaged += 1;
                } else {
                    self.counts.unsound += 1;
                }
                self.bad_blocks = self.bad_blocks.saturating_add(1);
            }
        }
    }
}

fn replace(held: &mut Step, step: &Step) {
    if fullness(&step.header) >= fullness(&held.header) {
        held.header = step.header;
        held.sector = step.sector;
    }
}

/// Which of two versions of a sector holds more: the final one, otherwise the one with more entries and bytes.
const fn fullness(header: &Header) -> (bool, u32, usize) {
    (!header.partial, header.entries(), header.body_bytes)
}
