//! Tasks by exception number: each task runs on an interrupt that no board uses otherwise.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::scb::VectActive;
use cortex_m::peripheral::{NVIC, SCB};
use embassy_stm32::interrupt::Interrupt;
use hums_onboard::Task;

pub(crate) const RECEPTION: Interrupt = Interrupt::CAN1_TX;
pub(crate) const MONITOR: Interrupt = Interrupt::CAN1_RX0;
pub(crate) const DOWNLINK: Interrupt = Interrupt::CAN1_RX1;
pub(crate) const STORAGE: Interrupt = Interrupt::CAN1_SCE;

/// 0 is thread mode.
pub(crate) fn running() -> u16 {
    match SCB::vect_active() {
        VectActive::ThreadMode => 0,
        VectActive::Exception(exception) => (16 + i16::from(exception.irqn())) as u16,
        VectActive::Interrupt { irqn } => 16 + u16::from(irqn),
    }
}

pub(crate) fn number_of(task: Task) -> u16 {
    let interrupt = match task {
        Task::Reception => RECEPTION,
        Task::Monitor => MONITOR,
        Task::Downlink => DOWNLINK,
        Task::Storage => STORAGE,
    };
    16 + interrupt as u16
}

pub(crate) fn rank(number: u16) -> usize {
    match Task::ALL.into_iter().position(|task| number_of(task) == number) {
        Some(place) => 1 + place,
        None if number == 0 => 1 + Task::ALL.len(),
        None => 0,
    }
}

pub(crate) fn begun() -> u16 {
    Task::ALL.into_iter().map(number_of).find(|number| NVIC::is_active(Number(number - 16))).unwrap_or(0)
}

#[derive(Clone, Copy)]
struct Number(u16);

// SAFETY: the numbers are those of interrupts that there are.
unsafe impl InterruptNumber for Number {
    fn number(self) -> u16 {
        self.0
    }
}

pub(crate) fn task_of(number: u16) -> &'static str {
    match Task::ALL.into_iter().find(|task| number_of(*task) == number) {
        Some(task) => task.name(),
        None if number == 0 => "idle",
        None if number < 16 => "exception",
        None => "interrupt",
    }
}
