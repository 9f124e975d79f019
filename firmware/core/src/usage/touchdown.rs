//! How fast the vehicle came down on the ground.
//!
//! Nobody says when a vehicle touches: the autopilot calls it landed a second or more later, and its estimate of the speed
//! goes on sinking slowly meanwhile. What shows the touch is that the sink speed breaks off: it halves within
//! [`BREAKS_WITHIN`]. The speed before that counts, where the vehicle then stays at this height until it has landed; a stop
//! higher up was a hover.

use crate::time::{Instant, Span};

/// A sink speed that halves within this was stopped by something.
const BREAKS_WITHIN: Span = Span::from_millis(600);
/// Slower than this nothing breaks off.
const SINK_MIN_MPS: f32 = 0.3;
/// The touch was at the height where the vehicle stands, give or take what pressure does near the ground.
const SAME_HEIGHT_M: f32 = 1.5;
/// The touch is at most so long before the vehicle is known to stand.
const KNOWN_AFTER: Span = Span::from_secs(8);

/// Where a descent broke off.
#[derive(Clone, Copy, Debug)]
struct Stop {
    at: Instant,
    height_m: f32,
    sink_mps: f32,
}

/// The speed of the last touch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touchdown {
    /// The fastest sink of this window of [`BREAKS_WITHIN`], and of the one before.
    now_mps: f32,
    before_mps: f32,
    window: Instant,
    stop: Option<Stop>,
}

impl Touchdown {
    pub(super) const fn new() -> Self {
        Self { now_mps: 0.0, before_mps: 0.0, window: Instant::ZERO, stop: None }
    }

    /// One step in the air: how fast it sinks (negative: climbs), and how high it is.
    pub(super) fn step(&mut self, at: Instant, sink_mps: f32, height_m: f32) {
        if at.since(self.window) >= BREAKS_WITHIN {
            (self.before_mps, self.now_mps, self.window) = (self.now_mps, 0.0, at);
        }
        self.now_mps = self.now_mps.max(sink_mps);
        let fastest_mps = self.now_mps.max(self.before_mps);
        if fastest_mps < SINK_MIN_MPS || sink_mps > fastest_mps / 2.0 {
            return;
        }
        (self.now_mps, self.before_mps) = (sink_mps.max(0.0), 0.0);
        let same = |stop: &Stop| {
            (stop.height_m - height_m).abs() <= SAME_HEIGHT_M && at.since(stop.at) <= KNOWN_AFTER
        };
        let stop = self.stop.filter(same).filter(|stop| stop.sink_mps >= fastest_mps);
        self.stop = stop.or(Some(Stop { at, height_m, sink_mps: fastest_mps }));
    }

    /// The vehicle stands at this height: how fast it touched, m/s. 0 where nothing broke off: it came down gently.
    pub(super) fn take(&mut self, at: Instant, height_m: Option<f32>) -> f32 {
        let here = |stop: &Stop| {
            at.since(stop.at) <= KNOWN_AFTER
                && height_m.is_none_or(|height_m| (stop.height_m - height_m).abs() <= SAME_HEIGHT_M)
        };
        let touched_mps = self.stop.filter(here).map_or(0.0, |stop| stop.sink_mps);
        *self = Self::new();
        touched_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (seconds, sink) pieces from a height, at 5 Hz; then the vehicle stands.
    fn land(mut height_m: f32, pieces: &[(f32, f32)]) -> f32 {
        let (mut touchdown, mut now_ms) = (Touchdown::new(), 0);
        for (seconds, sink_mps) in pieces {
            for _ in 0..(seconds * 5.0) as u32 {
                now_ms += 200;
                height_m -= sink_mps * 0.2;
                touchdown.step(Instant::from_millis(now_ms), *sink_mps, height_m);
            }
        }
        touchdown.take(Instant::from_millis(now_ms), Some(height_m))
    }

    #[test]
    fn the_speed_before_the_touch_counts_also_where_the_estimate_goes_on_sinking() {
        assert!((land(10.0, &[(4.0, 2.5), (3.0, 0.1)]) - 2.5).abs() < 1e-6);
        // As an ArduCopter's estimate did after a touch at 2.49 m/s.
        assert!(
            (land(10.0, &[(4.0, 2.49), (1.0, 0.75), (1.0, 0.5), (1.0, 0.3), (2.0, 0.0)]) - 2.49).abs() < 1e-6
        );
    }

    #[test]
    fn a_hover_on_the_way_down_is_no_touch() {
        assert!((land(10.0, &[(3.0, 2.5), (3.0, 0.0), (5.0, 0.5), (2.0, 0.0)]) - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_bounce_counts_with_its_first_and_harder_touch() {
        assert!((land(10.0, &[(4.0, 2.5), (0.4, -0.5), (0.4, 0.5), (2.0, 0.0)]) - 2.5).abs() < 1e-6);
    }
}
