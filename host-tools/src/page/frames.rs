//! How many frames came in a second, and how many of the vehicle's are missing by its own count.

use hums_core::observation::Source;
use hums_core::time::Instant;

use super::plots::Plot;
use crate::series::Store;

/// Who sent a frame, and its number.
#[derive(Clone, Copy, Debug)]
pub struct Sign {
    /// When it came.
    pub at: Instant,
    /// Who sent it.
    pub source: Source,
    /// Its sequence number.
    pub sequence: u8,
}

/// The counts of the second that is still open.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    second: Option<u64>,
    received: u32,
    missing: u32,
    last: Option<u8>,
}

impl Frames {
    /// Takes the next frame; a second that has ended goes to the plot.
    pub fn take(&mut self, sign: &Sign, vehicle: Option<Source>, store: &mut Store<Plot>) {
        let second = sign.at.as_micros() / 1_000_000;
        if let Some(before) = self.second.filter(|before| *before != second) {
            // The middle of that second.
            let at = Instant::from_millis(before.saturating_mul(1000).saturating_add(500));
            for (line, count) in (0..).zip([self.received, self.missing]) {
                store.push(at, (Plot::Frames, line), count as f32);
            }
            (self.received, self.missing) = (0, 0);
        }
        self.second = Some(second);
        self.received += 1;
        if vehicle == Some(sign.source) {
            let missing = self.last.map_or(0, |last| sign.sequence.wrapping_sub(last).wrapping_sub(1));
            // A step back is reordering or a restart, not 250 frames.
            self.missing += if missing < 128 { u32::from(missing) } else { 0 };
            self.last = Some(sign.sequence);
        }
    }

    /// What follows a gap follows no number before it.
    pub fn gap(&mut self) {
        self.last = None;
    }
}
