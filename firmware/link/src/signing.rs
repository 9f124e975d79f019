//! MAVLink 2 signing (<https://mavlink.io/en/guide/message_signing.html>): 13 bytes after the checksum have the link
//! id and the time of the frame, and prove that the sender has the key.
//!
//! # Time
//! A stamp counts 10 µs since 2015 and grows with every frame of a stream, which is a system, a component and a link
//! id. [`Clock`] derives it from UTC, if known. It goes back only when a key is set. Stamps do not go back over a
//! power-off either: a bound above all used stamps is stored ahead of time ([`Times::used`]). The stamps of the next
//! power-on begin there and count up one by one until time has caught up.
//!
//! A date from a GPS receiver may be wrong (a week number that rolled over, a spoofer). A time more than [`JUMP`]
//! ahead of ours counts only after [`JUMP_LASTS`] ([`Clock::hear_utc`]): a wrong clock would refuse every new stream
//! for years. A valid signature counts immediately: a holder of the key also has the time.
//!
//! # Replay
//! A frame whose stamp is not above its stream's last one is refused. The first stamp of a stream since power-on must
//! be above [`Times::accepted`], the stamp of the latest frame that changed anything. It must also be at most a
//! minute behind our own time. [`STREAMS_MAX`] streams are remembered; one more replaces the oldest. New streams must
//! then be above that one's last stamp, so a forgotten frame cannot be replayed.
//!
//! # Costs
//! SHA-256 over the key and the frame: at most six blocks, 0.2 ms on a Cortex-M4 at 168 MHz. The key is nowhere but
//! here, in the store, and in the `SETUP_SIGNING` that brought it, which is not recorded.

use core::fmt;

use hums_core::clock::{Instant, Span};
pub use hums_dialect::wire::SIGNATURE_BYTES;
use sha2::{Digest as _, Sha256};

use crate::frame::Frame;

/// Bytes of a key.
pub const KEY_BYTES: usize = 32;
/// Senders whose last stamp is remembered.
pub const STREAMS_MAX: usize = 8;
/// UTC of 2015-01-01, in microseconds since 1970.
const EPOCH_MICROS: u64 = 1_420_070_400_000_000;
/// A minute of stamps: how far a stream that is new may be behind.
pub const MINUTE: u64 = 6_000_000;
/// A date that is further ahead of our time than this has to last: a day of stamps.
pub const JUMP: u64 = 24 * 60 * MINUTE;
/// Duration for which it has to last.
pub const JUMP_LASTS: Span = Span::from_secs(60);
/// Dates of one clock agree to this: a second of stamps.
const JUMP_AGREES: u64 = 100_000;
/// Our stamps are stored ahead by this at first, by ...
const AHEAD_MIN: u64 = 2 * MINUTE;
/// ... this part of the time since power-on later, ...
const AHEAD_PART: u64 = 30;
/// ... and by this at most. After a power-off our stamps begin this far ahead of UTC, and receivers follow.
const AHEAD_MAX: u64 = 10 * MINUTE;
/// Stamps have 48 bits: until the year 2104.
const STAMP_MAX: u64 = (1 << 48) - 1;
const HASH: usize = 6;

/// The common secret of all partners. Never shown.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key(pub [u8; KEY_BYTES]);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(secret)")
    }
}

impl Key {
    /// The key of a passphrase, as Mission Planner, QGroundControl and `MAVProxy` make it: its SHA-256.
    pub fn of_passphrase(text: &str) -> Self {
        Self(Sha256::digest(text.as_bytes()).into())
    }

    /// All zeros mean that there is none.
    pub fn is_none(&self) -> bool {
        self.0 == [0; KEY_BYTES]
    }

    fn hash(&self, frame: &[u8], link_and_stamp: &[u8]) -> [u8; HASH] {
        let hash =
            Sha256::new().chain_update(self.0).chain_update(frame).chain_update(link_and_stamp).finalize();
        core::array::from_fn(|at| hash.get(at).copied().unwrap_or(0))
    }
}

