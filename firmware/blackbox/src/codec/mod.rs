//! How entries (frames and records) become symbols for the range coder, and back. Writer and reader run the same code
//! (`Model::entry`) over the two ends of the coder.
//!
//! An entry's time is in whole milliseconds since the monitor's power-on and never falls within a group.

mod element;
mod frame;
mod links;
mod payload;
mod slots;
mod text;

use element::Elements;
pub(crate) use frame::Frame;
use frame::SIGNATURE_BYTES;
use links::REGISTERS;
use slots::{INSTANCE_BYTES, Key, Length, Next, Slot, Slots};
use text::TextModel;

use crate::coder::{Coder, Decoder, Encoder, Reading, Scratch, Writing};
use crate::distribution::Cdf;
use crate::layouts::Layouts;
use crate::record::RECORD_BYTES_MAX;

/// The longest frame: a MAVLink 2 header, 255 bytes of payload, checksum and signature.
pub const FRAME_BYTES_MAX: usize = 10 + 255 + 2 + 13;

/// The longest entry.
pub(crate) const ENTRY_BYTES_MAX: usize =
    if FRAME_BYTES_MAX > RECORD_BYTES_MAX { FRAME_BYTES_MAX } else { RECORD_BYTES_MAX };

/// What the coder may make of an entry at most, bytes. An entry that would become longer starts a new group, where
/// its bytes go out as they are: with length and time that is `ENTRY_BYTES_MAX` and 20 more.
pub(crate) const CODED_BYTES_MAX: usize = 640;
const _: () = assert!(ENTRY_BYTES_MAX + 20 <= CODED_BYTES_MAX);

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A frame, and whether its checksum is that of our definition.
    Frame { verified: bool },
    /// A record in its stored form.
    Record,
}

/// An entry as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry<'a> {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) bytes: &'a [u8],
}

/// An entry read: its bytes are in the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decoded {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) len: usize,
}

/// The stream is not one that the writer makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corrupt;

pub(crate) type Out = Scratch<CODED_BYTES_MAX>;

/// How a frame's header was coded.
const AS_EXPECTED: usize = 0;
const REPEATED: usize = 1;
const SEQUENCE_JUMPS: usize = 2;
const SPELLED_OUT: usize = 3;

/// What writer and reader know alike of the group so far.
pub(crate) struct Model {
    layouts: Layouts,
    last_ms: u64,
    slots: Slots,
    elements: Elements,
    text: TextModel,
    /// The last texts of text fields.
    texts: [u8; TEXT_BYTES],
    texts_used: u16,
    registers: [f32; REGISTERS],
    clock_us: u32,
    clock_ms: u32,
    last_header: u8,
    headers: [Cdf; 16],
    jumps: [Cdf; 2],
    times: Cdf,
    changes: Cdf,
    lengths: [Cdf; 2],
    signatures: Cdf,
    last_record_kind: u8,
}

/// Bytes kept of text fields.
const TEXT_BYTES: usize = 1_024;

const HEADER: Cdf = Cdf::from_sizes([80, 4, 8, 4, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]);
const TIME: Cdf = Cdf::from_sizes([40, 10, 6, 4, 4, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 1]);

impl Model {
    pub(crate) const fn new() -> Self {
        Self {
            layouts: Layouts::Current,
            last_ms: 0,
            slots: Slots::new(),
            elements: Elements::new(),
            text: TextModel::new(),
            texts: [0; TEXT_BYTES],
            texts_used: 0,
            registers: [0.0; REGISTERS],
            clock_us: 0,
            clock_ms: 0,
            last_header: 0,
            headers: [HEADER; 16],
            jumps: [Cdf::FLAT; 2],
            times: TIME,
            changes: Cdf::FLAT,
            lengths: [Cdf::FLAT; 2],
            signatures: Cdf::FLAT,
            last_record_kind: 0,
        }
    }

    /// Starts afresh, at a group's start.
    pub(crate) fn reset(&mut self, at_ms: u64, layouts: Layouts) {
        self.layouts = layouts;
        self.last_ms = at_ms;
        self.slots.reset();
        self.elements.reset();
        self.text.reset();
        self.texts_used = 0;
        self.registers = [0.0; REGISTERS];
        self.clock_us = 0;
        self.clock_ms = 0;
        self.last_header = 0;
        self.headers = [HEADER; 16];
        self.jumps = [Cdf::FLAT; 2];
        self.times = TIME;
        self.changes = Cdf::FLAT;
        self.lengths = [Cdf::FLAT; 2];
        self.signatures = Cdf::FLAT;
        self.last_record_kind = 0;
    }

