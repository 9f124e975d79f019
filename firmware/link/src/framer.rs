//! Bytes of a line in, frames out: MAVLink 1, MAVLink 2 and signed frames, mixed, from any number of systems.
//!
//! Sans-io: [`Framer::push`] takes the received bytes and calls the sink with each frame at its last byte;
//! [`Framer::idle`] reports a silent line. Nothing depends on how the bytes are cut into pushes.
//!
//! # Resynchronising
//! A *candidate* is a start byte and the bytes behind it. Its bytes stay in the buffer until it is decided. If it is
//! not a frame, only its start byte is dropped and the search continues from the next byte. So a false start (damaged
//! length, start byte in the payload, noise) does not hide the frame behind it.
//!
//! # Frames of definitions that we do not have
//! They must be recorded and forwarded, unlike line noise. For each wrong checksum we compute the `crc_extra` that
//! would make it correct ([`hums_dialect::crc::extra_of`]; 1 in 256 of random bytes has one). The candidate passes as
//! [`Check::Unverified`](crate::frame::Check::Unverified) if this system used that extra for this id before. At first
//! sight it passes only between frames: behind a frame or silence, before a start byte or silence, without a known
//! complete frame inside. Without a frame before it, its extra is only remembered, and the next one passes. An id
//! that this system has sent with our definition never passes unverified: it is damage.
//!
//! # Limits
//! About 1 KiB. A candidate waits for at most 281 bytes (3 ms at 921,600 baud) or for `idle`. Per byte: one copy and
//! one step of the checksum. Untrusted candidates may cost at most four such steps per received byte, so no input
//! takes longer than its transmission. The most expensive known input, endless start bytes, takes some 1,100 of the
//! 1,823 cycles per byte at 921,600 baud.

use hums_dialect::crc;
use hums_dialect::wire::{FRAME_BYTES_MAX, START_V1, START_V2};

use crate::frame::{self, Frame, Header, NoHeader};
use crate::seen::{ExtraState, VerifiedMessages};

const BUFFER: usize = FRAME_BYTES_MAX + ROOM_MIN;
/// Least length of [`Framer::room`]: 2 ms of a line at 921,600 baud.
pub const ROOM_MIN: usize = 192;

/// Steps of the checksum that candidates which are not trusted may cost, for each byte received.
const CREDIT_PER_BYTE: u32 = 4;
/// Maximum credit: some dozens of frames of a private definition at once.
const CREDIT_MAX: u32 = 4_096;

/// Counts of a [`Framer`]. Always `bytes == bytes_in_frames + bytes_not_frames +` [`Framer::held`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FramerCounts {
    /// Bytes received.
    pub bytes: u64,
    /// Frames given to the sink, the unverified ones included.
    pub frames: u64,
    /// Frames with a wrong checksum. Damage to a start byte or a length shows only in `bytes_not_frames`.
    pub damaged: u64,
    /// Bytes of the frames given to the sink.
    pub bytes_in_frames: u64,
    /// Bytes that belong to no frame: noise, text, damaged frames.
    pub bytes_not_frames: u64,
}

/// Finds frames in a line's bytes (see the module).
#[derive(Debug)]
pub struct Framer {
    buffer: [u8; BUFFER],
    start: usize,
    end: usize,
    /// The first candidate cannot be decided with fewer bytes than this.
    needed: usize,
    /// Bytes until the end of the last damaged frame: false starts inside are the same damage, counted once.
    damage_left: usize,
    /// Whether the first byte held follows a frame, a damaged frame or silence.
    after_frame: bool,
    credit: u32,
    seen: VerifiedMessages,
    counts: FramerCounts,
}

const _: () = assert!(size_of::<Framer>() <= 1_152);

enum Verdict {
    /// A frame, and its message if the checksum is ours.
    Frame(Header, Option<u16>),
    Skip(usize),
    /// Undecided: this many bytes are needed.
    Wait(usize),
}

impl Framer {
    /// An empty framer.
    pub const fn new() -> Self {
        Self {
            buffer: [0; BUFFER],
            start: 0,
            end: 0,
            needed: 1,
            damage_left: 0,
            after_frame: true,
            credit: CREDIT_MAX,
            seen: VerifiedMessages::new(),
            counts: FramerCounts { bytes: 0, frames: 0, damaged: 0, bytes_in_frames: 0, bytes_not_frames: 0 },
        }
    }

