//! Programs that are not ours, on the model: embassy's examples for the STM32F4, built for the STM32F405ZG and never
//! committed.
//!
//! `foreign FOLDER` runs those of [`PROGRAMS`] that are in the folder and tells what they did; what they should do is
//! in each function's text.

use std::error::Error;
use std::path::Path;

use stm32f405_model::gpio::Pin;
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::time::{MS, Ps, SECOND};

type Outcome = Result<(), Box<dyn Error>>;
type Program = (&'static str, fn(&mut Machine) -> Outcome);

const PROGRAMS: [Program; 6] = [
    ("wdt", wdt),
    ("flash", flash),
    ("usart_dma", usart_dma),
    ("usart_buffered", usart_buffered),
    ("button_exti", button_exti),
    ("multiprio", multiprio),
];

fn main() -> Outcome {
    let folder = std::env::args().nth(1).ok_or("foreign FOLDER")?;
    for (name, check) in PROGRAMS {
        let path = Path::new(&folder).join(name);
        if path.exists() {
            let mut machine = Machine::new(Image::parse(&std::fs::read(path)?)?, Board::default());
            match check(&mut machine) {
                Ok(()) => println!("{name}: did what it says; notes {:?}", machine.chip.notes),
                Err(error) => println!("{name}: {error}"),
            }
        }
    }
    Ok(())
}

fn run(machine: &mut Machine, until: Ps) -> Outcome {
    machine.run_until(until).map_err(|report| format!("{} in {}", report.reason, report.place).into())
}

fn expect(good: bool, what: String) -> Outcome {
    if good { Ok(()) } else { Err(what.into()) }
}

/// How many bytes of log were written: the place of writing in the first channel of RTT.
fn logged(machine: &Machine) -> u32 {
    let Some(block) = machine.image().find("_SEGGER_RTT") else { return 0 };
    let word = |at: u32| {
        machine.memory(block.address + at, 4).iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte))
    };
    word(24 + 12)
}

/// The LED on PB7 changes each 300 ms; the watchdog of 1 s is fed five times, each 600 ms, and resets a second after
/// the last one.
fn wdt(machine: &mut Machine) -> Outcome {
    let mut changes = Vec::new();
    let mut was = false;
    for ms in 2..9_000 {
        run(machine, ms * MS)?;
        let high = machine.chip.gpio.is_high(Pin(1, 7));
        if high != was {
            changes.push(ms);
            was = high;
        }
    }
    let resets: Vec<_> = machine.resets.iter().map(|(at, _)| at / MS).collect();
    println!("  LED changed at {:?} ms, resets at {resets:?} ms", &changes[..changes.len().min(8)]);
    let steps = changes[1..10].windows(2).all(|pair| (299..=301).contains(&(pair[1] - pair[0])));
    expect(
        steps && resets.len() == 3 && (3_995..4_010).contains(&(resets[1] - resets[0])),
        "not in time".to_owned(),
    )
}

/// Sectors 5 and 11 are erased, and 32 numbers written to the beginning of each.
fn flash(machine: &mut Machine) -> Outcome {
    run(machine, 10 * SECOND)?;
    println!(
        "  {:?}",
        machine.chip.flash.erases.iter().map(|(at, _, long)| (*at, long / MS)).collect::<Vec<_>>()
    );
    let numbers: Vec<u8> = (1..=32).collect();
    for at in [0x0802_0000, 0x080E_0000] {
        expect(machine.memory(at, 32) == numbers, format!("{at:#x} holds {:?}", machine.memory(at, 32)))?;
        expect(
            machine.memory(at + 32, 1_000).iter().all(|byte| *byte == 0xFF),
            "it is not erased".to_owned(),
        )?;
    }
    Ok(())
}

fn text(sent: &[(Ps, u8)]) -> String {
    sent.iter().map(|(_, byte)| char::from(*byte)).collect()
}

/// Greets by DMA at 115,200 baud, echoes five bytes, and then what comes until the line is idle.
fn usart_dma(machine: &mut Machine) -> Outcome {
    const BAUD: f64 = 115_200.0;
    let mut said = String::new();
    for round in 1..=3_u64 {
        run(machine, round * 100 * MS)?;
        machine.send(2, b"12345", round * 100 * MS, BAUD);
        run(machine, (round * 100 + 20) * MS)?;
        machine.send(2, b"until it is idle", (round * 100 + 20) * MS, BAUD);
        run(machine, (round * 100 + 50) * MS)?;
        said += &text(&machine.take_sent(2));
    }
    println!("  {said:?}");
    let wanted: String =
        ["0", "1", "2"].map(|n| format!("Hello DMA World {n}!\r\n12345until it is idle")).concat();
    expect(said.starts_with(&wanted), "it says something else".to_owned())
}

/// Receives by interrupts into a ring of 32 bytes, and echoes. Its log of what came keeps interrupts off for longer
/// than a character takes at 115,200 baud and 16 MHz: back to back the port is overrun, with pauses nothing is lost.
fn usart_buffered(machine: &mut Machine) -> Outcome {
    run(machine, 50 * MS)?;
    let all: Vec<u8> = (0..=255).collect();
    let slept = machine.core.slept();
    machine.send(2, &all, 50 * MS, 115_200.0);
    run(machine, 72 * MS)?;
    let busy = 1.0 - (machine.core.slept() - slept) as f64 / 352e3;
    run(machine, 150 * MS)?;
    let (echoed, overruns) = (machine.take_sent(2).len(), machine.chip.usarts[2].counts.overruns);
    println!("  back to back: {echoed} of 256 echoed, {overruns} overruns, {:.1} % busy", 100.0 * busy);
    for (number, byte) in (0..).zip(&all) {
        machine.send(2, &[*byte], (150 + number) * MS, 115_200.0);
    }
    run(machine, 450 * MS)?;
    let sent: Vec<u8> = machine.take_sent(2).iter().map(|(_, byte)| *byte).collect();
    let more = machine.chip.usarts[2].counts.overruns - overruns;
    expect(sent == all && more == 0, format!("with pauses it echoed {} of 256, {more} overruns", sent.len()))
}

/// Logs each edge of PC13, and sleeps between them.
fn button_exti(machine: &mut Machine) -> Outcome {
    run(machine, 50 * MS)?;
    let mut counts = vec![logged(machine)];
    for press in 1..=6_u64 {
        machine.drive(Pin(2, 13), Some(press % 2 == 1));
        run(machine, (50 + 10 * press) * MS)?;
        counts.push(logged(machine));
    }
    let slept = machine.core.slept() as f64 / machine.core.cycles() as f64;
    println!("  log bytes after each edge {counts:?}; asleep {:.1} %", 100.0 * slept);
    expect(counts.windows(2).all(|pair| pair[1] > pair[0]) && slept > 0.8, "an edge was not seen".to_owned())
}

/// Three urgencies that interrupt each other: log goes on all the time.
fn multiprio(machine: &mut Machine) -> Outcome {
    let mut counts = Vec::new();
    for second in 1..=10 {
        run(machine, second * SECOND)?;
        counts.push(logged(machine));
    }
    println!("  log's place after each second {counts:?}");
    expect(counts.windows(2).all(|pair| pair[1] != pair[0]), "it stands still".to_owned())
}
