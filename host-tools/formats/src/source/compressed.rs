//! A recording as `.gz`: damage of its compressed bytes is damage of the recording.

use std::io;

use super::input::Progress;
use super::stream::{Chunk, Source};

/// A source of bytes from an input that may be compressed.
pub(super) struct Compressed<S> {
    inner: S,
    progress: Progress,
}

impl<S: Source> Compressed<S> {
    /// The bytes of `inner`, which reads the input of `progress`.
    pub(super) fn new(inner: S, progress: Progress) -> Self {
        Self { inner, progress }
    }
}

impl<S: Source> Source for Compressed<S> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        self.inner.next()
    }

    fn inner(&self) -> Option<&dyn Source> {
        Some(&self.inner)
    }

    fn damages(&self) -> u64 {
        self.inner.damages() + u64::from(self.progress.damage().is_some())
    }

    fn remark(&self) -> Option<String> {
        let said: Vec<String> = self.inner.remark().into_iter().chain(self.progress.damage()).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }
}
