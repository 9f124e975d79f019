//! Causes: faults as an autopilot reports them, and the status flags that report each.

numbered! {
    /// A fault that the autopilot reports. It has the name of its check.
    pub enum Cause {
        /// Gyro.
        Gyro "gyro_alert",
        /// Accelerometer.
        Accelerometer "accel_alert",
        /// Compass.
        Compass "compass_alert",
        /// Barometer.
        Barometer "baro_alert",
        /// Airspeed sensor.
        Airspeed "airspeed_alert",
        /// Satellite navigation: no fix, glitches, jamming, spoofing.
        Gnss "gnss_alert",
        /// Rangefinder, optical flow, vision, proximity.
        Ranging "ranging_alert",
        /// Heights of the ground.
        Terrain "terrain_alert",
        /// The estimator: it doubts or has lost attitude, velocity, position or height.
        Estimator "ekf_alert",
        /// The attitude is not what it should be.
        Attitude "attitude_alert",
        /// Motors, propellers, ESCs, engine.
        Propulsion "drive_alert",
        /// Batteries and supplies.
        Power "battery_alert",
        /// The pilot's remote control.
        RemoteControl "rc_alert",
        /// Ground station or companion computer.
        GroundStation "gcs_alert",
        /// The geofence is breached.
        Fence "fence_alert",
        /// Vibration or clipping.
        Vibration "vibration_alert",
        /// The autopilot's own log or storage.
        Logging "logging_alert",
        /// The autopilot's processor or firmware.
        Processor "processor_alert",
        /// A crash, a parachute, flight termination.
        Crash "crash_alert",
        /// A failsafe whose cause is not said.
        Failsafe "failsafe_alert",
        /// Something severe that no table knows.
        Other "autopilot_alert",
    }
}

/// A fault that the autopilot reports once, in a text or an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alert {
    /// The fault.
    pub cause: Cause,
    /// How bad it is.
    pub urgency: Urgency,
}

/// How bad it is. The numbers are the values of the checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Urgency {
    /// It is over.
    Over = 0,
    /// Worth knowing.
    Warning = 1,
    /// Somebody has to act now.
    Critical = 2,
}

impl Alert {
    /// A warning of it.
    pub const fn warning(cause: Cause) -> Self {
        Self { cause, urgency: Urgency::Warning }
    }

    /// The end of an alert.
    pub const fn over(cause: Cause) -> Self {
        Self { cause, urgency: Urgency::Over }
    }

    /// A critical one.
    pub const fn critical(cause: Cause) -> Self {
        Self { cause, urgency: Urgency::Critical }
    }
}

/// A set of causes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Causes(u32);

const _: () = assert!(Cause::COUNT <= 32);

impl Causes {
    /// None.
    pub const NONE: Self = Self(0);

    /// With one more.
    #[must_use]
    pub const fn with(self, cause: Cause) -> Self {
        Self(self.0 | 1 << cause as u32)
    }

    /// Whether it has this one.
    pub const fn has(self, cause: Cause) -> bool {
        self.0 & 1 << cause as u32 != 0
    }

    pub(crate) const fn both(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    pub(crate) const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(crate) fn of_bits(bits: u32, table: &[(u32, Cause)]) -> Self {
        if bits == 0 {
            return Self::NONE;
        }
        let set = table.iter().filter(|(bit, _)| bits & bit != 0);
        set.fold(Self::NONE, |causes, (_, cause)| causes.with(*cause))
    }

    /// The causes of bits of `MAV_SYS_STATUS_SENSOR` (source: `common.xml`). Pre-arm checks (28) mean nothing in
    /// flight. Terrain (22) comes from a card or a ground station, and an autopilot that needs it reports that
    /// itself.
    pub fn of_sensors(sensors: u32) -> Self {
        const SENSORS: &[(u32, Cause)] = &[
            (1 | 1 << 17, Cause::Gyro),
            (1 << 1 | 1 << 18, Cause::Accelerometer),
            (1 << 2 | 1 << 19, Cause::Compass),
            (1 << 3, Cause::Barometer),
            (1 << 4, Cause::Airspeed),
            (1 << 5, Cause::Gnss),
            // Optical flow, vision, laser, an external truth, proximity, obstacle avoidance.
            (1 << 6 | 1 << 7 | 1 << 8 | 1 << 9 | 1 << 26 | 1 << 29, Cause::Ranging),
            // Control of rate, attitude, yaw, height and position; the attitude reference.
            (1 << 10 | 1 << 11 | 1 << 12 | 1 << 13 | 1 << 14 | 1 << 21, Cause::Estimator),
            // Motor outputs, reversed motors, propulsion.
            (1 << 15 | 1 << 23 | 1 << 30, Cause::Propulsion),
            (1 << 16, Cause::RemoteControl),
            (1 << 20, Cause::Fence),
            (1 << 24, Cause::Logging),
            (1 << 25, Cause::Power),
            (1 << 27, Cause::GroundStation),
        ];
        Self::of_bits(sensors, SENSORS)
    }

    /// The causes of `HIGH_LATENCY2.failure_flags` (`HL_FAILURE_FLAG` of `common.xml`).
    pub fn of_failure_flags(flags: u16) -> Self {
        const FLAGS: &[(u32, Cause)] = &[
            (1, Cause::Gnss),
            (2, Cause::Airspeed),
            (4, Cause::Barometer),
            (8, Cause::Accelerometer),
            (16, Cause::Gyro),
            (32, Cause::Compass),
            (64, Cause::Terrain),
            (128, Cause::Power),
            (256, Cause::RemoteControl),
            (512, Cause::GroundStation),
            (1024, Cause::Propulsion),
            (2048, Cause::Fence),
            (4096, Cause::Estimator),
        ];
        Self::of_bits(u32::from(flags), FLAGS)
    }
}
