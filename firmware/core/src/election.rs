//! Election of the vehicle: of the systems on the autopilot's port, the one that streams most.
//!
//! An autopilot forwards other systems' messages, so the first heartbeat on the port may be another vehicle's. The first system
//! is taken at once. For [`SETTLES`] another one takes its place if it streams far more. Then the choice stands until the
//! vehicle has been silent for [`SILENT`]: the autopilot was changed, or its system id.
//!
//! A vehicle without a stream gives way to a system with one at any time. Autopilots may be silent until they are
//! asked for streams. So while several send heartbeats and none streams by itself, each is asked for one `TURN`; the
//! choice stands once all had theirs. The one at the port then streams more than one that is received over a radio.

use crate::observation::{Autopilot, Source};
use crate::time::{BootMs, Millis};

/// Autopilots that are compared; others are not counted.
const CANDIDATES_MAX: usize = 4;
/// How long after the first heartbeat another system may take its place. Observations are counted in windows of this length.
pub const SETTLES: Millis = Millis::from_secs(10);
/// How long the vehicle must have been silent before another one is chosen.
pub const SILENT: Millis = Millis::from_secs(30);
/// Observations in a window that make a stream: heartbeats alone, one a second, are fewer.
const STREAM_MIN: u16 = 20;
/// Time in which one system is asked. Its streams are awaited for 5 s before it is asked message by message, or by
/// groups.
const TURN: Millis = Millis::from_secs(15);
/// No system is asked before. One that streams by then does so by itself.
const UNASKED: Millis = Millis::from_secs(5);
/// A system takes the vehicle's place if it has this many times its observations.
const FAR_MORE: u16 = 2;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    source: Source,
    autopilot: Autopilot,
    now: u16,
    before: u16,
    heard: BootMs,
}

impl Candidate {
    const fn says(&self) -> u16 {
        if self.now > self.before { self.now } else { self.before }
    }
}

state! {
    pub(crate) struct Election {
        candidates: [Option<Candidate>; CANDIDATES_MAX] = [None; CANDIDATES_MAX],
        window: BootMs,
        /// When the first heartbeat was heard, or the vehicle was chosen anew.
        since: Option<BootMs>,
        /// First heartbeat: turns are counted from here.
        first: BootMs,
        streams: bool,
        /// It did so before anybody was asked.
        by_itself: bool,
        /// The choice stands.
        settled: bool,
    }
}

impl Election {
    pub(crate) fn is_settled(&self, now: BootMs) -> bool {
        self.settled || (self.lasts(now) >= SETTLES && self.heard(now).count() == 1)
    }

    pub(crate) fn asks(&self, now: BootMs, vehicle: Source) -> Option<(Source, Autopilot)> {
        let count = self.heard(now).count();
        let asked = if self.settled || count < 2 || self.is_decided(now) {
            self.of(vehicle)
        } else {
            let turns = now.since(self.first).as_millis() / TURN.as_millis();
            self.heard(now).nth(turns as usize % count)
        };
        asked.map(|candidate| (candidate.source, candidate.autopilot))
    }

    fn is_decided(&self, now: BootMs) -> bool {
        let turns = self.heard(now).count() as u64;
        let over = now.since(self.first).as_millis() >= turns * TURN.as_millis();
        self.by_itself || (self.streams && (turns < 2 || over))
    }

    fn heard(&self, now: BootMs) -> impl Iterator<Item = &Candidate> {
        self.candidates.iter().flatten().filter(move |candidate| now.since(candidate.heard) < SILENT)
    }

    pub(crate) fn lasts(&self, now: BootMs) -> Millis {
        self.since.map_or(Millis::ZERO, |since| now.since(since))
    }

