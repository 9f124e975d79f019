//! A frame's payload, element by element, by its layout.

use core::ops::Range;

use hums_dialect::{Kind, Role};

use super::element::{Context, ELEMENTS, Element, What};
use super::frame::{Frame, PAYLOAD_BYTES_MAX};
use super::links::{self, LINKS, Link};
use super::slots::{Key, Length, Slot};
use super::{INSTANCE_BYTES, Model, TEXT_BYTES};
use crate::coder::Coder;
use crate::layouts::{FieldLayout, Layout, Place};

/// Arrays of so many bytes are data, not numbers.
const DATA_BYTES: u8 = 16;

/// A text that is not kept.
const NOT_KEPT: u32 = u32::MAX;

/// Where a message's instance field is, and its size.
pub(crate) fn instance_of(layout: Layout) -> Option<(usize, usize)> {
    let mut offset = 0;
    for index in 0.. {
        let field = layout.field(index)?;
        if field.role == Role::Instance {
            return (field.size() <= INSTANCE_BYTES).then_some((offset, field.size()));
        }
        offset += field.size();
    }
    None
}

/// How the elements of a field are coded, how many there are and how many bytes each has.
fn elements_of(field: FieldLayout) -> (What, u8, u8) {
    let whole = |what| (what, 1, field.size() as u8);
    if field.role == Role::Instance && field.size() <= INSTANCE_BYTES {
        return whole(What::Instance);
    }
    let what = match (field.kind, field.role) {
        (Kind::Char, _) => return whole(What::Text),
        (Kind::U8 | Kind::I8, _) if field.count >= DATA_BYTES => return whole(What::Text),
        (Kind::U8 | Kind::I8, _) => What::Integer1,
        (Kind::U16 | Kind::I16, _) => What::Integer2,
        (Kind::F32, _) => What::Float,
        (Kind::U32 | Kind::I32, Role::Millis) => What::Millis,
        (Kind::U32 | Kind::I32, Role::Micros) => What::Micros,
        (Kind::U32 | Kind::I32, _) => What::Integer4,
        (_, Role::Millis | Role::Micros) => What::WideTime,
        _ => What::Wide,
    };
    (what, field.count, field.kind.size() as u8)
}

impl Model {
    /// A new slot with its elements, or without a layout where there is no room for them.
    pub(crate) fn describe(&mut self, key: Key, place: Option<Place>) -> Slot {
        let layout = place.and_then(|place| self.layouts.at(place));
        let (mut count, mut described) = (0, 0);
        let mut index = 0;
        while let Some(field) = layout.and_then(|layout| layout.field(index)) {
            let (what, elements, _) = elements_of(field);
            count += usize::from(elements) * if wide(what) { 2 } else { 1 };
            described += field.size();
            index += 1;
        }
        let fits = u8::try_from(count).is_ok() && described <= PAYLOAD_BYTES_MAX;
        let room = layout.filter(|_| fits).and_then(|layout| Some((layout, self.elements.claim(count)?)));
        let Some((layout, first)) = room else {
            let mut slot = Slot::new(key, None, None, 0, 0);
            slot.seed = layout.map_or(0, Layout::crc_extra);
            slot.verified = layout.is_some();
            return slot;
        };
        self.prepare(key.id, layout, usize::from(first));
        let mut slot = Slot::new(key, place, Some(layout), first, described);
        slot.elements_count = count as u8;
        slot
    }

    /// Sets up the elements of a layout.
    fn prepare(&mut self, id: u32, layout: Layout, first: usize) {
        let mut link = usize::from(links::first(id));
        let (mut at, mut offset, mut index) = (first, 0, 0);
        while let Some(field) = layout.field(index) {
            let (what, count, size) = elements_of(field);
            for _ in 0..count {
                while LINKS.get(link).is_some_and(|link| link.id == id && usize::from(link.offset) < offset) {
                    link += 1;
                }
                let linked =
                    LINKS.get(link).is_some_and(|link| link.id == id && usize::from(link.offset) == offset);
                let mut element = Element::new(what, size, linked && size <= 4);
                if what == What::Integer2 || what == What::Integer4 {
                    element.exponent = u8::from(matches!(field.kind, Kind::I16 | Kind::I32));
                }
                for (place, element) in
                    self.elements.list.iter_mut().skip(at).zip([element, Element::new(What::Upper, 0, false)])
                {
                    *place = element;
                }
                at += if wide(what) { 2 } else { 1 };
                offset += usize::from(size);
            }
            index += 1;
        }
    }

