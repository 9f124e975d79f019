//! Quantities over time, sampled so that no extreme is lost: all of them share one row of equal intervals, of which
//! each keeps its lowest and its highest value in the order in which they came. When the row is full, neighbours are
//! joined and the intervals become twice as long: memory and page are bounded, however long the flight is.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::RangeInclusive;

use hums_core::time::Instant;

/// Intervals at most: as many as a large screen has columns.
const INTERVALS_MAX: usize = 2048;
/// The first length of an interval.
const INTERVAL_MS: u64 = 50;
/// Series at most: all that the model of a vehicle can fill.
const SERIES_MAX: usize = 256;
/// Filled intervals of all series together: as many as 64 series have that are full, some 5 MiB. A flying vehicle fills some
/// forty series.
const FILLED_MAX: usize = 64 * INTERVALS_MAX;

/// The row of intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    start_ms: Option<u64>,
    interval_ms: u64,
}

/// What one interval keeps of one series.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extremes {
    low: f32,
    high: f32,
    /// The lowest came first.
    rises: bool,
}

impl Extremes {
    /// With a later value.
    fn with(self, value: f32) -> Self {
        if value < self.low {
            Self { low: value, rises: false, ..self }
        } else if value > self.high {
            Self { high: value, rises: true, ..self }
        } else {
            self
        }
    }

    /// With what a later interval kept.
    fn joined(self, later: Self) -> Self {
        let (first, second) = if later.rises { (later.low, later.high) } else { (later.high, later.low) };
        self.with(first).with(second)
    }
}

/// One quantity.
#[derive(Clone, Debug, Default)]
struct Series {
    /// By interval; a map, because slow quantities fill few of them.
    values: BTreeMap<u16, Extremes>,
}

/// A line of a plot: the plot, and the line's number: a motor, a cell, an axis.
pub type Line<P> = (P, u8);

/// All series of a page, or of a live vehicle, by the plots that there are.
#[derive(Clone, Debug)]
pub struct Store<P> {
    grid: Grid,
    series: BTreeMap<Line<P>, Series>,
    /// Intervals that have a value, of all series.
    filled: usize,
    series_max: usize,
}

/// What a series has in some of the intervals: their numbers, and the values of each in their order, a pair each.
pub type Part = (Vec<u16>, Vec<f32>);

impl<P> Default for Store<P> {
    fn default() -> Self {
        Self::of(SERIES_MAX)
    }
}

impl<P> Store<P> {
    /// With room for so many series; they have the filled intervals of all together.
    pub fn of(series_max: usize) -> Self {
        let grid = Grid { start_ms: None, interval_ms: INTERVAL_MS };
        Self { grid, series: BTreeMap::new(), filled: 0, series_max }
    }
}

impl<P: Copy + Ord> Store<P> {
    /// Takes a value; what is not finite is none.
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
        match series.values.entry(interval) {
            Entry::Occupied(mut known) => *known.get_mut() = known.get().with(value),
            Entry::Vacant(place) => {
                place.insert(Extremes { low: value, high: value, rises: true });
                self.filled += 1;
            }
        }
    }

    /// The interval of a time; makes room for it first. What is before the first one counts to it.
    pub fn interval(&mut self, at: Instant) -> u16 {
        let start_ms = *self.grid.start_ms.get_or_insert(at.as_millis());
        let since_ms = at.as_millis().saturating_sub(start_ms);
        while since_ms / self.grid.interval_ms >= INTERVALS_MAX as u64 || self.filled >= FILLED_MAX {
            self.join();
        }
        (since_ms / self.grid.interval_ms) as u16
    }

    /// Joins neighbours: the intervals are twice as long from then on.
    fn join(&mut self) {
        self.grid.interval_ms = self.grid.interval_ms.saturating_mul(2);
        self.filled = 0;
        for series in self.series.values_mut() {
            let mut joined: BTreeMap<u16, Extremes> = BTreeMap::new();
            for (interval, later) in std::mem::take(&mut series.values) {
                let into = joined.entry(interval / 2);
                into.and_modify(|extremes| *extremes = extremes.joined(later)).or_insert(later);
            }
            self.filled += joined.len();
            series.values = joined;
        }
    }

    /// The first interval's time and the intervals' length, milliseconds; `None` before the first value.
    pub fn spacing_ms(&self) -> Option<(u64, u64)> {
        Some((self.grid.start_ms?, self.grid.interval_ms))
    }

    /// What all series have in these intervals, for those that have anything.
    pub fn part(&self, intervals: RangeInclusive<u16>) -> impl Iterator<Item = (Line<P>, Part)> {
        // An empty range is one that ends before it begins, which a map refuses.
        let some = intervals.start() <= intervals.end();
        self.series.iter().filter(move |_| some).filter_map(move |(line, series)| {
            // Most series have nothing new at a look.
            let (last, _) = series.values.last_key_value()?;
            if last < intervals.start() {
                return None;
            }
            let (mut numbers, mut values) = (Vec::new(), Vec::new());
            for (&number, extremes) in series.values.range(intervals.clone()) {
                numbers.push(number);
                let (low, high) = (extremes.low, extremes.high);
                values.extend(if extremes.rises { [low, high] } else { [high, low] });
            }
            (!numbers.is_empty()).then_some((*line, (numbers, values)))
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
