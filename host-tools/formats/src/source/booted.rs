//! Raw MAVLink in its autopilot's time.

use hums_core::clock::Instant;

use super::boot::boot_ms;
use super::timeline::Timeline;
use super::tlog::times::Begins;

/// ms: a restart reports less. A time that falls after more belongs to another recording.
const STARTS_MS: u32 = 10_000;

/// Time since boot for frames without recorded times. Before the first report, the line's time.
#[derive(Debug, Default)]
pub struct BootTimes {
    /// The first system with an autopilot: only its times count.
    system: Option<u8>,
    timeline: Option<Timeline>,
    /// Extended beyond 32 bits of milliseconds (49.7 days).
    boot_ms: u64,
    /// The line's time at the first report.
    base: Instant,
}

impl BootTimes {
    /// A frame's time, and the power-on or recording that begins with it.
    pub fn at(&mut self, line: Instant, frame: &hums_link::Frame<'_>) -> (Instant, Option<Begins>) {
        let told = boot_ms(frame).filter(|_| self.system.is_none_or(|system| system == frame.system()));
        if let Some(boot_ms) = told {
            self.boot_ms = extend(self.boot_ms, boot_ms);
            let boot_us = self.boot_ms.saturating_mul(1_000);
            if self.timeline.is_none() {
                (self.system, self.base) = (Some(frame.system()), line);
            }
            let timeline = self.timeline.get_or_insert_with(|| Timeline::from_first(boot_us));
            let moment = timeline.at(boot_us);
            let begins = if boot_ms > STARTS_MS { Begins::Recording } else { Begins::Clock };
            return (self.after_base(moment.at), moment.restarted.then_some(begins));
        }
        (self.timeline.map_or(line, |timeline| self.after_base(timeline.now())), None)
    }

    /// Whether its system is the timed one.
    pub fn is_of(&self, frame: &hums_link::Frame<'_>) -> bool {
        self.system == Some(frame.system())
    }

    fn after_base(&self, at: Instant) -> Instant {
        Instant::from_micros(self.base.as_micros().saturating_add(at.as_micros()))
    }
}

/// The time near the last one; otherwise a later one of the same 49.7 days, or another boot's.
fn extend(last_ms: u64, boot_ms: u32) -> u64 {
    const NEAR_MS: u32 = 60_000;
    let step = boot_ms.wrapping_sub(last_ms as u32).cast_signed();
    let same = last_ms & !u64::from(u32::MAX) | u64::from(boot_ms);
    match last_ms.checked_add_signed(step.into()) {
        Some(near) if step.unsigned_abs() < NEAR_MS => near,
        _ if same >= last_ms => same,
        _ => boot_ms.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_since_boot_goes_on_when_its_32_bits_begin_again() {
        const WRAP: u64 = 1 << 32;
        for (name, last_ms, boot_ms, expected) in [
            ("first", 0, 5_000, 5_000),
            ("goes on", 5_000, 65_000, 65_000),
            ("out of order", 5_000, 4_000, 4_000),
            ("begins again", WRAP - 500, 500, WRAP + 500),
            ("from before that", WRAP + 500, u32::MAX, WRAP - 1),
            ("long after that", WRAP + 500, 3_600_000, WRAP + 3_600_000),
            ("another boot", 3_600_000, 900, 900),
            ("another boot, after that", WRAP + 3_600_000, 900, 900),
        ] {
            assert_eq!(extend(last_ms, boot_ms), expected, "{name}");
        }
    }
}