    /// Whether the payload is that of the slot's last frame.
    pub(crate) fn is_repeat(&self, slot: u8, frame: &Frame) -> bool {
        let mut copy = Frame::empty();
        copy.len = frame.len;
        self.restore(slot, &mut copy) && copy.payload == frame.payload
    }

    /// The payload of the slot's last frame again.
    pub(crate) fn repeat(&mut self, slot: u8, frame: &mut Frame) {
        self.restore(slot, frame);
    }

    /// Puts together the last payload from the elements; `false` where not all of it was kept.
    fn restore(&self, slot: u8, frame: &mut Frame) -> bool {
        let Some(slot) = self.slots.list.get(usize::from(slot)) else { return false };
        if slot.layout.is_none() {
            return false;
        }
        let limit = limit(slot);
        let mut offset = 0;
        let elements = self.elements.list.get(elements_in(slot)).unwrap_or_default();
        for (index, element) in elements.iter().enumerate() {
            let size = usize::from(element.size);
            if offset + size > limit {
                break;
            }
            let place = &mut frame.payload[offset..offset + size];
            match element.what {
                What::Instance => place.copy_from_slice(&slot.key.instance[..size]),
                What::Text => match kept(&self.texts, element.aux, size) {
                    Some(text) => place.copy_from_slice(text),
                    None => return false,
                },
                What::Wide | What::WideTime => {
                    let upper = elements.get(index + 1).map_or(0, |upper| upper.last);
                    let value = u64::from(upper) << 32 | u64::from(element.last);
                    place.copy_from_slice(&value.to_le_bytes());
                }
                _ => place.copy_from_slice(&element.last.to_le_bytes()[..size]),
            }
            offset += size;
        }
        // What lies beyond the layout is not kept.
        frame.len <= offset || slot.length == Length::Trimmed
    }

    /// All of the payload.
    pub(crate) fn payload<C: Coder>(
        &mut self,
        coder: &mut C,
        index: u8,
        slot: &Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let mut end = 0;
        if slot.layout.is_some() {
            let calm = self.calm(coder, usize::from(index), slot, frame)?;
            end = self.fields(coder, slot, frame, elapsed_ms, calm)?;
        }
        if let Length::Fixed(len) = slot.length {
            let mut before = 0;
            for at in end..usize::from(len) {
                let byte = frame.payload.get(at).copied()?;
                let byte = self.text.byte(coder, byte, before, at as u8, 3);
                frame.payload[at] = byte;
                before = before << 8 | u32::from(byte);
            }
        }
        Some(())
    }

