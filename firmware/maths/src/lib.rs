//! Functions of single precision: those of `libm`, but sine, cosine and square root.
//!
//! `libm` computes sine and cosine of any number with double precision, and the root bit by bit. That is 4 KiB of
//! slow code on a processor whose FPU has single precision and an instruction for the root.
//!
//! A PC gets the same bits as the firmware: it runs the same sine and cosine, and a root is exact on both.
#![cfg_attr(not(test), no_std)]

pub use libm::{acosf, asinf, atan2f, copysignf, expf, fabsf, fminf, logf, round, roundevenf, roundf};

/// Angles up to here are turned back exactly enough; an attitude has less than one turn.
const ANGLE_MAX: f32 = 8192.0;

/// Sine of an angle in radians, to 2e-7. Beyond 8192 rad and for NaN: 0.
pub fn sinf(angle: f32) -> f32 {
    let (quarter, rest) = reduce(angle);
    turned(quarter, rest)
}

/// Cosine of an angle in radians, to 2e-7. Beyond 8192 rad and for NaN: 1.
pub fn cosf(angle: f32) -> f32 {
    let (quarter, rest) = reduce(angle);
    turned(quarter + 1, rest)
}

/// Sine of these quarter turns and `rest`, which is within an eighth of a turn. Polynomials of S. Moshier's Cephes
/// library.
fn turned(quarter: i32, rest: f32) -> f32 {
    let square = rest * rest;
    let value = if quarter & 1 == 0 {
        ((-1.951_529_6e-4 * square + 8.332_161e-3) * square - 0.166_666_55) * square * rest + rest
    } else {
        ((2.443_315_7e-5 * square - 1.388_731_6e-3) * square + 4.166_664_6e-2) * square * square
            - 0.5 * square
            + 1.0
    };
    if quarter & 2 == 0 { value } else { -value }
}

/// Quarter turns, and the rest of an angle. A quarter turn has three parts (Cody and Waite), whose products are exact.
fn reduce(angle: f32) -> (i32, f32) {
    const PARTS: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
    let angle = if fabsf(angle) <= ANGLE_MAX { angle } else { 0.0 };
    let quarter = (angle * core::f32::consts::FRAC_2_PI + copysignf(0.5, angle)) as i32;
    (quarter, PARTS.iter().fold(angle, |rest, part| rest - quarter as f32 * part))
}

/// Square root; NaN below 0.
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub fn sqrtf(value: f32) -> f32 {
    libm::sqrtf(value)
}

/// Square root; NaN below 0.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
pub fn sqrtf(value: f32) -> f32 {
    unsafe extern "C" {
        safe fn hums_sqrtf(value: f32) -> f32;
    }
    hums_sqrtf(value)
}

// The instruction as a number: the assembler is not told of the FPU. `vsqrt.f32 s0, s0`: argument and result are in s0.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
core::arch::global_asm!(
    ".section .text.hums_sqrtf,\"ax\",%progbits",
    ".global hums_sqrtf",
    ".type hums_sqrtf,%function",
    ".thumb_func",
    "hums_sqrtf:",
    ".inst.w 0xeeb10ac0",
    "bx lr",
    ".size hums_sqrtf, . - hums_sqrtf",
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_right_for_every_angle_that_is_bounded() {
        let mut worst = 0.0_f64;
        for step in -200_000..=200_000_i32 {
            for scale in [1e-4_f32, 0.04] {
                let angle = step as f32 * scale;
                let exact = f64::from(angle);
                worst = worst.max((f64::from(sinf(angle)) - exact.sin()).abs());
                worst = worst.max((f64::from(cosf(angle)) - exact.cos()).abs());
            }
        }
        assert!(worst < 2e-7, "{worst:e}");
    }

    #[test]
    fn any_number_has_a_sine_and_a_cosine() {
        for angle in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e9, 8193.0] {
            assert_eq!(
                (sinf(angle).to_bits(), cosf(angle).to_bits()),
                (0.0_f32.to_bits(), 1.0_f32.to_bits())
            );
        }
    }
}