    /// `heartbeat`: the autopilot, if the observation is a heartbeat.
    pub(crate) fn hear(
        &mut self,
        at: BootMs,
        vehicle: Option<Source>,
        source: Source,
        heartbeat: Option<Autopilot>,
    ) -> Option<Source> {
        self.count(at, vehicle, source, heartbeat);
        let Some(vehicle) = vehicle else {
            heartbeat?;
            self.first = at;
            return Some(self.choose(at, source));
        };
        if source == vehicle && self.settled {
            return Some(vehicle);
        }
        let mine = self.of(vehicle);
        let silent = mine.is_none_or(|mine| at.since(mine.heard) >= SILENT);
        let mine = mine.map_or(0, Candidate::says);
        if source == vehicle {
            self.note_stream(at, mine);
            self.settled = self.lasts(at) >= SETTLES && self.is_decided(at);
        }
        if source == vehicle || (self.settled && !silent) {
            return Some(vehicle);
        }
        let says = self.of(source).map_or(0, Candidate::says);
        let limit = if silent || !self.streams { 0 } else { mine.saturating_mul(FAR_MORE) };
        Some(if says >= STREAM_MIN.max(limit) { self.choose(at, source) } else { vehicle })
    }

    fn choose(&mut self, at: BootMs, source: Source) -> Source {
        self.since = Some(at);
        (self.streams, self.by_itself, self.settled) = (false, false, false);
        self.note_stream(at, self.of(source).map_or(0, Candidate::says));
        source
    }

    fn note_stream(&mut self, at: BootMs, says: u16) {
        if !self.streams && says >= STREAM_MIN {
            self.streams = true;
            self.by_itself = at.since(self.first) < UNASKED;
        }
    }

    fn of(&self, source: Source) -> Option<&Candidate> {
        self.candidates.iter().flatten().find(|candidate| candidate.source == source)
    }

