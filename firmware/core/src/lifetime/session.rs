//! Counters of a session, that is of a power-on. It is the one item that is saved again and again in flight, so it is
//! short. At the next start it is added to the saved totals.
//!
//! Each item that adds up over sessions names the power-on that it is *as of*: it counts everything before that one.
//! The session is added to items that are as of the same power-on, and to no other: each figure counts once, even if
//! power fails while items are saved. An item that was not saved again gets the session added; one that was saved
//! includes it.
//!
//! Layout:
//!
//! - version, power-on (u32), whether the airframe was heard (u8);
//! - counters in the order of [`crate::usage::UsageCounter::ALL`]: times in tenths of a second, counts and half cycles as LEB128, amounts and
//!   extremes as f32;
//! - number of motors, and of each tenths of a second and whole revolutions (LEB128 of u32);
//! - time in ranges: a bit for each range that was entered (5 bytes), and of these tenths of a second (LEB128);
//! - number of batteries, and the cycles of each (f32).
//!
//! A quad with four ESCs has some 155 bytes after half an hour; the maximum is
//! [`Session::BYTES`](super::Item::BYTES).

use super::{Item, Lifetime, Unreadable};
use crate::bytes::{Fields, fields};
use crate::usage::{Form, Totals};

/// A session as it was stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Session {
    /// The number of its power-on.
    pub boots: u32,
    /// Whether the airframe was heard.
    pub heard: bool,
    /// Its counters.
    pub totals: Totals,
}

impl Session {
    /// Bytes that a quad with four ESCs needs after half an hour, generously.
    pub const BYTES_TYPICAL: usize = 160;
}

impl Item for Session {
    const VERSION: u8 = 3;
    const BYTES: usize = 503;
    const SHORT: bool = true;

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        let Self { boots, heard, totals } = self;
        let mut was_heard = u8::from(*heard);
        fields!(fields: boots, was_heard, totals);
        *heard = was_heard != 0;
        fields.list(
            &mut totals.battery_cycles,
            |cycles| *cycles > 0.0,
            |fields, cycles| fields.counter(Form::Amount, cycles),
        )
    }
}

impl Lifetime {
    /// Adds the session that was saved last, unless it is counted already.
    pub fn add(&mut self, session: &Session) {
        if session.boots == self.boots {
            self.sessions = self.sessions.saturating_add(u32::from(session.heard));
            self.totals.join(&session.totals);
        }
    }
}
