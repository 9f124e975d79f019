//! The state of the vehicle: the latest of each observation with its time.
//!
//! [`crate::election`] decides which system on the link is the vehicle. The others (ground stations, other vehicles)
//! are recorded and not judged. Bounded: [`BATTERIES_MAX`] batteries, [`MOTORS_MAX`] motors; more are recorded only.

use core::ops::Range;

use crate::alert::Alerts;
use crate::election::Election;
use crate::inertial::Inertial;
use crate::latest::Latest;
use crate::observation::{
    Air, Attitude, AttitudeSetpoint, Autopilot, AutopilotIdentity, Battery, CommandAck, Engine, Esc,
    EscGroup, Estimator, Feeds, Generator, GlobalPosition, Gnss, GnssIntegrity, Heartbeat, Hud, Imu,
    LandedState, LocalPosition, MOTORS_MAX, Observation, Processor, RadioControl, Rails, Source,
    SystemStatus, SystemTime, TelemetryRadio, VehicleKind, Vibration, VibrationScale, VtolState,
};
use crate::time::{BootMs, Millis, SILENT};
use crate::units::{Amperes, Fraction, MetresPerSecond, Radians, Rpm, Volts};

/// Batteries that are monitored.
pub const BATTERIES_MAX: usize = 4;
/// GNSS receivers that are monitored.
pub const RECEIVERS_MAX: usize = 2;
/// `MAV_COMP_ID_BATTERY`, `MAV_COMP_ID_BATTERY2`
const BATTERY_COMPONENTS: [u8; 2] = [180, 181];
/// Boot times follow each other within this of the time that went by, milliseconds: messages overtake each other and wait in line.
/// One that falls by more is a reboot.
const REBOOT_MS: i64 = 3_000;
/// The longest restart of an autopilot in flight. After a longer silence the link is lost (PX4: `COM_DL_LOSS_T`, 10
/// s), and a landing, a disarming or another battery may have passed unseen.
const OFF: Millis = Millis::from_secs(10);

state! {
    /// One motor, put together from two kinds of ESC messages: PX4 sends both, ArduPilot's one message is of both kinds. The fields of a kind
    /// are those of its last message.
    pub struct Motor {
        /// The fields of the last message of each kind.
        pub esc: Esc = Esc { rpm: None, voltage: None, current: None, temperature: None, failures: None, errors: None },
        /// When `rpm`, `voltage` and `current` came (`ESC_STATUS`).
        pub moved_at: Option<BootMs>,
        /// When `temperature`, `failures` and `errors` came (`ESC_INFO`).
        pub state_at: Option<BootMs>,
    }
}

impl Motor {
    fn take(&mut self, at: BootMs, esc: Esc) {
        let Esc { rpm, voltage, current, temperature, failures, errors } = esc;
        if rpm.is_some() || voltage.is_some() || current.is_some() {
            self.esc = Esc { rpm, voltage, current, ..self.esc };
            self.moved_at = Some(at);
        }
        if temperature.is_some() || failures.is_some() || errors.is_some() {
            self.esc = Esc { temperature, failures, errors, ..self.esc };
            self.state_at = Some(at);
        }
    }
}

/// The figures of a battery's load and charge.
pub(crate) struct Supply {
    pub(crate) at: BootMs,
    pub(crate) voltage: Option<Volts>,
    pub(crate) current: Option<Amperes>,
    pub(crate) remaining: Option<Fraction>,
}

