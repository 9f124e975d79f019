//! TIM11 (RM0090, chapter 19) as a meter: captures at each eighth edge of the crystal divided by `RTCPRE`. Other uses stop the
//! machine.

use crate::time::{Ps, SECOND};

/// `CC1S`, `IC1PSC`.
const EACH_EIGHTH: u32 = 0b1101;
/// `TI1_RMP`.
const CRYSTAL: u32 = 2;
const CC1IF: u32 = 1 << 1;
const EDGES: u64 = 8;

/// The timer's clocks at the moment of an access.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    /// The moment.
    pub ps: Ps,
    /// The timer's clock.
    pub timer_hz: u32,
    /// Divided by `RTCPRE`, mHz; 0 without it.
    pub edges_mhz: u64,
}

/// The timer.
#[derive(Clone, Debug, Default)]
pub struct Tim11 {
    cr1: u32,
    ccmr: u32,
    ccer: u32,
    or: u32,
    /// Last one read.
    read: u64,
}

impl Tim11 {
    /// A reset.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn captures(&self, input: Input) -> (u64, Ps) {
        let is_on = self.cr1 & self.ccer == 1 && self.ccmr == EACH_EIGHTH && self.or == CRYSTAL;
        if !is_on || input.edges_mhz == 0 {
            return (self.read, 0);
        }
        let period = (u128::from(SECOND) * 1_000 * u128::from(EDGES) / u128::from(input.edges_mhz)) as u64;
        (input.ps / period, input.ps / period * period)
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32, input: Input) -> Option<u32> {
        let (number, at) = self.captures(input);
        Some(match offset {
            0x00 => self.cr1,
            0x10 => {
                if number > self.read {
                    CC1IF
                } else {
                    0
                }
            }
            0x18 => self.ccmr,
            0x20 => self.ccer,
            0x34 => {
                self.read = number;
                let count = u128::from(at) * u128::from(input.timer_hz) / u128::from(SECOND);
                count as u32 & 0xFFFF
            }
            0x50 => self.or,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, input: Input) -> Option<()> {
        match offset {
            0x00 if value < 2 => self.cr1 = value,
            0x18 if matches!(value, 0 | EACH_EIGHTH) => self.ccmr = value,
            0x20 if value < 2 => self.ccer = value,
            0x50 if matches!(value, 0 | CRYSTAL) => self.or = value,
            _ => return None,
        }
        // Only later captures count.
        self.read = self.captures(input).0.max(self.read);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::US;

    #[test]
    fn captures_are_a_period_of_the_divided_crystal_apart() {
        let mut tim = Tim11::default();
        let at = |us: u64| Input { ps: us * US, timer_hz: 16_000_000, edges_mhz: 8_000_000_000 / 31 };
        for (offset, value) in [(0x50, CRYSTAL), (0x18, EACH_EIGHTH), (0x20, 1), (0x00, 1)] {
            assert_eq!(tim.write(offset, value, at(1)), Some(()), "{offset:#x}");
        }
        assert_eq!(tim.read(0x10, at(30)), Some(0));
        assert_eq!((tim.read(0x10, at(32)), tim.read(0x34, at(32))), (Some(CC1IF), Some(496)));
        assert_eq!(tim.read(0x10, at(33)), Some(0));
        assert_eq!(tim.read(0x34, at(63)), Some(992));
        assert_eq!((tim.write(0x18, 1, at(64)), tim.read(0x24, at(64))), (None, None));
        let dead = Input { edges_mhz: 0, ..at(1_000) };
        assert_eq!(tim.read(0x10, dead), Some(0));
    }
}
