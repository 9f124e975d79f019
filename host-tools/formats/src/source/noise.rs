//! A noisy line: repeatable damage by a probability.

use std::io;

use super::stream::{Chunk, Source};
use crate::rng::Rng;

const PURPOSE: u64 = 1;

/// Another source with damaged bytes.
pub struct Noisy<S> {
    inner: S,
    probability: f64,
    rng: Rng,
}

impl<S: Source> Noisy<S> {
    /// Damages bytes of `inner` with `probability`.
    pub fn new(inner: S, probability: f64, seed: u64) -> Self {
        Self { inner, probability, rng: Rng::new(seed, PURPOSE) }
    }
}

impl<S: Source> Source for Noisy<S> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        let Some(mut chunk) = self.inner.next()? else { return Ok(None) };
        if self.probability > 0.0 {
            for byte in &mut chunk.bytes {
                if self.rng.chance(self.probability) {
                    // Exclusive or with 1 to 255: it differs.
                    *byte ^= (self.rng.next_u64() % 255 + 1) as u8;
                }
            }
        }
        Ok(Some(chunk))
    }

    fn inner(&self) -> Option<&dyn Source> {
        Some(&self.inner)
    }
}

impl Source for Box<dyn Source> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        (**self).next()
    }

    fn inner(&self) -> Option<&dyn Source> {
        Some(&**self)
    }
}

#[cfg(test)]
mod tests {
    use super::super::raw::Raw;
    use super::*;

    #[test]
    fn a_thousandth_of_the_bytes_differ_and_a_run_repeats() {
        let clean = vec![0x55u8; 200_000];
        let run = |seed| {
            let mut source = Noisy::new(Raw::new(&clean[..]), 0.001, seed);
            let mut bytes = Vec::new();
            while let Some(chunk) = source.next().expect("memory") {
                bytes.extend(chunk.bytes);
            }
            bytes
        };
        let differing = run(7).iter().filter(|&&byte| byte != 0x55).count();
        assert!((140..260).contains(&differing), "{differing}");
        assert_eq!(run(7), run(7));
        assert_ne!(run(7), run(8));
    }
}
