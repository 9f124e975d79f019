//! Running: instructions, and whatever else is due.

use crate::bus::Bus;
use crate::cache::Entry;
use crate::decode::{self, Place};
use crate::exceptions::{self, THREAD};
use crate::processor::{Core, Outcome, Sleep};
use crate::timing;
use crate::trap::Trap;

impl Core {
    /// One instruction, or half of an exception's entry.
    pub fn step<B: Bus>(&mut self, bus: &mut B) -> Outcome {
        self.single = true;
        let outcome = self.run(bus, self.cycles + 1);
        self.single = false;
        outcome
    }

    /// Runs until the cycle, attention of the bus, or a stop.
    pub fn run<B: Bus>(&mut self, bus: &mut B, until: u64) -> Outcome {
        self.until = until;
        self.deadline = 0;
        loop {
            if self.cycles >= self.deadline
                && let Some(outcome) = self.attend(bus)
            {
                return outcome;
            }
            if let Err(trap) = self.instruction(bus)
                && let Some(outcome) = self.trapped(bus, trap)
            {
                return outcome;
            }
        }
    }

    #[inline(always)]
    fn instruction<B: Bus>(&mut self, bus: &mut B) -> Result<(), Trap> {
        let pc = self.pc;
        let tag = pc | u32::from(self.it != 0);
        self.it_now = self.it;
        let mut entry = *self.cache.get(tag);
        if entry.tag != tag {
            entry = self.decode(bus, tag)?;
        }
        self.note(pc);
        let bytes = u32::from(entry.bytes);
        let wait = bus.fetch_wait(pc, bytes, self.branched, self.cycles);
        self.branched = false;
        self.cycles += u64::from(entry.cycles) + u64::from(wait);
        self.r[15] = pc.wrapping_add(4);
        self.next = pc.wrapping_add(bytes);
        if self.it != 0 && !self.turn() {
            self.cycles -= u64::from(entry.cycles) - 1;
            self.previous = timing::NOTHING;
            self.pc = self.next;
            return Ok(());
        }
        self.execute(bus, entry.op)?;
        self.r[13] &= !3;
        self.depths.lowest = self.depths.lowest.min(self.r[13]);
        self.previous = entry.writes;
        self.pc = self.next;
        Ok(())
    }

    #[inline]
    fn turn(&mut self) -> bool {
        let holds = self.flags.holds(self.it >> 4);
        self.it = if self.it & 7 == 0 { 0 } else { self.it & 0xE0 | self.it << 1 & 0x1F };
        holds
    }

    #[cold]
    #[inline(never)]
    fn decode<B: Bus>(&mut self, bus: &mut B, tag: u32) -> Result<Entry, Trap> {
        let place = Place { address: tag & !1, in_it: tag & 1 == 1 };
        let first = self.fetch(bus, place.address)?;
        if !self.thumb {
            return Err(Trap::InvalidState);
        }
        let (op, bytes) = if decode::is_wide(first) {
            let second = self.fetch(bus, place.address.wrapping_add(2))?;
            (decode::wide(place, first, second), 4)
        } else {
            (decode::narrow(place, first), 2)
        };
        let (cycles, writes) = timing::of(op);
        let entry = Entry { tag, op, bytes, cycles, writes };
        if !self.mpu.is_on() {
            self.cache.put(entry);
        }
        Ok(entry)
    }

    fn fetch<B: Bus>(&mut self, bus: &mut B, address: u32) -> Result<u16, Trap> {
        if !self.mpu.allows_code(address, self.privileged(), self.mpu.is_on() && self.priority() < 0) {
            return Err(Trap::FetchMemory);
        }
        bus.fetch(address).map_err(|_| Trap::FetchBus)
    }

    #[cold]
    #[inline(never)]
    fn attend<B: Bus>(&mut self, bus: &mut B) -> Option<Outcome> {
        loop {
            if let Some(address) = self.unmodelled.take() {
                return Some(Outcome::Unmodelled(address));
            }
            if self.locked_up {
                return Some(Outcome::Lockup);
            }
            self.tick();
            if self.cycles >= self.until || core::mem::take(&mut self.leave) {
                return Some(Outcome::Ran);
            }
            if self.entering.is_some() {
                if self.faults_stop && self.exceptions.first().is_some_and(exceptions::is_fault) {
                    return Some(Outcome::Fault);
                }
                self.enter(bus);
                if self.single {
                    return Some(Outcome::Ran);
                }
            } else if let Some(number) = self.due(self.priority()) {
                self.sleeping = None;
                self.interrupt(bus, number);
            } else if self.sleeping.is_none() {
                break;
            } else if self.woken() {
                self.sleeping = None;
            } else {
                return Some(Outcome::Sleeping);
            }
        }
        if !self.thumb {
            // The address lacks the instruction set's state: no cached instruction.
            self.it_now = self.it;
            let trap = self.decode(bus, self.pc).err().unwrap_or(Trap::InvalidState);
            return self.trapped(bus, trap).or_else(|| self.attend(bus));
        }
        self.deadline = self.until.min(self.systick.next_interrupt().unwrap_or(u64::MAX));
        None
    }

    /// Pre-empts this priority.
    pub(crate) fn due(&self, priority: i16) -> Option<u16> {
        let number = self.exceptions.first()?;
        (self.exceptions.grouped(self.exceptions.priority(number)) < priority).then_some(number)
    }

    /// Priority of the active exceptions, raised by the masks.
    pub(crate) fn priority(&self) -> i16 {
        let exceptions = &self.exceptions;
        let mut boosted = THREAD;
        if self.basepri != 0 {
            boosted = exceptions.grouped(i16::from(self.basepri));
        }
        if self.primask {
            boosted = 0;
        }
        if self.faultmask {
            boosted = -1;
        }
        boosted.min(exceptions.active_priority())
    }

    /// Woken without an exception taken: PRIMASK does not keep WFI asleep.
    fn woken(&mut self) -> bool {
        match self.sleeping {
            Some(Sleep::Event) => core::mem::take(&mut self.event),
            Some(Sleep::Interrupt) => {
                let (primask, faultmask) = (self.primask, self.faultmask);
                self.primask = false;
                let priority = self.priority();
                (self.primask, self.faultmask) = (primask, faultmask);
                self.due(priority).is_some()
            }
            None => true,
        }
    }
}
