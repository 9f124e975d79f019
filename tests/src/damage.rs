//! Noise that can be repeated.

/// Pseudo-random numbers (`SplitMix64`).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// A seed's sequence.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Any 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `limit`.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.bits() % limit.max(1)
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        (self.bits() >> 11) as f64 / ((1_u64 << 53) as f64) < probability
    }

    /// As many bytes of noise.
    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.bits() as u8).collect()
    }
}

/// Damages bytes with this probability each; returns the changed ones.
pub fn noise(data: &mut [u8], probability: f64, seed: u64) -> Vec<bool> {
    let mut random = Random::new(seed);
    data.iter_mut()
        .map(|byte| {
            let hit = random.chance(probability);
            if hit {
                *byte ^= 1 + random.below(255) as u8;
            }
            hit
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_hits_as_often_as_asked_and_changes_what_it_hits() {
        let mut data = vec![0_u8; 1_000_000];
        let hits = noise(&mut data, 0.001, 1);
        let count = hits.iter().filter(|hit| **hit).count();
        assert!((850..1150).contains(&count), "{count}");
        assert!(data.iter().zip(&hits).all(|(byte, hit)| (*byte != 0) == *hit));
    }
}