state! {
    /// The vehicle as it is known now.
    pub struct Vehicle {
        /// The autopilot, once it has sent a heartbeat.
        pub source: Option<Source>,
        /// The autopilot's heartbeat.
        pub heartbeat: Latest<Heartbeat>,
        /// `SYS_STATUS`
        pub system: Latest<SystemStatus>,
        /// Alerts: problems that the autopilot reports.
        pub alerts: Alerts,
        /// `SYSTEM_TIME`
        pub time: Latest<SystemTime>,
        /// Receivers by instance.
        pub gnss: [Latest<Gnss>; RECEIVERS_MAX],
        /// Receivers by instance.
        pub gnss_integrity: [Latest<GnssIntegrity>; RECEIVERS_MAX],
        /// The first inertial sensor.
        pub imu: Latest<Imu>,
        /// Judgement of its motion and attitude by accelerometer and gyros alone.
        pub inertial: Inertial,
        /// The air.
        pub air: Latest<Air>,
        /// Attitude.
        pub attitude: Latest<Attitude>,
        /// Roll and pitch that the autopilot wants.
        pub wanted: Latest<[Radians; 2]>,
        /// Position from the local origin.
        pub local: Latest<LocalPosition>,
        /// The fused position.
        pub global: Latest<GlobalPosition>,
        /// The pilot's display.
        pub hud: Latest<Hud>,
        /// Radio control.
        pub rc: Latest<RadioControl>,
        /// The telemetry radio.
        pub radio: Latest<TelemetryRadio>,
        /// The autopilot's rails.
        pub rails: Latest<Rails>,
        /// Batteries in the order in which they were first seen.
        pub batteries: [Latest<Battery>; BATTERIES_MAX] = [Latest::default(); BATTERIES_MAX],
        /// The component that each battery is told by: two components may both have a battery 0.
        battery_of: [u8; BATTERIES_MAX],
        pub(crate) told_battery: Option<usize>,
        /// The estimator.
        pub estimator: Latest<Estimator>,
        /// Vibration.
        pub vibration: Latest<Vibration>,
        /// Motors by number.
        pub motors: [Motor; MOTORS_MAX] = [Motor::default(); MOTORS_MAX],
        /// The combustion engine.
        pub engine: Latest<Engine>,
        /// The generator.
        pub generator: Latest<Generator>,
        pub(crate) generator_top: Option<Rpm>,
        /// The autopilot's word on flying.
        pub landed: Latest<LandedState>,
        /// The lift of a VTOL, as old as `landed`.
        pub vtol: VtolState = VtolState::Unknown,
        /// The autopilot's processor.
        pub processor: Latest<Processor>,
        /// The autopilot's identity.
        pub identity: Latest<AutopilotIdentity>,
        /// The last answer to a command.
        pub command_ack: Latest<CommandAck>,
        /// The mission's item that was reached last.
        pub mission_reached: Latest<u16>,
        /// How often the autopilot has rebooted since our power-on.
        pub reboots: u32,
        /// When it did last.
        pub rebooted_at: Option<BootMs>,
        /// Whether it was armed then: a restart on the ground is none that endangers anybody.
        pub rebooted_armed: bool,
        /// How often another system has become the vehicle: everything else here is then of that one.
        pub changes: u32,
        election: Election,
        /// The highest boot time since its last boot, milliseconds, and when it came.
        boot: Option<(u32, BootMs)>,
        /// One that does not follow it, until the next one agrees with either.
        odd_boot: Option<(u32, BootMs)>,
        /// Whether it was armed when a boot time was believed last.
        boot_armed: bool,
        /// Since when it has called its flight terminated.
        pub terminated_since: Option<BootMs>,
        /// The mildest `MAV_STATE` since arming, 0 if the arming was not received. Whoever arms a vehicle in a failsafe knows of it.
        pub state_since_arming: u8,
        pub(crate) climb_wanted: Latest<MetresPerSecond>,
    }
}

impl Vehicle {
    pub(crate) fn has_batteries(&self) -> bool {
        self.batteries.iter().any(|slot| slot.get().is_some())
    }

    /// A battery's own figures. Those of the autopilot are the first battery's while none reports itself: with several they are
    /// ambiguous.
    pub(crate) fn supply(&self, battery: usize) -> Option<Supply> {
        let slot = self.batteries.get(battery)?;
        if let (Some(at), Some(&Battery { voltage, current, remaining, .. })) = (slot.at(), slot.get()) {
            return Some(Supply { at, voltage, current, remaining });
        }
        let &SystemStatus { voltage, current, remaining, .. } = self.system.get().filter(|_| battery == 0)?;
        Some(Supply { at: self.system.at()?, voltage, current, remaining })
    }

    /// Whether motors may turn, by the last heartbeat.
    pub fn armed(&self) -> bool {
        self.heartbeat.get().is_some_and(|heartbeat| heartbeat.armed)
    }

    #[inline(never)] // A whole vehicle: not on the stack of every observation.
    fn become_another(&mut self, chosen: Option<Source>) {
        let changes = self.changes.saturating_add(u32::from(self.source.is_some()));
        *self = Self { source: chosen, changes, election: self.election, ..Self::default() };
    }

