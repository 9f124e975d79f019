//! Values of an operation's fields.
#![allow(missing_docs, reason = "names of operations and operands are those of the architecture's manual")]

/// Data processing with two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alu {
    And,
    Bic,
    Orr,
    Orn,
    Eor,
    Add,
    Adc,
    Sub,
    Sbc,
    Rsb,
    Mov,
    Mvn,
    Tst,
    Teq,
    Cmn,
    Cmp,
}

/// A shift of an operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shift {
    Lsl,
    Lsr,
    Asr,
    Ror,
    Rrx,
}

/// A load's or store's unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    Byte,
    Half,
    Word,
    SByte,
    SHalf,
}

/// When an immediate offset changes the base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Index {
    /// Base and offset; the base stays.
    Offset,
    /// Base and offset; the base becomes the address.
    Pre,
    /// The base; it gets the offset afterwards.
    Post,
}

/// The extensions of a byte or halfword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extend {
    Sxtb,
    Sxth,
    Sxtb16,
    Uxtb,
    Uxth,
    Uxtb16,
}

/// The lanes of a parallel addition or subtraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    Add8,
    Add16,
    Asx,
    Sax,
    Sub8,
    Sub16,
}

/// Overflow of parallel additions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prefix {
    S,
    Q,
    Sh,
    U,
    Uq,
    Uh,
}

/// The bit and byte operations of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    Clz,
    Rbit,
    Rev,
    Rev16,
    Revsh,
}

/// Multiplications of three or four operands, long ones apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multiply {
    Mla,
    Mls,
    /// Halves: top of the first, top of the second.
    Smlaxy {
        n_top: bool,
        m_top: bool,
    },
    Smlaw {
        m_top: bool,
    },
    Smlad {
        exchange: bool,
    },
    Smlsd {
        exchange: bool,
    },
    Smmla {
        round: bool,
    },
    Smmls {
        round: bool,
    },
    Usada8,
}

/// A result of 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Long {
    Smull,
    Umull,
    Smlal,
    Umlal,
    Umaal,
    Smlalxy { n_top: bool, m_top: bool },
    Smlald { exchange: bool },
    Smlsld { exchange: bool },
}

/// The floating-point operations of three registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Float3 {
    Vmla,
    Vmls,
    Vnmla,
    Vnmls,
    Vmul,
    Vnmul,
    Vadd,
    Vsub,
    Vdiv,
    Vfma,
    Vfms,
    Vfnma,
    Vfnms,
}

/// The floating-point operations of two registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Float2 {
    /// VMOV
    Move,
    /// VABS
    Abs,
    /// VNEG
    Neg,
    /// VSQRT
    Sqrt,
    /// VCVTB, VCVTT to single precision
    FromHalf {
        /// Of the upper half.
        top: bool,
    },
    /// VCVTB, VCVTT to half precision
    ToHalf {
        /// Into the upper half.
        top: bool,
    },
    /// VCVT from an integer
    FromInt {
        /// Of a signed one.
        signed: bool,
    },
    /// VCVT, VCVTR to an integer
    ToInt {
        /// To a signed one.
        signed: bool,
        /// Toward zero, or as FPSCR says.
        to_zero: bool,
    },
    /// VCVT from fixed point, in place
    FromFixed {
        /// Of a signed one.
        signed: bool,
        /// Of 16 bits, or of 32.
        half: bool,
        /// Bits behind the point.
        fraction: u8,
    },
    /// VCVT to fixed point, in place
    ToFixed {
        /// To a signed one.
        signed: bool,
        /// To 16 bits, or to 32.
        half: bool,
        /// Bits behind the point.
        fraction: u8,
    },
}
