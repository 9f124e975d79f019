//! The faults that a review saw on another model of the chip (issue 22), shown on this one: `faults IMAGE FLIGHT.tlog
//! [NAME...]`. Each prints what it saw.

use std::error::Error;

use common::rig::{Rig, heartbeat, set};
use hums_sdcard::{Event, Fault, Kind, Model, Plan};
use stm32f405_model::flash::Speed;
use stm32f405_model::image::Image;
use stm32f405_model::machine::Board;
use stm32f405_model::small::Randomness;
use stm32f405_model::time::{MS, Ps, SECOND, US};

#[path = "../tests/common/mod.rs"]
mod common;

type Outcome = Result<(), Box<dyn Error>>;
type Scenario = (&'static str, fn(&Bench) -> Outcome);

/// What all scenarios have.
struct Bench {
    image: Image,
    frames: Vec<Vec<u8>>,
}

const SCENARIOS: [Scenario; 15] = [
    ("clock", clock),
    ("bitten", bitten),
    ("untold", untold),
    ("dark", dark),
    ("caches", caches),
    ("shares", shares),
    ("debugger", debugger),
    ("transmitter", transmitter),
    ("refused", refused),
    ("supply", supply),
    ("cuts", cuts),
    ("cards", cards),
    ("senders", senders),
    ("flips", flips),
    ("freeze", freeze),
];

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, image, flight, names @ ..] = arguments.as_slice() else {
        return Err("faults IMAGE FLIGHT.tlog [NAME...]".into());
    };
    let tlog = std::fs::read(flight)?;
    let frames = common::frames(&tlog).into_iter().map(|(_, frame)| frame.to_vec()).collect();
    let bench = Bench { image: Image::parse(&std::fs::read(image)?)?, frames };
    for (name, scenario) in SCENARIOS {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            println!("== {name}");
            scenario(&bench)?;
        }
    }
    Ok(())
}

impl Bench {
    fn rig(&self, parts: Board) -> Rig {
        Rig::new(&self.image, parts, self.frames.clone())
    }

    /// A board that has made its store before, and just got power again.
    fn settled(&self, parts: Board) -> Result<Rig, Box<dyn Error>> {
        let mut rig = self.rig(parts);
        rig.machine.run_until(2 * SECOND).map_err(|report| report.to_string())?;
        rig.machine.power_off();
        rig.machine.run_until(2 * SECOND + 100 * MS).map_err(|report| report.to_string())?;
        rig.machine.power_on();
        rig.machine.chip.flash.erases.clear();
        Ok(rig)
    }
}

fn run(rig: &mut Rig, until: Ps, busy: bool) -> Outcome {
    rig.run(until, busy).map_err(|report| report.to_string().into())
}

/// Keeps the card's image in the file that `CARD` names.
fn keep(rig: &Rig) -> Outcome {
    if let Some(path) = std::env::var_os("CARD") {
        common::save(&rig.medium, path.as_ref())?;
    }
    Ok(())
}

fn told(rig: &Rig) -> Outcome {
    let compared = rig.compared();
    println!("  {} frames sent, {compared:?}", rig.sent.len());
    println!(
        "  resets {:?}",
        rig.machine.resets.iter().map(|(ps, cause)| (ps / MS, *cause)).collect::<Vec<_>>()
    );
    for (number, session) in rig.sessions().iter().enumerate() {
        println!(
            "  session {number}: {} frames, losses {:?}, {} gaps",
            session.frames.len(),
            session.losses,
            session.gaps
        );
        for text in &session.texts {
            println!("    {text}");
        }
    }
    keep(rig)
}

