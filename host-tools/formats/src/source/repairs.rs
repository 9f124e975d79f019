//! Repairs wrong reports of old autopilots.
//!
//! | report | by | repair |
//! |---|---|---|
//! | a vertical speed that is positive upwards | `ArduPilot` until about 2018 (Copter of 2013, 2016 and
//! 3.5.7, Plane 3.6.0) | its sign is changed, once it has the sign of the displayed climb |
//! | the attitude itself as the attitude setpoint | some logs | the setpoint is unknown, until it differs
//! from the attitude |

use std::collections::BTreeMap;

use hums_core::clock::{Instant, Span};
use hums_core::observation::{Attitude, AttitudeSetpoint, Autopilot, GlobalPosition, Observation, Source};
use hums_core::units::Radians;

/// Older values are not compared.
const FRESH: Span = Span::from_secs(1);
/// A setpoint that equals the attitude for this time while turning is none.
const LEADS_FOR: Span = Span::from_secs(5);
/// 0.6 degrees, which is more than rounding.
const COPY_RAD: f32 = 0.01;
/// rad/s: slower, the attitude lags by no more than [`COPY_RAD`], at 0.1 s and more.
const HOLDS_RADPS: f32 = 0.1;
/// m/s, from which the sign counts.
const MOVES_MPS: f32 = 0.5;
/// Votes for a sign, at most.
const SURE: i8 = 8;
const VOTES_MAX: i8 = 3 * SURE;
/// `ArduPilot`'s 4.0 counts down.
const COUNTS_DOWN_SINCE: u32 = 0x0400_0000;

/// State of each source.
#[derive(Debug, Default)]
pub struct Repairs(BTreeMap<(u8, u8), Teller>);

#[derive(Debug, Default)]
struct Teller {
    is_ardupilot: bool,
    firmware: Option<u32>,
    climb: Option<(Instant, f32)>,
    votes: i8,
    wanted: Option<(Instant, [f32; 2])>,
    led_at: Option<Instant>,
}

impl Repairs {
    /// The observation as it should have been reported.
    pub fn mend(&mut self, at: Instant, source: Source, observation: &Observation) -> Observation {
        let teller = self.0.entry((source.system, source.component)).or_default();
        match *observation {
            Observation::Heartbeat(heartbeat) => {
                teller.is_ardupilot = heartbeat.autopilot == Autopilot::ArduPilot;
            }
            Observation::Identity(identity) => teller.firmware = Some(identity.firmware),
            Observation::Hud(hud) => teller.climb = hud.climb.map(|climb| (at, climb.0)),
            Observation::GlobalPosition(global) => {
                return Observation::GlobalPosition(teller.mend_climb(at, global));
            }
            Observation::Attitude(attitude) => teller.note_lead(at, &attitude),
            Observation::AttitudeSetpoint(wanted) => {
                return Observation::AttitudeSetpoint(teller.mend_wanted(at, wanted));
            }
            _ => {}
        }
        *observation
    }
}

impl Teller {
    fn mend_climb(&mut self, at: Instant, mut global: GlobalPosition) -> GlobalPosition {
        let is_old = self.is_ardupilot && self.firmware.is_none_or(|firmware| firmware < COUNTS_DOWN_SINCE);
        let [.., down] = &mut global.velocity;
        let displayed = self.climb.filter(|(told_at, _)| at.since(*told_at) <= FRESH);
        if let Some((_, climb_mps)) = displayed
            && down.0.abs().min(climb_mps.abs()) > MOVES_MPS
            && (0.5..2.0).contains(&(climb_mps / down.0).abs())
        {
            let vote = if climb_mps * down.0 > 0.0 { 1 } else { -1 };
            self.votes = (self.votes + vote).clamp(-VOTES_MAX, VOTES_MAX);
        }
        if is_old && self.votes >= SURE {
            down.0 = -down.0;
        }
        global
    }

    fn note_lead(&mut self, at: Instant, attitude: &Attitude) {
        let Some((_, [roll, pitch])) = self.wanted.filter(|(told_at, _)| at.since(*told_at) <= LEADS_FOR)
        else {
            return;
        };
        let leads = (roll - attitude.roll.0).abs() > COPY_RAD || (pitch - attitude.pitch.0).abs() > COPY_RAD;
        let holds = attitude
            .rates
            .is_some_and(|[roll, pitch, _]| roll.0.abs() < HOLDS_RADPS && pitch.0.abs() < HOLDS_RADPS);
        if leads || holds && self.leads(at) {
            self.led_at = Some(at);
        }
    }

