//! Power control (RM0090, chapter 5). Not modelled: stop and standby (see `Machine`), the wake-up pin, BOR
//! levels.

/// Levels of the detector, mV, rising and falling, typical (DS8626, table 20).
const LEVELS: [(u32, u32); 8] = [
    (2_140, 2_040),
    (2_300, 2_190),
    (2_450, 2_350),
    (2_600, 2_510),
    (2_760, 2_660),
    (2_930, 2_820),
    (3_030, 2_930),
    (3_140, 3_030),
];
/// Held in reset below, started above (DS8626, table 20: PDR and POR).
const RESET: (u32, u32) = (1_680, 1_720);

/// Bits of `CR`.
const PVDE: u32 = 1 << 4;
const DBP: u32 = 1 << 8;
const BRE: u32 = 1 << 9;

/// PWR.
#[derive(Clone)]
pub struct Pwr {
    cr: u32,
    csr: u32,
    supply_mv: u32,
    /// Below the detector's level.
    is_low: bool,
    /// Held in reset by the supply.
    pub is_off: bool,
}

impl Default for Pwr {
    fn default() -> Self {
        Self::new()
    }
}

impl Pwr {
    /// With a good supply.
    pub fn new() -> Self {
        Self { cr: 0x4000, csr: 0, supply_mv: 3_300, is_low: false, is_off: false }
    }

    /// A reset of the chip.
    pub fn reset(&mut self) {
        *self = Self { supply_mv: self.supply_mv, is_off: self.is_off, ..Self::new() };
    }

    /// True: its reset begins or ends.
    pub fn set_supply(&mut self, mv: u32) -> bool {
        self.supply_mv = mv;
        self.detect();
        let was_off = self.is_off;
        self.is_off = mv < if was_off { RESET.1 } else { RESET.0 };
        was_off != self.is_off
    }

    fn detect(&mut self) {
        let (rising, falling) = LEVELS[(self.cr >> 5 & 7) as usize];
        let level = if self.is_low { rising } else { falling };
        self.is_low = self.cr & PVDE != 0 && self.supply_mv < level;
    }

    /// EXTI line 16: high while low.
    pub fn is_low(&self) -> bool {
        self.is_low
    }

    /// Writable backup domain.
    pub fn is_backup_unlocked(&self) -> bool {
        self.cr & DBP != 0
    }

    /// The register at this offset.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0 => Some(self.cr),
            // The regulator is always ready.
            4 => Some(self.csr | 1 << 14 | u32::from(self.is_low) << 2 | (self.csr & BRE) >> 6),
            _ => None,
        }
    }

    /// Writes the register at this offset.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            // CWUF and CSBF read as 0. Other chips only: the overdrive of the F42x. (Bit 15, the upper one
            // of their VOS, is reserved here, and written by embassy.)
            0 if value & !0xC3FF != 0 => return None,
            0 => self.cr = value & 0x43F3,
            4 => self.csr = value & (1 << 8 | BRE),
            _ => return None,
        }
        self.detect();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_detector_has_eight_levels_and_a_hysteresis() {
        for (level, (rising, falling)) in (0..).zip(LEVELS) {
            let mut pwr = Pwr::new();
            pwr.write(0, level << 5 | PVDE);
            for (mv, low) in
                [(3_300, false), (falling, false), (falling - 1, true), (rising - 1, true), (rising, false)]
            {
                pwr.set_supply(mv);
                assert_eq!(pwr.is_low(), low, "level {level}, {mv} mV");
                assert_eq!(pwr.read(4).map(|csr| csr >> 2 & 1), Some(u32::from(low)));
            }
        }
    }

    #[test]
    fn registers_have_the_manuals_reset_values() {
        let mut pwr = Pwr::new();
        assert_eq!((pwr.read(0), pwr.read(4), pwr.read(8)), (Some(0x4000), Some(0x4000), None));
        assert_eq!(pwr.write(0, 1 << 16), None, "the overdrive is the F42x's");
    }

    #[test]
    fn below_1_68_v_the_chip_is_off() {
        let mut pwr = Pwr::new();
        for (mv, changes, off) in
            [(1_700, false, false), (1_679, true, true), (1_719, false, true), (1_720, true, false)]
        {
            assert_eq!((pwr.set_supply(mv), pwr.is_off), (changes, off), "{mv} mV");
        }
    }
}