/// 1: time over the erases of a first start.
fn clock(bench: &Bench) -> Outcome {
    for speed in [Speed::Typical, Speed::Longest] {
        let mut rig = bench.rig(Board::default());
        rig.machine.chip.flash.speed = speed;
        run(&mut rig, 3 * SECOND, false)?;
        run(&mut rig, 4 * SECOND, true)?;
        run(&mut rig, 6 * SECOND, false)?;
        let (sent, _) = rig.sent.first().ok_or("nothing was sent")?;
        let recorded = rig.sessions().first().and_then(|session| session.frames.first().map(|(ms, _)| *ms));
        let start = rig.machine.chip.flash.erases.first().map_or(0, |(_, at, _)| at / MS);
        println!(
            "  {speed:?}: first frame at {} ms after power, {recorded:?} ms in the record; first erase at {start} ms",
            sent / MS
        );
    }
    Ok(())
}

/// Fills the store by settings from a ground station, on the ground and disarmed, until a calm needs an erase.
fn fill(rig: &mut Rig) -> Outcome {
    const NAMES: [&str; 6] =
        ["BAT_TEMP_WARN", "ESC_TEMP_WARN", "MCU_TEMP_WARN", "VIBE_WARN", "CPU_LOAD_WARN", "LINK_LOSS_WARN"];
    for number in 0..360_u32 {
        let now = rig.machine.now();
        if number % 10 == 0 {
            let beat = heartbeat(number as u8);
            let end = rig.machine.send(0, &beat, now, common::BAUD);
            rig.sent.push((end, beat));
        }
        let name = NAMES[number as usize % NAMES.len()];
        rig.machine.send(1, &set(name, 20.0 + (number / 6) as f32 / 10.0, number as u8), now, 57_600.0);
        run(rig, now + 100 * MS, false)?;
    }
    println!(
        "  {} words written, {} erases since power",
        rig.machine.chip.flash.counts.1,
        rig.machine.chip.flash.erases.len()
    );
    Ok(())
}

/// 2: an erase in silence, with the watchdog's oscillator at its fastest and the flash at its slowest.
fn bitten(bench: &Bench) -> Outcome {
    for lsi_hz in [32_000, 40_000, 47_000] {
        let mut rig = bench.settled(Board { lsi_hz, ..Board::default() })?;
        rig.machine.chip.flash.speed = Speed::Longest;
        let begin = rig.machine.now() + SECOND;
        run(&mut rig, begin, false)?;
        fill(&mut rig)?;
        let until = rig.machine.now() + 12 * SECOND;
        run(&mut rig, until, false)?;
        let erases: Vec<_> =
            rig.machine.chip.flash.erases.iter().map(|(at, ps, long)| (at, ps / MS, long / MS)).collect();
        println!(
            "  LSI {lsi_hz}: erases {erases:?}, resets {:?}",
            rig.machine.resets.iter().map(|(ps, cause)| (ps / MS, *cause)).collect::<Vec<_>>()
        );
    }
    Ok(())
}

/// 3: the autopilot resumes while the store is erased.
fn untold(bench: &Bench) -> Outcome {
    for phase in [20, 60, 110, 170] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + SECOND;
        run(&mut rig, begin, false)?;
        fill(&mut rig)?;
        let end = rig.machine.now() + 20 * SECOND;
        while rig.machine.chip.flash.erases.is_empty() && rig.machine.now() < end {
            let next = rig.machine.now() + MS;
            run(&mut rig, next, false)?;
        }
        let now = rig.machine.now();
        run(&mut rig, now + phase * MS, false)?;
        run(&mut rig, now + 4 * SECOND, true)?;
        run(&mut rig, now + 8 * SECOND, false)?;
        println!("  resumed {phase} ms into the erase:");
        told(&rig)?;
    }
    Ok(())
}

/// 4: what never becomes ready.
fn dark(bench: &Bench) -> Outcome {
    for what in ["crystal dead at power-on", "crystal dies in flight", "random numbers never come"] {
        let mut rig = bench.rig(Board::default());
        match what {
            "crystal dead at power-on" => rig.machine.set_crystal(false),
            "random numbers never come" => rig.machine.chip.rng.behaves = Randomness::Never,
            _ => {}
        }
        run(&mut rig, 2 * SECOND, false)?;
        run(&mut rig, 4 * SECOND, true)?;
        if what == "crystal dies in flight" {
            rig.machine.set_crystal(false);
        }
        run(&mut rig, 15 * SECOND, true)?;
        let watched = rig.machine.chip.iwdg.is_running();
        println!(
            "  {what}: watchdog runs: {watched}, LED {:?}",
            rig.led.iter().map(|(ps, lit)| (ps / MS, *lit)).collect::<Vec<_>>()
        );
        told(&rig)?;
    }
    Ok(())
}

