//! `boot IMAGE SECONDS [FLIGHT.tlog|BYTES [CARD.img]]`: a tlog's frames come at their own times, other bytes back to
//! back at 921,600 baud, both from 1.5 s on. Run it with `cargo run --release -p hums-tests --example boot -- ...`.

use std::time::Instant;

use hums_tests::chip;
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::time::{MS, Ps, SECOND, US};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, image, seconds, rest @ ..] = arguments.as_slice() else {
        return Err("boot IMAGE SECONDS [FLIGHT [CARD]]".into());
    };
    let image = Image::parse(&std::fs::read(image)?)?;
    let until = (seconds.parse::<f64>()? * SECOND as f64) as Ps;
    let (mut machine, slot, medium) = chip::board(image, Board::default());
    let feed = match rest.first() {
        Some(path) => chip::Feed::read(path.as_ref(), 1_500 * MS)?,
        None => chip::Feed::default(),
    };
    let begun = Instant::now();
    let worst = fly(&mut machine, feed, until);
    let took = begun.elapsed().as_secs_f64();
    match worst {
        Ok(worst) => println!("worst second: {:.1} % busy", 100.0 * worst),
        Err(report) => println!("{report}"),
    }
    tell(&mut machine, took);
    println!("card: {:?}, violations {:?}, {} writes", slot.counts(), slot.violations(), medium.writes());
    if let Some(path) = rest.get(1) {
        chip::save(&medium, path.as_ref())?;
    }
    Ok(())
}

fn fly(
    machine: &mut Machine,
    mut feed: chip::Feed,
    until: Ps,
) -> Result<f64, Box<stm32f405_model::report::Report>> {
    let mut worst = 0.0_f64;
    while machine.now() < until {
        let to = (machine.now() / SECOND + 1) * SECOND;
        feed.give(machine, to);
        let before = (machine.core.cycles(), machine.core.slept());
        machine.run_until(to.min(until))?;
        let (cycles, slept) = (machine.core.cycles() - before.0, machine.core.slept() - before.1);
        if machine.now() > 2 * SECOND {
            worst = worst.max(1.0 - slept as f64 / cycles as f64);
        }
    }
    Ok(worst)
}

fn tell(machine: &mut Machine, took: f64) {
    let (cycles, slept) = (machine.core.cycles(), machine.core.slept());
    let busy = 100.0 - 100.0 * slept as f64 / cycles as f64;
    println!("{} ms, {cycles} cycles, {busy:.1} % busy; {took:.2} s here", machine.ms());
    println!("resets {:?}", machine.resets);
    println!("notes {:?}", machine.chip.notes);
    let flash = &machine.chip.flash;
    for (sector, at, long) in &flash.erases {
        println!("erase of {sector:#x} at {} us, {} ms", at / US, long / MS);
    }
    println!("flash: {:?}, ACR {:#x}, lines {:?}", flash.counts, flash.acr(), machine.chip.art.counts);
    for port in 0..2 {
        let counts = machine.chip.usarts[port].counts;
        let sent = machine.take_sent(port);
        println!("port {port}: {counts:?}, {} bytes sent", sent.len());
        let texts = sent
            .iter()
            .map(|(_, byte)| if (32..127).contains(byte) { char::from(*byte) } else { ' ' })
            .collect::<String>();
        println!(
            "  {}",
            texts.split_whitespace().filter(|word| word.len() > 2).collect::<Vec<_>>().join(" ")
        );
    }
}
