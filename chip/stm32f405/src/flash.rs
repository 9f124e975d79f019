//! The flash and its controller (RM0090, chapter 3); [`crate::art`] counts wait states. Erases and programming take the data
//! sheet's time, and reads wait. Errors are flagged. A power cut leaves a half-erased sector.
//!
//! Not modelled: programming of option bytes (it stops the machine), read protection, the OTP area's writing.

use cortex_m4_model::Size;

use crate::memory::{FLASH, Memory};
use crate::time::{MS, NEVER, Ps, US};

/// Bits of `SR`.
const EOP: u32 = 1;
const WRPERR: u32 = 1 << 4;
const PGAERR: u32 = 1 << 5;
const PGPERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;
const ERRORS: u32 = 0xF2;
/// Bits of `CR`.
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const MER: u32 = 1 << 2;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;
/// `OPTCR` as delivered: nothing protected.
const OPTCR: u32 = 0x0FFF_AAED;

/// Erase by x8, x16 and x32 (x64 with its own supply), ms: typical and longest; DS8626, table 40.
const ERASE_16K: [(u64, u64); 4] = [(400, 800), (300, 600), (250, 500), (230, 460)];
const ERASE_64K: [(u64, u64); 4] = [(1_200, 2_400), (700, 1_400), (550, 1_100), (490, 980)];
const ERASE_128K: [(u64, u64); 4] = [(2_000, 4_000), (1_300, 2_600), (1_000, 2_000), (875, 1_750)];
const ERASE_ALL: [(u64, u64); 4] = [(16_000, 32_000), (11_000, 22_000), (8_000, 16_000), (6_900, 13_800)];
const PROGRAM: (Ps, Ps) = (16 * US, 100 * US);

/// How fast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Typical.
    Typical,
    /// Its longest.
    Longest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    Erase { from: u32, bytes: u32 },
    Program { at: u32, size: Size, before: u32 },
}

/// The flash.
#[derive(Clone)]
pub struct Flash {
    /// The content.
    pub content: Memory,
    /// How fast it is.
    pub speed: Speed,
    /// Words still to be refused.
    pub refuses: u32,
    acr: u32,
    sr: u32,
    cr: u32,
    optcr: u32,
    /// `None`: a wrong one locks until a reset.
    keys: Option<u8>,
    option_keys: Option<u8>,
    work: Option<(Work, Ps, Ps)>,
    /// Finished early for a waiting processor, with the content before.
    ahead: Option<(Work, Ps, Ps, Vec<u8>)>,
    /// Erases and words.
    pub counts: (u64, u64),
    /// Sector's offset, start and length, ps.
    pub erases: Vec<(u32, Ps, Ps)>,
}

/// Start and length.
pub fn sector(number: u32) -> Option<(u32, u32)> {
    match number {
        0..=3 => Some((number * 0x4000, 0x4000)),
        4 => Some((0x1_0000, 0x1_0000)),
        5..=11 => Some(((number - 4) * 0x2_0000, 0x2_0000)),
        _ => None,
    }
}

fn sector_at(offset: u32) -> u32 {
    (0..12)
        .find(|number| sector(*number).is_some_and(|(from, bytes)| (from..from + bytes).contains(&offset)))
        .unwrap_or(11)
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}

impl Flash {
    /// An empty one, as delivered.
    pub fn new() -> Self {
        Self {
            content: Memory::new(FLASH.1, 0xFF),
            speed: Speed::Typical,
            refuses: 0,
            acr: 0,
            sr: 0,
            cr: LOCK,
            optcr: OPTCR,
            keys: Some(0),
            option_keys: Some(0),
            work: None,
            ahead: None,
            counts: (0, 0),
            erases: Vec::new(),
        }
    }

    /// Like a power cut in mid-work.
    pub fn reset(&mut self, now: Ps) {
        self.cut(now);
        (self.acr, self.sr, self.cr, self.optcr) = (0, 0, LOCK, OPTCR);
        (self.keys, self.option_keys) = (Some(0), Some(0));
    }

    /// `ACR`, for the accelerator.
    pub fn acr(&self) -> u32 {
        self.acr
    }

    /// Reads are answered then.
    pub fn busy_until(&self) -> Option<Ps> {
        self.work.map(|(_, _, end)| end)
    }

    /// When its work is done.
    pub fn deadline(&self) -> Ps {
        self.busy_until().unwrap_or(NEVER)
    }

    /// Finishes work at its time; returns start and length of changed bytes.
    pub fn happen(&mut self, now: Ps) -> Option<(u32, u32)> {
        let (work, _, _) = self.work.take_if(|(_, _, end)| *end <= now)?;
        if self.cr & EOPIE != 0 {
            self.sr |= EOP;
        }
        self.cr &= !STRT;
        match work {
            Work::Erase { from, bytes } => {
                self.content.all_mut()[from as usize..(from + bytes) as usize].fill(0xFF);
                Some((from, bytes))
            }
            Work::Program { at, size, .. } => Some((at, size.bytes())),
        }
    }

