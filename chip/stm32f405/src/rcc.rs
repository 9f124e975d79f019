//! Reset and clock control (RM0090, chapter 7; reset values of the STM32F405).
//!
//! Not modelled: interrupts of ready oscillators (an enabled one stops the machine), the clock outputs, spread
//! spectrum, `PLLI2S`'s output.

use crate::time::{MS, NEVER, Now, Ps, SECOND, US};

/// The internal oscillator.
const HSI_HZ: u32 = 16_000_000;
/// Start times: data sheet DS8626, tables 30 to 36, typical ones.
const HSI_START: Ps = 2_200_000;
const HSE_START: Ps = 2 * MS;
const LSI_START: Ps = 15 * US;
const LSE_START: Ps = 2 * SECOND;
const PLL_START: Ps = 100 * US;

/// Bits of `CR`.
const HSION: u32 = 1;
const HSIRDY: u32 = 1 << 1;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const HSEBYP: u32 = 1 << 18;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
const PLLI2SON: u32 = 1 << 26;
const PLLI2SRDY: u32 = 1 << 27;
/// Flag of the clock security system, and its clearing bit.
const CSSF: u32 = 1 << 7;
const CSSC: u32 = 1 << 23;

/// Bits of `CSR`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// POR, with pin's and brown-out's flag.
    Power,
    /// The reset pin.
    Pin,
    /// AIRCR.SYSRESETREQ.
    Software,
    /// The independent watchdog.
    Watchdog,
}

impl Cause {
    /// An internal reset pulls the pin low too (RM0090, 7.1.1).
    const fn flags(self) -> u32 {
        match self {
            Cause::Power => 0x0E00_0000,
            Cause::Pin => 1 << 26,
            Cause::Software => 1 << 28 | 1 << 26,
            Cause::Watchdog => 1 << 29 | 1 << 26,
        }
    }
}

/// Place among the registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bank {
    /// AHB1.
    Ahb1 = 0,
    /// AHB2.
    Ahb2 = 1,
    /// AHB3.
    Ahb3 = 2,
    /// APB1.
    Apb1 = 4,
    /// APB2.
    Apb2 = 5,
}

/// Hertz; 0: stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clocks {
    /// Processor, memories, DMA.
    pub hclk: u32,
    /// APB1 and APB2.
    pub pclk: [u32; 2],
    /// The timers of APB1 and APB2.
    pub timer: [u32; 2],
    /// USB, SDIO, random numbers.
    pub pll48: u32,
}

/// RCC.
#[derive(Clone)]
pub struct Rcc {
    cr: u32,
    pllcfgr: u32,
    cfgr: u32,
    cir: u32,
    resets: [u32; 6],
    gates: [u32; 6],
    sleep_gates: [u32; 6],
    bdcr: u32,
    csr: u32,
    sscgr: u32,
    plli2scfgr: u32,
    /// HSI, HSE, PLL, PLLI2S, LSI, LSE.
    since: [Ps; 6],
    /// Rate, and whether it swings.
    hse_hz: u32,
    hse_alive: bool,
}

const HSI: usize = 0;
const HSE: usize = 1;
const PLL: usize = 2;
const I2S: usize = 3;
const LSI: usize = 4;
const LSE: usize = 5;

impl Rcc {
    /// Clocks at power-on, with this crystal (or oscillator).
    pub fn new(hse_hz: u32) -> Self {
        let mut rcc = Self {
            cr: 0,
            pllcfgr: 0,
            cfgr: 0,
            cir: 0,
            resets: [0; 6],
            gates: [0; 6],
            sleep_gates: [0; 6],
            bdcr: 0,
            csr: 0,
            sscgr: 0,
            plli2scfgr: 0,
            since: [NEVER; 6],
            hse_hz,
            hse_alive: true,
        };
        rcc.reset(Cause::Power, 0);
        rcc
    }

