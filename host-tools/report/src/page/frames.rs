//! Number of frames per second, and of the vehicle's missing frames by its own count.

use hums_core::clock::Instant;
use hums_core::observation::Source;

use super::plots::Plot;
use crate::series::Store;

/// Sender and number of a frame.
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
    /// Takes the next frame.
    pub fn take(&mut self, sign: &Sign, vehicle: Option<Source>, store: &mut Store<Plot>) {
        self.pass(sign.at, store);
        self.second.get_or_insert(sign.at.as_micros() / 1_000_000);
        self.received += 1;
        if vehicle == Some(sign.source) {
            let missing = self.last.map_or(0, |last| sign.sequence.wrapping_sub(last).wrapping_sub(1));
            // A step back is reordering or a restart, not 250 frames.
            self.missing += if missing < 128 { u32::from(missing) } else { 0 };
            self.last = Some(sign.sequence);
        }
    }

    /// Adds a second to the plot at its end: a page that was shown the time up to then cannot take earlier
    /// values.
    pub fn pass(&mut self, now: Instant, store: &mut Store<Plot>) {
        let end = |second: u64| Instant::from_millis(second.saturating_add(1).saturating_mul(1_000));
        let Some(at) = self.second.map(end).filter(|end| *end <= now) else { return };
        for (line, count) in (0..).zip([self.received, self.missing]) {
            store.push(at, (Plot::Frames, line), count as f32);
        }
        (self.second, self.received, self.missing) = (None, 0, 0);
    }

    /// Numbers after a gap start again.
    pub fn gap(&mut self) {
        self.last = None;
    }
}
