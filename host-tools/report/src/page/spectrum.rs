//! Spectra of acceleration and body rates from samples at 180 Hz or more: rows `IMU` and batches `ISBH`,
//! `ISBD` of `ArduPilot`, `sensor_combined` of PX4.
//!
//! Power is averaged over segments with a Hann window (Welch's method). A segment with a pause is left out.

use std::f64::consts::TAU;

use hums_core::clock::Instant;
use serde::Serialize;

use super::more::{is_first, number};
use crate::source::item::Row;

/// The rows with samples.
pub const ROWS: [&str; 4] = ["IMU", "ISBH", "ISBD", "sensor_combined"];

const SEGMENT: usize = 512;
/// The least rate of samples: vibration of rotors is below half of it. PX4 logs `sensor_combined` at nominally
/// 200 Hz; logs have 197.9 and 199.2 Hz.
const RATE_MIN_HZ: f64 = 180.0;
/// The least frequency of the strongest line. Manoeuvres are below it (body rates of logs: 0.4 to 1.5 Hz), rotors
/// above it: `ArduPilot`'s notch filters against rotors (`INS_HNTCH_FREQ`) begin at 10 Hz.
const LINE_MIN_HZ: f64 = 10.0;
/// Segments of another rate than the first are left out.
const RATE_PART: f64 = 0.1;
/// Fewer segments are noise.
const SEGMENTS_MIN: u32 = 4;
const BATCH_ROW: usize = 32;

type Sample = [f64; 3];

/// One sensor's spectrum for the page.
#[derive(Clone, Debug, Serialize)]
pub struct SpectrumJson {
    title: &'static str,
    /// Of the values.
    unit: &'static str,
    /// Samples a second.
    rate_hz: f64,
    /// From one value to the next; the first is at this frequency.
    step_hz: f64,
    /// The strongest frequency from [`LINE_MIN_HZ`] and its axis, in words.
    strongest: String,
    /// Amplitude density of each axis.
    values: [Vec<f32>; 3],
}

/// Spectra in the making.
#[derive(Debug, Default)]
pub struct Spectra {
    /// From samples in rows of their own.
    rows: [Spectrum; 2],
    /// The same from batches, whose rate is higher.
    batches: [Spectrum; 2],
    /// Sensor, divisor and rate of the batch whose rows come.
    batch: Option<(bool, f64, f64)>,
}

#[derive(Debug, Default)]
struct Spectrum {
    waiting: Vec<(f64, Sample)>,
    rate_hz: f64,
    segments: u32,
    power: Vec<Sample>,
}

impl Spectra {
    /// Takes a row.
    pub fn row(&mut self, at: Instant, row: &Row<'_>) {
        let three = |names: [&str; 3]| {
            let [x, y, z] = names.map(|name| number(row, name).map(f64::from));
            Some([x?, y?, z?])
        };
        let at_s = at.as_secs_f64();
        match row.table.name.as_str() {
            "IMU" if number(row, "I").is_none_or(|sensor| sensor < 0.5) => {
                let [acceleration, rates] = &mut self.rows;
                acceleration.take(at_s, three(["AccX", "AccY", "AccZ"]));
                rates.take(at_s, three(["GyrX", "GyrY", "GyrZ"]));
            }
            "sensor_combined" if is_first(row) => {
                let names = |of: &str| [0, 1, 2].map(|axis| format!("{of}[{axis}]"));
                let values = |of: &str| three(names(of).each_ref().map(String::as_str));
                let [acceleration, rates] = &mut self.rows;
                acceleration.take(at_s, values("accelerometer_m_s2"));
                rates.take(at_s, values("gyro_rad"));
            }
            "ISBH" => {
                let field = |name| number(row, name).map(f64::from);
                let of = (field("type"), field("mul"), field("smp_rate"), field("instance"));
                self.batch = match of {
                    (Some(kind), Some(divisor), Some(rate), Some(0.0)) if divisor > 0.0 => {
                        Some((kind > 0.5, divisor, rate))
                    }
                    _ => None,
                };
            }
            "ISBD" => {
                let Some((is_gyro, divisor, rate_hz)) = self.batch else { return };
                let [acceleration, rates] = &mut self.batches;
                let spectrum = if is_gyro { rates } else { acceleration };
                let first = number(row, "seqno").map_or(0.0, f64::from) * BATCH_ROW as f64;
                if first < 0.5 {
                    spectrum.waiting.clear();
                }
                for place in 0..BATCH_ROW {
                    let names = ["x", "y", "z"].map(|axis| format!("{axis}[{place}]"));
                    let sample = three(names.each_ref().map(String::as_str));
                    let sample = sample.map(|of| of.map(|value| value / divisor));
                    spectrum.take((first + place as f64) / rate_hz, sample);
                }
            }
            _ => {}
        }
    }

