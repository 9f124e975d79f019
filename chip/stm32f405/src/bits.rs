//! A device on pins that the program moves, as SPI in mode 0: a bit at each rising edge, its own bit after that.

use crate::gpio::{Gpio, Pin};
use crate::spi::Wire;
use crate::time::{Ps, SECOND};

/// The pins of such a device.
#[derive(Clone, Copy, Debug)]
pub struct Pins {
    /// Clock.
    pub clock: Pin,
    /// To the device.
    pub to_device: Pin,
    /// From the device.
    pub from_device: Pin,
    /// Select, low.
    pub select: Pin,
}

/// The device.
pub struct Bits {
    pins: Pins,
    /// The other end.
    pub wire: Box<dyn Wire>,
    is_selected: bool,
    is_high: bool,
    /// Last rising edge.
    edge: Ps,
    /// Time between the last two of a byte.
    bit: Ps,
    /// So far, and their number.
    taken: (u8, u8),
    answer: u8,
}

impl Bits {
    /// A device on these pins.
    pub fn new(pins: Pins, wire: Box<dyn Wire>) -> Self {
        let (edge, bit) = (0, SECOND / 100_000);
        Self { pins, wire, is_selected: false, is_high: false, edge, bit, taken: (0, 0), answer: 0xFF }
    }

    /// The pins now; returns the device's pin and level, if new.
    pub fn look(&mut self, gpio: &Gpio, ps: Ps) -> Option<(Pin, bool)> {
        let selected = gpio.pulls_low(self.pins.select);
        if selected != self.is_selected {
            self.is_selected = selected;
            self.taken = (0, 0);
            self.wire.select(ps, selected);
        }
        let is_high = gpio.is_high(self.pins.clock);
        let was_high = std::mem::replace(&mut self.is_high, is_high);
        if was_high || !is_high {
            return None;
        }
        let (bits, count) = self.taken;
        if count > 0 {
            self.bit = ps.saturating_sub(self.edge).max(1);
        }
        self.edge = ps;
        let hz = (SECOND / self.bit) as u32;
        if count == 0 {
            self.answer = self.wire.begin(ps, hz);
        }
        let level = self.answer >> (7 - count) & 1 == 1;
        self.taken = (bits << 1 | u8::from(gpio.is_high(self.pins.to_device)), count + 1);
        if count == 7 {
            self.wire.exchange(ps, hz, self.taken.0);
            self.taken = (0, 0);
        }
        Some((self.pins.from_device, level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::rc::Rc;

    struct Next(Rc<RefCell<Vec<(u32, u8)>>>);

    impl Wire for Next {
        fn begin(&mut self, _: u64, _: u32) -> u8 {
            0xA5
        }
        fn exchange(&mut self, _: u64, hz: u32, sent: u8) -> u8 {
            self.0.borrow_mut().push((hz, sent));
            0
        }
        fn select(&mut self, _: u64, selected: bool) {
            self.0.borrow_mut().push((0, u8::from(selected)));
        }
    }

    #[test]
    fn bits_come_and_go_at_the_rising_edges_of_the_clock() {
        let pins =
            Pins { clock: Pin(2, 12), to_device: Pin(3, 2), from_device: Pin(2, 8), select: Pin(2, 11) };
        let seen = Rc::default();
        let mut bits = Bits::new(pins, Box::new(Next(Rc::clone(&seen))));
        let mut gpio = Gpio::new();
        gpio.write(2, 0x00, 1 << 24 | 1 << 22);
        gpio.write(3, 0x00, 1 << 4);
        let mut received = 0_u8;
        for (index, bit) in [0, 1, 0, 1, 1, 1, 0, 0_u32].into_iter().enumerate() {
            let ps = index as u64 * 100_000;
            gpio.write(3, 0x14, bit << 2);
            gpio.write(2, 0x14, 1 << 12);
            let (pin, level) = bits.look(&gpio, ps).unwrap();
            assert_eq!((pin, bits.look(&gpio, ps)), (pins.from_device, None));
            received = received << 1 | u8::from(level);
            gpio.write(2, 0x14, 0);
            assert_eq!(bits.look(&gpio, ps), None);
        }
        assert_eq!(received, 0xA5);
        assert_eq!(*seen.borrow(), [(0, 1), (10_000_000, 0b0101_1100)]);
    }
}
