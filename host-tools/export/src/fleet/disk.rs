//! Files that go to the disk side by side, while the program makes more of them.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, SendError, Sender, SyncSender};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::thread;

/// File systems with a journal write one entry for all files that wait.
const AT_ONCE: usize = 16;
/// Open files that wait for one thread.
const WAITING_MAX: usize = 8;

type Job = (File, Sender<io::Result<()>>);

static THREADS: LazyLock<Vec<SyncSender<Job>>> = LazyLock::new(|| {
    let thread = |_| {
        let (jobs, waiting) = mpsc::sync_channel::<Job>(WAITING_MAX);
        let work = move || waiting.into_iter().for_each(|(file, done)| sync(&file, &done));
        thread::Builder::new().spawn(work).ok().map(|_| jobs)
    };
    (0..AT_ONCE).map_while(thread).collect()
});

fn sync(file: &File, done: &Sender<io::Result<()>>) {
    let _ = done.send(file.sync_all());
}

/// The files of one change on their way to the disk.
#[derive(Debug)]
pub(super) struct Syncs {
    done: Sender<io::Result<()>>,
    results: Mutex<Receiver<io::Result<()>>>,
}

impl Default for Syncs {
    fn default() -> Self {
        let (done, results) = mpsc::channel();
        Self { done, results: Mutex::new(results) }
    }
}

impl Syncs {
    pub(super) fn add(&self, file: File) {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let job = (file, self.done.clone());
        let sent = match THREADS.get(NEXT.fetch_add(1, Ordering::Relaxed) % AT_ONCE) {
            Some(thread) => thread.send(job),
            None => Err(SendError(job)),
        };
        if let Err(SendError((file, done))) = sent {
            sync(&file, &done);
        }
    }

    pub(super) fn end(self) -> io::Result<()> {
        drop(self.done);
        self.results.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().collect()
    }
}
