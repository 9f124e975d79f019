//! Format definitions and layouts of messages.
//!
//! A definition (`vehicle_attitude:uint64_t timestamp;float[4] q;`) may name other definitions as types of its
//! fields, also later ones. [`Formats::layout`] resolves one to a flat list of numbers with places. Limits guard
//! against hostile files; PX4's logs stay far below.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use hums_dialect::Kind;

use crate::mavlink::values::Scalar;
use crate::source::item::CellValue;

/// Formats in one log. PX4 has some 250.
const FORMATS_MAX: usize = 1_024;
/// PX4's are some 60 KiB.
const TEXT_BYTES_MAX: usize = 1 << 20;
/// Of definitions that name each other. PX4's deepest is 2.
const DEPTH_MAX: usize = 8;
/// The length is a `u16`, two bytes of it the subscription's number.
const MESSAGE_BYTES_MAX: usize = u16::MAX as usize - 2;
/// Of all resolved definitions, elements of arrays of definitions counted. PX4: some 6,000.
const FIELDS_MAX: usize = 32_768;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    Of(Kind),
    Bool,
}

impl Number {
    /// Several are a text.
    pub(super) const CHAR: Self = Self::Of(Kind::Char);

    pub(super) fn named(name: &str) -> Option<Self> {
        Some(Self::Of(match name {
            "int8_t" => Kind::I8,
            "uint8_t" => Kind::U8,
            "int16_t" => Kind::I16,
            "uint16_t" => Kind::U16,
            "int32_t" => Kind::I32,
            "uint32_t" => Kind::U32,
            "int64_t" => Kind::I64,
            "uint64_t" => Kind::U64,
            "float" => Kind::F32,
            "double" => Kind::F64,
            "char" => Kind::Char,
            "bool" => return Some(Self::Bool),
            _ => return None,
        }))
    }

    pub(super) const fn bytes(self) -> usize {
        match self {
            Self::Of(kind) => kind.size(),
            Self::Bool => 1,
        }
    }

    /// A value of as many bytes as the type has; the code of a character.
    pub(super) fn value(self, bytes: &[u8]) -> Option<CellValue<'static>> {
        match self {
            Self::Of(kind) => Scalar::read(kind, bytes).map(CellValue::Number),
            Self::Bool => bytes.first().map(|byte| CellValue::Flag(*byte != 0)),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    /// `esc[3].esc_rpm`, with the definitions around it.
    pub(super) name: String,
    pub(super) number: Number,
    pub(super) array: Option<u32>,
    pub(super) offset: u32,
}

/// A definition, resolved.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) name: String,
    /// Without padding, in order of their places.
    pub(super) fields: Vec<Field>,
    pub(super) bytes: usize,
    /// Bytes without padding at the end, which a writer leaves out.
    pub(super) least_bytes: usize,
    /// Place of its time.
    pub(super) timestamp: Option<u32>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum FormatError {
    Malformed,
    /// There are too many already.
    TooMany,
    /// It exists already, with another definition.
    Redefined(String),
    Unknown(String),
    /// Deeper than [`DEPTH_MAX`], or in a circle.
    TooDeep(String),
    /// Longer than any message.
    TooLong(String),
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Malformed => f.write_str("a format definition that does not read `name:type field;`"),
            Self::TooMany => write!(f, "more than {FORMATS_MAX} format definitions or {FIELDS_MAX} fields"),
            Self::Redefined(name) => write!(f, "another format definition of {name}"),
            Self::Unknown(name) => write!(f, "no format definition of {name}"),
            Self::TooDeep(name) => {
                write!(f, "format definitions nested deeper than {DEPTH_MAX}, or in a circle, from {name} on")
            }
            Self::TooLong(name) => {
                write!(f, "the format of {name} is longer than a message can be ({MESSAGE_BYTES_MAX} bytes)")
            }
        }
    }
}

impl std::error::Error for FormatError {}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Written {
    kind: String,
    array: Option<u32>,
    name: String,
}

#[derive(Debug)]
pub(super) struct Formats {
    written: HashMap<String, Vec<Written>>,
    layouts: HashMap<String, Result<Arc<Layout>, FormatError>>,
    text_bytes: usize,
    /// Room for fields.
    left: usize,
}

impl Default for Formats {
    fn default() -> Self {
        Self { written: HashMap::new(), layouts: HashMap::new(), text_bytes: 0, left: FIELDS_MAX }
    }
}

impl Formats {
    /// Takes a definition; its repetition is harmless.
    pub(super) fn define(&mut self, text: &[u8]) -> Result<(), FormatError> {
        let (name, fields) = parse(text).ok_or(FormatError::Malformed)?;
        if let Some(known) = self.written.get(name) {
            return if *known == fields { Ok(()) } else { Err(FormatError::Redefined(name.to_owned())) };
        }
        self.text_bytes += text.len();
        if self.written.len() >= FORMATS_MAX || self.text_bytes > TEXT_BYTES_MAX {
            return Err(FormatError::TooMany);
        }
        self.written.insert(name.to_owned(), fields);
        // A missing definition may be there now.
        self.layouts.retain(|_, layout| layout.is_ok());
        Ok(())
    }

