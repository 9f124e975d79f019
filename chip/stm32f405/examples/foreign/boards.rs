//! Examples of board packages: the Adafruit Feather STM32F405 (`feather-f405`) and ST's discovery board with an
//! STM32F407 (`stm32f407g-disc`). Each uses an older `stm32f4xx-hal`.

use stm32f405_model::gpio::Pin;
use stm32f405_model::machine::Machine;
use stm32f405_model::spi::Wire;
use stm32f405_model::time::{MS, SECOND};

use crate::bench::{Outcome, changes, expect, log, run, text};

/// Answers with its identity, and as not busy.
#[derive(Default)]
struct Memory {
    selected: bool,
    command: Option<u8>,
    at: usize,
}

impl Wire for Memory {
    fn exchange(&mut self, _: u64, _: u32, sent: u8) -> u8 {
        const IDENTITY: [u8; 3] = [0xC8, 0x40, 0x15];
        if !self.selected {
            return 0xFF;
        }
        let Some(command) = self.command else {
            self.command = Some(sent);
            return 0xFF;
        };
        self.at += 1;
        match command {
            0x05 => 0,
            0x9F => IDENTITY.get(self.at - 1).copied().unwrap_or(0),
            _ => 0xFF,
        }
    }

    fn select(&mut self, _: u64, selected: bool) {
        *self = Self { selected, ..Self::default() };
    }
}

/// Logs the SPI1 memory's identity.
pub(crate) fn flash(machine: &mut Machine) -> Outcome {
    machine.connect(0, Pin(0, 15), Box::new(Memory::default()));
    run(machine, SECOND)?;
    let said = log(machine);
    expect(said.contains("Flash id: Identification([c8, 40, 15"), format!("it said «{said}»"))?;
    let hz = machine.chip.time.hz();
    expect(hz == 168_000_000, format!("it runs at {hz} Hz"))
}

/// 115,200 baud, 48 MHz of the internal oscillator by the PLL.
pub(crate) fn serial_echo(machine: &mut Machine) -> Outcome {
    run(machine, 50 * MS)?;
    let sent = "The quick brown fox jumps over the lazy dog, back to back.".repeat(10);
    machine.send(1, sent.as_bytes(), 50 * MS, 115_200.0);
    run(machine, 150 * MS)?;
    let heard = text(&machine.take_sent(1));
    expect(heard == sent, format!("it echoed {heard:?}"))?;
    let hz = machine.chip.time.hz();
    expect(hz == 48_000_000, format!("it runs at {hz} Hz"))
}

/// Four LEDs, each 0.5 s after the one before; off likewise a second later; 168 MHz.
pub(crate) fn gpio_hal_blinky(machine: &mut Machine) -> Outcome {
    // Orange, red, blue, green.
    const PINS: [Pin; 4] = [Pin(3, 13), Pin(3, 14), Pin(3, 15), Pin(3, 12)];
    let mut levels = Vec::new();
    for step in 0..24 {
        run(machine, step * 500 * MS + 250 * MS)?;
        levels.push(PINS.map(|pin| machine.chip.gpio.is_high(pin)));
    }
    let wanted = |step: usize| {
        let step = step % 12;
        std::array::from_fn(|led| step >= led && step < 6 + led)
    };
    for (step, levels) in levels.iter().enumerate() {
        expect(*levels == wanted(step), format!("after {step} half seconds the LEDs are {levels:?}"))?;
    }
    let next = changes(machine, PINS[0], 12_500)?;
    expect(
        next.len() == 1 && (12_000..12_010).contains(&next[0].0),
        format!("its thirteenth second: {next:?}"),
    )
}
