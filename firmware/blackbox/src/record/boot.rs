//! Boot record: the recorder, the previous contents of the card, and the end of the previous boot.

use super::stored::{Fields, Sink};

/// The previous session found on the card.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum PreviousEnd {
    /// Nobody has looked yet: the first boot record of a log is written before the card is open.
    #[default]
    Unknown = 0,
    /// The card holds no earlier log.
    Nothing = 1,
    /// Its end; the number of frames is unknown.
    Sectors = 2,
    /// Its end and its number of frames.
    Frames = 3,
    /// There is a log, but no sector of it can be read.
    Unreadable = 4,
}

impl PreviousEnd {
    /// Unknown for later ones.
    pub const fn from_number(number: u8) -> Self {
        match number {
            1 => Self::Nothing,
            2 => Self::Sectors,
            3 => Self::Frames,
            4 => Self::Unreadable,
            _ => Self::Unknown,
        }
    }

    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Nothing => "nothing",
            Self::Sectors => "sectors",
            Self::Frames => "frames",
            Self::Unreadable => "unreadable",
        }
    }
}

/// The session recorded before this one, as found when the card was opened. It shows the end of an earlier log, and what is
/// missing there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LastSession {
    /// The result of the search.
    pub found: PreviousEnd,
    /// Beginning of its files' names.
    pub number: u32,
    /// The sectors' session.
    pub session: u32,
    /// Number of its last sector and one.
    pub sectors: u32,
    /// Its frames, modulo 2^32.
    pub frames: u32,
    /// Check over all its entries; known together with its frames.
    pub check: u32,
}

impl LastSession {
    /// End of the previous session, if found.
    pub const fn has_end(&self) -> bool {
        matches!(self.found, PreviousEnd::Sectors | PreviousEnd::Frames)
    }
}

/// The monitor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Boot<'a> {
    /// `0.1.0`.
    pub version: &'a str,
    /// The commit.
    pub git: &'a str,
    /// The board's name.
    pub board: &'a str,
    /// 0 if unknown.
    pub reset: u32,
    /// The name of the cause.
    pub reset_name: &'a str,
    /// The device's unique id.
    pub uid: [u8; 12],
    /// Boots so far.
    pub boots: u32,
    /// The session before on this card. Known only after the card is open: the record is then written again.
    pub before: LastSession,
}

impl<'a> Boot<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        let LastSession { found, number, session, sectors, frames, check } = self.before;
        sink.head(1).u32(self.reset).u32(self.boots);
        sink.u32(number).u32(session).u32(sectors).u32(frames).u32(check);
        sink.name(self.version).name(self.git).name(self.board).name(self.reset_name).bytes(&self.uid);
        sink.u8(found as u8);
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
            before: LastSession {
                number: fields.u32(),
                session: fields.u32(),
                sectors: fields.u32(),
                frames: fields.u32(),
                check: fields.u32(),
                found: PreviousEnd::from_number(fields.u8()),
            },
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
    /// File and line, or function.
    pub place: &'a str,
    /// r0-r3, r12, lr, pc, xpsr, then CFSR, HFSR, MMFAR, BFAR.
    pub registers: [u32; 12],
    /// Panic message.
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
