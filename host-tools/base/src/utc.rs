//! Times as people and other tools read them: UTC in ISO 8601, and seconds since the box's power-on; for people hours,
//! minutes and seconds.

use hums_core::clock::{Instant, Span};

/// Microseconds since 1970 as `2026-11-21T10:13:42.123456Z`, appended to `out`. Years up to 9999; a later time is
/// damage and reads as the last one.
pub fn push_iso8601(out: &mut Vec<u8>, utc_us: u64) {
    const LAST_US: u64 = 253_402_300_799_999_999;
    let utc_us = utc_us.min(LAST_US);
    let seconds = utc_us / 1_000_000;
    let (year, month, day) = civil(seconds / 86_400);
    let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    // Digits by hand: this stands in every line of every table, and `write!` takes four times as long.
    push_digits::<4>(out, year);
    for (separator, number) in [(b'-', month), (b'-', day), (b'T', hour), (b':', minute), (b':', second)] {
        out.push(separator);
        push_digits::<2>(out, number);
    }
    out.push(b'.');
    push_digits::<6>(out, utc_us % 1_000_000);
    out.push(b'Z');
}

/// ISO 8601, as a `String`.
pub fn iso8601(utc_us: u64) -> String {
    let mut out = Vec::with_capacity(27);
    push_iso8601(&mut out, utc_us);
    String::from_utf8_lossy(&out).into_owned()
}

/// A time to the second, for people: `2026-11-21 10:13:42`.
pub fn date_and_time(utc_us: u64) -> String {
    iso8601(utc_us).chars().take(19).map(|c| if c == 'T' { ' ' } else { c }).collect()
}

/// To the millisecond, for people, as clocks on a link are known: `2026-11-21T10:13:42.123Z`.
pub fn iso8601_ms(utc_us: u64) -> String {
    let text = iso8601(utc_us / 1_000 * 1_000);
    text.strip_suffix("000Z").map_or_else(|| text.clone(), |text| format!("{text}Z"))
}

/// A time in a recording for people, to the nearest tenth of a second: `4:20.8`, `1:04:20.8`.
pub fn moment(at: Instant) -> String {
    let tenths = at.as_micros().saturating_add(50_000) / 100_000;
    let (hours, minutes, seconds) = (tenths / 36_000, tenths / 600 % 60, tenths / 10 % 60);
    let hours = if hours > 0 { format!("{hours}:{minutes:02}") } else { minutes.to_string() };
    format!("{hours}:{seconds:02}.{}", tenths % 10)
}

/// A length of time for people, to the second: `4:21`, `1:04:21`.
pub fn clock(span: Span) -> String {
    let seconds = (span.as_micros() + 500_000) / 1_000_000;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, minutes, seconds) => format!("{minutes}:{seconds:02}"),
        (hours, minutes, seconds) => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

/// Microseconds as seconds with all six decimals.
pub fn push_seconds(out: &mut Vec<u8>, micros: u64) {
    out.extend_from_slice(itoa::Buffer::new().format(micros / 1_000_000).as_bytes());
    out.push(b'.');
    push_digits::<6>(out, micros % 1_000_000);
}

fn push_digits<const WIDTH: usize>(out: &mut Vec<u8>, mut number: u64) {
    let mut digits = [0; WIDTH];
    for digit in digits.iter_mut().rev() {
        *digit = b'0' + (number % 10) as u8;
        number /= 10;
    }
    out.extend_from_slice(&digits);
}

/// Days since 1970 as year, month, day: Howard Hinnant's `civil_from_days`, for days from 1970 on.
fn civil(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let era = days / 146_097;
    let day_of_era = days % 146_097;
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year_of_era + era * 400 + u64::from(month <= 2), month, day)
}

