//! A frame's payload, field by field, by its layout.

use hums_dialect::{Kind, Role};

use super::element::{Context, Element, QUIET};
use super::frame::{Frame, PAYLOAD_BYTES_MAX};
use super::links::LINKS;
use super::slots::{Key, Length, Slot};
use super::{Model, TEXT_BYTES};
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
            return (field.size() <= super::INSTANCE_BYTES).then_some((offset, field.size()));
        }
        offset += field.size();
    }
    None
}

/// Text and data are coded as a whole.
fn is_text(field: FieldLayout) -> bool {
    match field.kind {
        Kind::Char => true,
        Kind::U8 | Kind::I8 => field.count >= DATA_BYTES,
        _ => false,
    }
}

/// Elements that a field takes: the instance none, as the slot says it; a text one; an element of 8 bytes two.
fn elements_of(field: FieldLayout) -> usize {
    match field.kind {
        _ if field.role == Role::Instance => 0,
        _ if is_text(field) => 1,
        kind if kind.size() == 8 => 2 * usize::from(field.count),
        _ => usize::from(field.count),
    }
}

impl Model {
    /// A new slot with its elements, or without a layout where there is no room for them.
    pub(crate) fn describe(&mut self, key: Key, place: Option<Place>) -> Slot {
        let layout = place.and_then(|place| self.layouts.at(place));
        let mut count = 0;
        let mut described = 0;
        let mut index = 0;
        while let Some(field) = layout.and_then(|layout| layout.field(index)) {
            count += elements_of(field);
            described += field.size();
            index += 1;
        }
        let room = self.elements.claim(count);
        let known = place.filter(|_| room.is_some() && described <= PAYLOAD_BYTES_MAX);
        let kept = layout.filter(|_| known.is_some());
        let mut slot =
            Slot::new(key, known, kept, room.unwrap_or(0), if known.is_some() { described } else { 0 });
        if known.is_none() {
            slot.seed = layout.map_or(0, Layout::crc_extra);
            slot.verified = layout.is_some();
        }
        slot
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
        let Some(layout) = slot.layout.and_then(|place| self.layouts.at(place)) else { return false };
        let limit = self.limit(slot);
        let (mut element, mut offset, mut index) = (usize::from(slot.elements), 0, 0);
        while let Some(field) = layout.field(index) {
            if offset + field.size() > limit {
                break;
            }
            let place = &mut frame.payload[offset..offset + field.size()];
            if field.role == Role::Instance {
                place.copy_from_slice(&slot.key.instance[..field.size()]);
            } else if is_text(field) {
                let Some(text) = self.elements.list.get(element).and_then(|e| self.kept(e.aux, field.size()))
                else {
                    return false;
                };
                place.copy_from_slice(text);
            } else {
                let size = field.kind.size();
                let per_element = if size == 8 { 2 } else { 1 };
                for (count, place) in place.chunks_exact_mut(size).enumerate() {
                    let at = element + count * per_element;
                    let low = self.elements.list.get(at).map_or(0, |e| e.last);
                    let high = self.elements.list.get(at + 1).map_or(0, |e| e.last);
                    let value = if size == 8 { u64::from(high) << 32 } else { 0 } | u64::from(low);
                    place.copy_from_slice(&value.to_le_bytes()[..size]);
                }
            }
            element += elements_of(field);
            offset += field.size();
            index += 1;
        }
        // What lies beyond the layout is not kept.
        frame.len <= offset || slot.length == Length::Trimmed
    }

    fn kept(&self, at: u32, size: usize) -> Option<&[u8]> {
        let at = usize::try_from(at).ok()?;
        self.texts.get(at..at.checked_add(size)?)
    }

    /// Bytes of the payload that are coded as fields: a MAVLink 1 payload may be shorter than its layout.
    fn limit(&self, slot: &Slot) -> usize {
        match slot.length {
            Length::Fixed(len) if !slot.key.v2 => usize::from(len.min(slot.described)),
            _ => usize::from(slot.described),
        }
    }