    /// A reset: only power clears earlier flags and the backup domain.
    pub fn reset(&mut self, cause: Cause, now: Ps) {
        let is_power = cause == Cause::Power;
        let (bdcr, csr) = if is_power { (0, 0) } else { (self.bdcr, self.csr) };
        *self = Self {
            cr: 0x83,
            pllcfgr: 0x2400_3010,
            cfgr: 0,
            cir: 0,
            resets: [0; 6],
            gates: [0x0010_0000, 0, 0, 0, 0, 0],
            sleep_gates: [0x7E67_91FF, 0xF1, 1, 0, 0x36FE_C9FF, 0x0007_5F33],
            bdcr,
            csr: csr | cause.flags(),
            sscgr: 0,
            plli2scfgr: 0x2000_3000,
            since: [0, NEVER, NEVER, NEVER, if is_power { NEVER } else { self.since[LSI] }, NEVER],
            hse_hz: self.hse_hz,
            hse_alive: self.hse_alive,
        };
        if bdcr & 1 == 1 {
            self.since[LSE] = now;
        }
    }

    /// True: the clock security system saw it die (NMI).
    pub fn set_crystal(&mut self, alive: bool, now: Ps) -> bool {
        self.hse_alive = alive;
        self.since[HSE] = if alive && self.cr & HSEON != 0 { now } else { NEVER };
        if alive || self.cr & CSSON == 0 || self.cr & HSEON == 0 {
            return false;
        }
        // RM0090, 7.2.7: the internal oscillator takes over, HSE and a PLL that hangs on it are switched off.
        self.cr = self.cr & !(HSEON | CSSON) | HSION;
        self.since[HSI] = self.since[HSI].min(now);
        if self.pll_on_hse() {
            self.cr &= !PLLON;
            self.since[PLL] = NEVER;
        }
        self.cfgr &= !0xF;
        self.cir |= CSSF;
        true
    }

    /// Flagged: the NMI stays pending.
    pub fn has_failed(&self) -> bool {
        self.cir & CSSF != 0
    }

    /// The watchdog forces the low-speed oscillator on (RM0090, 7.2.5).
    pub fn force_lsi(&mut self, now: Ps) {
        self.csr |= 1;
        self.since[LSI] = self.since[LSI].min(now);
    }

    /// Divided by `RTCPRE`, mHz; 0 without it.
    pub fn crystal_for_rtc_mhz(&self, now: Ps) -> u64 {
        let divider = self.cfgr >> 16 & 0x1F;
        if divider < 2 || !self.is_ready(HSE, now) {
            0
        } else {
            u64::from(self.hse_hz) * 1_000 / u64::from(divider)
        }
    }

    /// Whether the PLL runs from the crystal.
    pub fn pll_on_hse(&self) -> bool {
        self.pllcfgr & 1 << 22 != 0
    }

    fn ready_at(&self, oscillator: usize) -> Ps {
        let pll_source = if self.pll_on_hse() { HSE } else { HSI };
        let (start, source) = match oscillator {
            HSI => (HSI_START, None),
            HSE => (if self.cr & HSEBYP == 0 { HSE_START } else { 0 }, None),
            PLL | I2S => (PLL_START, Some(pll_source)),
            LSI => (LSI_START, None),
            _ => (LSE_START, None),
        };
        if oscillator == HSE && !self.hse_alive {
            return NEVER;
        }
        let own = self.since[oscillator].saturating_add(start);
        source.map_or(own, |source| {
            let other = self.ready_at(source);
            if other == NEVER { NEVER } else { own.max(other.saturating_add(start)) }
        })
    }

    fn is_ready(&self, oscillator: usize, now: Ps) -> bool {
        // The internal oscillator runs when the reset ends.
        oscillator == HSI && self.since[HSI] == 0 || self.ready_at(oscillator) <= now
    }

