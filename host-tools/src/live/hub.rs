//! Connects the vehicle's thread with the pages. It holds the newest state, and the histories. Neither waits:
//! a slow page skips states, and gets more history the next time.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use hums_core::clock::Instant;
use serde::Deserialize;

use super::world::Histories;
use crate::page::history::{Cursor, HistoryPart};

/// Commands of all pages; a refused one is repeated by a second key press.
const COMMANDS_MAX: usize = 64;

/// The present state, as text made once for all pages.
#[derive(Debug, Default)]
pub struct PublishedState {
    /// A new number means that time went back: take the histories again.
    pub epoch: u64,
    /// Pages see no later data.
    pub now: Instant,
    /// Source, time and vehicles.
    pub head: String,
    /// A recording's time line, or a link's bench check; the same text until it changes.
    pub aside: Arc<str>,
    /// Each vehicle by system id.
    pub crafts: Vec<(u8, String)>,
}

/// A request of a page.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(tag = "cmd", content = "to", rename_all = "lowercase")]
pub enum PageCommand {
    /// Stops time.
    Pause,
    /// Time goes on.
    Play,
    /// Go to this time, seconds since the first byte.
    Seek(f64),
    /// Seconds of the recording per second.
    Speed(f64),
    /// Bench check of this vehicle; `None`: the only one.
    Check(Option<u8>),
}

/// The meeting place.
#[derive(Debug)]
pub struct Hub {
    /// With the number of the newest one.
    state: Mutex<(u64, Arc<PublishedState>)>,
    changed: Condvar,
    histories: Mutex<Histories>,
    commands: SyncSender<PageCommand>,
}

impl Hub {
    /// With the end that takes commands.
    pub fn new() -> (Arc<Self>, Receiver<PageCommand>) {
        let (commands, taken) = sync_channel(COMMANDS_MAX);
        let hub =
            Self { state: Mutex::default(), changed: Condvar::new(), histories: Mutex::default(), commands };
        (Arc::new(hub), taken)
    }

    /// Replaces the state before.
    pub fn publish(&self, published: PublishedState) {
        let mut state = lock(&self.state);
        *state = (state.0 + 1, Arc::new(published));
        drop(state);
        self.changed.notify_all();
    }

    /// The newest state with its number. Waits for it as long as `seen` (0 for none) is the newest one; `None` if the wait is over.
    pub fn after(&self, seen: u64, wait: Duration) -> Option<(u64, Arc<PublishedState>)> {
        let newest = self.changed.wait_timeout_while(lock(&self.state), wait, |state| state.0 == seen);
        let (state, timeout) = newest.unwrap_or_else(PoisonError::into_inner);
        (!timeout.timed_out()).then(|| state.clone())
    }

    /// The histories.
    pub fn histories(&self) -> MutexGuard<'_, Histories> {
        lock(&self.histories)
    }

    /// The part of a vehicle's history that a page lacks.
    pub fn since(&self, vehicle: u8, cursor: &mut Cursor, until: Instant) -> Option<HistoryPart> {
        self.histories().get(&vehicle)?.since(vehicle, cursor, until)
    }

    /// `false` if too many wait.
    pub fn command(&self, command: PageCommand) -> bool {
        self.commands.try_send(command).is_ok()
    }
}

/// Usable after a thread's panic.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
