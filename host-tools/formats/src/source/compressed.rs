//! A `.gz` recording's damage is damage of the recording.

use std::io;

use super::input::Progress;
use super::stream::{Chunk, Source};

pub(super) struct Compressed<S> {
    inner: S,
    progress: Progress,
}

impl<S: Source> Compressed<S> {
    /// `progress` is of the input that `inner` reads.
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
