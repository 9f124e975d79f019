//! Boot record: the recorder, the previous contents of the card, and the end of the previous boot.

use super::stored::{Field, Fields, Sink, numbered, record};

numbered! {
    /// The previous session found on the card.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    PreviousEnd {
        /// Nobody has looked yet: the first boot record of a log is written before the card is open.
        #[default]
        Unknown = 0 "unknown",
        /// The card holds no earlier log.
        Nothing = 1 "nothing",
        /// Its end; the number of frames is unknown.
        Sectors = 2 "sectors",
        /// Its end and its number of frames.
        Frames = 3 "frames",
        /// There is a log, but no sector of it can be read.
        Unreadable = 4 "unreadable",
    } else Unknown
}

record! {
    /// The session recorded before this one, as found when the card was opened. It shows the end of an earlier log, and what is
    /// missing there.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    LastSession {
        /// The result of the search.
        found: PreviousEnd,
        /// Beginning of its files' names.
        number: u32,
        /// The sectors' session.
        session: u32,
        /// Number of its last sector and one.
        sectors: u32,
        /// Its frames, modulo 2^32.
        frames: u32,
        /// Check over all its entries; known together with its frames.
        check: u32,
    }
}

impl LastSession {
    /// End of the previous session, if found.
    pub const fn has_end(&self) -> bool {
        matches!(self.found, PreviousEnd::Sectors | PreviousEnd::Frames)
    }
}

record! {
    /// The monitor started.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Boot<'a> {
        /// `0.1.0`.
        version: &'a str,
        /// The commit.
        git: &'a str,
        /// The board's name.
        board: &'a str,
        /// 0 if unknown.
        reset: u32,
        /// The name of the cause.
        reset_name: &'a str,
        /// The device's unique id.
        uid: [u8; 12],
        /// Boots so far.
        boots: u32,
        /// The session before on this card. Known only after the card is open: the record is then written again.
        before: LastSession,
    }
}

record! {
    /// How the last boot ended.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Fault<'a> {
        /// 0 unknown, 1 panic, 2 hard fault, 3 watchdog.
        kind: u8,
        /// The task that ran.
        task: &'a str,
        /// File and line, or function.
        place: &'a str,
        /// r0-r3, r12, lr, pc, xpsr, then CFSR, HFSR, MMFAR, BFAR.
        registers: [u32; 12],
    }
    text {
        /// Panic message.
        message: &'a str,
    }
}
