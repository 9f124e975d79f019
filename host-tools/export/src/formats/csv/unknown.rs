//! Lines of frames without a definition, in order. The table of a line is chosen at the end of the log: there
//! are 16 million ids, and few files.

use crate::text::push_integer;

/// Lines of a CSV table, with their ids.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnknownLines {
    text: Vec<u8>,
    places: Vec<Place>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    id: u32,
    /// Place for the id.
    middle: usize,
    end: usize,
}

/// One line, without its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnknownLine<'a> {
    /// The message id.
    pub id: u32,
    head: &'a [u8],
    tail: &'a [u8],
}

impl UnknownLines {
    /// Adds a line: `head` writes its cells up to the place of the id, `tail` those after it, each with a comma before it.
    pub(crate) fn push(&mut self, id: u32, head: impl FnOnce(&mut Vec<u8>), tail: impl FnOnce(&mut Vec<u8>)) {
        head(&mut self.text);
        let middle = self.text.len();
        tail(&mut self.text);
        self.places.push(Place { id, middle, end: self.text.len() });
    }

    /// The lines in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = UnknownLine<'_>> {
        let mut start = 0;
        self.places.iter().map(move |place| {
            let head = self.text.get(start..place.middle).unwrap_or_default();
            let tail = self.text.get(place.middle..place.end).unwrap_or_default();
            start = place.end;
            UnknownLine { id: place.id, head, tail }
        })
    }

    /// Bytes of memory that it holds.
    pub(crate) fn held_bytes(&self) -> usize {
        self.text.len() + size_of::<Place>() * self.places.len()
    }
}

impl UnknownLine<'_> {
    /// The line in a table of its id.
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
