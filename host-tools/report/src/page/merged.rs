//! Several flights in the same plots, from take-off on: each flight is a line in the plot of each quantity.
//! So they have one scale, and the page draws them as it draws one flight.

use hums_core::clock::Instant;
use hums_core::observation::Autopilot;

use super::history::{History, HistoryPart, PlotJson, Series, TrackPoint, told};
use super::plots::{self, Limits, Plot};
use crate::series::Store;

/// Maximum number of series of each flight: all lines that are compared.
const SERIES_EACH: usize = 96;

/// Maximum number of places of a track in a comparison: the map there is small.
const PLACES_MAX: usize = 1_000;

/// A quantity: the plot, its line, and whether it is PX4's, whose figures of vibration and estimator differ.
type Quantity = (Plot, u8, bool);

/// A flight to be merged with others.
#[derive(Clone, Copy, Debug)]
pub struct MergedFlight<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its history.
    pub history: &'a History,
    /// Take-off, and when it was in the air last.
    pub span: (Instant, Instant),
}

const fn is_compared(plot: Plot, line: u8) -> bool {
    match plot {
        Plot::Height | Plot::Vertical => line == 0,
        Plot::Vibration => line != plots::RISE,
        Plot::Velocity
        | Plot::Heading
        | Plot::Rates
        | Plot::Altitude
        | Plot::WindFrom
        | Plot::Sticks
        | Plot::MotorVolts
        | Plot::EscErrors
        | Plot::Fix
        | Plot::Clips
        | Plot::Link
        | Plot::Frames
        | Plot::Pressure => false,
        Plot::Speed | Plot::Attitude => line < 2,
        Plot::Outputs => line < 12,
        _ => true,
    }
}

