//! The board on its chip's model: ports, card, power.

use std::collections::VecDeque;
use std::io::Write;

use anyhow::{Context as _, Result, anyhow};
use hums_link::framer::{Framer, FramerCounts};
use hums_sdcard::{Kind, Medium, Model, Slot};
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board as Parts, Machine as Chip, Reset};
use stm32f405_model::map;
use stm32f405_model::memory::FLASH;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, Ps, SECOND, US};
use stm32f405_model::usart::Usart;

use crate::run;
use crate::source::Chunk;

/// Sectors 1 and 2.
const STORE: std::ops::Range<usize> = 16 * 1024..48 * 1024;
/// Time until the first byte: a start takes some 25 ms.
const LEAD: Ps = 40 * MS;
/// Length of a short power cut.
const AWAY: Ps = 100 * MS;
/// Wait at the end: a sector in progress waits 0.15 s (`hums_onboard::monitoring`).
const LEAST: Ps = 2_400 * MS;
/// Quiet without a write on a slow card; before silence is a finding (3 s).
const QUIET: Ps = 200 * MS;
const MOST: Ps = 3_000 * MS;
/// The ports are looked after this often.
const STEP: Ps = 20 * MS;
/// Autopilot's, and radio's until a parameter sets another.
const BAUDS: [f64; 2] = [921_600.0, 57_600.0];

const STAGES: [&str; 9] =
    ["idle", "tasks", "framer", "monitor", "encode", "observe", "summary", "tick", "storage"];
const STAGE_CYCLES: &str = "STAGE_CYCLES";
/// Exceptions from the most urgent down (`firmware/app/src/executors.rs`; numbers: RM0090, table 62, and 16).
const URGENCIES: [(&str, &[u16]); 7] = [
    ("watch", &[15, 17]),
    ("clock", &[44]),
    ("reception", &[35]),
    ("monitor", &[36]),
    ("downlink", &[37]),
    ("storage", &[38]),
    ("start", &[0]),
];

#[derive(Debug, Default)]
struct Line {
    /// The end of the last transfer.
    free: Ps,
}

pub(super) struct EmulatedBoard {
    wiring: Wiring,
    chip: Chip,
    medium: Medium,
    to_ground: Box<dyn Write + Send>,
    to_autopilot: Box<dyn Write + Send>,
    lines: [Line; 2],
    /// When power goes for a moment, sorted.
    reboots: VecDeque<u64>,
    /// Received, and to the ground station.
    came: Framer,
    went: Framer,
    load: Load,
}

struct Wiring {
    /// Autopilot's and radio's.
    ports: [usize; 2],
    dma: Vec<u16>,
}

/// Awake part of each second but the first, which mounts the card.
#[derive(Debug)]
struct Load {
    /// Start of this second, cycles and sleeping cycles by then.
    since: Option<(Ps, u64, u64)>,
    worst: f64,
}

impl EmulatedBoard {
    /// Power comes a moment before the first byte.
    pub(super) fn new(
        (wired, image): (&hums_boards::Board, Image),
        seed: u32,
        medium: &Medium,
        store: &[u8],
        (to_ground, to_autopilot): (Box<dyn Write + Send>, Box<dyn Write + Send>),
        reboots: VecDeque<u64>,
    ) -> Self {
        let slot = Slot::new(Some(Model::new(Kind::Sdhc, medium.clone())));
        let parts = Parts { hse_hz: wired.crystal_hz, seed: u64::from(seed), ..Parts::default() };
        let mut chip = Chip::new(image, parts);
        // The image's handler would reset it again and again.
        chip.core.stop_at_faults(true);
        hums_sdcard::connect(&mut chip, wired, &slot);
        if let Some(flash) = chip.chip.flash.content.all_mut().get_mut(STORE) {
            flash.copy_from_slice(store);
        }
        Self {
            wiring: Wiring::of(wired),
            chip,
            medium: medium.clone(),
            to_ground,
            to_autopilot,
            lines: Default::default(),
            reboots,
            came: Framer::new(),
            went: Framer::new(),
            load: Load { since: None, worst: 0.0 },
        }
    }

    fn moment(at_us: u64) -> Ps {
        LEAD.saturating_add(at_us.saturating_mul(US))
    }

    fn run_until(&mut self, until: Ps) -> Result<()> {
        while self.chip.now() < until {
            let to = self.chip.now().saturating_add(STEP).min(until);
            self.chip.run_until(to).map_err(|report| anyhow!("the firmware stopped: {report}"))?;
            self.take_sent()?;
            self.load.look(&self.chip);
        }
        Ok(())
    }

    fn take_sent(&mut self) -> Result<()> {
        let [autopilot, ground] = self
            .wiring
            .ports
            .map(|port| self.chip.take_sent(port).into_iter().map(|(_, byte)| byte).collect::<Vec<_>>());
        self.to_autopilot.write_all(&autopilot).context("to the autopilot")?;
        if !ground.is_empty() {
            self.went.push(&ground, &mut |_| {});
            self.to_ground.write_all(&ground).context("--gs: cannot be written")?;
            self.to_ground.flush().context("--gs: cannot be written")?;
        }
        Ok(())
    }

