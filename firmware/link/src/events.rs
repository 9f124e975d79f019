//! PX4's events: detection of missed ones, and requests for them (MAVLink events interface).
//!
//! Each `EVENT` has a sequence number, and `CURRENT_EVENT_SEQUENCE` has the latest every 3 s. PX4 stores the last
//! ones and repeats those in `REQUEST_EVENT`. An event that the autopilot no longer has, or does not send after three
//! requests, is lost; the checks do without it.

use hums_core::clock::{Instant, Span};
use hums_core::observation::Source;
use hums_dialect::ids::{CURRENT_EVENT_SEQUENCE, EVENT, RESPONSE_EVENT_ERROR};

use crate::messages;
use crate::packet::{Fields, Packet};

/// More than PX4 stores: a wider gap is a restart of the autopilot, or too old.
const GAP_MAX: u16 = 20;
const ANSWER: Span = Span::from_secs(1);
const TRIES: u8 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Missing {
    first: u16,
    last: u16,
    tries: u8,
}

/// The events of one autopilot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Events {
    /// The next number.
    next: Option<u16>,
    missing: Option<Missing>,
    asked_at: Option<Instant>,
}

impl Events {
    /// No event yet.
    pub const fn new() -> Self {
        Self { next: None, missing: None, asked_at: None }
    }

    /// A frame of the autopilot that we ask.
    pub fn heard(&mut self, id: u32, payload: &[u8]) {
        let fields = Fields(payload);
        match id {
            EVENT => self.came(fields.u16(8)),
            CURRENT_EVENT_SEQUENCE => {
                let is_reset = fields.u8(2) & 1 != 0;
                let next = fields.u16(0).wrapping_add(1);
                if is_reset {
                    *self = Self { next: Some(next), ..Self::new() };
                } else {
                    self.expect(next);
                }
            }
            RESPONSE_EVENT_ERROR => self.refused(fields.u16(2)),
            _ => {}
        }
    }

    /// Every tick; `send` gets at most one message, and returns whether it was sent.
    pub fn tick(&mut self, now: Instant, of: Source, send: &mut impl FnMut(&Packet) -> bool) {
        if self.asked_at.is_some_and(|at| now.since(at) < ANSWER) {
            return;
        }
        let Some(missing) = &mut self.missing else { return };
        if missing.tries == TRIES {
            self.missing = None;
        } else if send(&messages::request_event(missing.first, missing.last, of.system, of.component)) {
            missing.tries += 1;
            self.asked_at = Some(now);
        }
    }

    fn came(&mut self, number: u16) {
        if self.next.is_some_and(|next| number.wrapping_sub(next) > u16::MAX / 2) {
            // An older one: requested, or sent twice.
            if let Some(missing) = &mut self.missing
                && number == missing.first
            {
                missing.first = number.wrapping_add(1);
                missing.tries = 0;
                if number == missing.last {
                    self.missing = None;
                }
            }
            return;
        }
        self.expect(number);
        self.next = Some(number.wrapping_add(1));
    }

    fn expect(&mut self, next: u16) {
        let Some(known) = self.next.replace(next) else { return };
        match next.wrapping_sub(known) {
            0 => {}
            1..=GAP_MAX => {
                let first = self.missing.map_or(known, |missing| missing.first);
                self.missing = Some(Missing { first, last: next.wrapping_sub(1), tries: 0 });
            }
            // Too many, or the autopilot began anew.
            _ => self.missing = None,
        }
    }

    fn refused(&mut self, oldest: u16) {
        let Some(missing) = &mut self.missing else { return };
        let is_later = |one: u16, than: u16| one.wrapping_sub(than).wrapping_sub(1) < u16::MAX / 2;
        if is_later(oldest, missing.last) {
            self.missing = None;
        } else if is_later(oldest, missing.first) {
            missing.first = oldest;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PX4: Source = Source { system: 1, component: 1 };

    fn asks(events: &mut Events, second: u64) -> Option<(u16, u16)> {
        let mut asked = None;
        events.tick(Instant::from_millis(1_000 * second), PX4, &mut |packet| {
            let fields = Fields(packet.payload());
            assert_eq!((packet.id(), fields.u8(4), fields.u8(5)), (412, 1, 1));
            asked = Some((fields.u16(0), fields.u16(2)));
            true
        });
        asked
    }

    fn hears(events: &mut Events, numbers: &[u16]) {
        for number in numbers {
            events.heard(EVENT, Packet::new(EVENT).u16(8, *number).payload());
        }
    }

    fn tells(events: &mut Events, current: u16, flags: u8) {
        let packet = Packet::new(CURRENT_EVENT_SEQUENCE).u16(0, current).u8(2, flags);
        events.heard(CURRENT_EVENT_SEQUENCE, packet.payload());
    }

    #[test]
    fn events_in_a_row_are_not_asked_for() {
        let mut events = Events::new();
        hears(&mut events, &[65_534, 65_535, 0, 1, 1]);
        tells(&mut events, 1, 0);
        assert_eq!(asks(&mut events, 0), None);
    }

    #[test]
    fn those_that_were_missed_are_asked_for_until_they_come() {
        let mut events = Events::new();
        hears(&mut events, &[7, 10]);
        assert_eq!(asks(&mut events, 0), Some((8, 9)));
        assert_eq!(asks(&mut events, 0), None, "an answer takes time");
        hears(&mut events, &[8]);
        assert_eq!(asks(&mut events, 1), Some((9, 9)));
        hears(&mut events, &[9, 11]);
        assert_eq!(asks(&mut events, 2), None);
        tells(&mut events, 13, 0);
        assert_eq!(asks(&mut events, 3), Some((12, 13)), "the last ones were missed");
    }

    #[test]
    fn what_the_autopilot_no_longer_has_is_given_up() {
        let mut events = Events::new();
        hears(&mut events, &[7, 12]);
        let gone = |oldest| Packet::new(RESPONSE_EVENT_ERROR).u16(2, oldest);
        events.heard(RESPONSE_EVENT_ERROR, gone(10).payload());
        let asked: Vec<_> = (0..5).map(|second| asks(&mut events, second)).collect();
        assert_eq!(asked, [Some((10, 11)), Some((10, 11)), Some((10, 11)), None, None]);
        hears(&mut events, &[14]);
        events.heard(RESPONSE_EVENT_ERROR, gone(14).payload());
        assert_eq!(asks(&mut events, 9), None);
    }

    #[test]
    fn another_start_of_the_autopilot_is_no_gap() {
        let mut events = Events::new();
        hears(&mut events, &[500]);
        tells(&mut events, 3, 1);
        hears(&mut events, &[4]);
        assert_eq!(asks(&mut events, 0), None);
        hears(&mut events, &[5, 900]);
        assert_eq!(asks(&mut events, 1), None, "more than it keeps");
    }
}
