//! Floats of 4 bytes, compared in the order of their values. Hundredths of whole numbers are counted in hundredths,
//! and unpredictable values are coded by their parts.

use super::classes::{COMPUTED, DECIMAL, FLOAT, RANDOM_FLOAT};
use super::costs::PREDICTIONS;
use super::rest::{ESCAPE, float_class, float_rest, integer_class, integer_rest};
use super::{Context, Distributions, Element, STEP_DECIMAL};
use crate::coder::Coder;

/// Predictions from the last value: unchanged, with the last step, with half of it, changed like the previous float
/// in the frame. Then two from the linked register: changed like it, or equal to it.
const LAST: usize = 0;
const LINEAR: usize = 1;
const HALF: usize = 2;
const AS_NEIGHBOUR: usize = 3;
const AS_LINK: usize = 4;
const LINKED: usize = 5;

/// From this cost on, in eighths of a bit, a float is as good as random and is coded by its own parts.
const RANDOM: u32 = 192;

impl Distributions {
    #[inline(never)]
    pub(crate) fn float<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        context: &Context,
    ) -> u32 {
        let (last, link) = (element.last, context.link);
        let mut coded = (None, None);
        if element.decimals() >= 3
            && let Some(hundredths) = hundredths(last)
        {
            coded = self.decimal(coder, element, hundredths, value);
        }
        let last_order = order(last);
        let last_step = if element.decimal & STEP_DECIMAL != 0 { 0 } else { element.step };
        let number = f32::from_bits(last);
        let mut guesses = [last_order; PREDICTIONS];
        guesses[LINEAR] = last_order.wrapping_add(last_step);
        guesses[HALF] = last_order.wrapping_add(last_step / 2);
        if let Some((now, before)) = context.neighbour {
            guesses[AS_NEIGHBOUR] = order_or(number + (now - before), last_order);
        }
        if let Some((linked, _)) = link {
            guesses[AS_LINK] = order_or(number + (linked - f32::from_bits(element.aux)), last_order);
            guesses[LINKED] = order_or(linked, last_order);
            element.aux = linked.to_bits();
        }
        let (coded, step) = coded;
        let value = if let Some(value) = coded {
            value
        } else {
            match (link, element.costs) {
                (Some((_, true)), _) if element.known() => {
                    self.computed(coder, element, guesses[LINKED], value)
                }
                (link, costs) => {
                    let (best, cost) = match link {
                        Some(_) => costs.cheapest::<PREDICTIONS>(),
                        None => costs.cheapest::<{ AS_NEIGHBOUR + 1 }>(),
                    };
                    self.difference(coder, element, guesses[best], cost, value)
                }
            }
        };
        let now = order(value);
        let [first @ .., as_link, linked] = guesses;
        element.costs.charge(first.map(|guess| now.wrapping_sub(guess)));
        if link.is_some() {
            element.costs.charge_more(AS_LINK, now.wrapping_sub(as_link));
            element.costs.charge_more(LINKED, now.wrapping_sub(linked));
        }
        element.step = step.unwrap_or_else(|| now.wrapping_sub(last_order));
        element.decimal = element.decimal & !STEP_DECIMAL | if step.is_some() { STEP_DECIMAL } else { 0 };
        if value != last && value != 0 {
            element.weigh_decimal(hundredths(value).is_some());
        }
        element.note(value == last);
        element.last = value;
        value
    }

    fn decimal<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        last: i32,
        value: u32,
    ) -> (Option<u32>, Option<i32>) {
        let linear = element.decimal & STEP_DECIMAL != 0 && element.costs.of(LINEAR) < element.costs.of(LAST);
        let guess = if linear { last.wrapping_add(element.step) } else { last };
        let now = if C::WRITES { hundredths(value) } else { None };
        let difference = now.map_or(0, |now| now.wrapping_sub(guess));
        let symbol = if now.is_some() { integer_class(difference.unsigned_abs()) } else { ESCAPE };
        let symbol = self.class(coder, element, DECIMAL, symbol);
        if symbol == ESCAPE && coder.bits16(u32::from(now.is_none()), 1) != 0 {
            return (None, None);
        }
        let now = guess.wrapping_add(integer_rest(coder, symbol, difference));
        (Some((now as f32 * 0.01).to_bits()), Some(now.wrapping_sub(last)))
    }

    #[inline(never)]
    fn computed<C: Coder>(&mut self, coder: &mut C, element: &mut Element, guess: i32, value: u32) -> u32 {
        let difference = order(value).wrapping_sub(guess);
        let symbol = self.class(coder, element, COMPUTED, integer_class(difference.unsigned_abs()));
        unorder(guess.wrapping_add(integer_rest(coder, symbol, difference)))
    }

    #[inline]
    fn difference<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        guess: i32,
        cost: u32,
        value: u32,
    ) -> u32 {
        let known = element.known();
        if known && cost >= RANDOM {
            return self.random(coder, element, value);
        }
        let guess = if known { guess } else { 0 };
        let difference = order(value).wrapping_sub(guess);
        let class = float_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, FLOAT, class);
        unorder(guess.wrapping_add(float_rest(coder, symbol, difference)))
    }

    /// An unpredictable float: its exponent by class, the rest uncoded.
    fn random<C: Coder>(&mut self, coder: &mut C, element: &mut Element, value: u32) -> u32 {
        let exponent = (value >> 23 & 0xff) as i32;
        let offset = exponent - i32::from(element.exponent) + 8;
        let symbol = match offset {
            _ if value == element.last => 0,
            1..=14 => offset as usize,
            _ => ESCAPE,
        };
        let symbol = self.class(coder, element, RANDOM_FLOAT, symbol);
        match symbol {
            0 => element.last,
            ESCAPE => {
                let value = coder.bits(value, 32);
                element.exponent = (value >> 23) as u8;
                value
            }
            _ => {
                let rest = coder.bits(value & 0x007f_ffff | value >> 31 << 23, 24);
                let exponent = (i32::from(element.exponent) + symbol as i32 - 8) as u32 & 0xff;
                rest >> 23 << 31 | exponent << 23 | rest & 0x007f_ffff
            }
        }
    }
}

#[inline]
const fn order(bits: u32) -> i32 {
    let bits = bits as i32;
    bits ^ ((bits >> 31) & 0x7fff_ffff)
}

#[inline]
const fn unorder(order: i32) -> u32 {
    (order ^ ((order >> 31) & 0x7fff_ffff)) as u32
}

/// A computed float in order; NaN differs between machines, so it does not count.
#[inline]
fn order_or(number: f32, otherwise: i32) -> i32 {
    if number.is_nan() { otherwise } else { order(number.to_bits()) }
}

/// `n` where the float is exactly `n x 0.01` as floats multiply.
#[inline]
fn hundredths(bits: u32) -> Option<i32> {
    let scaled = f32::from_bits(bits) * 100.0;
    if scaled.is_nan() || scaled.abs() >= 8_388_608.0 {
        return None;
    }
    let n = (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i32;
    ((n as f32 * 0.01).to_bits() == bits).then_some(n)
}
