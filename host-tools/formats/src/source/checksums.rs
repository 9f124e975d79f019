//! Frames of a ground station's log with a wrong checksum.

use hums_core::clock::Instant;
use hums_link::{Check, Frame};

use super::item::Gap;
use crate::mavlink::frame::{Peek, peek};
use crate::plural::count;

/// The words for this number of frames with a wrong checksum.
pub fn wrong_checksums(frames: u64) -> String {
    format!(
        "{} with a wrong checksum, which {} not read",
        count(frames, "frame"),
        if frames == 1 { "is" } else { "are" }
    )
}

/// Finds wrong checksums. Unknown ids, or other definitions, cannot be checked.
#[derive(Debug, Default)]
pub struct Checksums {
    /// Message known; `None` once the record's frame has come.
    waits: Option<bool>,
    length: usize,
    at: Instant,
    place: u64,
    damaged: u64,
    first: Option<(Instant, u64)>,
    /// Frames that cannot be checked.
    unchecked: u64,
}

impl Checksums {
    /// Notes the begin of a record.
    pub fn begin(&mut self, at: Instant, place: u64, bytes: &[u8]) {
        let Peek::Frame(frame) = peek(bytes) else { return };
        let is_known = hums_dialect::message(frame.id()).is_some();
        (self.waits, self.length) = (Some(is_known), frame.bytes().len());
        (self.at, self.place) = (at, place);
    }

    /// The record's own, unless inside a damaged one.
    pub fn frame(&mut self, frame: &Frame<'_>) {
        if frame.bytes().len() == self.length || self.waits == Some(false) {
            self.waits = None;
        }
        self.unchecked += u64::from(frame.check() == Check::Unverified);
    }

    /// Ends a record. Returns a frame of an unknown message, which is kept unchanged.
    pub fn end<'a>(&mut self, bytes: &'a [u8]) -> Option<Frame<'a>> {
        if self.waits.take()? {
            self.damaged += 1;
            self.first.get_or_insert((self.at, self.place));
            return None;
        }
        self.unchecked += 1;
        Frame::again(bytes, Check::Unverified)
    }

    /// Damage as gap.
    pub fn gap(&self) -> Option<Gap> {
        let (at, place) = self.first?;
        let gap = Gap::damaged(at, place, wrong_checksums(self.damaged));
        let own = hums_blackbox::Gap { frames: u32::try_from(self.damaged).ok(), ..gap.to_own() };
        Some(Gap { own: Some(own), ..gap })
    }

    /// A sentence.
    pub fn words(&self) -> Option<String> {
        (self.unchecked > 0).then(|| {
            let frames = count(self.unchecked, "frame");
            format!("{frames} of messages that this program has no definition of: whether they are damaged is not known")
        })
    }
}
