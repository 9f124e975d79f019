//! A line of a parameter file, as ground stations keep them.
//!
//! | program | a line |
//! |---|---|
//! | Mission Planner | `NAME,VALUE` |
//! | `MAVProxy`, `ArduPilot` | `NAME VALUE` |
//! | `QGroundControl` | `SYSTEM COMPONENT NAME VALUE TYPE`, with tabs; lines of other components than ours are left out |
//!
//! `#` begins a comment.

/// Our MAVLink component, as `QGroundControl`'s files name it.
const COMPONENT: &str = "191";

/// What a line says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Line<'a> {
    /// Nothing, or nothing for us.
    Nothing,
    /// A parameter's name, and its value as it is written.
    Set(&'a str, &'a str),
    /// Nothing that can be understood.
    Wrong,
}

/// Reads a line.
pub fn read(line: &str) -> Line<'_> {
    let line = line.trim_start_matches('\u{feff}').split('#').next().unwrap_or_default();
    let mut words = line.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    match [(); 6].map(|()| words.next()) {
        [None, ..] => Line::Nothing,
        [Some(name), Some(value), None, ..]
        | [Some(_), Some(COMPONENT), Some(name), Some(value), Some(_), None] => Line::Set(name, value),
        [Some(system), Some(component), Some(_), Some(_), Some(kind), None]
            if [system, component, kind].iter().all(|word| word.parse::<u32>().is_ok()) =>
        {
            Line::Nothing
        }
        _ => Line::Wrong,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_every_ground_station_are_read() {
        let set = Line::Set("CELL_VOLT_WARN", "3.5");
        for line in ["CELL_VOLT_WARN,3.5", "  CELL_VOLT_WARN\t3.5 # lipo\r", "1\t191\tCELL_VOLT_WARN\t3.5\t9"]
        {
            assert_eq!(read(line), set, "{line}");
        }
        for line in ["", "  ", "# Onboard parameters for Vehicle 1", "\u{feff}", "1\t1\tARMING_CHECK\t1\t6"] {
            assert_eq!(read(line), Line::Nothing, "{line}");
        }
        for line in ["CELL_VOLT_WARN", "CELL_VOLT_WARN 3.5 3.6", "a b c d e f"] {
            assert_eq!(read(line), Line::Wrong, "{line}");
        }
    }
}
