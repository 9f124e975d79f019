//! The residual engine: the difference between a measured figure and its reference, against its baseline in this
//! flight.
//!
//! 1. A sample counts while all gates of its [`Row`] are open.
//! 2. One sample moves the residual by `clamp` at most, so that one wrong message raises no alarm.
//! 3. The residual is smoothed. An allowance (delay, scale, wind) is smoothed with it and taken off.
//! 4. Its baseline is the mean of the last minute ([`crate::adaptive_baseline`]). A residual further out than `hold`
//!    teaches nothing.
//! 5. The reported value is the excess over the baseline. It is as old as the sample.
//!
//! | comparison | reference | measured | unit |
//! |---|---|---|---|
//! | [`Comparison::MagHeading`] | the estimator's yaw | heading of the first compass | deg |
//! | [`Comparison::BaroGnss`] | height of GNSS | height of the first barometer | m |
//! | [`Comparison::BaroNoise`] | climb | step of the barometer's height | m |
//! | [`Comparison::BaroClimb`] | climb of the barometer | climb of `VFR_HUD` | m/s |
//! | [`Comparison::Ahrs2Tilt`] | DCM | the estimator's vertical | deg |
//! | [`Comparison::Ahrs2Height`], [`Comparison::Ahrs2Position`] | DCM | the estimator's place | m |
//! | [`Comparison::SATELLITES`], [`Comparison::HDOP`] | their baseline | of each receiver | logarithm |
//! | [`Comparison::Vibration`], [`Comparison::VibrationPx4`] | their baseline | `VIBRATION` | m/s2 |
//! | [`Comparison::RATES`] | setpoint | body rate, roll and pitch | rad/s |
//! | [`PAIRS`] | one sensor | another one of its kind | [`crate::pairs::Kind`] |

use crate::adaptive_baseline::AdaptiveBaseline;
use crate::gates::{self, Gates};
use crate::latest::Reading;
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::vehicle::RECEIVERS_MAX;

/// Delay of one message, or of one of a receiver's figures, against another, s.
pub(crate) const LATE_S: f32 = 0.3;
/// Time over which a receiver's position and height are compared with its speed and the climb, s.
pub(crate) const RECEIVER_S: f32 = 4.0;

/// Values of one moment: messages at 4 Hz, with their jitter.
pub(crate) const AT_ONCE: Millis = Millis::from_millis(300);
/// Samples of a flight before anything is usual, or a lack of them says something.
pub(crate) const KNOWN_SAMPLES: u8 = 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Learn {
    /// Zero, for good.
    Nothing,
    /// Its mean: a slow drift would widen its range as it goes.
    Level,
    Range,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    gates: u16,
    /// Time constant, s; not zero.
    smoothing_s: f32,
    /// A longer step counts as this; it teaches twice as much.
    step_max: Millis,
    clamp: f32,
    /// Period of a circular residual; 0 for others.
    period: f32,
    /// A residual on either side of its baseline counts, not only above it.
    is_two_sided: bool,
    learn: Learn,
    /// Half of the check's default limit.
    pub(crate) hold: f32,
}

const ROW: Row = Row {
    gates: gates::SETTLED,
    smoothing_s: 0.5,
    step_max: PAUSE,
    clamp: f32::INFINITY,
    period: 0.0,
    is_two_sided: false,
    learn: Learn::Range,
    hold: f32::INFINITY,
};

const AHRS2: Row = Row {
    gates: gates::SETTLED | gates::CLEAR | gates::ONE_FRAME | gates::EXACT,
    learn: Learn::Nothing,
    ..ROW
};
/// A part of the satellites is lost, or the dilution has grown, by more than the logarithm of 1.2.
const CONSTELLATION: Row = Row { gates: gates::AIRBORNE, learn: Learn::Level, hold: 0.182, ..ROW };
/// The lower of two messages. The hold is the least rise, m/s2.
const VIBRATION: Row =
    Row { gates: gates::SETTLED | gates::CLEAR | gates::ROTORS, smoothing_s: 0.25, hold: 2.5, ..ROW };
const RATE: Row = Row {
    gates: gates::SETTLED | gates::CLEAR | gates::CONTROLLED | gates::DRIVEN,
    smoothing_s: 1.0,
    step_max: Millis::from_millis(500),
    is_two_sided: true,
    learn: Learn::Nothing,
    ..ROW
};