    /// The kind of the vehicle.
    pub fn kind(&self) -> VehicleKind {
        match self.heartbeat.get().map_or(VehicleKind::Other, |heartbeat| heartbeat.kind) {
            // With rotors too (Q_ENABLE) `ArduPlane` calls itself a plane, unless Q_MAV_TYPE says more. Only such a vehicle reports
            // which of them it flies on.
            VehicleKind::Plane if self.vtol != VtolState::Unknown => VehicleKind::Vtol,
            kind => kind,
        }
    }

    pub(crate) fn has_wings(&self) -> bool {
        matches!(self.kind(), VehicleKind::Plane | VehicleKind::Vtol)
    }

    pub(crate) fn is_ardupilot(&self) -> bool {
        self.heartbeat.get().is_some_and(|heartbeat| heartbeat.autopilot == Autopilot::ArduPilot)
    }

    /// Whether it hangs on several like rotors: only there are motors to be compared with each other. A helicopter's tail,
    /// a VTOL's pusher and a plane's two engines turn as they need to.
    pub fn is_multicopter(&self) -> bool {
        // MAV_TYPE: quadrotor, hexarotor, octorotor, tricopter, dodecarotor, decarotor.
        self.heartbeat
            .get()
            .is_some_and(|heartbeat| matches!(heartbeat.type_number, 2 | 13 | 14 | 15 | 29 | 35))
    }

    /// Whether it hangs on its rotors now (`Some(false)`: it flies on wings); `None` if that is unknown. Of a VTOL
    /// its own word counts, and its speed where it says none: between the two it may be either.
    pub fn hovers(&self, now: BootMs) -> Option<bool> {
        const TRANSITION_MPS: Range<f32> = 6.0..12.0;
        match self.kind() {
            VehicleKind::Rotorcraft => Some(true),
            VehicleKind::Plane => Some(false),
            VehicleKind::Vtol => match (self.vtol, self.landed.within(now, SILENT)) {
                (VtolState::Hover, Some(_)) => Some(true),
                (VtolState::Forward, Some(_)) => Some(false),
                (VtolState::Transition, Some(_)) => None,
                _ => {
                    let hud = self.hud.within(now, SILENT)?;
                    let speed_mps = hud.airspeed.into_iter().chain(hud.groundspeed).map(|speed| speed.0);
                    let speed_mps = speed_mps.reduce(f32::max)?;
                    (!TRANSITION_MPS.contains(&speed_mps)).then_some(speed_mps < TRANSITION_MPS.start)
                }
            },
            VehicleKind::Surface | VehicleKind::Other => None,
        }
    }

    /// Whether this is surely the vehicle: no other one takes its place for as long as it is heard.
    pub fn is_settled(&self, now: BootMs) -> bool {
        self.election.is_settled(now)
    }

    /// Who is to be asked for streams: the vehicle, and until that is settled each autopilot on the port in turn.
    pub fn asks(&self, now: BootMs) -> Option<(Source, Autopilot)> {
        self.election.asks(now, self.source?)
    }

    /// The time since this vehicle was chosen.
    pub fn known_for(&self, now: BootMs) -> Millis {
        self.election.lasts(now)
    }

    /// Takes an observation; `false` when it is not of this vehicle.
    pub fn observe(&mut self, at: BootMs, source: Source, observation: &Observation) -> bool {
        let heartbeat = match observation {
            Observation::Heartbeat(heartbeat) => Some(heartbeat.autopilot),
            _ => None,
        };
        let chosen = self.election.hear(at, self.source, source, heartbeat);
        if chosen != self.source {
            self.become_another(chosen);
        }
        if !self.concerns(source, observation) {
            return false;
        }
        self.take(at, source.component, observation);
        true
    }

    /// A radio is a system of its own (51, 68).
    fn concerns(&self, source: Source, observation: &Observation) -> bool {
        match observation {
            Observation::TelemetryRadio(_) => true,
            _ if observation.may_be_of_another_component() => {
                self.source.is_some_and(|vehicle| vehicle.system == source.system)
            }
            _ => self.source == Some(source),
        }
    }

