//! Connects the vehicle's thread with the pages. It holds the newest state, and the histories. Neither waits:
//! a slow page skips states, and gets more history the next time.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hums_core::clock::Instant;
use tokio::sync::watch;

use super::world::Histories;
use crate::page::history::{Cursor, Part};

/// Commands of all pages; a refused one is repeated by a second key press.
const COMMANDS_MAX: usize = 64;

/// The present state, as text made once for all pages.
#[derive(Debug, Default)]
pub struct Published {
    /// A new number means that time went back: take the histories again.
    pub epoch: u64,
    /// Pages see no later data.
    pub now: Instant,
    /// Source, time and vehicles.
    pub head: String,
    /// The recording's time line; the same text until it changes.
    pub timeline: Arc<str>,
    /// Each vehicle by system id.
    pub crafts: Vec<(u8, String)>,
}

/// A request of a page; apart from the vehicle, only for playback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PageCommand {
    /// Stops time.
    Pause,
    /// Time goes on.
    Play,
    /// Go to this time, seconds since the first byte.
    Seek(f64),
    /// Seconds of the recording per second.
    Speed(f64),
}

/// The meeting place.
#[derive(Debug)]
pub struct Hub {
    state: watch::Sender<Arc<Published>>,
    histories: Mutex<Histories>,
    commands: SyncSender<PageCommand>,
}

impl Hub {
    /// With the end that takes commands.
    pub fn new() -> (Arc<Self>, Receiver<PageCommand>) {
        let (commands, taken) = sync_channel(COMMANDS_MAX);
        let (state, _) = watch::channel(Arc::default());
        (Arc::new(Self { state, histories: Mutex::default(), commands }), taken)
    }

    /// Replaces the state before.
    pub fn publish(&self, published: Published) {
        self.state.send_replace(Arc::new(published));
    }

    /// The state, and when it changes.
    pub fn follow(&self) -> watch::Receiver<Arc<Published>> {
        self.state.subscribe()
    }

    /// The histories.
    pub fn histories(&self) -> MutexGuard<'_, Histories> {
        // Usable after a thread's panic.
        self.histories.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The part of a vehicle's history that a page lacks.
    pub fn since(&self, vehicle: u8, cursor: &mut Cursor, until: Instant) -> Option<Part> {
        self.histories().get(&vehicle)?.since(vehicle, cursor, until)
    }

    /// `false` if too many wait.
    pub fn command(&self, command: PageCommand) -> bool {
        self.commands.try_send(command).is_ok()
    }
}
