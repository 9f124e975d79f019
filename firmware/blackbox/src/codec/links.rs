//! Quantities in several messages: a velocity, for instance, is centimetres per second in one and a float in another.
//! Messages publish such quantities into registers; numbers are then also predicted from their register. A register
//! may also be computed from others, as in the autopilot: exactly alike on every machine.
//!
//! The table is part of format version 3. It names fields by message id and byte offset. If a layout differs, the
//! prediction is bad, but writer and reader still agree.

use super::element::Element;
use hums_dialect::ids::ATTITUDE_QUATERNION;
use zerocopy::FromZeros;

/// Stored quantities: single-precision numbers, and from `WHOLE` on whole ones of 32 bits, without a scale.
const REGISTERS: usize = 45;
const WHOLE: usize = 31;

/// The first registers of an attitude's angles, of their quaternion, and of the last received quaternion.
const ANGLES: usize = 0;
const QUATERNION: usize = 23;
const TOLD: usize = 27;
/// The times of the angles, and of the message that has them as a quaternion.
const TIMES: usize = 43;

#[derive(Clone, Copy, Debug)]
struct Link {
    register: u8,
    /// Published value = field x scale; prediction = register x scale.
    scale: f32,
}

struct Row {
    id: u32,
    offset: u8,
    consults: Option<Link>,
    publishes: Option<Link>,
}

const fn row(id: u32, offset: u8) -> Row {
    Row { id, offset, consults: None, publishes: None }
}

impl Row {
    const fn consults(mut self, register: u8, scale: f32) -> Self {
        self.consults = Some(Link { register, scale });
        self
    }

    const fn publishes(mut self, register: u8, scale: f32) -> Self {
        self.publishes = Some(Link { register, scale });
        self
    }
}

const DEGREES: f32 = 57.295_78;

/// 1e-7 degrees of latitude in a metre: 1e7 / 111,319.
const LATITUDE: f32 = 89.832;

