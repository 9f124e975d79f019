//! From halfwords to an [`Op`]: the encodings of Thumb as ARMv7E-M has them (DDI 0403E, chapter A5).
//!
//! UNPREDICTABLE encodings are UNDEFINED if the test is cheap: no compiler makes them, and going on would hide a jump into
//! data. Exceptions are in [`crate`]'s documentation.

mod dsp;
mod fields;
mod float;
mod memory;
mod narrow;
mod wide;

pub(crate) use fields::Place;

use crate::op::Op;

/// Decodes the instruction at an address; one of 16 bits is in the first halfword. Returns operation and length, bytes.
/// `in_it`: inside of an IT block.
pub fn decode(address: u32, in_it: bool, halfwords: [u16; 2]) -> (Op, u32) {
    let place = Place { address, in_it };
    let [first, second] = halfwords;
    if is_wide(first) { (wide(place, first, second), 4) } else { (narrow(place, first), 2) }
}

pub(crate) fn is_wide(first: u16) -> bool {
    first >= 0xE800
}

pub(crate) fn narrow(place: Place, halfword: u16) -> Op {
    narrow::decode(place, halfword)
}

pub(crate) fn wide(place: Place, first: u16, second: u16) -> Op {
    let (a, b) = (u32::from(first), u32::from(second));
    match (a >> 11 & 3, a >> 4 & 0x7F) {
        (1, op) if op & 0x64 == 0x00 => memory::multiple(a, b),
        (1, op) if op & 0x64 == 0x04 => memory::double_or_exclusive(a, b),
        (1, op) if op & 0x60 == 0x20 => wide::shifted_register(a, b),
        (2, _) if b & 0x8000 != 0 => wide::branch_or_control(place, a, b),
        (2, op) if op & 0x20 == 0 => wide::modified_immediate(a, b),
        (2, _) => wide::plain_immediate(place, a, b),
        (3, op) if op & 0x71 == 0x00 => memory::store(a, b),
        (3, op) if op & 0x67 == 0x01 => memory::load(place, a, b, crate::op::Width::Byte),
        (3, op) if op & 0x67 == 0x03 => memory::load(place, a, b, crate::op::Width::Half),
        (3, op) if op & 0x67 == 0x05 => memory::load(place, a, b, crate::op::Width::Word),
        (3, op) if op & 0x70 == 0x20 => dsp::register(a, b),
        (3, op) if op & 0x78 == 0x30 => dsp::multiply(a, b),
        (3, op) if op & 0x78 == 0x38 => dsp::long(a, b),
        (1 | 3, op) if op & 0x40 != 0 => float::coprocessor(a, b),
        _ => Op::Undefined,
    }
}
