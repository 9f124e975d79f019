//! Flags, ITSTATE, the exception's number.

/// APSR: conditions, saturation, parallel additions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "flags of the processor")]
pub(crate) struct Flags {
    pub(crate) n: bool,
    pub(crate) z: bool,
    pub(crate) c: bool,
    pub(crate) v: bool,
    pub(crate) q: bool,
    /// GE, four bits.
    pub(crate) ge: u8,
}

impl Flags {
    #[inline(always)]
    pub(crate) fn nz(&mut self, result: u32) {
        self.n = result >> 31 == 1;
        self.z = result == 0;
    }

    pub(crate) fn apsr(self) -> u32 {
        u32::from(self.n) << 31
            | u32::from(self.z) << 30
            | u32::from(self.c) << 29
            | u32::from(self.v) << 28
            | u32::from(self.q) << 27
            | u32::from(self.ge) << 16
    }

    pub(crate) fn set_nzcvq(&mut self, apsr: u32) {
        self.set_nzcv(apsr);
        self.q = apsr >> 27 & 1 == 1;
    }

    pub(crate) fn set_nzcv(&mut self, apsr: u32) {
        self.n = apsr >> 31 == 1;
        self.z = apsr >> 30 & 1 == 1;
        self.c = apsr >> 29 & 1 == 1;
        self.v = apsr >> 28 & 1 == 1;
    }

    pub(crate) fn set_ge(&mut self, apsr: u32) {
        self.ge = (apsr >> 16 & 15) as u8;
    }

    #[inline(always)]
    pub(crate) fn holds(self, condition: u8) -> bool {
        let base = match condition >> 1 {
            0 => self.z,
            1 => self.c,
            2 => self.n,
            3 => self.v,
            4 => self.c && !self.z,
            5 => self.n == self.v,
            6 => !self.z && self.n == self.v,
            _ => return true,
        };
        base != (condition & 1 == 1)
    }
}

/// EPSR with ITSTATE in its two places.
pub(crate) fn epsr(it: u8, thumb: bool) -> u32 {
    u32::from(it & 3) << 25 | u32::from(it >> 2) << 10 | u32::from(thumb) << 24
}

/// ITSTATE of a program status word.
pub(crate) fn it_of(xpsr: u32) -> u8 {
    (xpsr >> 25 & 3) as u8 | (xpsr >> 8 & 0xFC) as u8
}