    /// The fields that the layout describes; gives where they end. `calm`: the quiet ones stay as they are.
    fn fields<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: &Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
        calm: bool,
    ) -> Option<usize> {
        let limit = limit(slot);
        let mut context =
            Context { elapsed_ms, clock_us: self.clock_us, clock_ms: self.clock_ms, neighbour: None };
        let mut offset = 0;
        let range = elements_in(slot);
        let mut index = range.start;
        let mut link = usize::from(slot.links);
        while index < range.end {
            let element = self.elements.list.get_mut(index)?;
            let size = usize::from(element.size);
            if offset + size > limit {
                break;
            }
            let (last, aux, what) = (element.last, element.aux, element.what);
            if calm && element.is_quiet() && what != What::Text {
                if what == What::Float {
                    context.neighbour = Some((f32::from_bits(last), f32::from_bits(last)));
                }
                if !C::WRITES {
                    let upper = self.elements.list.get(index + 1).map_or(0, |upper| upper.last);
                    let value = u64::from(last) | if wide(what) { u64::from(upper) << 32 } else { 0 };
                    frame
                        .payload
                        .get_mut(offset..offset + size)?
                        .copy_from_slice(value.to_le_bytes().get(..size)?);
                }
                offset += size;
                index += 1;
                continue;
            }
            let mut links = (None, None);
            if element.has_links() {
                links = links_at(&mut link, slot.key.id, offset);
            }
            let place: &mut [u8; 8] = frame.payload.get_mut(offset..)?.first_chunk_mut()?;
            {
                match what {
                    What::Integer1 | What::Integer2 | What::Integer4 => {
                        let bits = word(place) & (u32::MAX >> (32 - 8 * size));
                        let value = self.elements.distributions.integer(coder, element, bits);
                        if !C::WRITES {
                            place.get_mut(..size)?.copy_from_slice(value.to_le_bytes().get(..size)?);
                        }
                    }
                    What::Millis | What::Micros => {
                        let bits = word(place);
                        let value = self.elements.distributions.time(coder, element, bits, &context);
                        place.get_mut(..4)?.copy_from_slice(&value.to_le_bytes());
                    }
                    What::Float => {
                        let linked = links.0.and_then(|link| {
                            Some(self.registers.get(usize::from(link.register))? * link.scale)
                        });
                        let bits = word(place);
                        let value = self.elements.distributions.float(coder, element, bits, &context, linked);
                        place.get_mut(..4)?.copy_from_slice(&value.to_le_bytes());
                    }
                    What::Wide | What::WideTime => {
                        let [element, upper] = self.elements.list.get_mut(index..index + 2)? else {
                            return None;
                        };
                        let bits = u64::from_le_bytes(*place);
                        let value = self.elements.distributions.wide(coder, element, upper, bits, &context);
                        *place = value.to_le_bytes();
                    }
                    What::Text => self.text_field(coder, index, frame, offset, size, calm)?,
                    What::Instance => {
                        let instance = slot.key.instance.get(..size)?;
                        frame.payload.get_mut(offset..offset + size)?.copy_from_slice(instance);
                    }
                    What::Upper => {}
                }
            }
            let element = self.elements.list.get(index)?;
            match what {
                What::Float => {
                    context.neighbour = Some((f32::from_bits(element.last), f32::from_bits(last)));
                }
                What::Millis => {
                    self.clock_ms = element.last;
                    let step_us = element.last.wrapping_sub(last).wrapping_mul(1_000);
                    self.clock_us = advanced(self.clock_us, aux.wrapping_add(step_us));
                }
                What::Micros | What::WideTime => {
                    let step_us = element.last.wrapping_sub(last);
                    self.clock_us = advanced(self.clock_us, aux.wrapping_add(step_us));
                }
                _ => {}
            }
            if let Some(link) = links.1
                && let Some(register) = self.registers.get_mut(usize::from(link.register))
            {
                *register = element.number() * link.scale;
            }
            offset += size;
            index += 1;
        }
        Some(offset)
    }

    /// Whether all quiet elements stay as they are: one bit for all of them, if there are any.
    fn calm<C: Coder>(
        &mut self,
        coder: &mut C,
        slot_index: usize,
        slot: &Slot,
        frame: &Frame,
    ) -> Option<bool> {
        let limit = limit(slot);
        let (mut any, mut same) = (false, true);
        let mut offset = 0;
        let elements = self.elements.list.get(elements_in(slot))?;
        for (index, element) in elements.iter().enumerate() {
            let size = usize::from(element.size);
            if offset + size > limit {
                break;
            }
            if element.is_quiet() {
                any = true;
                if !C::WRITES {
                    break;
                }
                let place: &[u8; 8] = frame.payload.get(offset..)?.first_chunk()?;
                same = match element.what {
                    What::Text => {
                        kept(&self.texts, element.aux, size) == frame.payload.get(offset..offset + size)
                    }
                    What::Wide | What::WideTime => {
                        let upper = elements.get(index + 1).map_or(0, |upper| upper.last);
                        u64::from_le_bytes(*place) == u64::from(upper) << 32 | u64::from(element.last)
                    }
                    _ => word(place) & (u32::MAX >> (32 - 8 * size)) == element.last,
                };
                if !same {
                    break;
                }
            }
            offset += size;
        }
        if !any {
            return Some(false);
        }
        let cell = &mut self.slots.list.get_mut(slot_index)?.calm;
        let same = coder.bit(cell.one().clamp(16, 4_080), same);
        cell.adapt(same);
        Some(same)
    }

    /// A text or data field.
    fn text_field<C: Coder>(
        &mut self,
        coder: &mut C,
        index: usize,
        frame: &mut Frame,
        offset: usize,
        size: usize,
        calm: bool,
    ) -> Option<()> {
        let mut element = *self.elements.list.get(index)?;
        if !element.known() {
            let at = usize::from(self.texts_used);
            element.aux = NOT_KEPT;
            if at + size <= TEXT_BYTES {
                element.aux = at as u32;
                self.texts.get_mut(at..at + size)?.fill(0);
                self.texts_used += size as u16;
            }
        }
        let mut above = [0; PAYLOAD_BYTES_MAX];
        let is_kept = kept(&self.texts, element.aux, size).is_some();
        if let Some(text) = kept(&self.texts, element.aux, size) {
            above[..size].copy_from_slice(text);
        }
        let text = frame.payload.get_mut(offset..offset + size)?;
        let mut same = calm && element.is_quiet();
        if !same {
            same = is_kept && text[..] == above[..size];
            same = coder.symbol(&mut self.changes, usize::from(!same)) == 0;
        }
        if same {
            text.copy_from_slice(&above[..size]);
        } else {
            let len = text.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
            let high = coder.symbol(&mut self.lengths[0], len >> 4);
            let len = high << 4 | coder.symbol(&mut self.lengths[1], len & 15);
            let (mut before, mut matched) = (0, 0);
            for (place, &above) in text.get_mut(..len)?.iter_mut().zip(&above) {
                *place = self.text.byte(coder, *place, before, above, matched);
                matched = if *place == above { matched + 1 } else { 0 };
                before = before << 8 | u32::from(*place);
            }
            text.get_mut(len..)?.fill(0);
        }
        element.note(same);
        if is_kept && let Ok(at) = usize::try_from(element.aux) {
            let text = frame.payload.get(offset..offset + size)?;
            self.texts.get_mut(at..at + size)?.copy_from_slice(text);
        }
        *self.elements.list.get_mut(index)? = element;
        Some(())
    }
}

