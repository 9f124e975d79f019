//! One element of a field: predicted from its past, and the difference coded.
//!
//! A difference becomes a *class* (about the length of its magnitude in bits), coded with the element's own adaptive
//! distribution, then sign and lower bits as they are: in a flight they are noise. Which of several predictions counts
//! is decided by what each would have cost lately.

use crate::coder::Coder;
use crate::distribution::Cdf;

/// Elements at most: a copter with all streams has 430, a PX4 510.
pub(crate) const ELEMENTS: usize = 544;

/// Distributions at most; an element gets its own when it first changes.
pub(crate) const BLOCKS: usize = 512;

/// An element that has not changed for so many frames is quiet.
pub(crate) const QUIET: u8 = 6;

/// Predictions that are weighed.
const PREDICTIONS: usize = 7;
const LAST: usize = 0;
const LINEAR: usize = 1;
const HALF: usize = 2;
/// Integers that are times: by the arrival, by the newest time of any message, equal to it.
const BY_ARRIVAL: usize = 3;
const BY_CLOCK: usize = 4;
const SAME_CLOCK: usize = 5;
/// Floats: changed as, or equal to, the float before in the frame; changed as, or equal to, the linked register.
const AS_NEIGHBOUR: usize = 3;
const NEIGHBOUR: usize = 4;
const AS_LINK: usize = 5;
const LINKED: usize = 6;

/// Costs are in eighths of a bit; beyond this a float is as good as random and is coded by its own parts.
const RANDOM: u8 = 192;
/// What a prediction costs before it is known.
const UNKNOWN: u8 = 100;

/// How an element is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum What {
    /// 1, 2 or 4 bytes.
    Integer1,
    Integer2,
    Integer4,
    /// Times of 4 bytes.
    Millis,
    Micros,
    Float,
    /// 8 bytes; the next element is their upper half.
    Wide,
    WideTime,
    Upper,
    /// Text or data, `size` bytes.
    Text,
    /// The slot says it, `size` bytes.
    Instance,
}

/// What is known of one element.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    /// The last value's bits; of a 64-bit element the lower half.
    pub(crate) last: u32,
    /// The last difference.
    step: i32,
    /// The clock at the last value, or the linked number's bits; of a text, where it is kept.
    pub(crate) aux: u32,
    /// Its own distribution, and the one for its other mode; 0: none yet.
    block: u16,
    other: u16,
    costs: [u8; PREDICTIONS],
    pub(crate) what: What,
    /// Bytes on the wire.
    pub(crate) size: u8,
    /// How surely it is a multiple of 1/100 (float) or of 1000 (64-bit integer): 3 and more. Bit 7: `step` is in
    /// hundredths.
    decimal: u8,
    /// The exponent that the classes of a random float are counted from. Of an integer with links: 1 if signed.
    pub(crate) exponent: u8,
    /// Frames since it changed, up to 63; bit 7: it has a last value; bit 6: it has links.
    quiet: u8,
}

const KNOWN: u8 = 0x80;
const LINKED_FIELD: u8 = 0x40;
const QUIET_MAX: u8 = 0x3f;
const STEP_DECIMAL: u8 = 0x80;

impl Element {
    const NEW: Self = Self::new(What::Integer1, 1, false);

    pub(crate) const fn new(what: What, size: u8, links: bool) -> Self {
        Self {
            last: 0,
            step: 0,
            aux: 0,
            block: 0,
            other: 0,
            costs: [0, 0, 0, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN],
            what,
            size,
            decimal: 0,
            exponent: 120,
            quiet: if links { LINKED_FIELD } else { 0 },
        }
    }

    /// Whether it has a last value.
    #[inline]
    pub(crate) const fn known(&self) -> bool {
        self.quiet & KNOWN != 0
    }

    /// Whether it has not changed for long.
    #[inline]
    pub(crate) const fn is_quiet(&self) -> bool {
        self.quiet & QUIET_MAX >= QUIET
    }

    /// Whether the table of links names it.
    #[inline]
    pub(crate) const fn has_links(&self) -> bool {
        self.quiet & LINKED_FIELD != 0
    }

