//! Rainflow counting after ASTM E1049-85, section 5.4.4, of a history without end: the cycles of a load by their
//! range, on which fatigue depends.
//!
//! Streaming and bounded: only turning points that may still pair are kept, at most [`POINTS`]. Beyond that the
//! oldest range counts as a half cycle, as at the end of the history.

/// Turning points kept. A residue grows and then shrinks: 2 N points need N distinct sizes of swing.
const POINTS: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rainflow<const BINS: usize> {
    edges: [f32; BINS],
    halves: [u32; BINS],
    points: [f32; POINTS],
    used: u8,
    extreme: Option<f32>,
    turn: f32,
}

impl<const BINS: usize> Rainflow<BINS> {
    /// Counts ranges from `edges[0]` on; ignores changes of less than `turn`.
    pub(crate) const fn new(edges: [f32; BINS], turn: f32) -> Self {
        Self { edges, halves: [0; BINS], points: [0.0; POINTS], used: 0, extreme: None, turn }
    }

    pub(crate) fn take(&mut self, value: f32) {
        if !value.is_finite() {
            return;
        }
        let (Some(extreme), true) = (self.extreme, self.used > 0) else {
            if self.used == 0 {
                self.push(value);
            }
            self.extreme = Some(value);
            return;
        };
        let rising = extreme > self.points[usize::from(self.used) - 1];
        let level = (extreme - self.points[usize::from(self.used) - 1]).abs() <= 0.0;
        if level || (rising && value >= extreme) || (!rising && value <= extreme) {
            self.extreme = Some(value);
        } else if (value - extreme).abs() > self.turn {
            self.push(extreme);
            self.extreme = Some(value);
        }
    }

    /// A new turning point: counts and removes the ranges that it closes.
    fn push(&mut self, point: f32) {
        if usize::from(self.used) == POINTS {
            self.count(self.points[0], self.points[1], 1);
            self.remove(0, 1);
        }
        self.points[usize::from(self.used)] = point;
        self.used += 1;
        while self.used >= 3 {
            let last = usize::from(self.used) - 1;
            let [a, b, c] = [self.points[last - 2], self.points[last - 1], self.points[last]];
            if (c - b).abs() < (b - a).abs() {
                break;
            }
            if last == 2 {
                self.count(a, b, 1);
                self.remove(0, 1);
            } else {
                self.count(a, b, 2);
                self.remove(last - 2, 2);
            }
        }
    }

    fn remove(&mut self, at: usize, count: usize) {
        self.points.copy_within(at + count..usize::from(self.used), at);
        self.used -= count as u8;
    }

    fn bin(&self, from: f32, to: f32) -> Option<usize> {
        let range = (to - from).abs();
        self.edges.iter().rposition(|edge| range >= *edge)
    }

    fn count(&mut self, from: f32, to: f32, halves: u32) {
        if let Some(bin) = self.bin(from, to) {
            self.halves[bin] = self.halves[bin].saturating_add(halves);
        }
    }

    /// Cycles of a bin as if the history ended now: open ranges count half.
    pub(crate) fn cycles(&self, bin: usize) -> f64 {
        let points = &self.points[..usize::from(self.used)];
        let open = self.extreme.filter(|_| !points.is_empty());
        let ends = points.iter().copied().skip(1).chain(open);
        let residue = points.iter().copied().zip(ends).filter(|(from, to)| self.bin(*from, *to) == Some(bin));
        let closed = self.halves.get(bin).copied().unwrap_or(0);
        0.5 * (f64::from(closed) + residue.count() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half cycles of ranges 1 to 10.
    fn counted(history: &[f32]) -> [u32; 10] {
        let mut rainflow = Rainflow::new([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0], 0.0);
        for value in history {
            rainflow.take(*value);
        }
        core::array::from_fn(|bin| (2.0 * rainflow.cycles(bin)) as u32)
    }

    #[test]
    fn the_worked_example_of_the_standard() {
        // ASTM E1049-85, figure 6: ranges 3, 4, 6, 8 and 9 with 0.5, 1.5, 0.5, 1.0 and 0.5 cycles.
        let expected = [0, 0, 1, 3, 0, 1, 0, 2, 1, 0];
        assert_eq!(counted(&[-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]), expected);
    }

    #[test]
    fn values_between_the_turning_points_change_nothing() {
        let history = [-2.0, -1.0, 0.5, 1.0, 1.0, -1.0, -3.0, 0.0, 5.0, 2.0, -1.0, 3.0, 1.0, -4.0, 4.0, -2.0];
        assert_eq!(counted(&history), counted(&[-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]));
    }

    #[test]
    fn a_long_steady_swing_is_counted_swing_by_swing() {
        let history: Vec<f32> = (0..2_001).map(|step| if step % 2 == 0 { 0.0 } else { 3.0 }).collect();
        assert_eq!(counted(&history)[2], 2_000);
    }

    #[test]
    fn a_residue_longer_than_the_memory_loses_no_half_cycle() {
        let history: Vec<f32> =
            (0..=80_i16).map(|step| f32::from(100 - step) * if step % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert_eq!(counted(&history).iter().sum::<u32>(), 80);
    }

    #[test]
    fn nothing_steady_and_noise_below_the_turn_are_no_cycles() {
        let mut rainflow = Rainflow::new([0.25], 0.2);
        for step in 0..1_000 {
            rainflow.take(if step % 2 == 0 { 1.0 } else { 1.1 });
            rainflow.take(f32::NAN);
        }
        assert!(rainflow.cycles(0) <= 0.0);
    }
}