/// 5: the processor's load at full rate, with the flash's caches as they are and as they could be.
fn caches(bench: &Bench) -> Outcome {
    const CASES: [&str; 5] =
        ["after an erase", "settled", "prefetch alone", "caches and prefetch", "no wait states"];
    for what in CASES {
        let erased = what == "after an erase";
        let mut rig = if erased { bench.rig(Board::default()) } else { bench.settled(Board::default())? };
        let begin = rig.machine.now() + 2 * SECOND;
        run(&mut rig, begin, false)?;
        let art = &mut rig.machine.chip.art;
        match what {
            "prefetch alone" => art.prefetch = true,
            "caches and prefetch" => {
                art.prefetch = true;
                art.set_caches(true, true);
            }
            "no wait states" => art.latency = 0,
            _ => {}
        }
        let (mut worst, mut busy, mut instructions) = (0, 0, 0);
        for second in 1..=15 {
            let before =
                (rig.machine.core.cycles(), rig.machine.core.slept(), rig.machine.core.instructions());
            run(&mut rig, begin + second * SECOND, true)?;
            let slept = rig.machine.core.slept() - before.1;
            let now = rig.machine.core.cycles() - before.0 - slept;
            worst = worst.max(now);
            busy += now;
            instructions += rig.machine.core.instructions() - before.2;
        }
        let acr = rig.machine.chip.flash.acr();
        let (mean, worst) = (busy as f64 / 15.0 / 1.68e6, worst as f64 / 1.68e6);
        let each = busy as f64 / instructions as f64;
        let millions = instructions as f64 / 15e6;
        println!(
            "  {what}: ACR {acr:#x}, {mean:.1} % busy, {worst:.1} % in the worst second; {millions:.1} million instructions a second of {each:.2} cycles"
        );
    }
    Ok(())
}

/// Who has the processor at full rate, with the caches as they are and on: samples of a second and a half, by the
/// exception's number.
fn shares(bench: &Bench) -> Outcome {
    for caches in [false, true] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + 4 * SECOND;
        if caches {
            run(&mut rig, begin - SECOND, true)?;
            rig.machine.chip.art.prefetch = true;
            rig.machine.chip.art.set_caches(true, true);
        }
        run(&mut rig, begin, true)?;
        let mut counts = std::collections::BTreeMap::<&str, u32>::new();
        for sample in 1..=15_000_u64 {
            run(&mut rig, begin + sample * 101 * US, true)?;
            let who = match rig.machine.core.xpsr() & 0x1FF {
                0 if rig.machine.core.is_sleeping() => "sleep",
                0 => "thread",
                35 => "reception",
                36 => "monitor",
                37 => "downlink",
                38 => "storage",
                44 => "clock (TIM2)",
                _ => "others",
            };
            *counts.entry(who).or_default() += 1;
        }
        println!("  caches {caches}:");
        for (who, count) in counts {
            println!("    {who}: {:.1} %", f64::from(count) / 150.0);
        }
    }
    Ok(())
}