    #[inline]
    pub(crate) fn note(&mut self, same: bool) {
        let count = if same { (self.quiet & QUIET_MAX).saturating_add(1).min(QUIET_MAX) } else { 0 };
        self.quiet = self.quiet & LINKED_FIELD | KNOWN | count;
    }

    /// The last value as a number.
    pub(crate) fn number(&self) -> f32 {
        match (self.what, self.exponent) {
            (What::Float, _) => f32::from_bits(self.last),
            (What::Integer2, 1) => f32::from(self.last as i16),
            (What::Integer4, 1) => self.last as i32 as f32,
            _ => self.last as f32,
        }
    }

    fn decimals(&self) -> u8 {
        self.decimal & !STEP_DECIMAL
    }

    /// Learns whether the value is a decimal.
    fn weigh_decimal(&mut self, is: bool) {
        let decimals = self.decimals();
        let decimals = if is { (decimals + 1).min(6) } else { decimals.saturating_sub(2) };
        self.decimal = self.decimal & STEP_DECIMAL | decimals;
    }
}

/// What the frame knows.
pub(crate) struct Context {
    /// Milliseconds since the last frame of this slot.
    pub(crate) elapsed_ms: u32,
    /// The newest time that any message gave, in microseconds; only differences count.
    pub(crate) clock_us: u32,
    /// The newest time in milliseconds.
    pub(crate) clock_ms: u32,
    /// The float before in this frame: now and before.
    pub(crate) neighbour: Option<(f32, f32)>,
}

/// The elements and their distributions.
pub(crate) struct Elements {
    pub(crate) list: [Element; ELEMENTS],
    pub(crate) used: u16,
    pub(crate) distributions: Distributions,
}

/// The distributions of classes.
pub(crate) struct Distributions {
    blocks: [Cdf; BLOCKS],
    used: u16,
    /// For elements without their own: by class of kind.
    calm: [Cdf; KINDS],
    /// What a new distribution begins as.
    young: [Cdf; KINDS],
    /// First values.
    first: [Cdf; KINDS],
}

/// Kinds whose elements behave alike: small and large integers, floats, decimal floats, random floats, times.
const KINDS: usize = 7;
const SMALL: usize = 0;
const MIDDLE: usize = 1;
const LARGE: usize = 2;
const FLOAT: usize = 3;
const DECIMAL: usize = 4;
const RANDOM_FLOAT: usize = 5;
const TIME: usize = 6;

const CALM: Cdf = Cdf::from_sizes([600, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20]);

impl Elements {
    pub(crate) const fn new() -> Self {
        Self { list: [Element::NEW; ELEMENTS], used: 0, distributions: Distributions::new() }
    }

    pub(crate) fn reset(&mut self) {
        self.used = 0;
        self.distributions.reset();
    }

    /// Room for `count` elements.
    pub(crate) fn claim(&mut self, count: usize) -> Option<u16> {
        let first = self.used;
        if usize::from(first) + count > ELEMENTS {
            return None;
        }
        self.used += count as u16;
        Some(first)
    }
}

impl Distributions {
    const fn new() -> Self {
        Self {
            blocks: [Cdf::FLAT; BLOCKS],
            used: 0,
            calm: [CALM; KINDS],
            young: [Cdf::FLAT; KINDS],
            first: [Cdf::FLAT; KINDS],
        }
    }

    fn reset(&mut self) {
        self.used = 0;
        self.calm = [CALM; KINDS];
        self.young = [Cdf::FLAT; KINDS];
        self.first = [Cdf::FLAT; KINDS];
    }

    /// A new distribution; 0 where there is none left.
    pub(crate) fn claim(&mut self, from: Cdf) -> u16 {
        let Some(block) = self.blocks.get_mut(usize::from(self.used)) else { return 0 };
        *block = from;
        self.used += 1;
        self.used
    }

    /// That distribution.
    #[inline]
    pub(crate) fn get(&mut self, number: u16) -> Option<&mut Cdf> {
        self.blocks.get_mut(usize::from(number).wrapping_sub(1))
    }

