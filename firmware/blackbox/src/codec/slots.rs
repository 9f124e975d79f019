//! Slots: each stream of one message from one sender (and one instance, for messages with several). A slot stores the
//! shape of its last frame, and the order of slots.

use hums_dialect::Message;
use zerocopy::FromZeros;

use super::frame::Frame;
use crate::coder::Coder;
use crate::distribution::{Cdf, Cell};
use crate::zeros;

/// Slots at most. Further streams are coded as plain bytes.
pub(crate) const SLOTS: usize = 112;

pub(crate) const SENDERS: usize = 16;

/// A name of 10 characters.
pub(crate) const INSTANCE_BYTES: usize = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq, FromZeros)]
pub(crate) struct Key {
    pub(crate) id: u32,
    pub(crate) v2: bool,
    pub(crate) sender: u8,
    pub(crate) instance: [u8; INSTANCE_BYTES],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, FromZeros)]
#[repr(u8)]
pub(crate) enum Length {
    /// Without the zeros at the end.
    Trimmed,
    /// As the last one.
    Fixed(u8),
}

#[derive(Clone, Copy, FromZeros)]
pub(crate) struct Slot {
    pub(crate) key: Key,
    pub(crate) elements: u16,
    pub(crate) elements_count: u8,
    /// The distribution of the times before its frames; 0: none yet.
    pub(crate) times: u16,
    pub(crate) at_ms: u32,
    pub(crate) seed: u8,
    /// The seed is that of our definition.
    pub(crate) own_seed: bool,
    pub(crate) verified: bool,
    pub(crate) incompat: u8,
    pub(crate) compat: u8,
    pub(crate) length: Length,
    /// Payload bytes that the layout describes.
    pub(crate) described: u8,
    pub(crate) header: u8,
    /// Offset and size of the instance field; 0 where there is none.
    pub(crate) instance_at: u8,
    pub(crate) instance_size: u8,
    pub(crate) calm: Cell,
    pub(crate) quiet: bool,
    /// Frames so far, up to 255.
    pub(crate) frames: u8,
    /// The slots that followed last, the latest first; `NONE`.
    next: [u8; 2],
}

pub(crate) const NONE: u8 = u8::MAX;

impl Slot {
    pub(crate) fn new(key: Key, message: Option<&Message>, elements: u16, described: usize) -> Self {
        let has_layout = message.is_some();
        let len_base = message.map_or(0, |message| message.len_base);
        Self {
            key,
            elements,
            described: described as u8,
            seed: message.map_or(0, |message| message.crc_extra),
            own_seed: has_layout,
            verified: has_layout,
            length: if key.v2 && has_layout { Length::Trimmed } else { Length::Fixed(len_base) },
            calm: Cell::EVEN,
            next: [NONE; 2],
            ..zeros()
        }
    }
}

impl Slot {
    /// Each message has a field.
    pub(crate) const fn has_layout(&self) -> bool {
        self.described > 0
    }

    fn is_instance(&self, frame: &Frame) -> bool {
        let (at, size) = (usize::from(self.instance_at), usize::from(self.instance_size));
        self.key.instance.get(..size) == frame.payload.get(at..at + size)
    }
}

/// A sender's state.
#[derive(Clone, Copy, Debug, FromZeros)]
pub(crate) struct Sender {
    pub(crate) system: u8,
    pub(crate) component: u8,
    pub(crate) sequence: u8,
    pub(crate) signature_link: u8,
    pub(crate) signature_time: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NextEntry {
    Slot(u8),
    NewSlot,
    Plain,
    Record,
}

const FIRST_GUESS: usize = 0;
const SECOND_GUESS: usize = 1;
const OTHER_SLOT: usize = 2;
const NEW_SLOT: usize = 3;
const PLAIN: usize = 4;
const RECORD: usize = 5;
/// Added for a slot's frame whose header is not as expected.
const UNEXPECTED: usize = 6;

/// Distributions of the above: by how sure the first guess is, and whether the last frame's header was as expected.
const KINDS: usize = 32;

/// Successions of three and of two slots, hashed.
const ORDER_3: usize = 512;
const ORDER_2: usize = 256;

#[derive(Clone, Copy, FromZeros)]
struct Guess {
    slot: u8,
    sure: u8,
}

const NO_GUESS: Guess = Guess { slot: NONE, sure: 0 };

#[derive(FromZeros)]
pub(crate) struct Slots {
    pub(crate) list: [Slot; SLOTS],
    used: u8,
    pub(crate) senders: [Sender; SENDERS],
    senders_used: u8,
    order_3: [Guess; ORDER_3],
    order_2: [Guess; ORDER_2],
    past: [u8; 3],
    /// The places in `order_3` and `order_2` for its successor.
    places: (u16, u16),
    guesses: (u8, u8, u8),
    kind: [Cdf; KINDS],
    high: Cdf,
    low: [Cdf; SLOTS / 16],
}

impl Slots {
    pub(crate) fn reset(&mut self) {
        self.used = 0;
        self.senders_used = 0;
        self.order_3 = [NO_GUESS; ORDER_3];
        self.order_2 = [NO_GUESS; ORDER_2];
        self.past = [NONE; 3];
        self.places = places(self.past);
        self.guesses = (NONE, NONE, 0);
        self.kind = [KIND; KINDS];
        self.high = Cdf::FLAT;
        self.low = [Cdf::FLAT; SLOTS / 16];
    }

    pub(crate) fn sender(&mut self, system: u8, component: u8) -> Option<u8> {
        let used = usize::from(self.senders_used);
        let known = self.senders.get(..used)?;
        let found = known.iter().position(|s| s.system == system && s.component == component);
        if let Some(found) = found {
            return Some(found as u8);
        }
        let place = self.senders.get_mut(used)?;
        *place = Sender { system, component, sequence: 0, signature_link: 0, signature_time: 0 };
        self.senders_used += 1;
        Some(used as u8)
    }

