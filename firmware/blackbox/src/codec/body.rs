//! A frame's payload, element by element, by its layout.

use core::ops::Range;

use zerocopy::FromZeros;

use super::element::{Context, Distributions, ELEMENTS, Element, ElementKind, Elements};
use super::frame::Frame;
use super::links::Registers;
use super::recall::End;
use super::slots::{Length, Slot};
use super::texts::Texts;
use crate::coder::Coder;
use crate::zeros;

const AT: u32 = 0x100;

#[derive(FromZeros)]
pub(super) struct Body {
    pub(super) elements: Elements,
    pub(super) common: Common,
}

#[derive(FromZeros)]
pub(super) struct Common {
    pub(super) distributions: Distributions,
    pub(super) texts: Texts,
    registers: Registers,
    clock_us: u32,
    clock_ms: u32,
}

impl Body {
    pub(super) fn reset(&mut self) {
        self.elements.reset();
        self.common.distributions.reset();
        self.common.texts.reset();
        self.common.registers.zero();
        (self.common.clock_us, self.common.clock_ms) = (0, 0);
    }

    pub(super) fn payload<C: End>(
        &mut self,
        coder: &mut C,
        slot: &mut Slot,
        frame: &mut Frame,
        elapsed_ms: u32,
    ) -> Option<()> {
        let calm = slot.quiet && self.calm(coder, slot, frame)?;
        if let Some(reading) = coder.reading()
            && !reading.recall.has(limit(slot))
        {
            frame.clear();
            self.restore(slot, frame);
        }
        let end = self.fields(coder, slot, frame, elapsed_ms, calm)?;
        let len = if let Length::Fixed(len) = slot.length { usize::from(len) } else { 0 };
        for at in end..len {
            let byte = frame.payload.get(at).copied()?;
            frame.payload[at] = self.common.texts.model.byte(coder, byte, AT | at as u32);
        }
        if let Some(reading) = coder.reading() {
            reading.recall.keep(limit(slot), len <= end);
        }
        Some(())
    }

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
        let (clock_us, clock_ms) = (self.common.clock_us, self.common.clock_ms);
        let mut context = Context { elapsed_ms, clock_us, clock_ms, neighbour: None, link: None };
        let (mut end, mut quiet) = (0, 0);
        let mut rest = self.elements.list.get_mut(elements_in(slot))?;
        while let Some((element, after)) = rest.split_first_mut() {
            if usize::from(element.end) > limit {
                break;
            }
            if !(calm && element.is_quiet()) {
                self.common.element(coder, element, after, frame, &mut context)?;
            }
            quiet |= element.quiet_bits();
            end = usize::from(element.end);
            rest = after;
        }
        slot.quiet = Element::any_quiet(quiet);
        Some(end)
    }

    /// Codes elements that all keep their values: one bit.
    #[inline(never)]
    fn calm<C: Coder>(&mut self, coder: &mut C, slot: &mut Slot, frame: &mut Frame) -> Option<bool> {
        let same = C::WRITES && self.stays(slot, frame)?;
        let same = coder.bit(slot.calm.one().clamp(16, 4_080), same);
        slot.calm.adapt(same);
        Some(same)
    }

    fn stays(&self, slot: &Slot, frame: &mut Frame) -> Option<bool> {
        let mut rest = self.elements.list.get(elements_in(slot))?;
        while let Some((element, after)) = rest.split_first()
            && usize::from(element.end) <= limit(slot)
        {
            if element.is_quiet() {
                let (at, size) = (element.offset(), element.size());
                let same = match self.common.last(slot, element, after)? {
                    Last::Number(last) => {
                        (u64::from_le_bytes(*frame.place(at)) ^ last) << (64 - 8 * size) == 0
                    }
                    Last::Bytes(last) => frame.payload.get(at..at + size) == Some(last),
                };
                if !same {
                    return Some(false);
                }
            }
            rest = after;
        }
        Some(true)
    }

    pub(super) fn is_repeat(&self, slot: &Slot, frame: &Frame) -> bool {
        let mut copy: Frame = zeros();
        copy.len = frame.len;
        self.restore(slot, &mut copy).is_some() && copy.payload == frame.payload
    }

    /// Assembles the last payload from the elements; `None` unless all of it was stored.
    pub(super) fn restore(&self, slot: &Slot, frame: &mut Frame) -> Option<()> {
        let (mut end, mut is_kept) = (0, slot.has_layout());
        let mut rest = self.elements.list.get(elements_in(slot))?;
        while let Some((element, after)) = rest.split_first()
            && usize::from(element.end) <= limit(slot)
        {
            let place = frame.payload.get_mut(element.offset()..)?;
            match self.common.last(slot, element, after) {
                Some(Last::Number(last)) => {
                    place
                        .get_mut(..element.size())?
                        .copy_from_slice(last.to_le_bytes().get(..element.size())?);
                }
                Some(Last::Bytes(last)) => place.get_mut(..last.len())?.copy_from_slice(last),
                None => is_kept = false,
            }
            end = usize::from(element.end);
            rest = after;
        }
        (is_kept && (frame.len <= end || slot.length == Length::Trimmed)).then_some(())
    }
}

