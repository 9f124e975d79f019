//! The estimator that flies against the one beside it ([`SecondEstimate`]).
//!
//! An `ArduPilot` runs two: where an EKF flies, DCM stands by, which takes its attitude from gyros held by accelerometers, its height from the
//! barometer and its place from the receiver as they are (`AP_AHRS_DCM`). So a main estimator that leaves what its sensors say is seen, whatever
//! made it do so. Their headings come apart by 40 degrees where a healthy vehicle is yawed fast, and are not compared.
//!
//! DCM takes accelerations off by the receiver's velocity: without an exact receiver, and for [`LEVELS`] after it, nothing is compared. Even with one its attitude is off
//! by 20 degrees in hard manoeuvres. Heights have an offset, which is learnt ([`crate::departure`]).

use crate::departure::Departure;
use crate::flight::Flight;
use crate::latest::Reading;
use crate::motion::ground_speed_mps;
use crate::observation::{Gnss, SecondEstimate, VehicleKind};
use crate::steady::is_clear;
use crate::time::{Instant, Span, Stamp};
use crate::units::{Position, norm};
use crate::vehicle::Vehicle;

/// What is compared is of one moment.
const FRESH: Span = Span::from_millis(250);
/// Comparisons further apart are not of one course.
const PAUSE: Span = Span::from_secs(2);
/// Time constant, s.
const SMOOTHING_S: f32 = 0.5;
/// Of heights further apart than usual, m, nothing is learnt: half of the default limit.
const HEIGHT_HOLD_M: f32 = 4.0;
/// A receiver's place, and a message, are so old, s.
const LATE_S: f32 = 0.5;
const RECEIVER_AGE: Span = Span::from_secs(2);
/// DCM is level again so long after its receiver is back: `AHRS_RP_P` 0.2 makes a time constant of 5 s.
const LEVELS: Span = Span::from_secs(15);
/// `EKF_POS_HORIZ_ABS`
const POS_HORIZ_ABS: u16 = 16;
/// A degree of latitude, m.
const DEGREE_M: f64 = 111_320.0;
/// What is further is garbage, m.
const APART_MAX_M: f32 = 1e6;

/// The memory of the comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Second {
    at: Stamp,
    /// When the receiver was not exact last.
    inexact_at: Stamp,
    /// The angle between the two verticals, degrees, and how far the places are apart, m.
    tilt_deg: Option<f32>,
    apart_m: Option<f32>,
    height: Departure,
}

impl Second {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self {
        at: Stamp::NONE,
        inexact_at: Stamp::NONE,
        tilt_deg: None,
        apart_m: None,
        height: Departure::NEW,
    };

    pub(crate) fn take(&mut self, at: Instant, second: &SecondEstimate, vehicle: &Vehicle, flight: &Flight) {
        let receiver = &vehicle.gnss[0];
        let exact = receiver.within(at, RECEIVER_AGE).is_some_and(Gnss::is_exact);
        if !exact && receiver.get().is_some() {
            self.inexact_at = Stamp::at(at);
        }
        // A tail-sitter's attitude has other axes in one of the two.
        let judged = exact
            && matches!(vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Plane)
            && self.inexact_at.age(at).is_none_or(|age| age > LEVELS);
        if !judged || !flight.is_settled(at) || !is_clear(at, vehicle) {
            return;
        }
        let step_s = self.at.age(at).map_or(0.0, |step| step.min(PAUSE).as_secs_f32());
        self.at = Stamp::at(at);
        let weight = step_s / (SMOOTHING_S + step_s);
        let follow = |smooth: &mut Option<f32>, value: f32| {
            let smooth = smooth.get_or_insert(value);
            *smooth += weight * (value - *smooth);
        };
        if let (Some(attitude), Some([roll, pitch, _])) =
            (vehicle.attitude.within(at, FRESH), second.attitude)
        {
            let one = down([attitude.roll.0, attitude.pitch.0]);
            let other = down([roll.0, pitch.0]);
            let chord = norm([0, 1, 2].map(|axis| one[axis] - other[axis]));
            if chord.is_finite() {
                follow(&mut self.tilt_deg, (2.0 * libm::asinf((chord / 2.0).min(1.0))).to_degrees());
            }
        }
        let Some(global) = vehicle.global.within(at, FRESH) else { return };
        let apart_m = second.altitude.map(|altitude| global.altitude.0 - altitude.0);
        if let Some(apart_m) = apart_m.filter(|apart_m| libm::fabsf(*apart_m) <= APART_MAX_M) {
            self.height.follow(apart_m, step_s, SMOOTHING_S);
            if !self.height.is_known() || libm::fabsf(self.height.departed()) <= HEIGHT_HOLD_M {
                self.height.learn(step_s);
            }
        }
        // One that flies by optical flow has its place from elsewhere.
        let absolute = vehicle.estimator.get().is_none_or(|estimator| estimator.flags & POS_HORIZ_ABS != 0);
        if let (Some(one), Some(other), true) = (global.position, second.position, absolute) {
            let late_m = LATE_S * ground_speed_mps(at, vehicle).unwrap_or(0.0);
            let apart_m = (distance_m(one, other) - late_m).max(0.0);
            if apart_m <= APART_MAX_M {
                follow(&mut self.apart_m, apart_m);
            }
        }
    }

    fn reading(&self, now: Instant, value: Option<f32>) -> Option<Reading> {
        Reading::new(self.at.instant(now), value)
    }

    /// How far the two verticals are apart, degrees.
    pub(crate) fn tilt(&self, now: Instant) -> Option<Reading> {
        self.reading(now, self.tilt_deg)
    }

    /// How far the two heights are apart beyond what is usual, m.
    pub(crate) fn height(&self, now: Instant) -> Option<Reading> {
        self.reading(now, self.height.is_known().then(|| libm::fabsf(self.height.departed())))
    }

    /// How far the two places are apart, m.
    pub(crate) fn place(&self, now: Instant) -> Option<Reading> {
        self.reading(now, self.apart_m)
    }
}

/// Where down is, in the body's axes.
fn down([roll, pitch]: [f32; 2]) -> [f32; 3] {
    let level = libm::cosf(pitch);
    [-libm::sinf(pitch), libm::sinf(roll) * level, libm::cosf(roll) * level]
}

fn distance_m(one: Position, other: Position) -> f32 {
    let north_m = ((one.latitude_deg - other.latitude_deg) * DEGREE_M) as f32;
    let turns_deg = one.longitude_deg - other.longitude_deg;
    let east_m = (turns_deg * DEGREE_M) as f32 * libm::cosf((one.latitude_deg as f32).to_radians());
    libm::sqrtf(north_m * north_m + east_m * east_m)
}
