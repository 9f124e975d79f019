//! How entries (frames and records) become symbols for the range coder, and back. Writer and reader run the same code
//! (`Model::entry`) over the two ends of the coder.
//!
//! An entry's time is in whole milliseconds since the box's power-on and never falls within a group.

mod body;
mod describe;
mod element;
mod frame;
mod header;
mod links;
mod recall;
mod records;
mod slots;
mod text;
mod texts;

use body::Body;
pub(crate) use frame::Frame;
use header::{Headers, REPEATED};
use recall::End;
pub(crate) use recall::Recall;
use records::Records;
pub(crate) use slots::SLOTS;
use slots::{INSTANCE_BYTES, Key, Length, NextEntry, Slots};

use zerocopy::FromZeros;

use crate::coder::{Coder, Encoder, Scratch, SymbolReader, SymbolWriter};
use crate::distribution::Cdf;
use crate::limits::ENTRY_BYTES_MAX;

/// Largest coded size of an entry, bytes. A longer entry starts a new group, where its bytes are stored uncoded: with
/// length and time that is at most `ENTRY_BYTES_MAX` and 20 more.
pub(crate) const CODED_BYTES_MAX: usize = 640;
const _: () = assert!(ENTRY_BYTES_MAX + 20 <= CODED_BYTES_MAX);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Frame { verified: bool },
    Record,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CodedEntry<'a> {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) bytes: &'a [u8],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DecodedEntry {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) len: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corrupt;

pub(crate) type Out = Scratch<CODED_BYTES_MAX>;

/// Common to writer and reader, about the group so far. Zeros until the first [`Self::reset`].
#[derive(FromZeros)]
pub(crate) struct Model {
    last_ms: u64,
    slots: Slots,
    headers: Headers,
    body: Body,
    records: Records,
    times: Cdf,
}

const TIME: Cdf = Cdf::from_sizes([40, 10, 6, 4, 4, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 1]);

impl Model {
    pub(crate) fn reset(&mut self, at_ms: u64) {
        self.last_ms = at_ms;
        self.slots.reset();
        self.headers.reset();
        self.body.reset();
        self.records.reset();
        self.times = TIME;
    }

    /// `plain`: uncoded, because the model makes it too long.
    pub(crate) fn encode(
        &mut self,
        entry: &CodedEntry<'_>,
        plain: bool,
        frame: &mut Frame,
        encoder: &mut Encoder,
        out: &mut Out,
    ) {
        let coder = &mut SymbolWriter { encoder, out };
        if let Kind::Frame { verified } = entry.kind
            && !plain
            && frame.parse(entry.bytes).is_some()
            && let Some((next, key)) = self.route(frame)
        {
            let expected = self.is_expected(next, frame, verified);
            if self.slots.next(coder, next, expected, self.headers.is_rough()).is_some() {
                self.frame(coder, (next, expected), key, frame, verified, entry.at_ms);
            }
            return;
        }
        let next = if entry.kind == Kind::Record { NextEntry::Record } else { NextEntry::Plain };
        self.slots.next(coder, next, false, self.headers.is_rough());
        let mut buffer = [0; ENTRY_BYTES_MAX];
        let len = entry.bytes.len().min(ENTRY_BYTES_MAX);
        buffer[..len].copy_from_slice(&entry.bytes[..len]);
        let decoded = DecodedEntry { kind: entry.kind, at_ms: entry.at_ms, len };
        self.plain(coder, decoded, &mut buffer, plain);
    }

    /// Reads an entry. Its bytes are in the buffer; a frame of the model is not reassembled yet, and its index in
    /// `frames` is returned.
    pub(crate) fn decode(
        &mut self,
        coder: &mut SymbolReader<'_, Recall>,
        frames: &mut [Frame; SLOTS],
        buffer: &mut [u8; ENTRY_BYTES_MAX],
    ) -> Result<(DecodedEntry, Option<usize>), Corrupt> {
        let rough = self.headers.is_rough();
        let (next, expected) = self.slots.next(coder, NextEntry::Plain, false, rough).ok_or(Corrupt)?;
        if next == NextEntry::Plain || next == NextEntry::Record {
            let verified = Kind::Frame { verified: false };
            let kind = if next == NextEntry::Record { Kind::Record } else { verified };
            let decoded = self.plain(coder, DecodedEntry { kind, at_ms: 0, len: 0 }, buffer, false);
            return Ok((decoded.ok_or(Corrupt)?, None));
        }
        let index = if let NextEntry::Slot(slot) = next { usize::from(slot) } else { self.slots.used() };
        let frame = frames.get_mut(index).ok_or(Corrupt)?;
        coder.recall.turn_to(index);
        let (verified, at_ms) =
            self.frame(coder, (next, expected), NO_KEY, frame, false, 0).ok_or(Corrupt)?;
        Ok((DecodedEntry { kind: Kind::Frame { verified }, at_ms, len: frame.bytes() }, Some(index)))
    }

