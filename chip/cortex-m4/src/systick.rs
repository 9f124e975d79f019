//! Computed from the cycles on demand.

/// The timer.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "bits of a register")]
pub(crate) struct SysTick {
    enabled: bool,
    interrupts: bool,
    processor_clock: bool,
    reload: u32,
    /// The value at `since`, while enabled.
    value: u32,
    /// Last change by software, cycles.
    since: u64,
    /// Zeros since then, already reported.
    told: u64,
    wrapped: bool,
    pub(crate) divider: u64,
}

impl Default for SysTick {
    fn default() -> Self {
        SysTick {
            enabled: false,
            interrupts: false,
            processor_clock: false,
            reload: 0,
            value: 0,
            since: 0,
            told: 0,
            wrapped: false,
            divider: 8,
        }
    }
}

impl SysTick {
    fn ticks(&self, now: u64) -> u64 {
        let cycles = now.saturating_sub(self.since);
        if self.processor_clock { cycles } else { cycles / self.divider }
    }

    fn course(&self) -> (u64, u64) {
        let period = u64::from(self.reload) + 1;
        let first = if self.value == 0 { period } else { u64::from(self.value) };
        (first, period)
    }

    fn zeros(&self, now: u64) -> u64 {
        let (first, period) = self.course();
        let ticks = self.ticks(now);
        if !self.enabled || ticks < first || self.value == 0 && self.reload == 0 {
            return 0;
        }
        if self.reload == 0 { 1 } else { 1 + (ticks - first) / period }
    }

    fn current(&self, now: u64) -> u32 {
        if !self.enabled {
            return self.value;
        }
        let (first, period) = self.course();
        let ticks = self.ticks(now);
        if ticks < first {
            // From zero, the first tick loads the reload value.
            return if self.value == 0 {
                if ticks == 0 { 0 } else { (period - ticks) as u32 }
            } else {
                self.value - ticks as u32
            };
        }
        if self.reload == 0 { 0 } else { ((period - (ticks - first) % period) % period) as u32 }
    }

    pub(crate) fn next_interrupt(&self) -> Option<u64> {
        if !self.enabled || !self.interrupts || self.reload == 0 && (self.value == 0 || self.told > 0) {
            return None;
        }
        let (first, period) = self.course();
        let ticks = first + self.told * period;
        let cycles = if self.processor_clock { ticks } else { ticks * self.divider };
        Some(self.since + cycles)
    }

    pub(crate) fn update(&mut self, now: u64) -> bool {
        let zeros = self.zeros(now);
        let new = zeros > self.told;
        self.told = zeros.max(self.told);
        self.wrapped |= new;
        new && self.interrupts
    }

    /// Into `value`.
    fn settle(&mut self, now: u64) {
        self.value = self.current(now);
        self.since = now;
        self.told = 0;
    }

    /// From `0xE000_E010`; reading the first clears COUNTFLAG.
    pub(crate) fn read(&mut self, offset: u32, now: u64) -> u32 {
        match offset {
            0 => {
                let wrapped = core::mem::take(&mut self.wrapped);
                u32::from(wrapped) << 16
                    | u32::from(self.processor_clock) << 2
                    | u32::from(self.interrupts) << 1
                    | u32::from(self.enabled)
            }
            4 => self.reload,
            8 => self.current(now),
            // CALIB: no reference is told.
            _ => 0x4000_0000,
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, now: u64) {
        match offset {
            0 => {
                self.settle(now);
                self.enabled = value & 1 != 0;
                self.interrupts = value & 2 != 0;
                self.processor_clock = value & 4 != 0;
            }
            4 => {
                // The running period ends first.
                self.settle(now);
                self.reload = value & 0x00FF_FFFF;
            }
            8 => {
                self.value = 0;
                self.since = now;
                self.told = 0;
                self.wrapped = false;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counter_counts_down_reloads_and_interrupts_at_each_zero() {
        let mut timer = SysTick::default();
        timer.write(4, 9, 0);
        timer.write(8, 1, 0);
        timer.write(0, 7, 100);
        for (now, value) in [(100, 0), (101, 9), (109, 1), (110, 0), (111, 9), (120, 0), (121, 9)] {
            assert_eq!(timer.read(8, now), value, "{now}");
        }
        assert_eq!(timer.next_interrupt(), Some(110));
        assert!(!timer.update(109));
        assert!(timer.update(110));
        assert!(!timer.update(111));
        assert_eq!(timer.next_interrupt(), Some(120));
        assert!(timer.update(145), "four zeros are one pending interrupt");
        assert_eq!(timer.next_interrupt(), Some(150));
        assert_eq!(timer.read(0, 145) >> 16, 1);
        assert_eq!(timer.read(0, 145) >> 16, 0);
    }

    #[test]
    fn the_other_clock_is_slower_by_its_divider() {
        let mut timer = SysTick::default();
        timer.write(4, 9, 0);
        timer.write(0, 3, 0);
        assert_eq!(timer.next_interrupt(), Some(80));
        assert_eq!(timer.read(8, 16), 8);
    }
}
