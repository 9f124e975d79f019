//! A board: processor, chip, supply, crystal, wired pins.
//!
//! The same image, seed and wires give the same run.

use cortex_m4_model::{Core, Outcome};

use crate::bits::{Bits, Pins};
use crate::chip::Chip;
use crate::gpio::Pin;
use crate::image::Image;
use crate::line::{Char, chars};
use crate::map;
use crate::memory::{CCM, FLASH, SRAM, garbage};
use crate::otg::Host;
use crate::rcc::Cause;
use crate::report::Report;
use crate::spi::Wire;
use crate::time::{MS, Now, Ps, US};

/// The chip's wait after power (DS8626, table 20: 0.5 to 3 ms).
const START: Ps = 1_500_000_000;

/// Parts of a board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// The crystal.
    pub hse_hz: u32,
    /// Low-speed oscillator: 17 to 47 kHz.
    pub lsi_hz: u32,
    /// Seed of memory at power-on and of random numbers.
    pub seed: u64,
}

impl Default for Board {
    /// The Olimex STM32-H405.
    fn default() -> Self {
        Self { hse_hz: 8_000_000, lsi_hz: 32_000, seed: 1 }
    }
}

/// When, and why.
pub type Reset = (Ps, Cause);

/// A board with a program.
pub struct Machine {
    /// The processor.
    pub core: Core,
    /// The chip round it.
    pub chip: Chip,
    image: Image,
    /// The moment that the world outside has come to.
    now: Ps,
    is_off: bool,
    seed: u64,
    lines: u128,
    nmi: bool,
    /// The first one by power.
    pub resets: Vec<Reset>,
}

impl Machine {
    /// A board with only this program in its flash; power on.
    pub fn new(image: Image, board: Board) -> Self {
        let mut chip = Chip::new(board.hse_hz, board.lsi_hz, board.seed);
        for (address, bytes) in &image.pieces {
            let at = (address - FLASH.0) as usize;
            chip.flash.content.all_mut()[at..at + bytes.len()].copy_from_slice(bytes);
        }
        let mut machine = Self {
            core: Core::new(map::LINES, map::PRIORITY_BITS),
            chip,
            image,
            now: 0,
            is_off: true,
            seed: board.seed,
            lines: 0,
            nmi: false,
            resets: Vec::new(),
        };
        machine.power_on();
        machine
    }

    /// The program.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Time so far.
    pub fn now(&self) -> Ps {
        self.now
    }

    fn moment(&self) -> Now {
        Now { cycle: self.core.cycles(), ps: self.now }
    }

    /// An error: it cannot go on.
    pub fn run_until(&mut self, until: Ps) -> Result<(), Box<Report>> {
        loop {
            if self.is_off {
                self.now = self.now.max(until);
                return Ok(());
            }
            self.deliver()?;
            let limit = self.chip.time.cycle(until);
            let next = self.chip.next().min(limit);
            if self.core.cycles() >= next {
                if self.chip.next() > limit || self.chip.next() > self.core.cycles() {
                    self.now = self.now.max(until);
                    return Ok(());
                }
                self.chip.happen(next);
                continue;
            }
            self.run(next)?;
        }
    }

    fn run(&mut self, next: u64) -> Result<(), Box<Report>> {
        self.chip.until = next;
        if self.chip.is_stopped() {
            self.core.advance_to(next);
            return Ok(());
        }
        let outcome = self.core.run(&mut self.chip, next);
        match outcome {
            Outcome::Ran => {}
            Outcome::Sleeping if self.core.sleeps_deeply() => {
                return Err(self.report("stop and standby are not modelled"));
            }
            Outcome::Sleeping => {
                let wakes = self.core.next_event().map_or(next, |event| event.min(next));
                self.core.advance_to(wakes);
            }
            Outcome::ResetRequested => {
                let at = self.chip.time.at(self.core.cycles());
                self.reset(Cause::Software, at);
            }
            Outcome::Unmodelled(at) => {
                return Err(
                    self.report(&format!("what the processor was asked for at {at:#010x} is not modelled"))
                );
            }
            Outcome::Lockup => return Err(self.report("the processor is locked up: a fault within a fault")),
            Outcome::Fault => {
                let reason = crate::report::fault(self.core.fault_status(), self.core.register(15));
                return Err(self.report(&reason));
            }
            Outcome::Breakpoint(number) => {
                return Err(self.report(&format!("breakpoint {number}, and no debugger is there")));
            }
        }
        Ok(())
    }

