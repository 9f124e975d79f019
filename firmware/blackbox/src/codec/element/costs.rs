//! Recent costs of an element's predictions: their lengths of error in bits, averaged, in eighths of a bit.

pub(super) const PREDICTIONS: usize = 6;

const UNKNOWN: u8 = 100;

/// Four in a word, which are charged in one step, and two more.
#[derive(Clone, Copy, Debug, zerocopy::FromZeros)]
pub(super) struct Costs {
    /// Bytes, to keep the element small.
    first: [u8; 4],
    more: [u8; 2],
}

impl Costs {
    pub(super) const NEW: Self = Self { first: [0, 0, 0, UNKNOWN], more: [UNKNOWN; 2] };

    #[inline]
    const fn word(self) -> u32 {
        u32::from_le_bytes(self.first)
    }

    #[inline]
    pub(super) const fn of(self, prediction: usize) -> u32 {
        self.word() >> (8 * prediction) & 0xff
    }

    #[inline]
    pub(super) fn cheapest<const COUNT: usize>(self) -> (usize, u32) {
        let mut best = (0, self.of(0));
        for prediction in 1..COUNT {
            let cost =
                if prediction < 4 { self.of(prediction) } else { u32::from(self.more[prediction - 4]) };
            if cost < best.1 {
                best = (prediction, cost);
            }
        }
        best
    }

    #[inline]
    pub(super) fn charge(&mut self, errors: [i32; 4]) {
        // Adds four bytes at once. All sums stay below 256, so intermediate carries cancel.
        let word = self.word();
        let eighths = (word >> 3) & 0x1f1f_1f1f;
        let mut sum = word.wrapping_sub(eighths).wrapping_add(0x2020_2020);
        for (place, error) in errors.into_iter().enumerate() {
            sum = sum.wrapping_sub((32 - length(error)) << (8 * place));
        }
        self.first = sum.to_le_bytes();
    }

    /// All were off by as much.
    #[inline]
    pub(super) fn charge_all(&mut self, error: i32) {
        let word = self.word();
        let eighths = (word >> 3) & 0x1f1f_1f1f;
        self.first = (word - eighths + length(error) * 0x0101_0101).to_le_bytes();
    }

    #[inline]
    pub(super) fn charge_more(&mut self, prediction: usize, error: i32) {
        if let Some(cost) = self.more.get_mut(prediction.wrapping_sub(4)) {
            *cost = *cost - (*cost >> 3) + length(error) as u8;
        }
    }
}

/// Bits of an error without its sign, 0 to 31: of its magnitude, or where it is negative of that less one.
#[inline]
const fn length(error: i32) -> u32 {
    32 - (error ^ (error >> 31)).leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_in_one_word_are_charged_as_each_by_itself() {
        let mut costs = Costs::NEW;
        let mut plain = [0, 0, 0, u32::from(UNKNOWN)];
        let mut state = 1_u32;
        for round in 0..10_000 {
            let errors = core::array::from_fn(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if round % 100 < 50 { i32::MIN } else { state as i32 >> (state % 32) }
            });
            if round % 7 == 0 {
                costs.charge_all(errors[0]);
                plain = plain.map(|cost| cost - cost / 8 + length(errors[0]));
            } else {
                costs.charge(errors);
                for (cost, error) in plain.iter_mut().zip(errors) {
                    *cost = *cost - *cost / 8 + length(error);
                }
            }
            assert_eq!(core::array::from_fn(|place| costs.of(place)), plain);
            let least = plain.into_iter().min().expect("four");
            let (best, cost) = costs.cheapest::<4>();
            assert_eq!((plain[best], cost), (least, least));
            assert!(plain[..best].iter().all(|&cost| cost > least));
        }
    }
}