    /// Resolved once.
    pub(super) fn layout(&mut self, name: &str) -> Result<Arc<Layout>, FormatError> {
        if let Some(known) = self.layouts.get(name) {
            return known.clone();
        }
        let layout = self.resolve(name);
        // Not kept: 65,536 names are possible.
        if self.written.contains_key(name) {
            self.layouts.insert(name.to_owned(), layout.clone());
        }
        layout
    }

    fn resolve(&mut self, name: &str) -> Result<Arc<Layout>, FormatError> {
        let mut walk = Walk { formats: self, fields: Vec::new(), bytes: 0, left: self.left };
        let result = walk.definition(name, "", 0);
        // Also without a result.
        let Walk { fields, bytes, left, .. } = walk;
        self.left = left;
        result?;
        let padding = self
            .written
            .get(name)
            .and_then(|fields| fields.last())
            .filter(|last| last.name.starts_with("_padding"))
            .and_then(|last| Some(Number::named(&last.kind)?.bytes() * last.array.unwrap_or(1) as usize))
            .unwrap_or(0);
        let timestamp = fields
            .iter()
            .find(|field| {
                field.name == "timestamp" && field.number == Number::Of(Kind::U64) && field.array.is_none()
            })
            .map(|field| field.offset);
        let least_bytes = bytes.saturating_sub(padding);
        Ok(Arc::new(Layout { name: name.to_owned(), fields, bytes, least_bytes, timestamp }))
    }
}

struct Walk<'a> {
    formats: &'a Formats,
    fields: Vec<Field>,
    bytes: usize,
    /// Room for fields.
    left: usize,
}

impl Walk<'_> {
    fn definition(&mut self, name: &str, prefix: &str, depth: usize) -> Result<(), FormatError> {
        if depth >= DEPTH_MAX {
            return Err(FormatError::TooDeep(name.to_owned()));
        }
        let formats = self.formats;
        let written = formats.written.get(name).ok_or_else(|| FormatError::Unknown(name.to_owned()))?;
        for field in written {
            self.take(1)?;
            let path = format!("{prefix}{}", field.name);
            if let Some(number) = Number::named(&field.kind) {
                self.number(name, field, path, number)?;
                continue;
            }
            match field.array {
                None => self.definition(&field.kind, &format!("{path}."), depth + 1)?,
                // An element has a byte at least: this ends at the longest message.
                Some(count) => (0..count).try_for_each(|element| {
                    self.definition(&field.kind, &format!("{path}[{element}]."), depth + 1)
                })?,
            }
        }
        Ok(())
    }

    fn number(
        &mut self,
        within: &str,
        field: &Written,
        path: String,
        number: Number,
    ) -> Result<(), FormatError> {
        let offset = self.bytes as u32;
        let bytes = number.bytes().saturating_mul(field.array.unwrap_or(1) as usize);
        self.bytes = self.bytes.saturating_add(bytes);
        if self.bytes > MESSAGE_BYTES_MAX {
            return Err(FormatError::TooLong(within.to_owned()));
        }
        if field.name.starts_with("_padding") {
            return Ok(());
        }
        // An array has a column for each element.
        self.take(if number == Number::CHAR { 0 } else { field.array.unwrap_or(1) as usize - 1 })?;
        self.fields.push(Field { name: path, number, array: field.array, offset });
        Ok(())
    }

    fn take(&mut self, fields: usize) -> Result<(), FormatError> {
        self.left = self.left.checked_sub(fields).ok_or(FormatError::TooMany)?;
        Ok(())
    }
}

fn is_name(text: &str) -> bool {
    !text.is_empty()
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'/'))
}

fn parse(text: &[u8]) -> Option<(&str, Vec<Written>)> {
    let (name, fields) = std::str::from_utf8(text).ok()?.split_once(':')?;
    if !is_name(name) || Number::named(name).is_some() {
        return None;
    }
    let written: Vec<Written> =
        fields.split(';').filter(|field| !field.is_empty()).map(written).collect::<Option<_>>()?;
    (!written.is_empty()).then_some((name, written))
}

/// An empty array would make an empty definition.
fn written(field: &str) -> Option<Written> {
    let (kind, name) = typed(field)?;
    let (kind, array) = kind;
    if array == Some(0) {
        return None;
    }
    Some(Written { kind: kind.to_owned(), array, name: name.to_owned() })
}

/// `type name` or `type[count] name`. PX4 writes empty lines as `char[0]`.
pub(super) fn typed(text: &str) -> Option<((&str, Option<u32>), &str)> {
    split(text).filter(|(_, name)| is_name(name))
}

/// A key as [`typed`], for names with spaces (`char[11] Build Date`).
pub(super) fn typed_key(text: &str) -> Option<((&str, Option<u32>), &str)> {
    split(text).filter(|(_, name)| name.split(' ').all(is_name))
}

