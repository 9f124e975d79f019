//! Quantities over time, sampled so that no extreme is lost. All share one row of equal intervals, with the lowest and highest
//! value in order of time. When full, neighbours are joined: bounded for any flight.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use hums_core::clock::Instant;

/// A large screen's columns.
const INTERVALS_MAX: usize = 2048;
const INTERVAL_MS: u64 = 50;
/// All that a vehicle's model can fill.
const SERIES_MAX: usize = 256;
/// As 64 full series, some 5 MiB; a flying vehicle fills some forty.
const FILLED_MAX: usize = 64 * INTERVALS_MAX;

/// The row of intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    start_ms: Option<u64>,
    interval_ms: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Extremes {
    low: f32,
    high: f32,
    /// The lowest came first.
    rises: bool,
}

impl Extremes {
    /// Later value.
    fn with(self, value: f32) -> Self {
        if value < self.low {
            Self { low: value, rises: false, ..self }
        } else if value > self.high {
            Self { high: value, rises: true, ..self }
        } else {
            self
        }
    }

    /// Later interval.
    fn joined(self, later: Self) -> Self {
        let (first, second) = if later.rises { (later.low, later.high) } else { (later.high, later.low) };
        self.with(first).with(second)
    }
}

/// One quantity.
#[derive(Clone, Debug, Default)]
struct Series {
    /// Values by interval; slow quantities fill few.
    values: Vec<(u16, Extremes)>,
    last: u64,
}

impl Series {
    fn part(&self, intervals: RangeInclusive<u16>) -> Option<Part> {
        // Mostly nothing new.
        let (last, _) = self.values.last()?;
        if last < intervals.start() {
            return None;
        }
        let place = |number: u16| self.values.partition_point(|(before, _)| *before < number);
        let (from, to) = (place(*intervals.start()), intervals.end().checked_add(1).map(place));
        let some = self.values.get(from..to.unwrap_or(self.values.len())).filter(|some| !some.is_empty())?;
        let pair = |extremes: &Extremes| {
            if extremes.rises { [extremes.low, extremes.high] } else { [extremes.high, extremes.low] }
        };
        let numbers = some.iter().map(|(number, _)| *number).collect();
        Some((numbers, some.iter().flat_map(|(_, extremes)| pair(extremes)).collect()))
    }

    fn push(&mut self, interval: u16, value: f32) -> bool {
        let first = (interval, Extremes { low: value, high: value, rises: true });
        match self.values.last_mut() {
            // Nearly all are in order.
            Some((last, extremes)) if *last == interval => *extremes = extremes.with(value),
            Some((last, _)) if *last > interval => {
                match self.values.binary_search_by_key(&interval, |(number, _)| *number) {
                    Ok(place) => {
                        if let Some((_, extremes)) = self.values.get_mut(place) {
                            *extremes = extremes.with(value);
                        }
                    }
                    Err(place) => {
                        self.values.insert(place, first);
                        return true;
                    }
                }
            }
            _ => {
                self.values.push(first);
                return true;
            }
        }
        false
    }
}

/// Plot and number: a motor, a cell, an axis.
pub type Line<P> = (P, u8);

/// Series by plot.
#[derive(Clone, Debug)]
pub struct Store<P> {
    grid: Grid,
    series: BTreeMap<Line<P>, Series>,
    filled: usize,
    series_max: usize,
    taken: u64,
}

/// Intervals, and a pair of values each.
pub type Part = (Vec<u16>, Vec<f32>);

impl<P> Default for Store<P> {
    fn default() -> Self {
        Self::of(SERIES_MAX)
    }
}

impl<P> Store<P> {
    /// Sharing one grid.
    pub fn of(series_max: usize) -> Self {
        let grid = Grid { start_ms: None, interval_ms: INTERVAL_MS };
        Self { grid, series: BTreeMap::new(), filled: 0, series_max, taken: 0 }
    }
}

impl<P: Copy + Ord> Store<P> {
    /// NaN and infinities are skipped.
    pub fn push(&mut self, at: Instant, line: Line<P>, value: f32) {
        if !value.is_finite() {
            return;
        }
        let interval = self.interval(at);
        let has_room = self.series.len() < self.series_max;
        let series = match self.series.get_mut(&line) {
            Some(series) => series,
            None if has_room => self.series.entry(line).or_default(),
            None => return,
        };
        self.taken += 1;
        series.last = self.taken;
        self.filled += usize::from(series.push(interval, value));
    }

    /// Makes room; earlier times count to the first one.
    pub fn interval(&mut self, at: Instant) -> u16 {
        let start_ms = *self.grid.start_ms.get_or_insert(at.as_millis());
        let since_ms = at.as_millis().saturating_sub(start_ms);
        while since_ms / self.grid.interval_ms >= INTERVALS_MAX as u64 || self.filled >= FILLED_MAX {
            self.join();
        }
        (since_ms / self.grid.interval_ms) as u16
    }

    /// Doubles the intervals.
    fn join(&mut self) {
        self.grid.interval_ms = self.grid.interval_ms.saturating_mul(2);
        self.filled = 0;
        for series in self.series.values_mut() {
            for (interval, _) in &mut series.values {
                *interval /= 2;
            }
            series.values.dedup_by(|(number, later), (before, extremes)| {
                let same = number == before;
                if same {
                    *extremes = extremes.joined(*later);
                }
                same
            });
            self.filled += series.values.len();
        }
    }