/// By id, then offset. Registers: 0-2 roll, pitch, yaw in rad; 3-5 body rates in rad/s; 6-8 the same from the raw
/// IMU; 9, 10 horizontal NED velocity in m/s (`GLOBAL_POSITION_INT`), 14, 15 the same (`LOCAL_POSITION_NED`); 11
/// velocity downwards, as the latest float has it; 12 relative altitude, 13 altitude in m; 16-18 local position in m;
/// 19 altitude (`AHRS2`); 20 pressure altitude; 21, 22 monotonic and relative altitude (`ALTITUDE`); 23-26 the
/// quaternion of 0-2, 27-30 the last received one. Whole ones: 31, 32 latitude and longitude in 1e-7 degrees; 33-40
/// channels of the remote control; 41, 42 voltage and current of the battery; 43, 44 times of the attitude and of the
/// message with its quaternion.
static ROWS: [Row; 98] = [
    row(1, 14).consults(41, 1.0).publishes(41, 1.0),
    row(1, 16).consults(42, 1.0).publishes(42, 1.0),
    row(24, 8).consults(31, 1.0).publishes(31, 1.0),
    row(24, 12).consults(32, 1.0).publishes(32, 1.0),
    row(27, 14).consults(3, 1_000.0).publishes(6, 0.001),
    row(27, 16).consults(4, 1_000.0).publishes(7, 0.001),
    row(27, 18).consults(5, 1_000.0).publishes(8, 0.001),
    row(30, 0).publishes(43, 1.0),
    row(30, 4).publishes(0, 1.0),
    row(30, 8).publishes(1, 1.0),
    row(30, 12).publishes(2, 1.0),
    row(30, 16).consults(6, 1.0).publishes(3, 1.0),
    row(30, 20).consults(7, 1.0).publishes(4, 1.0),
    row(30, 24).consults(8, 1.0).publishes(5, 1.0),
    row(31, 0).publishes(44, 1.0),
    row(31, 4).consults(23, 1.0).publishes(27, 1.0),
    row(31, 8).consults(24, 1.0).publishes(28, 1.0),
    row(31, 12).consults(25, 1.0).publishes(29, 1.0),
    row(31, 16).consults(26, 1.0).publishes(30, 1.0),
    row(31, 20).consults(3, 1.0),
    row(31, 24).consults(4, 1.0),
    row(31, 28).consults(5, 1.0),
    row(32, 4).publishes(16, 1.0),
    row(32, 8).publishes(17, 1.0),
    row(32, 12).consults(12, -1.0).publishes(18, 1.0),
    row(32, 16).consults(9, 1.0).publishes(14, 1.0),
    row(32, 20).consults(10, 1.0).publishes(15, 1.0),
    row(32, 24).consults(11, 1.0).publishes(11, 1.0),
    row(33, 4).consults(16, LATITUDE).publishes(31, 1.0),
    row(33, 8).consults(32, 1.0).publishes(32, 1.0),
    row(33, 12).consults(18, -1_000.0).publishes(13, 0.001),
    row(33, 16).consults(18, -1_000.0).publishes(12, 0.001),
    row(33, 20).consults(14, 100.0).publishes(9, 0.01),
    row(33, 22).consults(15, 100.0).publishes(10, 0.01),
    row(33, 24).consults(11, 100.0),
    row(33, 26).consults(2, 100.0 * DEGREES),
    row(35, 4).consults(33, 1.0).publishes(33, 1.0),
    row(35, 6).consults(34, 1.0).publishes(34, 1.0),
    row(35, 8).consults(35, 1.0).publishes(35, 1.0),
    row(35, 10).consults(36, 1.0).publishes(36, 1.0),
    row(35, 12).consults(37, 1.0).publishes(37, 1.0),
    row(35, 14).consults(38, 1.0).publishes(38, 1.0),
    row(35, 16).consults(39, 1.0).publishes(39, 1.0),
    row(35, 18).consults(40, 1.0).publishes(40, 1.0),
    row(62, 0).consults(0, DEGREES),
    row(62, 4).consults(1, DEGREES),
    row(65, 4).consults(33, 1.0).publishes(33, 1.0),
    row(65, 6).consults(34, 1.0).publishes(34, 1.0),
    row(65, 8).consults(35, 1.0).publishes(35, 1.0),
    row(65, 10).consults(36, 1.0).publishes(36, 1.0),
    row(65, 12).consults(37, 1.0).publishes(37, 1.0),
    row(65, 14).consults(38, 1.0).publishes(38, 1.0),
    row(65, 16).consults(39, 1.0).publishes(39, 1.0),
    row(65, 18).consults(40, 1.0).publishes(40, 1.0),
    row(74, 8).consults(13, 1.0),
    row(74, 12).consults(11, -1.0).publishes(11, -1.0),
    row(74, 16).consults(2, DEGREES),
    row(85, 16).consults(14, 1.0),
    row(85, 20).consults(15, 1.0),
    row(85, 24).consults(11, 1.0),
    row(87, 16).consults(14, 1.0),
    row(87, 20).consults(15, 1.0),
    row(87, 24).consults(11, 1.0),
    row(105, 20).consults(3, 1.0),
    row(105, 24).consults(4, 1.0),
    row(105, 28).consults(5, 1.0),
    row(105, 52).publishes(20, 1.0),
    row(136, 0).consults(31, 1.0),
    row(136, 4).consults(32, 1.0),
    row(136, 12).consults(19, 1.0),
    row(141, 8).consults(20, 1.0).publishes(21, 1.0),
    row(141, 20).publishes(22, 1.0),
    row(147, 10).consults(41, 1.0).publishes(41, 1.0),
    row(147, 30).consults(42, 1.0).publishes(42, 1.0),
    row(164, 0).consults(0, 1.0),
    row(164, 4).consults(1, 1.0),
    row(164, 8).consults(2, 1.0),
    row(178, 0).consults(0, 1.0),
    row(178, 4).consults(1, 1.0),
    row(178, 8).consults(2, 1.0),
    row(178, 12).publishes(19, 1.0),
    row(178, 16).consults(31, 1.0).publishes(31, 1.0),
    row(178, 20).consults(32, 1.0).publishes(32, 1.0),
    row(331, 8).consults(16, 1.0),
    row(331, 12).consults(17, 1.0),
    row(331, 16).consults(18, 1.0),
    row(331, 20).consults(23, 1.0).publishes(27, 1.0),
    row(331, 24).consults(24, 1.0).publishes(28, 1.0),
    row(331, 28).consults(25, 1.0).publishes(29, 1.0),
    row(331, 32).consults(26, 1.0).publishes(30, 1.0),
    row(331, 36).consults(14, 1.0),
    row(331, 40).consults(15, 1.0),
    row(331, 44).consults(11, 1.0),
    row(331, 48).consults(3, 1.0),
    row(331, 52).consults(4, 1.0),
    row(331, 56).consults(5, 1.0),
    row(12_901, 8).consults(21, 1.0),
    row(12_901, 16).consults(22, 1.0),
];