/// The stamp of a moment in UTC, microseconds since 1970.
pub const fn stamp(utc_micros: u64) -> u64 {
    utc_micros.saturating_sub(EPOCH_MICROS) / 10
}

/// Our own time as stamps count it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    begin: u64,
    /// A date far ahead that has to last: its stamp of power-on, and the time of its first arrival.
    jump: Option<(u64, Instant)>,
}

impl Clock {
    /// Now.
    pub const fn now(&self, now: Instant) -> u64 {
        let stamp = self.begin.saturating_add(now.as_micros() / 10);
        if stamp < STAMP_MAX { stamp } else { STAMP_MAX }
    }

    /// `false`: too far ahead to be believed yet.
    pub fn hear_utc(&mut self, at: Instant, stamp: u64) -> bool {
        let begin = stamp.min(STAMP_MAX).saturating_sub(at.as_micros() / 10);
        if begin > self.begin.saturating_add(JUMP) {
            match self.jump {
                Some((first, since)) if begin.abs_diff(first) <= JUMP_AGREES => {
                    if at.since(since) < JUMP_LASTS {
                        return false;
                    }
                }
                _ => {
                    self.jump = Some((begin, at));
                    return false;
                }
            }
        }
        self.jump = None;
        self.begin = self.begin.max(begin);
        true
    }

    /// Now is at least this stamp.
    pub const fn is_at_least(&mut self, now: Instant, stamp: u64) {
        let begin = stamp.saturating_sub(now.as_micros() / 10);
        if begin > self.begin {
            self.begin = begin;
        }
    }
}

/// The signer of one way out.
#[derive(Clone, Copy, Debug)]
pub struct Seal {
    key: Key,
    /// Tells this way from our others.
    link: u8,
    /// Our time.
    pub clock: Clock,
    last: u64,
}

impl Seal {
    /// With this key on this link, and stamps above `last`.
    pub const fn new(key: Key, link: u8, clock: Clock, last: u64) -> Self {
        Self { key, link, clock, last }
    }

    /// The last stamp.
    pub const fn last(&self) -> u64 {
        self.last
    }

    /// Made of this key.
    pub fn is_of(&self, key: &Key) -> bool {
        self.key == *key
    }

    /// `frame` ends with its checksum and has the signed flag.
    pub fn sign(&mut self, now: Instant, frame: &[u8]) -> [u8; SIGNATURE_BYTES] {
        self.last = (self.last + 1).max(self.clock.now(now)).min(STAMP_MAX);
        let mut tail = [0; SIGNATURE_BYTES];
        tail[0] = self.link;
        tail[1..7].copy_from_slice(&self.last.to_le_bytes()[..6]);
        let hash = self.key.hash(frame, &tail[..7]);
        tail[7..].copy_from_slice(&hash);
        tail
    }
}

/// Result of a signature test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// There is none.
    Unsigned,
    /// Signed with our key, and new.
    Good,
    /// Made with another key.
    Wrong,
    /// Made with our key, and too old.
    Replayed,
}

#[derive(Clone, Copy, Debug, Default)]
struct Stream {
    last: u64,
    who: [u8; 3],
}

/// State to store beside the key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// The latest stamp of a frame that changed anything.
    pub accepted: u64,
    /// The highest of our stamps.
    pub used: u64,
    /// Our time when this was stored.
    pub time: u64,
}

impl Times {
    /// Looks whether `used` is still ahead enough of our time and of the last stamp, and sets it so; `true` when it has
    /// to be stored: at first every two minutes, later every thirtieth of the time since power-on, every ten minutes at
    /// most. In the first six hours that is some 90 times.
    pub fn keep_ahead(&mut self, since_power_on: Instant, time: u64, last: u64) -> bool {
        // Behind the last stamp there is one for each frame until time has caught up.
        let (from, ahead) = if time > last {
            (time, (since_power_on.as_micros() / 10 / AHEAD_PART).clamp(AHEAD_MIN, AHEAD_MAX))
        } else {
            (last, MINUTE / 6)
        };
        // Slightly early, because a save takes some time.
        if from + MINUTE / 12 <= self.used {
            return false;
        }
        let next = from + ahead;
        (self.used, self.time) = (next, time);
        true
    }
}

