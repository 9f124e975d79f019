//! The monitor task's side of the store: items to save, and texts about them.

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::lifetime::{ITEM_BYTES_MAX, Room};
use hums_core::parameters::Params;
use hums_store::{Key, param_value};

use super::mailbox::MailboxIn;
use super::status::{EraseMoment, StoreReading, StoreState, StoreStatus};

/// The text if no earlier flights are known.
pub const STORE_NEW: &str = "HUMS: the store is new, all counters begin";

/// No frame for this long, and disarmed: an erase, which stops the processor, loses nothing.
pub const QUIET: Span = Span::from_secs(5);

/// Disarmed on the ground for this long: a nearly full store may be erased despite the autopilot's stream.
pub const GROUNDED: Span = Span::from_secs(10);

/// Saves the monitor's items.
pub struct Handover<'a> {
    items: MailboxIn<'a>,
    status: &'a StoreStatus,
    told: StoreReading,
    frames: u64,
    frames_at: Instant,
    /// Armed, flying, or not known to be disarmed.
    active_at: Instant,
}

/// A text about the store, for the record and the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct News {
    /// `MAV_SEVERITY`.
    pub severity: u8,
    /// At most 50 characters.
    pub text: &'static str,
}

impl<'a> Handover<'a> {
    /// Call after [`StoreWriter::load`](super::StoreWriter::load): parameters then equal their stored values.
    pub fn new(items: MailboxIn<'a>, status: &'a StoreStatus, monitor: &mut Monitor) -> Self {
        monitor.params_mut().all_saved();
        let told = StoreReading::default();
        Self { items, status, told, frames: 0, frames_at: Instant::ZERO, active_at: Instant::ZERO }
    }

    /// At every tick: hands over items that are due. `frames` is reception's counter.
    pub fn step(&mut self, now: Instant, monitor: &mut Monitor, frames: u64) {
        if self.frames != frames {
            (self.frames, self.frames_at) = (frames, now);
        }
        let disarmed = monitor.vehicle().heartbeat.get().is_some_and(|heartbeat| !heartbeat.armed);
        if !disarmed || monitor.flight().airborne() {
            self.active_at = now;
        }
        let calm = if disarmed && now.since(self.frames_at) >= QUIET {
            EraseMoment::Silent
        } else if now.since(self.active_at) >= GROUNDED {
            EraseMoment::Grounded
        } else {
            EraseMoment::None
        };
        self.status.change(|store| store.calm = calm);
        self.put_params(monitor.params_mut());
        self.put_items(now, monitor);
    }

    /// Hands over all items; whether all are written. `false`: call again after the store's writer took one.
    pub fn finish(&mut self, now: Instant, monitor: &mut Monitor) -> bool {
        monitor.save_all();
        self.put_params(monitor.params_mut()) && self.put_items(now, monitor) && self.items.is_empty()
    }

    /// Next store text.
    pub fn news(&mut self) -> Option<News> {
        let now = self.status.read();
        let Self { told, .. } = self;
        let news = |severity, text| Some(News { severity, text });
        if told.state != now.state {
            told.state = now.state;
            return match now.state {
                StoreState::Kept => None,
                StoreState::New => news(6, STORE_NEW),
                StoreState::Remade => news(3, "HUMS: store unreadable, counters begin anew"),
                StoreState::Failed => news(3, "HUMS: store broken, counters end with the power"),
            };
        }
        if newer(&mut told.unreadable, now.unreadable) {
            return news(4, "HUMS: a saved value was lost, using an older one");
        }
        if told.room != now.room {
            told.room = now.room;
            if now.room == Room::Reserve {
                return news(5, "HUMS: store nearly full, saved again at landing");
            }
        }
        if newer(&mut told.refused, now.refused) {
            return news(5, "HUMS: store full, saving waits for the ground");
        }
        if newer(&mut told.erased, now.erased) {
            return news(5, "HUMS: flash erased, up to 0.5 s not recorded");
        }
        if newer(&mut told.failed, now.failed) {
            return news(4, "HUMS: saving failed, have the board replaced");
        }
        None
    }

    pub(crate) fn room(&self) -> Room {
        self.status.read().room
    }

    /// An item of another owner; `false` without room.
    pub fn put(&mut self, key: Key, value: &[u8]) -> bool {
        self.items.put(key, |bytes| copy(value, bytes))
    }

    /// Set ones; `false` without room.
    fn put_params(&mut self, params: &mut Params) -> bool {
        while let Some((index, spec, value)) = params.unsaved() {
            if let Some((bytes, length)) = param_value(spec.name, value)
                && !self.put(Key::param(spec.name), bytes.get(..length).unwrap_or_default())
            {
                return false;
            }
            params.saved(index);
        }
        true
    }

    /// `false` without room.
    fn put_items(&mut self, now: Instant, monitor: &mut Monitor) -> bool {
        while let Some(key) = monitor.save_due(now.into(), self.status.read().room) {
            if !self.items.put(Key::item(key.number()), |bytes| monitor.encode_item(key, bytes)) {
                return false;
            }
            monitor.saved(key);
        }
        true
    }
}

fn copy(value: &[u8], to: &mut [u8; ITEM_BYTES_MAX]) -> usize {
    let Some(to) = to.get_mut(..value.len()) else { return 0 };
    to.copy_from_slice(value);
    value.len()
}

fn newer(told: &mut u32, now: u32) -> bool {
    core::mem::replace(told, now) != now
}
