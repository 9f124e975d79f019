//! Examples of the package `stm32f4xx-hal`.

use stm32f405_model::gpio::Pin;
use stm32f405_model::machine::Machine;
use stm32f405_model::time::{MS, Ps, SECOND};

use crate::bench::{Outcome, Tap, changes, expect, expect_pauses, pauses, run, text};

/// Number less one, and rate, by the sources.
const USART1: usize = 0;
const USART2: usize = 1;
const FAST: f64 = 115_200.0;
const SLOW: f64 = 9_600.0;
const BUTTON: Pin = Pin(0, 0);
const LED: Pin = Pin(2, 13);

/// Six bytes by DMA with interrupts, then six by polling.
pub(crate) fn serial_dma(machine: &mut Machine) -> Outcome {
    let mut heard = Vec::new();
    for (round, sent) in (1..).zip([b"by DMA", b"by ask", b"no one"]) {
        run(machine, round * 50 * MS)?;
        // Each byte after the one before was taken.
        machine.send(USART2, sent, round * 50 * MS, FAST);
        run(machine, (round * 50 + 40) * MS)?;
        heard.push(text(&machine.take_sent(USART2)));
    }
    expect(heard == ["by DMA", "by ask", ""], format!("it echoed {heard:?}"))
}

/// Into two buffers by DMA through its FIFO, until the line is silent. (Its interrupt never clears that flag: the
/// buffers change until the next byte, by chance.)
pub(crate) fn rtic_serial_dma_rx_idle(machine: &mut Machine) -> Outcome {
    const TEXTS: [&[u8]; 3] = [b"the first of them", b"another one", b"a third text, longer than the first"];
    const SRAM: u32 = 0x2000_0000;
    let mut places = Vec::new();
    for (round, sent) in (1..).zip(TEXTS) {
        run(machine, round * 100 * MS)?;
        machine.send(USART1, sent, round * 100 * MS, SLOW);
        run(machine, (round * 100 + 90) * MS)?;
        let memory = machine.memory(SRAM, 32 * 1024);
        places.push(memory.windows(sent.len()).position(|bytes| bytes == sent));
    }
    let [Some(a), Some(b), Some(c)] = places[..] else {
        return Err(format!("texts are in memory at {places:?}").into());
    };
    let apart = [a.abs_diff(b), b.abs_diff(c), a.abs_diff(c)];
    expect(
        apart.iter().all(|bytes| *bytes == 0 || *bytes >= 100),
        format!("texts are in memory at {places:?}"),
    )?;
    let counts = machine.chip.usarts[USART1].counts.overruns;
    expect(counts == 0, format!("{counts} overruns"))
}

/// 0 to 99 by DMA, at the HAL's choice for 3 MHz (16 MHz by four). Then 1 to 100 by interrupt; halts as it takes a
/// buffer twice.
pub(crate) fn spi_dma(machine: &mut Machine) -> Outcome {
    let tap = Tap::default();
    let heard = tap.0.clone();
    machine.connect(1, Pin(3, 0), Box::new(tap));
    run(machine, SECOND)?;
    let (bytes, fastest) = &*heard.borrow();
    let wanted: Vec<u8> = (0..100).chain(1..=100).collect();
    expect(*bytes == wanted, format!("it sent {bytes:?}"))?;
    expect(*fastest == 4_000_000, format!("its clock has {fastest} Hz"))
}

/// A button by EXTI; the pull-up holds it high.
pub(crate) fn rtic_button(machine: &mut Machine) -> Outcome {
    let mut seen = Vec::new();
    for press in 0..5 {
        run(machine, (press * 20 + 10) * MS)?;
        machine.drive(BUTTON, Some(false));
        run(machine, (press * 20 + 15) * MS)?;
        seen.push(machine.chip.gpio.is_high(LED));
        machine.drive(BUTTON, None);
        run(machine, (press * 20 + 20) * MS)?;
        expect(machine.chip.gpio.is_high(LED) == seen[press as usize], "it toggled at a release".to_owned())?;
    }
    expect(machine.chip.gpio.is_high(BUTTON), "the button is not pulled up".to_owned())?;
    expect(seen == [true, false, true, false, true], format!("the LED was {seen:?}"))?;
    let hz = machine.chip.time.hz();
    expect(hz == 100_000_000, format!("it runs at {hz} Hz"))
}

/// An LED by tasks on TIM3's compare and overflow.
pub(crate) fn rtic_tick(machine: &mut Machine) -> Outcome {
    let changes = changes(machine, LED, 10_500)?;
    expect_pauses(&changes, 1_000, 8)
}

/// TIM5's one-pulse mode.
pub(crate) fn delay_timer_blinky(machine: &mut Machine) -> Outcome {
    let changes = changes(machine, LED, 17_500)?;
    let pauses = pauses(&changes);
    // The pin becomes an output, at once or with the level.
    let good = changes.windows(2).all(|pair| {
        let wanted = if pair[0].1 { 1_000 } else { 3_000 };
        (pair[1].0 - pair[0].0).abs_diff(wanted) <= 2
    });
    expect(good && pauses.len() >= 7, format!("it changed after {pauses:?} ms"))
}

/// Toggles the LED each second by TIM2's update.
pub(crate) fn blinky_timer_irq(machine: &mut Machine) -> Outcome {
    let changes = changes(machine, Pin(0, 5), 8_500)?;
    // "Off" before the timer begins.
    expect_pauses(&changes[1..], 1_000, 6)
}

/// A delay by `SysTick`, whose 24 bits do not reach a second.
pub(crate) fn delay_syst_blinky(machine: &mut Machine) -> Outcome {
    let changes = changes(machine, Pin(0, 5), 8_500)?;
    expect_pauses(&changes, 1_000, 6)
}

/// 115,200 baud by interrupts: echo, `status` prints the LED, the button turns it.
pub(crate) fn rtic_usart_shell(machine: &mut Machine) -> Outcome {
    let typed = |machine: &mut Machine, words: &str, at: Ps| -> Result<String, Box<dyn std::error::Error>> {
        for (number, byte) in (0..).zip(words.bytes()) {
            machine.send(USART1, &[byte], at + number * 10 * MS, FAST);
        }
        run(machine, at + 300 * MS)?;
        Ok(text(&machine.take_sent(USART1)))
    };
    run(machine, 50 * MS)?;
    let first = typed(machine, "status\r", 50 * MS)?;
    expect(first.starts_with("status") && first.contains("LED: On") && first.ends_with("#> "), first)?;
    let off = typed(machine, "off\r", 400 * MS)?;
    expect(off.starts_with("off") && machine.chip.gpio.is_high(LED), off)?;
    let second = typed(machine, "status\r", 800 * MS)?;
    expect(second.contains("LED: Off"), second)?;
    machine.drive(BUTTON, Some(false));
    run(machine, 1_150 * MS)?;
    machine.drive(BUTTON, None);
    let third = typed(machine, "status\r", 1_200 * MS)?;
    expect(third.contains("LED: On") && !machine.chip.gpio.is_high(LED), third)?;
    let unknown = typed(machine, "fly\r", 1_600 * MS)?;
    expect(unknown.contains("unsupported command"), unknown)
}
