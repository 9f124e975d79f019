//! Messages and their descriptors in Protocol Buffers, by the
//! [encoding](https://protobuf.dev/programming-guides/encoding/) and `descriptor.proto`.

/// The type's number in `FieldDescriptorProto`, and the full name if it is a message or an enumeration.
pub(super) type Type = (u64, &'static str);

pub(super) const DOUBLE: Type = (1, "");
pub(super) const FLOAT: Type = (2, "");
pub(super) const INT64: Type = (3, "");
pub(super) const UINT64: Type = (4, "");
pub(super) const INT32: Type = (5, "");
pub(super) const BOOL: Type = (8, "");
pub(super) const STRING: Type = (9, "");
pub(super) const MESSAGE: u64 = 11;
pub(super) const BYTES: Type = (12, "");
pub(super) const ENUM: u64 = 14;
pub(super) const SINT64: Type = (18, "");

#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) kind: Type,
    pub(super) is_list: bool,
}

pub(super) type Enumeration = (&'static str, &'static [&'static str]);

const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const LENGTH: u64 = 2;
const FIXED32: u64 = 5;

pub(super) fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn tag(out: &mut Vec<u8>, number: u32, wire: u64) {
    varint(out, u64::from(number) << 3 | wire);
}

/// Small negative numbers are short.
pub(super) const fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

pub(super) fn unsigned(out: &mut Vec<u8>, number: u32, value: u64) {
    tag(out, number, VARINT);
    varint(out, value);
}

pub(super) fn signed(out: &mut Vec<u8>, number: u32, value: i64) {
    unsigned(out, number, zigzag(value));
}

pub(super) fn float(out: &mut Vec<u8>, number: u32, value: f32) {
    tag(out, number, FIXED32);
    out.extend_from_slice(&value.to_le_bytes());
}

pub(super) fn double(out: &mut Vec<u8>, number: u32, value: f64) {
    tag(out, number, FIXED64);
    out.extend_from_slice(&value.to_le_bytes());
}

pub(super) fn bytes(out: &mut Vec<u8>, number: u32, value: &[u8]) {
    tag(out, number, LENGTH);
    varint(out, value.len() as u64);
    out.extend_from_slice(value);
}

/// A message in a message, or a list of numbers. Most are shorter than 128 bytes, whose length takes one.
pub(super) fn inside(out: &mut Vec<u8>, number: u32, write: impl FnOnce(&mut Vec<u8>)) {
    tag(out, number, LENGTH);
    let place = out.len();
    out.push(0);
    write(out);
    let length = out.len() - place - 1;
    if let (Some(byte), true) = (out.get_mut(place), length < 0x80) {
        *byte = length as u8;
        return;
    }
    let mut long = Vec::new();
    varint(&mut long, length as u64);
    out.splice(place..=place, long);
}

pub(super) fn file(
    out: &mut Vec<u8>,
    (name, package): (&str, &str),
    depends_on: Option<&str>,
    messages: &[(&str, Vec<Field>, Option<Enumeration>)],
) {
    inside(out, 1, |out| {
        bytes(out, 1, name.as_bytes());
        bytes(out, 2, package.as_bytes());
        if let Some(other) = depends_on {
            bytes(out, 3, other.as_bytes());
        }
        for (name, fields, enumeration) in messages {
            inside(out, 4, |out| {
                bytes(out, 1, name.as_bytes());
                for field in fields {
                    inside(out, 2, |out| define(out, field));
                }
                if let Some((name, values)) = enumeration {
                    inside(out, 4, |out| {
                        bytes(out, 1, name.as_bytes());
                        for (number, name) in (0..).zip(*values) {
                            inside(out, 2, |out| {
                                bytes(out, 1, name.as_bytes());
                                unsigned(out, 2, number);
                            });
                        }
                    });
                }
            });
        }
    });
}

/// Without a syntax a file is of version 2, in which a missing field differs from zero.
fn define(out: &mut Vec<u8>, field: &Field) {
    const OPTIONAL: u64 = 1;
    const REPEATED: u64 = 3;
    bytes(out, 1, field.name.as_bytes());
    unsigned(out, 3, u64::from(field.number));
    unsigned(out, 4, if field.is_list { REPEATED } else { OPTIONAL });
    let (kind, name) = field.kind;
    unsigned(out, 5, kind);
    if !name.is_empty() {
        bytes(out, 6, name.as_bytes());
    }
    if field.is_list {
        // `FieldOptions.packed`
        inside(out, 8, |out| unsigned(out, 2, 1));
    }
}