/// The key, and the history of its use.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signing {
    key: Option<Key>,
    /// Our time.
    pub clock: Clock,
    streams: [Stream; STREAMS_MAX],
    /// A stream that is not known has to be above.
    floor: u64,
}

impl Signing {
    /// No key.
    pub const fn new() -> Self {
        Self {
            key: None,
            clock: Clock { begin: 0, jump: None },
            streams: [Stream { last: 0, who: [0; 3] }; STREAMS_MAX],
            floor: 0,
        }
    }

    /// The key, if there is one.
    pub const fn key(&self) -> Option<&Key> {
        self.key.as_ref()
    }

    /// At power-on: the stored state.
    pub fn restore(&mut self, key: Option<Key>, times: Times) {
        self.key = key.filter(|key| !key.is_none());
        self.floor = times.accepted;
        self.clock.is_at_least(Instant::ZERO, times.time.min(STAMP_MAX));
    }

    /// Sets a key, or none. `stamp` is the time by the sender of the key. It becomes the present time, also with the
    /// old key: so a sender corrects a wrong clock. Frames more than a minute older are refused. 0 means no time:
    /// setting the same key then changes nothing.
    pub fn set(&mut self, now: Instant, key: Key, stamp: u64) {
        if stamp == 0 && self.key == Some(key) {
            return;
        }
        let stamp = stamp.min(STAMP_MAX);
        *self = Self { key: Some(key).filter(|key| !key.is_none()), ..Self::new() };
        self.floor = stamp.saturating_sub(MINUTE);
        self.clock.is_at_least(now, stamp);
    }

    /// Remembers a good frame's stamp. Without a key every frame counts as unsigned.
    pub fn judge(&mut self, now: Instant, frame: &Frame<'_>) -> Verdict {
        let Some((key, tail)) = self.key.zip(frame.signature()) else { return Verdict::Unsigned };
        let (signed, [link, stamp @ .., _, _, _, _, _, _]) = tail;
        let hash = key.hash(signed, &tail.1[..7]);
        // All six bytes are compared, in constant time.
        let differs = hash.iter().zip(&tail.1[7..]).fold(0, |sum, (ours, theirs)| sum | (ours ^ theirs));
        if differs != 0 {
            return Verdict::Wrong;
        }
        let [s0, s1, s2, s3, s4, s5] = *stamp;
        let stamp = u64::from_le_bytes([s0, s1, s2, s3, s4, s5, 0, 0]);
        let who = [*link, frame.component(), frame.system()];
        let known = self.streams.iter().position(|stream| stream.who == who && stream.last > 0);
        let fresh = match known {
            Some(at) => stamp > self.streams[at].last,
            None => stamp > self.floor && stamp.saturating_add(MINUTE) >= self.clock.now(now),
        };
        if !fresh {
            return Verdict::Replayed;
        }
        let oldest = || (0..STREAMS_MAX).min_by_key(|at| self.streams[*at].last).unwrap_or(0);
        let place = known.unwrap_or_else(oldest);
        if known.is_none() {
            self.floor = self.floor.max(self.streams[place].last);
        }
        self.streams[place] = Stream { last: stamp, who };
        self.clock.is_at_least(now, stamp);
        Verdict::Good
    }