    /// Writes an entry. `plain`: as it is, because the model makes it too long.
    pub(crate) fn encode(
        &mut self,
        entry: &Entry<'_>,
        plain: bool,
        frame: &mut Frame,
        encoder: &mut Encoder,
        out: &mut Out,
    ) {
        let coder = &mut Writing { encoder, out };
        if let Kind::Frame { verified } = entry.kind
            && !plain
            && frame.parse(entry.bytes).is_some()
            && let Some((next, key)) = self.route(frame)
        {
            if self.slots.next(coder, next).is_some() {
                self.frame(coder, next, key, frame, verified, entry.at_ms);
            }
            return;
        }
        let next = if entry.kind == Kind::Record { Next::Record } else { Next::Plain };
        self.slots.next(coder, next);
        let mut buffer = [0; ENTRY_BYTES_MAX];
        let len = entry.bytes.len().min(ENTRY_BYTES_MAX);
        buffer[..len].copy_from_slice(&entry.bytes[..len]);
        let decoded = Decoded { kind: entry.kind, at_ms: entry.at_ms, len };
        self.plain(coder, decoded, &mut buffer, plain);
    }

    /// Reads an entry.
    pub(crate) fn decode(
        &mut self,
        decoder: &mut Decoder,
        input: &[u8],
        frame: &mut Frame,
        buffer: &mut [u8; ENTRY_BYTES_MAX],
    ) -> Result<Decoded, Corrupt> {
        let coder = &mut Reading { decoder, input };
        let next = self.slots.next(coder, Next::Plain).ok_or(Corrupt)?;
        if next == Next::Plain || next == Next::Record {
            let verified = Kind::Frame { verified: false };
            let kind = if next == Next::Record { Kind::Record } else { verified };
            return self.plain(coder, Decoded { kind, at_ms: 0, len: 0 }, buffer, false).ok_or(Corrupt);
        }
        frame.clear();
        let (verified, at_ms) = self.frame(coder, next, NO_KEY, frame, false, 0).ok_or(Corrupt)?;
        let len = frame.assemble(buffer);
        Ok(Decoded { kind: Kind::Frame { verified }, at_ms, len })
    }

    /// Which slot a frame belongs to; `None` where there is no room for it in the model.
    fn route(&mut self, frame: &Frame) -> Option<(Next, Key)> {
        let sender = self.slots.sender(frame.system, frame.component)?;
        if let Some(slot) = self.slots.find_guessed(frame, sender) {
            return Some((Next::Slot(slot), NO_KEY));
        }
        let mut key = Key { id: frame.id, v2: frame.v2, sender, instance: [0; INSTANCE_BYTES] };
        let layout = self.layouts.find(key.id).and_then(|place| self.layouts.at(place));
        if let Some((offset, size)) = layout.and_then(payload::instance_of) {
            key.instance[..size].copy_from_slice(frame.payload.get(offset..offset + size)?);
        }
        if let Some(slot) = self.slots.find(&key) {
            return Some((Next::Slot(slot), NO_KEY));
        }
        self.slots.has_room().then_some((Next::NewSlot, key))
    }

    /// Bytes as they are (`raw`), or by the text model: entries that are no frames.
    fn plain<C: Coder>(
        &mut self,
        coder: &mut C,
        entry: Decoded,
        buffer: &mut [u8; ENTRY_BYTES_MAX],
        raw: bool,
    ) -> Option<Decoded> {
        let at_ms = self.time(coder, None, entry.at_ms)?;
        let raw = coder.bits16(u32::from(raw), 1) != 0;
        let mut kind = entry.kind;
        if let Kind::Frame { verified } = kind {
            kind = Kind::Frame { verified: coder.bits16(u32::from(verified), 1) != 0 };
        }
        let len = coder.bits16(entry.len as u32, 10) as usize;
        let bytes = buffer.get_mut(..len)?;
        let mut before = 0;
        for place in bytes {
            *place = if raw {
                coder.bits16(u32::from(*place), 8) as u8
            } else {
                self.text.byte(coder, *place, before, 0, 0)
            };
            before = before << 8 | u32::from(*place);
        }
        Some(Decoded { kind, at_ms, len })
    }

