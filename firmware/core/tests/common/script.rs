//! Flights in words: the actions of a vehicle, and their times.
//!
//! `"* px4 plane mode=mission; 0-2 landed=ground; 4-10 h=20..80 c=10; 30 off; @32.3 ack=20,0"`
//!
//! A script has pieces, divided by `; `. A piece begins with its time in seconds: `4-10` from 4 s until 10 s, `30` from 30 s on,
//! `@32.3` at that moment, `*` always, also before the script begins; `4-10%2:0-0.1` is the first 0.1 s of every 2 s.
//! A word is a flag or has a value: a number, one that changes steadily during its piece (`20..80`), a list (`2,0.25,5x3`) or a name.
//! A later word counts.
#![allow(clippy::panic, reason = "that is how a test fails")]

use core::ops::Range;

use super::Quad;
use hums_core::observation::{Autopilot, LandedState, VehicleKind, VtolState};
use hums_core::units::{Amperes, Fraction, MetresPerSecond, Volts};

pub struct Script(Vec<Piece>);

struct Piece {
    from_ms: i64,
    until_ms: i64,
    /// The period, and the part of it that counts.
    every_ms: (i64, Range<i64>),
    words: Vec<Word>,
}

struct Word {
    name: String,
    numbers: Vec<f32>,
    to: Option<f32>,
    text: String,
}

/// A word at its moment.
pub struct Said<'a> {
    word: &'a Word,
    /// The part of its piece that is over.
    part: f32,
    /// Since its piece began.
    pub since_ms: u64,
}

fn millis(seconds: &str) -> i64 {
    (seconds.parse::<f64>().unwrap_or_else(|_| panic!("{seconds}: no time")) * 1_000.0).round() as i64
}

impl Word {
    fn new(text: &str) -> Self {
        let (name, value) = text.split_once('=').unwrap_or((text, ""));
        let (first, to) = value.split_once("..").map_or((value, None), |(from, to)| (from, to.parse().ok()));
        let numbers = first.split(',').map_while(|item| {
            let (number, times) = item.split_once('x').unwrap_or((item, "1"));
            Some(core::iter::repeat_n(number.parse().ok()?, times.parse().ok()?))
        });
        let numbers = numbers.flatten().collect();
        Self { name: name.to_owned(), numbers, to, text: value.to_owned() }
    }
}

impl Piece {
    fn new(text: &str) -> Self {
        let mut words = text.split_whitespace();
        let time = words.next().expect("a time");
        let (time, every) = time.split_once('%').unwrap_or((time, "1:0-1"));
        let (period, part) = every.split_once(':').expect("a part of the period");
        let (begins, ends) = part.split_once('-').expect("its beginning and end");
        let every_ms = (millis(period), millis(begins)..millis(ends));
        let (from_ms, until_ms) = match (time.strip_prefix('@'), time.split_once('-')) {
            _ if time == "*" => (i64::MIN, i64::MAX),
            (Some(moment), _) => (millis(moment), millis(moment) + 1),
            (None, Some((from, until))) => (millis(from), millis(until)),
            (None, None) => (millis(time), i64::MAX),
        };
        Self { from_ms, until_ms, every_ms, words: words.map(Word::new).collect() }
    }
}

impl Script {
    pub fn new(text: &str) -> Self {
        Self(text.split(';').filter(|piece| !piece.trim().is_empty()).map(Piece::new).collect())
    }

    /// The words of a moment, milliseconds after the beginning of the script.
    pub fn play(&self, ms: i64, mut take: impl FnMut(&Said<'_>)) {
        for piece in &self.0 {
            let (period_ms, part_ms) = &piece.every_ms;
            if (piece.from_ms..piece.until_ms).contains(&ms) && part_ms.contains(&ms.rem_euclid(*period_ms)) {
                let since_ms = ms.saturating_sub(piece.from_ms) as u64;
                let part = since_ms as f32 / piece.until_ms.saturating_sub(piece.from_ms) as f32;
                piece.words.iter().for_each(|word| take(&Said { word, part, since_ms }));
            }
        }
    }
}

impl Said<'_> {
    pub fn name(&self) -> &str {
        &self.word.name
    }

