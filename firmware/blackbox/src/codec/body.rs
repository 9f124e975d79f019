//! A frame's payload, element by element, by its layout.

use core::ops::Range;

use super::element::{Context, Distributions, ELEMENTS, Element, Elements, What};
use super::frame::Frame;
use super::links::{LINKS, Link, REGISTERS};
use super::recall::{End, Recall, WORDS};
use super::slots::{Length, Slot};
use super::texts::Texts;
use crate::coder::{Coder, Reading};

/// Context of bytes by their place.
const AT: u32 = 0x100;

/// What is known of all payloads.
pub(super) struct Body {
    pub(super) elements: Elements,
    pub(super) common: Common,
}

/// What the elements know in common.
pub(super) struct Common {
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
            common: Common {
                distributions: Distributions::new(),
                texts: Texts::new(),
                registers: [0.0; REGISTERS],
                clock_us: 0,
                clock_ms: 0,
            },
        }
    }

    pub(super) fn reset(&mut self) {
        self.elements.reset();
        self.common.distributions.reset();
        self.common.texts.reset();
        self.common.registers = [0.0; REGISTERS];
        (self.common.clock_us, self.common.clock_ms) = (0, 0);
    }

    /// All of the payload.
    pub(super) fn payload<C: End>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let mut end = 0;
        if slot.layout.is_some() {
            let calm = slot.quiet && self.calm(coder, slot, frame)?;
            end = match coder.reading() {
                Some(mut reading) if calm || !slot.quiet => match reading.recall.end(limit(slot)) {
                    Some(end) => self.lively(&mut reading, slot, frame, elapsed_ms).map(|()| end)?,
                    None => self.fields(coder, slot, frame, elapsed_ms, calm)?,
                },
                _ => self.fields(coder, slot, frame, elapsed_ms, calm)?,
            };
        } else if !C::WRITES {
            frame.clear();
        }
        if let Length::Fixed(len) = slot.length {
            for at in end..usize::from(len) {
                let byte = frame.payload.get(at).copied()?;
                let byte = self.common.texts.model.byte(coder, byte, AT | at as u32);
                frame.payload[at] = byte;
            }
        }
        if let Some(reading) = coder.reading() {
            match slot.length {
                Length::Fixed(len) if usize::from(len) > end => reading.recall.forget(),
                _ => reading.recall.keep(limit(slot), end),
            }
        }
        Some(())
    }

    /// The fields that the layout describes; gives where they end. `calm`: the quiet ones stay as they are.
    #[inline(never)]
    fn fields<C: End>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
        calm: bool,
    ) -> Option<usize> {
        let limit = limit(slot);
        if let Some(reading) = coder.reading() {
            reading.recall.forget();
            frame.clear();
        }
        let (clock_us, clock_ms) = (self.common.clock_us, self.common.clock_ms);
        let mut context = Context { elapsed_ms, clock_us, clock_ms, neighbour: None, link: None };
        let (mut offset, mut quiet) = (0, 0);
        let mut link = usize::from(slot.links);
        let mut elements = self.elements.list.get_mut(elements_in(slot))?.iter_mut();
        while let Some(element) = elements.next() {
            let (what, size) = (element.what, usize::from(element.size));
            if offset + size > limit {
                break;
            }
            let place = frame.place(offset);
            let stays = calm && element.is_quiet();
            let left = elements.len();
            match what {
                What::Text => {
                    let text = frame.payload.get_mut(offset..offset + size)?;
                    self.common.texts.code(coder, element, text, stays)?;
                }
                _ if stays => {
                    if !C::WRITES {
                        let upper = if what.is_wide() { elements.as_slice().first()?.last } else { 0 };
                        *place = (u64::from(upper) << 32 | u64::from(element.last)).to_le_bytes();
                    }
                }
                What::Integer1 | What::Integer2 | What::Integer4 => {
                    let bits = word(place) & (u32::MAX >> (32 - 8 * size));
                    let value = self.common.distributions.integer(coder, element, bits);
                    if element.has_links() {
                        self.common.publish(links_at(&mut link, slot.key.id, offset).1, element);
                    }
                    if !C::WRITES {
                        put(place, value, size);
                    }
                }
                What::Millis | What::Micros => self.common.time(coder, element, place, &context),
                What::Float => {
                    let mut links = (None, None);
                    if element.has_links() {
                        links = links_at(&mut link, slot.key.id, offset);
                    }
                    self.common.float(coder, element, place, &mut context, links);
                }
                What::Wide | What::WideTime => {
                    self.common.wide(coder, element, elements.next()?, place, &context);
                }
                What::Instance => {
                    let instance = slot.key.instance.get(..size)?;
                    frame.payload.get_mut(offset..offset + size)?.copy_from_slice(instance);
                }
                What::Upper => {}
            }
            quiet |= element.quiet_bits();
            if let Some(reading) = coder.reading() {
                reading.recall.visited(slot, left, offset, element);
            }
            offset += size;
        }
        slot.quiet = Element::any_quiet(quiet);
        Some(offset)
    }

    /// The same of a frame whose quiet fields stay as they are in the frame before, for the reader: it visits the others.
    #[inline(never)]
    fn lively(
        &mut self,
        coder: &mut Reading<'_, Recall>,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let (clock_us, clock_ms) = (self.common.clock_us, self.common.clock_ms);
        let mut context = Context { elapsed_ms, clock_us, clock_ms, neighbour: None, link: None };
        let mut link = usize::from(slot.links);
        let elements = self.elements.list.get_mut(elements_in(slot))?;
        let mut quiet = 0;
        for word in 0..WORDS {
            let (mut to_come, mut lively) = (*coder.recall.lively(word), 0);
            while to_come != 0 {
                let bit = to_come & to_come.wrapping_neg();
                let index = word * 64 + to_come.trailing_zeros() as usize;
                to_come ^= bit;
                let offset = coder.recall.offset(slot, index)?;
                let (element, rest) = elements.get_mut(index..)?.split_first_mut()?;
                self.common.element(
                    coder,
                    (element, rest),
                    (slot, frame),
                    offset,
                    (&mut link, &mut context),
                )?;
                quiet |= element.quiet_bits();
                lively |= if element.is_quiet() { 0 } else { bit };
            }
            *coder.recall.lively(word) = lively;
        }
        slot.quiet |= Element::any_quiet(quiet);
        Some(())
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
        let elements = self.elements.list.get(elements_in(slot))?;
        for (index, element) in elements.iter().enumerate() {
            let size = usize::from(element.size);
            if offset + size > limit {
                break;
            }
            if element.is_quiet() {
                let place = frame.place(offset);
                let same = match element.what {
                    What::Text => self.common.texts.last(element) == frame.payload.get(offset..offset + size),
                    What::Wide | What::WideTime => {
                        let upper = elements.get(index + 1)?;
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
                What::Text => match self.common.texts.last(element) {
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

impl Common {
    /// One element of a frame that is read, at this offset; `rest` are those after it.
    #[inline]
    fn element(
        &mut self,
        coder: &mut Reading<'_, Recall>,
        (element, rest): (&mut Element, &mut [Element]),
        (slot, frame): (&Slot, &mut Frame),
        offset: usize,
        (link, context): (&mut usize, &mut Context),
    ) -> Option<()> {
        let size = usize::from(element.size);
        let place = frame.place(offset);
        match element.what {
            What::Float => {
                let mut links = (None, None);
                if element.has_links() {
                    links = links_at(link, slot.key.id, offset);
                }
                self.float(coder, element, place, context, links);
            }
            What::Integer1 | What::Integer2 | What::Integer4 => {
                let value = self.distributions.integer(coder, element, 0);
                if element.has_links() {
                    self.publish(links_at(link, slot.key.id, offset).1, element);
                }
                put(place, value, size);
            }
            What::Millis | What::Micros => self.time(coder, element, place, context),
            What::Wide | What::WideTime => self.wide(coder, element, rest.first_mut()?, place, context),
            What::Text => {
                let text = frame.payload.get_mut(offset..offset + size)?;
                self.texts.code(coder, element, text, false)?;
            }
            What::Instance | What::Upper => {}
        }
        Some(())
    }

    #[inline]
    fn time<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        place: &mut [u8; 8],
        context: &Context,
    ) {
        let (last, at_last) = (element.last, element.aux);
        let value = self.distributions.time(coder, element, word(place), context);
        let mut step_us = value.wrapping_sub(last);
        if element.what == What::Millis {
            self.clock_ms = value;
            step_us = step_us.wrapping_mul(1_000);
        }
        self.advance(at_last.wrapping_add(step_us));
        if !C::WRITES {
            put(place, value, 4);
        }
    }

    #[inline]
    fn wide<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        upper: &mut Element,
        place: &mut [u8; 8],
        context: &Context,
    ) {
        let (last, at_last) = (element.last, element.aux);
        let value = self.distributions.wide(coder, element, upper, u64::from_le_bytes(*place), context);
        if element.what == What::WideTime {
            self.advance(at_last.wrapping_add((value as u32).wrapping_sub(last)));
        }
        if !C::WRITES {
            *place = value.to_le_bytes();
        }
    }

    #[inline]
    fn float<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        place: &mut [u8; 8],
        context: &mut Context,
        (consults, publishes): Links,
    ) {
        context.link = match consults {
            Some(link) => self.registers.get(usize::from(link.register)).map(|known| known * link.scale),
            None => None,
        };
        let last = element.last;
        let value = self.distributions.float(coder, element, word(place), context);
        context.neighbour = Some((f32::from_bits(value), f32::from_bits(last)));
        self.publish(publishes, element);
        if !C::WRITES {
            put(place, value, 4);
        }
    }

    /// A time field proposes to move the clock: only forward, and not by more than ten seconds; anything else is no
    /// advance of a clock.
    #[inline]
    fn advance(&mut self, proposed_us: u32) {
        if proposed_us.wrapping_sub(self.clock_us) < 10_000_000 {
            self.clock_us = proposed_us;
        }
    }

    #[inline]
    fn publish(&mut self, link: Option<&Link>, element: &Element) {
        if let Some(link) = link
            && let Some(register) = self.registers.get_mut(usize::from(link.register))
        {
            *register = element.number() * link.scale;
        }
    }
}

/// The links of a field: the one to consult and the one to publish.
type Links = (Option<&'static Link>, Option<&'static Link>);

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

/// A value of 1, 2 or 4 bytes in its place, and nothing else.
#[inline]
fn put(place: &mut [u8; 8], value: u32, size: usize) {
    let [a, b, c, d] = value.to_le_bytes();
    match size {
        1 => place[0] = a,
        2 => *place.first_chunk_mut().expect("two of eight") = [a, b],
        _ => *place.first_chunk_mut().expect("four of eight") = [a, b, c, d],
    }
}

/// The links of the field at an offset; moves on to them.
pub(super) fn links_at(at: &mut usize, id: u32, offset: usize) -> Links {
    let mut found = (None, None);
    while let Some(link) = LINKS.get(*at).filter(|link| link.id == id && usize::from(link.offset) <= offset) {
        if usize::from(link.offset) == offset {
            *(if link.publishes { &mut found.1 } else { &mut found.0 }) = Some(link);
        }
        *at += 1;
    }
    found
}