    /// The spectra; none of sensors whose samples are too few or too slow.
    pub fn end(self) -> Vec<SpectrumJson> {
        let titles = [("Acceleration", "m/s²/√Hz"), ("Body rates", "rad/s/√Hz")];
        let both = self.batches.into_iter().zip(self.rows).zip(titles);
        both.filter_map(|((batches, rows), (title, unit))| {
            batches.json(title, unit).or_else(|| rows.json(title, unit))
        })
        .collect()
    }
}

impl Spectrum {
    fn take(&mut self, at_s: f64, sample: Option<Sample>) {
        let Some(sample) = sample else { return };
        if self.waiting.last().is_some_and(|(last, _)| at_s <= *last) {
            self.waiting.clear();
        }
        self.waiting.push((at_s, sample));
        if self.waiting.len() == SEGMENT {
            self.segment();
            self.waiting.clear();
        }
    }

    fn segment(&mut self) {
        let (Some((first, _)), Some((last, _))) = (self.waiting.first(), self.waiting.last()) else { return };
        let rate_hz = (SEGMENT - 1) as f64 / (last - first);
        let times = self.waiting.iter().map(|(at, _)| at);
        let pause = times.clone().zip(times.skip(1)).map(|(from, to)| to - from).fold(0.0, f64::max);
        let is_other = self.segments > 0 && (rate_hz / self.rate_hz - 1.0).abs() > RATE_PART;
        if !(rate_hz >= RATE_MIN_HZ && pause < 3.0 / rate_hz) || is_other {
            return;
        }
        if self.segments == 0 {
            self.rate_hz = rate_hz;
            self.power = vec![[0.0; 3]; SEGMENT / 2];
        }
        self.segments += 1;
        let window = |place: usize| 0.5 - 0.5 * (TAU * place as f64 / SEGMENT as f64).cos();
        let weight: f64 = (0..SEGMENT).map(|place| window(place).powi(2)).sum();
        for axis in 0..3 {
            let value = |(_, sample): &(f64, Sample)| sample.get(axis).copied().unwrap_or_default();
            let mean = self.waiting.iter().map(value).sum::<f64>() / SEGMENT as f64;
            let samples = self.waiting.iter().enumerate();
            let samples = samples.map(|(place, of)| ((value(of) - mean) * window(place), 0.0)).collect();
            let bins = transform(samples);
            for (sum, (re, im)) in self.power.iter_mut().zip(bins.into_iter().skip(1)) {
                if let Some(sum) = sum.get_mut(axis) {
                    *sum += 2.0 * (re * re + im * im) / (rate_hz * weight);
                }
            }
        }
    }

    fn json(self, title: &'static str, unit: &'static str) -> Option<SpectrumJson> {
        if self.segments < SEGMENTS_MIN {
            return None;
        }
        let step_hz = self.rate_hz / SEGMENT as f64;
        let mean = |sum: f64| (sum / f64::from(self.segments)).sqrt();
        let values = [0, 1, 2].map(|axis| {
            let of = |sums: &Sample| mean(sums.get(axis).copied().unwrap_or_default()) as f32;
            self.power.iter().map(of).collect::<Vec<f32>>()
        });
        let bins = values.iter().zip(["x", "y", "z"]).flat_map(|(of, axis)| {
            of.iter().enumerate().map(move |(place, value)| (*value, (place + 1) as f64 * step_hz, axis))
        });
        let lines = bins.filter(|(_, hz, _)| *hz >= LINE_MIN_HZ);
        let strongest =
            lines.max_by(|(one, ..), (other, ..)| one.total_cmp(other)).filter(|(value, ..)| *value > 0.0);
        let strongest = strongest.map(|(_, hz, axis)| format!("{hz:.1} Hz, {axis}"))?;
        Some(SpectrumJson { title, unit, rate_hz: self.rate_hz, step_hz, strongest, values })
    }
}