    pub(crate) fn used(&self) -> usize {
        usize::from(self.used)
    }

    pub(crate) fn has_room(&self) -> bool {
        usize::from(self.used) < SLOTS
    }

    /// One of the guessed slots: spares most frames the search.
    #[inline]
    pub(crate) fn find_guessed(&self, frame: &Frame) -> Option<u8> {
        let (first, second, _) = self.guesses;
        if self.is_of(first, frame) {
            return Some(first);
        }
        self.is_of(second, frame).then_some(second)
    }

    #[inline]
    fn is_of(&self, slot: u8, frame: &Frame) -> bool {
        let Some(slot) = self.list.get(usize::from(slot)) else { return false };
        let Some(sender) = self.senders.get(usize::from(slot.key.sender)) else { return false };
        slot.key.id == frame.id
            && slot.key.v2 == frame.v2
            && sender.system == frame.system
            && sender.component == frame.component
            && (slot.instance_size == 0 || slot.is_instance(frame))
    }

    #[inline(never)]
    pub(crate) fn find(&self, frame: &Frame) -> Option<u8> {
        (0..self.used).find(|&slot| self.is_of(slot, frame))
    }

    pub(crate) fn add(&mut self, slot: Slot) -> Option<u8> {
        let place = self.list.get_mut(usize::from(self.used))?;
        *place = slot;
        self.used += 1;
        Some(self.used - 1)
    }

    fn guess(&self) -> (u8, u8, u8) {
        let (three, two) = self.places;
        let three = self.order_3[usize::from(three) % ORDER_3];
        let two = self.order_2[usize::from(two) % ORDER_2];
        let one = self.list.get(usize::from(self.past[0])).map_or([NONE; 2], |slot| slot.next);
        let (first, sure) = if three.slot != NONE {
            (three.slot, 4 + three.sure)
        } else if two.slot != NONE {
            (two.slot, 8 + two.sure)
        } else {
            (one[0], u8::from(one[0] != NONE))
        };
        let mut second = one[1];
        if one[0] != first && one[0] != NONE {
            second = one[0];
        }
        if two.slot != first && two.slot != NONE {
            second = two.slot;
        }
        if second == first {
            second = NONE;
        }
        // All three agree: an own context.
        let agree = first == two.slot && first == one[0];
        (first, second, if agree && sure >= 7 { 12 + (sure & 3) } else { sure })
    }

    /// Codes the next entry's slot, and for a slot's frame whether its header is as expected. `rough`: the last
    /// frame's header was unexpected.
    pub(crate) fn next<C: Coder>(
        &mut self,
        coder: &mut C,
        next: NextEntry,
        expected: bool,
        rough: bool,
    ) -> Option<(NextEntry, bool)> {
        let (first, second, context) = self.guesses;
        let mut symbol = match next {
            NextEntry::Slot(slot) if slot == first => FIRST_GUESS,
            NextEntry::Slot(slot) if slot == second => SECOND_GUESS,
            NextEntry::Slot(_) => OTHER_SLOT,
            NextEntry::NewSlot => NEW_SLOT,
            NextEntry::Plain => PLAIN,
            NextEntry::Record => RECORD,
        };
        if symbol <= OTHER_SLOT && !expected {
            symbol += UNEXPECTED;
        }
        let context = usize::from(context & 15) + if rough { 16 } else { 0 };
        symbol = coder.symbol(&mut self.kind[context % KINDS], symbol);
        let expected = symbol < UNEXPECTED;
        let slot = match if expected { symbol } else { symbol - UNEXPECTED } {
            FIRST_GUESS => first,
            SECOND_GUESS => second,
            OTHER_SLOT => {
                let slot = if let NextEntry::Slot(slot) = next { usize::from(slot) } else { 0 };
                let high = coder.symbol(&mut self.high, slot >> 4);
                let low = coder.symbol(self.low.get_mut(high)?, slot & 15);
                (high << 4 | low) as u8
            }
            NEW_SLOT if expected => return Some((NextEntry::NewSlot, false)),
            PLAIN if expected => return Some((NextEntry::Plain, false)),
            RECORD if expected => return Some((NextEntry::Record, false)),
            _ => return None,
        };
        (slot < self.used).then_some((NextEntry::Slot(slot), expected))
    }

    pub(crate) fn passed(&mut self, slot: u8) {
        let (three, two) = self.places;
        let three = &mut self.order_3[usize::from(three) % ORDER_3];
        let two = &mut self.order_2[usize::from(two) % ORDER_2];
        for guess in [three, two] {
            if guess.slot == slot {
                guess.sure = (guess.sure + 1).min(3);
            } else {
                *guess = Guess { slot, sure: 0 };
            }
        }
        if let Some(last) = self.list.get_mut(usize::from(self.past[0]))
            && last.next[0] != slot
        {
            last.next = [slot, last.next[0]];
        }
        self.past = [slot, self.past[0], self.past[1]];
        self.places = places(self.past);
        self.guesses = self.guess();
    }
}

const fn places([a, b, c]: [u8; 3]) -> (u16, u16) {
    let (a, b, c) = (a as u32, b as u32, c as u32);
    let two = (a << 8 | b).wrapping_mul(0x9e37_79b1) >> 16;
    let three = (a << 16 | b << 8 | c).wrapping_mul(0x85eb_ca6b) >> 16;
    (three as u16 % ORDER_3 as u16, two as u16 % ORDER_2 as u16)
}

const KIND: Cdf = Cdf::from_sizes([60, 12, 12, 8, 1, 2, 4, 1, 1, 1, 1, 1, 1, 1, 1, 1]);