    fn leads(&self, now: Instant) -> bool {
        self.led_at.is_some_and(|at| now.since(at) <= LEADS_FOR)
    }

    fn mend_wanted(&mut self, at: Instant, wanted: AttitudeSetpoint) -> AttitudeSetpoint {
        self.wanted = Some((at, [wanted.roll.0, wanted.pitch.0]));
        let not_known = Radians(f32::NAN);
        if self.leads(at) { wanted } else { AttitudeSetpoint { roll: not_known, pitch: not_known, ..wanted } }
    }
}

#[cfg(test)]
mod tests {
    use hums_core::observation::{AutopilotIdentity, Heartbeat, Hud};
    use hums_core::units::{MetresPerSecond, RadiansPerSecond};

    use super::*;

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn down_of(firmware: (Autopilot, u32), positions: u64, down_mps: f32, climb_mps: f32) -> f32 {
        let (mut repairs, mut known) = (Repairs::default(), f32::NAN);
        let (autopilot, firmware) = firmware;
        let mut mend = |at, said| repairs.mend(at, AUTOPILOT, &said);
        mend(Instant::ZERO, Observation::Heartbeat(Heartbeat { autopilot, ..Heartbeat::default() }));
        mend(Instant::ZERO, Observation::Identity(AutopilotIdentity { firmware, uid: 0 }));
        for step in 0..positions {
            let now = Instant::from_millis(step * 250);
            mend(now, Observation::Hud(Hud { climb: Some(MetresPerSecond(climb_mps)), ..Hud::default() }));
            let velocity = [0.0, 0.0, down_mps].map(MetresPerSecond);
            let global = GlobalPosition { velocity, ..GlobalPosition::default() };
            if let Observation::GlobalPosition(global) = mend(now, Observation::GlobalPosition(global)) {
                known = global.velocity[2].0;
            }
        }
        known
    }

    #[test]
    fn a_vertical_speed_that_counts_up_is_known_by_the_displayed_climb() {
        let old = (Autopilot::ArduPilot, 0x0305_07FF);
        for (of, positions, down_mps, climb_mps, known) in [
            ((Autopilot::ArduPilot, 0x0400_00FF), 20, 3.0, 3.1, 3.0),
            ((Autopilot::Px4, 0), 20, 3.0, 3.1, 3.0),
            (old, 20, 3.0, 3.1, -3.0),
            (old, 20, -3.0, -2.5, 3.0),
            (old, 20, -3.0, 3.1, -3.0),
            (old, 5, 3.0, 3.1, 3.0),
            (old, 20, 8.0, 1.0, 8.0),
            (old, 20, 0.3, 0.3, 0.3),
        ] {
            let down = down_of(of, positions, down_mps, climb_mps);
            assert!((down - known).abs() < 1e-6, "{of:?}, {positions} of {down_mps} at {climb_mps}: {down}");
        }
    }

    #[test]
    fn a_wanted_attitude_counts_while_it_is_not_the_attitude_itself() {
        let (mut repairs, mut tenth) = (Repairs::default(), 0);
        // Difference, turn rate, tenths of a second, and whether the setpoint is known at the end.
        for (apart, rate, tenths, known) in [
            (0.0, 0.5, 100, false),
            (0.1, 0.5, 40, true),
            (0.0, 0.0, 200, true),
            (0.0, 0.5, 40, true),
            (0.0, 0.5, 40, false),
        ] {
            let mut is_known = !known;
            for _ in 0..tenths {
                tenth += 1;
                let now = Instant::from_millis(tenth * 100);
                let (roll, rates) = (Radians(0.3), Some([rate, 0.0, 0.0].map(RadiansPerSecond)));
                let attitude = Attitude { roll, rates, ..Attitude::default() };
                repairs.mend(now, AUTOPILOT, &Observation::Attitude(attitude));
                let wanted = AttitudeSetpoint { roll: Radians(0.3 + apart), ..AttitudeSetpoint::default() };
                let said = repairs.mend(now, AUTOPILOT, &Observation::AttitudeSetpoint(wanted));
                is_known = matches!(said, Observation::AttitudeSetpoint(wanted) if wanted.roll.0.is_finite());
            }
            assert_eq!(is_known, known, "{apart} rad at {rate} rad/s, up to {tenth}");
        }
    }
}
