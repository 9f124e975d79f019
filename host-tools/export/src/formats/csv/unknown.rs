//! Lines of frames without a definition, in order. The table of a line is chosen at the end of the log: there
//! are 16 million ids, and few files.

use crate::text::push_integer;

#[derive(Clone, Debug, Default)]
pub(crate) struct UnknownLines {
    text: Vec<u8>,
    places: Vec<BufferedRow>,
}

#[derive(Clone, Copy, Debug)]
struct BufferedRow {
    id: u32,
    /// Place for the id.
    middle: usize,
    end: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct UnknownLine<'a> {
    /// The message id.
    pub id: u32,
    head: &'a [u8],
    tail: &'a [u8],
}

impl UnknownLines {
    /// `head` writes the cells up to the place of the id, `tail` those after it, each with a comma before it.
    pub(crate) fn push(&mut self, id: u32, head: impl FnOnce(&mut Vec<u8>), tail: impl FnOnce(&mut Vec<u8>)) {
        head(&mut self.text);
        let middle = self.text.len();
        tail(&mut self.text);
        self.places.push(BufferedRow { id, middle, end: self.text.len() });
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = UnknownLine<'_>> {
        let mut start = 0;
        self.places.iter().map(move |place| {
            let head = self.text.get(start..place.middle).unwrap_or_default();
            let tail = self.text.get(place.middle..place.end).unwrap_or_default();
            start = place.end;
            UnknownLine { id: place.id, head, tail }
        })
    }

    pub(crate) fn held_bytes(&self) -> usize {
        self.text.len() + size_of::<BufferedRow>() * self.places.len()
    }
}

impl UnknownLine<'_> {
    pub(crate) fn push(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.head);
        out.extend_from_slice(self.tail);
        out.push(b'\n');
    }

    /// The line in a table of many ids.
    pub(crate) fn push_with_id(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.head);
        out.push(b',');
        push_integer(out, u64::from(self.id));
        out.extend_from_slice(self.tail);
        out.push(b'\n');
    }
}
