//! Payload bytes as typed values, for every output format.
//!
//! MAVLink 2 omits the trailing zero bytes of a payload, and MAVLink 1 the extension fields: missing bytes read as
//! zero. Of a longer, newer payload the known fields are kept.

use hums_dialect::{Field, Kind, Message};
use serde::Serialize;

/// One field's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldValue<'a> {
    /// A number.
    Scalar(Scalar),
    /// An array of numbers.
    Array(Array<'a>),
    /// Up to the first NUL. It should be UTF-8, but vehicles send any bytes.
    Text(&'a [u8]),
}

/// One number, in the type it was sent in. As JSON it is 15.3, not 15.300000190734863.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Scalar {
    /// An unsigned integer of any width.
    Unsigned(u64),
    /// A signed integer of any width.
    Signed(i64),
    /// A `float`.
    Single(f32),
    /// A `double`.
    Double(f64),
}

impl Scalar {
    /// The number at the beginning of some bytes.
    pub fn read(kind: Kind, bytes: &[u8]) -> Option<Self> {
        bytes.get(..kind.size()).map(|bytes| scalar(kind, bytes))
    }

    /// Exact but for integers beyond 2^53.
    pub fn as_f64(self) -> f64 {
        match self {
            Self::Unsigned(value) => value as f64,
            Self::Signed(value) => value as f64,
            Self::Single(value) => f64::from(value),
            Self::Double(value) => value,
        }
    }
}

/// An array field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Array<'a> {
    kind: Kind,
    bytes: &'a [u8],
}

impl<'a> Array<'a> {
    /// The elements in order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Scalar> + 'a {
        self.bytes.chunks_exact(self.kind.size()).map(move |bytes| scalar(self.kind, bytes))
    }

    /// A `uint8_t` array is often tunnelled data or a file's content.
    pub fn as_bytes(self) -> Option<&'a [u8]> {
        (self.kind == Kind::U8).then_some(self.bytes)
    }
}

/// Full length, its end filled with zeros.
#[derive(Clone, Debug)]
pub struct Payload {
    message: &'static Message,
    bytes: [u8; 256],
}

impl Payload {
    /// Of a verified frame.
    pub fn of(frame: &hums_link::Frame<'_>) -> Option<Self> {
        let message = hums_dialect::messages().get(usize::from(frame.message()?))?;
        Some(Self::new(message, frame.payload()))
    }

    /// The checksum must match `message`.
    pub fn new(message: &'static Message, payload: &[u8]) -> Self {
        let mut bytes = [0; 256];
        let known = payload.len().min(usize::from(message.len_max));
        if let (Some(to), Some(from)) = (bytes.get_mut(..known), payload.get(..known)) {
            to.copy_from_slice(from);
        }
        Self { message, bytes }
    }

    /// Each field with its value, in wire order.
    pub fn fields(&self) -> impl Iterator<Item = (&'static Field, FieldValue<'_>)> {
        let mut at = 0;
        self.message.fields.iter().map(move |field| {
            let bytes = self.bytes.get(at..at + field.size()).unwrap_or_default();
            at += field.size();
            (field, value(field, bytes))
        })
    }

    /// A field by name; of an array, its first element.
    pub fn number(&self, name: &str) -> Option<f64> {
        let (_, value) = self.fields().find(|(field, _)| field.name == name)?;
        match value {
            FieldValue::Scalar(scalar) => Some(scalar.as_f64()),
            FieldValue::Array(array) => array.iter().next().map(Scalar::as_f64),
            FieldValue::Text(_) => None,
        }
    }
}

fn value<'a>(field: &Field, bytes: &'a [u8]) -> FieldValue<'a> {
    match (field.kind, field.array) {
        (Kind::Char, _) => FieldValue::Text(bytes.split(|&byte| byte == 0).next().unwrap_or_default()),
        (kind, 0) => FieldValue::Scalar(scalar(kind, bytes)),
        (kind, _) => FieldValue::Array(Array { kind, bytes }),
    }
}

fn scalar(kind: Kind, bytes: &[u8]) -> Scalar {
    /// A known count, none at run time: a table has millions of values.
    fn these<const N: usize>(bytes: &[u8]) -> [u8; N] {
        bytes.first_chunk().copied().unwrap_or([0; N])
    }
    match kind {
        Kind::U8 | Kind::Char => Scalar::Unsigned(u8::from_le_bytes(these(bytes)).into()),
        Kind::U16 => Scalar::Unsigned(u16::from_le_bytes(these(bytes)).into()),
        Kind::U32 => Scalar::Unsigned(u32::from_le_bytes(these(bytes)).into()),
        Kind::U64 => Scalar::Unsigned(u64::from_le_bytes(these(bytes))),
        Kind::I8 => Scalar::Signed(i8::from_le_bytes(these(bytes)).into()),
        Kind::I16 => Scalar::Signed(i16::from_le_bytes(these(bytes)).into()),
        Kind::I32 => Scalar::Signed(i32::from_le_bytes(these(bytes)).into()),
        Kind::I64 => Scalar::Signed(i64::from_le_bytes(these(bytes))),
        Kind::F32 => Scalar::Single(f32::from_le_bytes(these(bytes))),
        Kind::F64 => Scalar::Double(f64::from_le_bytes(these(bytes))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(name: &str) -> &'static Message {
        hums_dialect::messages().iter().find(|message| message.name == name).expect(name)
    }

    #[test]
    fn truncated_payload_reads_as_zeros() {
        let statustext = message("STATUSTEXT");
        let payload = Payload::new(statustext, b"\x06Hello");
        let fields: Vec<_> = payload.fields().map(|(field, value)| (field.name, value)).collect();
        assert_eq!(fields[0], ("severity", FieldValue::Scalar(Scalar::Unsigned(6))));
        assert_eq!(fields[1], ("text", FieldValue::Text(b"Hello")));
        assert_eq!(fields[2], ("id", FieldValue::Scalar(Scalar::Unsigned(0))));
    }

    #[test]
    fn negative_and_wide_numbers_keep_their_type() {
        // time_boot_ms u32, then six floats.
        let ned = message("LOCAL_POSITION_NED");
        let mut bytes = vec![0xff, 0xff, 0xff, 0xff];
        bytes.extend((-1.5f32).to_le_bytes());
        let payload = Payload::new(ned, &bytes);
        assert_eq!(payload.number("time_boot_ms"), Some(4_294_967_295.0));
        assert_eq!(payload.number("x"), Some(-1.5));
        assert_eq!(payload.number("vz"), Some(0.0));
        assert_eq!(payload.number("no such field"), None);
    }

    #[test]
    fn arrays_have_all_their_elements() {
        let battery = message("BATTERY_STATUS");
        let payload = Payload::new(battery, &[0xff; 36]);
        let (_, voltages) = payload.fields().find(|(field, _)| field.name == "voltages").expect("voltages");
        let FieldValue::Array(voltages) = voltages else { panic!("{voltages:?}") };
        assert_eq!(voltages.iter().collect::<Vec<_>>(), vec![Scalar::Unsigned(65_535); 10]);
        assert_eq!(payload.number("temperature"), Some(-1.0));
    }

    #[test]
    fn every_message_reads_whole_from_any_length() {
        for message in hums_dialect::messages() {
            for length in [0, 1, usize::from(message.len_max), 255] {
                let payload = Payload::new(message, &vec![0xa5; length]);
                assert_eq!(payload.fields().count(), message.fields.len());
            }
        }
    }
}
