//! Priorities of the tasks. Each task has an executor on an interrupt that the board does not use otherwise. Thread mode is idle
//! and runs only while every task waits.
//!
//! | urgency | what | why |
//! |---|---|---|
//! | 0 | the watch (`watch`) and the supply's | say what hangs, and that power goes |
//! | 1 | the port's interrupts | moves bytes, microseconds |
//! | 2 | the clock's interrupt | wakes tasks |
//! | 3 | reception | the ring holds 22 ms |
//! | 5 | monitor | the frame queue holds 14 ms |
//! | 7 | downlink | an alert has 50 ms; with it requests, uplink and USB with its interrupt, which only move bytes between ports and queues |
//! | 9 | storage | the sector queue holds 2.5 s; its library waits for the card with the processor |

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};

use crate::boards::board;
use crate::costs::{self, Stage};
use crate::exceptions::{DOWNLINK, MONITOR, RECEPTION, STORAGE};

static RECEPTION_EXECUTOR: InterruptExecutor = InterruptExecutor::new();
static MONITOR_EXECUTOR: InterruptExecutor = InterruptExecutor::new();
static DOWNLINK_EXECUTOR: InterruptExecutor = InterruptExecutor::new();
static STORAGE_EXECUTOR: InterruptExecutor = InterruptExecutor::new();

pub(crate) struct Spawners {
    pub(crate) reception: SendSpawner,
    pub(crate) monitor: SendSpawner,
    pub(crate) downlink: SendSpawner,
    pub(crate) storage: SendSpawner,
}

/// To be called once.
pub(crate) fn start() -> Spawners {
    for port in board::PORT_INTERRUPTS {
        port.set_priority(Priority::P1);
    }
    interrupt::TIM2.set_priority(Priority::P2);
    RECEPTION.set_priority(Priority::P3);
    MONITOR.set_priority(Priority::P5);
    DOWNLINK.set_priority(Priority::P7);
    interrupt::OTG_FS.set_priority(Priority::P7);
    STORAGE.set_priority(Priority::P9);
    Spawners {
        reception: RECEPTION_EXECUTOR.start(RECEPTION),
        monitor: MONITOR_EXECUTOR.start(MONITOR),
        downlink: DOWNLINK_EXECUTOR.start(DOWNLINK),
        storage: STORAGE_EXECUTOR.start(STORAGE),
    }
}

fn run(executor: &'static InterruptExecutor) {
    // SAFETY: only the interrupt that the executor was started with calls this, and its start unmasks that interrupt.
    costs::measure(Stage::Tasks, || unsafe { executor.on_interrupt() });
}

#[interrupt]
fn CAN1_TX() {
    run(&RECEPTION_EXECUTOR);
}

#[interrupt]
fn CAN1_RX0() {
    run(&MONITOR_EXECUTOR);
}

#[interrupt]
fn CAN1_RX1() {
    run(&DOWNLINK_EXECUTOR);
}

#[interrupt]
fn CAN1_SCE() {
    run(&STORAGE_EXECUTOR);
}
