//! Whether another file begins within a file of a log: what a file begins with, the record of who records, stands nowhere
//! else.
//!
//! What is left over in a recycled file begins somewhere within the older file, as a rule within a group, and goes on in the
//! order of its numbers. So only where a group begins whose number and place do not go on from the sector before it is there
//! anything to look for: logs were joined there. A page that lies where another one belongs is no file: behind it the numbers go on
//! from those before it, or the file has no such record where it begins, and this is its own.

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
    /// Blocks at the file's beginning where a group begins: a bit each. One of them has the record of who records; they are decoded
    /// where something is joined, which is nowhere in nearly every log.
    begins: u8,
    /// The record of who records was seen in the file, further on.
    has_heading: bool,
    /// The last sector so far in the file.
    last: Option<Found>,
    looks: u32,
    /// Who recorded what was joined to the file.
    found: Option<Board>,
}

/// A sector by its head, and the block of the file where it lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    session: u32,
    number: u32,
    at: u64,
}

impl Found {
    fn of(block: &[u8; SECTOR_BYTES], at: u64) -> Option<Self> {
        let sector = block.starts_with(&HEAD).then(|| Sector::from_bytes(*block))?;
        Some(Self { session: sector.session(), number: sector.number(), at })
    }

    /// Whether what lies between this sector and those of `rest` that go on from it is but a part of a log: `rest` begins behind this
    /// one with other numbers, which run on for a while.
    pub(super) fn is_resumed<E>(
        &self,
        rest: impl IntoIterator<Item = Result<(u64, [u8; SECTOR_BYTES]), E>>,
    ) -> Result<bool, E> {
        for block in rest {
            let (at, block) = block?;
            if let Some(next) = Self::of(&block, at)
                && next.session == self.session
                && (next.number == self.number.wrapping_add(1) || self.goes_on(&next))
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether one follows the other as numbers and places do, whatever lies between. A copy of a sector in progress may lie
    /// one block further.
    const fn goes_on(&self, next: &Self) -> bool {
        let numbers = next.number.wrapping_sub(self.number) as u64;
        self.session == next.session && numbers.abs_diff(next.at - self.at) <= 1
    }
}

impl Joints {
    /// Who recorded the file that was joined to this one and that this block belongs to, if it does; `heading` gives who
    /// recorded the file that begins at a block, if one does.
    pub(super) fn look(
        &mut self,
        (file, at): (usize, u64),
        block: &[u8; SECTOR_BYTES],
        heading: impl Fn(u64, Option<Found>) -> Result<Option<Board>>,
    ) -> Result<Option<Board>> {
        if file != self.file {
            *self = Self { file, ..Self::default() };
        }
        let Some(next) = Found::of(block, at).filter(|_| self.found.is_none()) else { return Ok(self.found) };
        let last = self.last.replace(next);
        let breaks = last.is_some_and(|last| !last.goes_on(&next));
        let begins = Sector::from_bytes(*block).starts_group();
        if begins && at <= FIRST_GROUP_MAX {
            self.first = Some(*block);
            self.begins |= 1 << at;
        } else if breaks && begins && self.looks < LOOKS_MAX && self.first.as_ref() != Some(block) {
            self.looks += 1;
            let found = heading(at, last)?;
            if found.is_some() && !self.has_heading {
                for at in (0..=FIRST_GROUP_MAX).filter(|at| self.begins >> at & 1 != 0) {
                    self.has_heading |= heading(at, None)?.is_some();
                }
            }
            // The file's own, where it had none so far.
            if self.has_heading {
                self.found = found;
            }
            self.has_heading |= found.is_some();
        }
        Ok(self.found)
    }
}
