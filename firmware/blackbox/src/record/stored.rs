//! The stored form of a record: a head with the number of numbers, then the numbers, then bytes. So the coder knows
//! the numbers of any record, also of later kinds.

use hums_core::clock::Instant;
use hums_core::component::{ComponentFigures, ComponentKind, Status};
use hums_core::health::exceedance::Crossings;
use hums_core::health::{Level, Subsystem};
use hums_core::protect::{Action, Stage};

use crate::bytes::ByteFields;
use crate::limits::{NAME_BYTES_MAX, TEXT_BYTES_MAX};

/// Bytes of the head: kind; version, and in the upper four bits times; words; halves.
pub(crate) const HEAD_BYTES: usize = 4;

const VERSION: u8 = 1;

/// Decoded head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) kind: u8,
    /// Version in bits 0-3; in bits 4-7 how many of the first pairs of words are times.
    pub(crate) version: u8,
    /// Numbers of 4 bytes.
    pub(crate) words: u8,
    /// Numbers of 2 bytes. Only the retired kind 16 had some.
    pub(crate) halves: u8,
}

impl Shape {
    /// The shape with the bytes after the numbers; `None` unless all numbers are there.
    pub(crate) fn read(stored: &[u8]) -> Option<(Self, usize)> {
        let shape = Self::of(*stored.first_chunk()?);
        Some((shape, stored.len().checked_sub(shape.bytes_at())?))
    }

    const fn of([kind, version, words, halves]: [u8; HEAD_BYTES]) -> Self {
        Self { kind, version, words, halves }
    }

    /// Words that are times, a pair each: first the lower half.
    pub(crate) const fn times(self) -> usize {
        2 * (self.version >> 4) as usize
    }

    pub(crate) const fn halves_at(self) -> usize {
        HEAD_BYTES + 4 * self.words as usize
    }

    pub(crate) const fn bytes_at(self) -> usize {
        self.halves_at() + 2 * self.halves as usize
    }
}

/// Numbers and bytes, each in order; zeros and empty texts beyond the end.
pub(crate) struct Fields<'a> {
    words: ByteFields<'a>,
    bytes: ByteFields<'a>,
}

impl<'a> Fields<'a> {
    pub(crate) fn new(stored: &'a [u8]) -> (Shape, Self) {
        let shape = Shape::of(ByteFields::new(stored).array());
        let part = |from: usize, to: usize| {
            let to = to.min(stored.len());
            stored.get(from.min(to)..to).unwrap_or_default()
        };
        let fields = Self {
            words: ByteFields::new(part(HEAD_BYTES, shape.halves_at())),
            bytes: ByteFields::new(part(shape.bytes_at(), usize::MAX)),
        };
        (shape, fields)
    }

    pub(crate) fn u32(&mut self) -> u32 {
        self.words.u32()
    }

    pub(crate) fn u64(&mut self) -> u64 {
        self.words.u64()
    }

    pub(crate) fn f32(&mut self) -> f32 {
        f32::from_bits(self.u32())
    }

    pub(crate) fn f64(&mut self) -> f64 {
        f64::from_bits(self.u64())
    }

    pub(crate) fn instant(&mut self) -> Instant {
        Instant::from_micros(self.u64())
    }

    pub(crate) fn words(&mut self) -> &'a [u8] {
        self.words.bytes(usize::MAX)
    }

    pub(crate) fn u8(&mut self) -> u8 {
        self.bytes.u8()
    }

    pub(crate) fn array<const N: usize>(&mut self) -> [u8; N] {
        self.bytes.array()
    }

    pub(crate) fn bytes(&mut self) -> &'a [u8] {
        self.bytes.bytes(usize::MAX)
    }

    pub(crate) fn text(&mut self) -> &'a str {
        self.bytes.text()
    }
}