fn split(text: &str) -> Option<((&str, Option<u32>), &str)> {
    let (kind, name) = text.split_once(' ')?;
    let (kind, array) = match kind.split_once('[') {
        None => (kind, None),
        Some((kind, count)) => {
            let count: u32 = count.strip_suffix(']')?.parse().ok()?;
            (kind, Some(count))
        }
    };
    is_name(kind).then_some(((kind, array), name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_may_have_spaces_and_a_field_may_not() {
        assert_eq!(typed_key("char[11] Build Date"), Some((("char", Some(11)), "Build Date")));
        assert_eq!(typed("char[11] Build Date"), None);
        assert_eq!(typed_key("char[11]  Date"), None);
    }

    fn formats(texts: &[&str]) -> Formats {
        let mut formats = Formats::default();
        for text in texts {
            formats.define(text.as_bytes()).expect("a definition");
        }
        formats
    }

    fn fields(layout: &Layout) -> Vec<(&str, u32)> {
        layout.fields.iter().map(|field| (field.name.as_str(), field.offset)).collect()
    }

    #[test]
    fn a_definition_may_name_one_that_comes_after_it() {
        let mut formats = formats(&[
            "a:uint64_t timestamp;b[2] each;b one;uint8_t[3] _padding0;",
            "b:float[2] x;uint8_t y;uint8_t[3] _padding0;",
        ]);
        let layout = formats.layout("a").expect("resolved");
        assert_eq!(
            fields(&layout),
            [
                ("timestamp", 0),
                ("each[0].x", 8),
                ("each[0].y", 16),
                ("each[1].x", 20),
                ("each[1].y", 28),
                ("one.x", 32),
                ("one.y", 40)
            ]
        );
        // Padding at the end may be left out.
        assert_eq!((layout.bytes, layout.least_bytes, layout.timestamp), (47, 44, Some(0)));
    }

    #[test]
    fn a_circle_and_a_thousand_levels_are_refused_with_a_name() {
        let mut circle = formats(&["a:b x;", "b:a x;"]);
        assert!(matches!(circle.layout("a"), Err(FormatError::TooDeep(_))));
        let mut itself = formats(&["a:a[200] x;uint8_t y;"]);
        assert!(matches!(itself.layout("a"), Err(FormatError::TooDeep(_))));
        let texts: Vec<String> = (0..1_000).map(|level| format!("n{level}:n{} x;", level + 1)).collect();
        let mut deep = formats(&texts.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(matches!(deep.layout("n0"), Err(FormatError::TooDeep(_))));
        assert!(matches!(deep.layout("n999"), Err(FormatError::Unknown(name)) if name == "n1000"));
    }

    #[test]
    fn lengths_of_gigabytes_take_neither_time_nor_memory() {
        for text in ["a:uint8_t[4294967295] x;", "a:double[4294967295] x;", "a:b[4294967295] x;"] {
            let mut formats = formats(&[text, "b:uint8_t y;"]);
            assert!(
                matches!(formats.layout("a"), Err(FormatError::TooLong(_) | FormatError::TooMany)),
                "{text}"
            );
        }
        let texts: Vec<String> = (0..7).map(|level| format!("n{level}:n{}[15] x;", level + 1)).collect();
        let mut wide = formats(&texts.iter().map(String::as_str).collect::<Vec<_>>());
        wide.define(b"n7:uint8_t[255] _padding;").expect("a definition");
        assert!(matches!(wide.layout("n0"), Err(FormatError::TooLong(_))));
    }

    #[test]
    fn all_layouts_together_have_a_limit() {
        let mut formats = Formats::default();
        for number in 0..100 {
            formats.define(format!("a{number}:uint8_t[1000] x;").as_bytes()).expect("a definition");
        }
        let resolved = (0..100).filter(|number| formats.layout(&format!("a{number}")).is_ok()).count();
        assert_eq!(resolved, FIELDS_MAX / 1_000);
    }

    #[test]
    fn what_is_no_definition_is_refused() {
        for text in [
            "",
            "a",
            ":",
            "a:",
            "a:float",
            "a:float;",
            "a:[3] x;",
            "a:float[0] x;",
            "a:float[x] y;",
            "a:float[3 x;",
            "float:float x;",
            "a b:float x;",
            "a:float[-1] x;",
            "a:float x y;",
            "a:float[99999999999] x;",
            "\u{e9}:float x;",
        ] {
            assert_eq!(Formats::default().define(text.as_bytes()), Err(FormatError::Malformed), "{text:?}");
        }
        assert_eq!(Formats::default().define(&[0xff, b':']), Err(FormatError::Malformed));
    }

    #[test]
    fn a_second_definition_of_a_name_does_not_replace_the_first() {
        let mut formats = formats(&["a:float x;", "a:float x;"]);
        assert_eq!(formats.define(b"a:double x;"), Err(FormatError::Redefined("a".to_owned())));
        assert_eq!(formats.layout("a").expect("resolved").bytes, 4);
    }
}