    /// All of the payload.
    pub(crate) fn payload<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: u8,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let slot_index = usize::from(slot);
        let slot = *self.slots.list.get(slot_index)?;
        let mut end = 0;
        if let Some(layout) = slot.layout.and_then(|place| self.layouts.at(place)) {
            end = self.fields(coder, slot_index, &slot, layout, frame, elapsed_ms)?;
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

    /// The fields that the layout describes; gives where they end.
    fn fields<C: Coder>(
        &mut self,
        coder: &mut C,
        slot_index: usize,
        slot: &Slot,
        layout: Layout,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<usize> {
        let calm = self.calm(coder, slot_index, slot, layout, frame)?;
        let limit = self.limit(slot);
        let mut link = usize::from(slot.links);
        let mut context =
            Context { elapsed_ms, clock_us: self.clock_us, clock_ms: self.clock_ms, neighbour: None };
        let (mut element, mut offset, mut index) = (usize::from(slot.elements), 0, 0);
        while let Some(field) = layout.field(index) {
            if offset + field.size() > limit {
                break;
            }
            if field.role == Role::Instance {
                frame.payload[offset..offset + field.size()]
                    .copy_from_slice(&slot.key.instance[..field.size()]);
                offset += field.size();
            } else if is_text(field) {
                self.text_field(coder, element, frame, offset, field.size(), calm)?;
                element += 1;
                offset += field.size();
            } else {
                for _ in 0..field.count {
                    let size = field.kind.size();
                    let (mut linked, mut publishes) = (None, None);
                    while let Some(entry) = LINKS
                        .get(link)
                        .filter(|entry| entry.id == slot.key.id && usize::from(entry.offset) <= offset)
                    {
                        let register = usize::from(entry.register);
                        if usize::from(entry.offset) == offset && entry.publishes {
                            publishes = Some((register, entry.scale));
                        } else if usize::from(entry.offset) == offset {
                            linked = Some(self.registers[register] * entry.scale);
                        }
                        link += 1;
                    }
                    self.one(coder, element, field, frame, offset, calm, &mut context, linked)?;
                    if let Some((register, scale)) = publishes
                        && size <= 4
                    {
                        self.registers[register] = self.elements.number(element, field.kind) * scale;
                    }
                    element += if size == 8 { 2 } else { 1 };
                    offset += size;
                }
            }
            index += 1;
        }
        Some(offset)
    }

    /// One element of a number field.
    #[expect(clippy::too_many_arguments, reason = "the loop's state")]
    #[inline]
    fn one<C: Coder>(
        &mut self,
        coder: &mut C,
        index: usize,
        field: FieldLayout,
        frame: &mut Frame,
        offset: usize,
        calm: bool,
        context: &mut Context,
        linked: Option<f32>,
    ) -> Option<()> {
        let size = field.kind.size();
        let Element { quiet, last, aux, .. } = *self.elements.list.get(index)?;
        let wide = u64::from_le_bytes(*frame.payload.get(offset..)?.first_chunk()?);
        let value = if size == 8 {
            if calm && quiet >= QUIET {
                u64::from(self.elements.list.get(index + 1)?.last) << 32 | u64::from(last)
            } else {
                self.elements.wide(coder, index, field.role, wide, context)
            }
        } else {
            let bits = wide as u32 & (u32::MAX >> (32 - 8 * size));
            u64::from(if calm && quiet >= QUIET {
                last
            } else if field.kind == Kind::F32 {
                self.elements.float(coder, index, bits, context, linked)
            } else {
                self.elements.integer(coder, index, field.kind, field.role, bits, context)
            })
        };
        if field.kind == Kind::F32 {
            context.neighbour = Some((f32::from_bits(value as u32), f32::from_bits(last)));
        }
        self.clocks(field.role, value as u32, last, aux, context);
        if !C::WRITES {
            frame.payload.get_mut(offset..offset + size)?.copy_from_slice(value.to_le_bytes().get(..size)?);
        }
        Some(())
    }

    /// A time field moves the clocks on.
    fn clocks(&mut self, role: Role, value: u32, last: u32, aux: u32, context: &mut Context) {
        let step_us = match role {
            Role::Millis => {
                self.clock_ms = value;
                value.wrapping_sub(last).wrapping_mul(1_000)
            }
            Role::Micros => value.wrapping_sub(last),
            _ => return,
        };
        let proposed = aux.wrapping_add(step_us);
        // Only forward, and not by more than ten seconds: otherwise it is no advance of a clock.
        if proposed.wrapping_sub(self.clock_us) < 10_000_000 {
            self.clock_us = proposed;
        }
        let _ = context;
    }

    /// Whether all quiet elements stay as they are: one bit for all of them.
    fn calm<C: Coder>(
        &mut self,
        coder: &mut C,
        slot_index: usize,
        slot: &Slot,
        layout: Layout,
        frame: &Frame,
    ) -> Option<bool> {
        let limit = self.limit(slot);
        let (mut element, mut offset, mut index) = (usize::from(slot.elements), 0, 0);
        let (mut any, mut same) = (false, true);
        while let Some(field) = layout.field(index) {
            if offset + field.size() > limit {
                break;
            }
            if field.role == Role::Instance {
                offset += field.size();
            } else if is_text(field) {
                let Element { quiet, aux, .. } = *self.elements.list.get(element)?;
                if quiet >= QUIET {
                    any = true;
                    if C::WRITES {
                        same &=
                            self.kept(aux, field.size()) == frame.payload.get(offset..offset + field.size());
                    }
                }
                element += 1;
                offset += field.size();
            } else {
                let size = field.kind.size();
                for _ in 0..field.count {
                    let Element { quiet, last, .. } = *self.elements.list.get(element)?;
                    if quiet >= QUIET {
                        any = true;
                        if C::WRITES {
                            let wide = u64::from_le_bytes(*frame.payload.get(offset..)?.first_chunk()?);
                            same &= if size == 8 {
                                wide as u32 == last
                                    && (wide >> 32) as u32 == self.elements.list.get(element + 1)?.last
                            } else {
                                wide as u32 & (u32::MAX >> (32 - 8 * size)) == last
                            };
                        }
                    }
                    element += if size == 8 { 2 } else { 1 };
                    offset += size;
                }
            }
            index += 1;
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
        if !element.known {
            let at = usize::from(self.texts_used);
            element.aux = NOT_KEPT;
            if at + size <= TEXT_BYTES {
                element.aux = at as u32;
                self.texts.get_mut(at..at + size)?.fill(0);
                self.texts_used += size as u16;
            }
        }
        let mut above = [0; PAYLOAD_BYTES_MAX];
        let kept = self.kept(element.aux, size).is_some();
        if let Some(text) = self.kept(element.aux, size) {
            above[..size].copy_from_slice(text);
        }
        let text = frame.payload.get_mut(offset..offset + size)?;
        let mut same = calm && element.quiet >= QUIET;
        if !same {
            same = kept && text[..] == above[..size];
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
        if let (Ok(at), true) = (usize::try_from(element.aux), kept) {
            let text = frame.payload.get(offset..offset + size)?;
            self.texts.get_mut(at..at + size)?.copy_from_slice(text);
        }
        *self.elements.list.get_mut(index)? = element;
        Some(())
    }
}
