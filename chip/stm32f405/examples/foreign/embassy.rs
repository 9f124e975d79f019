//! Embassy's examples for the STM32F4: `examples/stm32f4/src/bin` of its repository, at the release of the `embassy-stm32` in
//! use. On an STM32F405ZG: 16 MHz, time driver on TIM12.

use stm32f405_model::gpio::Pin;
use stm32f405_model::machine::Machine;
use stm32f405_model::time::{MS, SECOND};

use crate::bench::{Outcome, expect, logged, logged_since, run, text};

/// PB7 changes each 300 ms; the watchdog of 1 s is fed five times, each 600 ms, and resets a second later.
pub(crate) fn wdt(machine: &mut Machine) -> Outcome {
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

/// Erases sector 5 and writes 32 numbers to its beginning. The next sectors do not exist: the HAL refuses, and it panics.
pub(crate) fn flash(machine: &mut Machine) -> Outcome {
    const SECTOR: u32 = 0x0802_0000;
    run(machine, 10 * SECOND)?;
    let erases: Vec<_> = machine.chip.flash.erases.iter().map(|(at, _, long)| (*at, long / MS)).collect();
    println!("  erases {erases:?}");
    let numbers: Vec<u8> = (1..=32).collect();
    expect(erases.len() == 1, "not one erase".to_owned())?;
    expect(machine.memory(SECTOR, 32) == numbers, format!("it holds {:?}", machine.memory(SECTOR, 32)))?;
    let rest = machine.memory(SECTOR + 32, 128 * 1024 - 32);
    expect(rest.iter().all(|byte| *byte == 0xFF), "it is not erased".to_owned())
}

/// A program by DMA at 115,200 baud, endlessly, with its count.
pub(crate) fn usart_dma(machine: &mut Machine) -> Outcome {
    run(machine, SECOND)?;
    let said = text(&machine.take_sent(2));
    let wanted: Vec<String> = (0..700).map(|number| format!("Hello DMA World {number}!\r\n")).collect();
    expect(wanted.concat().starts_with(&said), "it says something else".to_owned())?;
    // 86.8 us a character; it logs between lines.
    expect((10_000..=11_521).contains(&said.len()), format!("{} characters", said.len()))
}

/// Into a ring of 32 bytes, by interrupts; logs each byte.
pub(crate) fn usart_buffered(machine: &mut Machine) -> Outcome {
    run(machine, 50 * MS)?;
    for number in 1..=100_u8 {
        let at = (50 + 5 * u64::from(number)) * MS;
        let before = logged(machine);
        machine.send(2, &[number], at, 115_200.0);
        run(machine, at + 5 * MS)?;
        let new = logged_since(machine, before);
        expect(new.contains(&number) && new.len() < 100, format!("after {number} it logged {new:?}"))?;
    }
    Ok(())
}

/// PC13; sleeps in between.
pub(crate) fn button_exti(machine: &mut Machine) -> Outcome {
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

/// Three nested urgencies log all the time.
pub(crate) fn multiprio(machine: &mut Machine) -> Outcome {
    let mut counts = Vec::new();
    for second in 1..=10 {
        run(machine, second * SECOND)?;
        counts.push(logged(machine));
    }
    println!("  log's place after each second {counts:?}");
    expect(counts.windows(2).all(|pair| pair[1] != pair[0]), "it stands still".to_owned())
}
