//! Who recorded, and how the boot before ended.

use super::stored::{Fields, Sink};

/// The monitor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Boot<'a> {
    /// The product's version, for instance `0.1.0`.
    pub version: &'a str,
    /// The commit it was built from.
    pub git: &'a str,
    /// The board's name.
    pub board: &'a str,
    /// The reset cause register, or 0.
    pub reset: u32,
    /// The name of the cause.
    pub reset_name: &'a str,
    /// The device's unique id.
    pub uid: [u8; 12],
    /// Boots so far.
    pub boots: u32,
}

impl<'a> Boot<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(1).u32(self.reset).u32(self.boots);
        sink.name(self.version).name(self.git).name(self.board).name(self.reset_name).bytes(&self.uid);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self {
            version: fields.text(),
            git: fields.text(),
            board: fields.text(),
            reset: fields.u32(),
            reset_name: fields.text(),
            uid: fields.array(),
            boots: fields.u32(),
        }
    }
}

/// How the last boot ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fault<'a> {
    /// 0 unknown, 1 panic, 2 hard fault, 3 watchdog.
    pub kind: u8,
    /// The task that ran.
    pub task: &'a str,
    /// File and line, or the function.
    pub place: &'a str,
    /// r0-r3, r12, lr, pc, xpsr, then CFSR, HFSR, MMFAR, BFAR.
    pub registers: [u32; 12],
    /// What the panic said.
    pub message: &'a str,
}

impl<'a> Fault<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(9);
        for &register in &self.registers {
            sink.u32(register);
        }
        sink.u8(self.kind).name(self.task).name(self.place).text(self.message);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self {
            kind: fields.u8(),
            task: fields.text(),
            place: fields.text(),
            registers: core::array::from_fn(|_| fields.u32()),
            message: fields.text(),
        }
    }
}
