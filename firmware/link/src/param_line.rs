//! A line of a parameter file in the form of ground stations.
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

/// Content of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Line<'a> {
    /// Nothing for us.
    Nothing,
    /// Name, and value as text.
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

/// A number in common notation: `-3.6`, `0.070000000298`, `1e-05`; `None` without a number. For the board: the
/// standard library's exact conversion takes 14 KB of flash.
pub fn value(text: &str) -> Option<f32> {
    let (sign, text) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, exponent.parse::<i8>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && part.is_empty() {
        return None;
    }
    let (mut number, mut scale) = (0_u64, i32::from(exponent));
    for (is_part, digit) in
        whole.bytes().map(|digit| (false, digit)).chain(part.bytes().map(|digit| (true, digit)))
    {
        let digit = digit.is_ascii_digit().then_some(u64::from(digit.wrapping_sub(b'0')))?;
        // Digits beyond 64 bits are far beyond the value's precision.
        match number.checked_mul(10).and_then(|number| number.checked_add(digit)) {
            Some(more) => (number, scale) = (more, scale - i32::from(is_part)),
            None => scale += i32::from(!is_part),
        }
    }
    let ten = (0..scale.unsigned_abs().min(330)).fold(1.0_f64, |ten, _| ten * 10.0);
    let number = number as f64;
    Some((sign * if scale < 0 { number / ten } else { number * ten }) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_the_standard_library_reads_them() {
        for text in [
            "0",
            "-0",
            "3.6",
            "-12.25",
            "+7",
            ".5",
            "5.",
            "0.070000000298023224",
            "921600",
            "1e-05",
            "2.5E3",
            "1000000",
        ] {
            let (ours, theirs) = (value(text).expect(text), text.parse::<f32>().expect(text));
            assert_eq!(ours.to_bits(), theirs.to_bits(), "{text}: {ours} {theirs}");
        }
        for text in ["", "-", ".", "nan", "inf", "1,5", "1e", "1e999", "0x10", "--1", "1 2"] {
            assert_eq!(value(text), None, "{text}");
        }
        assert_eq!(value("99999999999999999999999999e100"), Some(f32::INFINITY), "out of any range");
    }

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