    /// Codes a class with the element's distribution; what had none and changes gets one.
    #[inline]
    fn class<C: Coder>(&mut self, coder: &mut C, block: &mut u16, kind: usize, symbol: usize) -> usize {
        if let Some(cdf) = self.get(*block) {
            return coder.symbol(cdf, symbol);
        }
        let symbol = coder.symbol(&mut self.calm[kind], symbol);
        if symbol != 0 {
            let mut cdf = self.young[kind].renewed();
            cdf.adapt(symbol);
            self.young[kind].adapt(symbol);
            *block = self.claim(cdf);
        }
        symbol
    }

    /// The same for a value that may be the first one.
    #[inline]
    fn class_or_first<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        kind: usize,
        symbol: usize,
    ) -> usize {
        if element.known() {
            self.class(coder, &mut element.block, kind, symbol)
        } else {
            coder.symbol(&mut self.first[kind], symbol)
        }
    }

    /// An integer of 1, 2 or 4 bytes that is no time.
    #[inline]
    pub(crate) fn integer<C: Coder>(&mut self, coder: &mut C, element: &mut Element, value: u32) -> u32 {
        let (spare, kind) = match element.what {
            What::Integer1 => (24, SMALL),
            What::Integer2 => (16, MIDDLE),
            _ => (0, LARGE),
        };
        let fold = |difference: u32| ((difference << spare) as i32) >> spare;
        let (last, step) = (element.last, element.step);
        let known = element.known();
        // From the last value: as it is, with the last step, with half of it.
        let [as_is, linear, half, ..] = &mut element.costs;
        let mut ahead = 0;
        if *linear < *as_is {
            ahead = step;
        }
        if *half < (*linear).min(*as_is) {
            ahead = step / 2;
        }
        let guess = if known { last.wrapping_add(ahead as u32) } else { 0 };
        let difference = fold(value.wrapping_sub(guess));
        let class = integer_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, kind, class);
        let difference = integer_rest(coder, symbol, difference);
        let value = guess.wrapping_add(difference as u32) & (u32::MAX >> spare);
        let change = value.wrapping_sub(last);
        let [as_is, linear, half, ..] = &mut element.costs;
        charge(as_is, fold(change).unsigned_abs());
        charge(linear, fold(change.wrapping_sub(step as u32)).unsigned_abs());
        charge(half, fold(change.wrapping_sub((step / 2) as u32)).unsigned_abs());
        element.step = if known { fold(change) } else { 0 };
        element.note(change == 0);
        element.last = value;
        value
    }

    /// A time of 4 bytes.
    pub(crate) fn time<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        context: &Context,
    ) -> u32 {
        let last = element.last;
        let mut guesses = [last; SAME_CLOCK + 1];
        guesses[LINEAR] = last.wrapping_add(element.step as u32);
        guesses[HALF] = last.wrapping_add((element.step / 2) as u32);
        let elapsed_us = context.clock_us.wrapping_sub(element.aux);
        (guesses[BY_ARRIVAL], guesses[BY_CLOCK]) = if element.what == What::Millis {
            (last.wrapping_add(context.elapsed_ms), last.wrapping_add(thousandth(elapsed_us)))
        } else {
            let arrival = context.elapsed_ms.wrapping_mul(1_000);
            (last.wrapping_add(arrival), last.wrapping_add(elapsed_us))
        };
        guesses[SAME_CLOCK] = context.clock_ms;
        element.aux = context.clock_us;
        let known = element.known();
        let guess = if known { guesses[cheapest(&element.costs, SAME_CLOCK + 1)] } else { 0 };
        let difference = value.wrapping_sub(guess) as i32;
        let class = integer_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, TIME, class);
        let value = guess.wrapping_add(integer_rest(coder, symbol, difference) as u32);
        for (cost, guess) in element.costs.iter_mut().zip(guesses) {
            charge(cost, (value.wrapping_sub(guess) as i32).unsigned_abs());
        }
        element.step = if known { value.wrapping_sub(last) as i32 } else { 0 };
        element.note(value == last);
        element.last = value;
        value
    }

    /// A float of 4 bytes. `link`: what the linked register predicts.
    pub(crate) fn float<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        value: u32,
        context: &Context,
        link: Option<f32>,
    ) -> u32 {
        let last = element.last;
        let mut coded = None;
        let mut step = None;
        if element.decimals() >= 3
            && let Some(hundredths) = hundredths(last)
        {
            (coded, step) = self.decimal(coder, element, hundredths, value);
        }
        let last_order = order(last);
        let last_step = if element.decimal & STEP_DECIMAL != 0 { 0 } else { element.step };
        let mut guesses = [last_order; PREDICTIONS];
        guesses[LINEAR] = last_order.wrapping_add(last_step);
        guesses[HALF] = last_order.wrapping_add(last_step / 2);
        let number = f32::from_bits(last);
        if let Some((now, before)) = context.neighbour {
            guesses[AS_NEIGHBOUR] = order_or(number + (now - before), last_order);
            guesses[NEIGHBOUR] = order_or(now, last_order);
        }
        if let Some(linked) = link {
            guesses[AS_LINK] = order_or(number + (linked - f32::from_bits(element.aux)), last_order);
            guesses[LINKED] = order_or(linked, last_order);
            element.aux = linked.to_bits();
        }
        let count = if link.is_some() { PREDICTIONS } else { NEIGHBOUR + 1 };
        let value = match coded {
            Some(value) => value,
            None => self.difference(coder, element, &guesses, count, value),
        };
        let now = order(value);
        for (cost, guess) in element.costs.iter_mut().zip(guesses).take(count) {
            charge(cost, now.wrapping_sub(guess).unsigned_abs());
        }
        element.step = step.unwrap_or_else(|| now.wrapping_sub(last_order));
        element.decimal = element.decimals() | if step.is_some() { STEP_DECIMAL } else { 0 };
        if value != 0 {
            element.weigh_decimal(hundredths(value).is_some());
        }
        element.note(value == last);
        element.last = value;
        value
    }

    /// A float that is a number of hundredths, so far: the difference in hundredths. Nothing where it is none now.
    fn decimal<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        last: i32,
        value: u32,
    ) -> (Option<u32>, Option<i32>) {
        let linear = element.decimal & STEP_DECIMAL != 0 && element.costs[LINEAR] < element.costs[LAST];
        let guess = if linear { last.wrapping_add(element.step) } else { last };
        let now = if C::WRITES { hundredths(value) } else { None };
        let difference = now.map_or(0, |now| now.wrapping_sub(guess));
        let symbol = if now.is_some() { integer_class(difference.unsigned_abs()) } else { ESCAPE };
        let symbol = self.class(coder, &mut element.other, DECIMAL, symbol);
        if symbol == ESCAPE && coder.bits16(u32::from(now.is_none()), 1) != 0 {
            return (None, None);
        }
        let now = guess.wrapping_add(integer_rest(coder, symbol, difference));
        (Some((now as f32 * 0.01).to_bits()), Some(now.wrapping_sub(last)))
    }

    fn difference<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        guesses: &[i32; PREDICTIONS],
        count: usize,
        value: u32,
    ) -> u32 {
        let best = cheapest(&element.costs, count);
        let known = element.known();
        if known && element.costs[best] >= RANDOM {
            return self.random(coder, element, value);
        }
        let guess = if known { guesses[best] } else { 0 };
        let difference = order(value).wrapping_sub(guess);
        let class = float_class(difference.unsigned_abs());
        let symbol = self.class_or_first(coder, element, FLOAT, class);
        unorder(guess.wrapping_add(float_rest(coder, symbol, difference)))
    }

    /// A float that nothing predicts: its exponent by class, the rest as it is.
    fn random<C: Coder>(&mut self, coder: &mut C, element: &mut Element, value: u32) -> u32 {
        let exponent = (value >> 23 & 0xff) as i32;
        let offset = exponent - i32::from(element.exponent) + 8;
        let symbol = match offset {
            _ if value == element.last => 0,
            1..=14 => offset as usize,
            _ => ESCAPE,
        };
        let symbol = self.class(coder, &mut element.other, RANDOM_FLOAT, symbol);
        match symbol {
            0 => element.last,
            ESCAPE => {
                let value = coder.bits(value, 32);
                element.exponent = (value >> 23) as u8;
                value
            }
            _ => {
                let rest = coder.bits(value & 0x007f_ffff | value >> 31 << 23, 24);
                let exponent = (i32::from(element.exponent) + symbol as i32 - 8) as u32 & 0xff;
                rest >> 23 << 31 | exponent << 23 | rest & 0x007f_ffff
            }
        }
    }

    /// An integer of 8 bytes (a double is coded by its bits): the element holds the lower half, the next one the
    /// upper.
    pub(crate) fn wide<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        upper: &mut Element,
        value: u64,
        context: &Context,
    ) -> u64 {
        let last = u64::from(upper.last) << 32 | u64::from(element.last);
        let quantum = if element.decimals() >= 3 && times_1000(last) { 1_000 } else { 1 };
        let timed = element.what == What::WideTime;
        let mut guesses = [last; PREDICTIONS];
        guesses[LINEAR] = last.wrapping_add_signed(i64::from(element.step));
        guesses[HALF] = guesses[LINEAR];
        if timed {
            let elapsed_us = context.clock_us.wrapping_sub(element.aux) as i32;
            guesses[BY_ARRIVAL] = last.wrapping_add(u64::from(context.elapsed_ms) * 1_000);
            guesses[BY_CLOCK] = last.wrapping_add_signed(i64::from(elapsed_us));
        }
        let count = if timed { BY_CLOCK + 1 } else { LINEAR + 1 };
        let known = element.known();
        let mut guess = if known { guesses[cheapest(&element.costs, count)] } else { 0 };
        let mut now = value;
        if quantum == 1_000 {
            // In thousands, as long as the value is one; the escape below tells otherwise.
            guess = guess.wrapping_add(500) / 1_000;
            now = value / 1_000;
        }
        let whole = quantum == 1 || times_1000(value);
        let difference = now.wrapping_sub(guess) as i64;
        let fits = whole && i32::try_from(difference).is_ok();
        let class = if fits { integer_class(difference.unsigned_abs() as u32) } else { ESCAPE };
        let symbol = self.class_or_first(coder, element, TIME, class);
        let value = if symbol == ESCAPE && coder.bits16(u32::from(!fits), 1) != 0 {
            let low = coder.bits(value as u32, 32);
            u64::from(coder.bits((value >> 32) as u32, 32)) << 32 | u64::from(low)
        } else {
            let difference = integer_rest(coder, symbol, difference as i32);
            guess.wrapping_add_signed(i64::from(difference)).wrapping_mul(quantum)
        };
        let distance = |guess: u64| {
            let magnitude = (value.wrapping_sub(guess) as i64).unsigned_abs();
            u32::try_from(magnitude).unwrap_or(u32::MAX)
        };
        for (cost, guess) in element.costs.iter_mut().zip(guesses).take(count) {
            charge(cost, distance(guess));
        }
        let step = value.wrapping_sub(last) as i64;
        element.step = if known { i32::try_from(step).unwrap_or(0) } else { 0 };
        if value != 0 {
            element.weigh_decimal(times_1000(value));
        }
        element.aux = context.clock_us;
        element.note(value == last);
        element.last = value as u32;
        upper.last = (value >> 32) as u32;
        value
    }
}

