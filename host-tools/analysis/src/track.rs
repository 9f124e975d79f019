//! A track, bounded.

use hums_core::clock::{Instant, Span};
use hums_core::units::Position;

/// When full, every second one goes.
const POINTS_MAX: usize = 4_096;
/// The first distance between two.
const EVERY: Span = Span::from_millis(100);

/// A place at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// When.
    pub at: Instant,
    /// Degrees, north positive.
    pub latitude_deg: f64,
    /// Degrees, east positive.
    pub longitude_deg: f64,
    /// Above home, if known.
    pub height_m: Option<f32>,
}

/// Places in order of time.
#[derive(Clone, Debug)]
pub struct Track {
    points: Vec<Point>,
    every: Span,
}

impl Default for Track {
    fn default() -> Self {
        Self { points: Vec::new(), every: EVERY }
    }
}

impl Track {
    /// The first place of each interval. `true`: it was full, older points went, intervals doubled.
    pub fn push(&mut self, at: Instant, position: Position, height_m: Option<f32>) -> bool {
        if self.points.last().is_some_and(|last| at.since(last.at) < self.every) {
            return false;
        }
        let full = self.points.len() >= POINTS_MAX;
        if full {
            let mut odd = false;
            self.points.retain(|_| {
                odd = !odd;
                odd
            });
            self.every = Span::from_micros(self.every.as_micros().saturating_mul(2));
        }
        let Position { latitude_deg, longitude_deg } = position;
        self.points.push(Point { at, latitude_deg, longitude_deg, height_m });
        full
    }

    /// Points, oldest first.
    pub fn points(&self) -> &[Point] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_of_a_day_stays_in_bounds_and_keeps_its_beginning() {
        let mut track = Track::default();
        let mut thinned = 0;
        for second in 0..86_400 {
            let position = Position { latitude_deg: f64::from(second), longitude_deg: 0.0 };
            let at = Instant::from_millis(u64::from(second as u32) * 1000);
            thinned += u32::from(track.push(at, position, Some(1.0)));
        }
        assert!((POINTS_MAX / 2..=POINTS_MAX).contains(&track.points().len()));
        assert!(track.points()[0].at == Instant::ZERO && thinned > 0);
    }
}
