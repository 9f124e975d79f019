//! A frame's header, length, checksum and signature: as expected in nearly every frame.

use hums_dialect::crc;
use hums_dialect::wire::SIGNATURE_BYTES;

use super::body::Body;
use super::frame::Frame;
use super::slots::{Length, Sender, Slot};
use crate::coder::Coder;
use crate::distribution::Cdf;

const AS_EXPECTED: usize = 0;
pub(super) const REPEATED: usize = 1;
const SEQUENCE_JUMPS: usize = 2;
const SPELLED_OUT: usize = 3;

const UNEXPECTED: Cdf = Cdf::from_sizes([4, 8, 80, 20, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]);
const SYMBOL: Cdf = Cdf::from_sizes([80, 4, 8, 4, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]);

/// Statistics of headers.
#[derive(zerocopy::FromZeros)]
pub(super) struct Headers {
    last: u8,
    first: Cdf,
    /// For unexpected frames, by the coding of the slot's last one, and of the one before.
    symbols: [Cdf; 16],
    jumps: [Cdf; 2],
    signatures: Cdf,
}

pub(super) struct Plan {
    pub(super) header: usize,
    pub(super) length: Option<usize>,
    pub(super) checksum: Option<u16>,
}

impl Headers {
    pub(super) fn reset(&mut self) {
        self.last = 0;
        self.first = SYMBOL;
        self.symbols = [UNEXPECTED; 16];
        self.jumps = [Cdf::FLAT; 2];
        self.signatures = Cdf::FLAT;
    }

    #[inline]
    pub(super) const fn is_rough(&self) -> bool {
        self.last != AS_EXPECTED as u8
    }

    #[inline]
    pub(super) fn is_expected(slot: &Slot, sender: &Sender, frame: &Frame, verified: bool) -> bool {
        frame.sequence == sender.sequence && is_usual(slot, frame, verified)
    }

    #[inline]
    pub(super) fn expected<C: Coder>(
        &mut self,
        slot: &mut Slot,
        sender: &mut Sender,
        frame: &mut Frame,
    ) -> Plan {
        (slot.header, self.last) = (AS_EXPECTED as u8, AS_EXPECTED as u8);
        frame.sequence = sender.sequence;
        sender.sequence = frame.sequence.wrapping_add(1);
        if !C::WRITES {
            take_flags(slot, frame);
        }
        Plan { header: AS_EXPECTED, length: None, checksum: None }
    }

    #[inline(never)]
    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        sender: &mut Sender,
        frame: &mut Frame,
        verified: bool,
        body: &Body,
    ) -> Plan {
        let mut jump = frame.sequence.wrapping_sub(sender.sequence);
        let mut symbol = AS_EXPECTED;
        if C::WRITES {
            symbol = match jump {
                _ if !is_usual(slot, frame, verified) => SPELLED_OUT,
                0 => AS_EXPECTED,
                u8::MAX if slot.frames > 0 && body.is_repeat(slot, frame) => REPEATED,
                _ => SEQUENCE_JUMPS,
            };
        }
        let context = usize::from(slot.header) * 4 + usize::from(self.last);
        let cdf = if slot.frames == 0 { &mut self.first } else { &mut self.symbols[context & 15] };
        let symbol = coder.symbol(cdf, symbol).min(SPELLED_OUT);
        (slot.header, self.last) = (symbol as u8, symbol as u8);
        jump = match symbol {
            AS_EXPECTED => 0,
            REPEATED => u8::MAX,
            _ => {
                let high = coder.symbol(&mut self.jumps[0], usize::from(jump >> 4));
                (high << 4 | coder.symbol(&mut self.jumps[1], usize::from(jump & 15))) as u8
            }
        };
        frame.sequence = sender.sequence.wrapping_add(jump);
        sender.sequence = frame.sequence.wrapping_add(1);
        let mut plan = Plan { header: symbol, length: None, checksum: None };
        if symbol == SPELLED_OUT {
            plan = spelled_out(coder, slot, frame, verified);
        }
        if !C::WRITES {
            take_flags(slot, frame);
        }
        plan
    }

    pub(super) fn signature<C: Coder>(
        &mut self,
        coder: &mut C,
        sender: &mut Sender,
        frame: &mut Frame,
    ) -> Option<()> {
        let (link, rest) = frame.signature.split_first_mut()?;
        let (time, hash) = rest.split_at_mut(SIGNATURE_BYTES - 7);
        let same = coder.bits16(u32::from(*link == sender.signature_link), 1) != 0;
        *link = if same { sender.signature_link } else { coder.bits16(u32::from(*link), 8) as u8 };
        sender.signature_link = *link;
        let mut bytes = [0; 8];
        bytes[..6].copy_from_slice(time);
        let now = u64::from_le_bytes(bytes);
        let difference = now.wrapping_sub(sender.signature_time);
        // The class is the length of the difference from the time before in bits, up to 14.
        let class = (64 - difference.leading_zeros()).min(15) as usize;
        let class = coder.symbol(&mut self.signatures, class);
        let now = match class {
            0 => sender.signature_time,
            1..=14 => {
                let bits = class as u32 - 1;
                let low = coder.bits16(difference as u32 & ((1 << bits) - 1), bits);
                sender.signature_time.wrapping_add(u64::from(1 << bits | low))
            }
            _ => {
                let low = coder.bits(now as u32, 32);
                u64::from(coder.bits16((now >> 32) as u32, 16)) << 32 | u64::from(low)
            }
        };
        let now = now & 0xffff_ffff_ffff;
        sender.signature_time = now;
        time.copy_from_slice(&now.to_le_bytes()[..6]);
        for byte in hash {
            *byte = coder.bits16(u32::from(*byte), 8) as u8;
        }
        Some(())
    }
}