/// The class that says that more follows.
const ESCAPE: usize = 15;

/// Integers: 0 for none, 1 for +-1, then the length in bits; 15 for 15 bits and more.
#[inline]
fn integer_class(magnitude: u32) -> usize {
    ((32 - magnitude.leading_zeros()) as usize).min(ESCAPE)
}

/// Sign and lower bits of an integer difference.
#[inline]
fn integer_rest<C: Coder>(coder: &mut C, class: usize, difference: i32) -> i32 {
    if class == 0 {
        return 0;
    }
    let magnitude = difference.unsigned_abs();
    let mut length = class as u32;
    if class == ESCAPE {
        let longer = (32 - magnitude.leading_zeros()).saturating_sub(length);
        length = (length + coder.bits16(longer, 5)).min(32);
    }
    signed_rest(coder, difference, length - 1)
}

/// Sign and `bits` lower bits below a leading one.
#[inline]
fn signed_rest<C: Coder>(coder: &mut C, difference: i32, bits: u32) -> i32 {
    let magnitude = difference.unsigned_abs();
    let top = 1_u32 << bits;
    let (negative, low) = if bits < 31 {
        let rest = coder.bits((magnitude & (top - 1)) | u32::from(difference < 0) << bits, bits + 1);
        (rest >> bits & 1 != 0, rest & (top - 1))
    } else {
        let low = coder.bits(magnitude & (top - 1), bits);
        (coder.bits16(u32::from(difference < 0), 1) != 0, low)
    };
    let magnitude = top | low;
    (if negative { magnitude.wrapping_neg() } else { magnitude }) as i32
}

