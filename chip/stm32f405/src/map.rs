//! Modelled devices' addresses and gates (RM0090, table 1 and 7.3), interrupts (table 62), alternate functions
//! (DS8626, table 9).

use crate::gpio::Pin;
use crate::rcc::Bank;

/// A device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// TIM2 to TIM5: 0 to 3; TIM12: 4.
    Tim(u8),
    /// TIM11.
    Tim11,
    /// USART1, USART2, USART3, UART4, UART5, USART6: 0 to 5.
    Usart(u8),
    /// SPI1 to SPI3: 0 to 2.
    Spi(u8),
    /// The independent watchdog.
    Iwdg,
    /// Power control.
    Pwr,
    /// System configuration.
    Syscfg,
    /// External interrupts.
    Exti,
    /// Ports A to I: 0 to 8.
    Gpio(u8),
    /// The CRC unit.
    Crc,
    /// Reset and clock control.
    Rcc,
    /// The flash's controller.
    Flash,
    /// DMA1 and DMA2: 0 and 1.
    Dma(u8),
    /// The random number generator.
    Rng,
    /// USB OTG FS.
    Otg,
    /// The debugger's identity.
    Dbgmcu,
}

/// Clock and reset.
pub type Gate = (Bank, u8);

/// USB OTG FS: registers and FIFOs.
pub const OTG: u32 = 0x5000_0000;
const OTG_END: u32 = 0x5004_0000;
/// Ports of pins.
const GPIO: u32 = 0x4002_0000;

/// The device at an address, and its gate, if any.
pub fn unit_at(address: u32) -> Option<(Unit, Option<Gate>)> {
    use Bank::{Ahb1, Ahb2, Apb1, Apb2};
    let (unit, gate) = match address & !0x3FF {
        0x4000_0000 => (Unit::Tim(0), Some((Apb1, 0))),
        0x4000_0400 => (Unit::Tim(1), Some((Apb1, 1))),
        0x4000_0800 => (Unit::Tim(2), Some((Apb1, 2))),
        0x4000_0C00 => (Unit::Tim(3), Some((Apb1, 3))),
        0x4000_1800 => (Unit::Tim(4), Some((Apb1, 6))),
        0x4000_3000 => (Unit::Iwdg, None),
        0x4000_3800 => (Unit::Spi(1), Some((Apb1, 14))),
        0x4000_3C00 => (Unit::Spi(2), Some((Apb1, 15))),
        0x4000_4400 => (Unit::Usart(1), Some((Apb1, 17))),
        0x4000_4800 => (Unit::Usart(2), Some((Apb1, 18))),
        0x4000_4C00 => (Unit::Usart(3), Some((Apb1, 19))),
        0x4000_5000 => (Unit::Usart(4), Some((Apb1, 20))),
        0x4000_7000 => (Unit::Pwr, Some((Apb1, 28))),
        0x4001_1000 => (Unit::Usart(0), Some((Apb2, 4))),
        0x4001_1400 => (Unit::Usart(5), Some((Apb2, 5))),
        0x4001_3000 => (Unit::Spi(0), Some((Apb2, 12))),
        0x4001_3800 => (Unit::Syscfg, Some((Apb2, 14))),
        0x4001_3C00 => (Unit::Exti, None),
        0x4001_4800 => (Unit::Tim11, Some((Apb2, 18))),
        port @ GPIO..=0x4002_2000 => {
            let number = ((port - GPIO) >> 10) as u8;
            (Unit::Gpio(number), Some((Ahb1, number)))
        }
        0x4002_3000 => (Unit::Crc, Some((Ahb1, 12))),
        0x4002_3800 => (Unit::Rcc, None),
        0x4002_3C00 => (Unit::Flash, None),
        0x4002_6000 => (Unit::Dma(0), Some((Ahb1, 21))),
        0x4002_6400 => (Unit::Dma(1), Some((Ahb1, 22))),
        OTG..OTG_END => (Unit::Otg, Some((Ahb2, 7))),
        0x5006_0800 => (Unit::Rng, Some((Ahb2, 6))),
        0xE004_2000 => (Unit::Dbgmcu, None),
        _ => return None,
    };
    Some((unit, gate))
}

/// The device of a reset register's bit.
pub fn unit_of(gate: Gate) -> Option<Unit> {
    BASES.into_iter().filter_map(unit_at).find(|(_, of)| *of == Some(gate)).map(|(unit, _)| unit)
}

