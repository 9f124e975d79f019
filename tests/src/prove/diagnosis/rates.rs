//! Counts with their bounds, as text.

use super::bound::{events_at_most, share_at_most};

const SECONDS_AN_HOUR: f64 = 3_600.0;

pub(super) fn hours(seconds: f64) -> String {
    format!("{:.2}", seconds / SECONDS_AN_HOUR)
}

pub(super) fn an_hour(events: u64, seconds: f64) -> [String; 2] {
    let hours = seconds / SECONDS_AN_HOUR;
    if hours <= 0.0 {
        return ["-".to_owned(), "-".to_owned()];
    }
    [short(events as f64 / hours), short(events_at_most(events) / hours)]
}

/// Percent, and its lower bound.
pub(super) fn share(count: u64, all: u64) -> [String; 2] {
    if all == 0 {
        return ["-".to_owned(), "-".to_owned()];
    }
    let least = 1.0 - share_at_most(all - count, all);
    [format!("{:.0} %", 100.0 * count as f64 / all as f64), format!("{:.0} %", 100.0 * least)]
}

/// Two significant digits are all that such counts give.
fn short(rate: f64) -> String {
    if rate >= 10.0 || rate == 0.0 { format!("{rate:.0}") } else { format!("{rate:.2}") }
}

pub(super) fn quantile_s(delays_s: &[f64], share: f64) -> String {
    let mut sorted = delays_s.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).map_or_else(|| "-".to_owned(), |delay_s| format!("{delay_s:.1}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_their_bounds() {
        assert_eq!(an_hour(0, 36_000.0), ["0", "0.30"]);
        assert_eq!(an_hour(12, 3_600.0), ["12", "19"]);
        assert_eq!(an_hour(0, 0.0), ["-", "-"]);
        assert_eq!(share(36, 48), ["75 %", "63 %"]);
        assert_eq!(share(3, 3), ["100 %", "37 %"]);
    }

    #[test]
    fn nine_in_ten_are_within_the_ninth_of_ten() {
        let delays: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        assert_eq!((quantile_s(&delays, 0.5), quantile_s(&delays, 0.9)), ("5.0".into(), "9.0".into()));
        assert_eq!(quantile_s(&[], 0.5), "-");
    }
}
