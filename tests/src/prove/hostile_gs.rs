//! A hostile ground station, for a day.

use std::collections::{BTreeMap, VecDeque};

use anyhow::{Context as _, Result, ensure};
use hums::card::Faults;
use hums::logs::on_card;
use hums::rng::Rng;
use hums::run::sim::both_ports::{BoardSetup, Outcome, Side, run as power_on};
use hums::source::Chunk;
use hums_core::clock::Instant;
use hums_core::parameters::{Param, Params, TABLE};
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::frame::{Check, Frame};
use hums_link::packet::Packet;
use hums_link::signing::{Clock, Key, Seal};
use hums_recorder::{Buffers, CardStatus};

use super::card::Card;
use super::figures::Figures;
use super::options::Options;
use super::record::Record;
use super::stream::{FULL_RATE, Stream};
use crate::flights::{OWN, own};

/// 10 kB/s of the vehicle; the flights in turn.
const BAUD: u64 = 100_000;
/// Always full.
const GS_BAUD: u64 = 57_600;
/// Microseconds.
const STEP_US: u64 = 5_000;
const SECOND_US: u64 = 1_000_000;
const KEY: [u8; 32] = [0x5a; 32];
const BUDGET: u32 = 1_000;
/// The highest value that anybody may set.
const BUDGET_MAX: u32 = 5_000;
const AP_BUDGET_MAX: u32 = 10_000;

/// Earlier sessions on the card, and how long each is in seconds.
const EARLIER: u32 = 3;
const EARLIER_S: f64 = 3.0;
/// The box's own messages (docs/safety.md): HEARTBEAT, `PARAM_REQUEST_READ`, `REQUEST_DATA_STREAM` and
/// `COMMAND_LONG`, of the latter these.
const OWN_IDS: [u32; 4] = [0, 20, 66, 76];
const OWN_COMMANDS: [u16; 2] = [511, 512];
const COMPONENT: u8 = 191;

pub(super) fn run(options: &Options) -> Result<Figures> {
    let seconds = options.runs(24 * 3600, 120);
    let mut figures = Figures::with(&["figure, each over half of the hours", "without a key", "with a key"]);
    figures.fact("simulated hours", format!("{:.1}", seconds as f64 / 3600.0));
    // Half of the time the key is needed.
    let [without, with] = [("without a key", None), ("with a key", Some(KEY))].map(|(name, key)| {
        attack(options, seconds / 2, key).with_context(|| name.to_owned()).map(Half::figures)
    });
    for ((what, without), (_, with)) in without?.into_iter().zip(with?) {
        figures.row(&[&what, &without, &with]);
    }
    Ok(figures)
}

struct Half {
    outcome: Outcome,
    hostile_bytes: u64,
    fullest: usize,
    budget: u32,
    to_autopilot: ToAutopilot,
    autopilot_budget: u32,
    changed: usize,
    /// Logs of earlier sessions that are marked as erased.
    erased: usize,
}

#[derive(Default)]
struct ToAutopilot {
    window: Window,
    frames: u64,
    /// The box's own kinds, in its own name.
    own: u64,
}

impl ToAutopilot {
    fn add(&mut self, at_us: u64, frame: &[u8]) {
        self.window.add(at_us, frame.len());
        self.frames += 1;
        let Some(frame) = Frame::again(frame, Check::Verified) else { return };
        let payload = frame.payload();
        let command = payload.get(28..30).map_or(0, |at| u16::from_le_bytes([at[0], at[1]]));
        let is_own = frame.component() == COMPONENT
            && OWN_IDS.contains(&frame.id())
            && (frame.id() != 76 || OWN_COMMANDS.contains(&command));
        self.own += u64::from(is_own);
    }
}

fn logs_of(card: &Card) -> Result<(BTreeMap<String, Vec<u64>>, usize)> {
    let mut frames = BTreeMap::new();
    for log in on_card(&card.path()).into_iter().take(EARLIER as usize) {
        let hashes = Record::of(&log)?.frames.iter().map(|frame| frame.hash).collect();
        frames.insert(log.name, hashes);
    }
    let (status, held) = (CardStatus::new(), Buffers::new());
    let device = card.device(Faults::default())?;
    let mounted = hums_recorder::Card::mount(&device, &status, &held);
    let mut erased = 0;
    let mounted = mounted.map_err(|error| anyhow::anyhow!("the card: {error}"))?;
    mounted.logs(|log| erased += usize::from(log.hidden)).map_err(|error| anyhow::anyhow!("{error}"))?;
    Ok((frames, erased))
}

