//! Encodings that no run can show: far branches and undefined instructions.
use cortex_m4_model::decode;
use cortex_m4_model::op::Op;

const PLACE: u32 = 0x0800_0000;

#[test]
fn far_branches_reach_their_targets() {
    for (halfwords, distance) in [
        ([0xF07F, 0xAFFF], 0xF_FFFE),
        ([0xF440, 0x8000], -0x10_0000),
        ([0xF300, 0xA000], 0x4_0000),
        ([0xF300, 0x8800], 0x8_0000),
        ([0xF260, 0x8001], 0x2_0002),
        ([0xF3FF, 0x97FF], 0xFF_FFFE),
        ([0xF400, 0x9000], -0x100_0000),
        ([0xF000, 0xB000], 0x40_0000),
        ([0xF000, 0x9800], 0x80_0000),
        ([0xF3FF, 0xD7FF], 0xFF_FFFE),
        ([0xF400, 0xD000], -0x100_0000),
        ([0xF000, 0xF002], 0x40_0004),
        ([0xF7FF, 0xF7FE], -0x40_0004),
        ([0xBBFB, 0], 126),
        ([0xB303, 0], 64),
    ] {
        let expected = (PLACE + 4).wrapping_add_signed(distance);
        match decode(PLACE, false, halfwords).0 {
            Op::Branch { target }
            | Op::BranchIf { target, .. }
            | Op::Call { target }
            | Op::BranchZero { target, .. } => assert_eq!(target, expected, "{halfwords:x?}"),
            op => unreachable!("{halfwords:x?} is {op:?}"),
        }
    }
}

#[test]
fn what_no_compiler_makes_is_undefined() {
    for (what, halfwords) in [
        ("permanently", [0xDE00, 0]),
        ("permanently, 32 bits", [0xF7F0, 0xA000]),
        ("an empty list", [0xB400, 0]),
        ("one register in a list of 32 bits", [0xE8BD, 0x0001]),
        ("the stack pointer in a list", [0xE890, 0x2001]),
        ("a base that is loaded and written back", [0xE8B1, 0x0006]),
        ("a store of the program counter", [0xF8C1, 0xF000]),
        ("a sum in the program counter", [0xF101, 0x0F01]),
        ("a field beyond the register", [0xF3C1, 0x70DF]),
        ("a double-precision sum", [0xEE30, 0x0B01]),
        ("a NEON instruction", [0xEF00, 0x0000]),
        ("IT of never", [0xBFF8, 0]),
        ("a special register that there is not", [0xF3EF, 0x800A]),
    ] {
        assert_eq!(decode(PLACE, false, halfwords).0, Op::Undefined, "{what}");
    }
    for (what, halfwords) in
        [("IT in IT", [0xBF08, 0]), ("a branch if in IT", [0xD001, 0]), ("CBZ in IT", [0xB101, 0])]
    {
        assert_eq!(decode(PLACE, true, halfwords).0, Op::Undefined, "{what}");
    }
}
