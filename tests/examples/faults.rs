//! Results of faults that take too long for `cargo xtask test`, and the load of the processor: `faults IMAGE
//! FLIGHT.tlog [NAME...]`.

use std::error::Error;

use hums_sdcard::{Event, Fault, Kind, Model, Plan};
use hums_tests::chip;
use hums_tests::chip::rig::{Bench, Rig};
use stm32f405_model::image::Image;
use stm32f405_model::machine::Board;
use stm32f405_model::time::{MS, SECOND, US};

type Outcome = Result<(), Box<dyn Error>>;
type Scenario = (&'static str, fn(&Bench) -> Outcome);

const SCENARIOS: [Scenario; 9] = [
    ("caches", caches),
    ("shares", shares),
    ("first", first),
    ("refused", refused),
    ("supply", supply),
    ("cuts", cuts),
    ("cards", cards),
    ("senders", senders),
    ("flips", flips),
];

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, image, flight, names @ ..] = arguments.as_slice() else {
        return Err("faults IMAGE FLIGHT.tlog [NAME...]".into());
    };
    let tlog = std::fs::read(flight)?;
    let frames = chip::frames(&tlog).into_iter().map(|(_, frame)| frame.to_vec()).collect();
    let bench = Bench { image: Image::parse(&std::fs::read(image)?)?, frames };
    for (name, scenario) in SCENARIOS {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            println!("== {name}");
            scenario(&bench)?;
        }
    }
    Ok(())
}