    fn deliver(&mut self) -> Result<(), Box<Report>> {
        if !std::mem::take(&mut self.chip.attention) {
            return Ok(());
        }
        if let Some(trouble) = &self.chip.trouble {
            let reason = trouble.to_string();
            return Err(self.report(&reason));
        }
        for (address, bytes) in std::mem::take(&mut self.chip.changed) {
            self.core.forget_code(address, bytes);
        }
        if let Some(cause) = self.chip.reset_by.take() {
            let at = self.chip.moment;
            self.reset(cause, at);
            return Ok(());
        }
        let changed = self.lines ^ self.chip.lines;
        for number in (0..map::LINES).filter(|number| changed >> number & 1 == 1) {
            self.core.set_line(number, self.chip.lines >> number & 1 == 1);
        }
        self.lines = self.chip.lines;
        if std::mem::take(&mut self.nmi) {
            self.core.set_nmi();
        }
        if std::mem::take(&mut self.chip.event) {
            self.core.event();
        }
        self.core.count_in_sleep(self.chip.dbgmcu[0] & 1 == 1);
        Ok(())
    }

    fn reset(&mut self, cause: Cause, at: Now) {
        let now = Now { cycle: self.core.cycles(), ps: at.ps.max(self.now) };
        self.resets.push((now.ps, cause));
        self.chip.time.set(now, self.chip.time.hz());
        self.chip.reset(cause, now);
        self.chip.reset_by = None;
        self.core.reset(&mut self.chip, FLASH.0);
        self.chip.take_waits();
        for number in (0..map::LINES).filter(|number| self.lines >> number & 1 == 1) {
            self.core.set_line(number, false);
        }
        self.lines = 0;
    }

    /// Reason and place of the stop.
    pub fn report(&self, reason: &str) -> Box<Report> {
        let registers = std::array::from_fn(|number| self.core.register(number as u8));
        let name =
            |address: u32| self.image.symbol(address).map(|(name, behind)| format!("{name}+{behind:#x}"));
        let named = |address: u32| name(address).unwrap_or_else(|| "?".to_owned());
        let trace = self.core.trace();
        let come_from = name(trace[trace.len() - 1]).map(|last| format!("no function, come from {last}"));
        let place = name(registers[15]).or(come_from).unwrap_or_else(|| "?".to_owned());
        Box::new(Report {
            reason: reason.to_owned(),
            us: self.chip.time.ps(self.core.cycles()) / US,
            registers,
            place,
            trace: trace.into_iter().map(|address| (address, named(address))).collect(),
        })
    }

    /// Pulses the pin.
    pub fn reset_pin(&mut self) {
        if !self.is_off {
            self.reset(Cause::Pin, self.moment());
        }
    }

    /// Power goes at once, amid any work.
    pub fn power_off(&mut self) {
        if self.is_off {
            return;
        }
        self.chip.flash.cut(self.now);
        let now = self.now;
        self.wires().for_each(|wire| wire.power(now, false));
        self.is_off = true;
    }

