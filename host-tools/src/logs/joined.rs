//! Whether another file begins within a file of a log: what a file begins with, the record of who records, stands nowhere
//! else.
//!
//! What is left over in a recycled file begins somewhere within the older file, as a rule within a group, and goes on in the
//! order of its numbers. So only where a group begins whose number and place do not go on from the sector before it is there
//! anything to look for: logs were joined there.

use anyhow::Result;
use hums_blackbox::{SECTOR_BYTES, Sector};

use super::board::Board;

/// A file's first group may be this short, before the group with the record: what lies that far in front may be left over.
const FIRST_GROUP_MAX: u64 = 3;
/// Places of a file that are looked at more closely; more there are only in one that was made to take our time.
const LOOKS_MAX: u32 = 64;

/// What each sector begins with: the magic byte, and the one with the format's version.
pub(super) const HEAD: [u8; 2] = [b'H', 0xb0 | hums_blackbox::VERSION];

/// Looks for the place in each file of a log from which on another file was joined to it.
#[derive(Debug, Default)]
pub(super) struct Joints {
    file: usize,
    /// Where the file's own first group begins: the same again is a copy of it, and no other file.
    first: Option<[u8; SECTOR_BYTES]>,
    /// The last sector so far in the file.
    last: Option<Found>,
    looks: u32,
    /// Who recorded what was joined to the file.
    found: Option<Board>,
}

/// A sector by its head, and the block of the file where it lies.
#[derive(Clone, Copy, Debug)]
struct Found {
    session: u32,
    number: u32,
    at: u64,
}

impl Found {
    /// Whether one follows the other as numbers and places do, whatever lies between. A copy of a sector in progress may lie
    /// one block further.
    const fn goes_on(&self, next: &Self) -> bool {
        let numbers = next.number.wrapping_sub(self.number) as u64;
        self.session == next.session && numbers.abs_diff(next.at - self.at) <= 1
    }
}

impl Joints {
    /// Who recorded the file that was joined to this one and that this block belongs to, if it does; `heading` gives who
    /// recorded the file that begins here, if one does.
    pub(super) fn look(
        &mut self,
        (file, at): (usize, u64),
        block: &[u8; SECTOR_BYTES],
        heading: impl FnOnce() -> Result<Option<Board>>,
    ) -> Result<Option<Board>> {
        if file != self.file {
            *self = Self { file, ..Self::default() };
        }
        if self.found.is_some() || !block.starts_with(&HEAD) {
            return Ok(self.found);
        }
        let sector = Sector::from_bytes(*block);
        let next = Found { session: sector.session(), number: sector.number(), at };
        let breaks = self.last.replace(next).is_some_and(|last| !last.goes_on(&next));
        if sector.starts_group() && at <= FIRST_GROUP_MAX {
            self.first = Some(*block);
        } else if breaks
            && sector.starts_group()
            && self.looks < LOOKS_MAX
            && self.first.as_ref() != Some(block)
        {
            self.looks += 1;
            self.found = heading()?;
        }
        Ok(self.found)
    }
}
