//! Half-precision numbers (IEEE 754 binary16): 11 bits of precision, up to 65,504, in two bytes. Enough for what is
//! looked at, not for what is added up.

/// To the nearest half-precision number; beyond the range infinite, and no number stays none.
pub fn to_bits(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let magnitude = f32::from_bits(bits & 0x7FFF_FFFF);
    if magnitude.is_nan() {
        return sign | 0x7E00;
    }
    if magnitude >= 65_520.0 {
        return sign | 0x7C00;
    }
    if magnitude < 6.103_515_6e-5 {
        // Subnormal: multiples of 2^-24. The largest that rounds up is the smallest normal one, as it should be.
        return sign | libm::roundevenf(magnitude * 16_777_216.0) as u16;
    }
    let magnitude = bits & 0x7FFF_FFFF;
    // Round to even at bit 13, then move the exponent's bias from 127 to 15.
    let rounded = magnitude + 0xFFF + ((magnitude >> 13) & 1);
    sign | ((rounded >> 13) - (112 << 10)) as u16
}

/// The number that the bits stand for.
pub fn from_bits(half: u16) -> f32 {
    let sign = u32::from(half & 0x8000) << 16;
    let (exponent, fraction) = (u32::from(half >> 10) & 0x1F, u32::from(half) & 0x3FF);
    let magnitude = match exponent {
        0 => (fraction as f32 / 16_777_216.0).to_bits(),
        31 => 0x7F80_0000 | (fraction << 13),
        _ => ((exponent + 112) << 23) | (fraction << 13),
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_precision_number_comes_back() {
        for half in 0..=u16::MAX {
            let value = from_bits(half);
            if value.is_nan() {
                assert!(from_bits(to_bits(value)).is_nan());
            } else {
                assert_eq!(to_bits(value), half, "{value}");
            }
        }
    }

    #[test]
    fn what_lies_between_goes_to_the_nearest() {
        for value in [15.63_f32, 3.612, 0.1, -45.2, 5_021.0, 1e-6, 60_000.0, -2.5e-7] {
            let error = (from_bits(to_bits(value)) - value).abs();
            assert!(error <= (value.abs() / 2_048.0).max(3e-8), "{value}: {error}");
        }
        assert!(from_bits(to_bits(1e9)).is_infinite() && from_bits(to_bits(-1e9)).is_infinite());
    }
}