/// Microseconds of a text as [`moment`] writes it: `4:20.8`, `1:04:20`.
fn parse_moment(text: &str) -> Option<u64> {
    let (before, seconds) = text.rsplit_once(':')?;
    let (hours, minutes) = before.split_once(':').unwrap_or(("0", before));
    let whole =
        |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<u32>().ok())?;
    let is_below_60 = |micros: &u64| *micros < 60_000_000;
    let seconds = parse_seconds(seconds).filter(is_below_60)?;
    let minutes = u64::from(whole(hours)?) * 60 + u64::from(whole(minutes)?);
    Some(minutes * 60_000_000 + seconds)
}

/// Seconds as text, in microseconds.
pub fn parse_seconds(text: &str) -> Option<u64> {
    text.parse().ok().and_then(seconds_to_micros)
}

/// Seconds in microseconds, if they are a valid time.
pub fn seconds_to_micros(seconds: f64) -> Option<u64> {
    (seconds.is_finite() && (0.0..1e12).contains(&seconds)).then_some((seconds * 1e6).round() as u64)
}

/// A point in time on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TimePoint {
    /// Microseconds of the log's own time, as its tables have it.
    Seconds(u64),
    /// Microseconds since 1970.
    Utc(u64),
}

impl std::str::FromStr for TimePoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(micros) = parse_seconds(text).or_else(|| parse_moment(text)) {
            return Ok(Self::Seconds(micros));
        }
        let instant: Result<jiff::Timestamp, _> = text.parse();
        match instant.map(|instant| u64::try_from(instant.as_microsecond())) {
            Ok(Ok(micros)) => Ok(Self::Utc(micros)),
            _ => Err(format!(
                "`{text}` is no time: seconds as 260.8, minutes as 4:20.8, or UTC as 2026-11-21T10:13:42Z"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_of_four_centuries_agrees_with_jiff() {
        for day in 0..146_097u64 {
            let micros = day * 86_400_000_000 + 45_296_123_456;
            let theirs = jiff::Timestamp::from_microsecond(micros as i64).expect("in range");
            assert_eq!(iso8601(micros), format!("{theirs:.6}"));
        }
    }

    #[test]
    fn times_are_read_at_a_glance() {
        assert_eq!(moment(Instant::from_millis(260_849)), "4:20.8");
        assert_eq!(moment(Instant::from_millis(260_750)), "4:20.8", "as docs/cli.md has it");
        assert_eq!(moment(Instant::from_millis(3_599_950)), "1:00:00.0");
        assert_eq!(iso8601_ms(1_795_256_022_926_899), "2026-11-21T10:13:42.926Z");
        assert_eq!(moment(Instant::from_millis(3_860_000)), "1:04:20.0");
        assert_eq!(clock(Span::from_millis(59_600)), "1:00");
        assert_eq!(clock(Span::from_secs(3_861)), "1:04:21");
        assert_eq!(date_and_time(1_795_256_022_999_999), "2026-11-21 10:13:42");
    }

    #[test]
    fn seconds_keep_every_microsecond() {
        let mut out = Vec::new();
        push_seconds(&mut out, 12_000_034);
        assert_eq!(out, b"12.000034");
        assert_eq!(iso8601(u64::MAX), "9999-12-31T23:59:59.999999Z");
    }

    #[test]
    fn both_forms_of_a_time() {
        assert_eq!("12.5".parse(), Ok(TimePoint::Seconds(12_500_000)));
        assert_eq!("4:20.8".parse(), Ok(TimePoint::Seconds(260_800_000)));
        assert_eq!("1:04:20".parse(), Ok(TimePoint::Seconds(3_860_000_000)));
        assert_eq!("1970-01-01T00:00:01.5Z".parse(), Ok(TimePoint::Utc(1_500_000)));
        assert_eq!("1970-01-01T02:00:00+02:00".parse(), Ok(TimePoint::Utc(0)));
        for text in ["", "yesterday", "-5", "1:60", "1:-5", "+1:00", "1:2:3:4", ":5", "1960-01-01T00:00:00Z"]
        {
            assert!(text.parse::<TimePoint>().is_err(), "{text}");
        }
    }
}
