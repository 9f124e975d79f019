//! For all judges.

use std::error::Error;

use stm32f405_model::gpio::Pin;
use stm32f405_model::machine::Machine;
use stm32f405_model::spi::Wire;
use stm32f405_model::time::{MS, Ps};

pub(crate) type Outcome = Result<(), Box<dyn Error>>;

pub(crate) fn run(machine: &mut Machine, until: Ps) -> Outcome {
    machine.run_until(until).map_err(|report| format!("{} in {}", report.reason, report.place).into())
}

pub(crate) fn expect(good: bool, what: String) -> Outcome {
    if good { Ok(()) } else { Err(what.into()) }
}

fn word(machine: &Machine, at: u32) -> u32 {
    machine.memory(at, 4).iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte))
}

fn channel(machine: &Machine) -> Option<[u32; 3]> {
    let block = machine.image().find("_SEGGER_RTT")?.address;
    // Behind 24 bytes and the name.
    Some([4, 8, 12].map(|at| word(machine, block + 24 + at)))
}

/// Bytes so far.
pub(crate) fn logged(machine: &Machine) -> u32 {
    channel(machine).map_or(0, |[.., written]| written)
}

pub(crate) fn logged_since(machine: &Machine, place: u32) -> Vec<u8> {
    let Some([buffer, ring, written]) = channel(machine) else { return Vec::new() };
    let bytes = (written + ring - place) % ring;
    (0..bytes).map(|at| machine.memory(buffer + (place + at) % ring, 1)[0]).collect()
}

pub(crate) fn log(machine: &Machine) -> String {
    let Some([buffer, _, written]) = channel(machine) else { return String::new() };
    String::from_utf8_lossy(machine.memory(buffer, written)).into_owned()
}

pub(crate) fn text(sent: &[(Ps, u8)]) -> String {
    sent.iter().map(|(_, byte)| char::from(*byte)).collect()
}

pub(crate) fn changes(
    machine: &mut Machine,
    pin: Pin,
    until_ms: u64,
) -> Result<Vec<(u64, bool)>, Box<dyn Error>> {
    let mut changes = Vec::new();
    let mut was = machine.chip.gpio.is_high(pin);
    for ms in machine.ms() + 1..=until_ms {
        run(machine, ms * MS)?;
        let high = machine.chip.gpio.is_high(pin);
        if high != was {
            changes.push((ms, high));
            was = high;
        }
    }
    Ok(changes)
}

/// Milliseconds.
pub(crate) fn pauses(changes: &[(u64, bool)]) -> Vec<u64> {
    changes.windows(2).map(|pair| pair[1].0 - pair[0].0).collect()
}

/// But for one.
pub(crate) fn expect_pauses(changes: &[(u64, bool)], ms: u64, least: usize) -> Outcome {
    let pauses = pauses(changes);
    let good = pauses.len() >= least && pauses.iter().all(|pause| pause.abs_diff(ms) <= 1);
    expect(good, format!("it changed after {pauses:?} ms, and not each {ms} ms"))
}

#[derive(Default)]
pub(crate) struct Tap(pub(crate) std::rc::Rc<std::cell::RefCell<(Vec<u8>, u32)>>);

impl Wire for Tap {
    fn exchange(&mut self, _: u64, hz: u32, sent: u8) -> u8 {
        let (bytes, fastest) = &mut *self.0.borrow_mut();
        bytes.push(sent);
        *fastest = hz.max(*fastest);
        0xFF
    }

    fn select(&mut self, _: u64, _: bool) {}
}