/// The row of a field, counted from 1; 0 where it has none.
pub(super) fn row_of(id: u32, offset: usize) -> u8 {
    let found = ROWS.binary_search_by_key(&(id, offset), |row| (row.id, usize::from(row.offset)));
    found.map_or(0, |index| index as u8 + 1)
}

#[derive(FromZeros)]
pub(super) struct Registers([u32; REGISTERS]);

impl Registers {
    fn get(&self, register: usize) -> f32 {
        self.0.get(register).map_or(0.0, |&bits| f32::from_bits(bits))
    }

    /// Prediction of a float's register, if it uses one, and whether it used the sender's own computation.
    #[inline]
    pub(super) fn consult(&mut self, row: u8) -> Option<(f32, bool)> {
        let row = ROWS.get(usize::from(row).wrapping_sub(1))?;
        let link = row.consults?;
        let register = usize::from(link.register);
        if register == QUATERNION {
            self.quaternion();
        }
        let is_computed = row.id == ATTITUDE_QUATERNION
            && (QUATERNION..QUATERNION + 4).contains(&register)
            && self.0[TIMES] == self.0[TIMES + 1];
        Some((self.get(register) * link.scale, is_computed))
    }

    /// The same of an integer: a number counts without its fraction.
    #[inline]
    pub(super) fn consult_whole(&self, row: u8) -> Option<u32> {
        let link = ROWS.get(usize::from(row).wrapping_sub(1))?.consults?;
        let register = usize::from(link.register);
        if register >= WHOLE {
            return self.0.get(register).copied();
        }
        Some((self.get(register) * link.scale) as i32 as u32)
    }

    #[inline]
    pub(super) fn publish(&mut self, element: &Element) {
        if let Some(row) = ROWS.get(usize::from(element.row()).wrapping_sub(1))
            && let Some(link) = row.publishes
            && let Some(register) = self.0.get_mut(usize::from(link.register))
        {
            let is_whole = usize::from(link.register) >= WHOLE;
            *register = if is_whole { element.last } else { (element.number() * link.scale).to_bits() };
        }
    }

    /// The attitude's quaternion, with the sign of the last received one: both signs mean the same attitude.
    #[inline(never)]
    fn quaternion(&mut self) {
        let [(sr, cr), (sp, cp), (sy, cy)] =
            [0, 1, 2].map(|axis| sine_and_cosine(self.get(ANGLES + axis) * 0.5));
        let (cc, ss, cs, sc) = (cr * cp, sr * sp, cr * sp, sr * cp);
        let made = [cc * cy + ss * sy, sc * cy - cs * sy, cs * cy + sc * sy, cc * sy - ss * cy];
        let terms = [0, 1, 2, 3].map(|at| made[at] * self.get(TOLD + at));
        let turned = terms[0] + terms[1] + (terms[2] + terms[3]) < 0.0;
        for (register, part) in self.0.iter_mut().skip(QUATERNION).zip(made) {
            *register = (if turned { -part } else { part }).to_bits();
        }
    }
}