/// A part of a record. A record stores its times first, then all other numbers, then all bytes.
pub(crate) trait Field<'a>: Sized {
    fn times(&self, _: &mut Sink<'_>) {}
    fn numbers(&self, _: &mut Sink<'_>) {}
    fn bytes(&self, _: &mut Sink<'_>) {}
    /// `None` for a number that this reader does not know.
    fn read(fields: &mut Fields<'a>) -> Option<Self>;
}

macro_rules! field {
    ($type:ty, $part:ident, |$value:ident, $sink:ident| $store:expr, |$fields:ident| $read:expr) => {
        impl<'a> Field<'a> for $type {
            fn $part(&self, $sink: &mut Sink<'_>) {
                let $value = self;
                $store;
            }

            fn read($fields: &mut Fields<'a>) -> Option<Self> {
                $read
            }
        }
    };
    ($type:ty) => {
        field!($type, bytes, |value, sink| sink.u8(*value as u8), |fields| Self::from_number(fields.u8()));
    };
    ($type:ty, else $unknown:expr) => {
        field!($type, bytes, |value, sink| sink.u8(*value as u8), |fields| {
            Some(Self::from_number(fields.u8()).unwrap_or($unknown))
        });
    };
}

field!(Instant, times, |at, sink| sink.time(*at), |fields| Some(fields.instant()));
field!(u32, numbers, |value, sink| sink.u32(*value), |fields| Some(fields.u32()));
field!(u64, numbers, |value, sink| sink.u64(*value), |fields| Some(fields.u64()));
field!(f32, numbers, |value, sink| sink.f32(*value), |fields| Some(fields.f32()));
field!(f64, numbers, |value, sink| sink.f64(*value), |fields| Some(fields.f64()));
field!(u8, bytes, |value, sink| sink.u8(*value), |fields| Some(fields.u8()));
field!(bool, bytes, |value, sink| sink.u8(u8::from(*value)), |fields| Some(fields.u8() != 0));
field!(u16, bytes, |value, sink| sink.bytes(&value.to_le_bytes()), |fields| {
    Some(u16::from_le_bytes(fields.array()))
});
field!((u8, u8), bytes, |value, sink| sink.u8(value.0).u8(value.1), |fields| {
    Some((fields.u8(), fields.u8()))
});
field!([u8; 12], bytes, |value, sink| sink.bytes(value), |fields| Some(fields.array()));
field!(&'a str, bytes, |value, sink| sink.name(value), |fields| Some(fields.text()));
field!(Subsystem);
field!(Level);
field!(Action);
field!(Stage);
field!(ComponentKind, else Self::default());
field!(Status, else Self::Red);

impl<'a> Field<'a> for [u32; 12] {
    fn numbers(&self, sink: &mut Sink<'_>) {
        for number in self {
            number.numbers(sink);
        }
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(core::array::from_fn(|_| fields.u32()))
    }
}

impl<'a> Field<'a> for Crossings {
    fn numbers(&self, sink: &mut Sink<'_>) {
        sink.u32(u32::from(self.warnings)).u32(u32::from(self.criticals));
        sink.u32(self.warning_tenths).u32(self.critical_tenths).f32(self.peak);
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            warnings: fields.u32().try_into().unwrap_or(u16::MAX),
            criticals: fields.u32().try_into().unwrap_or(u16::MAX),
            warning_tenths: fields.u32(),
            critical_tenths: fields.u32(),
            peak: fields.f32(),
        })
    }
}

impl<'a> Field<'a> for ComponentFigures {
    fn numbers(&self, sink: &mut Sink<'_>) {
        sink.f64(self.powered_s).f64(self.flight_s).f64(self.motor_s).f64(self.flights).f64(self.cycles);
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            powered_s: fields.f64(),
            flight_s: fields.f64(),
            motor_s: fields.f64(),
            flights: fields.f64(),
            cycles: fields.f64(),
        })
    }
}

