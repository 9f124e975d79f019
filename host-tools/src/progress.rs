//! How far a long reading is, on standard error.

use indicatif::{ProgressBar, ProgressStyle};

use crate::printable::word;

/// A bar over so many bytes, on a terminal only; none where nobody knows how many.
pub fn bytes(total: Option<u64>, name: &str) -> ProgressBar {
    let Some(total) = total else { return ProgressBar::hidden() };
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {bytes}/{total_bytes} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(word(name).into_owned());
    bar
}

/// A bar over several logs, on a terminal only; none for a single one.
pub fn logs(count: usize) -> ProgressBar {
    if count < 2 {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(count as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} logs {eta}") {
        bar.set_style(style);
    }
    bar
}