/// The height of two sources, with an offset that is learnt.
const HEIGHT: Row = Row { is_two_sided: true, learn: Learn::Level, hold: 4.0, ..AHRS2 };

/// Each comparison with its row.
macro_rules! comparisons {
    ($($name:ident $row:expr;)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Comparison { $($name,)* }

        static ROWS: [Row; [$(Comparison::$name),*].len()] = [$($row),*];
    };
}

comparisons! {
    MagHeading Row {
        gates: gates::SETTLED | gates::CLEAR | gates::ONE_FRAME,
        // A stream that is slower than 4 Hz is smoothed over as many samples.
        step_max: Millis::from_millis(250),
        clamp: 30.0,
        period: 360.0,
        is_two_sided: true,
        hold: 6.0,
        ..ROW
    };
    BaroGnss Row { gates: gates::AIRBORNE | gates::CLEAR, ..HEIGHT };
    BaroNoise Row { gates: gates::SETTLED | gates::CLEAR | gates::STILL, hold: 1.0, ..ROW };
    BaroClimb Row { gates: gates::SETTLED | gates::HOVERS, ..RATE };
    Ahrs2Tilt AHRS2;
    Ahrs2Height HEIGHT;
    Ahrs2Position AHRS2;
    Satellites0 CONSTELLATION;
    Satellites1 CONSTELLATION;
    Hdop0 CONSTELLATION;
    Hdop1 CONSTELLATION;
    Vibration VIBRATION;
    VibrationPx4 Row { hold: 1.0, ..VIBRATION };
    RollRate RATE;
    PitchRate RATE;
}

impl Comparison {
    pub(crate) const SATELLITES: [Self; RECEIVERS_MAX] = [Self::Satellites0, Self::Satellites1];
    pub(crate) const HDOP: [Self; RECEIVERS_MAX] = [Self::Hdop0, Self::Hdop1];
    pub(crate) const RATES: [Self; 2] = [Self::RollRate, Self::PitchRate];

    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }
}

/// Pairs of sensors, by kind: the length of their difference. Motors shake accelerometers most. On wings a turn
/// carries more than the weight. At a touchdown the legs shake one accelerometer more than the other.
pub(crate) const PAIRS: [Row; 4] = {
    const PAIR: Row = Row {
        gates: gates::SETTLED | gates::ONE_FRAME | gates::STILL,
        step_max: Millis::from_millis(250),
        hold: 4.0,
        ..ROW
    };
    [
        Row { gates: PAIR.gates | gates::ROTORS | gates::CLEAR, hold: 0.5, ..PAIR },
        // Noisy gyros turn fast by themselves.
        Row { gates: gates::SETTLED | gates::ONE_FRAME, smoothing_s: 0.25, hold: 0.05, ..PAIR },
        Row { smoothing_s: 0.25, hold: 20.0, ..PAIR },
        PAIR,
    ]
};

impl Row {
    pub(crate) const fn is_open(&self, gates: Gates) -> bool {
        gates.are(self.gates)
    }

    pub(crate) fn weight(&self, step: Millis) -> f32 {
        let step_s = step.min(self.step_max).as_secs_f32();
        step_s / (self.smoothing_s + step_s)
    }
}

pub(crate) fn smooth<const N: usize>(figure: &mut [f32; N], sample: [f32; N], weight: f32, clamp: f32) {
    for (figure, sample) in figure.iter_mut().zip(sample) {
        *figure += (weight * (sample - *figure)).clamp(-clamp, clamp);
    }
}

state! {
    pub(crate) struct Residual {
        pub(crate) at: Stamp,
        allowance: f32,
        figure: AdaptiveBaseline,
    }
}

impl Residual {
    /// A residual of many samples: it settles for this time, s, before it is learnt.
    pub(crate) fn after(settles_s: f32) -> Self {
        Self { figure: AdaptiveBaseline::after(settles_s), ..Self::default() }
    }

