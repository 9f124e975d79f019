//! Watchdog (RM0090, chapter 21), random numbers (chapter 24), CRC unit (chapter 4).

use crate::time::{NEVER, Ps, SECOND, US};

/// The independent watchdog. 17 to 47 kHz, 32 typically (DS8626, table 36); only a reset stops it.
#[derive(Clone)]
pub struct Iwdg {
    /// The low-speed oscillator.
    pub lsi_hz: u32,
    prescaler: u32,
    reload: u32,
    open: bool,
    /// Counter at 0.
    bites: Ps,
    /// New prescaler and reload take effect.
    updates: [Ps; 2],
    /// Longest and shortest rest at a feeding.
    pub nearest: Ps,
}

impl Iwdg {
    /// Not running.
    pub fn new(lsi_hz: u32) -> Self {
        Self {
            lsi_hz,
            prescaler: 0,
            reload: 0xFFF,
            open: false,
            bites: NEVER,
            updates: [0; 2],
            nearest: NEVER,
        }
    }

    /// A reset.
    pub fn reset(&mut self) {
        *self = Self { nearest: self.nearest, ..Self::new(self.lsi_hz) };
    }

    fn clock(&self) -> Ps {
        SECOND / u64::from(self.lsi_hz)
    }

    /// When it resets the chip.
    pub fn deadline(&self) -> Ps {
        self.bites
    }

    /// Whether it runs.
    pub fn is_running(&self) -> bool {
        self.bites != NEVER
    }

    /// The register at this offset.
    pub fn read(&self, offset: u32, now: Ps) -> Option<u32> {
        Some(match offset {
            0x00 => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0C => u32::from(self.updates[0] > now) | u32::from(self.updates[1] > now) << 1,
            _ => return None,
        })
    }

    /// True: it began to run.
    pub fn write(&mut self, offset: u32, value: u32, now: Ps) -> Option<bool> {
        let clock = self.clock();
        match offset {
            0x00 => {
                self.open = value & 0xFFFF == 0x5555;
                let starts = value & 0xFFFF == 0xCCCC && !self.is_running();
                if starts || value & 0xFFFF == 0xAAAA && self.is_running() {
                    if !starts {
                        self.nearest = self.nearest.min(self.bites.saturating_sub(now));
                    }
                    let divider = 4_u64 << self.prescaler.min(6);
                    self.bites = now + (u64::from(self.reload) + 1) * divider * clock;
                }
                return Some(starts);
            }
            0x04 if self.open && self.updates[0] <= now => {
                (self.prescaler, self.updates[0]) = (value & 7, now + 5 * clock);
            }
            0x08 if self.open && self.updates[1] <= now => {
                (self.reload, self.updates[1]) = (value & 0xFFF, now + 5 * clock);
            }
            0x04..=0x0C => {}
            _ => return None,
        }
        Some(false)
    }
}

/// Behaviour of the generator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Randomness {
    /// It gives numbers.
    Good,
    /// It never has one.
    Never,
    /// A bad seed.
    BadSeed,
}

/// A number each 40 periods.
#[derive(Clone)]
pub struct Rng {
    /// How it behaves.
    pub behaves: Randomness,
    cr: u32,
    errors: u32,
    state: u64,
    ready: Ps,
    data: u32,
}

impl Rng {
    /// Seeded: repeatable.
    pub fn new(seed: u64) -> Self {
        Self { behaves: Randomness::Good, cr: 0, errors: 0, state: seed | 1, ready: NEVER, data: 0 }
    }

    /// A reset.
    pub fn reset(&mut self) {
        (self.cr, self.errors, self.ready, self.data) = (0, 0, NEVER, 0);
    }

    fn status(&self, now: Ps, pll48: u32) -> u32 {
        match self.behaves {
            // CECS and CEIS: its clock is missing.
            _ if self.cr & 4 != 0 && pll48 == 0 => 0x22,
            Randomness::Good => u32::from(self.ready <= now) | self.errors,
            Randomness::Never => self.errors,
            Randomness::BadSeed => self.errors | if self.cr & 4 != 0 { 0x44 } else { 0 },
        }
    }

    /// Time of the next number.
    pub fn deadline(&self) -> Ps {
        if self.cr & 0xC == 0xC && self.behaves == Randomness::Good { self.ready } else { NEVER }
    }