    /// The stamp of the latest frame that was good.
    pub fn latest(&self) -> u64 {
        self.streams.iter().map(|stream| stream.last).fold(self.floor, u64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::{Encoder, FRAME_BYTES_MAX};
    use crate::messages;

    const KEY: Key = Key([7; KEY_BYTES]);
    const NOW: Instant = Instant::from_millis(1_000);

    fn signed(component: u8, key: Key, link: u8, stamp: u64) -> Vec<u8> {
        let mut clock = Clock::default();
        clock.is_at_least(NOW, stamp);
        let mut buffer = [0; FRAME_BYTES_MAX];
        let mut seal = Seal::new(key, link, clock, 0);
        let mut encoder = Encoder::of(255, component);
        encoder.frame_signed(&mut buffer, &messages::heartbeat(4), NOW, &mut seal).to_vec()
    }

    fn judge(signing: &mut Signing, bytes: &[u8]) -> Verdict {
        signing.judge(NOW, &Frame::parse(bytes).expect("a frame"))
    }

    fn with_key() -> Signing {
        let mut signing = Signing::new();
        signing.set(NOW, KEY, 0);
        signing
    }

    #[test]
    fn the_signature_is_as_the_guide_says() {
        // As the guide has it: of key, frame to its checksum, link id, stamp. pymavlink checks it end to end.
        let bytes = signed(190, KEY, 3, 123_456_789);
        let tail = &bytes[bytes.len() - SIGNATURE_BYTES..];
        assert_eq!(tail[..7], [3, 0x15, 0xcd, 0x5b, 0x07, 0, 0]);
        let mut by_hand = Sha256::new();
        by_hand.update([7; 32]);
        by_hand.update(&bytes[..bytes.len() - 6]);
        assert_eq!(tail[7..], by_hand.finalize()[..6]);
    }

    #[test]
    fn only_the_key_opens_and_only_once() {
        let mut signing = with_key();
        let frame = signed(190, KEY, 0, 1_000_000);
        assert_eq!(judge(&mut signing, &frame), Verdict::Good);
        assert_eq!(judge(&mut signing, &frame), Verdict::Replayed, "the same again");
        assert_eq!(judge(&mut signing, &signed(190, KEY, 0, 999_999)), Verdict::Replayed, "an older one");
        assert_eq!(judge(&mut signing, &signed(190, KEY, 0, 1_000_001)), Verdict::Good);
        assert_eq!(judge(&mut signing, &signed(190, Key([8; 32]), 0, 2_000_000)), Verdict::Wrong);
        let mut damaged = signed(190, KEY, 0, 3_000_000);
        *damaged.last_mut().expect("a byte") ^= 1;
        assert_eq!(judge(&mut signing, &damaged), Verdict::Wrong);
    }

    #[test]
    fn without_a_key_every_frame_is_unsigned() {
        assert_eq!(judge(&mut Signing::new(), &signed(190, KEY, 0, 5)), Verdict::Unsigned);
        let mut buffer = [0; FRAME_BYTES_MAX];
        let plain = Encoder::new().frame(&mut buffer, &messages::heartbeat(4)).to_vec();
        assert_eq!(judge(&mut with_key(), &plain), Verdict::Unsigned);
        let mut signing = with_key();
        signing.set(NOW, Key([0; 32]), 0);
        assert_eq!(signing.key(), None, "a key of zeros takes it away");
    }

    #[test]
    fn a_stream_that_is_new_may_be_a_minute_behind_and_no_more() {
        let mut signing = with_key();
        signing.clock.is_at_least(NOW, 10 * MINUTE);
        assert_eq!(judge(&mut signing, &signed(190, KEY, 0, 9 * MINUTE)), Verdict::Good);
        assert_eq!(judge(&mut signing, &signed(191, KEY, 0, 9 * MINUTE - 1)), Verdict::Replayed);
    }

    #[test]
    fn what_changed_anything_is_refused_after_power_off_and_time_goes_on() {
        let mut signing = with_key();
        let frame = signed(190, KEY, 0, 50 * MINUTE);
        assert_eq!(judge(&mut signing, &frame), Verdict::Good);
        let mut times = Times { accepted: signing.latest(), ..Times::default() };
        assert!(
            times.keep_ahead(NOW, 50 * MINUTE, 0) && !times.keep_ahead(NOW, 50 * MINUTE + 9, 50 * MINUTE)
        );
        assert_eq!(times.used, 52 * MINUTE);
        let mut later = Signing::new();
        later.restore(signing.key().copied(), times);
        assert_eq!(judge(&mut later, &frame), Verdict::Replayed);
        assert!(later.clock.now(Instant::ZERO) >= 50 * MINUTE);
        assert_eq!(judge(&mut later, &signed(190, KEY, 0, 50 * MINUTE + 1)), Verdict::Good);
    }

    #[test]
    fn more_senders_than_there_are_places_forget_nothing_that_could_be_played_again() {
        let mut signing = with_key();
        let frames: Vec<_> = (0..40).map(|at| signed(at, KEY, 0, 1_000_000 + u64::from(at))).collect();
        for frame in &frames {
            assert_eq!(judge(&mut signing, frame), Verdict::Good);
        }
        for frame in &frames {
            assert_eq!(judge(&mut signing, frame), Verdict::Replayed);
        }
    }

    #[test]
    fn our_stamps_grow_whatever_the_clock_says() {
        let mut seal = Seal::new(KEY, 0, Clock::default(), 7);
        let mut last = 7;
        for _ in 0..5 {
            let tail = seal.sign(Instant::ZERO, &[1, 2, 3]);
            let stamp = u64::from_le_bytes([tail[1], tail[2], tail[3], tail[4], tail[5], tail[6], 0, 0]);
            assert!(stamp > last);
            last = stamp;
        }
        assert_eq!(stamp(EPOCH_MICROS + 20), 2);
    }

    #[test]
    fn power_that_comes_and_goes_does_not_carry_stamps_away() {
        let mut times = Times::default();
        let time = 50 * MINUTE;
        assert!(times.keep_ahead(NOW, time, 0));
        for _ in 0..5 {
            let last = times.used;
            assert!(times.keep_ahead(NOW, time, last), "each begins above the one before");
            assert!(times.used > last && times.used <= last + MINUTE / 6);
        }
    }

    #[test]
    fn in_six_hours_times_are_stored_a_hundred_times_at_most_and_always_in_time() {
        let (mut times, mut stored) = (Times::default(), 0);
        for second in 0..6 * 3_600_u64 {
            let now = Instant::from_millis(second * 1_000);
            let time = 50 * MINUTE + second * 100_000;
            stored += u32::from(times.keep_ahead(now, time, time - 1));
            assert!(times.used > time, "a stamp is above what is stored after {second} s");
            assert!(times.used <= time + AHEAD_MAX);
        }
        assert!((60..=100).contains(&stored), "{stored}");
    }

    #[test]
    fn one_wrong_date_locks_nobody_out() {
        let years = 12 * 365 * JUMP;
        let mut signing = with_key();
        signing.clock.is_at_least(NOW, 50 * MINUTE);
        let at = |second: u64| NOW + Span::from_secs(second);
        assert!(!signing.clock.hear_utc(at(1), 50 * MINUTE + years), "once");
        assert!(signing.clock.hear_utc(at(2), 50 * MINUTE + 200_000), "and the right one again");
        assert!(!signing.clock.hear_utc(at(70), 50 * MINUTE + years), "and the wrong one, later");
        assert_eq!(judge(&mut signing, &signed(190, KEY, 0, 50 * MINUTE)), Verdict::Good);
        // A board that lay on a shelf for a year: the date lasts.
        assert!(!signing.clock.hear_utc(at(100), years));
        assert!(!signing.clock.hear_utc(at(159), years + 59 * 100_000));
        assert!(signing.clock.hear_utc(at(160), years + 60 * 100_000));
        assert_eq!(signing.clock.now(at(160)), years + 60 * 100_000);
    }

    #[test]
    fn the_same_key_brought_again_sets_the_time_back() {
        let mut signing = with_key();
        let ahead = 12 * 365 * JUMP;
        signing.clock.is_at_least(NOW, ahead);
        let frame = signed(190, KEY, 0, 50 * MINUTE);
        assert_eq!(judge(&mut signing, &frame), Verdict::Replayed, "years behind");
        signing.set(NOW, KEY, 50 * MINUTE);
        assert_eq!(judge(&mut signing, &frame), Verdict::Good);
        assert_eq!(
            judge(&mut signing, &signed(191, KEY, 0, 49 * MINUTE)),
            Verdict::Replayed,
            "a minute before it"
        );
    }

    #[test]
    fn a_key_is_not_shown() {
        assert_eq!(format!("{:?}", with_key().key()), "Some(Key(secret))");
    }
}
