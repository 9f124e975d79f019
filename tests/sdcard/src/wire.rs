//! The card at a bus of the chip's model.

use hums_boards::Board;
use hums_recorder::spi::{Clock, Port as _};
use stm32f405_model::bits::Pins;
use stm32f405_model::gpio::Pin;
use stm32f405_model::machine::Machine;
use stm32f405_model::spi::Wire;

use crate::{Event, SimPort, Slot};

/// Wires slot and chip as the board does.
pub fn connect(machine: &mut Machine, board: &Board, slot: &Slot) {
    let pin = |pin: hums_boards::Pin| Pin(pin.port, pin.number);
    let (wires, card) = (&board.card, Box::new(Card::new(slot)));
    if let Some(bus) = &wires.bus {
        machine.connect(usize::from(bus.spi).saturating_sub(1), pin(wires.cs), card);
    } else {
        let [clock, to_device, from_device, select] = [wires.sck, wires.mosi, wires.miso, wires.cs].map(pin);
        machine.connect_pins(Pins { clock, to_device, from_device, select }, card);
    }
}

/// A card in its slot, byte by byte at a bus.
pub struct Card {
    slot: Slot,
    port: SimPort,
    hz: u32,
}

impl Card {
    /// At the start of the bus.
    pub fn new(slot: &Slot) -> Self {
        Self { slot: slot.clone(), port: slot.port(), hz: 0 }
    }
}

impl Wire for Card {
    fn exchange(&mut self, ps: u64, hz: u32, sent: u8) -> u8 {
        if hz != self.hz {
            self.hz = hz;
            self.port.set_clock(if hz <= 400_000 { Clock::Identification } else { Clock::Transfer });
        }
        // The slot adds the byte's own time.
        self.slot.advance_to((ps / 1_000).saturating_sub(8_000_000_000 / u64::from(hz.max(1))));
        let mut byte = [sent];
        let _ = self.port.exchange(&mut byte);
        byte[0]
    }

    fn begin(&mut self, ps: u64, _: u32) -> u8 {
        self.slot.advance_to(ps / 1_000);
        self.slot.begin()
    }

    fn select(&mut self, ps: u64, selected: bool) {
        self.slot.advance_to(ps / 1_000);
        self.port.select(selected);
    }

    fn power(&mut self, ps: u64, on: bool) {
        if !on && self.slot.has_card() {
            self.slot.advance_to(ps / 1_000);
            self.slot.event(Event::Bounce);
        }
    }
}
