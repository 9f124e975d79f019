//! Integers of 1, 2 or 4 bytes, times excepted.

use super::classes::{INTEGER_1, INTEGER_2, INTEGER_4};
use super::rest::{integer_class, integer_rest};
use super::{Distributions, Element, ElementKind};
use crate::coder::Coder;

/// Predictions from the last value: unchanged, with the last step, with half of it. Then two from the linked
/// register: equal to it, or changed like it.
const HALF: usize = 2;
const LINKED: usize = 3;
const AS_LINK: usize = 4;

impl Distributions {
    #[inline(never)]
    pub(crate) fn integer<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        linked: Option<u32>,
    ) -> u32 {
        let (spare, kind) = match element.what() {
            ElementKind::Integer1 => (24, INTEGER_1),
            ElementKind::Integer2 => (16, INTEGER_2),
            _ => (0, INTEGER_4),
        };
        let fold = |difference: u32| ((difference << spare) as i32) >> spare;
        let (last, step, known) = (element.last, element.step, element.known());
        // The first value is predicted as zero, the initial value of `last`.
        let mut ahead_by = [0, step, step / 2, 0, 0];
        if let Some(linked) = linked {
            ahead_by[LINKED] = fold(linked.wrapping_sub(last));
            ahead_by[AS_LINK] = fold(linked.wrapping_sub(element.aux));
            element.aux = linked;
        }
        let ahead = match (step, linked) {
            (_, Some(_)) if known => ahead_by[element.costs.cheapest::<{ AS_LINK + 1 }>().0],
            (0, _) => 0,
            _ => ahead_by[element.costs.cheapest::<{ HALF + 1 }>().0],
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
            let [first @ .., as_link] = ahead_by;
            let error = |ahead: i32| fold((change as u32).wrapping_sub(ahead as u32));
            element.costs.charge(first.map(error));
            if linked.is_some() {
                element.costs.charge_more(AS_LINK, error(as_link));
            }
        }
        element.step = if known { change } else { 0 };
        element.note(change == 0);
        element.last = value;
        value
    }
}
