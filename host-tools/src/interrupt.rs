//! Ctrl-C ends a run that would go on for ever in good order: the log is closed and the results are printed.
//! A second one ends the program at once.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C (or SIGTERM's equivalent on the platform) is only noted, once.
pub fn watch() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let handler = || {
            if REQUESTED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        };
        // Without a handler Ctrl-C simply ends the program, as before.
        if let Err(error) = ctrlc::set_handler(handler) {
            eprintln!("hums: Ctrl-C will end the program without closing the log: {error}");
        }
    });
}

/// Whether the user asked to end.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