    /// The time since the entry before, by the slot's own distribution where there is a slot.
    fn time<C: Coder>(&mut self, coder: &mut C, slot: Option<u8>, at_ms: u64) -> Option<u64> {
        let step = at_ms.saturating_sub(self.last_ms);
        let length = 64 - step.leading_zeros();
        let symbol = match step {
            0..=9 => step as usize,
            _ => (length as usize + 6).min(15),
        };
        let slot = slot.and_then(|slot| self.slots.list.get_mut(usize::from(slot)));
        let cdf = match slot {
            Some(slot) => {
                if slot.times == 0 && slot.frames > 0 {
                    slot.times = self.elements.distributions.claim(self.times.renewed());
                }
                self.elements.distributions.get(slot.times).unwrap_or(&mut self.times)
            }
            None => &mut self.times,
        };
        let symbol = coder.symbol(cdf, symbol);
        let step = match symbol {
            0..=9 => symbol as u64,
            10..=14 => {
                let bits = symbol as u32 - 7;
                1 << bits | u64::from(coder.bits16(step as u32 & ((1 << bits) - 1), bits))
            }
            _ => {
                let low = coder.bits(step as u32, 32);
                u64::from(coder.bits16((step >> 32) as u32, 16)) << 32 | u64::from(low)
            }
        };
        self.last_ms = self.last_ms.checked_add(step)?;
        Some(self.last_ms)
    }

    /// A frame of a slot. Gives whether it is verified, and its time.
    fn frame<C: Coder>(
        &mut self,
        coder: &mut C,
        next: Next,
        key: Key,
        frame: &mut Frame,
        verified: bool,
        at_ms: u64,
    ) -> Option<(bool, u64)> {
        let index = match next {
            Next::Slot(index) => index,
            _ => self.new_slot(coder, key)?,
        };
        self.slots.passed(index);
        let at_ms = self.time(coder, Some(index), at_ms)?;
        let mut slot = *self.slots.list.get(usize::from(index))?;
        let sender = self.slots.senders.get_mut(usize::from(slot.key.sender))?;
        (frame.system, frame.component) = (sender.system, sender.component);
        (frame.id, frame.v2) = (slot.key.id, slot.key.v2);
        let expected = sender.sequence;
        let before_seed = if C::WRITES { frame.checksum_before_seed() } else { 0 };
        let plan = self.header(coder, &mut slot, frame, verified, expected, before_seed, index);
        self.slots.senders[usize::from(slot.key.sender)].sequence = frame.sequence.wrapping_add(1);
        let elapsed_ms = (at_ms as u32).wrapping_sub(slot.at_ms);
        slot.at_ms = at_ms as u32;
        // In the slot before the payload: it looks there for what it needs.
        slot.frames = slot.frames.saturating_add(1);
        self.slots.list[usize::from(index)] = slot;
        if plan.header == REPEATED {
            self.repeat(index, frame);
        } else {
            self.payload(coder, index, &slot, frame, elapsed_ms)?;
        }
        if !C::WRITES {
            if plan.length.is_none() {
                frame.len = match slot.length {
                    Length::Trimmed => frame.trimmed(usize::from(slot.described)),
                    Length::Fixed(len) => usize::from(len),
                };
            }
            frame.checksum =
                plan.checksum.unwrap_or_else(|| frame::crc_add(frame.checksum_before_seed(), slot.seed));
        }
        if frame.signed() {
            self.signature(coder, slot.key.sender, frame)?;
        }
        Some((slot.verified, at_ms))
    }

