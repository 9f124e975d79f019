//! A board on the model of the chip, with the simulated SD card of `hums-sdcard` at its bus: the image that is flashed, run where
//! everything round it can be made to fail (`docs/chip.md`).

pub mod record;
pub mod rig;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use hums_recorder::spi::{Clock, Port};
use hums_sdcard::{Kind, Medium, Model, Plan, SimPort, Slot};
use stm32f405_model::gpio::Pin;
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::spi::Wire;
use stm32f405_model::time::{Ps, SECOND, US};

use crate::flights::root;

/// The F405's image, made as a release is: `HUMS_IMAGE` names the ELF file, otherwise it is where xtask leaves it.
///
/// # Panics
/// If it is not there.
pub fn image_path() -> PathBuf {
    let built = || root().join("target/firmware/hums-f405.elf");
    let path = std::env::var_os("HUMS_IMAGE").map_or_else(built, PathBuf::from);
    assert!(path.is_file(), "{} is missing: `cargo xtask firmware`", path.display());
    path
}

/// The autopilot's rate.
pub const BAUD: f64 = 921_600.0;

/// What comes to the first port: pieces of bytes, each at its time or as soon as the line is free.
#[derive(Debug, Default)]
pub struct Feed {
    pieces: VecDeque<(Ps, Vec<u8>)>,
    free: Ps,
    /// By how much the sender's clock is fast.
    pub fast: f64,
}

impl Feed {
    /// A tlog's frames at their own times, the first at `start`; other files' bytes back to back.
    pub fn read(path: &Path, start: Ps) -> std::io::Result<Self> {
        let bytes = std::fs::read(path)?;
        if path.extension().is_none_or(|extension| extension != "tlog") {
            return Ok(Self { pieces: [(start, bytes)].into(), ..Self::default() });
        }
        let frames = frames(&bytes);
        let first = frames.first().map_or(0, |(us, _)| *us);
        let pieces =
            frames.into_iter().map(|(us, frame)| (start + us.saturating_sub(first) * US, frame.to_vec()));
        Ok(Self { pieces: pieces.collect(), ..Self::default() })
    }

    /// Puts what comes until this moment on the line.
    pub fn give(&mut self, machine: &mut Machine, until: Ps) {
        while let Some((at, bytes)) = self.pieces.pop_front_if(|(at, _)| *at < until && self.free < until) {
            let start = at.max(self.free);
            // Not more of it at once than until then.
            let fit = ((until - start.min(until)) as f64 * BAUD / 10.0 / SECOND as f64) as usize + 1;
            let now = bytes.len().min(fit);
            self.free = machine.send(0, &bytes[..now], start, BAUD * (1.0 + self.fast));
            if now < bytes.len() {
                self.pieces.push_front((at, bytes[now..].to_vec()));
            }
        }
    }
}

/// The frames of a tlog: microseconds and bytes, by the lengths that MAVLink's headers tell.
pub fn frames(mut tlog: &[u8]) -> Vec<(u64, &[u8])> {
    let mut frames = Vec::new();
    while let Some((time, rest)) = tlog.split_first_chunk::<8>() {
        let long = match rest {
            [0xFD, bytes, incompatible, ..] => {
                12 + usize::from(*bytes) + if incompatible & 1 == 1 { 13 } else { 0 }
            }
            [0xFE, bytes, ..] => 8 + usize::from(*bytes),
            _ => break,
        };
        let Some(frame) = rest.get(..long) else { break };
        frames.push((u64::from_be_bytes(*time), frame));
        tlog = &rest[long..];
    }
    frames
}

/// A card in its slot, byte by byte at a bus.
pub struct Card {
    slot: Slot,
    port: SimPort,
    hz: u32,
}

impl Card {
    /// At the bus's beginning.
    pub fn new(slot: &Slot) -> Self {
        Self { slot: slot.clone(), port: slot.port(), hz: 0 }
    }
}

impl Wire for Card {
    fn exchange(&mut self, ps: u64, hz: u32, sent: u8) -> u8 {
        if hz != self.hz {
            self.hz = hz;
            self.port.set_clock(if hz <= 400_000 { Clock::Identification } else { Clock::Transfer });
        }
        // The slot adds the byte's own time.
        self.slot.advance_to((ps / 1_000).saturating_sub(8_000_000_000 / u64::from(hz.max(1))));
        let mut byte = [sent];
        let _ = self.port.exchange(&mut byte);
        if std::env::var_os("TRACE_CARD").is_some() {
            eprintln!("{} us {hz} Hz {sent:02x} -> {:02x}", ps / US, byte[0]);
        }
        byte[0]
    }

    fn select(&mut self, ps: u64, selected: bool) {
        self.slot.advance_to(ps / 1_000);
        self.port.select(selected);
        if std::env::var_os("TRACE_CARD").is_some() {
            eprintln!("{} us select {selected}", ps / US);
        }
    }

    fn power(&mut self, ps: u64, on: bool) {
        if !on && self.slot.has_card() {
            self.slot.advance_to(ps / 1_000);
            self.slot.event(hums_sdcard::Event::Bounce);
        }
    }
}

/// Blocks of the card: 4 GB, a multiple of what a CSD counts in.
pub const BLOCKS: u32 = 8_388_608;

/// A board of this image with a card in good order.
pub fn board(image: Image, board: Board) -> (Machine, Slot, Medium) {
    board_with(image, board, Vec::new())
}

/// A board of this image with a card that has these faults.
pub fn board_with(image: Image, board: Board, plans: Vec<Plan>) -> (Machine, Slot, Medium) {
    let medium = Medium::formatted(BLOCKS);
    let slot = Slot::new(Some(Model { plans, ..Model::new(Kind::Sdhc, medium.clone()) }));
    let mut machine = Machine::new(image, board);
    machine.connect(0, Pin(0, 4), Box::new(Card::new(&slot)));
    (machine, slot, medium)
}

/// Writes a card's image to a file.
pub fn save(medium: &Medium, path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::FileExt;
    let file = std::fs::File::create(path)?;
    file.set_len(u64::from(medium.size()) * 512)?;
    for (at, block) in medium.content() {
        file.write_all_at(&block, u64::from(at) * 512)?;
    }
    Ok(())
}