    fn send(&mut self, port: usize, chunk: &Chunk) -> Result<()> {
        let at = Self::moment(chunk.at_us);
        // At most a second of an input faster than the line waits.
        let waits = self.lines.get(port).map_or(0, |line| line.free.saturating_sub(SECOND));
        let power = self.reboots.front().map_or(Ps::MAX, |at_us| Self::moment(*at_us));
        self.run_until(at.max(waits.min(power)))?;
        let usual = self.wiring.ports.get(port).zip(BAUDS.get(port));
        let (Some(line), Some((usart, usual))) = (self.lines.get_mut(port), usual) else { return Ok(()) };
        // Both ends are set alike.
        let set = self.chip.chip.usarts.get(*usart).map_or(0.0, Usart::baud);
        let baud = if set > 0.0 { nearest(set) } else { *usual };
        line.free = self.chip.send(*usart, &chunk.bytes, at.max(line.free), baud);
        Ok(())
    }

    fn lose_power(&mut self, at_us: u64) -> Result<()> {
        self.run_until(Self::moment(at_us))?;
        self.chip.power_off();
        self.run_until(self.chip.now().saturating_add(AWAY))?;
        self.chip.power_on();
        Ok(())
    }

    pub(super) fn settle(&mut self) -> Result<()> {
        self.run_until(self.lines[0].free.max(self.lines[1].free).max(self.chip.now()))?;
        let end = self.chip.now();
        self.run_until(end.saturating_add(LEAST))?;
        let mut writes = None;
        while self.chip.now() < end.saturating_add(MOST) && writes.replace(self.medium.writes()) != writes {
            self.run_until(self.chip.now().saturating_add(QUIET))?;
        }
        // A complete frame, or nothing.
        self.came.idle(&mut |_| {});
        self.went.idle(&mut |_| {});
        self.to_ground.flush().context("--gs: cannot be written")
    }

    pub(super) fn store(&self) -> &[u8] {
        self.chip.memory(FLASH.0 + STORE.start as u32, STORE.len() as u32)
    }

    /// Received, and sent to the ground station.
    pub(super) const fn traffic(&self) -> (FramerCounts, FramerCounts) {
        (self.came.counts(), self.went.counts())
    }

    /// Resets by program or watchdog; the first one in seconds since the first byte.
    pub(super) fn resets(&self) -> Option<(u64, f64)> {
        let own = |(_, cause): &&Reset| matches!(cause, Cause::Software | Cause::Watchdog);
        let (at, _) = self.chip.resets.iter().find(own)?;
        Some((self.chip.resets.iter().filter(own).count() as u64, (*at as f64 - LEAD as f64) / SECOND as f64))
    }

    /// The processor's load in the worst second, percent, modelled.
    pub(super) const fn busy_percent_max(&self) -> f64 {
        self.load.worst
    }

    /// Cycles since the last start; `None` without the symbol.
    pub(super) fn stage_cycles(&self) -> Option<serde_json::Value> {
        let symbol = self.chip.image().symbols.iter().find(|symbol| symbol.name == STAGE_CYCLES)?;
        let words = self.chip.memory(symbol.address, 8 * STAGES.len() as u32).as_chunks::<8>().0;
        let cycles = STAGES.iter().zip(words).skip(1);
        Some(
            cycles
                .map(|(name, word)| ((*name).to_owned(), serde_json::Value::from(u64::from_le_bytes(*word))))
                .collect(),
        )
    }

    /// Deepest by urgency.
    pub(super) fn stack_by_urgency(&self) -> serde_json::Value {
        let deepest = |exceptions: &[u16]| {
            exceptions.iter().map(|number| self.chip.core.stack_depth(*number)).max().unwrap_or(0)
        };
        let ports = [("ports", &self.wiring.dma[..])];
        ports
            .into_iter()
            .chain(URGENCIES)
            .map(|(name, exceptions)| (name.to_owned(), serde_json::Value::from(deepest(exceptions))))
            .collect()
    }
}

impl Wiring {
    fn of(board: &hums_boards::Board) -> Self {
        let ports = [&board.autopilot, &board.radio].map(|port| usize::from(port.usart).saturating_sub(1));
        let line = |stream: hums_boards::Stream| {
            let controller = map::DMA.get(usize::from(stream.controller).checked_sub(1)?)?;
            Some(16 + controller.get(usize::from(stream.number))?)
        };
        Self { ports, dma: board.streams().into_iter().filter_map(line).collect() }
    }
}

impl run::Machine for EmulatedBoard {
    fn arrive(&mut self, chunk: &Chunk) -> Result<bool> {
        while let Some(at_us) = self.reboots.pop_front_if(|at_us| *at_us <= chunk.at_us) {
            self.lose_power(at_us)?;
        }
        self.came.push(&chunk.bytes, &mut |_| {});
        self.send(0, chunk)?;
        Ok(true)
    }

    fn hear(&mut self, chunk: &Chunk) -> Result<bool> {
        self.send(1, chunk)?;
        Ok(true)
    }
}

impl Load {
    fn look(&mut self, chip: &Chip) {
        let begun = self.since.map_or(LEAD, |(at, ..)| at);
        if chip.now() < begun + SECOND {
            return;
        }
        let now = (chip.now(), chip.core.cycles(), chip.core.slept());
        if let Some((_, cycles, slept)) = self.since {
            let asleep = (now.2 - slept) as f64 / (now.1 - cycles).max(1) as f64;
            self.worst = self.worst.max(100.0 - 100.0 * asleep);
        }
        self.since = Some(now);
    }
}

/// The usual rate that a port's divider stands for.
fn nearest(baud: f64) -> f64 {
    const USUAL: [f64; 9] =
        [9_600.0, 19_200.0, 38_400.0, 57_600.0, 115_200.0, 230_400.0, 460_800.0, 921_600.0, 1_500_000.0];
    USUAL.into_iter().find(|usual| (usual / baud - 1.0).abs() < 0.03).unwrap_or(baud)
}
