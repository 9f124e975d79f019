//! A frame's payload, element by element, by its layout.

use core::ops::Range;

use super::element::{Context, Distributions, ELEMENTS, Element, Elements, What};
use super::frame::Frame;
use super::links::{LINKS, Link, REGISTERS};
use super::slots::{Length, Slot};
use super::texts::Texts;
use crate::coder::Coder;

/// What is known of all payloads.
pub(super) struct Body {
    pub(super) elements: Elements,
    pub(super) distributions: Distributions,
    pub(super) texts: Texts,
    registers: [f32; REGISTERS],
    clock_us: u32,
    clock_ms: u32,
}

impl Body {
    pub(super) const fn new() -> Self {
        Self {
            elements: Elements::new(),
            distributions: Distributions::new(),
            texts: Texts::new(),
            registers: [0.0; REGISTERS],
            clock_us: 0,
            clock_ms: 0,
        }
    }

    pub(super) fn reset(&mut self) {
        self.elements.reset();
        self.distributions.reset();
        self.texts.reset();
        self.registers = [0.0; REGISTERS];
        self.clock_us = 0;
        self.clock_ms = 0;
    }

    /// All of the payload.
    pub(super) fn payload<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let mut end = 0;
        if slot.layout.is_some() {
            let calm = slot.quiet && self.calm(coder, slot, frame)?;
            end = self.fields(coder, slot, frame, elapsed_ms, calm)?;
        }
        if let Length::Fixed(len) = slot.length {
            let mut before = 0;
            for at in end..usize::from(len) {
                let byte = frame.payload.get(at).copied()?;
                let byte = self.texts.model.byte(coder, byte, before, at as u8, 3);
                frame.payload[at] = byte;
                before = before << 8 | u32::from(byte);
            }
        }
        Some(())
    }

    /// The fields that the layout describes; gives where they end. `calm`: the quiet ones stay as they are.
    #[inline(never)]
    fn fields<C: Coder>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
        calm: bool,
    ) -> Option<usize> {
        let limit = limit(slot);
        let mut context = Context {
            elapsed_ms,
            clock_us: self.clock_us,
            clock_ms: self.clock_ms,
            neighbour: None,
            link: None,
        };
        let mut offset = 0;
        let mut link = usize::from(slot.links);
        let mut quiet = false;
        let mut elements = self.elements.list.get_mut(elements_in(slot))?.iter_mut();
        while let Some(element) = elements.next() {
            let (what, size) = (element.what, usize::from(element.size));
            if offset + size > limit {
                break;
            }
            let place = frame.place(offset);
            let last = element.last;
            let stays = calm && element.is_quiet();
            if stays && what != What::Text {
                let upper = if what.is_wide() { elements.next()?.last } else { 0 };
                if !C::WRITES {
                    let value = u64::from(upper) << 32 | u64::from(last);
                    place.get_mut(..size)?.copy_from_slice(value.to_le_bytes().get(..size)?);
                }
                quiet = true;
                offset += size;
                continue;
            }
            match what {
                What::Integer1 | What::Integer2 | What::Integer4 => {
                    let bits = word(place) & (u32::MAX >> (32 - 8 * size));
                    let value = self.distributions.integer(coder, element, bits);
                    if !C::WRITES {
                        put(place, value, size);
                    }
                    if element.has_links() {
                        let (_, publishes) = links_at(&mut link, slot.key.id, offset);
                        publish(&mut self.registers, publishes, element);
                    }
                }
                What::Millis | What::Micros => {
                    let aux = element.aux;
                    let value = self.distributions.time(coder, element, word(place), &context);
                    let mut step_us = value.wrapping_sub(last);
                    if what == What::Millis {
                        self.clock_ms = value;
                        step_us = step_us.wrapping_mul(1_000);
                    }
                    self.clock_us = advanced(self.clock_us, aux.wrapping_add(step_us));
                    if !C::WRITES {
                        put(place, value, 4);
                    }
                }
                What::Float => {
                    let mut links = (None, None);
                    if element.has_links() {
                        links = links_at(&mut link, slot.key.id, offset);
                    }
                    context.link = links
                        .0
                        .and_then(|link| Some(self.registers.get(usize::from(link.register))? * link.scale));
                    let value = self.distributions.float(coder, element, word(place), &context);
                    context.neighbour = Some((f32::from_bits(value), f32::from_bits(last)));
                    publish(&mut self.registers, links.1, element);
                    if !C::WRITES {
                        put(place, value, 4);
                    }
                }
                What::Wide | What::WideTime => {
                    let (aux, upper) = (element.aux, elements.next()?);
                    let bits = u64::from_le_bytes(*place);
                    let value = self.distributions.wide(coder, element, upper, bits, &context);
                    if what == What::WideTime {
                        let step_us = (value as u32).wrapping_sub(last);
                        self.clock_us = advanced(self.clock_us, aux.wrapping_add(step_us));
                    }
                    if !C::WRITES {
                        *place = value.to_le_bytes();
                    }
                }
                What::Text => {
                    let text = frame.payload.get_mut(offset..offset + size)?;
                    self.texts.code(coder, element, text, stays)?;
                }
                What::Instance => {
                    let instance = slot.key.instance.get(..size)?;
                    frame.payload.get_mut(offset..offset + size)?.copy_from_slice(instance);
                }
                What::Upper => {}
            }
            quiet |= element.is_quiet();
            offset += size;
        }
        slot.quiet = quiet;
        Some(offset)
    }

    /// Whether all quiet elements stay as they are: one bit for all of them.
    #[inline(never)]
    fn calm<C: Coder>(&mut self, coder: &mut C, slot: &mut Slot, frame: &mut Frame) -> Option<bool> {
        let same = C::WRITES && self.stays(slot, frame)?;
        let same = coder.bit(slot.calm.one().clamp(16, 4_080), same);
        slot.calm.adapt(same);
        Some(same)
    }

    /// Whether the frame has the quiet elements as they are.
    fn stays(&self, slot: &Slot, frame: &mut Frame) -> Option<bool> {
        let limit = limit(slot);
        let mut offset = 0;
        let mut elements = self.elements.list.get(elements_in(slot))?.iter();
        while let Some(element) = elements.next() {
            let size = usize::from(element.size);
            if offset + size > limit {
                break;
            }
            let upper = if element.what.is_wide() { elements.next() } else { None };
            if element.is_quiet() {
                let place = frame.place(offset);
                let same = match (element.what, upper) {
                    (What::Text, _) => self.texts.last(element) == frame.payload.get(offset..offset + size),
                    (_, Some(upper)) => {
                        u64::from_le_bytes(*place) == u64::from(upper.last) << 32 | u64::from(element.last)
                    }
                    _ => word(place) & (u32::MAX >> (32 - 8 * size)) == element.last,
                };
                if !same {
                    return Some(false);
                }
            }
            offset += size;
        }
        Some(true)
    }

    /// Whether the payload is that of the slot's last frame.
    pub(super) fn is_repeat(&self, slot: &Slot, frame: &Frame) -> bool {
        let mut copy = Frame::empty();
        copy.len = frame.len;
        self.restore(slot, &mut copy) && copy.payload == frame.payload
    }

    /// Puts together the last payload from the elements; `false` where not all of it was kept.
    pub(super) fn restore(&self, slot: &Slot, frame: &mut Frame) -> bool {
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
                What::Text => match self.texts.last(element) {
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

#[inline]
fn word(place: &[u8; 8]) -> u32 {
    u32::from_le_bytes([place[0], place[1], place[2], place[3]])
}

/// The lower `size` bytes of a value.
#[inline]
fn put(place: &mut [u8; 8], value: u32, size: usize) {
    for (place, byte) in place.iter_mut().zip(value.to_le_bytes()).take(size) {
        *place = byte;
    }
}

/// A clock that a time field proposes to move: only forward, and not by more than ten seconds; anything else is no
/// advance of a clock.
#[inline]
fn advanced(clock_us: u32, proposed_us: u32) -> u32 {
    if proposed_us.wrapping_sub(clock_us) < 10_000_000 { proposed_us } else { clock_us }
}

#[inline]
fn publish(registers: &mut [f32; REGISTERS], link: Option<&Link>, element: &Element) {
    if let Some(link) = link
        && let Some(register) = registers.get_mut(usize::from(link.register))
    {
        *register = element.number() * link.scale;
    }
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
