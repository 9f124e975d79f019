//! Outputs of the autopilot to each motor of a multicopter, against the others. A motor with too little thrust shows
//! there, without any telemetry of its ESC.
//!
//! Control keeps the sum of thrust, roll, pitch and yaw. So if one motor is weak, its command rises until the sums
//! are as before: commands change by the projection of that motor on the four. Of four motors that is the weak one's
//! command alone. Of six it is 2/3 of the loss at the weak motor, 1/6 at four others and -1/3 at the opposite one. A
//! load, a tilt or a turn changes commands in pairs: as much down on one side as up on the other. The measure is
//! therefore the distance of the highest change from the second, less the distance of the others from each other. Of
//! four motors these are all others, of six all but the lowest. Of six it is half of the loss, and counts twice. It
//! is in percent of the mean command, smoothed, and against the usual value of this flight
//! ([`crate::adaptive_baseline`]), less the usual variation of commands. (Derived from the geometry of regular
//! frames, for this project.)
//!
//! Of eight motors, flat or two on each of four arms, it is 1/2 of the loss at the weak motor, at most a quarter at
//! three others, and less at the rest. So the second to the fourth are apart by as little as noise, and the weak
//! motor alone is a quarter of the loss above them. (Flat: a fifth, less the gap of the fourth.) A tilt of such a
//! vehicle raises two or three alike. It counts five times.
//!
//! A slightly weak motor stands out little, but goes on doing so. So what a motor stands out by beyond [`DRIFT_PERCENT`] is
//! summed over time, and what falls short of that is taken off again (a CUSUM: E. S. Page, Continuous inspection schemes,
//! Biometrika 41, 1954). The sum of [`SUMMED_S`] seconds counts as what stands out at once.
//!
//! A motor that alone is at the end of its range while no other one is near it gives less than is asked of it,
//! however the vehicle falls.
//!
//! A motor that is given next to nothing while the others carry the vehicle was taken out.
//!
//! Outputs are pulses of 1000 to 2000 us, or `PX4`'s numbers for its drivers: 0 to 1999 for `DShot`, 0 to 8191 for
//! ESCs on CAN (`DShot.h`, `actuators/esc.hpp`; `SERVO_OUTPUT_RAW` has `actuator_outputs` as they are). What they are
//! of is seen on the ground, and each becomes a part of its range.
//!
//! Other frames are not judged: three motors have no such pattern, and of three arms with two motors each none stands
//! out.

use core::ops::RangeInclusive;

use crate::adaptive_baseline::AdaptiveBaseline;
use crate::figures::OUTPUTS_MAX;
use crate::flight::Flight;
use crate::motion::{IDLE_THROTTLE, OFF};
use crate::observation::{MOTORS_MAX, Outputs};
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::vehicle::Vehicle;