    /// Does the work now for a waiting processor; returns its end. An earlier cut takes it back.
    pub fn finish(&mut self) -> Option<(Ps, (u32, u32))> {
        let (work, begin, end) = self.work?;
        let (from, bytes) = match work {
            Work::Erase { from, bytes } => (from, bytes),
            Work::Program { at, size, .. } => (at, size.bytes()),
        };
        let before = self.content.all()[from as usize..(from + bytes) as usize].to_vec();
        self.happen(end);
        self.ahead = Some((work, begin, end, before));
        Some((end, (from, bytes)))
    }

    /// Work cut by power or a reset: bits are somewhere between.
    pub fn cut(&mut self, now: Ps) {
        if let Some((work, begin, end, before)) = self.ahead.take().filter(|(_, _, end, _)| *end > now) {
            let (Work::Erase { from: at, .. } | Work::Program { at, .. }) = work;
            self.content.all_mut()[at as usize..at as usize + before.len()].copy_from_slice(&before);
            self.work = Some((work, begin, end));
        }
        let Some((work, begin, end)) = self.work.take() else { return };
        let part = (now.saturating_sub(begin) * 256 / (end - begin).max(1)).min(256) as u32;
        let mut state = begin | 1;
        let mut bits = |likely: u32| {
            let mut mask = 0_u8;
            for bit in 0..8 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                mask |= u8::from(((state >> 56) as u32) < likely) << bit;
            }
            mask
        };
        match work {
            Work::Erase { from, bytes } => {
                for byte in &mut self.content.all_mut()[from as usize..(from + bytes) as usize] {
                    *byte |= bits(part);
                }
            }
            Work::Program { at, size, before } => {
                let before = before.to_le_bytes();
                let bytes = &mut self.content.all_mut()[at as usize..(at + size.bytes()) as usize];
                for (byte, before) in bytes.iter_mut().zip(before) {
                    *byte |= before & bits(256 - part);
                }
            }
        }
    }

    /// Must not be busy; false if the bus refuses.
    pub fn program(&mut self, at: u32, size: Size, value: u32, now: Ps) {
        let width = 8 << (self.cr >> 8 & 3);
        let refused = std::mem::take(&mut self.refuses);
        self.refuses = refused.saturating_sub(u32::from(self.cr & PG != 0));
        if self.cr & LOCK != 0 || self.cr & PG == 0 {
            self.sr |= PGSERR;
        } else if size.bytes() * 8 != width {
            self.sr |= PGPERR;
        } else if refused > 0 || self.optcr >> (16 + sector_at(at)) & 1 == 0 {
            self.sr |= WRPERR;
        } else if let Some(before) = self.content.get(at, size) {
            let time = if self.speed == Speed::Typical { PROGRAM.0 } else { PROGRAM.1 };
            let _ = self.content.set(at, size, before & value);
            self.work = Some((Work::Program { at, size, before }, now, now + time));
            self.counts.1 += 1;
        } else {
            self.sr |= PGAERR;
        }
    }

    fn erase(&mut self, now: Ps) {
        let by = (self.cr >> 8 & 3) as usize;
        let number = self.cr >> 3 & 0xF;
        let place = if self.cr & MER != 0 { Some((0, FLASH.1)) } else { sector(number) };
        let Some((from, bytes)) = place else {
            self.sr |= PGSERR;
            return;
        };
        let times = match bytes {
            0x4000 => ERASE_16K,
            0x1_0000 => ERASE_64K,
            0x2_0000 => ERASE_128K,
            _ => ERASE_ALL,
        };
        if self.optcr >> 16 & 0xFFF != 0xFFF && self.optcr >> (16 + number) & 1 == 0 {
            self.sr |= WRPERR;
            return;
        }
        let (typical, longest) = times[by];
        let time = MS * if self.speed == Speed::Typical { typical } else { longest };
        self.counts.0 += 1;
        self.erases.push((from, now, time));
        self.work = Some((Work::Erase { from, bytes }, now, now + time));
    }

    /// The level of its interrupt.
    pub fn interrupts(&self) -> bool {
        self.sr & EOP != 0 && self.cr & EOPIE != 0 || self.sr & ERRORS != 0 && self.cr & ERRIE != 0
    }

    /// The register at this offset.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.acr,
            0x04 | 0x08 => 0,
            0x0C => self.sr | if self.work.is_some() { BSY } else { 0 },
            0x10 => self.cr,
            0x14 => self.optcr,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: Ps) -> Option<()> {
        match offset {
            0x00 => self.acr = value & 0x1F07,
            0x04 => Self::key(&mut self.keys, value, [0x4567_0123, 0xCDEF_89AB], &mut self.cr, LOCK),
            0x08 => Self::key(&mut self.option_keys, value, [0x0819_2A3B, 0x4C5D_6E7F], &mut self.optcr, 1),
            0x0C => self.sr &= !(value & (EOP | ERRORS)),
            0x10 => {
                if self.cr & LOCK != 0 || self.work.is_some() {
                    return Some(());
                }
                self.cr = value & 0x8301_037F;
                if value & LOCK != 0 {
                    self.keys = Some(0);
                }
                if value & STRT != 0 && value & (SER | MER) != 0 {
                    self.erase(now);
                }
            }
            0x14 if self.optcr & 1 != 0 => {}
            0x14 if value & 2 != 0 => return None,
            0x14 => self.optcr = value & 0x0FFF_FFED,
            _ => return None,
        }
        Some(())
    }

    fn key(keys: &mut Option<u8>, value: u32, wanted: [u32; 2], register: &mut u32, lock: u32) {
        let Some(taken) = *keys else { return };
        if wanted.get(taken as usize) != Some(&value) {
            *keys = None;
            return;
        }
        *keys = Some(taken + 1);
        if taken == 1 {
            *register &= !lock;
            *keys = Some(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unlocked() -> Flash {
        let mut flash = Flash::new();
        flash.write(4, 0x4567_0123, 0);
        flash.write(4, 0xCDEF_89AB, 0);
        flash
    }

    #[test]
    fn registers_have_the_manuals_reset_values() {
        for (offset, value) in [(0, 0), (4, 0), (8, 0), (0xC, 0), (0x10, 0x8000_0000), (0x14, 0x0FFF_AAED)] {
            assert_eq!(Flash::new().read(offset), Some(value), "{offset:#x}");
        }
        assert_eq!(Flash::new().read(0x18), None);
    }

    #[test]
    fn only_two_right_keys_unlock() {
        assert_eq!(unlocked().read(0x10), Some(0));
        let mut flash = Flash::new();
        for key in [0x4567_0123, 1, 0x4567_0123, 0xCDEF_89AB] {
            flash.write(4, key, 0);
        }
        assert_eq!(flash.read(0x10), Some(LOCK), "a wrong key locks until the next reset");
        flash.reset(0);
        flash.write(4, 0x4567_0123, 0);
        flash.write(4, 0xCDEF_89AB, 0);
        assert_eq!(flash.read(0x10), Some(0));
    }

    #[test]
    fn an_erase_takes_the_data_sheets_time() {
        let cases =
            [(1, 0, 400, 800), (1, 1, 300, 600), (1, 2, 250, 500), (4, 2, 550, 1_100), (11, 0, 2_000, 4_000)];
        for (number, by, typical, longest) in cases {
            for (speed, ms) in [(Speed::Typical, typical), (Speed::Longest, longest)] {
                let mut flash = unlocked();
                flash.speed = speed;
                let (from, _) = sector(number).expect("there is that sector");
                let _ = flash.content.set(from, Size::Word, 0x1234_5678);
                flash.write(0x10, SER | number << 3 | by << 8, 5);
                flash.write(0x10, SER | number << 3 | by << 8 | STRT, 5);
                assert_eq!(flash.deadline(), 5 + ms * MS);
                assert_eq!(flash.read(0xC), Some(BSY));
                assert_eq!(flash.happen(4 + ms * MS), None);
                assert_eq!(flash.content.get(from, Size::Word), Some(0x1234_5678));
                assert!(flash.happen(5 + ms * MS).is_some());
                assert_eq!(flash.content.get(from, Size::Word), Some(u32::MAX));
                assert_eq!(flash.read(0xC), Some(0));
            }
        }
    }

    #[test]
    fn a_store_is_checked_as_the_manual_says() {
        let cases = [
            (PG | 2 << 8, Size::Word, 0),
            (PG, Size::Byte, 0),
            (PG | 1 << 8, Size::Half, 0),
            (PG, Size::Word, PGPERR),
            (PG | 2 << 8, Size::Byte, PGPERR),
            (2 << 8, Size::Word, PGSERR),
        ];
        for (cr, size, error) in cases {
            let mut flash = unlocked();
            flash.write(0x10, cr, 0);
            flash.program(0x4000, size, 0x5A5A_5A5A, 0);
            flash.happen(100 * US);
            assert_eq!(flash.read(0xC), Some(error), "{cr:#x} {size:?}");
        }
        let mut flash = unlocked();
        flash.write(0x10, PG | 2 << 8, 0);
        for (value, held) in [(0xFFFF_00FF, 0xFFFF_00FF), (0x0F0F_FFFF, 0x0F0F_00FF)] {
            flash.program(0x4000, Size::Word, value, 0);
            flash.happen(16 * US);
            assert_eq!(flash.content.get(0x4000, Size::Word), Some(held), "bits go one way");
        }
        flash.refuses = 1;
        flash.program(0x4000, Size::Word, 0, 0);
        assert_eq!(flash.read(0xC), Some(WRPERR));
    }

    #[test]
    fn a_cut_in_an_erase_leaves_a_sector_between() {
        let mut flash = unlocked();
        flash.content.all_mut()[0x4000..0x8000].fill(0);
        flash.write(0x10, SER | 1 << 3, 0);
        flash.write(0x10, SER | 1 << 3 | STRT, 0);
        flash.cut(100 * MS);
        let ones: u32 = flash.content.all()[0x4000..0x8000].iter().map(|byte| byte.count_ones()).sum();
        let all = 8 * 0x4000;
        assert!((all / 5..all / 3).contains(&ones), "{ones} of {all}");
        assert_eq!(flash.deadline(), NEVER);
    }
}