/// A struct whose fields are stored in their order, times before other numbers; new ones come last. A last text may be longer than a name.
macro_rules! record {
    (
        $(#[$meta:meta])* $name:ident $(<$life:lifetime>)? {
            $($(#[$doc:meta])+ $field:ident: $type:ty,)+
        }
        $(text { $(#[$text_doc:meta])+ $text:ident: $text_type:ty, })?
    ) => {
        $(#[$meta])*
        pub struct $name $(<$life>)? {
            $($(#[$doc])+ pub $field: $type,)+
            $($(#[$text_doc])+ pub $text: $text_type,)?
        }

        impl<'a> Field<'a> for $name $(<$life>)? {
            fn times(&self, sink: &mut Sink<'_>) {
                $(Field::times(&self.$field, sink);)+
            }

            fn numbers(&self, sink: &mut Sink<'_>) {
                $(Field::numbers(&self.$field, sink);)+
            }

            fn bytes(&self, sink: &mut Sink<'_>) {
                $(Field::bytes(&self.$field, sink);)+
                $(sink.text(self.$text);)?
            }

            fn read(fields: &mut Fields<'a>) -> Option<Self> {
                Some(Self { $($field: Field::read(fields)?,)+ $($text: fields.text(),)? })
            }
        }
    };
}
pub(super) use record;

/// An enumeration whose numbers are stored, and the variant that stands for an unknown one, if there is one.
macro_rules! numbered {
    (
        $(#[$meta:meta])* $name:ident { $($(#[$doc:meta])+ $variant:ident = $number:literal $text:literal,)+ }
        $(else $unknown:ident)?
    ) => {
        $(#[$meta])*
        #[repr(u8)]
        pub enum $name {
            $($(#[$doc])+ $variant = $number,)+
        }

        impl $name {
            /// The name that reports use.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl<'a> Field<'a> for $name {
            fn bytes(&self, sink: &mut Sink<'_>) {
                sink.u8(*self as u8);
            }

            fn read(fields: &mut Fields<'a>) -> Option<Self> {
                match fields.u8() {
                    $($number => Some(Self::$variant),)+
                    $(_ => Some(Self::$unknown),)?
                    #[allow(unreachable_patterns, reason = "not every one has such a variant")]
                    _ => None,
                }
            }
        }
    };
}
pub(super) use numbered;

/// Words (times first), halves, then bytes. Remembers an overflow.
pub(crate) struct Sink<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl<'a> Sink<'a> {
    pub(crate) fn new(out: &'a mut [u8]) -> Self {
        Self { out, len: 0 }
    }

    /// `None` if they did not fit.
    pub(crate) fn len(&self) -> Option<usize> {
        (self.len <= self.out.len()).then_some(self.len)
    }

    pub(crate) fn record<'r>(&mut self, kind: u8, record: &impl Field<'r>) {
        self.head(kind);
        record.times(self);
        record.numbers(self);
        record.bytes(self);
    }

    fn head(&mut self, kind: u8) -> &mut Self {
        self.bytes(&[kind, VERSION, 0, 0])
    }

    pub(crate) fn time(&mut self, at: Instant) -> &mut Self {
        debug_assert_eq!(2 * self.out.get(1).map_or(0, |version| version >> 4), self.counted(2));
        if let Some(version) = self.out.get_mut(1) {
            *version += 0x10;
        }
        self.u64(at.as_micros())
    }

    pub(crate) fn u32(&mut self, value: u32) -> &mut Self {
        debug_assert_eq!(self.len, HEAD_BYTES + 4 * usize::from(self.counted(2)), "words come first");
        self.count(2);
        self.bytes(&value.to_le_bytes())
    }

    pub(crate) fn u64(&mut self, value: u64) -> &mut Self {
        self.u32(value as u32).u32((value >> 32) as u32)
    }

    pub(crate) fn f32(&mut self, value: f32) -> &mut Self {
        self.u32(value.to_bits())
    }

    pub(crate) fn f64(&mut self, value: f64) -> &mut Self {
        self.u64(value.to_bits())
    }

    pub(crate) fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes(&[value])
    }

    #[inline(never)]
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        let end = self.len.saturating_add(bytes.len());
        if let Some(place) = self.out.get_mut(self.len..end) {
            place.copy_from_slice(bytes);
        }
        self.len = end;
        self
    }

    /// A name, cut at a character's border where it is too long.
    pub(crate) fn name(&mut self, text: &str) -> &mut Self {
        self.cut(text, NAME_BYTES_MAX)
    }

    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.cut(text, TEXT_BYTES_MAX)
    }

    #[inline(never)]
    fn cut(&mut self, text: &str, bytes_max: usize) -> &mut Self {
        let mut end = text.len().min(bytes_max);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.u8(end as u8).bytes(&text.as_bytes()[..end])
    }

    fn counted(&self, place: usize) -> u8 {
        self.out.get(place).copied().unwrap_or_default()
    }

    fn count(&mut self, place: usize) {
        if let Some(count) = self.out.get_mut(place) {
            // Contents too long for a record are refused.
            *count = count.saturating_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_bytes_come_back_each_in_their_order_and_what_is_cut_off_is_zero() {
        let mut stored = [0; 64];
        let mut sink = Sink::new(&mut stored);
        let at = Instant::from_micros(5_000_000_000);
        sink.head(7).time(at).u32(9).f64(-1.5).u8(1).name("abc");
        let len = sink.len().expect("fits");
        let (shape, mut fields) = Fields::new(&stored[..len]);
        assert_eq!((shape.kind, shape.version, shape.times()), (7, 0x11, 2));
        assert_eq!(Shape::read(&stored[..len]), Some((shape, 5)));
        // Read in another order than written.
        assert_eq!((fields.u8(), fields.text(), fields.text()), (1, "abc", ""));
        assert_eq!((fields.instant(), fields.u32(), fields.f64(), fields.u32()), (at, 9, -1.5, 0));
        assert_eq!(Shape::read(&stored[..shape.bytes_at() - 1]), None);
        let (_, mut fields) = Fields::new(&stored[..6]);
        assert_eq!((fields.u32(), fields.u8()), (0xf200, 0));
    }
}