    /// Calls `sink` with every completed frame, in order.
    pub fn push(&mut self, bytes: &[u8], sink: &mut impl FnMut(Frame<'_>)) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let room = self.room();
            let (now, later) = rest.split_at(rest.len().min(room.len()));
            room[..now.len()].copy_from_slice(now);
            self.received(now.len(), sink);
            rest = later;
        }
    }

    /// Room for the next bytes, at least [`ROOM_MIN`]; [`Self::received`] takes them from there.
    pub fn room(&mut self) -> &mut [u8] {
        if BUFFER - self.end < ROOM_MIN {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        &mut self.buffer[self.end..]
    }

    /// Takes the first `count` bytes of [`Self::room`], and calls `sink` with every completed frame, in order.
    pub fn received(&mut self, count: usize, sink: &mut impl FnMut(Frame<'_>)) {
        let count = count.min(BUFFER - self.end);
        self.counts.bytes = self.counts.bytes.wrapping_add(count as u64);
        self.end += count;
        self.scan(false, sink);
    }

    /// The line has been silent for longer than a pause inside a frame, or has ended: no more bytes are expected. An
    /// incomplete candidate is dropped and its bytes are searched; afterwards no byte is held.
    pub fn idle(&mut self, sink: &mut impl FnMut(Frame<'_>)) {
        self.scan(true, sink);
        self.after_frame = true;
    }

    /// Bytes received and not yet decided: at most [`FRAME_BYTES_MAX`].
    pub const fn held(&self) -> usize {
        self.end - self.start
    }

    /// Counters.
    pub const fn counts(&self) -> FramerCounts {
        self.counts
    }

    fn scan(&mut self, idle: bool, sink: &mut impl FnMut(Frame<'_>)) {
        while self.held() >= self.needed || (idle && self.held() > 0) {
            match self.judge(idle) {
                Verdict::Frame(header, message) => {
                    let len = header.frame_len();
                    let bytes = &self.buffer[self.start..self.start + len];
                    sink(Frame::from_parts(header, bytes, message));
                    self.counts.frames = self.counts.frames.wrapping_add(1);
                    self.counts.bytes_in_frames = self.counts.bytes_in_frames.wrapping_add(len as u64);
                    self.consume(len);
                    self.after_frame = true;
                }
                Verdict::Skip(len) => {
                    self.counts.bytes_not_frames = self.counts.bytes_not_frames.wrapping_add(len as u64);
                    // The end of a damaged frame is a frame's end too.
                    self.after_frame = self.damage_left == len;
                    self.consume(len);
                }
                Verdict::Wait(needed) => {
                    debug_assert!(needed > self.held() && needed <= FRAME_BYTES_MAX + 1);
                    self.needed = needed;
                    return;
                }
            }
        }
    }

    fn consume(&mut self, len: usize) {
        self.start += len;
        self.needed = 1;
        self.damage_left = self.damage_left.saturating_sub(len);
        self.credit = CREDIT_MAX.min(self.credit + CREDIT_PER_BYTE * len as u32);
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        }
    }

    fn judge(&mut self, idle: bool) -> Verdict {
        let held = &self.buffer[self.start..self.end];
        match held.iter().position(|&byte| is_start(byte)) {
            Some(0) => {}
            Some(at) => return Verdict::Skip(at),
            None => return Verdict::Skip(held.len()),
        }
        let header = match Header::read(held) {
            Ok(header) => header,
            Err(NoHeader::Incomplete(needed)) if !idle => return Verdict::Wait(needed),
            Err(_) => return Verdict::Skip(1),
        };
        let len = header.frame_len();
        if held.len() < len {
            return if idle { Verdict::Skip(1) } else { Verdict::Wait(len) };
        }
        let known = KnownMessage::of(&header);
        if let KnownMessage::Fits { index, crc_extra } = known {
            let Some((computed, sent)) = frame::checksums(&header, held) else { return Verdict::Skip(1) };
            if crc::step(computed, crc_extra) == sent {
                self.seen.verified(header.system, usize::from(index));
                return Verdict::Frame(header, Some(index));
            }
            if self.seen.was_verified(header.system, usize::from(index)) {
                return self.damaged(len);
            }
        }
        self.judge_unknown(&header, known, idle)
    }

    fn judge_unknown(&mut self, header: &Header, known: KnownMessage, idle: bool) -> Verdict {
        let held = &self.buffer[self.start..self.end];
        let len = header.frame_len();
        // The cheap check comes first: behind a false start in noise there is seldom a start byte.
        let learned = self.seen.extra(header.system, header.id);
        if !matches!(learned, ExtraState::Confirmed(_)) {
            match held.get(len) {
                Some(&next) if is_start(next) => {}
                Some(_) => return self.not_a_frame(known, len),
                None if idle => {}
                None => return Verdict::Wait(len + 1),
            }
        }
        let Some(credit) = self.credit.checked_sub(len as u32) else { return Verdict::Skip(1) };
        self.credit = credit;
        let Some((computed, sent)) = frame::checksums(header, held) else { return Verdict::Skip(1) };
        if let KnownMessage::Misfits { index, crc_extra } = known
            && crc::step(computed, crc_extra) == sent
        {
            return Verdict::Frame(*header, Some(index));
        }
        let Some(extra) = crc::extra_of(computed, sent) else { return self.damaged(len) };
        let accepted = match learned {
            ExtraState::Confirmed(confirmed) if confirmed != extra => return self.damaged(len),
            ExtraState::Full => return self.damaged(len),
            ExtraState::Confirmed(_) => true,
            ExtraState::Once(once) if once == extra => true,
            ExtraState::Once(_) | ExtraState::None => self.after_frame && !holds_a_known_frame(&held[..len]),
        };
        self.seen.learn(header.system, header.id, extra);
        if !accepted {
            return self.damaged(len);
        }
        Verdict::Frame(*header, None)
    }

    /// A wrong checksum without other evidence of a frame: damage if id and length match a known message, otherwise a false
    /// start.
    fn not_a_frame(&mut self, known: KnownMessage, len: usize) -> Verdict {
        if matches!(known, KnownMessage::Fits { .. }) { self.damaged(len) } else { Verdict::Skip(1) }
    }

    fn damaged(&mut self, len: usize) -> Verdict {
        if self.damage_left == 0 {
            self.counts.damaged = self.counts.damaged.wrapping_add(1);
            self.damage_left = len;
        }
        Verdict::Skip(1)
    }
}

#[inline]
const fn is_start(byte: u8) -> bool {
    byte == START_V1 || byte == START_V2
}

#[derive(Clone, Copy)]
enum KnownMessage {
    /// There is a message of this id, and the payload may have this length.
    Fits { index: u16, crc_extra: u8 },
    /// The id is known, but no encoder makes this length.
    Misfits { index: u16, crc_extra: u8 },
    /// No such message.
    No,
}

impl KnownMessage {
    fn of(header: &Header) -> Self {
        let Some(index) = hums_dialect::index(header.id) else { return Self::No };
        let message = &hums_dialect::messages()[usize::from(index)];
        // MAVLink 1 sends all fields but the extensions. MAVLink 2 leaves out zeros at the end, and a newer definition
        // may have extension fields that ours has not.
        if header.version == 1 && header.payload_len != message.len_base {
            return Self::Misfits { index, crc_extra: message.crc_extra };
        }
        Self::Fits { index, crc_extra: message.crc_extra }
    }
}

fn holds_a_known_frame(candidate: &[u8]) -> bool {
    (1..candidate.len()).any(|at| {
        let bytes = &candidate[at..];
        let Ok(header) = Header::read(bytes) else { return false };
        let KnownMessage::Fits { crc_extra, .. } = KnownMessage::of(&header) else { return false };
        bytes.len() >= header.frame_len()
            && frame::checksums(&header, bytes)
                .is_some_and(|(computed, sent)| crc::step(computed, crc_extra) == sent)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn credit_that_was_spent_comes_back_with_the_bytes_up_to_its_limit() {
        let mut framer = Framer::new();
        framer.credit = 0;
        framer.push(&[0; 100], &mut |_| {});
        assert_eq!(framer.credit, 100 * CREDIT_PER_BYTE);
        framer.push(&[0; 2_000], &mut |_| {});
        assert_eq!(framer.credit, CREDIT_MAX);
    }
}
