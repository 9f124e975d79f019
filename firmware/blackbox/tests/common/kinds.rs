//! A generated stream that reaches every part of the codec's model. Every message with every pattern of values, both
//! versions, signed frames, every odd kind.
//!
//! Part of the golden sums: it never changes.

use hums_dialect::{Kind, Message, Role};

use crate::common::Random;
use crate::frames::{checks, checksum};

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Entry {
    Frame(u64, Vec<u8>, bool),
    Record(u64, Vec<u8>),
}

#[derive(Clone, Copy)]
enum Habit {
    Constant,
    Counts,
    Walks,
    ChangesRarely,
    /// Hundredths; for 64 bits thousands.
    Decimal,
    /// The same quantity in many fields: a plain float, integers in thousandths.
    Shared,
    Random,
    /// Not-a-numbers, infinities, the ends of integers.
    Extreme,
}

const HABITS: [Habit; 12] = [
    Habit::Constant,
    Habit::Counts,
    Habit::Walks,
    Habit::ChangesRarely,
    Habit::Decimal,
    Habit::Shared,
    Habit::Shared,
    Habit::Random,
    Habit::Walks,
    Habit::Decimal,
    Habit::Extreme,
    Habit::Shared,
];

struct Element {
    kind: Kind,
    role: Role,
    habit: Habit,
    number: f64,
    step: f64,
    text: Vec<u8>,
}

struct World {
    at_ms: u64,
    clock_us: u64,
    shared: f64,
    signature_time: u64,
}

impl Element {
    fn next(&mut self, world: &World, random: &mut Random, out: &mut Vec<u8>) {
        let size = self.kind.size();
        if !self.text.is_empty() {
            return self.next_text(random, out);
        }
        let jump = if random.below(300) == 0 { random.next() >> 30 } else { 0 };
        let bits = match (self.role, self.habit) {
            (Role::Instance, _) => random.below(3) as u64,
            (Role::Millis, _) => (world.clock_us + jump) / 1_000,
            (Role::Micros, _) => world.clock_us + random.next() % 500 + jump,
            (Role::Plain, Habit::Random) => random.next(),
            (Role::Plain, Habit::Extreme) => self.extreme(random.below(9)),
            (Role::Plain, _) => self.number(world, random),
        };
        out.extend_from_slice(&bits.to_le_bytes()[..size]);
    }

    fn number(&mut self, world: &World, random: &mut Random) -> u64 {
        let drift = random.below(201) as f64 - 100.0;
        let whole = !matches!(self.kind, Kind::F32 | Kind::F64);
        match self.habit {
            Habit::Counts => self.number += self.step,
            Habit::Walks => self.number += self.step * drift / 64.0,
            Habit::Decimal => self.number += (drift / 16.0).trunc(),
            Habit::ChangesRarely if random.below(30) == 0 => self.number += self.step * drift,
            Habit::Shared => self.number = if whole { world.shared * 1_000.0 } else { world.shared },
            _ => {}
        }
        let decimal = matches!(self.habit, Habit::Decimal);
        match self.kind {
            Kind::F32 if decimal => u64::from((self.number as f32 * 0.01).to_bits()),
            Kind::F32 => u64::from((self.number as f32).to_bits()),
            Kind::F64 => self.number.to_bits(),
            Kind::U64 | Kind::I64 if decimal => (self.number * 1_000.0) as i64 as u64,
            _ => self.number as i64 as u64,
        }
    }

    fn extreme(&self, which: usize) -> u64 {
        let float = [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e-40, 1.0];
        match self.kind {
            Kind::F32 => u64::from(float[which].to_bits()),
            Kind::F64 => f64::from(float[which]).to_bits(),
            _ => [0, 1, u64::MAX, 1 << 63, i64::MAX as u64, 1 << 15, 1 << 31, 1 << 7, 127][which],
        }
    }

    fn next_text(&mut self, random: &mut Random, out: &mut Vec<u8>) {
        if self.role == Role::Instance {
            let name: &[u8] = [&b"alpha"[..], b"beta", b"a_long_name_of_26_letters_"][random.below(3)];
            let letters = name.iter().copied().chain(std::iter::repeat(0));
            out.extend(letters.take(self.text.len()));
            return;
        }
        if random.below(8) == 0 {
            let place = random.below(self.text.len());
            self.text[place] = b'a' + random.below(26) as u8;
        }
        if random.below(40) == 0 {
            let end = random.below(self.text.len());
            self.text[end..].fill(0);
        }
        out.extend_from_slice(&self.text);
    }
}

struct Source {
    message: &'static Message,
    v1: bool,
    signed: bool,
    system: u8,
    elements: Vec<Element>,
}

impl Source {
    fn new(message: &'static Message, index: usize, random: &mut Random) -> Self {
        let mut elements = Vec::new();
        for field in message.fields {
            let count = usize::from(field.array.max(1));
            let is_text = field.kind == Kind::Char || field.kind.size() == 1 && count >= 16;
            for _ in 0..if is_text { 1 } else { count } {
                elements.push(Element {
                    kind: field.kind,
                    role: field.role,
                    habit: HABITS[random.below(HABITS.len())],
                    number: random.below(2_000) as f64 - 500.0,
                    step: [0.001, 0.25, 1.0, 3.0, 50.0, 700.0][random.below(6)],
                    text: if is_text { vec![b' '; count] } else { Vec::new() },
                });
            }
        }
        let v1 = message.id < 256 && index % 5 == 1;
        Self { message, v1, signed: index % 7 == 3, system: 1 + (index % 3) as u8, elements }
    }