    /// Memory holds anything, the flash its content.
    pub fn power_on(&mut self) {
        if !self.is_off {
            return;
        }
        self.is_off = false;
        self.seed = self.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1);
        garbage(self.chip.sram.all_mut(), self.seed);
        garbage(self.chip.ccm.all_mut(), self.seed ^ 0x55);
        let now = self.now;
        self.wires().for_each(|wire| wire.power(now, true));
        self.now += START;
        self.reset(Cause::Power, self.moment());
    }

    /// Supply, millivolts.
    pub fn set_supply(&mut self, mv: u32) {
        let changes = self.chip.pwr.set_supply(mv);
        if changes && self.chip.pwr.is_off {
            self.power_off();
        } else if changes {
            self.power_on();
        } else if !self.is_off {
            self.chip.look_at_lines();
        }
    }

    /// The crystal's swing.
    pub fn set_crystal(&mut self, alive: bool) {
        self.nmi |= self.chip.rcc.set_crystal(alive, self.now);
        self.chip.attention = true;
        self.chip.apply_clocks(self.moment());
    }

    /// Drives a pin from outside, or lets it go.
    pub fn drive(&mut self, pin: Pin, level: Option<bool>) {
        self.chip.gpio.drive(pin, level);
        self.chip.look_at_lines();
    }

    /// Bytes on a port's line from `start`; returns the end.
    pub fn send(&mut self, port: usize, bytes: &[u8], start: Ps, baud: f64) -> Ps {
        let (chars, end) = chars(bytes, start, baud);
        self.send_chars(port, chars);
        end
    }

    /// Characters on a port's line, after those that are there.
    pub fn send_chars(&mut self, port: usize, chars: Vec<Char>) {
        self.chip.usarts[port].line.extend(chars);
        self.chip.line_changed(port);
    }

    /// Characters sent since the last call, with each end.
    pub fn take_sent(&mut self, port: usize) -> Vec<(Ps, u8)> {
        std::mem::take(&mut self.chip.usarts[port].sent)
    }

    /// Selected by this pin when low.
    pub fn connect(&mut self, bus: usize, select: Pin, wire: Box<dyn Wire>) {
        self.chip.spis[bus].wire = wire;
        self.chip.selects[bus] = Some(select);
    }

    /// Connects something to pins that the program moves itself.
    pub fn connect_pins(&mut self, pins: Pins, wire: Box<dyn Wire>) {
        self.chip.bits = Some(Bits::new(pins, wire));
    }

    /// Plugs a host into the USB port.
    pub fn plug(&mut self, host: Box<dyn Host>) {
        self.chip.otg.connect(host, self.now);
        self.chip.host_plugged();
    }

    /// Pulls the cable of the USB port.
    pub fn unplug(&mut self) {
        self.chip.otg.disconnect();
        self.chip.host_plugged();
    }

    /// Other ends of buses.
    fn wires(&mut self) -> impl Iterator<Item = &mut Box<dyn Wire>> {
        let bits = self.chip.bits.iter_mut().map(|bits| &mut bits.wire);
        self.chip.spis.iter_mut().map(|spi| &mut spi.wire).chain(bits)
    }

    /// Bytes as a debugger sees them; fewer at the end.
    pub fn memory(&self, address: u32, bytes: u32) -> &[u8] {
        let memories = [(SRAM, &self.chip.sram), (CCM, &self.chip.ccm), (FLASH, &self.chip.flash.content)];
        let found = memories.into_iter().find(|((from, size), _)| (*from..from + size).contains(&address));
        found.map_or(&[], |((from, _), memory)| {
            let all = memory.all();
            let at = (address - from) as usize;
            &all[at..all.len().min(at + bytes as usize)]
        })
    }

    /// A changed byte of RAM, as by a debugger or a flipped bit.
    pub fn poke(&mut self, address: u32, change: impl Fn(u8) -> u8) {
        for ((from, size), memory) in [(SRAM, &mut self.chip.sram), (CCM, &mut self.chip.ccm)] {
            if (from..from + size).contains(&address) {
                let byte = &mut memory.all_mut()[(address - from) as usize];
                *byte = change(*byte);
            }
        }
    }

    /// Milliseconds since the model began, for texts.
    pub fn ms(&self) -> u64 {
        self.now / MS
    }
}