    /// The chosen clock takes over when ready.
    pub fn settle(&mut self, now: Ps) {
        let chosen = self.cfgr & 3;
        if self.cfgr >> 2 & 3 != chosen && chosen < 3 && self.is_ready(chosen as usize, now) {
            self.cfgr = self.cfgr & !0xC | chosen << 2;
        }
    }

    /// When the clock that was chosen will be ready.
    pub fn deadline(&self) -> Ps {
        let chosen = self.cfgr & 3;
        if self.cfgr >> 2 & 3 == chosen || chosen == 3 { NEVER } else { self.ready_at(chosen as usize) }
    }

    /// All clocks as they are now.
    pub fn clocks(&self, now: Ps) -> Clocks {
        let source = if self.pll_on_hse() { self.hse_hz } else { HSI_HZ };
        let m = (self.pllcfgr & 0x3F).max(1);
        let vco = u64::from(source) * u64::from(self.pllcfgr >> 6 & 0x1FF) / u64::from(m);
        let runs = self.is_ready(PLL, now);
        let pll = |divider: u32| if runs && divider > 0 { (vco / u64::from(divider)) as u32 } else { 0 };
        let sysclk = match self.cfgr >> 2 & 3 {
            0 => HSI_HZ,
            1 if self.is_ready(HSE, now) => self.hse_hz,
            2 => pll(2 * ((self.pllcfgr >> 16 & 3) + 1)),
            _ => 0,
        };
        let hclk = sysclk >> [0, 1, 2, 3, 4, 6, 7, 8, 9][(self.cfgr >> 4 & 0xF).saturating_sub(7) as usize];
        let apb = [self.cfgr >> 10 & 7, self.cfgr >> 13 & 7].map(|bits| bits.saturating_sub(3));
        Clocks {
            hclk,
            pclk: apb.map(|shift| hclk >> shift),
            timer: apb.map(|shift| if shift == 0 { hclk } else { hclk >> (shift - 1) }),
            pll48: pll(self.pllcfgr >> 24 & 0xF),
        }
    }

    /// The device's clock runs.
    pub fn is_on(&self, bank: Bank, bit: u8) -> bool {
        self.gates[bank as usize] >> bit & 1 == 1
    }

    /// The device is held.
    pub fn is_held(&self, bank: Bank, bit: u8) -> bool {
        self.resets[bank as usize] >> bit & 1 == 1
    }

