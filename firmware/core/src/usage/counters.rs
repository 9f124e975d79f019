//! The counters: their stored numbers, their names, which carry the unit, and how they add up over sessions.

use crate::exposure::{BINS, ExposureQuantity};
use crate::figures::Quantity as Steady;

/// How a counter adds up over sessions, and its stored form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Time that adds up; stored in tenths of a second in 32 bits: 119,000 hours.
    Tenths,
    /// Events that add up; 32 bits.
    Count,
    /// Half cycles that add up; 32 bits of halves.
    Halves,
    /// A quantity that adds up; double precision.
    Amount,
    /// The greatest of all; single precision.
    Highest,
    /// The least of all, infinite while never measured; single precision.
    Lowest,
}

impl Form {
    /// The value of a counter that has counted nothing.
    pub const fn nothing(self) -> f64 {
        match self {
            Self::Lowest => f64::INFINITY,
            _ => 0.0,
        }
    }
}

macro_rules! counters {
    ($($(#[$doc:meta])* $variant:ident = $number:literal $form:ident $name:literal;)*) => {
        /// A usage counter, by its place in [`UsageCounter::ALL`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum UsageCounter {
            $($(#[$doc])* $variant,)*
        }

        impl UsageCounter {
            /// All counters except those of motors. New ones are appended: the stored lifetime follows this order.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The number in logs, which never changes its meaning.
            pub const fn number(self) -> u8 {
                match self {
                    $(Self::$variant => $number,)*
                }
            }

            /// How it adds up over sessions, and how it is stored.
            pub const fn form(self) -> Form {
                match self {
                    $(Self::$variant => Form::$form,)*
                }
            }

            /// The name, which ends in the unit.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

counters! {
    /// Since power-on of the box.
    Powered = 0 Tenths "powered_time_s";
    /// The autopilot's heartbeat says armed.
    Armed = 1 Tenths "armed_time_s";
    /// In the air, by `EXTENDED_SYS_STATE` if the autopilot sends it. Otherwise from armed and 1 m above the place of arming
    /// for 0.5 s (a plane: 8 m/s), until disarmed, or below 0.5 m and still for 2 s. The time until detection counts too.
    Flight = 2 Tenths "flight_time_s";
    /// Take-offs by that definition.
    Flights = 3 Count "flights";
    /// Landings by that definition; a flight ended by a mishap has no landing.
    Landings = 4 Count "landings";
    /// Speed over ground (`GLOBAL_POSITION_INT`, else `LOCAL_POSITION_NED`, else `VFR_HUD`) over time in the air.
    Distance = 5 Amount "distance_m";
    /// Height above home in the air, `GLOBAL_POSITION_INT`.
    HeightMax = 6 Highest "height_max_m";
    /// Speed over ground in the air.
    SpeedMax = 7 Highest "speed_max_m_s";
    /// Magnitude of the specific force over 9.80665 m/s² in the air. Each axis passes a first-order filter of 0.3 s: a shock
    /// counts little, a held turn nearly in full. Not counted while VIBRATION is 60 m/s² or more: such samples give no load
    /// factor.
    LoadFactorMax = 8 Highest "load_factor_max_g";
    /// Discharge current of all batteries over time, from `BATTERY_STATUS`; else from `SYS_STATUS`; else the sum of all ESCs.
    Charge = 9 Amount "charge_ah";
    /// The same times voltage.
    Energy = 10 Amount "energy_wh";
    /// That current while armed.
    CurrentMax = 11 Highest "current_max_a";
    /// The first battery's voltage while armed.
    VoltageMin = 12 Lowest "voltage_min_v";
    /// The worst of VIBRATION's three figures while armed, on the autopilot's own scale.
    VibrationMax = 13 Highest "vibration_max_m_s2";
    /// The autopilot's boot time fell by more than 3 s.
    AutopilotReboots = 14 Count "autopilot_reboots";
    /// Touchdowns faster than `HARD_LANDING`, including the impact of a mishap.
    HardLandings = 15 Count "hard_landings";
    /// Descent speed just before the vehicle stopped at the height where it then stood. In a mishap: the fastest descent that
    /// stopped abruptly.
    TouchdownMax = 16 Highest "touchdown_max_m_s";
    /// Charge over `BAT_CAPACITY`, in full discharges; not counted without a capacity.
    BatteryCycles = 17 Amount "battery_cycles";
    /// Regime: not in the air, and a message of the autopilot within 5 s.
    Ground = 20 Tenths "ground_time_s";
    /// Regime: climbing faster than 0.35 m/s below 3 m.
    TakeOff = 21 Tenths "take_off_time_s";
    /// Regime: in the air, none of the others.
    Hover = 22 Tenths "hover_time_s";
    /// Regime: climbing faster than 0.7 m/s.
    Climb = 23 Tenths "climb_time_s";
    /// Regime: faster than 1.5 m/s over ground.
    Cruise = 24 Tenths "cruise_time_s";
    /// Regime: descending faster than 0.7 m/s.
    Descent = 25 Tenths "descent_time_s";
    /// Regime: descending faster than 0.35 m/s below 3 m.
    Landing = 26 Tenths "landing_time_s";
    /// Rainflow cycles (ASTM E1049-85) of the load factor in the air with a range of 0.25 to 0.5 g; turns of less than 0.1 g
    /// are ignored.
    LoadCycles0 = 30 Halves "load_cycles_from_0_25_g";
    /// Range 0.5 to 1 g.
    LoadCycles1 = 31 Halves "load_cycles_from_0_5_g";
    /// Range 1 to 1.5 g.
    LoadCycles2 = 32 Halves "load_cycles_from_1_g";
    /// Range 1.5 to 2 g.
    LoadCycles3 = 33 Halves "load_cycles_from_1_5_g";
    /// Range 2 to 3 g.
    LoadCycles4 = 34 Halves "load_cycles_from_2_g";
    /// Range 3 to 4 g.
    LoadCycles5 = 35 Halves "load_cycles_from_3_g";
    /// Range from 4 g on.
    LoadCycles6 = 36 Halves "load_cycles_from_4_g";
    /// Flights ended by a mishap.
    Mishaps = 18 Count "mishaps";
}

/// Counters one a motor: run time in seconds from this number on, motor by motor.
pub const MOTOR_TIME_FIRST: u8 = 100;
/// Counters one a motor: revolutions from this number on, motor by motor.
pub const MOTOR_REVOLUTIONS_FIRST: u8 = 120;

/// Time in ranges: seconds from this number on, quantity by quantity and range by range.
pub const EXPOSURE_FIRST: u8 = 140;
/// Figures of a flight: from this number on, by [`crate::figures::Quantity::index`].
pub const FIGURE_FIRST: u8 = 200;

const _: () = assert!(EXPOSURE_FIRST as usize + BINS * ExposureQuantity::ALL.len() <= FIGURE_FIRST as usize);
const _: () = assert!(FIGURE_FIRST as usize + Steady::COUNT <= 256);

/// The number of the time that a quantity stood in a range.
pub const fn exposure_number(quantity: ExposureQuantity, bin: usize) -> u8 {
    EXPOSURE_FIRST + quantity as u8 * BINS as u8 + bin as u8
}

/// The number of a flight's figure.
pub fn figure_number(quantity: Steady) -> u8 {
    FIGURE_FIRST + quantity.index() as u8
}
