//! SI units (and the few that the field uses instead) as types, so that a value never crosses a border without its
//! unit. Single precision everywhere but in positions: a sensor has less than 24 bits to say.

/// Standard gravity, m/s2 (CGPM 1901).
pub const GRAVITY: f32 = 9.806_65;

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident, $symbol:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f32);

        impl $name {
            /// The unit's symbol as findings and reports print it.
            pub const SYMBOL: &'static str = $symbol;

            /// The value if it is a number; NaN and infinities are nothing that a sensor can have measured.
            pub fn finite(self) -> Option<Self> {
                self.0.is_finite().then_some(self)
            }
        }
    )*};
}

units! {
    /// Electric potential.
    Volts, "V";
    /// Electric current.
    Amperes, "A";
    /// Electric charge.
    AmpereHours, "Ah";
    /// Energy.
    WattHours, "Wh";
    /// Temperature.
    Celsius, "degC";
    /// Length.
    Metres, "m";
    /// Speed.
    MetresPerSecond, "m/s";
    /// Acceleration.
    MetresPerSecond2, "m/s2";
    /// Angle.
    Radians, "rad";
    /// Angular speed.
    RadiansPerSecond, "rad/s";
    /// Revolutions a minute; negative is reverse.
    Rpm, "rpm";
    /// Pressure.
    Hectopascals, "hPa";
    /// Magnetic flux density: the earth's is 0.25 to 0.65.
    Gauss, "G";
    /// A part of the whole: 1 is all of it.
    Fraction, "1";
}

/// A position on the WGS 84 ellipsoid in degrees; double precision, because single is 1 m at best.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// North positive.
    pub latitude_deg: f64,
    /// East positive.
    pub longitude_deg: f64,
}

/// How long a vector is.
pub fn norm([x, y, z]: [f32; 3]) -> f32 {
    libm::sqrtf(x * x + y * y + z * z)
}
