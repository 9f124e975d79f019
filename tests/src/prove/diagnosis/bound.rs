//! Bounds of a rate from a count: exact, one-sided, at 95 %.

/// The probability outside.
const OUTSIDE: f64 = 0.05;
/// Each halving gives a bit; a double has 53.
const HALVINGS: usize = 60;

/// The upper bound of a Poisson mean for this count. Exact (Garwood 1936): half the 95 % quantile of chi-squared with
/// `2 (count + 1)` degrees of freedom.
pub(super) fn events_at_most(count: u64) -> f64 {
    let highest = count as f64 + 10.0 * (count as f64 + 10.0).sqrt();
    boundary(highest, |mean| poisson_up_to(count, mean) > OUTSIDE)
}

/// The upper bound of a share (Clopper and Pearson 1934).
pub(super) fn share_at_most(count: u64, all: u64) -> f64 {
    if count >= all { 1.0 } else { boundary(1.0, |share| binomial_up_to(count, all, share) > OUTSIDE) }
}

/// `holds` at zero.
fn boundary(highest: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, highest);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if holds(middle) { low = middle } else { high = middle }
    }
    high
}

fn poisson_up_to(count: u64, mean: f64) -> f64 {
    let mut logarithm = -mean;
    let mut sum = logarithm.exp();
    for events in 1..=count {
        logarithm += (mean / events as f64).ln();
        sum += logarithm.exp();
    }
    sum
}

fn binomial_up_to(count: u64, all: u64, share: f64) -> f64 {
    let odds = share / (1.0 - share);
    let mut logarithm = all as f64 * (1.0 - share).ln();
    let mut sum = logarithm.exp();
    for hits in 1..=count {
        logarithm += (odds * (all - hits + 1) as f64 / hits as f64).ln();
        sum += logarithm.exp();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half the 95 % quantiles of chi-squared with 2, 4, 12, 42 degrees of freedom, and of 202 (Abramowitz and Stegun,
    /// table 26.8; the last one by Wilson and Hilferty).
    #[test]
    fn bounds_of_counts_are_those_of_the_tables() {
        for (count, bound, within) in [
            (0, 2.9957, 1e-4),
            (1, 4.7439, 1e-4),
            (5, 10.5130, 1e-4),
            (20, 29.062, 1e-3),
            (100, 118.08, 0.02),
        ] {
            let found = events_at_most(count);
            assert!((found - bound).abs() < within, "{count}: {found}");
        }
        assert!(events_at_most(5_000) < 5_130.0, "large counts do not underflow to nothing");
    }

    /// None of n: 1 - 0.05^(1/n).
    #[test]
    fn bounds_of_shares_are_exact() {
        for all in [1, 10, 48] {
            let exact = 1.0 - OUTSIDE.powf(1.0 / all as f64);
            assert!((share_at_most(0, all) - exact).abs() < 1e-9);
        }
        assert!((share_at_most(1, 10) - 0.3942).abs() < 1e-4);
        assert!((share_at_most(3, 3) - 1.0).abs() < 1e-9);
    }
}