    /// Start and length, ms; `None` before the first value.
    pub fn spacing_ms(&self) -> Option<(u64, u64)> {
        Some((self.grid.start_ms?, self.grid.interval_ms))
    }

    /// Number of values in all series.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Series with values in these intervals.
    pub fn part(&self, intervals: RangeInclusive<u16>) -> impl Iterator<Item = (Line<P>, Part)> {
        self.series.iter().filter_map(move |(line, series)| Some((*line, series.part(intervals.clone())?)))
    }

    /// For a reader that saw the first interval at `seen` values: repeated only for series with a value since.
    pub fn news(&self, intervals: RangeInclusive<u16>, seen: u64) -> impl Iterator<Item = (Line<P>, Part)> {
        let (from, to) = intervals.into_inner();
        self.series.iter().filter_map(move |(line, series)| {
            let from = if series.last > seen { from } else { from.saturating_add(1) };
            Some((*line, series.part(from..=to)?))
        })
    }

    /// All lines that have a value, in their order.
    pub fn lines(&self) -> impl Iterator<Item = Line<P>> {
        self.series.keys().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEIGHT: &str = "height";
    const KEY: Line<&str> = (HEIGHT, 0);

    fn whole(store: &Store<&str>) -> Part {
        store.part(0..=u16::MAX).next().expect("a series").1
    }

    #[test]
    fn extremes_outlive_every_doubling() {
        let mut store = Store::default();
        for second in 0..100_000_u64 {
            let value = match second {
                777 => 99.0,
                55_555 => -99.0,
                _ => (second % 7) as f32,
            };
            store.push(Instant::from_millis(second * 1000), KEY, value);
        }
        let (_, interval_ms) = store.spacing_ms().expect("a value");
        let (numbers, values) = whole(&store);
        assert!((1000..=2048).contains(&numbers.len()), "{interval_ms}");
        assert!(numbers.iter().copied().eq(0..numbers.len() as u16));
        let place = |wanted: f32| {
            values.iter().position(|value| (value - wanted).abs() < 0.01).expect("kept") as u64 / 2
        };
        let at = |second: u64| second * 1000 / interval_ms;
        assert_eq!((place(99.0), place(-99.0)), (at(777), at(55_555)));
    }

    #[test]
    fn the_order_of_extremes_is_kept() {
        for (values, kept) in
            [([1.0, 5.0, 3.0], [1.0, 5.0]), ([5.0, 1.0, 3.0], [5.0, 1.0]), ([3.0, 5.0, 1.0], [5.0, 1.0])]
        {
            let mut store = Store::default();
            for value in values {
                store.push(Instant::ZERO, KEY, value);
            }
            assert_eq!(whole(&store).1, kept);
        }
    }

    #[test]
    fn a_time_beyond_all_reason_and_a_clock_set_back_stay_in_bounds() {
        let mut store = Store::default();
        store.push(Instant::from_millis(1000), KEY, 1.0);
        store.push(Instant::from_micros(u64::MAX), KEY, 2.0);
        store.push(Instant::ZERO, KEY, f32::NAN);
        store.push(Instant::ZERO, KEY, 3.0);
        let (numbers, values) = whole(&store);
        assert!(numbers.iter().all(|number| usize::from(*number) < INTERVALS_MAX));
        assert_eq!(values.len(), 2 * numbers.len());
    }

    #[test]
    fn who_has_seen_an_interval_gets_it_again_only_of_the_series_that_changed() {
        let mut store = Store::default();
        let at = |interval: u64| Instant::from_millis(interval * INTERVAL_MS);
        store.push(at(0), (HEIGHT, 0), 1.0);
        store.push(at(0), (HEIGHT, 1), 2.0);
        let seen = store.taken();
        assert_eq!(store.news(0..=1, seen).count(), 0);
        store.push(at(0), (HEIGHT, 1), 3.0);
        let news: Vec<_> = store.news(0..=1, seen).collect();
        assert_eq!(news, [((HEIGHT, 1), (vec![0], vec![2.0, 3.0]))]);
        // Before the first reader.
        let seen = store.taken();
        store.push(at(1), (HEIGHT, 0), 4.0);
        let news: Vec<_> = store.news(0..=1, seen + 1).collect();
        assert_eq!(news, [((HEIGHT, 0), (vec![1], vec![4.0, 4.0]))]);
    }

    #[test]
    fn many_full_series_become_coarser_and_none_of_them_goes() {
        let mut store = Store::default();
        for interval in 0..INTERVALS_MAX as u64 {
            for line in 0..=u8::MAX {
                store.push(Instant::from_millis(interval * INTERVAL_MS), (HEIGHT, line), interval as f32);
            }
        }
        let series: Vec<_> = store.part(0..=u16::MAX).map(|(_, part)| part).collect();
        assert_eq!(series.len(), SERIES_MAX);
        let filled: usize = series.iter().map(|(numbers, _)| numbers.len()).sum();
        assert!((FILLED_MAX / 2..=FILLED_MAX).contains(&filled), "{filled}");
        assert_eq!(filled, store.filled);
        let last = INTERVALS_MAX as f32 - 1.0;
        assert!(
            series.iter().all(|(_, values)| values.first() == Some(&0.0) && values.last() == Some(&last))
        );
    }
}