    fn count(&mut self, at: BootMs, vehicle: Option<Source>, source: Source, heartbeat: Option<Autopilot>) {
        if at.since(self.window) >= SETTLES {
            self.window = at;
            for candidate in self.candidates.iter_mut().flatten() {
                (candidate.before, candidate.now) = (candidate.now, 0);
            }
        }
        let known = |slot: &Option<Candidate>| slot.is_some_and(|candidate| candidate.source == source);
        let place = self.candidates.iter().position(known).or_else(|| {
            // A newcomer takes a free place, or the place of a silent system that is not the vehicle.
            let gone = |slot: &Option<Candidate>| {
                slot.is_none_or(|old| at.since(old.heard) >= SILENT && Some(old.source) != vehicle)
            };
            self.candidates.iter().position(gone).filter(|_| heartbeat.is_some())
        });
        let Some(slot) = place.and_then(|place| self.candidates.get_mut(place)) else { return };
        let autopilot = heartbeat.unwrap_or_default();
        let fresh = Candidate { source, autopilot, now: 0, before: 0, heard: at };
        let candidate = slot.get_or_insert(fresh);
        if candidate.source != source {
            *candidate = fresh;
        }
        candidate.autopilot = heartbeat.unwrap_or(candidate.autopilot);
        candidate.now = candidate.now.saturating_add(1);
        candidate.heard = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: Source = Source { system: 1, component: 1 };
    const OTHER: Source = Source { system: 7, component: 1 };

    fn hear(
        election: &mut Election,
        mut vehicle: Option<Source>,
        ms: core::ops::Range<u64>,
        who: &[(Source, u64)],
    ) -> Option<Source> {
        for now_ms in ms.step_by(100) {
            for (source, every_ms) in who {
                if now_ms.is_multiple_of(*every_ms) {
                    let heartbeat = now_ms.is_multiple_of(1_000).then_some(Autopilot::Px4);
                    vehicle = election.hear(BootMs::from_millis(now_ms), vehicle, *source, heartbeat);
                }
            }
        }
        vehicle
    }

    #[test]
    fn nothing_but_a_heartbeat_makes_a_vehicle() {
        let mut election = Election::default();
        assert_eq!(election.hear(BootMs::ZERO, None, OURS, None), None);
        assert_eq!(election.hear(BootMs::ZERO, None, OURS, Some(Autopilot::Px4)), Some(OURS));
    }

    /// Who is received until when, ms; the vehicle at the end, and whether the choice is settled.
    type Case = (&'static [(u64, &'static [(Source, u64)])], Source, bool);

    #[test]
    fn a_stream_is_the_vehicle_and_once_settled_until_half_a_minute_of_silence() {
        const FORWARDED: (u64, &[(Source, u64)]) = (12_000, &[(OTHER, 1_000), (OURS, 1_000)]);
        const LATE: (u64, &[(Source, u64)]) = (200_000, &[(OTHER, 1_000), (OURS, 1_000)]);
        let cases: [Case; 11] = [
            (&[(100, &[(OTHER, 1_000)])], OTHER, false),
            (&[(100, &[(OTHER, 1_000)]), (5_000, &[(OTHER, 1_000), (OURS, 100)])], OURS, false),
            (&[(15_000, &[(OURS, 500)]), (120_000, &[(OURS, 1_000), (OTHER, 100)])], OURS, true),
            (&[(20_000, &[(OURS, 100)]), (49_000, &[(OTHER, 100)])], OURS, true),
            // The vehicle's system id was changed.
            (&[(20_000, &[(OURS, 100)]), (51_000, &[(OTHER, 100)])], OTHER, false),
            (&[(20_000, &[(OURS, 100), (OTHER, 1_000)]), (300_000, &[(OTHER, 1_000)])], OURS, true),
            (&[FORWARDED], OTHER, false),
            (&[LATE], OTHER, false),
            (&[FORWARDED, (15_000, &[(OTHER, 1_000), (OURS, 100)])], OURS, false),
            (
                &[
                    FORWARDED,
                    (15_000, &[(OTHER, 1_000), (OURS, 100)]),
                    (75_000, &[(OURS, 100), (OTHER, 100)]),
                ],
                OURS,
                true,
            ),
            (
                &[LATE, (203_000, &[(OTHER, 1_000), (OURS, 100)]), (263_000, &[(OURS, 100), (OTHER, 100)])],
                OURS,
                true,
            ),
        ];
        for (pieces, expected, is_settled) in cases {
            let (mut election, mut vehicle, mut from_ms) = (Election::default(), None, 0);
            for (until_ms, who) in pieces {
                vehicle = hear(&mut election, vehicle, from_ms..*until_ms, who);
                from_ms = *until_ms;
            }
            let end = BootMs::from_millis(from_ms);
            assert_eq!((vehicle, election.is_settled(end)), (Some(expected), is_settled), "{pieces:?}");
        }
    }

    /// Two minutes. The other system's heartbeat comes first; each streams for good once it was asked for 6 s.
    fn asked_in_turns(ours_ms: u64, others_ms: u64) -> (Option<Source>, Option<Source>, bool) {
        let mut election = Election::default();
        let (mut vehicle, mut asked) = (None, [(OTHER, 0), (OURS, 0)]);
        for now_ms in (0..120_000).step_by(100) {
            let now = BootMs::from_millis(now_ms);
            if let Some((source, _)) = vehicle.and_then(|vehicle| election.asks(now, vehicle))
                && let Some((_, for_ms)) = asked.iter_mut().find(|(of, _)| *of == source)
            {
                *for_ms += 100;
            }
            let who = asked.map(|(of, for_ms)| {
                let streams_ms = if of == OURS { ours_ms } else { others_ms };
                (of, if for_ms > 6_000 { streams_ms } else { 1_000 })
            });
            vehicle = hear(&mut election, vehicle, now_ms..now_ms + 100, &who);
        }
        let end = BootMs::from_millis(120_000);
        let asks = vehicle.and_then(|vehicle| election.asks(end, vehicle));
        (vehicle, asks.map(|(source, _)| source), election.is_settled(end))
    }

    #[test]
    fn one_that_is_silent_until_it_is_asked_is_asked_though_another_was_heard_first() {
        assert_eq!(asked_in_turns(100, 1_000), (Some(OURS), Some(OURS), true));
        assert_eq!(asked_in_turns(100, 300), (Some(OURS), Some(OURS), true));
        let (_, _, settled) = asked_in_turns(1_000, 1_000);
        assert!(!settled, "nobody streams: they are asked on");
    }

    #[test]
    fn more_systems_than_places_leave_room_for_the_vehicle() {
        let mut election = Election::default();
        let mut vehicle = None;
        for system in 10..60 {
            let source = Source { system, component: 1 };
            vehicle = election.hear(BootMs::ZERO, vehicle, source, Some(Autopilot::Px4));
        }
        let vehicle = hear(&mut election, vehicle, 0..90_000, &[(OURS, 100)]);
        assert_eq!(vehicle, Some(OURS));
    }
}
