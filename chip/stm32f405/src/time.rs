//! Time: the processor's cycles, and picoseconds since the model began.
//!
//! Bus devices count in cycles, devices with their own clock (sender, watchdog, flash, card) in picoseconds. A change
//! of the clock tree moves the relation, never the past.

/// 213 days fit.
pub type Ps = u64;

/// Picoseconds.
pub const US: Ps = 1_000_000;
/// Picoseconds.
pub const MS: Ps = 1_000 * US;
/// Picoseconds.
pub const SECOND: Ps = 1_000 * MS;
/// A moment that never comes.
pub const NEVER: u64 = u64::MAX;

/// Moment, both ways.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Now {
    /// Processor cycles.
    pub cycle: u64,
    /// Picoseconds.
    pub ps: Ps,
}

/// Cycles and picoseconds.
#[derive(Clone, Debug)]
pub struct Timebase {
    hz: u32,
    base: Now,
    /// Picoseconds a cycle, by 2^32.
    ps_a_cycle: u64,
}

impl Timebase {
    /// From cycle 0 at 0 s on, at this rate.
    pub fn new(hz: u32) -> Self {
        let mut time = Self { hz: 0, base: Now::default(), ps_a_cycle: 0 };
        time.set(Now::default(), hz);
        time
    }

    /// The processor's rate from this moment on.
    pub fn set(&mut self, now: Now, hz: u32) {
        let hz = hz.max(1);
        self.base = now;
        self.hz = hz;
        self.ps_a_cycle = ((u128::from(SECOND) << 32) / u128::from(hz)) as u64;
    }

    /// The processor's clock.
    pub fn hz(&self) -> u32 {
        self.hz
    }

    /// Start of this cycle.
    pub fn ps(&self, cycle: u64) -> Ps {
        let cycles = u128::from(cycle.saturating_sub(self.base.cycle));
        self.base.ps + ((cycles * u128::from(self.ps_a_cycle)) >> 32) as u64
    }

    /// Start of this cycle.
    pub fn at(&self, cycle: u64) -> Now {
        Now { cycle, ps: self.ps(cycle) }
    }

    /// First cycle then.
    pub fn cycle(&self, ps: Ps) -> u64 {
        if ps == NEVER {
            return NEVER;
        }
        let Some(after) = ps.checked_sub(self.base.ps) else { return self.base.cycle };
        let near = (after as f64 * f64::from(self.hz) / SECOND as f64) as u64;
        let mut cycle = self.base.cycle + near.saturating_sub(1);
        while self.ps(cycle) < ps {
            cycle += 1;
        }
        cycle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_and_its_cycle_agree_at_each_rate() {
        for hz in [1_000_000, 16_000_000, 84_000_000, 168_000_000] {
            let mut time = Timebase::new(16_000_000);
            time.set(Now { cycle: 77, ps: 5 * SECOND }, hz);
            for cycle in [77, 78, 79, 1_000, 168_000_077, 604_800_000_077] {
                assert_eq!(time.cycle(time.ps(cycle)), cycle, "{hz}");
                assert_eq!(time.cycle(time.ps(cycle) + 1), cycle + 1, "{hz}");
            }
            assert!(time.ps(77 + u64::from(hz)).abs_diff(6 * SECOND) <= 1, "{hz}");
        }
    }
}
