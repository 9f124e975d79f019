//! Frames at the first port at full rate, and their record.

use hums_sdcard::{Medium, Plan, Slot};
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::memory::FLASH;
use stm32f405_model::report::Report;
use stm32f405_model::time::{MS, Ps, SECOND};

use super::record::{Compared, Session, compare, read};
use super::{BAUD, board_with, pin, usart, wired};
use crate::frames;

/// Frames and the image that records them.
#[derive(Debug)]
pub struct Bench {
    /// The board's image.
    pub image: Image,
    /// Repeated input frames.
    pub frames: Vec<Vec<u8>>,
}

impl Bench {
    /// A board that gets power for the first time.
    pub fn rig(&self, parts: Board) -> Rig {
        Rig::new(&self.image, parts, self.frames.clone())
    }

    /// Its store exists: the second reset.
    pub fn settled(&self, parts: Board) -> Result<Rig, Box<Report>> {
        let mut rig = self.rig(parts);
        rig.machine.run_until(2 * SECOND)?;
        rig.machine.power_off();
        rig.machine.run_until(2 * SECOND + 100 * MS)?;
        rig.machine.power_on();
        rig.machine.chip.flash.erases.clear();
        Ok(rig)
    }
}

/// A board on a bench.
pub struct Rig {
    /// The image's board.
    pub wired: &'static hums_boards::Board,
    /// The board.
    pub machine: Machine,
    /// Its card's slot.
    pub slot: Slot,
    /// The card's blocks.
    pub medium: Medium,
    /// Sent frames, with the time of their last bits.
    pub sent: Vec<(Ps, Vec<u8>)>,
    frames: Vec<Vec<u8>>,
    next: usize,
    free: Ps,
    /// Times of its changes, and whether it was lit then.
    pub led: Vec<(Ps, bool)>,
}

impl Rig {
    /// Sends these frames over and over.
    pub fn new(image: &Image, parts: Board, frames: Vec<Vec<u8>>) -> Self {
        Self::with(image, parts, frames, Vec::new())
    }

    /// A rig whose card has these faults.
    pub fn with(image: &Image, parts: Board, frames: Vec<Vec<u8>>, plans: Vec<Plan>) -> Self {
        let (machine, slot, medium) = board_with(image.clone(), parts, plans);
        let (wired, sent, led) = (wired(image), Vec::new(), Vec::new());
        Self { wired, machine, slot, medium, sent, frames, next: 0, free: 0, led }
    }

    /// `busy`: the line is full of frames.
    pub fn run(&mut self, until: Ps, busy: bool) -> Result<(), Box<Report>> {
        while self.machine.now() < until {
            let to = (self.machine.now() + 10 * MS).min(until);
            self.free = self.free.max(self.machine.now());
            while busy && self.free < to {
                let frame = self.frames[self.next % self.frames.len()].clone();
                self.next += 1;
                self.free = self.machine.send(usart(&self.wired.autopilot), &frame, self.free, BAUD);
                self.sent.push((self.free, frame));
            }
            self.machine.run_until(to)?;
            let (gpio, led) = (&self.machine.chip.gpio, pin(self.wired.led.pin));
            let lit = match self.wired.led.lit {
                hums_boards::Level::Low => gpio.pulls_low(led),
                hums_boards::Level::High => gpio.is_high(led),
            };
            if self.led.last().is_none_or(|(_, last)| *last != lit) {
                self.led.push((self.machine.now(), lit));
            }
        }
        Ok(())
    }

    /// As [`Self::run`], from now on.
    pub fn run_for(&mut self, time: Ps, busy: bool) -> Result<(), Box<Report>> {
        self.run(self.machine.now() + time, busy)
    }

    /// 36 s of settings on the ground, disarmed: the next calm needs an erase.
    pub fn fill(&mut self) -> Result<(), Box<Report>> {
        const NAMES: [&str; 6] = [
            "BAT_TEMP_WARN",
            "ESC_TEMP_WARN",
            "MCU_TEMP_WARN",
            "VIBE_WARN",
            "CPU_LOAD_WARN",
            "LINK_LOSS_WARN",
        ];
        for number in 0..360_u32 {
            let now = self.machine.now();
            if number % 10 == 0 {
                let beat = heartbeat(number as u8);
                let end = self.machine.send(0, &beat, now, BAUD);
                self.sent.push((end, beat));
            }
            let name = NAMES[number as usize % NAMES.len()];
            self.machine.send(1, &set(name, 20.0 + (number / 6) as f32 / 10.0, number as u8), now, 57_600.0);
            self.run(now + 100 * MS, false)?;
        }
        Ok(())
    }

    /// Replaces the handler's beginning until the next reset (at most 15 s), at full rate or with an idle line. Returns its
    /// address.
    ///
    /// # Panics
    ///
    /// The image has no such handler.
    pub fn replace(&mut self, handler: &str, code: &[u8], busy: bool) -> Result<u32, Box<Report>> {
        let symbol = self.machine.image().symbols.iter().find(|symbol| symbol.name == handler);
        let address = symbol.expect("a handler of the image's").address;
        let at = (address - FLASH.0) as usize;
        let swap = |rig: &mut Self, with: &[u8]| {
            let place = &mut rig.machine.chip.flash.content.all_mut()[at..at + with.len()];
            let was = place.to_vec();
            place.copy_from_slice(with);
            rig.machine.core.forget_code(address, with.len() as u32);
            was
        };
        let was = swap(self, code);
        let (resets, end) = (self.machine.resets.len(), self.machine.now() + 15 * SECOND);
        while self.machine.resets.len() == resets && self.machine.now() < end {
            self.run(self.machine.now() + MS, busy)?;
        }
        swap(self, &was);
        Ok(address)
    }

    /// The sessions on the card.
    pub fn sessions(&self) -> Vec<Session> {
        read(&self.medium)
    }

    /// The record against the sent frames.
    pub fn compared(&self) -> Compared {
        let sent: Vec<Vec<u8>> = self.sent.iter().map(|(_, frame)| frame.clone()).collect();
        let sessions = self.sessions();
        let recorded =
            sessions.iter().flat_map(|session| session.frames.iter().map(|(_, frame)| frame.as_slice()));
        compare(&sent, recorded)
    }
}

/// A `MAVLink` 2 frame of a ground station.
pub fn frame(id: u32, payload: &[u8], seed: u8, sequence: u8) -> Vec<u8> {
    frames::build_from((255, 190), sequence, id, payload, seed)
}

/// `PARAM_SET`.
pub fn set(name: &str, value: f32, sequence: u8) -> Vec<u8> {
    let mut payload = value.to_le_bytes().to_vec();
    payload.extend([1, 191]);
    payload.extend(name.bytes().chain(std::iter::repeat(0)).take(16));
    payload.push(9);
    frame(23, &payload, 168, sequence)
}

/// A heartbeat of a disarmed quadrotor of ArduPilot's.
pub fn heartbeat(sequence: u8) -> Vec<u8> {
    heartbeat_in(0x51, sequence)
}

/// A heartbeat with this `base_mode`.
pub fn heartbeat_in(base_mode: u8, sequence: u8) -> Vec<u8> {
    frames::build_v2(sequence, 0, &[0, 0, 0, 0, 2, 3, base_mode, 3, 3], 50)
}
