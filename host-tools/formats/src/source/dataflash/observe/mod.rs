//! From `ArduPilot`'s messages to SI observations, equal to the same autopilot's MAVLink.
//!
//! Each useful message has a [`Handler`]: its names, its columns (with their labels in other versions), and
//! one function. Columns are found once, at the FMT. Sources: `LogStructure.h` for the messages;
//! `GCS_Common.cpp` and `AP_NavEKF3_Outputs.cpp` for the MAVLink form.

mod arming;
mod handler;
mod motion;
mod out;
mod power;
mod said;
mod state;
mod system;
mod words;

use std::cell::OnceCell;

use hums_core::clock::Instant;

use self::handler::{Given, Handler, Slots};
pub(super) use self::out::{Out, SOURCE};
pub(super) use self::state::{Standing, State};
pub(in crate::source) use self::words::is_firmware;
pub use self::words::mode_name;
use super::format::Format;
use super::message::Message;

fn handler(name: &str) -> Option<(&'static Handler, u8)> {
    let lists = [motion::HANDLERS, power::HANDLERS, system::HANDLERS, said::HANDLERS];
    lists.into_iter().flatten().find_map(|handler| Some((handler, handler.sensor(name)?)))
}

/// Whether items are made of it.
#[cfg(test)]
pub(super) fn has_handler(name: &str) -> bool {
    handler(name).is_some()
}

#[derive(Clone, Copy, Debug)]
pub(super) struct ResolvedHandler {
    pub(super) handler: &'static Handler,
    slots: Slots,
    base: u8,
}

#[derive(Debug)]
pub(super) struct Handlers {
    /// Looked up once.
    by_kind: Vec<OnceCell<Option<ResolvedHandler>>>,
}

impl Default for Handlers {
    fn default() -> Self {
        Self { by_kind: vec![OnceCell::new(); 256] }
    }
}

impl Handlers {
    pub(super) fn of(&self, format: &Format) -> Option<&ResolvedHandler> {
        let resolve = || {
            let (handler, base) = handler(&format.name)?;
            Some(ResolvedHandler { handler, slots: handler.resolve(&format.fields), base })
        };
        self.by_kind.get(usize::from(format.kind))?.get_or_init(resolve).as_ref()
    }

    pub(super) fn forget(&mut self, kind: u8) {
        if let Some(slot) = self.by_kind.get_mut(usize::from(kind)) {
            slot.take();
        }
    }
}

pub(super) fn take(
    state: &mut State,
    resolved: &ResolvedHandler,
    message: &Message<'_>,
    (at, boot_us): (Instant, Option<u64>),
    out: &mut Out<'_>,
) {
    let ResolvedHandler { handler, slots, base } = resolved;
    (handler.take)(state, &Given { message, slots, base: *base, at, boot_us }, out);
}
