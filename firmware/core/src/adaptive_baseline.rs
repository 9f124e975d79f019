//! A smoothed figure and its baseline in this flight.
//!
//! The baseline is the mean of the smoothed figure over the last minute; its range is [`SPREADS`] times the mean distance from
//! that mean. The caller says which samples are learnt, so a fault does not become the baseline, and an offset from the
//! beginning of a flight does.

/// The baseline is known after so long, s, and looks back over so long.
const KNOWN_S: f32 = 8.0;
const MEMORY_S: f32 = 60.0;
const FIGURE_MAX: f32 = 1e6;
/// Of noise with a normal distribution four mean distances are 3.2 standard deviations.
const SPREADS: f32 = 4.0;

state! {
    pub(crate) struct AdaptiveBaseline {
        pub(crate) smooth: f32,
        mean: f32,
        /// The mean distance of the smoothed figure from its mean.
        pub(crate) spread: f32,
        learnt_s: f32,
    }
}

impl AdaptiveBaseline {
    pub(crate) fn zero() -> Self {
        Self { learnt_s: MEMORY_S, ..Self::default() }
    }

    /// Nothing learnt, also not in the first seconds given, in which the figure settles.
    pub(crate) fn after(settles_s: f32) -> Self {
        Self { learnt_s: -settles_s, ..Self::default() }
    }

    pub(crate) fn is_sane(sample: f32) -> bool {
        (-FIGURE_MAX..=FIGURE_MAX).contains(&sample)
    }

    /// Smooths a sane sample with this weight, without learning.
    pub(crate) fn follow(&mut self, sample: f32, weight: f32) {
        if self.learnt_s <= 0.0 {
            (self.smooth, self.mean) = (sample, sample);
        }
        self.smooth += weight * (sample - self.smooth);
    }

    pub(crate) fn wrap(&mut self, period: f32) {
        self.smooth -= period * libm::roundf(self.departed() / period);
    }

    /// Learns the smoothed figure, which held for this time.
    pub(crate) fn learn(&mut self, step_s: f32) {
        self.learnt_s = (self.learnt_s + step_s).min(MEMORY_S);
        let weight = if self.learnt_s > step_s { step_s / self.learnt_s } else { 1.0 };
        let off = self.departed();
        self.mean += weight * off;
        self.spread += weight * (libm::fabsf(off) - self.spread);
    }

    pub(crate) fn is_known(&self) -> bool {
        self.learnt_s >= KNOWN_S
    }

    pub(crate) fn departed(&self) -> f32 {
        self.smooth - self.mean
    }

    pub(crate) fn range(&self) -> f32 {
        SPREADS * self.spread
    }

    /// The figure as a multiple of its baseline if it is out of its range by more than `grain`; 1 otherwise.
    pub(crate) fn multiple(&self, grain: f32) -> Option<f32> {
        let is_risen = self.departed() - self.range() > grain;
        self.is_known().then(|| if is_risen { self.smooth / self.base(grain) } else { 1.0 })
    }

    /// The figure from which on it is more than this multiple; `None` until the baseline is known.
    pub(crate) fn limit(&self, times: f32, grain: f32) -> Option<f32> {
        let highest = self.mean + self.range() + grain;
        self.is_known().then_some((times * self.base(grain)).max(highest))
    }

    fn base(&self, grain: f32) -> f32 {
        self.mean.max(grain / 10.0)
    }
}
