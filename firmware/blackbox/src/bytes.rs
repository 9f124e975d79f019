//! Little-endian fields out of byte slices, and copies between them, bounded at both ends.

/// Copies `from` to the start of `to`, as far as there is room. Pieces of fixed sizes: less work than a call of `memcpy`.
#[inline]
pub(crate) fn copy_few(from: &[u8], to: &mut [u8]) {
    if from.len() >= 64 {
        for (place, &byte) in to.iter_mut().zip(from) {
            *place = byte;
        }
        return;
    }
    let rest = copy_piece::<32>((from, to));
    let rest = copy_piece::<16>(rest);
    let rest = copy_piece::<8>(rest);
    let rest = copy_piece::<4>(rest);
    let rest = copy_piece::<2>(rest);
    copy_piece::<1>(rest);
}

#[inline]
fn copy_piece<'f, 't, const N: usize>((from, to): (&'f [u8], &'t mut [u8])) -> (&'f [u8], &'t mut [u8]) {
    if from.len() < N || to.len() < N {
        return (from, to);
    }
    let (bytes, from) = from.split_at(N);
    let (places, to) = to.split_at_mut(N);
    places.copy_from_slice(bytes);
    (from, to)
}

/// Reads fields; beyond the end there are zeros and empty texts.
pub(crate) struct ByteFields<'a> {
    rest: &'a [u8],
}

impl<'a> ByteFields<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    pub(crate) fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.rest.split_at(count.min(self.rest.len()));
        self.rest = rest;
        taken
    }

    pub(crate) fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        let taken = self.bytes(N);
        array[..taken.len()].copy_from_slice(taken);
        array
    }

    pub(crate) fn u8(&mut self) -> u8 {
        u8::from_le_bytes(self.array())
    }

    pub(crate) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    pub(crate) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    /// A length and that many bytes; the first invalid UTF-8 byte ends the text.
    pub(crate) fn text(&mut self) -> &'a str {
        let len = self.u8();
        let bytes = self.bytes(usize::from(len));
        match core::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_and_many_bytes_are_copied_as_they_are() {
        let from: Vec<u8> = (1..=100).collect();
        for len in 0..=from.len() {
            for room in [0, 1, 7, 64, 100, 120] {
                let mut to = vec![0; room];
                copy_few(&from[..len], &mut to);
                let copied = to.iter().zip(&from[..len]).take_while(|(a, b)| a == b).count();
                assert!(to[copied..].iter().all(|&byte| byte == 0));
                assert!(copied == len || room < len, "{len} into {room}: {copied}");
            }
        }
    }
}
