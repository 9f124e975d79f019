//! A figure against its own usual level in this flight.
//!
//! The figure is smoothed. Its usual level is the mean of the smoothed figure over the last minute, and its usual range that mean and
//! [`SPREADS`] times the mean distance from it. What is beyond the range by as much as the caller names teaches nothing, so
//! that a fault does not become usual; what is so from the beginning of a flight is usual.

/// The usual level is known after so long, s, and looks back over so long.
const KNOWN_S: f32 = 8.0;
const MEMORY_S: f32 = 60.0;
/// What is more is garbage.
const FIGURE_MAX: f32 = 1e6;
/// Of noise with a normal distribution four mean distances are 3.2 standard deviations.
const SPREADS: f32 = 4.0;

/// A figure, and what is usual of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departure {
    smooth: f32,
    mean: f32,
    spread: f32,
    learnt_s: f32,
}

impl Departure {
    /// Nothing learnt.
    pub(crate) const NEW: Self = Self::after(0.0);

    /// Nothing learnt, and nothing to be for so long: the figure has to settle first.
    pub(crate) const fn after(settles_s: f32) -> Self {
        Self { smooth: 0.0, mean: 0.0, spread: 0.0, learnt_s: -settles_s }
    }

    /// Takes the figure, `step_s` after the one before, with the time constant of its kind; learns nothing.
    pub(crate) fn follow(&mut self, figure: f32, step_s: f32, smoothing_s: f32) {
        if !(-FIGURE_MAX..=FIGURE_MAX).contains(&figure) {
            return;
        }
        if self.learnt_s <= 0.0 {
            (self.smooth, self.mean) = (figure, figure);
        }
        self.smooth += step_s / (smoothing_s + step_s) * (figure - self.smooth);
    }

    /// Of what comes round after so much: it is taken round to the side of its usual level.
    pub(crate) fn wrap(&mut self, round: f32) {
        self.smooth -= round * libm::roundf(self.departed() / round);
    }

    /// What it follows is usual.
    pub(crate) fn learn(&mut self, step_s: f32) {
        self.learnt_s = (self.learnt_s + step_s).min(MEMORY_S);
        let weight = if self.learnt_s > step_s { step_s / self.learnt_s } else { 1.0 };
        let off = self.departed();
        self.mean += weight * off;
        self.spread += weight * (libm::fabsf(off) - self.spread);
    }

    /// Both at once, of a figure that is wrong where it is large: further above its usual range than `hold` it teaches nothing.
    pub(crate) fn take(&mut self, figure: f32, step_s: f32, smoothing_s: f32, hold: f32) {
        self.follow(figure, step_s, smoothing_s);
        let is_garbage = !(-FIGURE_MAX..=FIGURE_MAX).contains(&figure);
        if !is_garbage && self.beyond().is_none_or(|beyond| beyond <= hold) {
            self.learn(step_s);
        }
    }

    /// Whether its usual level is known.
    pub(crate) fn is_known(&self) -> bool {
        self.learnt_s >= KNOWN_S
    }

    /// How far the figure is from its usual level, with its sign.
    pub(crate) fn departed(&self) -> f32 {
        self.smooth - self.mean
    }

    /// How far the figure is above its usual range, 0 at least; `None` until that is known.
    pub(crate) fn beyond(&self) -> Option<f32> {
        let beyond = self.departed() - SPREADS * self.spread;
        self.is_known().then_some(beyond.max(0.0))
    }

    /// The same of a figure that is wrong either way.
    pub(crate) fn beyond_either_way(&self) -> Option<f32> {
        let beyond = libm::fabsf(self.departed()) - SPREADS * self.spread;
        self.is_known().then_some(beyond.max(0.0))
    }

    /// Its mean distance from its usual level.
    pub(crate) fn spread(&self) -> f32 {
        self.spread
    }

    /// The figure as it is followed.
    pub(crate) fn figure(&self) -> f32 {
        self.smooth
    }

