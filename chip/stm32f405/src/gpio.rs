//! Pins: GPIO (RM0090, chapter 8), SYSCFG's choice of lines (chapter 9) and EXTI (chapter 12).
//!
//! Not modelled: the lock (`LCKR` reads back), analog levels, pins driven twice.

const PORTS: usize = 9;

/// Port (0 is A) and number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin(pub u8, pub u8);

impl std::fmt::Display for Pin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "P{}{}", char::from(b'A' + self.0), self.1)
    }
}

#[derive(Clone, Default)]
struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    afr: [u32; 2],
    driven: u32,
    level: u32,
}

impl Port {
    fn new(port: usize) -> Self {
        let (moder, ospeedr, pupdr) = match port {
            0 => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
            1 => (0x280, 0xC0, 0x100),
            _ => (0, 0, 0),
        };
        Self { moder, ospeedr, pupdr, ..Self::default() }
    }

    fn mode(&self, pin: u8) -> u32 {
        self.moder >> (2 * pin) & 3
    }

    fn levels(&self) -> u32 {
        (0..16).filter(|pin| self.is_high(*pin)).map(|pin| 1 << pin).sum()
    }

    fn is_high(&self, pin: u8) -> bool {
        let bit = |register: u32| register >> pin & 1 == 1;
        let drives = self.mode(pin) == 1 && !(bit(self.otyper) && bit(self.odr));
        match self.mode(pin) {
            3 => false,
            _ if drives => bit(self.odr),
            _ if bit(self.driven) => bit(self.level),
            // Low without a pull.
            _ => self.pupdr >> (2 * pin) & 3 == 1,
        }
    }
}

/// All pins.
#[derive(Clone)]
pub struct Gpio {
    ports: [Port; PORTS],
}

impl Default for Gpio {
    fn default() -> Self {
        Self::new()
    }
}

impl Gpio {
    /// As after a reset.
    pub fn new() -> Self {
        Self { ports: std::array::from_fn(Port::new) }
    }

    /// Reset; outside stays.
    pub fn reset(&mut self) {
        for port in 0..PORTS {
            self.reset_port(port);
        }
    }

    /// A reset of one port.
    pub fn reset_port(&mut self, port: usize) {
        let (driven, level) = (self.ports[port].driven, self.ports[port].level);
        self.ports[port] = Port { driven, level, ..Port::new(port) };
    }

    /// A pin is driven from outside, or no more.
    pub fn drive(&mut self, pin: Pin, level: Option<bool>) {
        let port = &mut self.ports[pin.0 as usize];
        let bit = 1 << pin.1;
        port.driven = port.driven & !bit | if level.is_some() { bit } else { 0 };
        port.level = port.level & !bit | if level == Some(true) { bit } else { 0 };
    }

    /// The level at a pin.
    pub fn is_high(&self, pin: Pin) -> bool {
        self.ports[pin.0 as usize].is_high(pin.1)
    }

    /// An output, low: selects a card.
    pub fn pulls_low(&self, pin: Pin) -> bool {
        let port = &self.ports[pin.0 as usize];
        port.mode(pin.1) == 1 && port.odr >> pin.1 & 1 == 0
    }

    /// Whether the pin is pulled up by the chip.
    pub fn is_pulled_up(&self, pin: Pin) -> bool {
        self.ports[pin.0 as usize].pupdr >> (2 * pin.1) & 3 == 1
    }

    /// Whether a device's alternate function has this pin.
    pub fn is_routed(&self, pin: Pin, function: u8) -> bool {
        let port = &self.ports[pin.0 as usize];
        port.mode(pin.1) == 2
            && port.afr[pin.1 as usize / 8] >> (4 * (pin.1 % 8)) & 0xF == u32::from(function)
    }

    /// The levels of a port's pins.
    pub fn levels(&self, port: usize) -> u32 {
        self.ports[port].levels()
    }

    /// A port's register.
    pub fn read(&self, port: usize, offset: u32) -> Option<u32> {
        let port = &self.ports[port];
        Some(match offset {
            0x00 => port.moder,
            0x04 => port.otyper,
            0x08 => port.ospeedr,
            0x0C => port.pupdr,
            0x10 => port.levels(),
            0x14 => port.odr,
            0x18 => 0,
            0x1C => port.lckr,
            0x20 => port.afr[0],
            0x24 => port.afr[1],
            _ => return None,
        })
    }

    /// Writes a port's register.
    pub fn write(&mut self, port: usize, offset: u32, value: u32) -> Option<()> {
        let port = &mut self.ports[port];
        match offset {
            0x00 => port.moder = value,
            0x04 => port.otyper = value & 0xFFFF,
            0x08 => port.ospeedr = value,
            0x0C => port.pupdr = value,
            0x10 => {}
            0x14 => port.odr = value & 0xFFFF,
            // Set wins over reset (RM0090, 8.4.7).
            0x18 => port.odr = port.odr & !(value >> 16) | value & 0xFFFF,
            0x1C => port.lckr = value & 0x1_FFFF,
            0x20 => port.afr[0] = value,
            0x24 => port.afr[1] = value,
            _ => return None,
        }
        Some(())
    }
}

/// EXTI and SYSCFG.
#[derive(Clone, Default)]
pub struct Exti {
    imr: u32,
    emr: u32,
    rtsr: u32,
    ftsr: u32,
    pr: u32,
    /// Last levels, by line.
    seen: u32,
    memrmp: u32,
    pmc: u32,
    exticr: [u32; 4],
}

