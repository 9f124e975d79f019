//! The flash accelerator's timing (RM0090, 3.4.2): 128-bit lines, 64 of them kept for instructions and 8 for data, and
//! a line fetched ahead.
//!
//! * The last line stays in the flash's register, also with caches off.
//! * A miss costs the wait states. Prefetch reads the next line when the flash is free; an early access waits for the rest.
//!   Least recently used lines are replaced.
//! * Data bus and instruction bus wait for each other only while the flash is busy.
//! * **An erase leaves the data cache stale**, until it is emptied, which works only while it is off (3.5.2). A store into the
//!   flash updates it.
//!
//! Not modelled: stale instructions.

use cortex_m4_model::Size;

use crate::memory::{FLASH, Memory};

const INSTRUCTION_LINES: usize = 64;
const DATA_LINES: usize = 8;
const FLASH_LINES: usize = (FLASH.1 / LINE) as usize;
/// Bytes.
const LINE: u32 = 16;
/// No line.
const NONE: u32 = u32::MAX;

/// Least recently used first to go.
#[derive(Clone)]
struct Lines<const N: usize> {
    kept: [u32; N],
    /// Place plus one; 0 outside the cache.
    place_of: Box<[u8]>,
    /// Places in order of use: the place before, and behind.
    ring: [(u8, u8); N],
    /// Used last; behind it the first to go.
    newest: u8,
}

impl<const N: usize> Lines<N> {
    fn new() -> Self {
        let last = (N - 1) as u8;
        let ring = std::array::from_fn(|place| {
            let place = place as u8;
            (place.checked_sub(1).unwrap_or(last), if place == last { 0 } else { place + 1 })
        });
        Self { kept: [NONE; N], place_of: vec![0; FLASH_LINES].into(), ring, newest: last }
    }

    fn clear(&mut self) {
        *self = Self::new();
    }

    fn find(&self, line: u32) -> Option<usize> {
        self.place_of.get(line as usize).and_then(|place| (*place as usize).checked_sub(1))
    }

    /// Used now.
    fn used(&mut self, line: u32) -> Option<usize> {
        let place = self.find(line)?;
        let oldest = self.ring[self.newest as usize].1;
        if place as u8 == oldest {
            self.newest = oldest;
        } else if place as u8 != self.newest {
            let (before, behind) = self.ring[place];
            self.ring[before as usize].1 = behind;
            self.ring[behind as usize].0 = before;
            self.ring[place] = (self.newest, oldest);
            self.ring[self.newest as usize].1 = place as u8;
            self.ring[oldest as usize].0 = place as u8;
            self.newest = place as u8;
        }
        Some(place)
    }

    /// Returns its place.
    fn keep(&mut self, line: u32) -> usize {
        self.newest = self.ring[self.newest as usize].1;
        let oldest = self.newest as usize;
        if let Some(place) = self.place_of.get_mut(self.kept[oldest] as usize) {
            *place = 0;
        }
        self.kept[oldest] = line;
        if let Some(place) = self.place_of.get_mut(line as usize) {
            *place = oldest as u8 + 1;
        }
        oldest
    }
}

/// The accelerator.
#[derive(Clone)]
pub struct Art {
    /// Wait states of the flash.
    pub latency: u32,
    /// The next line is fetched ahead.
    pub prefetch: bool,
    /// Instructions, data.
    on: (bool, bool),
    instructions: Lines<INSTRUCTION_LINES>,
    data: Lines<DATA_LINES>,
    held: [[u8; LINE as usize]; DATA_LINES],
    /// Read last by the instruction bus.
    line: u32,
    /// The line, and when it is there.
    ahead: (u32, u64),
    /// Until when the flash is busy with a read.
    busy: u64,
    /// Missed lines, and requested ones.
    pub counts: (u64, u64),
}

impl Default for Art {
    fn default() -> Self {
        Self::new()
    }
}

