//! A board on the model of the chip, with the simulated SD card of `hums-sdcard` at its bus. All devices around it
//! can fail (`docs/chip.md`).

#[path = "../../../firmware/blackbox/tests/common/log.rs"]
mod log;
pub mod record;
pub mod rig;
pub mod usb;

use std::collections::VecDeque;
use std::path::Path;

use hums_recorder::layout::Layout;
use hums_sdcard::{Kind, Medium, Model, Plan, Slot};
use hums_update::files;
use stm32f405_model::gpio::Pin;
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::time::{Ps, SECOND, US};

/// The autopilot's rate.
pub const BAUD: f64 = 921_600.0;

/// Input of the first port.
#[derive(Debug, Default)]
pub struct Feed {
    pieces: VecDeque<(Ps, Vec<u8>)>,
    free: Ps,
}

impl Feed {
    /// A tlog's frames at their own times, the first at `start`; other bytes back to back.
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

    /// Puts bytes on the line until then.
    pub fn give(&mut self, machine: &mut Machine, until: Ps) {
        while let Some((at, bytes)) = self.pieces.pop_front_if(|(at, _)| *at < until && self.free < until) {
            let start = at.max(self.free);
            let fit = ((until - start.min(until)) as f64 * BAUD / 10.0 / SECOND as f64) as usize + 1;
            let now = bytes.len().min(fit);
            self.free = machine.send(0, &bytes[..now], start, BAUD);
            if now < bytes.len() {
                self.pieces.push_front((at, bytes[now..].to_vec()));
            }
        }
    }
}

/// Microseconds and bytes, by the lengths in MAVLink's headers.
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

/// 4 GB, a multiple of a CSD's unit.
pub const BLOCKS: u32 = 8_388_608;

/// A board with a faultless card.
pub fn board(image: Image, board: Board) -> (Machine, Slot, Medium) {
    board_with(image, board, Vec::new())
}

/// A board with a card of these faults.
pub fn board_with(image: Image, board: Board, plans: Vec<Plan>) -> (Machine, Slot, Medium) {
    let medium = Medium::formatted(BLOCKS);
    let (machine, slot) = board_of(image, board, Model { plans, ..Model::new(Kind::Sdhc, medium.clone()) });
    (machine, slot, medium)
}

/// A board of this image with this card.
pub fn board_of(image: Image, board: Board, card: Model) -> (Machine, Slot) {
    let slot = Slot::new(Some(card));
    let wired = wired(&image);
    let mut machine = Machine::new(image, board);
    hums_sdcard::connect(&mut machine, wired, &slot);
    (machine, slot)
}

/// The image's board.
///
/// # Panics
/// The image names none.
pub fn wired(image: &Image) -> &'static hums_boards::Board {
    let name = image.pieces.iter().find_map(|(_, bytes)| hums_boards::name_in(bytes));
    hums_boards::find(name.expect("the image names its board")).expect("a board of this version")
}

/// A pin, as the model counts it.
pub fn pin(pin: hums_boards::Pin) -> Pin {
    Pin(pin.port, pin.number)
}

/// A port, as the model counts it.
pub fn usart(port: &hums_boards::Port) -> usize {
    usize::from(port.usart) - 1
}

/// Puts files on an empty card, each in a row of clusters.
///
/// # Panics
/// The card has no file system.
pub fn put(medium: &Medium, all: &[(&files::Name, &[u8])]) {
    let Layout { fat_start, fat_stride, fat_copies, data_start, cluster_blocks, root, .. } =
        Layout::read(medium).expect("a formatted card");
    let block_of = |cluster: u32| data_start + (cluster - 2) * cluster_blocks;
    let mut cluster = 1_000;
    for (number, (name, file)) in all.iter().enumerate() {
        let count = (file.len() as u32).div_ceil(512 * cluster_blocks);
        let mut entry = [0; 32];
        entry[..11].copy_from_slice(*name);
        entry[11] = 0x20;
        entry[26..28].copy_from_slice(&(cluster as u16).to_le_bytes());
        entry[28..].copy_from_slice(&(file.len() as u32).to_le_bytes());
        medium.patch(block_of(root), 32 * number, &entry);
        for (at, block) in file.chunks(512).enumerate() {
            medium.patch(block_of(cluster) + at as u32, 0, block);
        }
        for at in cluster..cluster + count {
            let next = if at + 1 < cluster + count { at + 1 } else { 0x0FFF_FFFF };
            for copy in 0..fat_copies {
                let block = fat_start + copy * fat_stride + at / 128;
                medium.patch(block, (at % 128 * 4) as usize, &next.to_le_bytes());
            }
        }
        cluster += count;
    }
}

/// Writes the card's image.
pub fn save(medium: &Medium, path: &Path) -> std::io::Result<()> {
    medium.save(&std::fs::File::create(path)?)
}