/// Floats: 0 for none, 1 for up to 4 bits, 2 for up to 8, 3 for up to 10, 4 for up to 12, then 13 to 22 bits each
/// their own; 15 for more.
#[inline]
fn float_class(magnitude: u32) -> usize {
    let length = 32 - magnitude.leading_zeros();
    match length {
        0 => 0,
        1..=4 => 1,
        5..=8 => 2,
        9..=10 => 3,
        11..=12 => 4,
        13..=22 => length as usize - 8,
        _ => ESCAPE,
    }
}

/// Sign and lower bits of a float's difference.
#[inline]
fn float_rest<C: Coder>(coder: &mut C, class: usize, difference: i32) -> i32 {
    let magnitude = difference.unsigned_abs();
    let length = 32 - magnitude.leading_zeros();
    match class {
        0 => 0,
        1..=4 => {
            let bits = [4, 8, 10, 12][class - 1];
            let rest = coder.bits16(magnitude | u32::from(difference < 0) << bits, bits + 1);
            let magnitude = (rest & ((1 << bits) - 1)) as i32;
            if rest >> bits & 1 != 0 { -magnitude } else { magnitude }
        }
        ESCAPE => {
            let length = (23 + coder.bits16(length.saturating_sub(23), 4)).min(32);
            signed_rest(coder, difference, length - 1)
        }
        _ => signed_rest(coder, difference, class as u32 + 7),
    }
}