impl Art {
    /// As after a reset: no wait states, all off.
    pub fn new() -> Self {
        Self {
            latency: 0,
            prefetch: false,
            on: (false, false),
            instructions: Lines::new(),
            data: Lines::new(),
            held: [[0; LINE as usize]; DATA_LINES],
            line: NONE,
            ahead: (NONE, 0),
            busy: 0,
            counts: (0, 0),
        }
    }

    /// Switches the caches.
    pub fn set_caches(&mut self, instructions: bool, data: bool) {
        self.on = (instructions, data);
    }

    /// Empties the caches that are off.
    pub fn reset_caches(&mut self, instructions: bool, data: bool) {
        if instructions && !self.on.0 {
            self.instructions.clear();
        }
        if data && !self.on.1 {
            self.data.clear();
        }
    }

    /// Whether a fetch at this offset needs the flash.
    pub fn needs_flash(&self, offset: u32, bytes: u32) -> bool {
        let kept = |line| line == self.line || self.on.0 && self.instructions.find(line).is_some();
        !kept(offset / LINE) || !kept((offset + bytes - 1) / LINE)
    }

    /// Wait states at this offset.
    #[inline]
    pub fn fetch(&mut self, offset: u32, bytes: u32, now: u64) -> u32 {
        let first = offset / LINE;
        let last = (offset + bytes - 1) / LINE;
        if first == self.line && last == first {
            return 0;
        }
        let mut wait = 0;
        for line in first..=last {
            if line != self.line {
                wait += self.next_line(line, now + u64::from(wait));
            }
        }
        wait
    }

    fn next_line(&mut self, line: u32, now: u64) -> u32 {
        self.counts.1 += 1;
        self.line = line;
        if self.latency == 0 {
            return 0;
        }
        let kept = self.on.0 && self.instructions.used(line).is_some();
        let ready = if kept {
            now
        } else if self.ahead.0 == line {
            self.keep(line);
            self.ahead.1.max(now)
        } else {
            self.counts.0 += 1;
            let ready = self.busy.max(now) + u64::from(self.latency);
            self.busy = ready;
            self.keep(line);
            ready
        };
        if self.prefetch && self.ahead.0 != line + 1 {
            let next = line + 1;
            let there = self.on.0 && self.instructions.find(next).is_some();
            if !there {
                self.busy = self.busy.max(ready) + u64::from(self.latency) + 1;
                self.ahead = (next, self.busy);
            }
        }
        (ready - now) as u32
    }

    fn keep(&mut self, line: u32) {
        if self.on.0 {
            self.instructions.keep(line);
        }
    }

    /// Fresh or stale.
    #[inline]
    pub fn held(&mut self, offset: u32, size: Size) -> Option<u32> {
        if !self.on.1 {
            return None;
        }
        let place = self.data.used(offset / LINE)?;
        let at = (offset % LINE) as usize;
        let mut bytes = [0; 4];
        let count = size.bytes() as usize;
        bytes[..count].copy_from_slice(self.held[place].get(at..at + count)?);
        Some(u32::from_le_bytes(bytes))
    }

    /// Wait states of a load that the data cache lacks.
    #[inline]
    pub fn load(&mut self, offset: u32, flash: &Memory, now: u64) -> u32 {
        let line = offset / LINE;
        if self.on.1 {
            let place = self.data.keep(line);
            self.hold(place, line, flash);
        }
        if self.latency == 0 {
            return 0;
        }
        let ready = self.busy.max(now) + u64::from(self.latency);
        self.busy = ready;
        (ready - now) as u32
    }

    fn hold(&mut self, place: usize, line: u32, flash: &Memory) {
        let from = (line * LINE) as usize;
        if let Some(bytes) = flash.all().get(from..from + LINE as usize) {
            self.held[place].copy_from_slice(bytes);
        }
    }