    fn payload(&mut self, world: &World, random: &mut Random) -> Vec<u8> {
        let mut payload = Vec::new();
        for element in &mut self.elements {
            element.next(world, random, &mut payload);
        }
        payload
    }
}

/// Ways in which a frame is odd.
const ODDITIES: usize = 13;

/// `odd` below `ODDITIES` selects the oddity.
fn frame(
    source: &mut Source,
    sequence: u8,
    odd: usize,
    world: &mut World,
    random: &mut Random,
) -> (Vec<u8>, bool) {
    let mut body = source.payload(world, random);
    if source.v1 {
        body.truncate(usize::from(source.message.len_base));
    }
    match odd {
        0 => body.truncate(body.len() / 2),
        1 => body.resize((body.len() + 1 + random.below(20)).min(255), random.next() as u8),
        2 | 3 => {}
        _ if source.v1 => {}
        _ => body.truncate(body.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1)),
    }
    let id = if odd == 4 { source.message.id ^ 0x0012_3400 } else { source.message.id };
    let system = if odd == 5 { random.next() as u8 } else { source.system };
    let flags = u8::from(source.signed) | if odd == 6 { 2 } else { 0 };
    let [a, b, c, _] = id.to_le_bytes();
    let mut bytes = if source.v1 {
        vec![0xfe, body.len() as u8, sequence, system, 1, a]
    } else {
        vec![0xfd, body.len() as u8, flags, if odd == 7 { 9 } else { 0 }, sequence, system, 1, a, b, c]
    };
    bytes.extend_from_slice(&body);
    let extra = source.message.crc_extra ^ if odd == 8 { 0x3c } else { 0 };
    let damage = if odd == 9 { random.next() as u16 } else { 0 };
    bytes.extend_from_slice(&(checksum(&bytes[1..], extra) ^ damage).to_le_bytes());
    if source.signed && !source.v1 {
        world.signature_time += random.next() % [1, 30, 3_000, 1 << 33][random.below(4)];
        bytes.push(if random.below(20) == 0 { 8 } else { 7 });
        bytes.extend_from_slice(&world.signature_time.to_le_bytes()[..6]);
        bytes.extend_from_slice(&random.next().to_le_bytes()[..6]);
    }
    if odd == 10 {
        bytes.truncate(bytes.len() / 2);
    }
    let verified = checks(&bytes) && odd != 11;
    (bytes, verified)
}

fn record(index: usize, random: &mut Random) -> Vec<u8> {
    let (words, halves) = (random.below(20), random.below(10));
    let calm = random.below(3) > 0;
    let len = 4 + 4 * words + 2 * halves + random.below(20);
    let mut bytes: Vec<u8> = (0..len).map(|_| if calm { 7 } else { random.next() as u8 }).collect();
    let head = [100 + (index % 5) as u8, 1 + 0x10 * random.below(4) as u8, words as u8, halves as u8];
    bytes[..4].copy_from_slice(&head);
    bytes
}

/// `count` entries with these messages; one frame in `odd_one_in` is odd (0: none).
pub(crate) fn entries(
    seed: u64,
    messages: &'static [Message],
    count: usize,
    odd_one_in: usize,
) -> Vec<Entry> {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let numbered = messages.iter().enumerate();
    let mut sources: Vec<_> =
        numbered.map(|(index, message)| Source::new(message, index, &mut random)).collect();
    let mut sequences = [0_u8; 4];
    let mut world = World { at_ms: 500, clock_us: 5_000_000, shared: 0.5, signature_time: 1 << 40 };
    let mut entries = Vec::new();
    for index in 0..count {
        let step_ms = [0, 0, 1, 3, 10, 10, 40, 300][random.below(8)];
        world.at_ms += if random.below(500) == 0 { random.next() >> 24 } else { step_ms };
        world.clock_us += step_ms * 1_000;
        world.shared += (random.below(201) as f64 - 100.0) * 0.000_3;
        if index % 40 == 39 {
            entries.push(Entry::Record(world.at_ms, record(index / 40, &mut random)));
        }
        // In turn, like streams, with exceptions.
        let which = if random.below(4) == 0 { random.below(sources.len()) } else { index % sources.len() };
        let is_odd = odd_one_in > 0 && random.below(odd_one_in) == 0;
        let odd = if is_odd { random.below(ODDITIES) } else { ODDITIES };
        let source = &mut sources[which];
        let sequence = &mut sequences[usize::from(source.system)];
        if odd == 12 {
            *sequence = sequence.wrapping_add(random.next() as u8);
        }
        let (bytes, verified) = frame(source, *sequence, odd, &mut world, &mut random);
        *sequence = sequence.wrapping_add(1);
        let frame = Entry::Frame(world.at_ms, bytes, verified);
        // Some frames are repeated.
        entries.extend((random.below(50) == 0).then(|| frame.clone()));
        entries.push(frame);
    }
    entries
}