fn take_flags(slot: &Slot, frame: &mut Frame) {
    (frame.incompat, frame.compat) = (slot.incompat, slot.compat);
    if let Length::Fixed(len) = slot.length {
        frame.len = usize::from(len);
    }
}

fn is_usual(slot: &Slot, frame: &Frame, verified: bool) -> bool {
    // The checksum of a verified frame matched our definition. If it no longer matches, memory has changed; the chain reveals
    // this to readers.
    let trusted = verified && slot.own_seed;
    frame.incompat == slot.incompat
        && frame.compat == slot.compat
        && verified == slot.verified
        && match slot.length {
            Length::Trimmed => frame.len <= usize::from(slot.described) && frame.is_trimmed(),
            Length::Fixed(len) => frame.len == usize::from(len),
        }
        && (trusted || checks(slot, frame))
}

fn checks(slot: &Slot, frame: &Frame) -> bool {
    crc::step(frame.checksum_before_seed(), slot.seed) == frame.checksum
}

/// Unexpected values, in full.
#[inline(never)]
fn spelled_out<C: Coder>(coder: &mut C, slot: &mut Slot, frame: &mut Frame, verified: bool) -> Plan {
    let mut plan = Plan { header: SPELLED_OUT, length: None, checksum: None };
    frame.incompat = coder.bits16(u32::from(frame.incompat), 8) as u8;
    frame.compat = coder.bits16(u32::from(frame.compat), 8) as u8;
    slot.verified = coder.bits16(u32::from(verified), 1) != 0;
    frame.len = coder.bits16(frame.len as u32, 8) as usize;
    let trims = slot.has_layout() && frame.len <= usize::from(slot.described) && frame.is_trimmed();
    let trims = coder.bits16(u32::from(slot.key.v2 && trims), 1) != 0;
    slot.length = if trims { Length::Trimmed } else { Length::Fixed(frame.len as u8) };
    plan.length = Some(frame.len);
    let mut seed = None;
    if C::WRITES {
        seed = crc::extra_of(frame.checksum_before_seed(), frame.checksum);
    }
    if coder.bits16(u32::from(seed.is_some()), 1) != 0 {
        let seed = coder.bits16(u32::from(seed.unwrap_or(0)), 8) as u8;
        slot.own_seed &= seed == slot.seed;
        slot.seed = seed;
    } else {
        plan.checksum = Some(coder.bits16(u32::from(frame.checksum), 16) as u16);
    }
    (slot.incompat, slot.compat) = (frame.incompat, frame.compat);
    plan
}