/// Floats in the order of their values, as integers; a bijection.
#[inline]
const fn order(bits: u32) -> i32 {
    let bits = bits as i32;
    bits ^ ((bits >> 31) & 0x7fff_ffff)
}

#[inline]
const fn unorder(order: i32) -> u32 {
    (order ^ ((order >> 31) & 0x7fff_ffff)) as u32
}

/// A computed float in order; not-a-numbers differ between machines, so they do not count.
#[inline]
fn order_or(number: f32, otherwise: i32) -> i32 {
    if number.is_nan() { otherwise } else { order(number.to_bits()) }
}

/// `n` where the float is exactly `n x 0.01` as floats multiply.
#[inline]
fn hundredths(bits: u32) -> Option<i32> {
    let scaled = f32::from_bits(bits) * 100.0;
    if scaled.is_nan() || scaled.abs() >= 8_388_608.0 {
        return None;
    }
    let n = (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i32;
    ((n as f32 * 0.01).to_bits() == bits).then_some(n)
}

/// Whether it is a multiple of 1000, without dividing: by the inverse of 125 modulo 2^64.
#[inline]
const fn times_1000(value: u64) -> bool {
    const INVERSE_OF_125: u64 = 0x1cac_0831_26e9_78d5;
    value & 7 == 0 && value.wrapping_mul(INVERSE_OF_125) <= u64::MAX / 125
}

/// A thousandth, rounded: for spans below an hour.
#[inline]
const fn thousandth(value: u32) -> u32 {
    ((value.wrapping_add(500) as u64 * 4_294_968) >> 32) as u32
}

#[inline]
fn cheapest(costs: &[u8; PREDICTIONS], count: usize) -> usize {
    let mut best = 0;
    for prediction in 1..count.min(PREDICTIONS) {
        if costs[prediction] < costs[best] {
            best = prediction;
        }
    }
    best
}

/// Adds what a prediction was off by: an eighth of the cost makes place for it.
#[inline]
fn charge(cost: &mut u8, magnitude: u32) {
    let length = (32 - magnitude.leading_zeros()).min(31) as u8;
    *cost = *cost - (*cost >> 3) + length;
}
