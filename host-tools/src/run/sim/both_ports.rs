//! A power-on with a ground station, step by step.

use std::io::{self, Write};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Result, anyhow};
use hums_core::parameters::Params;
use hums_store::{Key, Store};

use super::outside::{Memory, Outside, Slot};
use super::pipeline::Pipeline;
use super::{PowerOn, identity};
use crate::card::SimCard;
use crate::run::Machine as _;
use crate::run::store;
use crate::source::Chunk;
use crate::source::told::Finding;

/// The signing key's item in the store.
const ITEM_KEY: u8 = 32;

/// The side that sends bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The autopilot.
    Autopilot,
    /// The ground station.
    Ground,
}

/// The board before its first byte.
#[derive(Clone, Copy, Debug)]
pub struct BoardSetup<'a> {
    /// Its card.
    pub card: &'a SimCard,
    /// Its parameters.
    pub params: &'a Params,
    /// Its signing key.
    pub key: Option<[u8; 32]>,
    /// Distinguishes power-ons on a card.
    pub boots: u32,
}

/// A result with each change of level and its time.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The figures.
    pub done: PowerOn,
    /// Changes of level.
    pub findings: Vec<Finding>,
    /// Parameters at the end.
    pub params: Params,
}

/// A power-on with an autopilot alone, and default parameters.
pub fn power_on(card: &SimCard, boots: u32, chunks: impl IntoIterator<Item = Chunk>) -> Result<PowerOn> {
    let board = BoardSetup { card, params: &Params::defaults(), key: None, boots };
    let chunks = chunks.into_iter().map(|chunk| (Side::Autopilot, chunk));
    Ok(run(&board, chunks, |_, _, _| ())?.done)
}

/// Both ports get their bytes in time. `told` gets each frame that leaves a port, with the time of the chunk before.
/// For milliseconds, give a chunk each millisecond. A card whose power went ends it.
pub fn run(
    board: &BoardSetup<'_>,
    chunks: impl IntoIterator<Item = (Side, Chunk)>,
    mut told: impl FnMut(Side, u64, &[u8]),
) -> Result<Outcome> {
    let mut memory = Memory::new(board.params);
    let flash = store::open(None, &[])?;
    if let Some(key) = board.key {
        let (mut store, _) = Store::mount(flash.clone()).map_err(|error| anyhow!("the store: {error:?}"))?;
        store.save(Key::item(ITEM_KEY), &key).map_err(|error| anyhow!("the store: {error:?}"))?;
    }
    let ports = [(Side::Ground, Frames::default()), (Side::Autopilot, Frames::default())];
    let [mut gs, mut autopilot] = ports.clone().map(|(_, frames)| frames);
    let mut findings = Vec::new();
    let mut keep = |finding| findings.push(finding);
    let outside = Outside {
        slot: &Slot { card: board.card, power_on_us: 0 },
        flash: &flash,
        gs: &mut gs,
        autopilot: &mut autopilot,
        findings: &mut keep,
        reboot_at_us: None,
    };
    let mut pipeline = Pipeline::new(outside, &mut memory, identity(board.boots), board.boots);
    pipeline.start()?;
    let mut goes_on = true;
    for (side, chunk) in chunks {
        goes_on = match side {
            Side::Autopilot => pipeline.arrive(&chunk)?,
            Side::Ground => pipeline.hear(&chunk)?,
        };
        if !goes_on {
            break;
        }
        for (side, port) in &ports {
            port.take().iter().for_each(|frame| told(*side, chunk.at_us, frame));
        }
    }
    let frames_left = if goes_on { pipeline.finish()? } else { 0 };
    let (stats, params) = (pipeline.stats(), pipeline.params());
    drop(pipeline);
    Ok(Outcome { done: PowerOn { stats, frames_left, card: memory.card_reading() }, findings, params })
}

/// Written one by one.
#[derive(Clone, Default)]
struct Frames(Arc<Mutex<Vec<Vec<u8>>>>);

impl Frames {
    fn take(&self) -> Vec<Vec<u8>> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Frames {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(bytes.to_vec());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
