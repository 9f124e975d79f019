//! Whose vehicle it is: of the systems on the autopilot's port, the one that streams most.
//!
//! An autopilot forwards what other systems say, so the first heartbeat on the port may be of another vehicle. The first
//! one heard is taken at once, so that nothing waits; for [`SETTLES`] another one takes its place if it says far more.
//! Then the choice stands until the vehicle has been silent for [`SILENT`]: the autopilot was changed, or its system id.

use crate::observation::Source;
use crate::time::{Instant, Span};

/// Autopilots that are compared; more than these are not counted.
const CANDIDATES_MAX: usize = 4;
/// How long after the first heartbeat another system may take its place.
pub const SETTLES: Span = Span::from_secs(10);
/// How long the vehicle must have been silent before another one is chosen.
pub const SILENT: Span = Span::from_secs(30);
/// What is counted is of this long.
const WINDOW: Span = Span::from_secs(10);
/// Observations in a window that make a stream: heartbeats alone, one a second, are fewer.
const STREAM_MIN: u16 = 20;
/// Another system has to say so many times more.
const FAR_MORE: u16 = 2;

/// An autopilot that sent a heartbeat.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    source: Source,
    /// Observations in this window, and in the one before.
    now: u16,
    before: u16,
    heard: Instant,
}

impl Candidate {
    /// What it says, in the busier of the last two windows.
    const fn says(&self) -> u16 {
        if self.now > self.before { self.now } else { self.before }
    }
}

/// The systems on the port, and which of them is the vehicle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Election {
    candidates: [Option<Candidate>; CANDIDATES_MAX],
    window: Instant,
    /// When the first heartbeat was heard, or the vehicle was chosen anew.
    since: Option<Instant>,
}

impl Election {
    pub(crate) const fn new() -> Self {
        Self { candidates: [None; CANDIDATES_MAX], window: Instant::ZERO, since: None }
    }

    /// Whether the choice stands for as long as the vehicle is heard.
    pub(crate) fn is_settled(&self, now: Instant) -> bool {
        self.since.is_some_and(|since| now.since(since) >= SETTLES)
    }

    /// How long the vehicle has been the vehicle.
    pub(crate) fn lasts(&self, now: Instant) -> Span {
        self.since.map_or(Span::ZERO, |since| now.since(since))
    }

    /// Takes note of an observation; who the vehicle is from now on. `heartbeat`: it is an autopilot's heartbeat.
    pub(crate) fn hear(
        &mut self,
        at: Instant,
        vehicle: Option<Source>,
        source: Source,
        heartbeat: bool,
    ) -> Option<Source> {
        self.count(at, vehicle, source, heartbeat);
        let Some(vehicle) = vehicle else {
            return heartbeat.then(|| self.choose(at, source));
        };
        let mine = self.of(vehicle);
        let silent = mine.is_none_or(|mine| at.since(mine.heard) >= SILENT);
        if source == vehicle || (self.is_settled(at) && !silent) {
            return Some(vehicle);
        }
        let says = self.of(source).map_or(0, Candidate::says);
        let limit = if silent { 0 } else { mine.map_or(0, Candidate::says).saturating_mul(FAR_MORE) };
        Some(if says >= STREAM_MIN.max(limit) { self.choose(at, source) } else { vehicle })
    }

    fn choose(&mut self, at: Instant, source: Source) -> Source {
        self.since = Some(at);
        source
    }

    fn of(&self, source: Source) -> Option<&Candidate> {
        self.candidates.iter().flatten().find(|candidate| candidate.source == source)
    }

