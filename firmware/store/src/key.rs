//! Keys of items, and the stored form of parameters.

/// Longest name of a parameter, as in `PARAM_VALUE`.
pub const NAME_BYTES_MAX: usize = 16;

/// The longest value that [`param_value`] makes.
pub const PARAM_BYTES_MAX: usize = 1 + NAME_BYTES_MAX + 4;

/// Numbers never change meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key(u32);

impl Key {
    const PARAM: u32 = 1 << 31;
    const OWN: u32 = 1 << 30;

    pub(crate) const MOUNTS: Self = Self(Self::OWN);

    /// An item's key by number, which its owner never changes.
    pub const fn item(number: u8) -> Self {
        Self(number as u32)
    }

    /// A parameter's key by name: a reordered table still finds it.
    pub const fn param(name: &str) -> Self {
        // FNV-1a (draft-eastlake-fnv, 32 bits). The value holds the name itself.
        let mut hash: u32 = 0x811C_9DC5;
        let mut at = 0;
        while at < name.len() {
            hash = (hash ^ name.as_bytes()[at] as u32).wrapping_mul(0x0100_0193);
            at += 1;
        }
        Self(hash | Self::PARAM)
    }

    /// `None` for a parameter.
    pub const fn number(self) -> Option<u8> {
        if self.0 <= u8::MAX as u32 { Some(self.0 as u8) } else { None }
    }

    /// Whether it is a parameter's.
    pub const fn is_param(self) -> bool {
        self.0 & Self::PARAM != 0
    }

    /// The stored form.
    pub const fn stored(self) -> u32 {
        self.0
    }

    /// The key of any stored form.
    pub const fn from_stored(key: u32) -> Self {
        Self(key)
    }

    pub(crate) const fn is_own(self) -> bool {
        self.0 & (Self::PARAM | Self::OWN) == Self::OWN
    }
}

/// Bytes and count; `None` if the name is longer than [`NAME_BYTES_MAX`].
pub fn param_value(name: &str, value: f32) -> Option<([u8; PARAM_BYTES_MAX], usize)> {
    let mut bytes = [0; PARAM_BYTES_MAX];
    let (length, rest) = bytes.split_first_mut()?;
    *length = u8::try_from(name.len()).ok().filter(|length| usize::from(*length) <= NAME_BYTES_MAX)?;
    rest.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
    rest.get_mut(name.len()..name.len() + 4)?.copy_from_slice(&value.to_le_bytes());
    Some((bytes, 1 + name.len() + 4))
}

/// `None` if the bytes are not a parameter.
pub fn param(stored: &[u8]) -> Option<(&str, f32)> {
    let (length, rest) = stored.split_first()?;
    let (name, value) = rest.split_at_checked(usize::from(*length))?;
    let value = <[u8; 4]>::try_from(value).ok()?;
    Some((core::str::from_utf8(name).ok()?, f32::from_le_bytes(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_reads_back_by_name() {
        for (name, value) in [("A", 0.0), ("SIXTEEN_LETTERS_", -1.5e30), ("", f32::INFINITY)] {
            let (bytes, length) = param_value(name, value).expect("short enough");
            assert_eq!(param(&bytes[..length]), Some((name, value)));
            for cut in 0..length {
                assert_eq!(param(&bytes[..cut]), None, "{name} cut to {cut}");
            }
        }
        assert_eq!(param_value("SEVENTEEN_LETTERS", 0.0), None);
        assert_eq!(param(&[1, 0xFF, 0, 0, 0, 0]), None, "no text");
    }

    #[test]
    fn keys_of_items_parameters_and_the_store_are_apart() {
        assert_eq!(Key::item(255).number(), Some(255));
        assert!(!Key::item(255).is_param() && !Key::item(255).is_own());
        let param = Key::param("CELL_WARN");
        assert!(param.is_param() && !param.is_own() && param.number().is_none());
        assert!(Key::MOUNTS.is_own() && !Key::MOUNTS.is_param());
        // The published test vector of FNV-1a, 32 bits: "a".
        assert_eq!(Key::param("a").stored(), 0xE40C_292C);
    }
}