    #[inline]
    fn is_expected(&self, next: NextEntry, frame: &Frame, verified: bool) -> bool {
        let NextEntry::Slot(slot) = next else { return false };
        let Some(slot) = self.slots.list.get(usize::from(slot)) else { return false };
        let Some(sender) = self.slots.senders.get(usize::from(slot.key.sender)) else { return false };
        Headers::is_expected(slot, sender, frame, verified)
    }

    /// The slot of a frame; `None` if the model has no room for it.
    fn route(&mut self, frame: &Frame) -> Option<(NextEntry, Key)> {
        if let Some(slot) = self.slots.find_guessed(frame).or_else(|| self.slots.find(frame)) {
            return Some((NextEntry::Slot(slot), NO_KEY));
        }
        let sender = self.slots.sender(frame.system, frame.component)?;
        let mut key = Key { id: frame.id, v2: frame.v2, sender, instance: [0; INSTANCE_BYTES] };
        if let Some((offset, size)) = hums_dialect::message(key.id).and_then(describe::instance_of) {
            key.instance[..size].copy_from_slice(frame.payload.get(offset..offset + size)?);
        }
        self.slots.has_room().then_some((NextEntry::NewSlot, key))
    }

    fn plain<C: Coder>(
        &mut self,
        coder: &mut C,
        entry: DecodedEntry,
        buffer: &mut [u8; ENTRY_BYTES_MAX],
        raw: bool,
    ) -> Option<DecodedEntry> {
        let at_ms = self.time(coder, None, entry.at_ms)?;
        let Kind::Frame { verified } = entry.kind else {
            let text = &mut self.body.common.texts.model;
            let len = self.records.code(coder, text, at_ms, (buffer, entry.len), raw)?;
            return Some(DecodedEntry { kind: Kind::Record, at_ms, len });
        };
        let raw = coder.bits16(u32::from(raw), 1) != 0;
        let kind = Kind::Frame { verified: coder.bits16(u32::from(verified), 1) != 0 };
        let len = coder.bits16(entry.len as u32, 10) as usize;
        let bytes = buffer.get_mut(..len)?;
        let mut before = 0;
        for place in bytes {
            *place = if raw {
                coder.bits16(u32::from(*place), 8) as u8
            } else {
                self.body.common.texts.model.byte(coder, *place, before)
            };
            before = u32::from(*place);
        }
        Some(DecodedEntry { kind, at_ms, len })
    }

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
                    slot.times = self.body.common.distributions.claim(self.times.renewed());
                }
                self.body.common.distributions.get(slot.times).unwrap_or(&mut self.times)
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

    fn frame<C: End>(
        &mut self,
        coder: &mut C,
        (next, expected): (NextEntry, bool),
        key: Key,
        frame: &mut Frame,
        verified: bool,
        at_ms: u64,
    ) -> Option<(bool, u64)> {
        let index = match next {
            NextEntry::Slot(index) => index,
            _ => self.new_slot(coder, key)?,
        };
        self.slots.passed(index);
        let at_ms = self.time(coder, Some(index), at_ms)?;
        let slot = self.slots.list.get_mut(usize::from(index))?;
        let sender = self.slots.senders.get_mut(usize::from(slot.key.sender))?;
        (frame.system, frame.component) = (sender.system, sender.component);
        (frame.id, frame.v2) = (slot.key.id, slot.key.v2);
        let plan = if expected {
            self.headers.expected::<C>(slot, sender, frame)
        } else {
            self.headers.code(coder, slot, sender, frame, verified, &self.body)
        };
        let elapsed_ms = (at_ms as u32).wrapping_sub(slot.at_ms);
        slot.at_ms = at_ms as u32;
        slot.frames = slot.frames.saturating_add(1);
        if plan.header == REPEATED {
            if !C::WRITES {
                frame.clear();
            }
            self.body.restore(slot, frame);
        } else {
            self.body.payload(coder, slot, frame, elapsed_ms)?;
        }
        if !C::WRITES {
            if plan.length.is_none() {
                frame.len = match slot.length {
                    Length::Trimmed => frame.trimmed(usize::from(slot.described)),
                    Length::Fixed(len) => usize::from(len),
                };
            }
            frame.fill_ends(frame.len.max(usize::from(slot.described)));
            frame.checksum = plan.checksum.unwrap_or(0);
            if let Some(reading) = coder.reading() {
                reading.recall.seed = plan.checksum.is_none().then_some(slot.seed);
            }
        }
        if frame.signed() {
            self.headers.signature(coder, sender, frame)?;
        }
        Some((slot.verified, at_ms))
    }

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
        let message = hums_dialect::message(key.id);
        let (instance_at, instance) = message.and_then(describe::instance_of).unwrap_or((0, 0));
        for place in key.instance.get_mut(..instance)? {
            *place = coder.bits16(u32::from(*place), 8) as u8;
        }
        let mut slot = self.body.describe(key, message);
        (slot.instance_at, slot.instance_size) = (instance_at as u8, instance as u8);
        self.slots.add(slot)
    }
}

const NO_KEY: Key = Key { id: 0, v2: false, sender: 0, instance: [0; INSTANCE_BYTES] };