const fn wide(what: What) -> bool {
    matches!(what, What::Wide | What::WideTime)
}

fn elements_in(slot: &Slot) -> Range<usize> {
    let first = usize::from(slot.elements);
    first..(first + usize::from(slot.elements_count)).min(ELEMENTS)
}

/// Bytes of the payload that are coded as fields: a MAVLink 1 payload may be shorter than its layout.
fn limit(slot: &Slot) -> usize {
    match slot.length {
        Length::Fixed(len) if !slot.key.v2 => usize::from(len.min(slot.described)),
        _ => usize::from(slot.described),
    }
}

fn kept(texts: &[u8; TEXT_BYTES], at: u32, size: usize) -> Option<&[u8]> {
    let at = usize::try_from(at).ok()?;
    texts.get(at..at.checked_add(size)?)
}

#[inline]
fn word(place: &[u8; 8]) -> u32 {
    u32::from_le_bytes([place[0], place[1], place[2], place[3]])
}

/// A clock that a time field proposes to move: only forward, and not by more than ten seconds; anything else is no
/// advance of a clock.
fn advanced(clock_us: u32, proposed_us: u32) -> u32 {
    if proposed_us.wrapping_sub(clock_us) < 10_000_000 { proposed_us } else { clock_us }
}

/// The links of the field at an offset, the one to consult and the one to publish; moves on to them.
fn links_at(at: &mut usize, id: u32, offset: usize) -> (Option<&'static Link>, Option<&'static Link>) {
    let mut found = (None, None);
    while let Some(link) = LINKS.get(*at).filter(|link| link.id == id && usize::from(link.offset) <= offset) {
        if usize::from(link.offset) == offset {
            *(if link.publishes { &mut found.1 } else { &mut found.0 }) = Some(link);
        }
        *at += 1;
    }
    found
}