pub(crate) const JUDGED_MAX: usize = 8;
/// Time constant of the commands, s: gusts and corrections of course that last longer are in what commands vary by ([`SPREADS`]).
const SMOOTHING_S: f32 = 2.0;
/// What motors are given is a part of their range. One that does not turn is given no more than this.
const IDLE: f32 = 0.15;
/// Parts of the mean command of the others. An output that idled on the ground and has such a command in level flight is a
/// motor too.
const LIKE_OTHERS: RangeInclusive<f32> = 0.5..=1.5;
/// Numbers for `DShot` that were not seen on the ground look like pulses: a motor among such is given less of both.
const SURELY_CARRIES: f32 = 0.3;
/// Further above the others a change teaches nothing, percent.
const HOLD_PERCENT: f32 = 4.0;
/// Where commands vary much, a change must be larger: by this many of their mean distances from the usual value.
const SPREADS: f32 = 3.0;
/// A third of the excess of a motor that gives 85 % of its command, percent: no healthy one reaches it on the
/// average.
const DRIFT_PERCENT: f32 = 3.0;
/// An excess for this long, s, counts in full.
const SUMMED_S: f32 = 6.0;
/// No sum is worth more, percent: what ends is over soon.
const SUM_MAX_PERCENT: f32 = 12.0;
/// Below this part of the average, percent, a motor was shut off.
const SHUT_OFF_SHARE: f32 = -70.0;
/// A motor at the end of its range stands out by so much, percent, and none by more.
const SATURATED_PERCENT: f32 = 100.0;
/// Outputs end here or beyond: `MOT_PWM_MAX` of ArduPilot is 1950 us, `PWM_MAIN_MAX` of PX4 2000.
const FULL: f32 = 0.94;
/// Two thirds of the range: an output above it shares the load with one at the end, as in a turn or a climb.
const SHARES: f32 = 0.667;
/// 30 degrees a second: a pilot yaws faster, and gusts do not turn a vehicle so fast for long.
const YAWS_RAD_S: f32 = 0.5;
/// A motor's command varies by more than this in flight; a servo that holds its place, as a landing gear's, does not.
const MOVES: f32 = 0.02;
/// A state without an observed beginning counts after this time.
const LASTS: Millis = Millis::from_secs(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Range {
    /// Pulses of 1000 to 2000 us.
    Pulses,
    /// Numbers for `DShot`.
    DShot,
    /// Numbers for ESCs on CAN.
    Can,
}

impl Range {
    /// Pulses are as long as this, us.
    const PULSES_US: RangeInclusive<u16> = 500..=2_500;

    /// What these show it to be: it begins at nothing where all that are given next to nothing on the ground say so.
    fn seen(self, outputs: &[u16], on_ground: bool) -> Self {
        let used = || outputs.iter().filter(|output| **output > 0);
        let begins = || used().count() > 1 && used().all(|output| *output < *Self::PULSES_US.start());
        match self {
            Self::Pulses if on_ground && begins() => Self::DShot,
            Self::DShot if outputs.iter().any(|output| *output > *Self::PULSES_US.end()) => Self::Can,
            known => known,
        }
    }

    fn part(self, output: u16) -> f32 {
        // Dividing is dear.
        let (zero, of_whole) = match self {
            Self::Pulses => (1_000, 1.0 / 1_000.0),
            Self::DShot => (0, 1.0 / 1_999.0),
            Self::Can => (0, 1.0 / 8_191.0),
        };
        f32::from(output.saturating_sub(zero)) * of_whole
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// Nothing that counts.
    Ok,
    /// It gives less thrust than it should: its command stands out by so much, percent of the average.
    Weak(f32),
    Saturated,
    ShutOff,
}

impl Verdict {
    pub(crate) fn excess_percent(self) -> f32 {
        match self {
            Self::Ok | Self::ShutOff => 0.0,
            Self::Weak(percent) => percent.clamp(0.0, SATURATED_PERCENT),
            Self::Saturated => SATURATED_PERCENT,
        }
    }
}

state! {
    struct Output {
        /// Command against the average of all, percent.
        share: AdaptiveBaseline,
        /// It was given as little on the ground as a motor that does not turn.
        idles: bool,
        carried: bool,
        off: bool,
        full: bool,
        /// Without a received take-off: the first output, and whether it moved since.
        first: u16,
        moved: bool,
    }

    pub(crate) struct MotorOutputs {
        port: Option<u8>,
        /// How many motors there are in this flight; 0 before it is known.
        count: u8,
        range: Range = Range::Pulses,
        outputs: [Output; JUDGED_MAX] = [Output::default(); JUDGED_MAX],
        pub(crate) at: Stamp,
        /// The motor that has stood out over time, and by how much, percent for [`SUMMED_S`].
        summed: (u8, f32),
        /// The judged motor and its verdict; all others are good.
        verdict: (u8, Verdict) = (0, Verdict::Ok),
        /// The take-off was not received; since when one output alone is at an end of its range then.
        takeoff_not_recorded: bool,
        at_end_since: Stamp,
    }
}

impl MotorOutputs {
    pub(crate) fn begin(&mut self) {
        let Self { port, range, outputs, .. } = *self;
        let outputs =
            outputs.map(|Output { idles, carried, .. }| Output { idles, carried, ..Output::default() });
        *self = Self { port, range, outputs, ..Self::default() };
    }

    pub(crate) fn take(
        &mut self,
        at: BootMs,
        outputs: &Outputs,
        vehicle: &Vehicle,
        flight: &Flight,
        flies_level: bool,
    ) {
        let told = motors(vehicle);
        if !outputs.pulses.iter().take(told).any(|pulse| *pulse > 0)
            || *self.port.get_or_insert(outputs.port) != outputs.port
        {
            return;
        }
        let Some((outputs, _)) = outputs.pulses.split_first_chunk::<JUDGED_MAX>() else { return };
        // `ArduPilot` sends pulses, whatever its drivers make of them.
        let drivers = outputs.get(..told).filter(|_| !vehicle.is_ardupilot()).unwrap_or_default();
        self.range = self.range.seen(drivers, !flight.airborne());
        let parts = outputs.map(|output| self.range.part(output));
        if !flight.airborne() {
            self.note_idle(outputs, &parts, vehicle.armed());
            return;
        }
        self.note_ends(&parts);
        let count = self.judged(vehicle);
        let Some(given) = parts.get(..count) else { return };
        let has_idled = self.outputs.iter().any(|output| output.idles);
        self.takeoff_not_recorded = !has_idled || !flight.was_on_ground();
        // An output that does not idle on the ground is a servo's.
        if !self.outputs.iter().take(count).all(|output| output.idles) {
            if self.takeoff_not_recorded {
                self.at = Stamp::at(at);
                self.note_moved(outputs);
                let used = count > 4 && outputs.iter().take(count).all(|output| *output > 0);
                self.verdict = self.judge_unseen(at, given, used, flies_level);
            }
            return;
        }
        if let Some(place) = saturated_alone(given) {
            (self.at, self.verdict) = (Stamp::at(at), (place, Verdict::Saturated));
            return;
        }
        if self.verdict.1 == Verdict::Saturated {
            (self.at, self.verdict.1) = (Stamp::at(at), Verdict::Ok);
        }
        let mean = given.iter().sum::<f32>() / count as f32;
        if !flies_level || yaws(vehicle) || mean < IDLE_THROTTLE || !self.is_of_frame(&parts, mean, count) {
            return;
        }
        let step_s = self.at.age(at).filter(|step| *step <= PAUSE).map_or(0.0, Millis::as_secs_f32);
        self.at = Stamp::at(at);
        for (output, given) in self.outputs.iter_mut().zip(given) {
            output.share.follow(given / mean * 100.0 - 100.0, step_s / (SMOOTHING_S + step_s));
        }
        self.judge(count, step_s);
    }

    fn is_of_frame(&mut self, parts: &[f32; JUDGED_MAX], mean: f32, count: usize) -> bool {
        if self.count == 0 {
            let is_like =
                |(output, given): &(&Output, &f32)| output.idles && LIKE_OTHERS.contains(&(*given / mean));
            let motors = self.outputs.iter().zip(parts).take_while(is_like).count();
            self.count = if matches!(motors, 6 | JUDGED_MAX) { motors.max(count) } else { count } as u8;
        }
        usize::from(self.count) == count
    }

    fn judge_unseen(&mut self, at: BootMs, given: &[f32], used: bool, flies_level: bool) -> (u8, Verdict) {
        let (place, verdict) = self.verdict;
        // The one opposite may idle then.
        if verdict == Verdict::ShutOff && given.get(usize::from(place)).is_some_and(is_off) {
            return self.verdict;
        }
        // An output of nothing is not used.
        let shut_off = only(given, is_off, |given| *given > SURELY_CARRIES).filter(|_| used);
        let at_end = shut_off.map(|place| (place, Verdict::ShutOff));
        let at_end = at_end.or_else(|| Some((saturated_alone(given)?, Verdict::Saturated)));
        let others_moved = |place: u8| {
            let outputs = (0..).zip(&self.outputs).take(given.len());
            outputs.into_iter().all(|(other, output)| other == place || output.moved)
        };
        let at_end = at_end.filter(|(place, _)| flies_level && others_moved(*place));
        let lasts = self.at_end_since.run(at_end.is_some(), at, LASTS);
        at_end.filter(|_| lasts).unwrap_or((0, Verdict::Ok))
    }

    fn note_moved(&mut self, outputs: &[u16; JUDGED_MAX]) {
        for (output, now) in self.outputs.iter_mut().zip(outputs) {
            if output.first == 0 {
                output.first = *now;
            }
            output.moved |= (self.range.part(*now) - self.range.part(output.first)).abs() > MOVES;
        }
    }

    /// Without a received take-off the motor's earlier speed is unknown.
    pub(crate) fn was_found_at_end(&self, motor: u8) -> bool {
        self.takeoff_not_recorded
            && self.verdict.0 == motor
            && matches!(self.verdict.1, Verdict::Saturated | Verdict::ShutOff)
    }

    fn note_idle(&mut self, outputs: &[u16; JUDGED_MAX], parts: &[f32; JUDGED_MAX], armed: bool) {
        let used = self.outputs.iter_mut().zip(outputs).zip(parts).filter(|((_, now), _)| **now > 0);
        for ((output, _), given) in used {
            output.idles = *given <= IDLE || (output.idles && armed);
        }
    }

    fn note_ends(&mut self, parts: &[f32; JUDGED_MAX]) {
        for (output, given) in self.outputs.iter_mut().zip(parts) {
            output.carried |= *given > IDLE_THROTTLE;
            output.off = output.carried && is_off(given);
            output.full = is_full(given);
        }
    }

    fn output(&self, motor: u8) -> Option<&Output> {
        self.outputs.get(usize::from(motor))
    }

    /// A motor that carried before, now with next to no command, stands without a fault of its own. Of four, only opposite to one at
    /// its end.
    pub(crate) fn is_off(&self, motor: u8) -> bool {
        let may_be = self.count != 4 || self.outputs.iter().any(|output| output.full);
        may_be && self.output(motor).is_some_and(|output| output.off)
    }

    pub(crate) fn is_full(&self, motor: u8) -> bool {
        self.output(motor).is_some_and(|output| output.full)
    }

    fn judge(&mut self, count: usize, step_s: f32) {
        let (place, stands_out) = self.find_weak(count, step_s);
        let is_quiet = !self.is_known() || stands_out < HOLD_PERCENT;
        if is_quiet {
            self.outputs.iter_mut().for_each(|output| output.share.learn(step_s));
        }
        // Opposite to a motor that alone drives, an idle one is the balance. An oscillating one idles for moments. On three of four motors
        // no vehicle flies level.
        let mut outputs = (0_u8..).zip(&self.outputs).take(count).filter(|_| is_quiet && count > 4);
        let shut_off = outputs.find(|(_, output)| output.off && output.share.smooth < SHUT_OFF_SHARE);
        self.verdict = match shut_off {
            Some((place, _)) => (place, Verdict::ShutOff),
            None => (place, if self.is_known() { Verdict::Weak(stands_out) } else { Verdict::Ok }),
        };
    }

    fn find_weak(&mut self, count: usize, step_s: f32) -> (u8, f32) {
        let mut changes = [(0.0, 0); JUDGED_MAX];
        for ((place, change), output) in (0_u8..).zip(&mut changes).zip(&self.outputs).take(count) {
            *change = (output.share.departed(), place);
        }
        let changes = &mut changes[..count];
        changes.sort_unstable_by(|one, other| other.0.total_cmp(&one.0));
        let [first, second, .., lowest] = *changes else { return (0, 0.0) };
        let (lowest, part) = match count {
            8 => (changes[3], 0.2),
            // Of six the opposite one is lowered.
            6 => (changes[4], 0.5),
            _ => (lowest, 1.0),
        };
        let spreads = self.outputs.iter().take(count).map(|output| output.share.spread);
        let spread = spreads.sum::<f32>() / count as f32;
        let excess = ((first.0 - second.0) - (second.0 - lowest.0)) / part;
        let (now, (summed, sum)) = (excess - SPREADS * spread / part, self.sum(excess, first.1, step_s));
        // A motor that stands out over time goes on doing so while another one does for a moment.
        if sum > now { (summed, sum) } else { (first.1, now) }
    }

    fn sum(&mut self, excess: f32, motor: u8, step_s: f32) -> (u8, f32) {
        if self.is_known() {
            let (place, sum) = &mut self.summed;
            if *sum <= 0.0 {
                *place = motor;
            }
            // That another one stands out speaks against it.
            let beyond = if *place == motor { excess } else { -excess.max(0.0) } - DRIFT_PERCENT;
            *sum = (*sum + beyond * step_s / SUMMED_S).clamp(0.0, SUM_MAX_PERCENT);
        }
        self.summed
    }

    /// All learn together.
    fn is_known(&self) -> bool {
        self.outputs.first().is_some_and(|output| output.share.is_known())
    }

    pub(crate) fn judged(&self, vehicle: &Vehicle) -> usize {
        motors(vehicle).max(self.count.into()) * usize::from(motors(vehicle) > 0)
    }

    /// A motor's command against the average of all, percent, smoothed; of frames whose outputs have a past.
    pub(crate) fn share(&self, now: BootMs, vehicle: &Vehicle, motor: u8) -> Option<f32> {
        self.at.age(now).filter(|age| *age <= PAUSE)?;
        let judged = Some(self.judged(vehicle)).filter(|count| *count <= OUTPUTS_MAX)?;
        Some(self.outputs.get(..judged)?.get(usize::from(motor))?.share.smooth)
    }

    /// The verdict on a motor, and when it was made; good for those that are not judged now.
    pub(crate) fn verdict(&self, now: BootMs, vehicle: &Vehicle, motor: u8) -> Option<(BootMs, Verdict)> {
        let at = self.at.instant(now).filter(|at| now.since(*at) <= PAUSE)?;
        let count = self.judged(vehicle);
        // Outputs that all idled on the ground are motors; without a received take-off, if all but one moved.
        let seen = |is: fn(&Output) -> bool| self.outputs.iter().filter(|output| is(output)).count();
        let are_motors = seen(|output| output.idles) >= count || seen(|output| output.moved) + 1 >= count;
        if usize::from(motor) >= count || !are_motors {
            return None;
        }
        let (place, verdict) = self.verdict;
        Some((at, if place == motor { verdict } else { Verdict::Ok }))
    }
}

fn is_off(given: &f32) -> bool {
    *given < OFF
}

fn is_full(given: &f32) -> bool {
    *given >= FULL
}

fn only(given: &[f32], is: fn(&f32) -> bool, others: fn(&f32) -> bool) -> Option<u8> {
    let place = given.iter().position(is)?;
    let mut rest = given.iter().enumerate().filter(|(other, _)| *other != place);
    rest.all(|(_, given)| others(given)).then_some(place as u8)
}

fn saturated_alone(given: &[f32]) -> Option<u8> {
    only(given, is_full, |given| (IDLE..SHARES).contains(given))
}

fn yaws(vehicle: &Vehicle) -> bool {
    let rates = vehicle.attitude.get().and_then(|attitude| attitude.rates);
    rates.is_some_and(|[.., yaw]| libm::fabsf(yaw.0) > YAWS_RAD_S)
}

/// Motors of a frame that is judged; 0 of any other. `MAV_TYPE`: 2 quadrotor, 13 hexarotor (a coaxial one calls itself so too, and is
/// quiet), 14 octorotor.
fn motors(vehicle: &Vehicle) -> usize {
    match vehicle.heartbeat.get().map(|heartbeat| heartbeat.type_number) {
        Some(2) => 4,
        Some(13) => 6,
        Some(14) => JUDGED_MAX,
        _ => 0,
    }
}

const _: () = assert!(JUDGED_MAX <= MOTORS_MAX);

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f32 = 0.2;

    fn octocopter(lost: f32) -> Vec<(u8, f32)> {
        let mut outputs = MotorOutputs::default();
        let steps = 0..350_usize;
        let judged = steps.map(|step| {
            let mut figures = [0.0; JUDGED_MAX];
            if step >= 50 {
                figures = [0.5, 0.177, 0.25, -0.177, 0.0, -0.177, 0.25, 0.177].map(|part| part * lost);
                if step.is_multiple_of(7) {
                    figures[3] = 0.6 * lost;
                }
            }
            for (output, figure) in outputs.outputs.iter_mut().zip(figures) {
                output.share.follow(figure, 1.0);
            }
            outputs.judge(JUDGED_MAX, STEP_S);
            (outputs.verdict.0, outputs.verdict.1.excess_percent())
        });
        judged.skip(50).collect()
    }

    #[test]
    fn a_motor_that_was_weak_for_long_is_weak_while_another_one_stands_out_for_a_moment() {
        let judged = octocopter(8.0);
        let last = &judged[150..];
        assert!(last.iter().all(|(motor, percent)| *motor == 0 && *percent > 8.0), "{last:?}");
        assert!(octocopter(2.0).iter().all(|(_, percent)| *percent < 4.0), "it is hardly weak");
    }
}