/// Sine and cosine of an angle up to a right one, by their series. They are the same on every machine, since each
/// operation is rounded to the nearest single-precision number.
fn sine_and_cosine(angle: f32) -> (f32, f32) {
    const SINE: [f32; 6] = [
        1.0 / 6_227_020_800.0,
        -1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        -1.0 / 5_040.0,
        1.0 / 120.0,
        -1.0 / 6.0,
    ];
    const COSINE: [f32; 6] =
        [1.0 / 479_001_600.0, -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5];
    let square = angle * angle;
    let series = |terms: [f32; 6]| terms.into_iter().fold(0.0, |sum, term| (sum + term) * square);
    (angle + angle * series(SINE), 1.0 + series(COSINE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_names_registers_that_exist() {
        assert!(ROWS.is_sorted_by_key(|row| (row.id, row.offset)));
        let links = || ROWS.iter().flat_map(|row| [row.consults, row.publishes]).flatten();
        assert!(links().all(|link| usize::from(link.register) < REGISTERS));
        assert!(ROWS.iter().all(|row| row_of(row.id, usize::from(row.offset)) != 0));
        assert_eq!(row_of(0, 0), 0);
    }

    #[test]
    fn sines_and_cosines_are_near_the_true_ones_and_the_same_to_the_bit_as_ever() {
        let (mut state, mut sum) = (1_u32, 0xcbf2_9ce4_8422_2325_u64);
        for round in 0..2_000_000_u32 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Angles of all sizes up to a right one, and any bits at all.
            let scale = 2_f32.powi(-(round as i32 % 24));
            let angle = (state as i32 >> 7) as f32 * (core::f32::consts::FRAC_PI_2 / 16_777_216.0) * scale;
            let (sine, cosine) = sine_and_cosine(angle);
            let (s, c) = (f64::from(angle).sin(), f64::from(angle).cos());
            assert!((f64::from(sine) - s).abs() <= s.abs() * 2e-7, "{angle}: {sine} for {s}");
            assert!((f64::from(cosine) - c).abs() <= 1.5e-7, "{angle}: {cosine} for {c}");
            let any = sine_and_cosine(f32::from_bits(state));
            for number in [sine, cosine, any.0, any.1] {
                // NaN bits differ between machines, so NaN counts as 0.
                let bits = if number.is_nan() { 0 } else { number.to_bits() };
                sum = (sum ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        // numpy has the same, operation by operation.
        assert_eq!(sum, 0x9333_6fd3_65a9_8eff, "{sum:#x}");
    }

    #[test]
    fn the_table_is_that_of_the_format_document() {
        let document = include_str!("../../../../docs/log-format.md");
        let table = document.split("\n## 10. Links").nth(1).expect("the section");
        let expected: std::vec::Vec<_> =
            table.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
        let mut links = std::vec::Vec::new();
        for Row { id, offset, consults, publishes } in &ROWS {
            for (what, link) in [("consults", consults), ("publishes", publishes)] {
                if let Some(Link { register, scale }) = link {
                    links.push(std::format!("| {id} | {offset} | {what} | {register} | {scale:?} |"));
                }
            }
        }
        assert_eq!(expected, links);
    }

    #[test]
    fn every_link_names_a_field_of_the_dialect() {
        for row in &ROWS {
            let message = hums_dialect::message(row.id).expect("known");
            let mut offset = 0;
            let found = message.fields.iter().any(|field| {
                let within = usize::from(row.offset).wrapping_sub(offset);
                offset += field.size();
                within < field.size() && within % field.kind.size() == 0
            });
            assert!(found, "message {} offset {}", row.id, row.offset);
        }
    }
}