    /// Takes a sample; returns the learnt part, s.
    pub(crate) fn take(&mut self, row: &Row, at: BootMs, sample: f32, allowance: f32) -> f32 {
        if !AdaptiveBaseline::is_sane(sample) || !allowance.is_finite() {
            return 0.0;
        }
        let step = self.at.age(at);
        if row.learn == Learn::Nothing && step.is_none_or(|step| step > PAUSE) {
            *self = Self { figure: AdaptiveBaseline::zero(), ..Self::default() };
        }
        let clamp = if self.at.is_set() { row.clamp } else { f32::INFINITY };
        let step = step.filter(|_| self.at.is_set()).unwrap_or(Millis::ZERO);
        let weight = row.weight(step);
        self.at = Stamp::at(at);
        self.allowance += weight * (allowance - self.allowance);
        let before = self.figure.smooth;
        let off = sample - before;
        let turns = if row.period > 0.0 { libm::roundf(off / row.period) } else { 0.0 };
        self.figure.follow(before + (off - row.period * turns).clamp(-clamp, clamp), weight);
        if row.period > 0.0 {
            self.figure.wrap(row.period);
        }
        if row.learn == Learn::Nothing || self.excess(row).is_some_and(|excess| excess > row.hold) {
            return 0.0;
        }
        let learnt_s = step.min(row.step_max + row.step_max).as_secs_f32();
        self.figure.learn(learnt_s);
        learnt_s
    }

    /// The residual beyond its baseline, 0 at least; `None` until that is known.
    pub(crate) fn excess(&self, row: &Row) -> Option<f32> {
        let off = self.figure.departed();
        let off = if row.is_two_sided { libm::fabsf(off) } else { off };
        let range = if row.learn == Learn::Range { self.figure.range() } else { 0.0 };
        self.figure.is_known().then(|| (off - range - self.allowance).max(0.0))
    }
}

state! {
    pub(crate) struct Residuals {
        pub(crate) gates: Gates,
        each: [Residual; ROWS.len()] = [Residual::default(); ROWS.len()],
    }
}

impl Residuals {
    /// Whether a sample counts now, and the last one is old enough.
    pub(crate) fn is_due(&self, of: Comparison, at: BootMs, every: Millis) -> bool {
        of.row().is_open(self.gates) && self.each[of as usize].at.age(at).is_none_or(|age| age >= every)
    }

    /// Takes a sample if its gates are open; returns the learnt part, s.
    pub(crate) fn take(&mut self, of: Comparison, at: BootMs, sample: f32, allowance: f32) -> f32 {
        let row = of.row();
        if row.is_open(self.gates) { self.each[of as usize].take(row, at, sample, allowance) } else { 0.0 }
    }

    pub(crate) fn excess(&self, of: Comparison) -> Option<f32> {
        self.each[of as usize].excess(of.row())
    }

    pub(crate) fn reading(&self, now: BootMs, of: Comparison) -> Option<Reading> {
        self.as_measured(now, of, self.excess(of))
    }

    fn as_measured(&self, now: BootMs, of: Comparison, value: Option<f32>) -> Option<Reading> {
        Reading::new(self.each[of as usize].at.instant(now), value)
    }

    /// The figure as a multiple of its baseline, if it exceeds it by more than its hold; 1 otherwise.
    pub(crate) fn multiple(&self, now: BootMs, of: Comparison) -> Option<Reading> {
        let multiple = self.each[of as usize].figure.multiple(of.row().hold);
        self.as_measured(now, of, multiple)
    }

