//! SI units (and the few that the field uses instead) as types, so that a value never crosses a border without its
//! unit. Single precision everywhere but in positions: a sensor has less than 24 bits to say.

/// Standard gravity, m/s2 (CGPM 1901).
pub const GRAVITY: f32 = 9.806_65;
/// A degree of latitude, m.
pub(crate) const DEGREE_M: f64 = 111_320.0;

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident $(= $max:expr)?;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f32);

        impl $name {
            $(
                /// Greater values, in either direction, are garbage: no vehicle here reaches them.
                pub const MAX: f32 = $max;

                /// The number, unless it is garbage.
                pub fn sane(self) -> Option<f32> {
                    (self.0.abs() <= Self::MAX).then_some(self.0)
                }
            )?

            /// The value if it is a number; NaN and infinities are nothing that a sensor can have measured.
            pub fn finite(self) -> Option<Self> {
                self.0.is_finite().then_some(self)
            }
        }
    )*};
}

units! {
    /// Electric potential, V.
    Volts = 1_000.0;
    /// Electric current, A.
    Amperes = 10_000.0;
    /// Electric charge, Ah.
    AmpereHours;
    /// Temperature, degC.
    Celsius = 1_000.0;
    /// Length, m.
    Metres = 100_000.0;
    /// Speed, m/s.
    MetresPerSecond = 1_000.0;
    /// Acceleration, m/s2. No autopilot's sensor measures more than 32 g an axis.
    MetresPerSecond2 = 60.0 * GRAVITY;
    /// Angle, rad.
    Radians;
    /// Angular speed, rad/s.
    RadiansPerSecond = 60.0;
    /// Revolutions a minute; negative is reverse.
    Rpm = 1e6;
    /// Pressure, hPa.
    Hectopascals;
    /// Magnetic flux density, G: the earth's is 0.25 to 0.65.
    Gauss;
    /// A part of the whole: 1 is all of it.
    Fraction;
}

/// A position on the WGS 84 ellipsoid in degrees; double precision, because single is 1 m at best.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// North positive.
    pub latitude_deg: f64,
    /// East positive.
    pub longitude_deg: f64,
}

/// How long a vector of two or three axes is.
#[inline]
pub fn norm<const N: usize>(vector: [f32; N]) -> f32 {
    let [x, y, z] = core::array::from_fn(|axis| vector.get(axis).copied().unwrap_or_default());
    libm::sqrtf(x * x + y * y + z * z)
}