/// All logs of a day: without a key any station can begin logs, and a full card overwrites the oldest.
const CARD_MIB: u64 = 4096;

fn attack(options: &Options, seconds: u64, key: Option<[u8; 32]>) -> Result<Half> {
    let open = |flight: &&str| Stream::of_flight(&own(flight), BAUD);
    let streams = OWN.iter().map(open).collect::<Result<Vec<_>>>()?;
    let mut card = Card::new(CARD_MIB)?;
    let earlier = Stream::of_flight(&own(OWN[0]), FULL_RATE)?.for_seconds(EARLIER_S);
    for boots in 1..=EARLIER {
        card.record(&earlier, boots)?;
    }
    let (logs_before, _) = logs_of(&card)?;
    ensure!(logs_before.values().all(|frames| frames.len() > 100), "an earlier session is empty");
    let device = card.device(Faults::default())?;
    let params = params(key.is_some())?;
    let mut hostile = Hostile::new(options.seed ^ u64::from(key.is_some()));
    let (mut window, mut to_autopilot) = (Window::default(), ToAutopilot::default());
    let board = BoardSetup { card: &device, params: &params, key, boots: 1 };
    let outcome =
        power_on(&board, both_sides(&streams, seconds, &mut hostile), |side, at_us, frame| match side {
            Side::Ground => window.add(at_us, frame.len()),
            Side::Autopilot => to_autopilot.add(at_us, frame),
        })?;
    card.check()?;
    let (logs, erased) = logs_of(&card)?;
    ensure!(logs == logs_before, "an earlier log is not what it was");
    let changed =
        params.iter().zip(outcome.params.iter()).filter(|(a, b)| a.1.to_bits() != b.1.to_bits()).count();
    let keyed = key.is_some();
    let half = Half {
        outcome,
        hostile_bytes: hostile.bytes,
        fullest: window.fullest,
        budget: if keyed { BUDGET } else { BUDGET_MAX },
        to_autopilot,
        autopilot_budget: if keyed { params.get(Param::ApBudget) as u32 } else { AP_BUDGET_MAX },
        changed,
        erased,
    };
    half.judge()?;
    if keyed {
        half.judge_with_key(&card)?;
    } else {
        ensure!(changed > 0, "the attack never got through: it shows nothing");
    }
    Ok(half)
}

fn params(keyed: bool) -> Result<Params> {
    let mut params = Params::defaults();
    let mut set = |name: &str, value: f32| {
        params.set(name, value).map_err(|error| anyhow::anyhow!("{name}: {error:?}"))
    };
    set("GS_BUDGET", BUDGET as f32)?;
    if keyed {
        set("GS_SIGN", 2.0)?;
        set("AP_SIGN", 2.0)?;
    }
    Ok(params)
}

