//! Between the thread that follows the vehicle and the pages: what is known now, of which only the newest counts, and the
//! histories, of which each page takes what it lacks. The one side never waits for the other: a page that is slow skips
//! states, and gets a larger part of the history the next time.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hums_core::clock::Instant;
use tokio::sync::watch;

use super::world::Histories;
use crate::page::history::{Cursor, Part};

/// Commands of all pages that wait; more are refused, which a second key press repeats.
const COMMANDS_MAX: usize = 64;

/// What is known at a moment, as text that is made once for all pages.
#[derive(Debug, Default)]
pub struct Published {
    /// Another one: the time went back, take the histories anew.
    pub epoch: u64,
    /// No page sees what is later.
    pub now: Instant,
    /// Source, time and vehicles.
    pub head: String,
    /// What stands on a recording's time line; the same one until it changes.
    pub timeline: Arc<str>,
    /// Each vehicle by system id.
    pub crafts: Vec<(u8, String)>,
}

/// What a page asks for; only a recording can be played otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Time stands.
    Pause,
    /// Time goes on.
    Play,
    /// Go to this time, seconds since the first byte.
    Seek(f64),
    /// So many seconds a second.
    Speed(f64),
}

/// The meeting place.
#[derive(Debug)]
pub struct Hub {
    state: watch::Sender<Arc<Published>>,
    histories: Mutex<Histories>,
    commands: SyncSender<Command>,
}

impl Hub {
    /// With the end that takes commands.
    pub fn new() -> (Arc<Self>, Receiver<Command>) {
        let (commands, taken) = sync_channel(COMMANDS_MAX);
        let (state, _) = watch::channel(Arc::default());
        (Arc::new(Self { state, histories: Mutex::default(), commands }), taken)
    }

    /// The newest state replaces the one before.
    pub fn publish(&self, published: Published) {
        self.state.send_replace(Arc::new(published));
    }

    /// For a page: the state, and when it changes.
    pub fn follow(&self) -> watch::Receiver<Arc<Published>> {
        self.state.subscribe()
    }

    /// The histories, to be held for moments.
    pub fn histories(&self) -> MutexGuard<'_, Histories> {
        // What a panicking thread left is still the best there is.
        self.histories.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a page lacks of a vehicle's history.
    pub fn since(&self, vehicle: u8, cursor: &mut Cursor, until: Instant) -> Option<Part> {
        self.histories().get(&vehicle)?.since(vehicle, cursor, until)
    }

    /// A page asks for something; `false` where too much waits.
    pub fn command(&self, command: Command) -> bool {
        self.commands.try_send(command).is_ok()
    }
}