    /// `None`: there is none.
    pub fn read(&self, offset: u32, now: Now) -> Option<u32> {
        let ready = |oscillator, bit| if self.is_ready(oscillator, now.ps) { bit } else { 0 };
        Some(match offset {
            0x00 => {
                let flags =
                    ready(HSI, HSIRDY) | ready(HSE, HSERDY) | ready(PLL, PLLRDY) | ready(I2S, PLLI2SRDY);
                self.cr & !(HSIRDY | HSERDY | PLLRDY | PLLI2SRDY) | flags
            }
            0x04 => self.pllcfgr,
            0x08 => self.cfgr,
            0x0C => self.cir,
            0x10..=0x24 if offset != 0x1C => self.resets[(offset as usize - 0x10) / 4],
            0x30..=0x44 if offset != 0x3C => self.gates[(offset as usize - 0x30) / 4],
            0x50..=0x64 if offset != 0x5C => self.sleep_gates[(offset as usize - 0x50) / 4],
            0x70 => self.bdcr & !2 | ready(LSE, 2),
            0x74 => self.csr & !2 | ready(LSI, 2),
            0x80 => self.sscgr,
            0x84 => self.plli2scfgr,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: Now, backup_unlocked: bool) -> Option<()> {
        match offset {
            0x00 => self.write_cr(value, now.ps),
            // RM0090: only while the PLL is off, and only while the backup domain is open.
            0x04 if self.cr & PLLON != 0 => {}
            0x70 if !backup_unlocked => {}
            0x04 => self.pllcfgr = value & 0x0F43_7FFF,
            0x08 => self.cfgr = self.cfgr & 0xC | value & !0xC & 0xFFFF_FCF3,
            0x0C if value & 0x3F00 != 0 => return None,
            0x0C => {
                if value & CSSC != 0 {
                    self.cir &= !CSSF;
                }
            }
            0x10..=0x24 if offset != 0x1C => self.resets[(offset as usize - 0x10) / 4] = value,
            0x30..=0x44 if offset != 0x3C => self.gates[(offset as usize - 0x30) / 4] = value,
            0x50..=0x64 if offset != 0x5C => self.sleep_gates[(offset as usize - 0x50) / 4] = value,
            0x70 => self.write_bdcr(value, now.ps),
            0x74 => {
                if value & 1 << 24 != 0 {
                    self.csr &= 0x00FF_FFFF;
                }
                self.csr = self.csr & !1 | value & 1;
                Self::switch(&mut self.since[LSI], value & 1 != 0, now.ps);
            }
            0x80 => self.sscgr = value & 0xCFFF_FFFF,
            0x84 => self.plli2scfgr = value & 0x7000_7FC0,
            _ => return None,
        }
        self.settle(now.ps);
        Some(())
    }

    fn write_cr(&mut self, value: u32, now: Ps) {
        let mut kept = value & (HSION | 0xF8 | HSEON | HSEBYP | CSSON | PLLON | PLLI2SON);
        // The processor's clock source cannot be switched off.
        let by_pll = self.cfgr >> 2 & 3 == 2;
        match self.cfgr >> 2 & 3 {
            0 => kept |= HSION,
            1 => kept |= HSEON,
            _ => kept |= PLLON,
        }
        if by_pll {
            kept |= if self.pll_on_hse() { HSEON } else { HSION };
        }
        if self.cr & HSEON != 0 {
            kept = kept & !HSEBYP | self.cr & HSEBYP;
        }
        self.cr = kept;
        for (oscillator, bit) in [(HSI, HSION), (HSE, HSEON), (PLL, PLLON), (I2S, PLLI2SON)] {
            Self::switch(&mut self.since[oscillator], kept & bit != 0, now);
        }
    }

    fn write_bdcr(&mut self, value: u32, now: Ps) {
        if value & 1 << 16 != 0 {
            self.bdcr = 1 << 16;
            self.since[LSE] = NEVER;
            return;
        }
        // The clock of the real-time clock is chosen once (RM0090, 7.3.20).
        let chosen = if self.bdcr & 0x300 == 0 { value & 0x300 } else { self.bdcr & 0x300 };
        self.bdcr = value & 0x8005 | chosen;
        Self::switch(&mut self.since[LSE], value & 1 != 0, now);
    }

    fn switch(since: &mut Ps, on: bool, now: Ps) {
        if !on {
            *since = NEVER;
        } else if *since == NEVER {
            *since = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ps: Ps) -> Now {
        Now { cycle: 0, ps }
    }

    #[test]
    fn registers_have_the_manuals_reset_values() {
        let rcc = Rcc::new(8_000_000);
        let values = [
            (0x00, 0x83),
            (0x04, 0x2400_3010),
            (0x08, 0),
            (0x0C, 0),
            (0x10, 0),
            (0x14, 0),
            (0x18, 0),
            (0x20, 0),
            (0x24, 0),
            (0x30, 0x0010_0000),
            (0x34, 0),
            (0x38, 0),
            (0x40, 0),
            (0x44, 0),
            (0x50, 0x7E67_91FF),
            (0x54, 0xF1),
            (0x58, 1),
            (0x60, 0x36FE_C9FF),
            (0x64, 0x0007_5F33),
            (0x70, 0),
            (0x74, 0x0E00_0000),
            (0x80, 0),
            (0x84, 0x2000_3000),
        ];
        for (offset, value) in values {
            assert_eq!(rcc.read(offset, at(0)), Some(value), "{offset:#x}");
        }
        for offset in [0x1C, 0x28, 0x3C, 0x48, 0x5C, 0x68, 0x78, 0x8C] {
            assert_eq!(rcc.read(offset, at(0)), None, "{offset:#x}");
        }
    }

    /// 168 MHz from 8 MHz, as the F405 starts.
    fn started(rcc: &mut Rcc) -> Option<Ps> {
        let mut now = 0;
        rcc.write(0x00, 0x83 | HSEON, at(now), false)?;
        for (bit, on) in [(HSERDY, 0), (PLLRDY, PLLON)] {
            rcc.write(0x04, 4 | 168 << 6 | 1 << 22 | 7 << 24, at(now), false)?;
            let cr = rcc.read(0, at(now))?;
            rcc.write(0x00, cr | on, at(now), false)?;
            while rcc.read(0, at(now))? & bit == 0 {
                now += 10 * US;
                if now > SECOND {
                    return None;
                }
            }
        }
        rcc.write(0x08, 2 | 5 << 10 | 4 << 13, at(now), false)?;
        Some(now)
    }

    #[test]
    fn the_pll_makes_168_mhz_of_8() {
        let mut rcc = Rcc::new(8_000_000);
        assert_eq!(rcc.clocks(0).hclk, 16_000_000);
        let now = started(&mut rcc).expect("it starts");
        assert!((2 * MS..3 * MS).contains(&now), "{now}");
        let wanted = Clocks {
            hclk: 168_000_000,
            pclk: [42_000_000, 84_000_000],
            timer: [84_000_000, 168_000_000],
            pll48: 48_000_000,
        };
        assert_eq!(rcc.clocks(now), wanted);
        assert_eq!(rcc.read(8, at(now)).map(|cfgr| cfgr >> 2 & 3), Some(2));
    }

    #[test]
    fn a_dead_crystal_is_never_ready_and_one_that_dies_stops_the_clock() {
        let mut rcc = Rcc::new(8_000_000);
        rcc.set_crystal(false, 0);
        assert_eq!(started(&mut rcc), None);
        let mut rcc = Rcc::new(8_000_000);
        let now = started(&mut rcc).expect("it starts");
        assert!(!rcc.set_crystal(false, now));
        assert_eq!(rcc.clocks(now).hclk, 0);
        rcc.reset(Cause::Watchdog, now);
        assert_eq!(rcc.clocks(now).hclk, 16_000_000);
        assert_eq!(rcc.read(0x74, at(now)), Some(0x2E00_0000));
    }

    #[test]
    fn the_clock_security_system_goes_on_with_the_internal_oscillator() {
        let mut rcc = Rcc::new(8_000_000);
        let now = started(&mut rcc).expect("it starts");
        let cr = rcc.read(0, at(now)).expect("there is CR");
        rcc.write(0, cr | CSSON, at(now), false);
        assert!(rcc.set_crystal(false, now));
        assert_eq!(rcc.clocks(now).hclk, 16_000_000);
        assert!(rcc.has_failed());
        rcc.write(0x0C, CSSC, at(now), false);
        assert!(!rcc.has_failed());
    }

    #[test]
    fn the_backup_domain_is_locked_and_its_clock_chosen_once() {
        let mut rcc = Rcc::new(8_000_000);
        rcc.write(0x70, 0x8200, at(0), false);
        assert_eq!(rcc.read(0x70, at(0)), Some(0));
        rcc.write(0x70, 0x8200, at(0), true);
        rcc.write(0x70, 0x8100, at(0), true);
        assert_eq!(rcc.read(0x70, at(0)), Some(0x8200));
        rcc.reset(Cause::Software, 0);
        assert_eq!(rcc.read(0x70, at(0)), Some(0x8200));
        rcc.write(0x70, 1 << 16, at(0), true);
        rcc.write(0x70, 0x8100, at(0), true);
        assert_eq!(rcc.read(0x70, at(0)), Some(0x8100));
    }
}
