//! TIM2 to TIM5 and TIM12, general-purpose timers (RM0090, chapters 18 and 19), as counters. TIM2 and TIM5 have 32
//! bits; TIM12 has two channels.
//!
//! Not modelled: counting down, capture, outputs, encoder, slave mode, DMA requests: they stop the machine. The
//! counter is computed on demand; events only set flags.

use crate::time::NEVER;

/// Bits of `CR1`.
const CEN: u32 = 1;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
const ARPE: u32 = 1 << 7;
/// UIE or UIF, and the channels' flags.
const UPDATE: u32 = 1;

/// A timer.
#[derive(Clone)]
pub struct Tim {
    cr1: u32,
    cr2: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    cnt: u32,
    psc: u32,
    arr: u32,
    ccr: [u32; 4],
    dcr: u32,
    or: u32,
    /// Active values of prescaler and reload.
    psc_now: u32,
    arr_now: u32,
    max: u32,
    channels: u32,
    /// Ticks since the counter's value, at this cycle.
    ticks: u64,
    at: u64,
    clock: u64,
}

impl Tim {
    /// A reset timer with bits and channels.
    pub fn new(bits: u32, channels: u32) -> Self {
        let max = u32::MAX >> (32 - bits);
        Self {
            cr1: 0,
            cr2: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            cnt: 0,
            psc: 0,
            arr: max,
            ccr: [0; 4],
            dcr: 0,
            or: 0,
            psc_now: 0,
            arr_now: max,
            max,
            channels,
            ticks: 0,
            at: 0,
            clock: 1,
        }
    }

    /// A reset.
    pub fn reset(&mut self, now: u64) {
        *self =
            Self { clock: self.clock, at: now, ..Self::new(32 - self.max.leading_zeros(), self.channels) };
    }

    /// The timer's clock in processor cycles.
    pub fn set_clock(&mut self, now: u64, clock: u64) {
        self.advance(now);
        self.clock = clock.max(1);
        self.at = now;
    }

    fn is_counting(&self) -> bool {
        self.cr1 & CEN != 0
    }

    fn steps_to(&self, value: u32) -> Option<u64> {
        let period = u64::from(self.arr_now) + 1;
        let (from, to) = (u64::from(self.cnt), u64::from(value));
        if self.arr_now == 0 {
            return None;
        }
        if from >= period {
            // Beyond the reload it counts to its end first.
            return Some(u64::from(self.max) + 1 - from + to).filter(|_| to < period);
        }
        if to >= period {
            return None;
        }
        Some(if to > from { to - from } else { period - from + to })
    }

    fn steps_to_update(&self) -> Option<u64> {
        self.steps_to(0)
    }

    /// Brings it to this cycle.
    pub fn advance(&mut self, now: u64) {
        let passed = now.saturating_sub(self.at) / self.clock;
        self.at += passed * self.clock;
        if !self.is_counting() {
            return;
        }
        self.ticks += passed;
        loop {
            let scale = u64::from(self.psc_now) + 1;
            let steps = self.ticks / scale;
            let Some(update) = self.steps_to_update() else { return };
            let taken = steps.min(update);
            if taken == 0 {
                return;
            }
            // With nothing buffered whole periods are alike.
            let is_settled = self.psc == self.psc_now && self.arr == self.arr_now && self.cr1 & OPM == 0;
            self.flag_channels(taken);
            self.ticks -= taken * scale;
            if taken < update {
                self.cnt += taken as u32;
                if u64::from(self.cnt) > u64::from(self.max) {
                    self.cnt = 0;
                }
                return;
            }
            self.cnt = 0;
            self.update(false);
            if !self.is_counting() {
                self.ticks = 0;
                return;
            }
            let period = u64::from(self.arr_now) + 1;
            let more = self.ticks / (scale * period);
            if is_settled && more > 0 {
                self.flag_channels(period);
                self.ticks -= more * scale * period;
            }
        }
    }

