//! Ctrl-C and SIGTERM end an endless run in good order: waiting data is written, the log is closed and the results
//! are printed. A second signal ends the program at once, unless it follows so closely that it belongs to the first.
//! With a database the second one ends the wait for that, and the third one the program.
//!
//! SIGHUP keeps its default, so that `nohup` works. SIGXFSZ, which a file beyond the limit of `ulimit -f` sends, is
//! only noted: then the write fails with an error that names the file.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

const EXIT_CODE: i32 = 130;

/// Signals within this time after one belong to it: `timeout -s INT` sends two.
const ECHO: Duration = Duration::from_millis(50);
/// Polling interval, if the system cannot wait for a signal.
#[cfg(not(unix))]
const LOOK: Duration = Duration::from_millis(20);

static REQUESTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
/// Whether a second request came, if it counts apart from the first.
static AGAIN: AtomicBool = AtomicBool::new(false);

/// From now on the first Ctrl-C or SIGTERM is only noted; the second one ends the program at once.
pub fn watch() {
    watch_for(1);
}

/// From now on the first and the second Ctrl-C or SIGTERM are only noted; the third one ends the program at once.
pub fn watch_twice() {
    watch_for(2);
}

fn watch_for(wishes: u32) {
    REQUESTED.get_or_init(|| watched(wishes, next));
}

/// The flag of a signal. It is set from the moment on in which a signal no longer ends the program, so none is
/// missed.
fn watched<N: FnMut() + Send + 'static>(
    wishes: u32,
    next: impl FnOnce() -> io::Result<N>,
) -> Arc<AtomicBool> {
    let [requested, armed] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    note_failure(set_by_signals(&requested));
    let thread = std::thread::Builder::new().name("signals".to_owned());
    let ready = Arc::clone(&armed);
    let is_told_apart =
        next().and_then(|next| thread.spawn(move || tell_apart(wishes, next, &ready))).is_ok();
    note_failure(end_once(&armed));
    if !is_told_apart {
        // Without a thread the second one ends the program, at any time. In this order: the first one must not find
        // the flag set.
        note_failure(set_by_signals(&armed));
    }
    requested
}

fn tell_apart(wishes: u32, mut next: impl FnMut(), armed: &AtomicBool) {
    let mut last: Option<Instant> = None;
    for wish in 1..=wishes {
        next();
        while last.is_some_and(|last| last.elapsed() < ECHO) {
            next();
        }
        last = Some(Instant::now());
        AGAIN.store(wish > 1, Ordering::SeqCst);
    }
    std::thread::sleep(ECHO);
    armed.store(true, Ordering::SeqCst);
}

#[cfg(unix)]
fn next() -> io::Result<impl FnMut() + Send + 'static> {
    let (mut heard, tell) = io::pipe()?;
    for signal in [SIGINT, SIGTERM] {
        signal_hook::low_level::pipe::register(signal, std::os::fd::OwnedFd::from(tell.try_clone()?))?;
    }
    Ok(move || while !matches!(io::Read::read(&mut heard, &mut [0]), Ok(1)) {})
}

#[cfg(not(unix))]
fn next() -> io::Result<impl FnMut() + Send + 'static> {
    let heard = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&heard))?;
    }
    Ok(move || {
        while !heard.swap(false, Ordering::SeqCst) {
            std::thread::sleep(LOOK);
        }
    })
}

fn set_by_signals(set: &Arc<AtomicBool>) -> io::Result<()> {
    [SIGINT, SIGTERM].into_iter().try_for_each(|signal| flag::register(signal, Arc::clone(set)).map(|_| ()))
}

fn end_once(armed: &Arc<AtomicBool>) -> io::Result<()> {
    [SIGINT, SIGTERM].into_iter().try_for_each(|signal| {
        flag::register_conditional_shutdown(signal, EXIT_CODE, Arc::clone(armed)).map(|_| ())
    })
}

fn note_failure(result: io::Result<()>) {
    if let Err(error) = result {
        note!("Ctrl-C will end the program without closing the log: {error}");
    }
}

/// From now on a file that grows beyond the process's limit is an error of the write, and not the end of the program.
pub fn no_end_by_file_size() {
    #[cfg(unix)]
    // Without a handler the signal ends the program, as before.
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Whether the user, or the system, requested the end.
pub fn requested() -> bool {
    REQUESTED.get().is_some_and(|requested| requested.load(Ordering::SeqCst))
}

/// Whether the end was requested a second time, after [`watch_twice`].
pub fn requested_again() -> bool {
    AGAIN.load(Ordering::SeqCst)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_that_comes_while_the_program_begins_to_watch_is_noted() {
        let requested = watched(1, || {
            let next = next();
            signal_hook::low_level::raise(SIGTERM)?;
            next
        });
        assert!(requested.load(Ordering::SeqCst));
    }
}