    /// The data cache changes with it.
    pub fn stored(&mut self, offset: u32, flash: &Memory) {
        let line = offset / LINE;
        if let Some(place) = self.data.find(line) {
            self.hold(place, line, flash);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_line_goes_first() {
        const PLACES: usize = 8;
        let (mut lines, mut order) = (Lines::<PLACES>::new(), Vec::<u32>::new());
        let mut state = 1_u32;
        for _ in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let line = state >> 28;
            let there = order.iter().position(|one| *one == line);
            assert_eq!(lines.used(line).is_some(), there.is_some());
            match there {
                Some(at) => drop(order.remove(at)),
                None => _ = lines.keep(line),
            }
            order.push(line);
            order.drain(..order.len().saturating_sub(PLACES));
            assert!((0..16).all(|line| lines.find(line).is_some() == order.contains(&line)));
        }
    }

    fn waits(prefetch: bool, cache: bool) -> (u32, u32, u32) {
        let mut art = Art::new();
        art.latency = 5;
        art.prefetch = prefetch;
        art.set_caches(cache, cache);
        let mut now = 100;
        let mut round = |art: &mut Art, from: u32, to: u32| {
            let mut waits = 0;
            for offset in (from..to).step_by(2) {
                let wait = art.fetch(offset, 2, now);
                now += 1 + u64::from(wait);
                waits += wait;
            }
            waits
        };
        let first = round(&mut art, 0, 48);
        round(&mut art, 0, 48);
        let third = round(&mut art, 0, 48);
        (first, third, round(&mut art, 4_096, 4_256))
    }

    #[test]
    fn lines_cost_what_the_manual_says() {
        // Ten lines of eight halfwords: with prefetch only the first waits.
        assert_eq!(waits(false, false), (15, 15, 50));
        assert_eq!(waits(false, true), (15, 0, 50));
        let (first, third, straight) = waits(true, true);
        assert_eq!((first, third), (5, 0));
        assert!((5..=6).contains(&straight), "{straight}");
    }

    #[test]
    fn data_are_kept_in_eight_lines_and_are_stale_until_they_are_emptied() {
        let mut flash = Memory::new(FLASH.1, 0x5A);
        let mut art = Art::new();
        art.latency = 5;
        art.set_caches(false, true);
        let load = |art: &mut Art, flash: &Memory, offset, now| match art.held(offset, Size::Word) {
            Some(value) => (value, 0),
            None => (flash.get(offset, Size::Word).unwrap_or(0), art.load(offset, flash, now)),
        };
        for line in 0..8 {
            assert_eq!(load(&mut art, &flash, line * 16, 1_000 * u64::from(line)), (0x5A5A_5A5A, 5));
        }
        assert_eq!(load(&mut art, &flash, 4, 100_000), (0x5A5A_5A5A, 0));
        assert_eq!(load(&mut art, &flash, 16 * 8, 101_000).1, 5, "the ninth takes the place of the second");
        assert_eq!(load(&mut art, &flash, 0, 102_000).1, 0);
        assert_eq!(load(&mut art, &flash, 16, 103_000).1, 5);
        flash.all_mut()[..32].fill(0xFF);
        assert_eq!(load(&mut art, &flash, 0, 104_000), (0x5A5A_5A5A, 0), "stale after an erase");
        art.stored(16, &flash);
        assert_eq!(load(&mut art, &flash, 16, 105_000), (0xFFFF_FFFF, 0), "a store changes both");
        art.reset_caches(true, true);
        assert_eq!(load(&mut art, &flash, 0, 106_000).0, 0x5A5A_5A5A, "it cannot be emptied while it is on");
        for (on, value) in [(false, 0xFFFF_FFFF), (true, 0x5A5A_5A5A)] {
            art.set_caches(false, on);
            assert_eq!(load(&mut art, &flash, 0, 107_000).0, value, "off, and on again");
        }
        art.set_caches(false, false);
        art.reset_caches(true, true);
        art.set_caches(false, true);
        assert_eq!(load(&mut art, &flash, 0, 108_000), (0xFFFF_FFFF, 5));
    }
}
