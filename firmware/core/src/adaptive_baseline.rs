//! A smoothed figure and its baseline in this flight.
//!
//! The baseline is the mean of the smoothed figure over the last minute; its range is [`SPREADS`] times the mean distance from that mean.
//! The caller says which samples are learnt. So a fault does not become the baseline, and an offset from the beginning of a flight does.

/// The baseline is known after so long, s, and looks back over so long.
const KNOWN_S: f32 = 8.0;
const MEMORY_S: f32 = 60.0;
/// What is more is garbage.
const FIGURE_MAX: f32 = 1e6;
/// Of noise with a normal distribution four mean distances are 3.2 standard deviations.
const SPREADS: f32 = 4.0;

/// A figure, and what is usual of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdaptiveBaseline {
    smooth: f32,
    mean: f32,
    spread: f32,
    learnt_s: f32,
}

impl AdaptiveBaseline {
    /// Nothing learnt.
    pub(crate) const NEW: Self = Self::after(0.0);

    /// It is known to be zero.
    pub(crate) const ZERO: Self = Self { learnt_s: MEMORY_S, ..Self::NEW };

    /// Nothing learnt, and nothing to be for so long, s: the figure has to settle first.
    pub(crate) const fn after(settles_s: f32) -> Self {
        Self { smooth: 0.0, mean: 0.0, spread: 0.0, learnt_s: -settles_s }
    }

    /// Whether a sample is no garbage.
    pub(crate) fn is_sane(sample: f32) -> bool {
        (-FIGURE_MAX..=FIGURE_MAX).contains(&sample)
    }

    /// Smooths a sane sample that counts so much; learns nothing.
    pub(crate) fn follow(&mut self, sample: f32, weight: f32) {
        if self.learnt_s <= 0.0 {
            (self.smooth, self.mean) = (sample, sample);
        }
        self.smooth += weight * (sample - self.smooth);
    }

    /// Takes what comes round after a period to the side of its baseline.
    pub(crate) fn wrap(&mut self, period: f32) {
        self.smooth -= period * libm::roundf(self.departed() / period);
    }

    /// Learns the smoothed figure, which lasted for so long.
    pub(crate) fn learn(&mut self, step_s: f32) {
        self.learnt_s = (self.learnt_s + step_s).min(MEMORY_S);
        let weight = if self.learnt_s > step_s { step_s / self.learnt_s } else { 1.0 };
        let off = self.departed();
        self.mean += weight * off;
        self.spread += weight * (libm::fabsf(off) - self.spread);
    }

    /// Whether the baseline is known.
    pub(crate) fn is_known(&self) -> bool {
        self.learnt_s >= KNOWN_S
    }

    /// How far the figure is from its baseline, with its sign.
    pub(crate) fn departed(&self) -> f32 {
        self.smooth - self.mean
    }

    /// How far the figure goes from its baseline by itself.
    pub(crate) fn range(&self) -> f32 {
        SPREADS * self.spread
    }

    /// Its mean distance from its baseline.
    pub(crate) fn spread(&self) -> f32 {
        self.spread
    }

    /// The smoothed figure.
    pub(crate) fn figure(&self) -> f32 {
        self.smooth
    }

    /// The figure as a multiple of its baseline, where it is beyond its range by more than `grain`; 1 where it is not.
    pub(crate) fn multiple(&self, grain: f32) -> Option<f32> {
        let is_risen = self.departed() - self.range() > grain;
        self.is_known().then(|| if is_risen { self.smooth / self.base(grain) } else { 1.0 })
    }

    /// From which figure on that is more than so many times; `None` until the baseline is known.
    pub(crate) fn limit(&self, times: f32, grain: f32) -> Option<f32> {
        let highest = self.mean + self.range() + grain;
        self.is_known().then_some((times * self.base(grain)).max(highest))
    }

    /// What multiples are of: a simulator's figure may be exactly 0.
    fn base(&self, grain: f32) -> f32 {
        self.mean.max(grain / 10.0)
    }
}