    fn flag_channels(&mut self, steps: u64) {
        for (channel, value) in self.ccr.into_iter().enumerate() {
            if self.steps_to(value).is_some_and(|to| to <= steps) {
                self.sr |= 2 << channel;
            }
        }
    }

    fn update(&mut self, by_program: bool) {
        if self.cr1 & UDIS == 0 {
            (self.psc_now, self.arr_now) = (self.psc, self.arr);
            if !by_program || self.cr1 & URS == 0 {
                self.sr |= UPDATE;
            }
        }
        if self.cr1 & OPM != 0 && !by_program {
            self.cr1 &= !CEN;
        }
    }

    /// The cycle of the next flag that interrupts.
    pub fn deadline(&self) -> u64 {
        if !self.is_counting() {
            return NEVER;
        }
        let mut next = if self.dier & UPDATE != 0 { self.steps_to_update() } else { None };
        for (channel, value) in self.ccr.into_iter().enumerate() {
            if self.dier & 2 << channel != 0 {
                let steps = self.steps_to(value);
                next = next.map_or(steps, |next| Some(steps.map_or(next, |steps| steps.min(next))));
            }
        }
        let Some(steps) = next else { return NEVER };
        // A set flag changes nothing again; buffers change at an update.
        let ticks = (steps * (u64::from(self.psc_now) + 1)).saturating_sub(self.ticks).max(1);
        self.at.saturating_add(ticks.saturating_mul(self.clock))
    }

    /// The level of its interrupt.
    pub fn interrupts(&self) -> bool {
        self.sr & self.dier & 0x5F != 0
    }

    fn has(&self, offset: u32) -> bool {
        self.channels == 4 || !matches!(offset, 0x04 | 0x1C | 0x3C | 0x40 | 0x48 | 0x50)
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        self.advance(now);
        Some(match offset {
            _ if !self.has(offset) => return None,
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 | 0x14 => 0,
            0x0C => self.dier,
            0x10 => self.sr,
            0x18 | 0x1C => self.ccmr[(offset as usize - 0x18) / 4],
            0x20 => self.ccer,
            0x24 => self.cnt,
            0x28 => self.psc,
            0x2C => self.arr,
            0x34..=0x40 => self.ccr[(offset as usize - 0x34) / 4],
            0x48 => self.dcr,
            0x50 => self.or,
            _ => return None,
        })
    }

