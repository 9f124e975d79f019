//! Saturation, and parallel arithmetic.

use super::alu::shift;
use crate::op::{Lanes, Op, Prefix};
use crate::processor::Core;

fn saturate(value: i64, signed: bool, bits: u8) -> (i64, bool) {
    let (low, high) =
        if signed { (-(1i64 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1i64 << bits) - 1) };
    let result = value.clamp(low, high);
    (result, result != value)
}

impl Core {
    pub(super) fn execute_simd(&mut self, op: Op) {
        match op {
            Op::Saturate { signed, d, n, to, shift: kind, amount } => {
                let (value, _) = shift(self.get(n), kind, amount, false);
                let (result, changed) = saturate(i64::from(value as i32), signed, to);
                self.set(d, result as u32);
                self.flags.q |= changed;
            }
            Op::Saturate16 { signed, d, n, to } => {
                let value = self.get(n);
                let (low, low_changed) = saturate(i64::from(value as i16), signed, to);
                let (high, high_changed) = saturate(i64::from((value >> 16) as i16), signed, to);
                self.set(d, (high as u32) << 16 | low as u32 & 0xFFFF);
                self.flags.q |= low_changed || high_changed;
            }
            Op::Saturating { double, subtract, d, n, m } => {
                let (n, m) = (i64::from(self.get(n) as i32), i64::from(self.get(m) as i32));
                let (n, doubled) = if double { saturate(2 * n, true, 32) } else { (n, false) };
                let (result, changed) = saturate(if subtract { m - n } else { m + n }, true, 32);
                self.set(d, result as u32);
                self.flags.q |= doubled || changed;
            }
            Op::Select { d, n, m } => {
                let mask =
                    (0..4).filter(|lane| self.flags.ge >> lane & 1 == 1).map(|lane| 0xFF << (8 * lane));
                let mask: u32 = mask.sum();
                self.set(d, self.get(n) & mask | self.get(m) & !mask);
            }
            Op::Pack { top, d, n, m, amount } => {
                let (n, m) = (self.get(n), self.get(m));
                let result = if top {
                    n & 0xFFFF_0000 | (i64::from(m as i32) >> amount) as u32 & 0xFFFF
                } else {
                    n & 0xFFFF | m << amount & 0xFFFF_0000
                };
                self.set(d, result);
            }
            Op::Parallel { prefix, lanes, d, n, m } => {
                let (result, ge) = parallel(prefix, lanes, self.get(n), self.get(m));
                self.set(d, result);
                if let Some(ge) = ge {
                    self.flags.ge = ge;
                }
            }
            _ => {}
        }
    }
}

fn parallel(prefix: Prefix, lanes: Lanes, n: u32, m: u32) -> (u32, Option<u8>) {
    let signed = matches!(prefix, Prefix::S | Prefix::Q | Prefix::Sh);
    let bytes = matches!(lanes, Lanes::Add8 | Lanes::Sub8);
    let (width, count) = if bytes { (8, 4) } else { (16, 2) };
    let crossed = matches!(lanes, Lanes::Asx | Lanes::Sax);
    let m = if crossed { m.rotate_right(16) } else { m };
    let part = |value: u32, lane: u32| {
        let raw = value >> (lane * width) & ((1 << width) - 1);
        let extended = (raw << (32 - width)) as i32 >> (32 - width);
        if signed { i64::from(extended) } else { i64::from(raw) }
    };
    let (mut result, mut ge) = (0, 0);
    for lane in 0..count {
        let adds = match lanes {
            Lanes::Add8 | Lanes::Add16 => true,
            Lanes::Sub8 | Lanes::Sub16 => false,
            Lanes::Asx => lane == 1,
            Lanes::Sax => lane == 0,
        };
        let (x, y) = (part(n, lane), part(m, lane));
        let exact = if adds { x + y } else { x - y };
        let value = match prefix {
            Prefix::Q | Prefix::Uq => saturate(exact, signed, width as u8).0,
            Prefix::Sh | Prefix::Uh => exact >> 1,
            Prefix::S | Prefix::U => exact,
        };
        result |= (value as u32 & ((1 << width) - 1)) << (lane * width);
        let good = if signed || !adds { exact >= 0 } else { exact >> width != 0 };
        if good {
            ge |= if bytes { 1 << lane } else { 3 << (2 * lane) };
        }
    }
    (result, matches!(prefix, Prefix::S | Prefix::U).then_some(ge))
}
