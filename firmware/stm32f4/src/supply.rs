//! The voltage detector (PVD, RM0090, 5.2.3). Below 2.7 V the flash takes no 32 bits at once (table 7), and a microSD card is out
//! of specification (SD specification, 6.6).

use stm32_metapac::{PWR, RCC};

/// 2.7 V falling, the sixth of the detector's eight levels (RM0090, 5.4.1).
const LEVEL_2V7: u8 = 0b101;

/// Turns it on.
pub fn watch() {
    RCC.apb1enr().modify(|w| w.set_pwren(true));
    PWR.cr1().modify(|w| {
        w.set_pls(LEVEL_2V7);
        w.set_pvde(true);
    });
}

/// Whether the supply is below the level.
pub fn is_low() -> bool {
    PWR.csr1().read().pvdo()
}
