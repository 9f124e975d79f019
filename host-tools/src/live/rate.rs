//! Update rate of the pages, and number of frames per second.

use std::time::{Duration, Instant as Wall};

/// Twenty times a second.
pub const PUBLISH: Duration = Duration::from_millis(50);

/// Frames a second.
#[derive(Debug)]
pub struct Rate {
    since: Wall,
    frames: u64,
    /// Frames in the last whole second.
    pub frames_s: f64,
}

impl Default for Rate {
    /// From now on.
    fn default() -> Self {
        Self { since: Wall::now(), frames: 0, frames_s: 0.0 }
    }
}

impl Rate {
    /// Skips the frames in between.
    pub fn jump(&mut self, frames: u64) {
        (self.frames, self.since) = (frames, Wall::now());
    }

    /// Frames so far.
    pub fn count(&mut self, frames: u64) {
        let passed = self.since.elapsed().as_secs_f64();
        if passed >= 1.0 {
            self.frames_s = frames.saturating_sub(self.frames) as f64 / passed;
            (self.frames, self.since) = (frames, Wall::now());
        }
    }
}
