//! The speed of the touchdown.
//!
//! The autopilot reports a landing a second or more after the touch, and its estimate goes on sinking slowly meanwhile. At the touch the sink
//! breaks off: it falls to half of the greatest sink of the last second ([`crate::motion::WindowMax`]). This speed counts if the vehicle stays
//! within [`CLEAR_M`] of this height until it has landed: a pressure in ground effect errs. A stop higher up was a hover.

use super::GROUND_LASTS;
use crate::motion::{CLEAR_M, HANGS_MPS};
use crate::time::BootMs;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    at: BootMs,
    height_m: f32,
    sink_mps: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Touchdown(Option<Stop>);

impl Touchdown {
    /// Sink is negative in a climb; the other sink is the most in the last second.
    pub(super) fn step(&mut self, at: BootMs, sink_mps: f32, fastest_mps: f32, height_m: f32) {
        if fastest_mps < HANGS_MPS || sink_mps > fastest_mps / 2.0 {
            return;
        }
        let same =
            |stop: &Stop| (stop.height_m - height_m).abs() <= CLEAR_M && at.since(stop.at) <= GROUND_LASTS;
        let stop = self.0.filter(same).filter(|stop| stop.sink_mps >= fastest_mps);
        self.0 = stop.or(Some(Stop { at, height_m, sink_mps: fastest_mps }));
    }

    /// The vehicle stands at this height: how fast it touched, m/s. 0 where nothing broke off: it came down gently.
    pub(super) fn take(&mut self, at: BootMs, height_m: Option<f32>) -> f32 {
        let here = |stop: &Stop| {
            at.since(stop.at) <= GROUND_LASTS
                && height_m.is_none_or(|height_m| (stop.height_m - height_m).abs() <= CLEAR_M)
        };
        self.0.take().filter(here).map_or(0.0, |stop| stop.sink_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::WindowMax;

    fn land(mut height_m: f32, pieces: &[(f32, f32)]) -> f32 {
        let (mut touchdown, mut sink, mut now_ms) = (Touchdown::default(), WindowMax::default(), 0);
        for (seconds, sink_mps) in pieces {
            for _ in 0..(seconds * 5.0) as u32 {
                now_ms += 200;
                height_m -= sink_mps * 0.2;
                let now = BootMs::from_millis(now_ms);
                sink.take(now, *sink_mps);
                touchdown.step(now, *sink_mps, sink.greatest(now), height_m);
            }
        }
        touchdown.take(BootMs::from_millis(now_ms), Some(height_m))
    }

    #[test]
    fn the_speed_before_the_first_and_hardest_touch_counts() {
        for (what, pieces, touch_mps) in [
            ("it stands", &[(4.0, 2.5), (3.0, 0.1)][..], 2.5),
            ("the estimate sinks on", &[(4.0, 2.49), (1.0, 0.75), (1.0, 0.5), (1.0, 0.3), (2.0, 0.0)], 2.49),
            ("a hover on the way down", &[(3.0, 2.5), (3.0, 0.0), (5.0, 0.5), (2.0, 0.0)], 0.5),
            ("a bounce", &[(4.0, 2.5), (0.4, -0.5), (0.4, 0.5), (2.0, 0.0)], 2.5),
        ] {
            let found_mps = land(10.0, pieces);
            assert!((found_mps - touch_mps).abs() < 1e-6, "{what}: {found_mps}");
        }
    }
}
