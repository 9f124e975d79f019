//! Single precision, rounded as `FPSCR` says, with its flags; in integers, independent of the host.
//!
//! After the architecture's pseudocode (DDI 0403E, A2.5 and appendix D): `FPUnpack`, `FPProcessNaNs`, `FPRound` (tininess is
//! found before rounding), `FPMulAdd`, ... Functions take and return bits, and set bits of FPSCR in `status`.

/// Bits of FPSCR.
pub(crate) const IOC: u32 = 1;
pub(crate) const DZC: u32 = 1 << 1;
pub(crate) const OFC: u32 = 1 << 2;
pub(crate) const UFC: u32 = 1 << 3;
pub(crate) const IXC: u32 = 1 << 4;
pub(crate) const IDC: u32 = 1 << 7;
const FZ: u32 = 1 << 24;
const DN: u32 = 1 << 25;
const AHP: u32 = 1 << 26;

const SIGN: u32 = 1 << 31;
const INFINITY: u32 = 0x7F80_0000;
const DEFAULT_NAN: u32 = 0x7FC0_0000;
const QUIET: u32 = 1 << 22;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    Nearest,
    Up,
    Down,
    Zero,
}

impl Rounding {
    pub(crate) fn of(status: u32) -> Self {
        [Rounding::Nearest, Rounding::Up, Rounding::Down, Rounding::Zero][(status >> 22 & 3) as usize]
    }