/// 6: a debugger that read the log and went.
fn debugger(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 2 * SECOND;
    run(&mut rig, begin, false)?;
    let block = rig.machine.image().find("_SEGGER_RTT").ok_or("no RTT in the image")?.address;
    // The first up-channel's flags: 24 bytes of head, then name, buffer, size, write, read, flags.
    rig.machine.poke(block + 24 + 20, |flags| flags & !3 | 2);
    for second in 1..=120 {
        run(&mut rig, begin + second * SECOND, second % 8 != 0)?;
        if rig.machine.resets.len() > 2 {
            break;
        }
    }
    let after: Vec<_> =
        rig.machine.resets[2..].iter().map(|(ps, cause)| ((ps - begin) / MS, *cause)).collect();
    println!("  resets {after:?} ms after the debugger went, until {} ms", (rig.machine.now() - begin) / MS);
    let written =
        rig.machine.memory(block + 24 + 12, 4).iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
    println!("  the log's place of writing: {written}");
    let now = rig.machine.now();
    run(&mut rig, now + 4 * SECOND, true)?;
    told(&rig)
}

/// 7: a transmitter that stands still.
fn transmitter(bench: &Bench) -> Outcome {
    for port in [0, 1] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + 2 * SECOND;
        run(&mut rig, begin, true)?;
        rig.machine.chip.usarts[port].is_stuck = true;
        rig.machine.take_sent(port);
        run(&mut rig, begin + 15 * SECOND, true)?;
        println!("  port {port}: {} bytes sent after that", rig.machine.take_sent(port).len());
        told(&rig)?;
    }
    Ok(())
}

/// 8: the flash refuses words, from the first one on or later.
fn refused(bench: &Bench) -> Outcome {
    for (refuses, after) in [(0, 1), (3, 1), (3, 20), (30, 1)] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + after * SECOND;
        run(&mut rig, begin, false)?;
        rig.machine.chip.flash.refuses = refuses;
        let before = rig.machine.chip.flash.counts.1;
        fill(&mut rig)?;
        println!(
            "  {refuses} refused: {} words written after that",
            rig.machine.chip.flash.counts.1 - before
        );
    }
    Ok(())
}

/// 9: the supply is low for a second.
fn supply(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 4 * SECOND;
    run(&mut rig, begin, true)?;
    rig.machine.set_supply(2_700);
    run(&mut rig, begin + SECOND, true)?;
    rig.machine.set_supply(3_300);
    run(&mut rig, begin + 4 * SECOND, true)?;
    run(&mut rig, begin + 8 * SECOND, false)?;
    told(&rig)
}

/// Power cut at moments of full rate, and in the erase of a calm: what is on the card and in the store afterwards.
fn cuts(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 2 * SECOND;
    run(&mut rig, begin, true)?;
    for cut in 1..=12_u64 {
        let at = rig.machine.now() + (1_000 + 173 * cut) * MS + cut * 7_919 * US;
        run(&mut rig, at, true)?;
        rig.machine.power_off();
        run(&mut rig, at + 200 * MS, false)?;
        rig.machine.power_on();
    }
    let end = rig.machine.now() + 4 * SECOND;
    run(&mut rig, end, true)?;
    println!("  12 cuts: {} sessions, {:?}", rig.sessions().len(), rig.compared());
    for part in [5, 100, 200, 300, 395] {
        let mut rig = bench.settled(Board::default())?;
        fill(&mut rig)?;
        let end = rig.machine.now() + 20 * SECOND;
        while rig.machine.chip.flash.erases.is_empty() && rig.machine.now() < end {
            let next = rig.machine.now() + MS;
            run(&mut rig, next, false)?;
        }
        let at = rig.machine.now() + part * MS;
        run(&mut rig, at, false)?;
        rig.machine.power_off();
        rig.machine.power_on();
        run(&mut rig, at + 5 * SECOND, true)?;
        let last = rig.sessions().pop().unwrap_or_default();
        println!("  {part} ms into the erase: {} frames after it, {:?}", last.frames.len(), last.texts);
    }
    Ok(())
}