    pub fn text(&self) -> &str {
        &self.word.text
    }

    pub fn number(&self) -> f32 {
        let from = *self.word.numbers.first().unwrap_or_else(|| panic!("{}: no number", self.word.name));
        self.word.to.map_or(from, |to| from + (to - from) * self.part)
    }

    /// A list, or one number for all.
    pub fn list<const N: usize>(&self) -> [f32; N] {
        let numbers = &self.word.numbers;
        core::array::from_fn(|place| numbers.get(place).copied().unwrap_or_else(|| self.number()))
    }

    /// The rest of a list.
    pub fn more(&self, from: usize) -> &[f32] {
        self.word.numbers.get(from..).unwrap_or_default()
    }

    fn mode(&self) -> u32 {
        match self.text() {
            "posctl" => 0x0003_0000,
            "altctl" => 0x0002_0000,
            "stabilized" => 0x0007_0000,
            "acro" => 0x0005_0000,
            "rattitude" => 0x0008_0000,
            "hold" => 0x0304_0000,
            "mission" => 0x0404_0000,
            "precland" => 0x0904_0000,
            _ => self.number() as u32,
        }
    }

    fn landed(&self) -> Option<LandedState> {
        match self.text() {
            "ground" => Some(LandedState::OnGround),
            "air" => Some(LandedState::InAir),
            "landing" => Some(LandedState::Landing),
            "-" => None,
            other => panic!("{other}: no landed state"),
        }
    }
}

impl Quad {
    /// Takes a word; `false` if it is not the vehicle's.
    pub fn take(&mut self, said: &Said<'_>) -> bool {
        let kind = match said.name() {
            "quad" => Some((VehicleKind::Rotorcraft, 2)),
            "hexa" => Some((VehicleKind::Rotorcraft, 13)),
            "heli" => Some((VehicleKind::Rotorcraft, 4)),
            "plane" => Some((VehicleKind::Plane, 1)),
            "vtol" => Some((VehicleKind::Vtol, 22)),
            "rover" => Some((VehicleKind::Surface, 10)),
            "boat" => Some((VehicleKind::Surface, 11)),
            "submarine" => Some((VehicleKind::Surface, 12)),
            _ => None,
        };
        (self.kind, self.type_number) = kind.unwrap_or((self.kind, self.type_number));
        match said.name() {
            _ if kind.is_some() => {}
            "ap" => self.autopilot = Autopilot::ArduPilot,
            "px4" => self.autopilot = Autopilot::Px4,
            "other" => self.autopilot = Autopilot::Other,
            "mode" => self.mode = said.mode(),
            "state" => self.state = said.number() as u8,
            "on" => self.armed = true,
            "off" => self.armed = false,
            "silent" => self.silent = true,
            "mute" => self.battery_silent = true,
            "landed" => self.landed = said.landed(),
            "hover" => self.vtol = VtolState::Hover,
            "forward" => self.vtol = VtolState::Forward,
            "transition" => self.vtol = VtolState::Transition,
            "boot" => self.boot_offset_ms = said.number() as i64,
            "start" => self.start_height = said.number(),
            "h" => self.height = said.number(),
            "c" => self.climb = said.number(),
            "wants" => self.climb_wanted = Some(said.number()),
            "thr" => self.throttle = said.number(),
            "roll" => self.roll = said.number(),
            "down" => self.acceleration_down = said.number(),
            "rem" => self.battery.remaining = Some(Fraction(said.number())),
            "volt" => self.battery.voltage = Some(Volts(said.number())),
            "vibe" => self.vibration.levels = said.list().map(Some),
            "cpu" => self.system.load = Some(Fraction(said.number())),
            "gps" => self.gnss.speed = Some(MetresPerSecond(said.number())),
            "fix" => self.gnss.fix = said.number() as u8,
            "vel" => self.estimator.velocity = Some(said.number()),
            "amps" => {
                for (esc, current) in self.escs.iter_mut().flatten().zip(said.list::<4>()) {
                    esc.current = Some(Amperes(current));
                }
            }
            _ => return false,
        }
        true
    }
}
