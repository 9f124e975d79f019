//! A decoded instruction: a variant an operation, with registers and constants.
//!
//! After the `ARMv7-M` Architecture Reference Manual (DDI 0403E, chapter A7). Effects of the place (IT block, address) are
//! settled: an [`Op`] belongs to one address. A register is its number, 0 to 15; reading 15 gives the address of the
//! instruction and 4.
#![allow(missing_docs, reason = "names of operations and operands are those of the architecture's manual")]

mod operands;

pub use operands::{Alu, Extend, Float2, Float3, Index, Lanes, Long, Multiply, Prefix, Shift, Unary, Width};

/// A decoded instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Op {
    /// Not an instruction: `UsageFault` UNDEFINSTR.
    Undefined,
    /// Of a coprocessor that is not there: `UsageFault` NOCP.
    NoCoprocessor,

    MovImmediate {
        d: u8,
        value: u32,
    },
    AddImmediate {
        d: u8,
        n: u8,
        value: u32,
    },
    CmpImmediate {
        n: u8,
        value: u32,
    },
    MovRegister {
        d: u8,
        m: u8,
    },
    AddRegister {
        d: u8,
        n: u8,
        m: u8,
    },
    CmpRegister {
        n: u8,
        m: u8,
    },
    /// `carry`: a logical operation's new flag; `None` leaves it.
    Immediate {
        alu: Alu,
        flags: bool,
        d: u8,
        n: u8,
        carry: Option<bool>,
        value: u32,
    },
    Register {
        alu: Alu,
        flags: bool,
        d: u8,
        n: u8,
        m: u8,
        shift: Shift,
        amount: u8,
    },
    /// A shift by a register's low byte.
    ShiftBy {
        shift: Shift,
        flags: bool,
        d: u8,
        n: u8,
        m: u8,
    },
    MovTop {
        d: u8,
        value: u16,
    },
    MovPc {
        m: u8,
    },
    AddPc {
        m: u8,
    },

    BitInsert {
        d: u8,
        n: u8,
        lsb: u8,
        mask: u32,
    },
    BitClear {
        d: u8,
        mask: u32,
    },
    BitExtract {
        signed: bool,
        d: u8,
        n: u8,
        lsb: u8,
        width: u8,
    },
    Saturate {
        signed: bool,
        d: u8,
        n: u8,
        to: u8,
        shift: Shift,
        amount: u8,
    },
    Saturate16 {
        signed: bool,
        d: u8,
        n: u8,
        to: u8,
    },
    /// `n` 15: nothing is added.
    Extend {
        kind: Extend,
        d: u8,
        n: u8,
        m: u8,
        rotate: u8,
    },
    Unary {
        kind: Unary,
        d: u8,
        m: u8,
    },
    Select {
        d: u8,
        n: u8,
        m: u8,
    },
    Parallel {
        prefix: Prefix,
        lanes: Lanes,
        d: u8,
        n: u8,
        m: u8,
    },
    /// QADD and its family: `m` and, doubled or not, `n`.
    Saturating {
        double: bool,
        subtract: bool,
        d: u8,
        n: u8,
        m: u8,
    },
    /// PKHBT, PKHTB.
    Pack {
        top: bool,
        d: u8,
        n: u8,
        m: u8,
        amount: u8,
    },

    Mul {
        flags: bool,
        d: u8,
        n: u8,
        m: u8,
    },
    Multiply {
        kind: Multiply,
        d: u8,
        n: u8,
        m: u8,
        a: u8,
    },
    Long {
        kind: Long,
        low: u8,
        high: u8,
        n: u8,
        m: u8,
    },
    Divide {
        signed: bool,
        d: u8,
        n: u8,
        m: u8,
    },

    /// `[n, offset]`, the plain one.
    Load {
        width: Width,
        t: u8,
        n: u8,
        offset: i32,
    },
    Store {
        width: Width,
        t: u8,
        n: u8,
        offset: i32,
    },
    LoadIndexed {
        width: Width,
        t: u8,
        n: u8,
        offset: i16,
        index: Index,
    },
    StoreIndexed {
        width: Width,
        t: u8,
        n: u8,
        offset: i16,
        index: Index,
    },
    LoadRegister {
        width: Width,
        t: u8,
        n: u8,
        m: u8,
        shift: u8,
    },
    StoreRegister {
        width: Width,
        t: u8,
        n: u8,
        m: u8,
        shift: u8,
    },
    LoadLiteral {
        width: Width,
        t: u8,
        address: u32,
    },
    LoadUnprivileged {
        width: Width,
        t: u8,
        n: u8,
        offset: u8,
    },
    StoreUnprivileged {
        width: Width,
        t: u8,
        n: u8,
        offset: u8,
    },
    /// `n` 15: from the literal pool.
    LoadDouble {
        t: u8,
        t2: u8,
        n: u8,
        offset: i16,
        index: Index,
    },
    StoreDouble {
        t: u8,
        t2: u8,
        n: u8,
        offset: i16,
        index: Index,
    },
    LoadMultiple {
        n: u8,
        list: u16,
        before: bool,
        writeback: bool,
    },
    StoreMultiple {
        n: u8,
        list: u16,
        before: bool,
        writeback: bool,
    },
    LoadExclusive {
        width: Width,
        t: u8,
        n: u8,
        offset: u16,
    },
    StoreExclusive {
        width: Width,
        d: u8,
        t: u8,
        n: u8,
        offset: u16,
    },
    ClearExclusive,
    TableBranch {
        n: u8,
        m: u8,
        half: bool,
    },

    Branch {
        target: u32,
    },
    BranchIf {
        condition: u8,
        target: u32,
    },
    BranchZero {
        n: u8,
        non_zero: bool,
        target: u32,
    },
    Call {
        target: u32,
    },
    BranchExchange {
        m: u8,
    },
    CallExchange {
        m: u8,
    },

    IfThen {
        state: u8,
    },
    Nop,
    Wfe,
    Wfi,
    Sev,
    /// DSB, DMB; ISB.
    Barrier {
        flush: bool,
    },
    Cps {
        disable: bool,
        primask: bool,
        faultmask: bool,
    },
    MoveFromSpecial {
        d: u8,
        special: u8,
    },
    MoveToSpecial {
        n: u8,
        special: u8,
        mask: u8,
    },
    Svc {
        number: u8,
    },
    Breakpoint {
        number: u8,
    },

    Float3 {
        kind: Float3,
        d: u8,
        n: u8,
        m: u8,
    },
    Float2 {
        kind: Float2,
        d: u8,
        m: u8,
    },
    /// `m` none: with zero.
    FloatCompare {
        d: u8,
        m: Option<u8>,
        quiet_too: bool,
    },
    FloatImmediate {
        d: u8,
        value: u32,
    },
    FloatLoad {
        d: u8,
        n: u8,
        offset: i16,
        double: bool,
    },
    FloatStore {
        d: u8,
        n: u8,
        offset: i16,
        double: bool,
    },
    FloatLoadMultiple {
        d: u8,
        count: u8,
        n: u8,
        before: bool,
        writeback: bool,
    },
    FloatStoreMultiple {
        d: u8,
        count: u8,
        n: u8,
        before: bool,
        writeback: bool,
    },
    FloatFromCore {
        d: u8,
        t: u8,
    },
    FloatToCore {
        t: u8,
        d: u8,
    },
    FloatFromCore2 {
        d: u8,
        t: u8,
        t2: u8,
    },
    FloatToCore2 {
        t: u8,
        t2: u8,
        d: u8,
    },
    /// VMRS; `t` 15: the flags to APSR.
    FloatStatusToCore {
        t: u8,
    },
    FloatStatusFromCore {
        t: u8,
    },
}
