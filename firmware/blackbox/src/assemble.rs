//! From blocks as they lie on the medium to sectors in order: checks each block, drops what is stale, chooses among
//! copies of one sector, and says what is missing.
//!
//! A sector in progress is written as partial copies at its own place and the one after, in turn, so several versions
//! of one number may lie next to each other; the fullest one counts. That needs one sector held back.

use crate::sector::{Header, NotASector, SECTOR_BYTES, Sector};

/// What was seen so far, in blocks of 512 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockCounts {
    /// All blocks.
    pub blocks: u64,
    /// Sectors given out.
    pub sectors: u64,
    /// Copies of a sector that a fuller one supersedes.
    pub superseded: u64,
    /// Blocks of this session, as far as can be told, that fail their check: torn or damaged.
    pub damaged: u64,
    /// Sectors of another session, sound or not: left over from an earlier file.
    pub stale: u64,
    /// All zeros.
    pub empty: u64,
    /// Anything else, for instance sectors of another format version.
    pub foreign: u64,
    /// Sound sectors of a format version that this build does not read, also counted as foreign.
    pub other_version: u64,
}

/// A sector in its order.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Its header.
    pub header: Header,
    /// The sector.
    pub sector: Sector,
    /// Numbers missing between the sector before and this one.
    pub missing: u32,
    /// Blocks between the sector before and this one that fail their check or are no sector.
    pub damaged: u32,
}

/// Puts the sectors of one session in order.
#[derive(Debug, Default)]
pub struct Assembler {
    session: Option<u32>,
    held: Option<Step>,
    last_number: Option<u32>,
    /// Blocks that are no sector since the sector held.
    bad_blocks: u32,
    /// Those of them that were sectors of this session, as far as can be told.
    bad_own: u32,
    counts: BlockCounts,
}

impl Assembler {
    /// For the session of the first sound sector.
    pub fn new() -> Self {
        Self::default()
    }

    /// For this session only.
    pub fn for_session(session: u32) -> Self {
        Self { session: Some(session), ..Self::default() }
    }

    /// Takes the next block; gives the sector that is now known to be the fullest of its number.
    pub fn feed(&mut self, block: &[u8; SECTOR_BYTES]) -> Option<Step> {
        self.counts.blocks += 1;
        let header = match Header::read(block) {
            Ok(header) => header,
            Err(error) => {
                self.count(error, block);
                return None;
            }
        };
        if *self.session.get_or_insert(header.session) != header.session {
            self.counts.stale += 1;
            return None;
        }
        let sector = Sector::from_bytes(*block);
        let number_held = self.held.as_ref().map(|held| held.header.number).or(self.last_number);
        if let Some(held) = self.held.as_mut().filter(|held| held.header.number == header.number) {
            self.counts.superseded += 1;
            if fullness(&header) >= fullness(&held.header) {
                held.header = header;
                held.sector = sector;
            }
            return None;
        }
        if number_held.is_some_and(|number| header.number <= number) {
            self.counts.superseded += 1;
            return None;
        }
        let damaged = core::mem::take(&mut self.bad_blocks);
        self.bad_own = 0;
        let missing = number_held.map_or(u32::from(header.since_first), |number| header.number - number - 1);
        let released = self.release();
        self.held = Some(Step { header, sector, missing, damaged });
        released
    }

    /// No more blocks: gives the last sector.
    pub fn end(&mut self) -> Option<Step> {
        self.release()
    }

    /// Blocks since the last sector that were sectors of this session and fail their check. What a file was before it
    /// became a log may follow its last sector, and is no damage.
    pub const fn damaged_since(&self) -> u32 {
        self.bad_own
    }

    /// What was seen so far.
    pub const fn counts(&self) -> BlockCounts {
        self.counts
    }

    /// The session, once it is known.
    pub const fn session(&self) -> Option<u32> {
        self.session
    }

    fn release(&mut self) -> Option<Step> {
        let step = self.held.take()?;
        self.last_number = Some(step.header.number);
        self.counts.sectors += 1;
        Some(step)
    }

    /// Whether a block that fails its check was a sector of this session. It says so where it says which one it is, and
    /// where all that is wrong is one bit of what makes it a sector.
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
        let is_own = matches!(error, NotASector::Foreign | NotASector::Damaged) && self.is_own(block);
        self.bad_own = self.bad_own.saturating_add(u32::from(is_own));
        match error {
            NotASector::Empty => self.counts.empty += 1,
            NotASector::Foreign => {
                self.counts.foreign += 1;
                self.bad_blocks = self.bad_blocks.saturating_add(1);
            }
            NotASector::OtherVersion(_) => {
                self.counts.foreign += 1;
                self.counts.other_version += 1;
            }
            NotASector::Damaged => {
                if is_own {
                    self.counts.damaged += 1;
                } else {
                    self.counts.stale += 1;
                }
                self.bad_blocks = self.bad_blocks.saturating_add(1);
            }
        }
    }
}

/// Which of two versions of a sector holds more: the final one, otherwise the one with more entries and bytes.
const fn fullness(header: &Header) -> (bool, u32, usize) {
    (!header.partial, header.entries(), header.body_bytes)
}
