//! State of the NVIC and the system handlers.
//!
//! Numbers are the architecture's: 1 reset, 2 NMI, 3 `HardFault`, ..., 16 and on the interrupt lines.

pub(crate) const NMI: u16 = 2;
pub(crate) const HARD_FAULT: u16 = 3;
pub(crate) const MEM_MANAGE: u16 = 4;
pub(crate) const BUS_FAULT: u16 = 5;
pub(crate) const USAGE_FAULT: u16 = 6;
pub(crate) const SVCALL: u16 = 11;
pub(crate) const DEBUG_MONITOR: u16 = 12;
pub(crate) const PENDSV: u16 = 14;
pub(crate) const SYSTICK: u16 = 15;

pub(crate) fn is_fault(number: u16) -> bool {
    (HARD_FAULT..=USAGE_FAULT).contains(&number)
}

/// Thread mode, below all.
pub(crate) const THREAD: i16 = 256;

/// A bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Set([u64; 4]);

impl Set {
    pub(crate) fn has(&self, number: u16) -> bool {
        self.0[usize::from(number >> 6 & 3)] >> (number & 63) & 1 == 1
    }

    pub(crate) fn put(&mut self, number: u16, on: bool) {
        let bit = 1 << (number & 63);
        let word = &mut self.0[usize::from(number >> 6 & 3)];
        if on { *word |= bit } else { *word &= !bit }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = u16> + use<> {
        let words = self.0;
        (0..4u16).flat_map(move |word| {
            let mut bits = words[usize::from(word)];
            core::iter::from_fn(move || {
                (bits != 0).then(|| {
                    let bit = bits.trailing_zeros() as u16;
                    bits &= bits - 1;
                    word * 64 + bit
                })
            })
        })
    }

    fn and(&self, other: &Set) -> Set {
        Set(core::array::from_fn(|word| self.0[word] & other.0[word]))
    }

    fn is_empty(&self) -> bool {
        self.0 == [0; 4]
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Exceptions {
    lines: u16,
    priority_bits: u8,
    pub(crate) pending: Set,
    pub(crate) active: Set,
    pub(crate) enabled: Set,
    high: Set,
    priority: [u8; 256],
    /// AIRCR.PRIGROUP.
    pub(crate) group: u8,
}

impl Exceptions {
    pub(crate) fn new(lines: u16, priority_bits: u8) -> Self {
        let mut enabled = Set::default();
        for number in [NMI, HARD_FAULT, SVCALL, DEBUG_MONITOR, PENDSV, SYSTICK] {
            enabled.put(number, true);
        }
        Exceptions {
            lines: lines.min(240),
            priority_bits: priority_bits.clamp(3, 8),
            pending: Set::default(),
            active: Set::default(),
            enabled,
            high: Set::default(),
            priority: [0; 256],
            group: 0,
        }
    }

    pub(crate) fn lines(&self) -> u16 {
        self.lines
    }

    pub(crate) fn priority_bits(&self) -> u8 {
        self.priority_bits
    }

    pub(crate) fn is_interrupt(&self, number: u16) -> bool {
        number >= 16 && number < 16 + self.lines
    }

    pub(crate) fn pend(&mut self, number: u16) -> bool {
        if number >= 16 && !self.is_interrupt(number) {
            return false;
        }
        let new = !self.pending.has(number);
        self.pending.put(number, true);
        new
    }

    /// Unless its line holds it.
    pub(crate) fn unpend(&mut self, number: u16) {
        self.pending.put(number, self.high.has(number) && !self.active.has(number));
    }

    pub(crate) fn set_line(&mut self, interrupt: u16, high: bool) -> bool {
        let number = interrupt + 16;
        if interrupt >= self.lines || self.high.has(number) == high {
            return false;
        }
        self.high.put(number, high);
        high && self.pend(number)
    }

    pub(crate) fn activate(&mut self, number: u16) {
        self.pending.put(number, false);
        self.active.put(number, true);
    }

    /// A line still high makes it pending again.
    pub(crate) fn deactivate(&mut self, number: u16) {
        self.active.put(number, false);
        if self.high.has(number) {
            self.pending.put(number, true);
        }
    }

    /// All bits: -3 to 255.
    pub(crate) fn priority(&self, number: u16) -> i16 {
        match number {
            1 => -3,
            NMI => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priority[usize::from(number & 255)]),
        }
    }

    pub(crate) fn priority_byte(&self, number: u16) -> u8 {
        self.priority[usize::from(number & 255)]
    }

    /// Lower bits are not implemented.
    pub(crate) fn set_priority(&mut self, number: u16, value: u8) {
        let configurable = (4..=6).contains(&number)
            || matches!(number, SVCALL | DEBUG_MONITOR | PENDSV | SYSTICK)
            || self.is_interrupt(number);
        if configurable {
            self.priority[usize::from(number & 255)] = self.kept(value);
        }
    }

    /// Implemented bits.
    pub(crate) fn kept(&self, value: u8) -> u8 {
        value & (0xFFu16 << (8 - self.priority_bits)) as u8
    }

    pub(crate) fn grouped(&self, priority: i16) -> i16 {
        if priority < 0 { priority } else { priority & !((2 << self.group) - 1) }
    }

    /// [`THREAD`] without one.
    pub(crate) fn active_priority(&self) -> i16 {
        let grouped = self.active.iter().map(|number| self.grouped(self.priority(number)));
        grouped.min().unwrap_or(THREAD)
    }

    pub(crate) fn first(&self) -> Option<u16> {
        let ready = self.pending.and(&self.enabled);
        if ready.is_empty() {
            return None;
        }
        ready.iter().min_by_key(|&number| (self.priority(number), number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_urgent_comes_first_and_of_equals_the_lower_number() {
        let mut exceptions = Exceptions::new(82, 4);
        for (number, priority) in [(20, 0x80), (30, 0x40), (25, 0x40), (40, 0x10)] {
            exceptions.set_priority(number, priority);
            exceptions.pend(number);
            exceptions.enabled.put(number, number != 40);
        }
        assert_eq!(exceptions.first(), Some(25), "40 is not enabled");
        exceptions.pend(HARD_FAULT);
        assert_eq!(exceptions.first(), Some(HARD_FAULT));
    }

    #[test]
    fn the_group_is_what_is_left_of_the_split() {
        let mut exceptions = Exceptions::new(82, 4);
        exceptions.set_priority(16, 0xFF);
        assert_eq!(exceptions.priority(16), 0xF0, "four bits are there");
        for (group, grouped) in [(0, 0xB0), (3, 0xB0), (4, 0xA0), (5, 0x80), (6, 0x80), (7, 0)] {
            exceptions.group = group;
            assert_eq!(exceptions.grouped(0xB0), grouped, "PRIGROUP {group}");
        }
    }

    #[test]
    fn a_line_that_stays_high_is_pending_again_after_its_handler() {
        let mut exceptions = Exceptions::new(82, 4);
        assert!(exceptions.set_line(3, true));
        exceptions.activate(19);
        assert!(!exceptions.pending.has(19));
        exceptions.deactivate(19);
        assert!(exceptions.pending.has(19));
        exceptions.unpend(19);
        assert!(exceptions.pending.has(19), "the line holds it");
        exceptions.set_line(3, false);
        exceptions.unpend(19);
        assert!(!exceptions.pending.has(19));
    }
}
