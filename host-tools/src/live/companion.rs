//! Reports of a HUMS on board ([`hums_link::summary`]). It is the authority on events on board: it receives
//! every frame.

use hums_core::clock::{Instant, Span};
use hums_core::health::{Level, Subsystem};
use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use hums_link::{Check, Frame};
use serde::Serialize;

use crate::mavlink::ids::{HEARTBEAT, NAMED_VALUE_FLOAT, NAMED_VALUE_INT};

/// Five heartbeats missed.
const GONE: Span = Span::from_secs(5);
/// Levels come every two seconds, over the slowest radio every half minute.
const LEVELS_AGE_MAX: Span = Span::from_secs(60);

/// State of the HUMS on board.
#[derive(Clone, Debug, Default)]
pub struct Companion {
    heard: Option<Instant>,
    /// Name by a value that only HUMS sends.
    named: bool,
    levels: Option<(Instant, [Level; Subsystem::ALL.len()])>,
    overall: Option<Level>,
    flight_s: Option<f32>,
    flights: Option<f32>,
}

/// As the page takes it.
#[derive(Debug, Serialize)]
pub struct CompanionJson {
    heard_ms: u64,
    gone: bool,
    recorder: Option<&'static str>,
    flight_s: Option<f32>,
    flights: Option<f32>,
}

impl Companion {
    /// Takes a frame of the vehicle's system.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>) {
        if frame.component() != COMPONENT || frame.check() != Check::Verified {
            return;
        }
        let fields = Fields(frame.payload());
        match frame.id() {
            HEARTBEAT => self.heard = Some(at),
            NAMED_VALUE_FLOAT => self.float(at, fields.text(8, 10).unwrap_or_default(), fields.f32(4)),
            NAMED_VALUE_INT if fields.text(8, 10) == Some("HUMS_STATE") => {
                self.named = true;
                self.heard = Some(at);
                let packed = fields.u32(4);
                let level = |index: usize| Level::from_number((packed >> (3 * index) & 7) as u8);
                let levels = std::array::from_fn(|index| level(index).unwrap_or(Level::Stale));
                self.levels = Some((at, levels));
            }
            _ => {}
        }
    }

    fn float(&mut self, at: Instant, name: &str, value: f32) {
        let value = Some(value).filter(|value| value.is_finite());
        match name {
            "HUMS_LEVEL" => {
                self.named = true;
                self.overall = value.and_then(|value| Level::from_number(value as u8));
            }
            "FLT_TIME_S" => self.flight_s = value,
            "FLIGHTS" => self.flights = value,
            _ => return,
        }
        self.heard = Some(at);
    }

    /// Whether there is one and it is being received.
    pub fn present(&self, now: Instant) -> bool {
        self.named && self.heard.is_some_and(|at| now.since(at) <= GONE)
    }

    /// Whether there ever was one on this link.
    pub fn known(&self) -> bool {
        self.named
    }

    /// Level while received.
    pub fn overall(&self, now: Instant) -> Option<Level> {
        self.overall.filter(|_| self.present(now))
    }

    /// Level, unless old.
    pub fn level(&self, now: Instant, subsystem: Subsystem) -> Option<Level> {
        let (at, levels) = self.levels.filter(|(at, _)| now.since(*at) <= LEVELS_AGE_MAX)?;
        // The levels of a silent one are out of date.
        if !self.present(now) || now.since(at) > LEVELS_AGE_MAX {
            return None;
        }
        levels.get(subsystem as usize).copied()
    }

    /// The companion for the page; `None` without one.
    pub fn json(&self, now: Instant) -> Option<CompanionJson> {
        let heard = self.heard.filter(|_| self.named)?;
        Some(CompanionJson {
            heard_ms: now.since(heard).as_millis(),
            gone: !self.present(now),
            recorder: self.level(now, Subsystem::Recorder).map(Level::name),
            flight_s: self.flight_s,
            flights: self.flights,
        })
    }
}

#[cfg(test)]
mod tests {
    use hums_core::Monitor;
    use hums_core::parameters::Params;
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::{messages, packet, summary};

    use super::*;

    fn hear(companion: &mut Companion, at: Instant, packet: &packet::Packet) {
        let mut buffer = [0; FRAME_BYTES_MAX];
        let mut encoder = Encoder::new();
        companion.frame(at, &Frame::parse(encoder.frame(&mut buffer, packet)).expect("a frame"));
    }

    #[test]
    fn the_state_that_the_box_packs_is_unpacked_here() {
        let (mut companion, at) = (Companion::default(), Instant::from_millis(1));
        let monitor = Monitor::new(Params::defaults());
        hear(&mut companion, at, &messages::heartbeat(4));
        assert!(!companion.present(at), "any companion has heartbeats");
        hear(&mut companion, at, &messages::named_int(at, "HUMS_STATE", summary::state(&monitor)));
        for subsystem in Subsystem::ALL {
            assert_eq!(companion.level(at, subsystem), Some(monitor.health().subsystem(subsystem)));
        }
        hear(&mut companion, at, &messages::named_int(at, "HUMS_STATE", 3 << 24 | 1));
        assert_eq!(companion.level(at, Subsystem::Power), Some(Level::Advisory));
        assert_eq!(companion.level(at, Subsystem::Recorder), Some(Level::Critical));
    }

    #[test]
    fn one_that_falls_silent_is_no_authority_any_longer() {
        let (mut companion, at) = (Companion::default(), Instant::from_millis(1));
        hear(&mut companion, at, &messages::named_float(at, "HUMS_LEVEL", 2.0));
        hear(&mut companion, at, &messages::named_int(at, "HUMS_STATE", 0));
        assert!(companion.present(Instant::from_millis(5_000)));
        assert_eq!(companion.level(Instant::from_millis(5_002), Subsystem::Power), None);
        assert!(companion.json(Instant::from_millis(9_000)).expect("there was one").gone);
    }
}