enum Last<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

impl Common {
    #[inline]
    fn last<'a>(&'a self, slot: &'a Slot, element: &Element, after: &[Element]) -> Option<Last<'a>> {
        Some(match element.what() {
            ElementKind::Text => Last::Bytes(self.texts.last(element)?),
            ElementKind::Instance => Last::Bytes(slot.key.instance.get(..element.size())?),
            ElementKind::Wide | ElementKind::WideTime => {
                Last::Number(u64::from(after.first()?.last) << 32 | u64::from(element.last))
            }
            _ => Last::Number(u64::from(element.last)),
        })
    }

    /// `after`: the elements after it.
    #[inline]
    fn element<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        after: &mut [Element],
        frame: &mut Frame,
        context: &mut Context,
    ) -> Option<()> {
        let place = frame.place(element.offset());
        match element.what() {
            ElementKind::Float => {
                let last = element.last;
                context.link = self.registers.consult(element.row());
                let value = self.distributions.float(coder, element, word(place), context);
                context.neighbour = Some((f32::from_bits(value), f32::from_bits(last)));
                self.registers.publish(element);
                put::<C>(place, u64::from(value), 4);
            }
            ElementKind::Integer1 | ElementKind::Integer2 | ElementKind::Integer4 => {
                let size = element.size();
                let bits = word(place) & (u32::MAX >> (32 - 8 * size));
                let linked = self.registers.consult_whole(element.row());
                let value = self.distributions.integer(coder, element, bits, linked);
                self.registers.publish(element);
                put::<C>(place, u64::from(value), size);
            }
            ElementKind::Millis | ElementKind::Micros => {
                let (last, at_last) = (element.last, element.aux);
                let value = self.distributions.time(coder, element, word(place), context);
                let mut step_us = value.wrapping_sub(last);
                if element.what() == ElementKind::Millis {
                    self.clock_ms = value;
                    step_us = step_us.wrapping_mul(1_000);
                }
                self.advance(at_last.wrapping_add(step_us));
                self.registers.publish(element);
                put::<C>(place, u64::from(value), 4);
            }
            ElementKind::Wide | ElementKind::WideTime => {
                let (last, at_last) = (element.last, element.aux);
                let value = u64::from_le_bytes(*place);
                let value = self.distributions.wide(coder, element, after.first_mut()?, value, context);
                if element.what() == ElementKind::WideTime {
                    self.advance(at_last.wrapping_add((value as u32).wrapping_sub(last)));
                }
                put::<C>(place, value, 8);
            }
            ElementKind::Text => {
                let (start, end) = (element.offset(), usize::from(element.end));
                self.texts.code(coder, element, frame.payload.get_mut(start..end)?)?;
            }
            ElementKind::Instance | ElementKind::Upper => {}
        }
        Some(())
    }

    /// A time field may advance the clock by at most 10 s. Any other change is ignored.
    #[inline]
    fn advance(&mut self, proposed_us: u32) {
        if proposed_us.wrapping_sub(self.clock_us) < 10_000_000 {
            self.clock_us = proposed_us;
        }
    }
}

fn elements_in(slot: &Slot) -> Range<usize> {
    let first = usize::from(slot.elements);
    first..(first + usize::from(slot.elements_count)).min(ELEMENTS)
}

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

/// The writer has it there already.
#[inline]
fn put<C: Coder>(place: &mut [u8; 8], value: u64, size: usize) {
    let bytes = value.to_le_bytes();
    match size {
        _ if C::WRITES => {}
        1 => place[0] = bytes[0],
        2 => place[..2].copy_from_slice(&bytes[..2]),
        4 => place[..4].copy_from_slice(&bytes[..4]),
        _ => *place = bytes,
    }
}