    /// The level of its interrupt.
    pub fn interrupts(&self, now: Ps, pll48: u32) -> bool {
        self.cr & 8 != 0 && self.status(now, pll48) & 0x61 != 0
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32, now: Ps, pll48: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.cr,
            0x04 => self.status(now, pll48),
            0x08 => {
                if self.status(now, pll48) & 1 != 0 {
                    self.state = self
                        .state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    self.data = (self.state >> 32) as u32;
                    self.ready = now + 40 * SECOND / u64::from(pll48.max(1));
                }
                self.data
            }
            _ => return None,
        })
    }

    /// Writes the register at this offset.
    pub fn write(&mut self, offset: u32, value: u32, now: Ps) -> Option<()> {
        match offset {
            0x00 => {
                if value & 4 != 0 && self.cr & 4 == 0 {
                    self.ready = now + US;
                }
                if value & 4 == 0 {
                    self.ready = NEVER;
                }
                self.cr = value & 0xC;
            }
            0x04 => self.errors &= value,
            0x08 => {}
            _ => return None,
        }
        Some(())
    }
}

/// CRC-32 of words, most significant bit first, 0x04C11DB7.
#[derive(Clone)]
pub struct Crc {
    sum: u32,
    idr: u32,
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc {
    /// As after a reset.
    pub fn new() -> Self {
        Self { sum: u32::MAX, idr: 0 }
    }

    /// The register at this offset.
    pub fn read(&self, offset: u32) -> Option<u32> {
        [self.sum, self.idr, 0].get(offset as usize / 4).copied()
    }

    /// Writes the register at this offset.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0 => {
                self.sum ^= value;
                for _ in 0..32 {
                    let carry = self.sum >> 31;
                    self.sum = (self.sum << 1) ^ (carry * 0x04C1_1DB7);
                }
            }
            4 => self.idr = value & 0xFF,
            8 if value & 1 == 1 => self.sum = u32::MAX,
            8 => {}
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::MS;

    #[test]
    fn the_watchdog_bites_after_its_second_by_its_own_clock() {
        // As the firmware sets it: 1 s at 32 kHz, prescaler 8, so 4,000.
        for (hz, ms) in [(17_000, 1_882), (32_000, 1_000), (47_000, 680)] {
            let mut iwdg = Iwdg::new(hz);
            assert_eq!(
                (iwdg.read(4, 0), iwdg.read(8, 0), iwdg.read(0xC, 0)),
                (Some(0), Some(0xFFF), Some(0))
            );
            for (offset, value) in [(4, 3), (0, 0x5555), (4, 1), (8, 3_999)] {
                assert_eq!(iwdg.write(offset, value, 0), Some(false));
            }
            assert_eq!(
                (iwdg.read(4, 0), iwdg.read(0xC, 0)),
                (Some(1), Some(3)),
                "locked before the key, then on their way"
            );
            assert_eq!(iwdg.write(0, 0xAAAA, 0), Some(false));
            assert_eq!(iwdg.deadline(), NEVER);
            assert_eq!(iwdg.write(0, 0xCCCC, 0), Some(true));
            assert_eq!(iwdg.deadline() / MS, ms);
            iwdg.write(0, 0xAAAA, 500 * MS);
            assert_eq!(iwdg.deadline() / MS, ms + 500);
            iwdg.write(0, 0, 500 * MS);
            assert!(iwdg.is_running(), "nothing but a reset stops it");
        }
    }

    #[test]
    fn random_numbers_come_in_time_or_never() {
        let mut rng = Rng::new(1);
        assert_eq!((rng.read(0, 0, 0), rng.read(4, 0, 0), rng.read(8, 0, 0)), (Some(0), Some(0), Some(0)));
        rng.write(0, 4, 0);
        assert_eq!(rng.read(4, 0, 48_000_000), Some(0));
        assert_eq!(rng.read(4, US, 48_000_000), Some(1));
        let first = rng.read(8, US, 48_000_000);
        assert_eq!(rng.read(4, US, 48_000_000), Some(0));
        assert_ne!(rng.read(8, 2 * US, 48_000_000), first);
        assert_eq!(rng.read(4, 2 * US, 0), Some(0x22), "without its clock");
        for (behaves, status) in [(Randomness::Never, 0), (Randomness::BadSeed, 0x44)] {
            rng.behaves = behaves;
            assert_eq!(rng.read(4, SECOND, 48_000_000), Some(status));
        }
    }

    #[test]
    fn the_crc_unit_gives_the_known_sum() {
        let mut crc = Crc::new();
        crc.write(0, 0x3132_3334);
        // CRC-32/MPEG-2 of "1234".
        assert_eq!(crc.read(0), Some(0xA695_C4AA));
        crc.write(8, 1);
        assert_eq!(crc.read(0), Some(u32::MAX));
    }
}
