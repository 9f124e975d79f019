//! A receiver's satellites and its dilution of precision against what is usual in this flight.
//!
//! How many satellites a receiver uses, and how well they stand, depends on the receiver, on the site and on what the antenna sees. A site
//! that has few is as it is; a sudden loss is a jammer that begins, a cable that comes off, or a view that is gone, and is worth a word
//! while there are enough left. Both figures are followed as logarithms, since what counts is the part that is lost.

use crate::departure::Departure;
use crate::observation::Gnss;
use crate::time::{Instant, Span, Stamp};

/// Time constant, s.
const SMOOTHING_S: f32 = 0.5;
/// Messages further apart are not of one course.
const PAUSE: Span = Span::from_secs(2);
/// Logarithm of 1.2: what is further on its bad side teaches nothing.
const HOLD: f32 = 0.182;
/// No geometry is worth more, and a receiver of several systems says so much less that its least change is a large part.
const HDOP_IDEAL: f32 = 1.0;

/// The memory of one receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Geometry {
    at: Stamp,
    /// Logarithms: of one part of the satellites, and of the dilution. Both are worse where they are greater.
    fewer: Departure,
    hdop: Departure,
}

impl Geometry {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self { at: Stamp::NONE, fewer: Departure::NEW, hdop: Departure::NEW };

    /// Takes what a receiver says in flight. What it says without a fix is another check's.
    pub(crate) fn take(&mut self, at: Instant, gnss: &Gnss) {
        if gnss.fix < 3 {
            return;
        }
        let step_s = self.at.age(at).map_or(0.0, |step| step.min(PAUSE).as_secs_f32());
        self.at = Stamp::at(at);
        let fewer = gnss.satellites.filter(|count| *count > 0).map(|count| -libm::logf(count.into()));
        let hdop = gnss.hdop.filter(|hdop| hdop.is_finite()).map(|hdop| libm::logf(hdop.max(HDOP_IDEAL)));
        for (figure, course) in [(fewer, &mut self.fewer), (hdop, &mut self.hdop)] {
            if let Some(figure) = figure {
                course.follow(figure, step_s, SMOOTHING_S);
                if !course.is_known() || course.departed() <= HOLD {
                    course.learn(step_s);
                }
            }
        }
    }

    /// Which part of its usual satellites it has lost, percent.
    pub(crate) fn satellites_lost(&self) -> Option<f32> {
        self.fewer.is_known().then(|| (1.0 - libm::expf(-self.fewer.departed().max(0.0))) * 100.0)
    }

    /// Its dilution of precision as a multiple of the usual one.
    pub(crate) fn hdop_rise(&self) -> Option<f32> {
        self.hdop.is_known().then(|| libm::expf(self.hdop.departed()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tells five times a second.
    fn heard(said: impl Iterator<Item = (u8, f32)>) -> Geometry {
        let mut geometry = Geometry::NEW;
        for (fifth, (satellites, hdop)) in (1_u64..).zip(said) {
            let gnss = Gnss { fix: 3, satellites: Some(satellites), hdop: Some(hdop), ..Gnss::default() };
            geometry.take(Instant::from_millis(200 * fifth), &gnss);
        }
        geometry
    }

    fn for_s(seconds: usize, satellites: u8, hdop: f32) -> impl Iterator<Item = (u8, f32)> + Clone {
        core::iter::repeat_n((satellites, hdop), 5 * seconds)
    }

    fn lost(geometry: Geometry) -> Option<f32> {
        geometry.satellites_lost().map(f32::round)
    }

    #[test]
    fn a_sudden_loss_is_told_and_stays_and_is_over_when_they_are_back() {
        let falls = || for_s(60, 16, 0.8).chain(for_s(300, 8, 2.4));
        assert_eq!(lost(heard(falls())), Some(50.0));
        assert!(heard(falls()).hdop_rise().is_some_and(|rise| (2.3..2.5).contains(&rise)));
        assert_eq!(lost(heard(falls().chain(for_s(5, 16, 0.8)))), Some(0.0));
    }

    #[test]
    fn a_site_that_has_few_and_a_slow_change_are_usual() {
        assert_eq!(lost(heard(for_s(60, 7, 1.9))), Some(0.0));
        let slowly = (0..12).flat_map(|step| for_s(40, 20 - step, 1.0 + 0.1 * f32::from(step)));
        assert!(heard(slowly.clone()).satellites_lost().is_some_and(|lost| lost < 20.0));
        assert!(heard(slowly).hdop_rise().is_some_and(|rise| rise < 1.2));
    }

    #[test]
    fn nothing_is_said_at_first_and_without_a_fix_and_what_is_ideal_does_not_get_worse() {
        assert_eq!(lost(heard(for_s(5, 16, 0.8))), None);
        let mut geometry = heard(for_s(60, 16, 0.5));
        geometry.take(Instant::from_millis(70_000), &Gnss { satellites: Some(0), ..Gnss::default() });
        assert_eq!(lost(geometry), Some(0.0));
        assert_eq!(heard(for_s(60, 30, 0.4).chain(for_s(60, 30, 0.9))).hdop_rise(), Some(1.0));
    }
}
