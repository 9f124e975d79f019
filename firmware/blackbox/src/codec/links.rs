//! The same quantity in several messages: a velocity comes in centimetres per second in one message and as a float in
//! another. Messages publish such quantities into registers; floats are then also predicted from their register.
//!
//! The table is part of format version 2. It names fields by message id and byte offset; where a layout has something
//! else there, the prediction is bad, but writer and reader still agree.

use super::element::Element;

/// Quantities kept.
const REGISTERS: usize = 22;

/// A register, and what turns the field's unit into the register's or back.
#[derive(Clone, Copy, Debug)]
struct Link {
    register: u8,
    /// Published value = field x scale; prediction = register x scale.
    scale: f32,
}

/// What a field has to do with registers.
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

/// Degrees in a radian.
const DEGREES: f32 = 57.295_78;

/// By id, then offset. Registers: 0-2 roll, pitch, yaw in rad; 3-5 body
/// rates in rad/s; 6-8 the same from the raw IMU; 9-11 NED velocity in m/s (`GLOBAL_POSITION_INT`); 12 relative
/// altitude, 13 altitude in m; 15-17 NED velocity (`LOCAL_POSITION_NED`); 18 altitude (`AHRS2`); 19 pressure altitude;
/// 20, 21 monotonic and relative altitude (`ALTITUDE`); 14 climb rate in m/s.
static ROWS: [Row; 47] = [
    row(27, 14).publishes(6, 0.001),
    row(27, 16).publishes(7, 0.001),
    row(27, 18).publishes(8, 0.001),
    row(30, 4).publishes(0, 1.0),
    row(30, 8).publishes(1, 1.0),
    row(30, 12).publishes(2, 1.0),
    row(30, 16).consults(6, 1.0).publishes(3, 1.0),
    row(30, 20).consults(7, 1.0).publishes(4, 1.0),
    row(30, 24).consults(8, 1.0).publishes(5, 1.0),
    row(31, 20).consults(3, 1.0),
    row(31, 24).consults(4, 1.0),
    row(31, 28).consults(5, 1.0),
    row(32, 12).consults(12, -1.0),
    row(32, 16).consults(9, 1.0).publishes(15, 1.0),
    row(32, 20).consults(10, 1.0).publishes(16, 1.0),
    row(32, 24).consults(11, 1.0).publishes(17, 1.0),
    row(33, 12).publishes(13, 0.001),
    row(33, 16).publishes(12, 0.001),
    row(33, 20).publishes(9, 0.01),
    row(33, 22).publishes(10, 0.01),
    row(33, 24).publishes(11, 0.01),
    row(62, 0).consults(0, DEGREES),
    row(62, 4).consults(1, DEGREES),
    row(74, 8).consults(13, 1.0),
    row(74, 12).consults(11, -1.0).publishes(14, 1.0),
    row(85, 16).consults(15, 1.0),
    row(85, 20).consults(16, 1.0),
    row(85, 24).consults(17, 1.0),
    row(87, 16).consults(15, 1.0),
    row(87, 20).consults(16, 1.0),
    row(87, 24).consults(17, 1.0),
    row(105, 20).consults(3, 1.0),
    row(105, 24).consults(4, 1.0),
    row(105, 28).consults(5, 1.0),
    row(105, 52).publishes(19, 1.0),
    row(136, 12).consults(18, 1.0),
    row(141, 8).consults(19, 1.0).publishes(20, 1.0),
    row(141, 20).publishes(21, 1.0),
    row(164, 0).consults(0, 1.0),
    row(164, 4).consults(1, 1.0),
    row(164, 8).consults(2, 1.0),
    row(178, 0).consults(0, 1.0),
    row(178, 4).consults(1, 1.0),
    row(178, 8).consults(2, 1.0),
    row(178, 12).publishes(18, 1.0),
    row(12_901, 8).consults(20, 1.0),
    row(12_901, 16).consults(21, 1.0),
];

/// The row of a field, counted from 1; 0 where it has none.
pub(super) fn row_of(id: u32, offset: usize) -> u8 {
    let found = ROWS.binary_search_by_key(&(id, offset), |row| (row.id, usize::from(row.offset)));
    found.map_or(0, |index| index as u8 + 1)
}

/// The quantities as they were told last.
pub(super) struct Registers([f32; REGISTERS]);

impl Registers {
    pub(super) const fn new() -> Self {
        Self([0.0; REGISTERS])
    }

    /// What a field's register lets expect of it, if it consults one.
    #[inline]
    pub(super) fn consult(&self, row: u8) -> Option<f32> {
        let link = ROWS.get(usize::from(row).wrapping_sub(1))?.consults?;
        self.0.get(usize::from(link.register)).map(|known| known * link.scale)
    }

    /// A field tells its register.
    #[inline]
    pub(super) fn publish(&mut self, element: &Element) {
        if let Some(row) = ROWS.get(usize::from(element.row()).wrapping_sub(1))
            && let Some(link) = row.publishes
            && let Some(register) = self.0.get_mut(usize::from(link.register))
        {
            *register = element.number() * link.scale;
        }
    }
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
                let here = offset == usize::from(row.offset);
                offset += field.size();
                here
            });
            assert!(found, "message {} offset {}", row.id, row.offset);
        }
    }
}