    fn count(&mut self, at: Instant, vehicle: Option<Source>, source: Source, heartbeat: bool) {
        if at.since(self.window) >= WINDOW {
            self.window = at;
            for candidate in self.candidates.iter_mut().flatten() {
                (candidate.before, candidate.now) = (candidate.now, 0);
            }
        }
        let known = |slot: &Option<Candidate>| slot.is_some_and(|candidate| candidate.source == source);
        let place = self.candidates.iter().position(known).or_else(|| {
            // A newcomer takes a free place, or that of one who fell silent and is not the vehicle.
            let gone = |slot: &Option<Candidate>| {
                slot.is_none_or(|old| at.since(old.heard) >= SILENT && Some(old.source) != vehicle)
            };
            self.candidates.iter().position(gone).filter(|_| heartbeat)
        });
        let Some(slot) = place.and_then(|place| self.candidates.get_mut(place)) else { return };
        let fresh = Candidate { source, now: 0, before: 0, heard: at };
        let candidate = slot.get_or_insert(fresh);
        if candidate.source != source {
            *candidate = fresh;
        }
        candidate.now = candidate.now.saturating_add(1);
        candidate.heard = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: Source = Source { system: 1, component: 1 };
    const OTHER: Source = Source { system: 7, component: 1 };

    /// Each tenth of a second: who speaks in it, with a heartbeat every second. Who is the vehicle at the end.
    fn hear(
        election: &mut Election,
        mut vehicle: Option<Source>,
        ms: core::ops::Range<u64>,
        who: &[(Source, u64)],
    ) -> Option<Source> {
        for now_ms in ms.step_by(100) {
            for (source, every_ms) in who {
                if now_ms.is_multiple_of(*every_ms) {
                    let heartbeat = now_ms.is_multiple_of(1_000);
                    vehicle = election.hear(Instant::from_millis(now_ms), vehicle, *source, heartbeat);
                }
            }
        }
        vehicle
    }

    #[test]
    fn the_first_heartbeat_is_taken_at_once_and_one_that_streams_takes_its_place() {
        let mut election = Election::new();
        let vehicle = election.hear(Instant::ZERO, None, OTHER, true);
        assert_eq!(vehicle, Some(OTHER));
        // The other one's heartbeats are forwarded; ours streams.
        let vehicle = hear(&mut election, vehicle, 100..5_000, &[(OTHER, 1_000), (OURS, 100)]);
        assert_eq!(vehicle, Some(OURS));
        assert!(!election.is_settled(Instant::from_millis(5_000)));
    }

    #[test]
    fn nothing_but_a_heartbeat_makes_a_vehicle() {
        let mut election = Election::new();
        assert_eq!(election.hear(Instant::ZERO, None, OURS, false), None);
        assert_eq!(election.hear(Instant::ZERO, None, OURS, true), Some(OURS));
    }

    #[test]
    fn once_settled_the_choice_stands_whatever_others_say() {
        let mut election = Election::new();
        let vehicle = hear(&mut election, None, 0..15_000, &[(OURS, 500)]);
        let vehicle = hear(&mut election, vehicle, 15_000..120_000, &[(OURS, 1_000), (OTHER, 100)]);
        assert_eq!(vehicle, Some(OURS));
    }

    #[test]
    fn after_half_a_minute_of_silence_the_one_that_streams_is_the_vehicle() {
        let mut election = Election::new();
        let vehicle = hear(&mut election, None, 0..20_000, &[(OURS, 100)]);
        let vehicle = hear(&mut election, vehicle, 20_000..49_000, &[(OTHER, 100)]);
        assert_eq!(vehicle, Some(OURS));
        let vehicle = hear(&mut election, vehicle, 49_000..51_000, &[(OTHER, 100)]);
        assert_eq!(vehicle, Some(OTHER), "its system id was changed");
    }

    #[test]
    fn a_heartbeat_that_is_only_forwarded_never_takes_the_place_of_a_silent_vehicle() {
        let mut election = Election::new();
        let vehicle = hear(&mut election, None, 0..20_000, &[(OURS, 100), (OTHER, 1_000)]);
        assert_eq!(hear(&mut election, vehicle, 20_000..300_000, &[(OTHER, 1_000)]), Some(OURS));
    }

    #[test]
    fn more_systems_than_places_leave_room_for_the_vehicle() {
        let mut election = Election::new();
        let mut vehicle = None;
        for system in 10..60 {
            vehicle = election.hear(Instant::ZERO, vehicle, Source { system, component: 1 }, true);
        }
        let vehicle = hear(&mut election, vehicle, 0..90_000, &[(OURS, 100)]);
        assert_eq!(vehicle, Some(OURS));
    }
}
