//! Who may interrupt whom. One executor a task, each on an interrupt that the board does not use otherwise; thread mode
//! is idle, and runs only when every task waits.
//!
//! | urgency | what | why |
//! |---|---|---|
//! | 0 | the watch (`watch`) and the supply's | say what hangs, and that power goes |
//! | 1 | the port's interrupts | moves bytes, microseconds |
//! | 2 | the clock's interrupt | wakes tasks |
//! | 3 | reception | the ring holds 22 ms |
//! | 5 | monitor | the frame queue holds 16 ms |
//! | 7 | downlink | an alert has 50 ms; with it requests and uplink, which only move bytes between ports and queues |
//! | 9 | storage | the sector queue holds 2.5 s; its library waits for the card with the processor |

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::scb::VectActive;
use cortex_m::peripheral::{NVIC, SCB};
use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use hums_onboard::Task;

use crate::boards::board;
use crate::costs::{self, Stage};
use crate::memory::depth;

static RECEPTION: InterruptExecutor = InterruptExecutor::new();
static MONITOR: InterruptExecutor = InterruptExecutor::new();
static DOWNLINK: InterruptExecutor = InterruptExecutor::new();
static STORAGE: InterruptExecutor = InterruptExecutor::new();

/// Where to spawn each task.
pub(crate) struct Spawners {
    pub(crate) reception: SendSpawner,
    pub(crate) monitor: SendSpawner,
    pub(crate) downlink: SendSpawner,
    pub(crate) storage: SendSpawner,
}

/// Starts all executors. To be called once.
pub(crate) fn start() -> Spawners {
    for port in board::PORT_INTERRUPTS {
        port.set_priority(Priority::P1);
    }
    interrupt::TIM2.set_priority(Priority::P2);
    interrupt::CAN1_TX.set_priority(Priority::P3);
    interrupt::CAN1_RX0.set_priority(Priority::P5);
    interrupt::CAN1_RX1.set_priority(Priority::P7);
    interrupt::CAN1_SCE.set_priority(Priority::P9);
    Spawners {
        reception: RECEPTION.start(interrupt::CAN1_TX),
        monitor: MONITOR.start(interrupt::CAN1_RX0),
        downlink: DOWNLINK.start(interrupt::CAN1_RX1),
        storage: STORAGE.start(interrupt::CAN1_SCE),
    }
}

/// The number of the exception that runs; 0 is thread mode.
pub(crate) fn running() -> u16 {
    match SCB::vect_active() {
        VectActive::ThreadMode => 0,
        VectActive::Exception(exception) => (16 + i16::from(exception.irqn())) as u16,
        VectActive::Interrupt { irqn } => 16 + u16::from(irqn),
    }
}

/// The number of the exception that a task runs as.
pub(crate) fn number_of(task: Task) -> u16 {
    let interrupt = match task {
        Task::Reception => interrupt::CAN1_TX,
        Task::Monitor => interrupt::CAN1_RX0,
        Task::Downlink => interrupt::CAN1_RX1,
        Task::Storage => interrupt::CAN1_SCE,
    };
    16 + interrupt as u16
}

/// The most urgent task that has begun and not come to its end, for want of a stacked number: it ran until now.
pub(crate) fn begun() -> u16 {
    // As they interrupt each other.
    let tasks = [Task::Reception, Task::Monitor, Task::Downlink, Task::Storage];
    tasks.into_iter().map(number_of).find(|number| NVIC::is_active(Number(number - 16))).unwrap_or(0)
}

/// An interrupt by its number.
#[derive(Clone, Copy)]
struct Number(u16);

// SAFETY: the numbers are those of interrupts that there are.
unsafe impl InterruptNumber for Number {
    fn number(self) -> u16 {
        self.0
    }
}

/// What runs as an exception, by its number.
pub(crate) fn task_of(number: u16) -> &'static str {
    match Task::ALL.into_iter().find(|task| number_of(*task) == number) {
        Some(task) => task.name(),
        None if number == 0 => "idle",
        None if number < 16 => "exception",
        None => "interrupt",
    }
}

/// Runs a task's executor, on the account of the urgency at this place of `memory::depth::NAMES`.
fn run(executor: &'static InterruptExecutor, urgency: usize) {
    // SAFETY: only the interrupt that the executor was started with calls this, and its start unmasks that interrupt.
    let work = || costs::measure(Stage::Tasks, || unsafe { executor.on_interrupt() });
    depth::of(urgency, work);
}

#[interrupt]
fn CAN1_TX() {
    run(&RECEPTION, 1);
}

#[interrupt]
fn CAN1_RX0() {
    run(&MONITOR, 2);
}

#[interrupt]
fn CAN1_RX1() {
    run(&DOWNLINK, 3);
}

#[interrupt]
fn CAN1_SCE() {
    run(&STORAGE, 4);
}