    /// Header, flags, length and checksum, as far as they are not as expected.
    #[expect(clippy::too_many_arguments, reason = "all that the header depends on")]
    fn header<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        verified: bool,
        expected: u8,
        before_seed: u16,
        index: u8,
    ) -> Plan {
        let mut symbol = AS_EXPECTED;
        if C::WRITES {
            let usual = frame.incompat == slot.incompat
                && frame.compat == slot.compat
                && verified == slot.verified
                && frame::crc_add(before_seed, slot.seed) == frame.checksum
                && match slot.length {
                    Length::Trimmed => frame.len == frame.trimmed(frame.len.max(usize::from(slot.described))),
                    Length::Fixed(len) => frame.len == usize::from(len),
                }
                && (slot.length != Length::Trimmed || frame.len <= usize::from(slot.described));
            symbol = match frame.sequence.wrapping_sub(expected) {
                _ if !usual => SPELLED_OUT,
                0 => AS_EXPECTED,
                u8::MAX if slot.frames > 0 && self.is_repeat(index, frame) => REPEATED,
                _ => SEQUENCE_JUMPS,
            };
        }
        let context = usize::from(slot.header) * 4 + usize::from(self.last_header);
        let symbol = coder.symbol(&mut self.headers[context & 15], symbol).min(SPELLED_OUT);
        (slot.header, self.last_header) = (symbol as u8, symbol as u8);
        let mut jump = frame.sequence.wrapping_sub(expected);
        jump = match symbol {
            AS_EXPECTED => 0,
            REPEATED => u8::MAX,
            _ => {
                let high = coder.symbol(&mut self.jumps[0], usize::from(jump >> 4));
                (high << 4 | coder.symbol(&mut self.jumps[1], usize::from(jump & 15))) as u8
            }
        };
        frame.sequence = expected.wrapping_add(jump);
        let mut plan = Plan { header: symbol, length: None, checksum: None };
        if symbol == SPELLED_OUT {
            frame.incompat = coder.bits16(u32::from(frame.incompat), 8) as u8;
            frame.compat = coder.bits16(u32::from(frame.compat), 8) as u8;
            slot.verified = coder.bits16(u32::from(verified), 1) != 0;
            frame.len = coder.bits16(frame.len as u32, 8) as usize;
            let trims = slot.layout.is_some()
                && frame.len <= usize::from(slot.described)
                && frame.len == frame.trimmed(usize::from(slot.described));
            let trims = coder.bits16(u32::from(slot.key.v2 && trims), 1) != 0;
            slot.length = if trims { Length::Trimmed } else { Length::Fixed(frame.len as u8) };
            plan.length = Some(frame.len);
            let seed = if C::WRITES { frame::seed_for(before_seed, frame.checksum) } else { None };
            if coder.bits16(u32::from(seed.is_some()), 1) != 0 {
                slot.seed = coder.bits16(u32::from(seed.unwrap_or(0)), 8) as u8;
            } else {
                plan.checksum = Some(coder.bits16(u32::from(frame.checksum), 16) as u16);
            }
            (slot.incompat, slot.compat) = (frame.incompat, frame.compat);
        }
        if !C::WRITES {
            (frame.incompat, frame.compat) = (slot.incompat, slot.compat);
            if let Length::Fixed(len) = slot.length {
                frame.len = usize::from(len);
            }
        }
        plan
    }

    /// A slot's first frame: who sends what.
    fn new_slot<C: Coder>(&mut self, coder: &mut C, key: Key) -> Option<u8> {
        let sender = self.slots.senders.get(usize::from(key.sender))?;
        let (system, component) = (u32::from(sender.system), u32::from(sender.component));
        let v2 = coder.bits16(u32::from(key.v2), 1) != 0;
        let system = coder.bits16(system, 8) as u8;
        let component = coder.bits16(component, 8) as u8;
        let short = coder.bits16(u32::from(key.id < 512), 1) != 0;
        let id = if short { coder.bits16(key.id, 9) } else { coder.bits(key.id, 24) };
        let sender = self.slots.sender(system, component)?;
        let mut key = Key { id, v2, sender, instance: key.instance };
        let place = self.layouts.find(key.id);
        let layout = place.and_then(|place| self.layouts.at(place));
        let (instance_at, instance) = layout.and_then(payload::instance_of).unwrap_or((0, 0));
        for place in key.instance.get_mut(..instance)? {
            *place = coder.bits16(u32::from(*place), 8) as u8;
        }
        if !C::WRITES {
            key.instance[instance..].fill(0);
        }
        let mut slot = self.describe(key, place);
        (slot.instance_at, slot.instance_size) = (instance_at as u8, instance as u8);
        self.slots.add(slot)
    }

    fn signature<C: Coder>(&mut self, coder: &mut C, sender: u8, frame: &mut Frame) -> Option<()> {
        let sender = self.slots.senders.get_mut(usize::from(sender))?;
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

/// What a frame's header said of what follows.
struct Plan {
    header: usize,
    length: Option<usize>,
    checksum: Option<u16>,
}

const NO_KEY: Key = Key { id: 0, v2: false, sender: 0, instance: [0; INSTANCE_BYTES] };