/// One part that is all of them, in the order in which they are given; limits are those of the first one.
pub fn merged(flights: &[MergedFlight<'_>]) -> HistoryPart {
    let mut store: Store<Quantity> = Store::of(SERIES_EACH * flights.len());
    // Take-off is the beginning of all.
    store.interval(Instant::ZERO);
    for (number, flight) in (0..).zip(flights) {
        add(&mut store, number, flight);
    }
    let (start_ms, step_ms) = store.spacing_ms().unwrap_or((0, 1));
    let name = |(quantity, line)| format!("{}:{line}", id(quantity));
    let series = store.part(0..=u16::MAX);
    let series = series.map(|(line, part)| (name(line), about(line.0).decimals, part)).collect();
    let plots = plots(&store, flights);
    HistoryPart {
        t: "history",
        reset: true,
        start_s: start_ms as f64 / 1e3,
        step_s: step_ms as f64 / 1e3,
        plots: Some(plots),
        series: Series(series),
        ..HistoryPart::default()
    }
}

fn add(store: &mut Store<Quantity>, number: u8, flight: &MergedFlight<'_>) {
    let (own, autopilot, _) = flight.history.drawn();
    let Some((start_ms, step_ms)) = own.spacing_ms() else { return };
    let (from, to) = flight.span;
    let of_px4 = |plot| autopilot == Autopilot::Px4 && matches!(plot, Plot::Vibration | Plot::Estimator);
    for ((plot, line), (numbers, values)) in own.part(0..=u16::MAX) {
        if !is_compared(plot, line) {
            continue;
        }
        for (interval, pair) in numbers.iter().zip(values.chunks_exact(2)) {
            let begin_ms = start_ms + u64::from(*interval) * step_ms;
            // An interval has its extremes somewhere in it.
            for (at_ms, value) in [begin_ms + step_ms / 4, begin_ms + step_ms * 3 / 4].into_iter().zip(pair) {
                let at = Instant::from_millis(at_ms);
                if at >= from && at <= to {
                    let since = Instant::from_micros(at.since(from).as_micros());
                    store.push(since, ((plot, line, of_px4(plot)), number), *value);
                }
            }
        }
    }
}

/// The track of a flight, from its take-off on: the first place of each of at most `PLACES_MAX` pieces, and
/// the last.
pub fn places(flight: &MergedFlight<'_>) -> Vec<TrackPoint> {
    let (from, to) = flight.span;
    let track = flight.history.track();
    let begin = track.partition_point(|place| place.at < from);
    let of_it = track.get(begin..track.partition_point(|place| place.at <= to)).unwrap_or_default();
    let each = of_it.len().div_ceil(PLACES_MAX).max(1);
    let chosen = of_it.iter().step_by(each);
    let last = of_it.last().filter(|_| of_it.len() % each != 1 && each > 1);
    chosen.chain(last).map(|place| told(place, from)).collect()
}

fn plots(store: &Store<Quantity>, flights: &[MergedFlight<'_>]) -> Vec<PlotJson> {
    let mut all: Vec<(Quantity, PlotJson)> = Vec::new();
    for (quantity, number) in store.lines() {
        let flight = flights.get(usize::from(number));
        let named = (number, flight.map_or_else(String::new, |flight| flight.name.to_owned()));
        if let Some((_, json)) = all.last_mut().filter(|(last, _)| *last == quantity) {
            json.lines.push(named);
            continue;
        }
        let plots::PlotProperties { group, title, unit, decimals, name } = about(quantity);
        let line = name(quantity.1);
        let title = if title == line { line } else { format!("{title}: {line}") };
        let limits = limits(quantity, flights);
        let id = id(quantity);
        all.push((quantity, PlotJson { id, group, title, unit, decimals, limits, lines: vec![named] }));
    }
    all.into_iter().map(|(_, json)| json).collect()
}

fn about((plot, _, of_px4): Quantity) -> plots::PlotProperties {
    plots::about(plot, if of_px4 { Autopilot::Px4 } else { Autopilot::ArduPilot })
}

fn limits((plot, _, of_px4): Quantity, flights: &[MergedFlight<'_>]) -> Vec<Limits> {
    let params = flights.iter().find_map(|flight| flight.history.drawn().2);
    let autopilot = if of_px4 { Autopilot::Px4 } else { Autopilot::ArduPilot };
    params.map(|params| plots::limits(plot, autopilot, params, 0)).unwrap_or_default()
}

/// Safe as an element's name.
fn id((plot, line, of_px4): Quantity) -> String {
    format!("{plot:?}-{line}{}", if of_px4 { "-px4" } else { "" })
}

#[cfg(test)]
mod tests {
    use hums_core::observation::{GlobalPosition, Observation};
    use hums_core::units::Metres;

    use super::*;
    use crate::reference::Reference;

    fn rises(take_off_s: u64) -> History {
        let mut history = History::default();
        for second in 0..take_off_s + 60 {
            let relative_altitude = Metres(second.saturating_sub(take_off_s) as f32);
            let global = GlobalPosition { relative_altitude, ..GlobalPosition::default() };
            let at = Instant::from_millis(second * 1_000);
            history.sample(at, &Reference::default(), &Observation::GlobalPosition(global));
        }
        history
    }

    #[test]
    fn flights_stand_in_one_plot_from_their_take_off_on() {
        let histories = [rises(10), rises(300)];
        let span = |take_off_s: u64| {
            (Instant::from_millis(take_off_s * 1_000), Instant::from_millis((take_off_s + 40) * 1_000))
        };
        let flight = |name, history, take_off_s| MergedFlight { name, history, span: span(take_off_s) };
        let part = merged(&[flight("one", &histories[0], 10), flight("other", &histories[1], 300)]);
        let plots = part.plots.expect("plots");
        let height = plots.iter().find(|plot| plot.id == "Height-0").expect("its height");
        assert_eq!(height.lines, [(0, "one".to_owned()), (1, "other".to_owned())]);
        for number in 0..2 {
            let key = format!("Height-0:{number}");
            let (_, _, (numbers, values)) =
                part.series.0.iter().find(|(name, ..)| *name == key).expect("one");
            for (interval, pair) in numbers.iter().zip(values.chunks_exact(2)) {
                let at_s = (f64::from(*interval) + 0.5) * part.step_s;
                assert!((f64::from(pair[1]) - at_s).abs() < 2.0, "{pair:?} m after {at_s} s");
            }
            assert!(values.iter().all(|height_m| *height_m < 42.0), "no more than the flight");
        }
    }
}