impl Half {
    fn figures(self) -> [(&'static str, String); 8] {
        let Self {
            changed, erased, fullest, budget, to_autopilot: ToAutopilot { window, frames, own }, ..
        } = &self;
        let stats = self.outcome.done.stats;
        [
            ("hostile bytes, MB", format!("{:.1}", self.hostile_bytes as f64 / 1e6)),
            ("frames of the vehicle, and lost", format!("{}, {}", stats.frames_in, stats.frames_lost)),
            ("bytes to the ground station in a second: most, budget", format!("{fullest}, {budget}")),
            (
                "bytes to the autopilot in a second: most, budget",
                format!("{}, {}", window.fullest, self.autopilot_budget),
            ),
            ("frames to the autopilot, and the box's own of them", format!("{frames}, {own}")),
            ("parameters changed", changed.to_string()),
            ("earlier logs, marks as erased, unreadable", format!("{EARLIER}, {erased}, 0")),
            (
                "sector queue: most, size",
                format!("{}, {}", stats.queue_bytes_max, stats.queue_bytes_capacity),
            ),
        ]
    }

    fn judge(&self) -> Result<()> {
        let (stats, left) = (self.outcome.done.stats, self.outcome.done.frames_left);
        ensure!(
            self.fullest <= self.budget as usize,
            "{} bytes in a second of {}",
            self.fullest,
            self.budget
        );
        let (fullest, budget) = (self.to_autopilot.window.fullest, self.autopilot_budget);
        ensure!(fullest <= budget as usize, "{fullest} bytes to the autopilot in a second of {budget}");
        ensure!(stats.frames_lost + left == 0, "{} frames lost", stats.frames_lost);
        Ok(())
    }

    fn judge_with_key(&self, card: &Card) -> Result<()> {
        let Self { changed, erased, to_autopilot: ToAutopilot { frames, own, .. }, .. } = self;
        ensure!(*changed == 0, "{changed} parameters were changed without the key");
        ensure!(*erased == 0, "{erased} logs were marked as erased without the key");
        ensure!(frames == own && *own > 0, "{own} of {frames} frames to the autopilot are the box's own");
        // Recording never stopped; no frame is foreign.
        let stats = self.outcome.done.stats;
        ensure!(stats.frames_logged == stats.frames_in, "{} of {}", stats.frames_logged, stats.frames_in);
        let logs = on_card(&card.path());
        let record = Record::of(logs.last().context("no log")?)?;
        let holes = record.gaps.iter().filter(|(_, gap)| gap.from.is_some()).count();
        ensure!(holes == 0, "{holes} holes in the log");
        Ok(())
    }
}

#[derive(Default)]
struct Window {
    frames: VecDeque<(u64, usize)>,
    bytes: usize,
    fullest: usize,
}

impl Window {
    fn add(&mut self, at_us: u64, bytes: usize) {
        // An event at a step began after the previous step.
        while self.frames.front().is_some_and(|(first, _)| at_us - first >= SECOND_US - STEP_US) {
            self.bytes -= self.frames.pop_front().map_or(0, |(_, bytes)| bytes);
        }
        self.frames.push_back((at_us, bytes));
        self.bytes += bytes;
        self.fullest = self.fullest.max(self.bytes);
    }
}

/// Step by step.
fn both_sides<'a>(
    streams: &'a [Stream],
    seconds: u64,
    hostile: &'a mut Hostile,
) -> impl Iterator<Item = (Side, Chunk)> + 'a {
    let mut flights = streams.iter().cycle().flat_map(|stream| stream.bytes.iter().copied());
    (1..=seconds * SECOND_US / STEP_US).flat_map(move |step| {
        let at_us = step * STEP_US;
        let count = (BAUD / 10 * STEP_US / SECOND_US) as usize;
        let vehicle = flights.by_ref().take(count).collect();
        let ground = hostile.take((GS_BAUD / 10 * STEP_US / SECOND_US) as usize + 1);
        [(Side::Ground, Chunk { at_us, bytes: ground }), (Side::Autopilot, Chunk { at_us, bytes: vehicle })]
    })
}

/// The attacker's output.
struct Hostile {
    rng: Rng,
    encoder: Encoder,
    waiting: VecDeque<u8>,
    flood: (u64, u64),
    bytes: u64,
    old: Vec<u8>,
    frames: u64,
}

impl Hostile {
    fn new(seed: u64) -> Self {
        Self {
            rng: Rng::new(seed, 0x905),
            encoder: Encoder::of(255, 190),
            waiting: VecDeque::new(),
            flood: (0, 0),
            bytes: 0,
            old: Vec::new(),
            frames: 0,
        }
    }

    fn take(&mut self, count: usize) -> Vec<u8> {
        while self.waiting.len() < count {
            self.attack();
        }
        self.bytes += count as u64;
        self.waiting.drain(..count).collect()
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.rng.next_u64() % limit
    }

