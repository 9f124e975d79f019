//! Ctrl-C and SIGTERM end a run that would go on for ever in good order: what waits is written, the log is closed and
//! the results are printed. A second one ends the program at once (of a wait for a database it ends the wait, and the third
//! one the program). SIGTERM is what `systemctl stop` and `docker stop` send.
//!
//! SIGHUP keeps its default, so that `nohup` works. SIGXFSZ, which a file beyond the limit of `ulimit -f` sends, is only
//! noted: then the write fails with an error that names the file.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// What a shell reports of a program that Ctrl-C ended.
const EXIT_CODE: i32 = 130;

static REQUESTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
/// Whether the next one ends the program at once.
static ARMED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on the first Ctrl-C or SIGTERM is only noted.
pub fn watch() {
    REQUESTED.get_or_init(|| {
        let requested = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // In this order: the first one must not find the flag set.
            let armed = Arc::clone(ARMED.get_or_init(Arc::default));
            let second = flag::register_conditional_shutdown(signal, EXIT_CODE, Arc::clone(&armed));
            let first = second.and_then(|_| flag::register(signal, armed));
            let first = first.and_then(|_| flag::register(signal, Arc::clone(&requested)));
            // Without a handler the signal simply ends the program, as before.
            if let Err(error) = first {
                note!("Ctrl-C will end the program without closing the log: {error}");
            }
        }
        requested
    });
}

/// From now on a file that grows beyond the process's limit is an error of the write, and not the end of the program.
pub fn no_end_by_file_size() {
    #[cfg(unix)]
    // Without a handler the signal ends the program, as before.
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Whether the user, or the system, asked to end.
pub fn requested() -> bool {
    REQUESTED.get().is_some_and(|requested| requested.load(Ordering::SeqCst))
}

/// The first one has come, and something is waited for that may take long: from now on a second one is noted too, and the
/// third one ends the program at once. What is given says whether the second one has come.
pub fn watch_again() -> Arc<AtomicBool> {
    let again = Arc::new(AtomicBool::new(false));
    if let Some(armed) = ARMED.get() {
        for signal in [SIGINT, SIGTERM] {
            // Without a handler the second one ends the program at once, as before.
            if flag::register(signal, Arc::clone(&again)).is_ok() {
                armed.store(false, Ordering::SeqCst);
            }
        }
    }
    again
}
