//! One message and its values: bytes of a binary log, words of a text log.

use std::borrow::Cow;

use half::f16;
use hums_dialect::Kind;

use super::format::{Field, FieldKind, Format, TimeField};
use crate::mavlink::values::Scalar;

#[derive(Clone, Copy, Debug)]
pub(super) struct Message<'a> {
    format: &'a Format,
    body: Body<'a>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Body<'a> {
    /// The bytes after the header.
    Bytes(&'a [u8]),
    /// The words between the commas.
    Words(&'a [&'a str]),
}

impl<'a> Message<'a> {
    pub(super) const fn new(format: &'a Format, body: Body<'a>) -> Self {
        Self { format, body }
    }

    pub(super) const fn format(&self) -> &'a Format {
        self.format
    }

    fn field(&self, column: usize) -> Option<&'a Field> {
        self.format.fields.get(column)
    }

    /// Scaled; `None` if not finite.
    pub(super) fn number(&self, column: usize) -> Option<f64> {
        self.any_number(column).filter(|number| number.is_finite())
    }

    /// The number of a column, finite or not.
    pub(super) fn any_number(&self, column: usize) -> Option<f64> {
        let field = self.field(column)?;
        match self.body {
            Body::Bytes(payload) => number(field.kind, payload.get(field.offset..)?),
            Body::Words(words) => words.get(column)?.trim().parse().ok(),
        }
    }

    /// Finite.
    pub(super) fn single(&self, column: usize) -> Option<f32> {
        let single = match (self.body, self.field(column)?) {
            (Body::Bytes(payload), Field { kind: FieldKind::Number(Kind::F32), offset, .. }) => {
                f32::from_le_bytes(*payload.get(*offset..)?.first_chunk()?)
            }
            _ => self.number(column)? as f32,
        };
        Some(single).filter(|single| single.is_finite())
    }

    pub(super) fn no_number(&self, column: usize) -> Option<&'a str> {
        match self.body {
            Body::Bytes(_) => None,
            Body::Words(words) => Some(words.get(column)?.trim()).filter(|word| !word.is_empty()),
        }
    }

    pub(super) const fn is_words(&self) -> bool {
        matches!(self.body, Body::Words(_))
    }

    pub(super) fn bytes(&self, column: usize) -> Option<&'a [u8]> {
        let field = self.field(column)?;
        match (self.body, field.kind) {
            (Body::Bytes(payload), FieldKind::Text(size)) => {
                payload.get(field.offset..)?.get(..usize::from(size))
            }
            _ => None,
        }
    }

    pub(super) fn time_us(&self) -> Option<u64> {
        match self.format.time? {
            TimeField::Micros(column) => self.unsigned(column.into()),
            TimeField::Millis(column) => Some(self.unsigned(column.into())?.saturating_mul(1_000)),
        }
    }

    /// `None` if signed.
    pub(super) fn unsigned(&self, column: usize) -> Option<u64> {
        let field = self.field(column)?;
        match self.body {
            Body::Bytes(payload) => {
                let bytes = payload.get(field.offset..)?;
                match field.kind {
                    FieldKind::Number(Kind::U64) => Some(u64::from_le_bytes(*bytes.first_chunk()?)),
                    FieldKind::Number(Kind::I64) => {
                        u64::try_from(i64::from_le_bytes(*bytes.first_chunk()?)).ok()
                    }
                    _ => whole(self.number(column)?).and_then(|number| u64::try_from(number).ok()),
                }
            }
            Body::Words(words) => {
                let word = words.get(column)?.trim();
                word.parse()
                    .ok()
                    .or_else(|| whole(word.parse().ok()?).and_then(|whole| whole.try_into().ok()))
            }
        }
    }

    /// A whole number.
    pub(super) fn signed(&self, column: usize) -> Option<i64> {
        let field = self.field(column)?;
        match self.body {
            Body::Bytes(payload) if field.kind == FieldKind::Number(Kind::I64) => {
                Some(i64::from_le_bytes(*payload.get(field.offset..)?.first_chunk()?))
            }
            Body::Bytes(_) => whole(self.number(column)?),
            Body::Words(words) => {
                let word = words.get(column)?.trim();
                word.parse().ok().or_else(|| whole(word.parse().ok()?))
            }
        }
    }

    /// Invalid UTF-8 is read as ISO 8859-1, as in `pymavlink`.
    pub(super) fn text(&self, column: usize) -> Option<Cow<'a, str>> {
        let field = self.field(column)?;
        match self.body {
            Body::Bytes(payload) => {
                let FieldKind::Text(size) = field.kind else { return None };
                Some(words(payload.get(field.offset..)?.get(..usize::from(size))?))
            }
            Body::Words(words) => Some(Cow::Borrowed(words.get(column)?.trim())),
        }
    }

    pub(super) fn element(&self, column: usize, element: usize) -> Option<i16> {
        let field = self.field(column)?;
        match self.body {
            Body::Bytes(payload) if field.kind == FieldKind::Array => {
                let at = field.offset + 2 * element;
                Some(i16::from_le_bytes(*payload.get(at..)?.first_chunk()?))
            }
            _ => None,
        }
    }
}

fn whole(number: f64) -> Option<i64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    (number.abs() <= EXACT && number.fract() == 0.0).then_some(number as i64)
}

fn words(bytes: &[u8]) -> Cow<'_, str> {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let bytes = bytes.get(..end).unwrap_or_default();
    std::str::from_utf8(bytes)
        .map_or_else(|_| bytes.iter().map(|byte| char::from(*byte)).collect::<String>().into(), Cow::Borrowed)
}

/// Exact, unlike multiplication by 0.01.
fn number(kind: FieldKind, bytes: &[u8]) -> Option<f64> {
    let read = |kind| Scalar::read(kind, bytes).map(Scalar::as_f64);
    match kind {
        FieldKind::Number(kind) => read(kind),
        FieldKind::Mode => read(Kind::U8),
        FieldKind::Half => Some(f16::from_bits(u16::from_le_bytes(*bytes.first_chunk()?)).into()),
        FieldKind::Hundredths(kind) => Some(read(kind)? / 100.0),
        FieldKind::Degrees => Some(read(Kind::I32)? / 1e7),
        FieldKind::Text(_) | FieldKind::Array => None,
    }
}