    /// `None`: not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<()> {
        self.advance(now);
        match offset {
            _ if !self.has(offset) => return None,
            // Down, centre-aligned.
            0x00 if value & 0x70 == 0 => {
                if !self.is_counting() {
                    self.at = now;
                }
                self.cr1 = value & 0x3FF;
            }
            0x04 => self.cr2 = value & 0xF8,
            0x08 if value & 7 == 0 => {}
            // Requests of DMA.
            0x0C if value & 0x5F00 == 0 => self.dier = value & 0x5F,
            0x10 => self.sr &= value,
            0x14 => {
                if value & 1 != 0 {
                    (self.cnt, self.ticks, self.at) = (0, 0, now);
                    self.update(true);
                }
                self.sr |= value & 0x5E;
            }
            // Channels that capture.
            0x18 | 0x1C if value & 0x303 == 0 => self.ccmr[(offset as usize - 0x18) / 4] = value & 0xFFFF,
            0x20 if value == 0 => self.ccer = 0,
            0x24 => (self.cnt, self.ticks, self.at) = (value & self.max, 0, now),
            0x28 => self.psc = value & 0xFFFF,
            0x2C => {
                self.arr = value & self.max;
                if self.cr1 & ARPE == 0 {
                    self.arr_now = self.arr;
                }
            }
            0x34..=0x40 => self.ccr[(offset as usize - 0x34) / 4] = value & self.max,
            0x48 => self.dcr = value & 0x1F1F,
            0x50 => self.or = value & 0xCC0,
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driver() -> Tim {
        let mut tim = Tim::new(32, 4);
        tim.set_clock(0, 2);
        for (offset, value) in [
            (0x28, 83),
            (0x2C, 0xFFFF),
            (0x00, URS),
            (0x14, 1),
            (0x00, 0),
            (0x34, 0x8000),
            (0x0C, 3),
            (0x00, CEN),
        ] {
            assert!(tim.write(offset, value, 0).is_some(), "{offset:#x}");
        }
        tim
    }

    const US: u64 = 168;

    #[test]
    fn registers_have_the_manuals_reset_values() {
        for (offset, value) in
            [(0, 0), (0xC, 0), (0x10, 0), (0x24, 0), (0x28, 0), (0x2C, u32::MAX), (0x40, 0)]
        {
            assert_eq!(Tim::new(32, 4).read(offset, 0), Some(value), "{offset:#x}");
        }
        assert_eq!(Tim::new(16, 4).read(0x2C, 0), Some(0xFFFF));
        assert_eq!(Tim::new(16, 4).read(0x44, 0), None);
        assert_eq!((Tim::new(16, 2).read(0x38, 0), Tim::new(16, 2).read(0x3C, 0)), (Some(0), None));
        for (offset, value) in [(0, 0x10), (0, 0x20), (8, 1), (0xC, 1 << 8), (0x18, 1), (0x20, 1)] {
            assert_eq!(Tim::new(16, 4).write(offset, value, 0), None, "{offset:#x}");
        }
    }

    #[test]
    fn a_microsecond_is_a_microsecond() {
        let mut tim = driver();
        assert_eq!(tim.read(0x10, 0), Some(0), "URS keeps the update by a program from being flagged");
        for us in [0, 1, 999, 32_767, 65_535, 65_536, 1_000_000, 3_600_000_000] {
            assert_eq!(tim.read(0x24, us * US), Some((us % 65_536) as u32), "{us}");
            assert_eq!(tim.read(0x24, us * US + 167), Some((us % 65_536) as u32), "{us}");
        }
    }

    #[test]
    fn half_and_whole_turns_are_flagged_when_they_come() {
        let mut tim = driver();
        for (us, sr) in [(32_768, 2), (65_536, 1), (98_304, 2), (131_072, 1)] {
            assert_eq!(tim.deadline(), us * US);
            assert_eq!(tim.read(0x10, us * US - 1), Some(0x1C & tim.sr), "{us}");
            assert_eq!(tim.read(0x10, us * US).map(|flags| flags & 3), Some(sr), "{us}");
            assert!(tim.interrupts());
            tim.write(0x10, 0, us * US);
            assert!(!tim.interrupts());
        }
    }

    #[test]
    fn turns_that_nobody_saw_leave_one_flag() {
        let mut tim = driver();
        assert_eq!(tim.read(0x10, 400_000 * US).map(|flags| flags & 3), Some(3));
        assert_eq!(tim.read(0x24, 400_000 * US), Some(400_000 % 65_536));
    }

    #[test]
    fn a_compare_channel_fires_at_its_value() {
        let mut tim = driver();
        tim.write(0x38, 5_000, 0);
        tim.write(0x0C, 7, 0);
        assert_eq!(tim.deadline(), 5_000 * US);
        assert_eq!(tim.read(0x10, 5_000 * US - 1).map(|flags| flags & 4), Some(0));
        assert_eq!(tim.read(0x10, 5_000 * US).map(|flags| flags & 4), Some(4));
    }

    #[test]
    fn one_pulse_stops_at_its_end_and_a_new_clock_keeps_the_count() {
        let mut tim = driver();
        tim.set_clock(100 * US, 4);
        assert_eq!(tim.read(0x24, 120 * US), Some(110));
        let mut tim = Tim::new(16, 4);
        for (offset, value) in [(0x2C, 9), (0x0C, 1), (0x00, CEN | OPM)] {
            tim.write(offset, value, 0);
        }
        assert_eq!(tim.deadline(), 10);
        tim.advance(1_000);
        assert_eq!((tim.read(0, 1_000), tim.read(0x24, 1_000)), (Some(OPM), Some(0)));
    }
}