/// Discrete Fourier transform (radix 2).
fn transform(samples: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if samples.len() < 2 {
        return samples;
    }
    let half = |from: usize| transform(samples.iter().skip(from).step_by(2).copied().collect());
    let (even, odd) = (half(0), half(1));
    let turned: Vec<(f64, f64)> = (0_u32..)
        .zip(&odd)
        .map(|(place, (re, im))| {
            let (sin, cos) = (-TAU * f64::from(place) / samples.len() as f64).sin_cos();
            (re * cos - im * sin, re * sin + im * cos)
        })
        .collect();
    let sums = even.iter().zip(&turned).map(|((re, im), (re2, im2))| (re + re2, im + im2));
    let differences = even.iter().zip(&turned).map(|((re, im), (re2, im2))| (re - re2, im - im2));
    sums.chain(differences).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::mavlink::values::Scalar;
    use crate::source::item::{CellValue, Column, ColumnType, Table};

    #[test]
    fn batches_are_one_spectrum_whatever_rows_come_between() {
        let table = |name: &str, columns: &[String]| {
            let column =
                |name: &String| Column { name: name.clone(), unit: String::new(), kind: ColumnType::Double };
            Arc::new(Table { name: name.to_owned(), columns: columns.iter().map(column).collect() })
        };
        let own = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let head = table("ISBH", &own(&["N", "type", "instance", "mul", "smp_cnt", "smp_rate"]));
        let arrays =
            ["x", "y", "z"].iter().flat_map(|axis| (0..BATCH_ROW).map(move |at| format!("{axis}[{at}]")));
        let rows = table("ISBD", &own(&["seqno"]).into_iter().chain(arrays).collect::<Vec<_>>());
        let slow = table("IMU", &own(&["I", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"]));
        let mut spectra = Spectra::default();
        let numbers =
            |of: &[f64]| of.iter().map(|value| CellValue::Number(Scalar::Double(*value))).collect::<Vec<_>>();
        for batch in 0..4_u32 {
            let at = Instant::from_millis(u64::from(batch) * 2_000);
            let values = numbers(&[f64::from(batch), 1.0, 0.0, 100.0, 1_024.0, 2_000.0]);
            spectra.row(at, &Row { table: &head, values: &values });
            for row in 0..32_u32 {
                let sample = |at: usize| f64::from(row) * 32.0 + at as f64;
                let wave = (0..BATCH_ROW).map(|at| 300.0 * (TAU * 250.0 * sample(at) / 2_000.0).sin());
                let still = std::iter::repeat_n(0.0, BATCH_ROW);
                let all: Vec<f64> =
                    std::iter::once(f64::from(row)).chain(still.clone()).chain(still).chain(wave).collect();
                spectra.row(at, &Row { table: &rows, values: &numbers(&all) });
                let at = Instant::from_millis(u64::from(batch * 2_000 + row * 40));
                spectra.row(at, &Row { table: &slow, values: &numbers(&[0.0; 7]) });
            }
        }
        let all = spectra.end();
        let [found] = all.as_slice() else { panic!("{all:?}") };
        assert_eq!((found.title, found.strongest.as_str()), ("Body rates", "250.0 Hz, z"));
        assert!((found.rate_hz - 2_000.0).abs() < 1e-6, "{}", found.rate_hz);
    }

    fn spectrum(rate_hz: f64, has_pauses: bool) -> Option<SpectrumJson> {
        let mut spectrum = Spectrum::default();
        for place in 0..(rate_hz * 12.0) as u32 {
            let second = f64::from(place) / rate_hz;
            let at_s = if has_pauses { second + 0.1 * (second * 5.0).floor() } else { second };
            spectrum.take(at_s, Some([0.0, 9.8 + 2.0 * (TAU * 80.0 * second).sin(), 1.0]));
        }
        spectrum.json("Acceleration", "m/s²/√Hz")
    }

    #[test]
    fn a_manoeuvre_is_not_the_strongest_line() {
        let mut spectrum = Spectrum::default();
        for place in 0..4_000 {
            let at_s = f64::from(place) / 400.0;
            let wave = |hz: f64, size: f64| size * (TAU * hz * at_s).sin();
            spectrum.take(at_s, Some([wave(1.0, 3.0), wave(80.0, 0.02), 0.0]));
        }
        let found = spectrum.json("Body rates", "rad/s/√Hz").expect("a spectrum");
        let [hz, axis] = found.strongest.split(" Hz, ").collect::<Vec<_>>()[..] else { panic!("{found:?}") };
        let hz: f64 = hz.parse().expect("a number");
        assert!((hz - 80.0).abs() <= found.step_hz && axis == "y", "{}", found.strongest);
    }

    #[test]
    fn a_sine_stands_at_its_frequency_with_its_power() {
        for rate_hz in [197.9, 400.0, 1_000.0] {
            let found = spectrum(rate_hz, false).expect("a spectrum");
            let [x, y, z] = &found.values;
            let peak = y.iter().enumerate().max_by(|(_, one), (_, other)| one.total_cmp(other));
            let (place, _) = peak.expect("a peak");
            assert!(((place + 1) as f64 * found.step_hz - 80.0).abs() <= found.step_hz, "{found:?}");
            let power: f64 = y.iter().map(|value| f64::from(*value).powi(2) * found.step_hz).sum();
            assert!((power - 2.0).abs() < 0.02, "half of the amplitude's square: {power}");
            assert!(x.iter().chain(z).all(|value| *value < 1e-6) && found.strongest.ends_with(", y"));
        }
        assert!(spectrum(150.0, false).is_none(), "too slow");
        assert!(spectrum(1_000.0, true).is_none(), "no segment is without a pause");
    }
}