    /// The figure as a multiple of what is usual, where it is beyond its usual range by more than `grain`; 1 where it is not.
    pub(crate) fn multiple(&self, grain: f32) -> Option<f32> {
        let beyond = self.beyond()?;
        Some(if beyond > grain { self.smooth / self.base(grain) } else { 1.0 })
    }

    /// From which figure on that is more than so many times; `None` until its usual level is known.
    pub(crate) fn limit(&self, times: f32, grain: f32) -> Option<f32> {
        let usual = self.mean + SPREADS * self.spread;
        self.is_known().then_some((times * self.base(grain)).max(usual + grain))
    }

    /// What multiples are of: a simulator's figure may be exactly 0.
    fn base(&self, grain: f32) -> f32 {
        self.mean.max(grain / 10.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_so_many_times_the_usual_one_from_its_limit_on() {
        let steady = taken((0..400).map(|_| 2.0));
        let limit = steady.limit(2.2, 0.5).expect("known");
        assert!((limit - 4.4).abs() < 0.1, "{limit}");
        assert!(steady.limit(2.2, 6.0).expect("known") > 7.5, "by less than the grain nothing rises");
        assert_eq!(taken((0..5).map(|_| 2.0)).limit(2.2, 0.5), None);
    }

    /// Takes figures ten times a second.
    fn taken(figures: impl Iterator<Item = f32>) -> Departure {
        let mut departure = Departure::NEW;
        figures.for_each(|figure| departure.take(figure, 0.1, 0.5, 1.0));
        departure
    }

    /// Up and down by one around a level.
    fn noise(level: f32, count: usize) -> impl Iterator<Item = f32> {
        (0..count).map(move |step| level + if step % 2 == 0 { 1.0 } else { -1.0 })
    }

    #[test]
    fn nothing_is_said_before_the_usual_level_is_known() {
        assert_eq!(taken(noise(5.0, 70)).beyond(), None);
        assert_eq!(taken(noise(5.0, 90)).beyond(), Some(0.0));
    }

    #[test]
    fn a_step_is_beyond_and_stays_so_and_does_not_become_usual() {
        let departed = taken(noise(5.0, 200).chain(noise(15.0, 3_000)));
        let beyond = departed.beyond().unwrap();
        assert!((8.0..10.0).contains(&beyond), "{beyond}");
        assert!(departed.multiple(1.0).is_some_and(|multiple| (2.5..3.5).contains(&multiple)));
        assert_eq!(taken(noise(5.0, 200)).multiple(1.0), Some(1.0));
    }

    #[test]
    fn what_is_so_from_the_beginning_and_what_changes_slowly_is_usual() {
        assert_eq!(taken(noise(50.0, 300)).beyond(), Some(0.0));
        let slowly = taken(noise(5.0, 200).chain((0..6_000).map(|step| 5.0 + step as f32 / 600.0)));
        assert_eq!(slowly.beyond(), Some(0.0));
    }

    #[test]
    fn a_figure_that_was_nothing_rises_by_a_number_of_times() {
        let risen = taken(core::iter::repeat_n(0.0, 200).chain([5.0; 20]));
        let multiple = risen.multiple(1.0).unwrap();
        assert!((10.0..100.0).contains(&multiple), "{multiple}");
        assert!(risen.limit(2.2, 1.0).is_some_and(|limit| limit <= 5.0));
    }

    #[test]
    fn a_figure_that_comes_round_is_as_far_as_the_short_way() {
        let mut turning = taken((0..200).map(|_| 10.0));
        for figure in (10..=370).step_by(2) {
            turning.follow(figure as f32, 1.0, 0.0);
            turning.wrap(360.0);
            assert!(turning.departed().abs() <= 181.0, "{figure}");
        }
        assert_eq!(turning.beyond_either_way(), Some(0.0));
    }

    #[test]
    fn garbage_changes_nothing() {
        assert_eq!(taken(core::iter::repeat_n(f32::NAN, 300)).beyond(), None);
        let departed =
            taken(noise(5.0, 200).chain([f32::NAN, f32::INFINITY, f32::MAX, -1.0]).chain(noise(5.0, 10)));
        assert_eq!(departed.beyond(), Some(0.0));
    }
}