    fn random_bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.rng.next_u64() as u8).collect()
    }

    fn attack(&mut self) {
        if self.flood.1 == 0 {
            self.flood = (self.below(16), 1 + self.below(400));
        }
        self.flood.1 -= 1;
        self.frames += 1;
        let kind = self.flood.0;
        let target = (if self.rng.chance(0.8) { 1 } else { self.rng.next_u64() as u8 }, self.component());
        let at_target = |packet: Packet, at: usize| packet.u8(at, target.0).u8(at + 1, target.1);
        let packet = match kind {
            0 => {
                let count = 1 + self.below(300) as usize;
                let noise = self.random_bytes(count);
                self.waiting.extend(noise);
                return;
            }
            1 => at_target(Packet::new(21), 0),
            2 => at_target(Packet::new(20).u16(0, self.rng.next_u64() as u16), 2),
            3 | 4 => {
                let (value, name) = (self.value(), self.name());
                at_target(Packet::new(23).f32(0, value).bytes(6, &name).u8(22, 9), 4)
            }
            5 => {
                let commands = [400, 401, 511, 512, 519, 520, 526, 2510, 2511, 31_010, 31_011, 246];
                let known = commands[self.below(12) as usize];
                let command = if self.rng.chance(0.7) { known } else { self.rng.next_u64() as u16 };
                let first = if self.rng.chance(0.5) { self.below(400) as f32 } else { self.value() };
                let id = 75 + self.below(2) as u32;
                // Often enough.
                let (first, second) =
                    if command == 526 && self.rng.chance(0.5) { (1.0, 1.0) } else { (first, 0.0) };
                at_target(Packet::new(id).f32(0, first).f32(4, second).u16(28, command), 30)
            }
            6 => at_target(Packet::new(117).u16(0, self.rng.next_u64() as u16).u16(2, u16::MAX), 4),
            7 => {
                let (offset, count) = (self.rng.next_u64() as u32, self.rng.next_u64() as u32);
                let id = self.below(4) as u16;
                at_target(Packet::new(119).u32(0, offset % 100_000).u32(4, count).u16(8, id), 10)
            }
            8 => at_target(Packet::new(121), 0),
            9 | 10 => {
                let size = 12 + self.below(240) as usize;
                let mut payload = self.random_bytes(size);
                payload[3] = self.below(18) as u8;
                if self.rng.chance(0.5) {
                    payload.splice(12..12, *b"/00001_00.HUM");
                }
                at_target(Packet::new(110).bytes(3, payload.get(..251).unwrap_or(&payload)), 1)
            }
            11 => {
                let key = self.random_bytes(32);
                at_target(Packet::new(256).u64(0, self.rng.next_u64()).bytes(10, &key), 8)
            }
            12 | 13 => {
                let id = self.below(512) as u32;
                let size = self.below(255) as usize;
                Packet::new(id).bytes(0, &self.random_bytes(size))
            }
            14 => {
                let old = self.old.clone();
                self.waiting.extend(old);
                return;
            }
            _ if self.rng.chance(0.5) => {
                Packet::new(23).f32(0, 5_000.0).u8(4, 1).u8(5, 191).text(6, 16, "GS_BUDGET")
            }
            _ => Packet::new(23).f32(0, 57_600.0).u8(4, 1).u8(5, 191).text(6, 16, "GS_BAUD"),
        };
        self.say(&packet);
    }

    fn component(&mut self) -> u8 {
        match self.below(4) {
            0 => 0,
            1 => self.rng.next_u64() as u8,
            _ => 191,
        }
    }

    fn name(&mut self) -> Vec<u8> {
        if self.rng.chance(0.2) {
            return self.random_bytes(16);
        }
        // Its own port off would end the attack.
        let name =
            Some(TABLE[self.below(TABLE.len() as u64) as usize].name).filter(|name| *name != "GS_PATH");
        let mut name = name.unwrap_or("GS_BUDGET").as_bytes().to_vec();
        name.resize(16, 0);
        name
    }

    fn value(&mut self) -> f32 {
        match self.below(5) {
            0 => f32::from_bits(self.rng.next_u64() as u32),
            1 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MAX][self.below(5) as usize],
            2 => self.below(100_000) as f32,
            _ => self.below(4) as f32,
        }
    }

    /// Any identity; sometimes damaged, sometimes signed with another key.
    fn say(&mut self, packet: &Packet) {
        let who = match self.below(8) {
            0 => (1, 1),
            1 => (1, 191),
            2 => (self.rng.next_u64() as u8, self.rng.next_u64() as u8),
            _ => (255, 190),
        };
        let mut encoder = if who == (255, 190) { self.encoder } else { Encoder::of(who.0, who.1) };
        let mut buffer = [0; FRAME_BYTES_MAX];
        let now = Instant::from_millis(self.frames);
        let mut frame = if self.rng.chance(0.2) {
            let mut key = [0; 32];
            key[..].copy_from_slice(&self.random_bytes(32));
            let mut seal =
                Seal::new(Key(key), self.rng.next_u64() as u8, Clock::default(), self.rng.next_u64() >> 17);
            encoder.frame_signed(&mut buffer, packet, now, &mut seal).to_vec()
        } else {
            encoder.frame(&mut buffer, packet).to_vec()
        };
        if who == (255, 190) {
            self.encoder = encoder;
        }
        if self.rng.chance(0.05) && !frame.is_empty() {
            let at = self.below(frame.len() as u64) as usize;
            frame[at] ^= 1 << self.below(8);
        }
        if self.rng.chance(0.02) {
            frame.truncate(self.below(frame.len() as u64 + 1) as usize);
        }
        if self.rng.chance(0.1) {
            self.old.clone_from(&frame);
        }
        // Unknown messages give no frame.
        if frame.is_empty() {
            frame = self.random_bytes(8);
        }
        self.waiting.extend(frame);
    }
}
