//! Registers that only hold their written value.

/// CFSR: MMFSR, BFSR and the halfword UFSR.
pub(crate) const IACCVIOL: u32 = 1;
pub(crate) const DACCVIOL: u32 = 1 << 1;
pub(crate) const MUNSTKERR: u32 = 1 << 3;
pub(crate) const MSTKERR: u32 = 1 << 4;
pub(crate) const MLSPERR: u32 = 1 << 5;
pub(crate) const MMARVALID: u32 = 1 << 7;
pub(crate) const IBUSERR: u32 = 1 << 8;
pub(crate) const PRECISERR: u32 = 1 << 9;
pub(crate) const IMPRECISERR: u32 = 1 << 10;
pub(crate) const UNSTKERR: u32 = 1 << 11;
pub(crate) const STKERR: u32 = 1 << 12;
pub(crate) const LSPERR: u32 = 1 << 13;
pub(crate) const BFARVALID: u32 = 1 << 15;
pub(crate) const UNDEFINSTR: u32 = 1 << 16;
pub(crate) const INVSTATE: u32 = 1 << 17;
pub(crate) const INVPC: u32 = 1 << 18;
pub(crate) const NOCP: u32 = 1 << 19;
pub(crate) const UNALIGNED: u32 = 1 << 24;
pub(crate) const DIVBYZERO: u32 = 1 << 25;

/// Bits of HFSR.
pub(crate) const VECTTBL: u32 = 1 << 1;
pub(crate) const FORCED: u32 = 1 << 30;
pub(crate) const DEBUGEVT: u32 = 1 << 31;

/// Bits of CCR.
pub(crate) const NONBASETHRDENA: u32 = 1;
const USERSETMPEND: u32 = 1 << 1;
pub(crate) const UNALIGN_TRP: u32 = 1 << 3;
pub(crate) const DIV_0_TRP: u32 = 1 << 4;
pub(crate) const BFHFNMIGN: u32 = 1 << 8;
pub(crate) const STKALIGN: u32 = 1 << 9;

/// Bits of FPCCR.
pub(crate) const ASPEN: u32 = 1 << 31;
pub(crate) const LSPEN: u32 = 1 << 30;
pub(crate) const LSPACT: u32 = 1;

/// Implemented bits.
pub(crate) const FPSCR: u32 = 0xF7C0_009F;

pub(crate) const FPDSCR: u32 = 0x07C0_0000;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Control {
    pub(crate) actlr: u32,
    pub(crate) vtor: u32,
    pub(crate) scr: u32,
    pub(crate) ccr: u32,
    pub(crate) cfsr: u32,
    pub(crate) hfsr: u32,
    pub(crate) mmfar: u32,
    pub(crate) bfar: u32,
    pub(crate) cpacr: u32,
    pub(crate) fpccr: u32,
    pub(crate) fpcar: u32,
    pub(crate) fpdscr: u32,
    pub(crate) demcr: u32,
    pub(crate) dwt: u32,
    /// Offset from cycles to CYCCNT while it counts; else its value.
    pub(crate) cyccnt: u32,
}

impl Default for Control {
    fn default() -> Self {
        Control {
            actlr: 0,
            vtor: 0,
            scr: 0,
            ccr: STKALIGN,
            cfsr: 0,
            hfsr: 0,
            mmfar: 0,
            bfar: 0,
            cpacr: 0,
            fpccr: ASPEN | LSPEN,
            fpcar: 0,
            fpdscr: 0,
            demcr: 0,
            dwt: 0,
            cyccnt: 0,
        }
    }
}

impl Control {
    /// `DEMCR.MON_EN`: breakpoints go to the debug monitor.
    pub(crate) fn monitors(&self) -> bool {
        self.demcr >> 16 & 1 == 1
    }

    /// STIR, if CCR allows it.
    pub(crate) fn user_may(&self, address: u32, write: bool) -> bool {
        address == 0xE000_EF00 && write && self.ccr & USERSETMPEND != 0
    }
}
