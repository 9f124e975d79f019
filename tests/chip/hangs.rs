//! A task that never comes back: the watchdog resets, and the next start tells which task, and where it was.

use stm32f405_model::machine::Board;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, SECOND};

use crate::bench;

/// From the moment that a task hangs: the watchdog's second and what is left of a tick, or its own second before where it only waits.
const NOTICED_MS: u64 = 1_100;

#[track_caller]
fn hangs(handler: &str, task: &str) {
    let mut rig = bench().settled(Board::default()).unwrap();
    let begin = rig.machine.now() + SECOND;
    rig.run(begin, false).unwrap();
    rig.run(begin + 500 * MS, true).unwrap();
    let address = rig.hang(handler).unwrap();
    let (at, cause) = *rig.machine.resets.last().unwrap();
    let after_ms = (at - begin) / MS - 500;
    assert_eq!(cause, Cause::Watchdog);
    assert!(after_ms < NOTICED_MS, "{after_ms} ms");
    rig.run(at + 500 * MS, true).unwrap();
    rig.run(at + 1_500 * MS, false).unwrap();
    let session = rig.sessions().pop().unwrap();
    let wanted = format!("fault: hangs in {task} at pc {address:08x}");
    assert!(session.texts.contains(&wanted), "not «{wanted}» but {:#?}", session.texts);
    assert!(session.frames.len() > 500, "{} frames after it", session.frames.len());
}

#[test]
fn a_task_that_never_comes_back_is_named_by_the_next_start() {
    hangs("CAN1_TX", "reception");
    hangs("CAN1_RX0", "monitor");
}