fn keep(rig: &Rig) -> Outcome {
    if let Some(path) = std::env::var_os("CARD") {
        chip::save(&rig.medium, path.as_ref())?;
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

fn caches(bench: &Bench) -> Outcome {
    for what in ["as the image sets it", "prefetch alone", "nothing", "no wait states"] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + 2 * SECOND;
        rig.run(begin, false)?;
        let art = &mut rig.machine.chip.art;
        match what {
            "prefetch alone" => art.set_caches(false, false),
            "nothing" => {
                art.prefetch = false;
                art.set_caches(false, false);
            }
            "no wait states" => art.latency = 0,
            _ => {}
        }
        let (mut worst, mut busy, mut instructions) = (0, 0, 0);
        for second in 1..=15 {
            let before =
                (rig.machine.core.cycles(), rig.machine.core.slept(), rig.machine.core.instructions());
            rig.run(begin + second * SECOND, true)?;
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

fn shares(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 4 * SECOND;
    rig.run(begin, true)?;
    sample(&mut rig, 1_500)
}

fn first(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    for part in 1..=6 {
        let before = (rig.machine.core.cycles(), rig.machine.core.slept());
        println!("  the quarter of a second number {part}:");
        sample(&mut rig, 250)?;
        let (cycles, slept) = (rig.machine.core.cycles() - before.0, rig.machine.core.slept() - before.1);
        println!("  {:.1} % busy", 100.0 - 100.0 * slept as f64 / cycles as f64);
    }
    Ok(())
}

fn sample(rig: &mut Rig, ms: u64) -> Outcome {
    let begin = rig.machine.now();
    let samples = ms * 10;
    let mut counts = std::collections::BTreeMap::<&str, u32>::new();
    let mut functions = std::collections::BTreeMap::<String, u32>::new();
    for sample in 1..=samples {
        rig.run(begin + sample * 100 * US + sample % 7 * US, true)?;
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
        if who != "sleep" {
            let image = rig.machine.image();
            let name = image.symbol(rig.machine.core.register(15)).map_or("?", |(name, _)| name);
            *functions.entry(format!("{who} {name}")).or_default() += 1;
        }
    }
    for (who, count) in counts {
        println!("    {who}: {:.1} %", 100.0 * f64::from(count) / samples as f64);
    }
    let mut functions: Vec<_> = functions.into_iter().collect();
    functions.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    for (name, count) in functions.iter().take(25) {
        println!("    {:5.2} % {name}", 100.0 * f64::from(*count) / samples as f64);
    }
    Ok(())
}

fn refused(bench: &Bench) -> Outcome {
    for (refuses, after) in [(0, 1), (3, 1), (3, 20), (30, 1)] {
        let mut rig = bench.settled(Board::default())?;
        let begin = rig.machine.now() + after * SECOND;
        rig.run(begin, false)?;
        rig.machine.chip.flash.refuses = refuses;
        let before = rig.machine.chip.flash.counts.1;
        rig.fill()?;
        println!(
            "  {refuses} refused: {} words written after that",
            rig.machine.chip.flash.counts.1 - before
        );
    }
    Ok(())
}

fn supply(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 4 * SECOND;
    rig.run(begin, true)?;
    rig.machine.set_supply(2_700);
    rig.run(begin + SECOND, true)?;
    rig.machine.set_supply(3_300);
    rig.run(begin + 4 * SECOND, true)?;
    rig.run(begin + 8 * SECOND, false)?;
    told(&rig)
}

fn cuts(bench: &Bench) -> Outcome {
    let mut rig = bench.settled(Board::default())?;
    let begin = rig.machine.now() + 2 * SECOND;
    rig.run(begin, true)?;
    for cut in 1..=12_u64 {
        let at = rig.machine.now() + (1_000 + 173 * cut) * MS + cut * 7_919 * US;
        rig.run(at, true)?;
        rig.machine.power_off();
        rig.run(at + 200 * MS, false)?;
        rig.machine.power_on();
    }
    let end = rig.machine.now() + 4 * SECOND;
    rig.run(end, true)?;
    println!("  12 cuts: {} sessions, {:?}", rig.sessions().len(), rig.compared());
    for part in [5, 100, 200, 300, 395] {
        let mut rig = bench.settled(Board::default())?;
        rig.fill()?;
        let end = rig.machine.now() + 20 * SECOND;
        while rig.machine.chip.flash.erases.is_empty() && rig.machine.now() < end {
            let next = rig.machine.now() + MS;
            rig.run(next, false)?;
        }
        let at = rig.machine.now() + part * MS;
        rig.run(at, false)?;
        rig.machine.power_off();
        rig.machine.power_on();
        rig.run(at + 5 * SECOND, true)?;
        let last = rig.sessions().pop().unwrap_or_default();
        println!("  {part} ms into the erase: {} frames after it, {:?}", last.frames.len(), last.texts);
    }
    Ok(())
}

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
        rig.run(4 * SECOND, false)?;
        rig.run(6 * SECOND, true)?;
        if plan.is_none() {
            rig.slot.event(Event::Pull);
            rig.run(12 * SECOND, true)?;
            rig.slot.event(Event::Insert(Model::new(Kind::Sdhc, rig.medium.clone())));
        }
        rig.run(14 * SECOND, true)?;
        rig.run(18 * SECOND, false)?;
        let told: Vec<_> = rig.sessions().iter().flat_map(|session| session.losses.clone()).collect();
        println!("  {what}: {:?}, told {told:?}, violations {:?}", rig.compared(), rig.slot.violations());
    }
    Ok(())
}

fn senders(bench: &Bench) -> Outcome {
    for percent in [-5, -4, -2, 2, 4, 5] {
        let mut rig = bench.settled(Board::default())?;
        rig.fast = f64::from(percent) / 100.0;
        let begin = rig.machine.now() + SECOND;
        rig.run(begin, false)?;
        rig.run(begin + 5 * SECOND, true)?;
        rig.run(begin + 9 * SECOND, false)?;
        println!("  {percent} %: {:?}, {:?}", rig.compared(), rig.machine.chip.usarts[0].counts);
    }
    Ok(())
}

/// Ten times 30 bits.
fn flips(bench: &Bench) -> Outcome {
    for seed in
        (1..=10_u64).filter(|seed| std::env::var("SEED").map_or(true, |only| only == seed.to_string()))
    {
        let mut rig = bench.settled(Board { seed, ..Board::default() })?;
        let begin = rig.machine.now() + 2 * SECOND;
        rig.run(begin, true)?;
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
