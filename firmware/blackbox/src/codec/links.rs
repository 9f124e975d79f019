//! The same quantity in several messages: a velocity comes in centimetres per second in one message and as a float in
//! another. Messages publish such quantities into registers; floats are then also predicted from their register.
//!
//! The table is part of format version 2. It names fields by message id and byte offset; where a layout has something
//! else there, the prediction is bad, but writer and reader still agree.

/// Quantities kept.
pub(crate) const REGISTERS: usize = 22;

/// What a field has to do with a register. `scale` turns the field's unit into the register's or back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub(crate) id: u32,
    pub(crate) offset: u8,
    pub(crate) register: u8,
    /// Published value = field x scale; prediction = register x scale.
    pub(crate) scale: f32,
    pub(crate) publishes: bool,
}

const fn publish(id: u32, offset: u8, register: u8, scale: f32) -> Link {
    Link { id, offset, register, scale, publishes: true }
}

const fn consult(id: u32, offset: u8, register: u8, scale: f32) -> Link {
    Link { id, offset, register, scale, publishes: false }
}

/// Degrees in a radian.
const DEGREES: f32 = 57.295_78;

/// By id, then offset; a field's `consult` before its `publish`. Registers: 0-2 roll, pitch, yaw in rad; 3-5 body
/// rates in rad/s; 6-8 the same from the raw IMU; 9-11 NED velocity in m/s (`GLOBAL_POSITION_INT`); 12 relative
/// altitude, 13 altitude in m; 15-17 NED velocity (`LOCAL_POSITION_NED`); 18 altitude (`AHRS2`); 19 pressure altitude;
/// 20, 21 monotonic and relative altitude (`ALTITUDE`); 14 climb rate in m/s.
pub(crate) static LINKS: [Link; 57] = [
    publish(27, 14, 6, 0.001),
    publish(27, 16, 7, 0.001),
    publish(27, 18, 8, 0.001),
    publish(30, 4, 0, 1.0),
    publish(30, 8, 1, 1.0),
    publish(30, 12, 2, 1.0),
    consult(30, 16, 6, 1.0),
    publish(30, 16, 3, 1.0),
    consult(30, 20, 7, 1.0),
    publish(30, 20, 4, 1.0),
    consult(30, 24, 8, 1.0),
    publish(30, 24, 5, 1.0),
    consult(31, 20, 3, 1.0),
    consult(31, 24, 4, 1.0),
    consult(31, 28, 5, 1.0),
    consult(32, 12, 12, -1.0),
    consult(32, 16, 9, 1.0),
    publish(32, 16, 15, 1.0),
    consult(32, 20, 10, 1.0),
    publish(32, 20, 16, 1.0),
    consult(32, 24, 11, 1.0),
    publish(32, 24, 17, 1.0),
    publish(33, 12, 13, 0.001),
    publish(33, 16, 12, 0.001),
    publish(33, 20, 9, 0.01),
    publish(33, 22, 10, 0.01),
    publish(33, 24, 11, 0.01),
    consult(62, 0, 0, DEGREES),
    consult(62, 4, 1, DEGREES),
    consult(74, 8, 13, 1.0),
    consult(74, 12, 11, -1.0),
    publish(74, 12, 14, 1.0),
    consult(85, 16, 15, 1.0),
    consult(85, 20, 16, 1.0),
    consult(85, 24, 17, 1.0),
    consult(87, 16, 15, 1.0),
    consult(87, 20, 16, 1.0),
    consult(87, 24, 17, 1.0),
    consult(105, 20, 3, 1.0),
    consult(105, 24, 4, 1.0),
    consult(105, 28, 5, 1.0),
    publish(105, 52, 19, 1.0),
    consult(136, 12, 18, 1.0),
    consult(141, 8, 19, 1.0),
    publish(141, 8, 20, 1.0),
    publish(141, 20, 21, 1.0),
    consult(164, 0, 0, 1.0),
    consult(164, 4, 1, 1.0),
    consult(164, 8, 2, 1.0),
    consult(178, 0, 0, 1.0),
    consult(178, 4, 1, 1.0),
    consult(178, 8, 2, 1.0),
    publish(178, 12, 18, 1.0),
    consult(12_901, 8, 20, 1.0),
    consult(12_901, 16, 21, 1.0),
    // Ends that keep the search simple: no such ids.
    publish(u32::MAX, 0, 0, 1.0),
    publish(u32::MAX, 1, 0, 1.0),
];

/// Where the links of a message begin in the table.
pub(crate) fn first(id: u32) -> u8 {
    LINKS.partition_point(|link| link.id < id) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_names_registers_that_exist() {
        assert!(LINKS.is_sorted_by_key(|link| (link.id, link.offset)));
        assert!(LINKS.iter().all(|link| usize::from(link.register) < REGISTERS));
        assert_eq!(LINKS[usize::from(first(62))].id, 62);
    }

    #[test]
    fn the_table_is_that_of_the_format_document() {
        let document = include_str!("../../../../docs/log-format.md");
        let table = document.split("\n## 10. Links").nth(1).expect("the section");
        let rows: std::vec::Vec<_> = table.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
        let row = |link: &Link| {
            let what = if link.publishes { "publishes" } else { "consults" };
            let Link { id, offset, register, scale, .. } = link;
            std::format!("| {id} | {offset} | {what} | {register} | {scale:?} |")
        };
        let links: std::vec::Vec<_> = LINKS.iter().filter(|link| link.id != u32::MAX).map(row).collect();
        assert_eq!(rows, links);
    }

    #[test]
    fn every_link_names_a_field_of_the_dialect() {
        for link in LINKS.iter().filter(|link| link.id != u32::MAX) {
            let message = hums_dialect::message(link.id).expect("known");
            let mut offset = 0;
            let found = message.fields.iter().any(|field| {
                let here = offset == usize::from(link.offset);
                offset += field.size();
                here
            });
            assert!(found, "message {} offset {}", link.id, link.offset);
        }
    }
}
