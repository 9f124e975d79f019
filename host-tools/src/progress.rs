//! How far a long reading is, on standard error.

use indicatif::{ProgressBar, ProgressStyle};

use crate::logs::Log;

/// A bar over the log's bytes, on a terminal only.
pub fn bar(log: &Log) -> ProgressBar {
    let bar = ProgressBar::new(log.bytes());
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {bytes}/{total_bytes} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(log.name.clone());
    bar
}