    pub(crate) fn limit(&self, of: Comparison, times: f32) -> Option<f32> {
        self.each[of as usize].figure.limit(times, of.row().hold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ABOVE: Row = Row { hold: 1.0, ..ROW };
    const EITHER: Row = Row { is_two_sided: true, ..ABOVE };

    fn taken(row: &Row, figures: impl Iterator<Item = f32>) -> Residual {
        let mut residual = Residual::default();
        for (tenth, figure) in (0..).zip(figures) {
            residual.take(row, BootMs::from_millis(tenth * 100), figure, 0.0);
        }
        residual
    }

    fn excess(figures: impl Iterator<Item = f32>) -> Option<f32> {
        taken(&ABOVE, figures).excess(&ABOVE)
    }

    fn noise(level: f32, count: usize) -> impl Iterator<Item = f32> {
        (0..count).map(move |step| level + if step % 2 == 0 { 1.0 } else { -1.0 })
    }

    #[test]
    fn the_baseline_is_known_after_eight_seconds_and_follows_what_is_slow_or_was_so_from_the_beginning() {
        let slowly = noise(5.0, 200).chain((0..6_000).map(|step| 5.0 + step as f32 / 600.0));
        let garbage = [f32::NAN, f32::INFINITY, f32::MAX, -1.0];
        assert_eq!(excess(noise(5.0, 70)), None);
        assert_eq!(excess(noise(5.0, 90)), Some(0.0));
        assert_eq!(excess(noise(50.0, 300)), Some(0.0));
        assert_eq!(excess(slowly), Some(0.0));
        assert_eq!(excess(core::iter::repeat_n(f32::NAN, 300)), None);
        assert_eq!(excess(noise(5.0, 200).chain(garbage).chain(noise(5.0, 10))), Some(0.0));
    }

    #[test]
    fn a_step_is_beyond_the_baseline_for_good_and_a_multiple_of_it() {
        let stepped = taken(&ABOVE, noise(5.0, 200).chain(noise(15.0, 3_000)));
        assert!(stepped.excess(&ABOVE).is_some_and(|excess| (8.0..10.0).contains(&excess)));
        let multiple = |figures: &mut dyn Iterator<Item = f32>| taken(&ABOVE, figures).figure.multiple(1.0);
        assert!(stepped.figure.multiple(1.0).is_some_and(|multiple| (2.5..3.5).contains(&multiple)));
        assert_eq!(multiple(&mut noise(5.0, 200)), Some(1.0));
        let from_nothing = multiple(&mut core::iter::repeat_n(0.0, 200).chain([5.0; 20]));
        assert!(from_nothing.is_some_and(|multiple| (10.0..100.0).contains(&multiple)), "{from_nothing:?}");
    }

    #[test]
    fn a_figure_is_so_many_times_its_baseline_from_its_limit_on() {
        let limit = |figure: f32, count: usize, grain: f32| {
            taken(&ABOVE, core::iter::repeat_n(figure, count)).figure.limit(2.2, grain)
        };
        assert!(limit(2.0, 400, 0.5).is_some_and(|limit| (limit - 4.4).abs() < 0.1));
        assert!(
            limit(2.0, 400, 6.0).is_some_and(|limit| limit > 7.5),
            "by less than the grain nothing rises"
        );
        assert!(limit(0.0, 200, 1.0).is_some_and(|limit| limit <= 5.0));
        assert_eq!(limit(2.0, 5, 0.5), None);
    }

    #[test]
    fn a_residual_that_comes_round_is_as_far_as_the_short_way() {
        let row = Row { period: 360.0, smoothing_s: 1e-4, ..EITHER };
        let turns = core::iter::repeat_n(10.0, 200).chain((10..=370).map(|degrees| degrees as f32));
        for degrees in 1..=360 {
            let turned = taken(&row, turns.clone().take(200 + degrees));
            assert!(turned.excess(&row).is_some_and(|excess| excess <= 181.0), "{degrees}");
        }
        assert!(taken(&row, turns).excess(&row).is_some_and(|excess| excess < 0.1));
    }

    #[test]
    fn one_sample_moves_it_by_the_clamp_and_an_allowance_is_taken_off() {
        let row = Row { clamp: 4.0, smoothing_s: 1e-4, hold: 0.5, ..EITHER };
        let leapt = taken(&row, core::iter::repeat_n(0.0, 200).chain([1_000.0]));
        assert!(leapt.excess(&row).is_some_and(|excess| (3.9..=4.0).contains(&excess)));
        let mut allowed = taken(&row, core::iter::repeat_n(0.0, 200));
        allowed.take(&row, BootMs::from_millis(20_100), -4.0, 3.0);
        assert!(allowed.excess(&row).is_some_and(|excess| (0.9..=1.1).contains(&excess)));
    }

    #[test]
    fn without_a_baseline_it_begins_at_zero_after_a_hole_too() {
        let row = Row { learn: Learn::Nothing, ..EITHER };
        let mut residual = taken(&row, core::iter::repeat_n(9.0, 100));
        assert!(residual.excess(&row).is_some_and(|excess| excess > 8.9));
        residual.take(&row, BootMs::from_millis(15_000), 9.0, 0.0);
        assert_eq!(residual.excess(&row), Some(0.0));
    }
}