    fn take(&mut self, at: BootMs, component: u8, observation: &Observation) {
        match *observation {
            Observation::Heartbeat(heartbeat) => self.take_heartbeat(at, heartbeat),
            Observation::SystemStatus(system) => {
                if let Some(sensors) = &system.sensors {
                    self.alerts.take_sensors(at, sensors);
                }
                self.system.set(at, system);
            }
            Observation::SystemTime(time) => {
                self.take_boot_time(at, time.boot_ms);
                self.time.set(at, time);
            }
            Observation::Gnss(gnss) => set_instance(&mut self.gnss, gnss.instance, at, gnss),
            Observation::GnssIntegrity(integrity) => {
                set_instance(&mut self.gnss_integrity, integrity.instance, at, integrity);
            }
            Observation::Imu(imu) => self.take_imu(at, imu),
            Observation::Air(air) => self.take_air(at, air),
            Observation::ImuAndAir(imu, air) => {
                self.take_imu(at, imu);
                self.take_air(at, air);
            }
            Observation::Attitude(attitude) => self.take_attitude(at, attitude),
            Observation::AttitudeSetpoint(AttitudeSetpoint { roll, pitch, .. })
                if (roll.0 + pitch.0).is_finite() =>
            {
                self.wanted.set(at, [roll, pitch]);
            }
            Observation::ClimbWanted(climb) => self.climb_wanted.set(at, climb),
            Observation::LocalPosition(local) => self.local.set(at, local),
            Observation::GlobalPosition(global) => self.global.set(at, global),
            Observation::Hud(hud) => self.hud.set(at, hud),
            Observation::RadioControl(rc) => self.rc.set(at, rc),
            Observation::TelemetryRadio(radio) => self.radio.set(at, radio),
            Observation::Rails(rails) => self.rails.set(at, rails),
            Observation::Battery(battery) => self.take_battery(at, component, battery),
            Observation::Estimator(estimator) => {
                let has_fix = self.gnss.iter().filter_map(Latest::get).any(|gnss| gnss.fix >= 3);
                let in_air = self.landed.within(at, SILENT) == Some(&LandedState::InAir);
                self.alerts.take_estimator(at, &estimator, has_fix, in_air);
                self.estimator.set(at, estimator);
            }
            Observation::Vibration(vibration) => self.take_vibration(at, vibration),
            Observation::Escs(group) => self.take_escs(at, &group),
            Observation::Engine(engine) => self.engine.set(at, engine),
            Observation::Generator(generator) => self.take_generator(at, generator),
            Observation::Landed(landed, vtol) => {
                self.landed.set(at, landed);
                self.vtol = vtol;
            }
            Observation::Processor(processor) => self.processor.set(at, processor),
            Observation::Identity(identity) => self.identity.set(at, identity),
            Observation::CommandAck(ack) => self.command_ack.set(at, ack),
            Observation::Alert(alert) => self.alerts.tell(at, alert),
            Observation::Failing(causes) => self.alerts.take_failures(at, causes),
            Observation::MissionReached(item) => self.mission_reached.set(at, item),
            Observation::AttitudeSetpoint(_)
            | Observation::SpeedSensors(_)
            | Observation::SecondEstimate(_)
            | Observation::Outputs(_)
            | Observation::Parameter(..)
            | Observation::Shock(_) => {}
        }
    }

    fn take_attitude(&mut self, at: BootMs, attitude: Attitude) {
        if let Some(boot_ms) = attitude.boot_ms {
            self.take_boot_time(at, boot_ms);
        }
        self.inertial.take_rates(at, attitude.rates);
        self.inertial.take_attitude(at, &attitude);
        self.attitude.set(at, attitude);
    }

    fn take_heartbeat(&mut self, at: BootMs, heartbeat: Heartbeat) {
        self.alerts.take_armed(at, heartbeat.armed);
        self.alerts.take_state(at, heartbeat.state);
        if heartbeat.armed && self.heartbeat.within(at, SILENT).is_some_and(|before| !before.armed) {
            self.state_since_arming = heartbeat.state;
        }
        self.state_since_arming = self.state_since_arming.min(heartbeat.state);
        let terminated = heartbeat.state == Heartbeat::TERMINATED;
        self.terminated_since = terminated.then(|| self.terminated_since.unwrap_or(at));
        self.heartbeat.set(at, heartbeat);
    }

