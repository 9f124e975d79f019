//! Integers of 1, 2 or 4 bytes that are no times.

use super::classes::{INTEGER_1, INTEGER_2, INTEGER_4};
use super::rest::{integer_class, integer_rest};
use super::{Distributions, Element, What};
use crate::coder::Coder;

/// From the last value: as it is, with the last step, with half of it; or equal to the linked register.
const LAST: usize = 0;
const LINEAR: usize = 1;
const HALF: usize = 2;
const LINKED: usize = 3;

impl Distributions {
    /// Codes the value's bits.
    #[inline(never)]
    pub(crate) fn integer<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        linked: Option<u32>,
    ) -> u32 {
        // Bits that the value does not have.
        let (spare, kind) = match element.what {
            What::Integer1 => (24, INTEGER_1),
            What::Integer2 => (16, INTEGER_2),
            _ => (0, INTEGER_4),
        };
        let fold = |difference: u32| ((difference << spare) as i32) >> spare;
        let (last, step, known) = (element.last, element.step, element.known());
        // The first value is predicted as zero, which is what `last` is then.
        let ahead = match (step, linked) {
            (0, None) => 0,
            _ => match element.costs.cheapest::<4>().0 {
                _ if !known => 0,
                LAST => 0,
                LINEAR => step,
                HALF => step / 2,
                _ => fold(linked.unwrap_or(last).wrapping_sub(last)),
            },
        };
        let guess = last.wrapping_add(ahead as u32);
        let difference = fold(value.wrapping_sub(guess));
        let class = integer_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, kind, class);
        let difference = integer_rest(coder, symbol, difference);
        let value = guess.wrapping_add(difference as u32) & (u32::MAX >> spare);
        let change = fold(value.wrapping_sub(last));
        if step == 0 && linked.is_none() {
            element.costs.charge_all(change);
        } else {
            let mut errors = [change; 4];
            let ahead_by = |ahead: i32| fold((change as u32).wrapping_sub(ahead as u32));
            errors[LINEAR] = ahead_by(step);
            errors[HALF] = ahead_by(step / 2);
            if let Some(linked) = linked {
                errors[LINKED] = fold(value.wrapping_sub(linked));
            }
            element.costs.charge(errors);
        }
        element.step = if known { change } else { 0 };
        element.note(change == 0);
        element.last = value;
        value
    }
}
