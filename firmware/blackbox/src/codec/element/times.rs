//! Times of 4 and 8 bytes, and all other integers of 8 bytes.

use super::classes::TIME;
use super::rest::{ESCAPE, integer_class, integer_rest};
use super::{Context, Distributions, Element, ElementKind};
use crate::coder::Coder;

/// Predictions of a time:
/// - the last value (the first one);
/// - with the last step;
/// - by the arrival time;
/// - by the newest time of any message;
/// - that time itself.
const LINEAR: usize = 1;
const BY_ARRIVAL: usize = 2;
const BY_CLOCK: usize = 3;
const SAME_CLOCK: usize = 4;

impl Distributions {
    #[inline(never)]
    pub(crate) fn time<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        context: &Context,
    ) -> u32 {
        let last = element.last;
        let mut guesses = [last; SAME_CLOCK + 1];
        guesses[LINEAR] = last.wrapping_add(element.step as u32);
        let elapsed_us = context.clock_us.wrapping_sub(element.aux);
        (guesses[BY_ARRIVAL], guesses[BY_CLOCK]) = if element.what() == ElementKind::Millis {
            (last.wrapping_add(context.elapsed_ms), last.wrapping_add(thousandth(elapsed_us)))
        } else {
            let arrival = context.elapsed_ms.wrapping_mul(1_000);
            (last.wrapping_add(arrival), last.wrapping_add(elapsed_us))
        };
        guesses[SAME_CLOCK] = context.clock_ms;
        element.aux = context.clock_us;
        let known = element.known();
        let guess = if known { guesses[element.costs.cheapest::<{ SAME_CLOCK + 1 }>().0] } else { 0 };
        let difference = value.wrapping_sub(guess) as i32;
        let class = integer_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, TIME, class);
        let value = guess.wrapping_add(integer_rest(coder, symbol, difference) as u32);
        let [first @ .., same_clock] = guesses;
        element.costs.charge(first.map(|guess| value.wrapping_sub(guess) as i32));
        element.costs.charge_more(SAME_CLOCK, value.wrapping_sub(same_clock) as i32);
        element.step = if known { value.wrapping_sub(last) as i32 } else { 0 };
        element.note(value == last);
        element.last = value;
        value
    }

    /// An integer of 8 bytes (a double is coded by its bits): the element holds the lower half, the next one the
    /// upper.
    #[inline(never)]
    pub(crate) fn wide<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        upper: &mut Element,
        value: u64,
        context: &Context,
    ) -> u64 {
        let last = u64::from(upper.last) << 32 | u64::from(element.last);
        let timed = element.what() == ElementKind::WideTime;
        let mut guesses = [last; BY_CLOCK + 1];
        guesses[LINEAR] = last.wrapping_add_signed(i64::from(element.step));
        if timed {
            let elapsed_us = context.clock_us.wrapping_sub(element.aux) as i32;
            guesses[BY_ARRIVAL] = last.wrapping_add(u64::from(context.elapsed_ms) * 1_000);
            guesses[BY_CLOCK] = last.wrapping_add_signed(i64::from(elapsed_us));
        }
        let (best, _) = if timed { element.costs.cheapest::<4>() } else { element.costs.cheapest::<2>() };
        let known = element.known();
        let guess = if known { guesses[best] } else { 0 };
        let value = self.wide_from(coder, element, guess, last, value);
        element.costs.charge(guesses.map(|guess| within_32_bits(value.wrapping_sub(guess) as i64)));
        let step = value.wrapping_sub(last) as i64;
        element.step = if known { i32::try_from(step).unwrap_or(0) } else { 0 };
        if value != last && value != 0 {
            element.weigh_decimal(times_1000(value));
        }
        element.aux = context.clock_us;
        element.note(value == last);
        element.last = value as u32;
        upper.last = (value >> 32) as u32;
        value
    }

    /// The value as its difference from a guess, in thousands while all differences are.
    fn wide_from<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        guess: u64,
        last: u64,
        value: u64,
    ) -> u64 {
        let (mut guess, mut now, mut quantum, mut whole) = (guess, value, 1, true);
        if element.decimals() >= 3 && times_1000(last) {
            (guess, now, quantum) = (guess.wrapping_add(500) / 1_000, value / 1_000, 1_000);
            whole = times_1000(value);
        }
        let difference = now.wrapping_sub(guess) as i64;
        let fits = whole && i32::try_from(difference).is_ok();
        let class = if fits { integer_class(difference.unsigned_abs() as u32) } else { ESCAPE };
        let symbol = self.class_or_first(coder, element, TIME, class);
        if symbol == ESCAPE && coder.bits16(u32::from(!fits), 1) != 0 {
            let low = coder.bits(value as u32, 32);
            return u64::from(coder.bits((value >> 32) as u32, 32)) << 32 | u64::from(low);
        }
        let difference = integer_rest(coder, symbol, difference as i32);
        guess.wrapping_add_signed(i64::from(difference)).wrapping_mul(quantum)
    }
}

#[inline]
fn within_32_bits(error: i64) -> i32 {
    i32::try_from(error).unwrap_or(i32::MAX)
}

/// Whether it is a multiple of 1000, without dividing: by the inverse of 125 modulo 2^64.
#[inline]
const fn times_1000(value: u64) -> bool {
    const INVERSE_OF_125: u64 = 0x1cac_0831_26e9_78d5;
    value & 7 == 0 && value.wrapping_mul(INVERSE_OF_125) <= u64::MAX / 125
}

#[inline]
const fn thousandth(value: u32) -> u32 {
    ((value.wrapping_add(500) as u64 * 4_294_968) >> 32) as u32
}
