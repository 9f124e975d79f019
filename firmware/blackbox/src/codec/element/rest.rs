//! Rest of a difference beyond its class: the sign and the lower bits.

use crate::coder::Coder;

/// The class of longer values.
pub(super) const ESCAPE: usize = 15;

/// Integers: 0 for none, 1 for +-1, then the length in bits; 15 for 15 bits and more.
#[inline]
pub(crate) fn integer_class(magnitude: u32) -> usize {
    ((32 - magnitude.leading_zeros()) as usize).min(ESCAPE)
}

#[inline]
pub(crate) fn integer_rest<C: Coder>(coder: &mut C, class: usize, difference: i32) -> i32 {
    match class {
        0 => 0,
        // Only the sign, and then at most 15 bits: nearly all of them.
        1..ESCAPE => {
            let bits = class as u32 - 1;
            let top = 1_u32 << bits;
            let negative = u32::from(difference < 0);
            let rest = coder.bits16(difference.unsigned_abs() & (top - 1) | negative << bits, class as u32);
            let magnitude = (top | rest & (top - 1)) as i32;
            if rest & top != 0 { -magnitude } else { magnitude }
        }
        _ => {
            let longer = (32 - difference.unsigned_abs().leading_zeros()).saturating_sub(ESCAPE as u32);
            let length = (ESCAPE as u32 + coder.bits16(longer, 5)).min(32);
            signed_rest(coder, difference, length - 1)
        }
    }
}

/// Below a leading one.
#[inline(never)]
fn signed_rest<C: Coder>(coder: &mut C, difference: i32, bits: u32) -> i32 {
    let magnitude = difference.unsigned_abs();
    let top = 1_u32 << bits;
    let (negative, low) = if bits < 31 {
        let rest = coder.bits((magnitude & (top - 1)) | u32::from(difference < 0) << bits, bits + 1);
        (rest >> bits & 1 != 0, rest & (top - 1))
    } else {
        let low = coder.bits(magnitude & (top - 1), bits);
        (coder.bits16(u32::from(difference < 0), 1) != 0, low)
    };
    let magnitude = top | low;
    (if negative { magnitude.wrapping_neg() } else { magnitude }) as i32
}

/// Floats: 0 for none, 1 for up to 4 bits, 2 for up to 8, 3 for up to 10, 4 for up to 12, then 13 to 22 bits each
/// their own; 15 for more.
#[inline]
pub(super) fn float_class(magnitude: u32) -> usize {
    /// By length in bits.
    static CLASSES: [u8; 33] = [
        0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 4, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15, 15, 15, 15, 15, 15,
        15, 15, 15,
    ];
    usize::from(CLASSES[(32 - magnitude.leading_zeros()) as usize])
}

#[inline]
pub(super) fn float_rest<C: Coder>(coder: &mut C, class: usize, difference: i32) -> i32 {
    let magnitude = difference.unsigned_abs();
    match class {
        0 => 0,
        1..=4 => {
            let bits = [4, 8, 10, 12][class - 1];
            let rest = coder.bits16(magnitude | u32::from(difference < 0) << bits, bits + 1);
            let magnitude = (rest & ((1 << bits) - 1)) as i32;
            if rest >> bits & 1 != 0 { -magnitude } else { magnitude }
        }
        ESCAPE => {
            let length = 32 - magnitude.leading_zeros();
            let length = (23 + coder.bits16(length.saturating_sub(23), 4)).min(32);
            signed_rest(coder, difference, length - 1)
        }
        _ => signed_rest(coder, difference, class as u32 + 7),
    }
}