/// Devices with a gate.
const BASES: [u32; 31] = [
    0x4001_4800,
    0x4000_1800,
    0x4000_0000,
    0x4000_0400,
    0x4000_0800,
    0x4000_0C00,
    0x4000_3800,
    0x4000_3C00,
    0x4000_4400,
    0x4000_4800,
    0x4000_4C00,
    0x4000_5000,
    0x4000_7000,
    0x4001_1000,
    0x4001_1400,
    0x4001_3000,
    0x4001_3800,
    0x4002_0000,
    0x4002_0400,
    0x4002_0800,
    0x4002_0C00,
    0x4002_1000,
    0x4002_1400,
    0x4002_1800,
    0x4002_1C00,
    0x4002_2000,
    0x4002_3000,
    0x4002_6000,
    0x4002_6400,
    OTG,
    0x5006_0800,
];

/// Interrupt lines of the chip.
pub const LINES: u16 = 82;
/// Bits of an interrupt's priority.
pub const PRIORITY_BITS: u8 = 4;
/// The supply's detector.
pub const PVD: u16 = 1;
/// The flash's.
pub const FLASH: u16 = 4;
/// The random number generator's.
pub const RNG: u16 = 80;
/// The USB port's.
pub const OTG_LINE: u16 = 67;
/// Its pins, and their alternate function.
pub const OTG_PINS: (u8, [Pin; 2]) = (10, [pin('A', 11), pin('A', 12)]);

/// The interrupt of a port.
pub const USART: [u16; 6] = [37, 38, 39, 52, 53, 71];
/// Interrupts of the SPI buses.
pub const SPI: [u16; 3] = [35, 36, 51];
/// Interrupts of the timers.
pub const TIM: [u16; 5] = [28, 29, 30, 50, 43];
/// Interrupts of each DMA controller's streams.
pub const DMA: [[u16; 8]; 2] = [[11, 12, 13, 14, 15, 16, 17, 47], [56, 57, 58, 59, 60, 68, 69, 70]];
/// Interrupts of EXTI, with their lines.
pub const EXTI: [(u32, u16); 10] = [
    (1, 6),
    (1 << 1, 7),
    (1 << 2, 8),
    (1 << 3, 9),
    (1 << 4, 10),
    (0x1F << 5, 23),
    (0x3F << 10, 40),
    (1 << 16, PVD),
    (1 << 17, 41),
    (1 << 18, 42),
];

const fn pin(port: char, number: u8) -> Pin {
    Pin(port as u8 - b'A', number)
}

/// Alternate function, receiving pins, sending pins.
pub const USART_PINS: [(u8, &[Pin], &[Pin]); 6] = [
    (7, &[pin('A', 10), pin('B', 7)], &[pin('A', 9), pin('B', 6)]),
    (7, &[pin('A', 3), pin('D', 6)], &[pin('A', 2), pin('D', 5)]),
    (7, &[pin('B', 11), pin('C', 11), pin('D', 9)], &[pin('B', 10), pin('C', 10), pin('D', 8)]),
    (8, &[pin('A', 1), pin('C', 11)], &[pin('A', 0), pin('C', 10)]),
    (8, &[pin('D', 2)], &[pin('C', 12)]),
    (8, &[pin('C', 7), pin('G', 9)], &[pin('C', 6), pin('G', 14)]),
];

/// Alternate function; pins of clock, output, input.
pub const SPI_PINS: [(u8, [&[Pin]; 3]); 3] = [
    (5, [&[pin('A', 5), pin('B', 3)], &[pin('A', 7), pin('B', 5)], &[pin('A', 6), pin('B', 4)]]),
    (5, [&[pin('B', 10), pin('B', 13)], &[pin('B', 15), pin('C', 3)], &[pin('B', 14), pin('C', 2)]]),
    (6, [&[pin('B', 3), pin('C', 10)], &[pin('B', 5), pin('C', 12)], &[pin('B', 4), pin('C', 11)]]),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_gate_has_one_device() {
        for base in BASES {
            let (unit, gate) = unit_at(base).expect("a device is there");
            assert_eq!(unit_of(gate.expect("it has a gate")), Some(unit), "{base:#x}");
        }
    }
}