impl Exti {
    /// A reset, with the lines as they are.
    pub fn reset(&mut self) {
        *self = Self { seen: self.seen, ..Self::default() };
    }

    /// Pins as chosen, line 16 the supply's detector. Returns whether an event went to the processor (WFE).
    pub fn look(&mut self, gpio: &Gpio, supply_low: bool) -> bool {
        let mut levels = u32::from(supply_low) << 16;
        for line in 0..16_u8 {
            let port = self.exticr[line as usize / 4] >> (4 * (line % 4)) & 0xF;
            if (port as usize) < PORTS && gpio.is_high(Pin(port as u8, line)) {
                levels |= 1 << line;
            }
        }
        let edges = (levels & !self.seen & self.rtsr) | (!levels & self.seen & self.ftsr);
        self.seen = levels;
        self.pr |= edges & (self.imr | self.emr);
        edges & self.emr != 0
    }

    /// Interrupting lines.
    pub fn pending(&self) -> u32 {
        self.pr & self.imr
    }

    /// EXTI's register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.imr,
            0x04 => self.emr,
            0x08 => self.rtsr,
            0x0C => self.ftsr,
            0x10 => 0,
            0x14 => self.pr,
            _ => return None,
        })
    }

    /// Writes EXTI's register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        let value = value & 0x7F_FFFF;
        match offset {
            0x00 => self.imr = value,
            0x04 => self.emr = value,
            0x08 => self.rtsr = value,
            0x0C => self.ftsr = value,
            0x10 => self.pr |= value & self.imr,
            0x14 => self.pr &= !value,
            _ => return None,
        }
        Some(())
    }

    /// SYSCFG's register.
    pub fn read_syscfg(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.memrmp,
            0x04 => self.pmc,
            0x08..=0x14 => self.exticr[(offset as usize - 8) / 4],
            0x20 => 0,
            _ => return None,
        })
    }

    /// Another memory at address 0 is not modelled.
    pub fn write_syscfg(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x00 if value & 3 == 0 => self.memrmp = 0,
            0x04 => self.pmc = value & 1 << 23,
            0x08..=0x14 => self.exticr[(offset as usize - 8) / 4] = value & 0xFFFF,
            _ => return None,
        }
        Some(())
    }

    /// A reset of SYSCFG alone.
    pub fn reset_syscfg(&mut self) {
        (self.memrmp, self.pmc, self.exticr) = (0, 0, [0; 4]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_have_the_manuals_reset_values() {
        let gpio = Gpio::new();
        for (port, offset, value) in [
            (0, 0, 0xA800_0000),
            (1, 0, 0x280),
            (2, 0, 0),
            (0, 8, 0x0C00_0000),
            (1, 8, 0xC0),
            (0, 0xC, 0x6400_0000),
            (1, 0xC, 0x100),
            (8, 0xC, 0),
            (0, 0x14, 0),
            (0, 0x24, 0),
        ] {
            assert_eq!(gpio.read(port, offset), Some(value), "port {port} {offset:#x}");
        }
        assert_eq!(gpio.read(0, 0x28), None);
    }

    #[test]
    fn a_pin_shows_who_drives_it() {
        let mut gpio = Gpio::new();
        let pin = Pin(2, 12);
        // (mode, open drain, output, pull, outside, level)
        let cases = [
            (1, 0, 1, 0, None, true),
            (1, 0, 0, 1, None, false),
            (1, 1, 1, 0, Some(false), false),
            (1, 1, 1, 1, None, true),
            (0, 0, 1, 0, None, false),
            (0, 0, 0, 1, None, true),
            (0, 0, 0, 1, Some(false), false),
            (2, 0, 0, 0, Some(true), true),
        ];
        for (mode, drain, output, pull, outside, level) in cases {
            gpio.write(2, 0x00, mode << 24);
            gpio.write(2, 0x04, drain << 12);
            gpio.write(2, 0x18, if output == 1 { 1 << 12 } else { 1 << 28 });
            gpio.write(2, 0x0C, pull << 24);
            gpio.drive(pin, outside);
            assert_eq!(gpio.is_high(pin), level, "{mode} {drain} {output} {pull} {outside:?}");
            assert_eq!(gpio.read(2, 0x10), Some(u32::from(level) << 12));
        }
        gpio.write(2, 0x24, 8 << 16);
        assert!(gpio.is_routed(pin, 8) && !gpio.is_routed(pin, 7));
    }

    #[test]
    fn edges_of_chosen_lines_are_pending_until_cleared() {
        let (mut gpio, mut exti) = (Gpio::new(), Exti::default());
        exti.write_syscfg(0x08, 2 << 8);
        exti.write(0x00, 1 << 2 | 1 << 16);
        exti.write(0x08, 1 << 2 | 1 << 16);
        for (level, low, pending) in
            [(true, false, 4), (true, false, 0), (false, true, 1 << 16), (true, true, 4)]
        {
            gpio.drive(Pin(2, 2), Some(level));
            exti.look(&gpio, low);
            assert_eq!(exti.pending(), pending);
            exti.write(0x14, pending);
            assert_eq!(exti.read(0x14), Some(0));
        }
        exti.write(0x10, 1 << 16);
        assert_eq!(exti.pending(), 1 << 16);
    }
}