    /// A boot time that falls, and which the next one agrees with, is a reboot. One wrong time is none, nor are messages that
    /// overtake each other a little, nor the end of 32 bits of milliseconds after 49.7 days.
    fn take_boot_time(&mut self, at: BootMs, boot_ms: u32) {
        // How far this one is ahead of an earlier one, and how far it should be.
        let ahead_ms = |(told_ms, told_at): (u32, BootMs)| {
            (i64::from(boot_ms.wrapping_sub(told_ms).cast_signed()), at.since(told_at).as_millis() as i64)
        };
        if let Some((ahead, passed)) = self.boot.map(ahead_ms)
            && (-REBOOT_MS..=passed + REBOOT_MS).contains(&ahead)
        {
            if ahead > 0 {
                self.boot = Some((boot_ms, at));
            }
            (self.odd_boot, self.boot_armed) = (None, self.armed());
            return;
        }
        let agrees = |(ahead, passed): (i64, i64)| (ahead - passed).abs() <= REBOOT_MS;
        if !self.odd_boot.map(ahead_ms).is_some_and(agrees) {
            self.odd_boot = Some((boot_ms, at));
            return;
        }
        if let Some((_, told_at)) = self.boot
            && self.boot.map(ahead_ms).is_some_and(|(ahead, _)| ahead < 0)
        {
            // The silence before this power-on. A long one may hide anything, a landing too.
            let silent_ms = at.since(told_at).as_millis().saturating_sub(boot_ms.into());
            self.reboots = self.reboots.saturating_add(1);
            self.rebooted_at = Some(at);
            // As before: the first heartbeat after a restart may come before the time that shows it. An autopilot's
            // own log of the next power-on may begin with its arming.
            self.rebooted_armed = self.boot_armed && silent_ms <= OFF.as_millis();
        }
        (self.boot, self.odd_boot, self.boot_armed) = (Some((boot_ms, at)), None, self.armed());
    }

    fn take_imu(&mut self, at: BootMs, imu: Imu) {
        if imu.instance == 0 {
            self.imu.set(at, imu);
            self.inertial.take(at, &imu);
        }
    }

    fn take_air(&mut self, at: BootMs, air: Air) {
        if air.instance == 0 {
            self.air.set(at, air);
        }
    }

    /// The same message on two scales: only the heartbeat tells which.
    fn take_vibration(&mut self, at: BootMs, vibration: Vibration) {
        let px4 = self.heartbeat.get().is_some_and(|heartbeat| heartbeat.autopilot == Autopilot::Px4);
        let scale = if px4 { VibrationScale::Px4Metrics } else { VibrationScale::PerAxis };
        self.vibration.set(at, Vibration { scale, ..vibration });
    }

    /// A battery of unknown use is the vehicle's if the autopilot or a battery of its own component reports it, and
    /// not if a gimbal does.
    fn take_battery(&mut self, at: BootMs, component: u8, mut battery: Battery) {
        let is_own = BATTERY_COMPONENTS.contains(&component)
            || self.source.is_some_and(|vehicle| vehicle.component == component);
        if battery.feeds == Feeds::Unsaid && is_own {
            battery.feeds = Feeds::Vehicle;
        }
        let Self { batteries, battery_of, told_battery, .. } = self;
        *told_battery = batteries
            .iter()
            .zip(battery_of.iter())
            .position(|(slot, of)| slot.get().is_none_or(|other| other.id == battery.id && *of == component));
        if let Some(place) = *told_battery {
            batteries[place].set(at, battery);
            battery_of[place] = component;
        }
    }

    fn take_generator(&mut self, at: BootMs, generator: Generator) {
        let before = self.generator_top.filter(|_| self.armed());
        self.generator_top = match generator.speed.and_then(Rpm::finite) {
            _ if generator.is_off => before.map(|_| Rpm(0.0)),
            Some(speed) if speed.0 > 0.0 => Some(before.map_or(speed, |top| Rpm(top.0.max(speed.0)))),
            _ => before,
        };
        self.generator.set(at, generator);
    }

    fn take_escs(&mut self, at: BootMs, group: &EscGroup) {
        for (offset, esc) in group.escs.iter().enumerate() {
            if let (Some(esc), Some(motor)) = (esc, self.motors.get_mut(usize::from(group.first) + offset)) {
                motor.take(at, *esc);
            }
        }
    }
}

