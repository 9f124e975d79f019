//! The emulated board over all its starts: what power loss and resets leave, and the input from there on.

use std::collections::VecDeque;
use std::path::PathBuf;

use anyhow::{Result, bail};

use crate::run::Machine;
use crate::run::qemu::{Again, Ended, Ground, Qemu, Start};
use crate::source::Chunk;

/// Input that is kept to be sent again after a reset: more than the pipes to the emulator hold.
const KEPT_BYTES: usize = 1 << 20;
/// A firmware that is reset more often than this never gets anywhere.
const RESETS_MAX: u32 = 16;

/// What stays the same over all starts.
pub(super) struct Fixed {
    /// What stands for true randomness at the first start; later ones count on from it.
    pub(super) entropy: u32,
    pub(super) firmware: PathBuf,
    pub(super) card: PathBuf,
    pub(super) store: PathBuf,
    pub(super) gs: Ground,
    pub(super) autopilot: Ground,
    pub(super) costs: bool,
    /// What is to go wrong in the firmware itself.
    pub(super) provoke: Option<String>,
    /// When power goes for a moment, in microseconds since the first byte; sorted.
    pub(super) reboots: VecDeque<u64>,
}

/// What the starts before the last one came to.
#[derive(Default)]
pub(super) struct Earlier {
    pub(super) frames_in: u64,
    pub(super) bytes_in: u64,
    pub(super) bytes_not_frames: u64,
    pub(super) blocks_written: u64,
    /// How many there were.
    pub(super) starts: u32,
}

/// The board.
pub(super) struct Board {
    fixed: Fixed,
    qemu: Option<Qemu>,
    earlier: Earlier,
    resets: u32,
    /// When this start was, in microseconds since the first byte.
    started_us: u64,
    /// The newest input since this start, and how many bytes of it were sent before that.
    sent: VecDeque<Chunk>,
    sent_bytes: usize,
    forgotten: u64,
}

impl Board {
    pub(super) fn start(fixed: Fixed) -> Result<Self> {
        let mut board = Self {
            fixed,
            qemu: None,
            earlier: Earlier::default(),
            resets: 0,
            started_us: 0,
            sent: VecDeque::new(),
            sent_bytes: 0,
            forgotten: 0,
        };
        board.power_on(None)?;
        Ok(board)
    }

    fn power_on(&mut self, survived: Option<Vec<u8>>) -> Result<()> {
        let Fixed { firmware, card, store, gs, autopilot, costs, provoke, .. } = &self.fixed;
        let mut arguments = vec![format!("seed={}", self.fixed.entropy.wrapping_add(self.earlier.starts))];
        // Once, also where power is lost in between.
        arguments.extend(provoke.iter().filter(|_| self.resets == 0).map(|what| format!("provoke={what}")));
        let (gs, autopilot, costs) = (gs.clone(), autopilot.clone(), *costs);
        let start = Start { firmware, card, store, gs, autopilot, arguments, costs, survived };
        self.qemu = Some(Qemu::start(start)?);
        Ok(())
    }

    /// The input has ended: the counters of the last start, one JSON object, and those of the starts before.
    pub(super) fn finish(mut self) -> Result<(String, Earlier)> {
        loop {
            let Some(qemu) = self.qemu.take() else { bail!("the firmware does not run") };
            match qemu.finish()? {
                Ended::Done(json) => return Ok((json, self.earlier)),
                Ended::Again(again) => self.start_again(again)?,
            }
        }
    }

    /// Power goes at `at_us`, and comes back at once.
    fn lose_power(&mut self, at_us: u64) -> Result<()> {
        loop {
            let Some(mut qemu) = self.qemu.take() else { bail!("the firmware does not run") };
            qemu.power_off(at_us.saturating_sub(self.started_us))?;
            let Ended::Again(again) = qemu.finish()? else { bail!("the firmware ended without its power") };
            let was_power = again.what == "power";
            self.start_again(again)?;
            if was_power {
                // What was still on its way in when it came, to the byte, is lost on the line.
                return Ok(());
            }
        }
    }

    /// Starts the firmware anew, and sends again what it had not taken.
    fn start_again(&mut self, again: Again) -> Result<()> {
        self.resets += u32::from(again.what == "reset");
        if self.resets > RESETS_MAX {
            bail!("the firmware is reset again and again");
        }
        let Earlier { frames_in, bytes_in, bytes_not_frames, blocks_written, starts } = &mut self.earlier;
        *frames_in += again.frames_in;
        *bytes_in += again.bytes_in;
        *bytes_not_frames += again.bytes_not_frames;
        *blocks_written += again.blocks_written;
        *starts += 1;
        self.started_us += again.at_us;
        let mut untaken = self.untaken(again.taken)?;
        self.power_on(again.survived)?;
        while let Some(chunk) = untaken.pop_front() {
            // A reset within is met at the next arrival, or at the end.
            self.send(chunk)?;
        }
        Ok(())
    }

    /// What was sent beyond the first `taken` bytes.
    fn untaken(&mut self, taken: u64) -> Result<VecDeque<Chunk>> {
        let Some(mut skip) = taken.checked_sub(self.forgotten) else {
            bail!("the firmware was reset so far back that its input is not known any more");
        };
        let mut untaken = std::mem::take(&mut self.sent);
        while let Some(chunk) = untaken.front_mut().filter(|chunk| chunk.bytes.len() as u64 <= skip) {
            skip -= chunk.bytes.len() as u64;
            untaken.pop_front();
        }
        if let Some(chunk) = untaken.front_mut() {
            chunk.bytes.drain(..usize::try_from(skip)?);
        }
        (self.sent_bytes, self.forgotten) = (0, 0);
        Ok(untaken)
    }

    /// Sends a chunk and keeps it; `false` when the firmware is being reset.
    fn send(&mut self, chunk: Chunk) -> Result<bool> {
        let Some(qemu) = &mut self.qemu else { bail!("the firmware does not run") };
        let taken = qemu.arrive(chunk.at_us.saturating_sub(self.started_us), &chunk.bytes)?;
        self.sent_bytes += chunk.bytes.len();
        self.sent.push_back(chunk);
        while self.sent_bytes > KEPT_BYTES
            && let Some(oldest) = self.sent.pop_front()
        {
            self.sent_bytes -= oldest.bytes.len();
            self.forgotten += oldest.bytes.len() as u64;
        }
        Ok(taken)
    }
}

impl Machine for Board {
    fn arrive(&mut self, chunk: &Chunk) -> Result<bool> {
        while let Some(at_us) = self.fixed.reboots.pop_front_if(|at_us| *at_us <= chunk.at_us) {
            self.lose_power(at_us)?;
        }
        if !self.send(Chunk { at_us: chunk.at_us, bytes: chunk.bytes.clone() })? {
            let Some(qemu) = self.qemu.take() else { bail!("the firmware does not run") };
            let Ended::Again(again) = qemu.finish()? else { bail!("the firmware ended before its input") };
            self.start_again(again)?;
        }
        Ok(true)
    }

    fn hear(&mut self, chunk: &Chunk) -> Result<bool> {
        let Some(qemu) = &mut self.qemu else { bail!("the firmware does not run") };
        // Nobody hears it while the firmware is being reset, which the next arrival notices.
        qemu.hear(chunk.at_us.saturating_sub(self.started_us), &chunk.bytes)?;
        Ok(true)
    }
}
