//! Stored items: a version byte, then fields, little endian. One list of fields serves for writing and for reading.

use crate::usage::Form;

/// An item that cannot be read: too short, or without a known version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable;

/// An item that outlives power.
///
/// A later version only appends fields, which an earlier one ignores.
pub trait Item: Default {
    /// The stored form's version, from 1.
    const VERSION: u8;
    /// Bytes of the stored form at most.
    const BYTES: usize;
    /// Whether numbers take only as many bytes as they need.
    const SHORT: bool = false;

    /// Every field in its stored order.
    ///
    /// # Errors
    /// [`Unreadable`] if the stored form ends too early; writing has none.
    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable>;

    /// Writes the stored form; returns its length. `out` has [`Self::BYTES`] at least.
    fn encode(mut self, out: &mut [u8]) -> usize {
        let mut fields = Fields::write(out, Self::VERSION);
        fields.short = Self::SHORT;
        let written = self.fields(&mut fields);
        debug_assert!(written.is_ok() && fields.at <= Self::BYTES);
        fields.at
    }

    /// Reads the stored form, of this version or a later one.
    ///
    /// # Errors
    /// [`Unreadable`] if it ends too early, or has an earlier version.
    fn decode(stored: &[u8]) -> Result<Self, Unreadable> {
        let mut item = Self::default();
        let mut fields = Fields::read(stored, Self::VERSION)?;
        fields.short = Self::SHORT;
        item.fields(&mut fields)?;
        Ok(item)
    }
}

enum Way<'a> {
    Write(&'a mut [u8]),
    Read(&'a [u8]),
}

/// The stored form of an item that is being written or read, field by field.
pub struct Fields<'a> {
    way: Way<'a>,
    pub(crate) at: usize,
    pub(crate) short: bool,
}

impl<'a> Fields<'a> {
    pub(crate) fn write(out: &'a mut [u8], version: u8) -> Self {
        if let Some(first) = out.first_mut() {
            *first = version;
        }
        Self { way: Way::Write(out), at: 1, short: false }
    }

    pub(crate) fn read(stored: &'a [u8], version: u8) -> Result<Self, Unreadable> {
        stored.first().filter(|stored| **stored >= version).ok_or(Unreadable)?;
        Ok(Self { way: Way::Read(stored), at: 1, short: false })
    }

    pub(crate) const fn is_read(&self) -> bool {
        matches!(self.way, Way::Read(stored) if stored.len() <= self.at)
    }

    fn bytes<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result<(), Unreadable> {
        let range = self.at..self.at + N;
        match &mut self.way {
            Way::Write(out) => {
                if let Some(place) = out.get_mut(range) {
                    place.copy_from_slice(bytes);
                }
            }
            Way::Read(stored) => bytes.copy_from_slice(stored.get(range).ok_or(Unreadable)?),
        }
        self.at += N;
        Ok(())
    }

    /// A count. The short form is LEB128: seven bits a byte, the lowest first, the last byte with the top bit clear.
    pub(crate) fn count(&mut self, count: &mut u32) -> Result<(), Unreadable> {
        if !self.short {
            return count.code(self);
        }
        let (reads, mut left, mut value) = (matches!(self.way, Way::Read(_)), *count, 0);
        for shift in (0..u32::BITS).step_by(7) {
            let mut byte = left as u8 & 0x7F | if left >= 0x80 { 0x80 } else { 0 };
            byte.code(self)?;
            let bits = u32::from(byte & 0x7F);
            if bits << shift >> shift != bits {
                return Err(Unreadable);
            }
            (left, value) = (left >> 7, value | bits << shift);
            if byte & 0x80 == 0 {
                *count = if reads { value } else { *count };
                return Ok(());
            }
        }
        Err(Unreadable)
    }

    /// A counter by its form. On reading, negative and infinite values are rejected, except for a minimum.
    pub(crate) fn counter(&mut self, form: Form, value: &mut f64) -> Result<(), Unreadable> {
        let parts = match form {
            Form::Tenths => 10.0,
            Form::Halves => 2.0,
            Form::Count => 1.0,
            Form::Amount | Form::Highest | Form::Lowest => {
                if form == Form::Amount && !self.short {
                    value.code(self)?;
                } else {
                    let mut single = *value as f32;
                    single.code(self)?;
                    *value = f64::from(single);
                }
                if !(*value >= 0.0 && (value.is_finite() || form == Form::Lowest)) {
                    *value = form.nothing();
                }
                return Ok(());
            }
        };
        // To the nearest tenth; a cast saturates.
        let whole = *value * parts;
        let mut count = if form == Form::Tenths { libm::round(whole) } else { whole } as u32;
        self.count(&mut count)?;
        *value = f64::from(count) / parts;
        Ok(())
    }

    /// A list. The short form stores the number of used members, and only these.
    pub(crate) fn list<T>(
        &mut self,
        list: &mut [T],
        is_used: fn(&T) -> bool,
        mut member: impl FnMut(&mut Self, &mut T) -> Result<(), Unreadable>,
    ) -> Result<(), Unreadable> {
        let mut used = list.len() as u8;
        if self.short {
            used = list.iter().rposition(is_used).map_or(0, |last| last + 1) as u8;
            used.code(self)?;
        }
        let members = list.get_mut(..usize::from(used)).ok_or(Unreadable)?;
        members.iter_mut().try_for_each(|one| member(self, one))
    }
}

pub(crate) trait Field {
    fn code(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable>;
}

macro_rules! numbers {
    ($($number:ty)*) => {$(
        impl Field for $number {
            fn code(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
                let mut bytes = self.to_le_bytes();
                fields.bytes(&mut bytes)?;
                *self = Self::from_le_bytes(bytes);
                Ok(())
            }
        }
    )*};
}

numbers! { u8 u16 u32 i32 u64 f32 f64 }

impl<T: Field, const N: usize> Field for [T; N] {
    fn code(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        self.iter_mut().try_for_each(|member| member.code(fields))
    }
}

macro_rules! fields {
    ($fields:ident: $($field:expr),* $(,)?) => {{
        use $crate::bytes::Field as _;
        $($field.code($fields)?;)*
    }};
}
pub(crate) use fields;

/// FNV-1a (draft-eastlake-fnv, 32 bits): a name in four bytes.
pub const fn fnv1a(name: &str) -> u32 {
    let mut hash = 0x811C_9DC5_u32;
    let mut index = 0;
    while index < name.len() {
        hash = (hash ^ name.as_bytes()[index] as u32).wrapping_mul(0x0100_0193);
        index += 1;
    }
    hash
}