fn set_instance<T, const N: usize>(slots: &mut [Latest<T>; N], instance: u8, at: BootMs, value: T) {
    if let Some(slot) = slots.get_mut(usize::from(instance)) {
        slot.set(at, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn known() -> Vehicle {
        let mut vehicle = Vehicle::default();
        let heartbeat = Heartbeat { autopilot: Autopilot::Px4, ..Heartbeat::default() };
        assert!(vehicle.observe(BootMs::ZERO, AUTOPILOT, &Observation::Heartbeat(heartbeat)));
        vehicle
    }

    #[test]
    fn only_the_first_vehicle_is_monitored() {
        let mut vehicle = known();
        let other = Source { system: 2, component: 1 };
        assert!(!vehicle.observe(BootMs::ZERO, other, &Observation::Heartbeat(Heartbeat::default())));
        assert!(!vehicle.observe(BootMs::ZERO, other, &Observation::Attitude(Attitude::default())));
        let gimbal = Source { system: 1, component: 154 };
        assert!(!vehicle.observe(BootMs::ZERO, gimbal, &Observation::Attitude(Attitude::default())));
        let battery = Source { system: 1, component: 180 };
        assert!(vehicle.observe(BootMs::ZERO, battery, &Observation::Battery(Battery::default())));
    }

    #[test]
    fn an_esc_is_put_together_from_several_messages() {
        let mut vehicle = known();
        let status = Esc { rpm: Some(Rpm(5_000.0)), voltage: Some(Volts(12.0)), ..Esc::default() };
        let info = Esc { errors: Some(3), ..Esc::default() };
        for (at, esc) in [(1, status), (2, info)] {
            let group = EscGroup { first: 11, escs: [Some(esc); 4] };
            vehicle.observe(BootMs::from_millis(at), AUTOPILOT, &Observation::Escs(group));
        }
        let motor = vehicle.motors[11];
        assert_eq!((motor.esc.rpm, motor.esc.errors), (Some(Rpm(5_000.0)), Some(3)));
        assert_eq!(motor.moved_at, Some(BootMs::from_millis(1)));
        assert_eq!(motor.state_at, Some(BootMs::from_millis(2)));
    }

    #[test]
    fn a_falling_boot_time_is_a_reboot_and_reordering_and_the_end_of_the_counter_are_none() {
        let by_time = |boot_ms| Observation::SystemTime(SystemTime { boot_ms, utc_micros: None });
        let by_attitude =
            |boot_ms| Observation::Attitude(Attitude { boot_ms: Some(boot_ms), ..Attitude::default() });
        let wraps = [u32::MAX - 10, 5, 90_000, 90_400, 90_100, 1_000, 1_100];
        for said in
            [[5_000, 6_000, 5_500, 7_000, 300, 400].map(by_time).to_vec(), wraps.map(by_attitude).to_vec()]
        {
            let mut vehicle = known();
            for observation in said {
                vehicle.observe(BootMs::from_millis(7), AUTOPILOT, &observation);
            }
            assert_eq!((vehicle.reboots, vehicle.rebooted_at), (1, Some(BootMs::from_millis(7))));
        }
    }

    fn reboots_with(odd_ms: u32, restarts: bool) -> (u32, Option<BootMs>) {
        let mut vehicle = known();
        for step in 0..600 {
            let ran_ms = if restarts && step >= 300 { step - 300 } else { 2_000 + step } * 100;
            let boot_ms = if step == 200 { odd_ms } else { ran_ms };
            let attitude = Attitude { boot_ms: Some(boot_ms), ..Attitude::default() };
            let at = BootMs::from_millis(u64::from(step) * 100);
            vehicle.observe(at, AUTOPILOT, &Observation::Attitude(attitude));
        }
        (vehicle.reboots, vehicle.rebooted_at)
    }

    #[test]
    fn one_wrong_boot_time_is_no_restart_and_a_restart_after_it_is_seen_within_a_second() {
        for odd_ms in [0, 7, 100_000, 1_000_000, u32::MAX / 2, u32::MAX] {
            assert_eq!(reboots_with(odd_ms, false), (0, None), "{odd_ms}");
            assert_eq!(reboots_with(odd_ms, true), (1, Some(BootMs::from_millis(30_100))), "{odd_ms}");
        }
    }

    #[test]
    fn a_battery_that_does_not_say_what_it_feeds_feeds_the_vehicle_if_its_component_does() {
        for (component, feeds) in
            [(1, Feeds::Vehicle), (180, Feeds::Vehicle), (181, Feeds::Vehicle), (154, Feeds::Unsaid)]
        {
            let mut vehicle = known();
            let source = Source { system: 1, component };
            vehicle.observe(BootMs::ZERO, source, &Observation::Battery(Battery::default()));
            assert_eq!(vehicle.batteries[0].get().map(|battery| battery.feeds), Some(feeds), "{component}");
            let propels = Battery { feeds: Feeds::Vehicle, ..Battery::default() };
            vehicle.observe(BootMs::ZERO, source, &Observation::Battery(propels));
            assert_eq!(vehicle.batteries[0].get().map(|battery| battery.feeds), Some(Feeds::Vehicle));
        }
    }
}