/// A card that stands still, is silent or out for a while, at full rate; all times count from power-on.
fn cards(bench: &Bench) -> Outcome {
    let ms = |ms: u64| ms * 1_000_000;
    let silent = |long: u64| Plan::always(Fault::Silent).from(ms(6_000)).until(ms(6_000 + long));
    let cases = [
        ("busy 2.5 s", Some(Plan::always(Fault::Busy(ms(2_500))).from(ms(6_000)).times(1))),
        ("busy 60 ms at each block", Some(Plan::always(Fault::Busy(ms(60))).from(ms(6_000)))),
        ("silent 0.1 s", Some(silent(100))),
        ("silent 1.5 s", Some(silent(1_500))),
        ("silent 2.5 s", Some(silent(2_500))),
        ("three failed writes", Some(Plan::always(Fault::WriteError).from(ms(6_000)).times(3))),
        ("out for 6 s", None),
    ];
    for (what, plan) in cases {
        let plans = plan.into_iter().collect();
        let mut rig = Rig::with(&bench.image, Board::default(), bench.frames.clone(), plans);
        run(&mut rig, 4 * SECOND, false)?;
        run(&mut rig, 6 * SECOND, true)?;
        if plan.is_none() {
            rig.slot.event(Event::Pull);
            run(&mut rig, 12 * SECOND, true)?;
            rig.slot.event(Event::Insert(Model::new(Kind::Sdhc, rig.medium.clone())));
        }
        run(&mut rig, 14 * SECOND, true)?;
        run(&mut rig, 18 * SECOND, false)?;
        let told: Vec<_> = rig.sessions().iter().flat_map(|session| session.losses.clone()).collect();
        println!("  {what}: {:?}, told {told:?}, violations {:?}", rig.compared(), rig.slot.violations());
    }
    Ok(())
}

/// A sender whose clock is slow or fast.
fn senders(bench: &Bench) -> Outcome {
    for percent in [-5, -4, -2, 2, 4, 5] {
        let mut rig = bench.settled(Board::default())?;
        rig.fast = f64::from(percent) / 100.0;
        let begin = rig.machine.now() + SECOND;
        run(&mut rig, begin, false)?;
        run(&mut rig, begin + 5 * SECOND, true)?;
        run(&mut rig, begin + 9 * SECOND, false)?;
        println!("  {percent} %: {:?}, {:?}", rig.compared(), rig.machine.chip.usarts[0].counts);
    }
    Ok(())
}

/// 10: memory that flips, ten times 30 bits.
fn flips(bench: &Bench) -> Outcome {
    for seed in
        (1..=10_u64).filter(|seed| std::env::var("SEED").map_or(true, |only| only == seed.to_string()))
    {
        let mut rig = bench.settled(Board { seed, ..Board::default() })?;
        let begin = rig.machine.now() + 2 * SECOND;
        run(&mut rig, begin, true)?;
        let mut state = seed;
        let mut random = move |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for round in 1..=4 {
            for _ in 0..30 {
                let (at, bit) = (random(192 * 1024) as u32, random(8));
                let address = if at < 0x2_0000 { 0x2000_0000 + at } else { 0x1000_0000 + at - 0x2_0000 };
                rig.machine.poke(address, |byte| byte ^ 1 << bit);
            }
            if let Err(report) = rig.run(begin + 3 * round * SECOND, true) {
                println!("  seed {seed}: {}", report.reason);
                break;
            }
        }
        let now = rig.machine.now();
        let _ = rig.run(now + 3 * SECOND, false);
        keep(&rig)?;
        println!(
            "  seed {seed}: {:?}, resets {:?}",
            rig.compared(),
            rig.machine.resets[2..].iter().map(|(ps, cause)| (ps / MS, *cause)).collect::<Vec<_>>()
        );
    }
    Ok(())
}

/// 11: what a debugger's halt would freeze.
fn freeze(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 2 * SECOND;
    run(&mut rig, begin, true)?;
    let [cr, apb1, apb2] = rig.machine.chip.dbgmcu;
    println!(
        "  DBGMCU_CR {cr:#x}, APB1_FZ {apb1:#x} (IWDG is bit 12), APB2_FZ {apb2:#x}; watchdog's least margin {} us",
        rig.machine.chip.iwdg.nearest / US
    );
    Ok(())
}