    fn goes_up(self, negative: bool, odd: bool, cut: u64, half: u64) -> bool {
        match self {
            Rounding::Nearest => cut > half || cut == half && odd,
            Rounding::Up => cut != 0 && !negative,
            Rounding::Down => cut != 0 && negative,
            Rounding::Zero => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    Zero,
    /// `mantissa` x 2^`exponent`; bit 23 is the mantissa's highest.
    Finite {
        mantissa: u32,
        exponent: i32,
    },
    Infinite,
    Nan,
}

#[derive(Clone, Copy, Debug)]
struct Unpacked {
    negative: bool,
    number: Number,
    bits: u32,
}

fn unpack(bits: u32, status: &mut u32) -> Unpacked {
    let (exponent, fraction) = ((bits >> 23 & 0xFF) as i32, bits & 0x7F_FFFF);
    let number = match (exponent, fraction) {
        (0, 0) => Number::Zero,
        (0, _) if *status & FZ != 0 => {
            *status |= IDC;
            Number::Zero
        }
        (0, _) => {
            let shift = fraction.leading_zeros() - 8;
            Number::Finite { mantissa: fraction << shift, exponent: -149 - shift as i32 }
        }
        (255, 0) => Number::Infinite,
        (255, _) => Number::Nan,
        _ => Number::Finite { mantissa: fraction | 1 << 23, exponent: exponent - 150 },
    };
    Unpacked { negative: bits & SIGN != 0, number, bits }
}

fn sign(negative: bool) -> u32 {
    if negative { SIGN } else { 0 }
}

fn is_nan(bits: u32) -> bool {
    bits & !SIGN > INFINITY
}

fn is_signaling(bits: u32) -> bool {
    is_nan(bits) && bits & QUIET == 0
}

fn nan_of(operands: &[u32], status: &mut u32) -> Option<u32> {
    let signaling = operands.iter().copied().find(|&bits| is_signaling(bits));
    let nan = signaling.or_else(|| operands.iter().copied().find(|&bits| is_nan(bits)))?;
    if signaling.is_some() {
        *status |= IOC;
    }
    Some(if *status & DN != 0 { DEFAULT_NAN } else { nan | QUIET })
}

fn invalid(status: &mut u32) -> u32 {
    *status |= IOC;
    DEFAULT_NAN
}

/// Shift with a sticky lowest bit.
fn jam(value: u128, by: u32) -> u128 {
    match by {
        0 => value,
        1..=127 => value >> by | u128::from(value << (128 - by) != 0),
        _ => u128::from(value != 0),
    }
}

/// A format's sizes.
struct Format {
    exponent_bits: u32,
    fraction_bits: u32,
    minimum: i32,
}

const SINGLE: Format = Format { exponent_bits: 8, fraction_bits: 23, minimum: -126 };
const HALF: Format = Format { exponent_bits: 5, fraction_bits: 10, minimum: -14 };

/// `FPRound` of `mantissa` x 2^`exponent`, not zero; the lowest bit may stand for all below.
fn round(negative: bool, mantissa: u128, exponent: i32, rounding: Rounding, status: &mut u32) -> u32 {
    round_to(&SINGLE, negative, mantissa, exponent, rounding, status)
}

fn round_to(
    format: &Format,
    negative: bool,
    mantissa: u128,
    exponent: i32,
    rounding: Rounding,
    status: &mut u32,
) -> u32 {
    // The highest bit to place 63.
    let zeros = mantissa.leading_zeros() as i32;
    let (mantissa, exponent) = if zeros >= 64 {
        ((mantissa << (zeros - 64)) as u64, exponent - (zeros - 64))
    } else {
        (jam(mantissa, (64 - zeros) as u32) as u64, exponent + 64 - zeros)
    };
    let scale = exponent + 63;
    let half_format = format.fraction_bits == HALF.fraction_bits;
    let sign_bit = u32::from(negative) << (format.exponent_bits + format.fraction_bits);
    if *status & FZ != 0 && !half_format && scale < format.minimum {
        *status |= UFC;
        return sign_bit;
    }
    let mut biased = (scale - format.minimum + 1).max(0) as u32;
    let mantissa = if biased == 0 {
        jam(u128::from(mantissa), (format.minimum - scale) as u32) as u64
    } else {
        mantissa
    };
    let low = 63 - format.fraction_bits;
    let (mut kept, cut) = ((mantissa >> low) as u32, mantissa & ((1 << low) - 1));
    let inexact = cut != 0;
    if biased == 0 && inexact {
        *status |= UFC;
    }
    if rounding.goes_up(negative, kept & 1 == 1, cut, 1 << (low - 1)) {
        kept += 1;
        if kept == 1 << format.fraction_bits {
            biased = 1;
        }
        if kept == 2 << format.fraction_bits {
            biased += 1;
            kept >>= 1;
        }
    }
    let most = (1 << format.exponent_bits) - 1;
    if half_format && *status & AHP != 0 {
        if biased > most {
            *status |= IOC;
            return sign_bit | 0x7FFF;
        }
    } else if biased >= most {
        *status |= OFC | IXC;
        let to_infinity = match rounding {
            Rounding::Nearest => true,
            Rounding::Up => !negative,
            Rounding::Down => negative,
            Rounding::Zero => false,
        };
        return sign_bit | ((most << format.fraction_bits) - u32::from(!to_infinity));
    }
    if inexact {
        *status |= IXC;
    }
    sign_bit | biased << format.fraction_bits | kept & ((1 << format.fraction_bits) - 1)
}

/// Sum that is not zero; an exact zero is positive unless rounding is downward.
fn sum(a: (bool, u128, i32), b: (bool, u128, i32), status: &mut u32) -> u32 {
    let (mut a, mut b) = (a, b);
    if a.2 < b.2 {
        core::mem::swap(&mut a, &mut b);
    }
    let small = jam(b.1, (a.2 - b.2) as u32);
    let (negative, mantissa) = if a.0 == b.0 {
        (a.0, a.1 + small)
    } else if a.1 >= small {
        (a.0, a.1 - small)
    } else {
        (b.0, small - a.1)
    };
    let rounding = Rounding::of(*status);
    if mantissa == 0 {
        return sign(rounding == Rounding::Down);
    }
    round(negative, mantissa, a.2, rounding, status)
}

/// `FPAdd`.
pub(crate) fn add(a: u32, b: u32, status: &mut u32) -> u32 {
    let (x, y) = (unpack(a, status), unpack(b, status));
    if let Some(nan) = nan_of(&[a, b], status) {
        return nan;
    }
    match (x.number, y.number) {
        (Number::Infinite, Number::Infinite) if x.negative != y.negative => invalid(status),
        (Number::Infinite, _) => x.bits,
        (_, Number::Infinite) => y.bits,
        (Number::Zero, Number::Zero) if x.negative == y.negative => sign(x.negative),
        (Number::Zero, Number::Zero) => sign(Rounding::of(*status) == Rounding::Down),
        _ => sum(wide(x, 80), wide(y, 80), status),
    }
}

fn wide(value: Unpacked, room: u32) -> (bool, u128, i32) {
    match value.number {
        Number::Finite { mantissa, exponent } => {
            (value.negative, u128::from(mantissa) << room, exponent - room as i32)
        }
        _ => (value.negative, 0, -1000),
    }
}

/// `FPNeg`.
pub(crate) fn negate(a: u32) -> u32 {
    a ^ SIGN
}

/// `FPSub`.
pub(crate) fn subtract(a: u32, b: u32, status: &mut u32) -> u32 {
    // A NaN keeps its sign.
    if is_nan(b) { add(a, b, status) } else { add(a, negate(b), status) }
}

/// `FPMul`.
pub(crate) fn multiply(a: u32, b: u32, status: &mut u32) -> u32 {
    let (x, y) = (unpack(a, status), unpack(b, status));
    if let Some(nan) = nan_of(&[a, b], status) {
        return nan;
    }
    let negative = x.negative != y.negative;
    match (x.number, y.number) {
        (Number::Infinite, Number::Zero) | (Number::Zero, Number::Infinite) => invalid(status),
        (Number::Infinite, _) | (_, Number::Infinite) => sign(negative) | INFINITY,
        (Number::Finite { mantissa: m, exponent: e }, Number::Finite { mantissa: n, exponent: f }) => {
            round(negative, u128::from(m) * u128::from(n), e + f, Rounding::of(*status), status)
        }
        _ => sign(negative),
    }
}

/// `FPDiv`.
pub(crate) fn divide(a: u32, b: u32, status: &mut u32) -> u32 {
    let (x, y) = (unpack(a, status), unpack(b, status));
    if let Some(nan) = nan_of(&[a, b], status) {
        return nan;
    }
    let negative = x.negative != y.negative;
    match (x.number, y.number) {
        (Number::Infinite, Number::Infinite) | (Number::Zero, Number::Zero) => invalid(status),
        (Number::Infinite, _) => sign(negative) | INFINITY,
        (_, Number::Zero) => {
            *status |= DZC;
            sign(negative) | INFINITY
        }
        (Number::Finite { mantissa: m, exponent: e }, Number::Finite { mantissa: n, exponent: f }) => {
            let (m, n) = (u64::from(m) << 39, u64::from(n));
            let quotient = (m / n) << 1 | u64::from(m % n != 0);
            round(negative, u128::from(quotient), e - f - 40, Rounding::of(*status), status)
        }
        _ => sign(negative),
    }
}

/// `FPSqrt`.
pub(crate) fn square_root(a: u32, status: &mut u32) -> u32 {
    let x = unpack(a, status);
    if let Some(nan) = nan_of(&[a], status) {
        return nan;
    }
    match x.number {
        Number::Zero => sign(x.negative),
        _ if x.negative => invalid(status),
        Number::Finite { mantissa, exponent } => {
            let odd = exponent & 1;
            let square = u64::from(mantissa) << (38 + odd);
            let root = square.isqrt();
            let mantissa = root << 1 | u64::from(root * root != square);
            round(false, u128::from(mantissa), (exponent - odd - 38) / 2 - 1, Rounding::of(*status), status)
        }
        _ => INFINITY,
    }
}

/// `FPMulAdd`: `a` + `n` x `m`, rounded once.
pub(crate) fn multiply_add(a: u32, n: u32, m: u32, status: &mut u32) -> u32 {
    let (z, x, y) = (unpack(a, status), unpack(n, status), unpack(m, status));
    let zero_times_infinity =
        matches!((x.number, y.number), (Number::Infinite, Number::Zero) | (Number::Zero, Number::Infinite));
    if zero_times_infinity && is_nan(a) && !is_signaling(a) {
        return invalid(status);
    }
    if let Some(nan) = nan_of(&[a, n, m], status) {
        return nan;
    }
    let negative = x.negative != y.negative;
    let infinite = x.number == Number::Infinite || y.number == Number::Infinite;
    let zero = x.number == Number::Zero || y.number == Number::Zero;
    if zero_times_infinity || z.number == Number::Infinite && infinite && z.negative != negative {
        return invalid(status);
    }
    match z.number {
        Number::Infinite => return z.bits,
        _ if infinite => return sign(negative) | INFINITY,
        Number::Zero if zero && z.negative == negative => return sign(negative),
        Number::Zero if zero => return sign(Rounding::of(*status) == Rounding::Down),
        _ => {}
    }
    let product = match (x.number, y.number) {
        (Number::Finite { mantissa: m, exponent: e }, Number::Finite { mantissa: n, exponent: f }) => {
            (negative, (u128::from(m) * u128::from(n)) << 62, e + f - 62)
        }
        _ => (negative, 0, -1000),
    };
    sum(wide(z, 86), product, status)
}

/// `FPCompare`: the flags NZCV. `quiet_too`: a quiet NaN is invalid as well.
pub(crate) fn compare(a: u32, b: u32, quiet_too: bool, status: &mut u32) -> u32 {
    let (x, y) = (unpack(a, status), unpack(b, status));
    if is_nan(a) || is_nan(b) {
        if quiet_too || is_signaling(a) || is_signaling(b) {
            *status |= IOC;
        }
        return 0b0011;
    }
    let order = |value: Unpacked| {
        let magnitude = if value.number == Number::Zero { 0 } else { i64::from(value.bits & !SIGN) };
        if value.negative { -magnitude } else { magnitude }
    };
    match order(x).cmp(&order(y)) {
        core::cmp::Ordering::Equal => 0b0110,
        core::cmp::Ordering::Less => 0b1000,
        core::cmp::Ordering::Greater => 0b0010,
    }
}

/// `FPToFixed`: of `bits` bits, `fraction` of them behind the point.
pub(crate) fn to_fixed(
    a: u32,
    bits: u32,
    fraction: u32,
    signed: bool,
    rounding: Rounding,
    status: &mut u32,
) -> u32 {
    let x = unpack(a, status);
    let (low, high) =
        if signed { (-(1i128 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1i128 << bits) - 1) };
    let limit = if x.negative { low } else { high };
    let Number::Finite { mantissa, exponent } = x.number else {
        if x.number == Number::Zero {
            return 0;
        }
        *status |= IOC;
        return if is_nan(a) { 0 } else { limit as u32 };
    };
    let shift = exponent + fraction as i32;
    if shift > 64 {
        *status |= IOC;
        return limit as u32;
    }
    // 64 bits behind the point.
    let scaled = if shift >= -40 { u128::from(mantissa) << (shift + 40) } else { 1 };
    let (whole, cut) = ((scaled >> 40) as i128, (scaled & ((1 << 40) - 1)) as u64);
    let whole = whole + i128::from(rounding.goes_up(x.negative, whole & 1 == 1, cut, 1 << 39));
    let value = if x.negative { -whole } else { whole };
    if value < low || value > high {
        *status |= IOC;
        return limit as u32;
    }
    if cut != 0 {
        *status |= IXC;
    }
    value as u32
}

/// `FixedToFP`, of 32 bits that are extended already.
pub(crate) fn from_fixed(
    value: u32,
    fraction: u32,
    signed: bool,
    rounding: Rounding,
    status: &mut u32,
) -> u32 {
    let negative = signed && value >> 31 == 1;
    let magnitude = if negative { value.wrapping_neg() } else { value };
    if magnitude == 0 {
        return 0;
    }
    round(negative, u128::from(magnitude), -(fraction as i32), rounding, status)
}

/// `FPHalfToSingle`.
pub(crate) fn from_half(half: u32, status: &mut u32) -> u32 {
    let sign = (half & 0x8000) << 16;
    let (exponent, fraction) = (half >> 10 & 0x1F, half & 0x3FF);
    match (exponent, fraction) {
        (0, 0) => sign,
        (0, _) => {
            let shift = fraction.leading_zeros() - 21;
            sign | (113 - shift) << 23 | (fraction << (13 + shift) & 0x7F_FFFF)
        }
        (31, 0) if *status & AHP == 0 => sign | INFINITY,
        (31, _) if *status & AHP == 0 => {
            if fraction & 0x200 == 0 {
                *status |= IOC;
            }
            if *status & DN != 0 { DEFAULT_NAN } else { sign | INFINITY | QUIET | fraction << 13 }
        }
        _ => sign | (exponent + 112) << 23 | fraction << 13,
    }
}

/// `FPSingleToHalf`.
pub(crate) fn to_half(a: u32, status: &mut u32) -> u32 {
    let x = unpack(a, status);
    let sign = a >> 16 & 0x8000;
    let alternative = *status & AHP != 0;
    match x.number {
        Number::Nan if alternative => {
            *status |= IOC;
            sign
        }
        Number::Nan => {
            if is_signaling(a) {
                *status |= IOC;
            }
            if *status & DN != 0 { 0x7E00 } else { sign | 0x7E00 | a >> 13 & 0x1FF }
        }
        Number::Infinite if alternative => {
            *status |= IOC;
            sign | 0x7FFF
        }
        Number::Infinite => sign | 0x7C00,
        Number::Zero => sign,
        Number::Finite { mantissa, exponent } => {
            round_to(&HALF, x.negative, u128::from(mantissa), exponent, Rounding::of(*status), status)
        }
    }
}
