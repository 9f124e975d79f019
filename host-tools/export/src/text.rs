//! Values as text: the cells of a CSV table and the members of a JSON object.
//!
//! Floats are printed with the fewest digits that read back as the same float. CSV spells the special ones `NaN`,
//! `inf` and `-inf`, which Python, pandas and `DuckDB` read. JSON has no such numbers: there NaN is `null`, and the
//! infinities are the strings `"Infinity"` and `"-Infinity"`. Text that is not UTF-8 gets replacement characters; its
//! bytes are in the `tlog` output.

use hums_dialect::{Kind, Message};

use crate::mavlink::values::{FieldValue, Payload, Scalar};

/// The names of a message's columns, with units: `alt[mm]`, `voltages[3][mV]`.
pub fn columns(message: &Message) -> Vec<String> {
    let mut columns = Vec::new();
    for field in message.fields {
        let units = if field.units.is_empty() { String::new() } else { format!("[{}]", field.units) };
        if field.kind == Kind::Char || field.array == 0 {
            columns.push(format!("{}{units}", field.name));
        } else {
            columns.extend((0..field.count()).map(|index| format!("{}[{index}]{units}", field.name)));
        }
    }
    columns
}

/// First characters of a formula, which a spreadsheet would run: a vehicle's text must not become one. The
/// full-width forms count too on systems with Japanese or Chinese (OWASP, "CSV Injection").
const FORMULA: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];

/// One cell of text, quoted if CSV (RFC 4180) needs it. A text that would be a formula, or begins with an
/// apostrophe, gets an apostrophe before it. So removing the first apostrophe always restores the text.
pub fn push_csv_text(out: &mut Vec<u8>, text: &[u8]) {
    let mut text = String::from_utf8_lossy(text);
    if text.starts_with('\'') || text.starts_with(FORMULA) {
        text.to_mut().insert(0, '\'');
    }
    if !text.bytes().any(|byte| matches!(byte, b',' | b'"' | b'\r' | b'\n')) {
        out.extend_from_slice(text.as_bytes());
        return;
    }
    out.push(b'"');
    for byte in text.bytes() {
        if byte == b'"' {
            out.push(b'"');
        }
        out.push(byte);
    }
    out.push(b'"');
}

/// The cells of a payload, each with a comma before it, as [`columns`] names them.
pub fn push_csv_cells(out: &mut Vec<u8>, payload: &Payload) {
    for (_, value) in payload.fields() {
        match value {
            FieldValue::Scalar(scalar) => {
                out.push(b',');
                push_csv_number(out, scalar);
            }
            FieldValue::Array(array) => {
                for scalar in array.iter() {
                    out.push(b',');
                    push_csv_number(out, scalar);
                }
            }
            FieldValue::Text(text) => {
                out.push(b',');
                push_csv_text(out, text);
            }
        }
    }
}

/// One number as a CSV cell.
pub fn push_csv_number(out: &mut Vec<u8>, scalar: Scalar) {
    match scalar {
        Scalar::Single(value) if !value.is_finite() => out.extend_from_slice(special(f64::from(value))),
        Scalar::Double(value) if !value.is_finite() => out.extend_from_slice(special(value)),
        _ => push_finite(out, scalar),
    }
}

fn special(value: f64) -> &'static [u8] {
    if value.is_nan() {
        b"NaN"
    } else if value > 0.0 {
        b"inf"
    } else {
        b"-inf"
    }
}

/// A finite number.
pub fn push_finite(out: &mut Vec<u8>, scalar: Scalar) {
    match scalar {
        Scalar::Unsigned(value) => push_integer(out, value),
        Scalar::Signed(value) => out.extend_from_slice(itoa::Buffer::new().format(value).as_bytes()),
        Scalar::Single(value) => out.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes()),
        Scalar::Double(value) => out.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes()),
    }
}

/// An integer in decimal.
pub fn push_integer(out: &mut Vec<u8>, value: u64) {
    out.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// The members of a payload as one JSON object.
pub fn push_json_object(out: &mut Vec<u8>, payload: &Payload) {
    let mut separator = b'{';
    for (field, value) in payload.fields() {
        out.push(separator);
        separator = b',';
        push_json_text(out, field.name.as_bytes());
        out.push(b':');
        match value {
            FieldValue::Scalar(scalar) => push_json_number(out, scalar),
            FieldValue::Text(text) => push_json_text(out, text),
            FieldValue::Array(array) => {
                let mut separator = b'[';
                for scalar in array.iter() {
                    out.push(separator);
                    separator = b',';
                    push_json_number(out, scalar);
                }
                out.push(b']');
            }
        }
    }
    if separator == b'{' {
        out.push(b'{');
    }
    out.push(b'}');
}

/// One number as JSON.
pub fn push_json_number(out: &mut Vec<u8>, scalar: Scalar) {
    let as_f64 = scalar.as_f64();
    if as_f64.is_nan() {
        out.extend_from_slice(b"null");
    } else if as_f64.is_infinite() {
        out.extend_from_slice(if as_f64 > 0.0 { b"\"Infinity\"" } else { b"\"-Infinity\"" });
    } else {
        push_finite(out, scalar);
    }
}

/// Text as a JSON string.
pub fn push_json_text(out: &mut Vec<u8>, text: &[u8]) {
    // Most texts need no escape; looking for one takes less than writing byte by byte.
    if text.iter().all(|byte| matches!(byte, b' '..=b'~') && *byte != b'"' && *byte != b'\\') {
        out.push(b'"');
        out.extend_from_slice(text);
        out.push(b'"');
        return;
    }
    let _ = serde_json::to_writer(out, &String::from_utf8_lossy(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(scalar: Scalar) -> String {
        let mut out = Vec::new();
        push_csv_number(&mut out, scalar);
        String::from_utf8(out).expect("ASCII")
    }

    fn json(scalar: Scalar) -> String {
        let mut out = Vec::new();
        push_json_number(&mut out, scalar);
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn floats_read_back_as_the_same_float() {
        for value in [0.1f32, -0.0, 1.0e-45, f32::MAX, 16_777_217.0, 1.0 / 3.0] {
            let text = csv(Scalar::Single(value));
            assert_eq!(text.parse::<f32>().expect(&text).to_bits(), value.to_bits(), "{text}");
        }
        assert_eq!(csv(Scalar::Single(0.1)), "0.1");
        assert_eq!(csv(Scalar::Unsigned(u64::MAX)), "18446744073709551615");
        assert_eq!(csv(Scalar::Signed(-128)), "-128");
    }

    #[test]
    fn what_is_no_number_has_a_spelling_in_each_format() {
        assert_eq!(csv(Scalar::Single(f32::NAN)), "NaN");
        assert_eq!(csv(Scalar::Double(f64::NEG_INFINITY)), "-inf");
        assert_eq!(json(Scalar::Single(f32::NAN)), "null");
        assert_eq!(json(Scalar::Single(f32::INFINITY)), "\"Infinity\"");
    }

    #[test]
    fn text_is_quoted_where_it_must_be() {
        let quoted = |text: &[u8]| {
            let mut out = Vec::new();
            push_csv_text(&mut out, text);
            String::from_utf8(out).expect("UTF-8")
        };
        assert_eq!(quoted(b"EKF3 IMU0"), "EKF3 IMU0");
        assert_eq!(quoted(b"a,\"b\"\n"), "\"a,\"\"b\"\"\n\"");
        assert_eq!(quoted(b"\xff"), "\u{fffd}");
    }

    #[test]
    fn any_text_reads_back_from_json() {
        for byte in 0..=u8::MAX {
            let (text, mut out) = ([b'a', byte, b'z'], Vec::new());
            push_json_text(&mut out, &text);
            assert_eq!(serde_json::from_slice::<String>(&out).expect("JSON"), String::from_utf8_lossy(&text));
        }
    }

    #[test]
    fn no_text_is_a_formula_to_a_spreadsheet_and_each_is_read_back() {
        for text in
            ["=HYPERLINK(\"http://x\",\"y\")", "+1", "-1", "@SUM(A1)", "\tx", "\rx", "'quoted", "''", "＝1"]
        {
            let mut out = Vec::new();
            push_csv_text(&mut out, text.as_bytes());
            let cell = String::from_utf8(out).expect("UTF-8");
            let inner = cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"'));
            let cell = inner.map_or(cell.clone(), |inner| inner.replace("\"\"", "\""));
            assert_eq!(cell.strip_prefix('\''), Some(text), "{cell}");
        }
        let mut out = Vec::new();
        push_csv_text(&mut out, b"a=b");
        assert_eq!(out, b"a=b");
    }

    #[test]
    fn columns_and_cells_match_for_every_message() {
        for message in hums_dialect::messages() {
            let payload = Payload::new(message, &[]);
            let mut out = Vec::new();
            push_csv_cells(&mut out, &payload);
            // Each cell has its comma before it.
            let cells = out.split(|&byte| byte == b',').count() - 1;
            assert_eq!(cells, columns(message).len(), "{}", message.name);
            let mut object = Vec::new();
            push_json_object(&mut object, &payload);
            let object: serde_json::Value = serde_json::from_slice(&object).expect(message.name);
            assert_eq!(object.as_object().map(serde_json::Map::len), Some(message.fields.len()));
        }
    }

    #[test]
    fn units_and_indices_stand_in_the_header() {
        let message = |id| hums_dialect::message(id).expect("known");
        assert!(columns(message(24)).contains(&"alt[mm]".to_owned()));
        assert!(columns(message(147)).contains(&"voltages[9][mV]".to_owned()));
        assert!(columns(message(253)).contains(&"text".to_owned()));
    }
}
