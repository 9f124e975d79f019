//! Faults of the program itself, provoked from outside: each leaves a note with its place.

use hums_tests::chip::rig::Rig;
use stm32f405_model::machine::Board;
use stm32f405_model::memory::CCM;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::MS;

use super::{assert_heard, ready};

/// The tasks' handlers, by their names in the vector table.
const RECEPTION: &str = "CAN1_TX";
const MONITOR: &str = "CAN1_RX0";
const DOWNLINK: &str = "CAN1_RX1";
const STORAGE: &str = "CAN1_SCE";

/// `wfi; b .-2`: the model has few instructions to run.
const HANG: [u8; 4] = [0x30, 0xBF, 0xFD, 0xE7];
/// `mov.w r0, #0x30000000`, an address without memory; `ldr r0, [r0]`
const BUS_FAULT: [u8; 6] = [0x4F, 0xF0, 0x40, 0x50, 0x00, 0x68];
/// `push {r0-r7, lr}`, again and again.
const OVERFLOW: [u8; 4] = [0xFF, 0xB5, 0xFD, 0xE7];

/// The watchdog's second and the rest of a tick.
const NOTICED_MS: u64 = 1_100;
/// Storage may wait for its card: it reports in each 10 s only (`hums_onboard::supervisor`).
const STORAGE_NOTICED_MS: u64 = 11_100;
/// Frames of full rate: memory, a quarter of a second, and the start.
const LOST_MAX: usize = 700;

fn flying() -> Rig {
    let (mut rig, begin) = ready(Board::default());
    rig.run(begin + 500 * MS, true).unwrap();
    rig
}

#[track_caller]
fn survives(rig: &mut Rig, since: u64, expected: Cause, within_ms: u64, [fault, told]: [&str; 2]) {
    let (at, cause) = *rig.machine.resets.last().unwrap();
    let after_ms = (at - since) / MS;
    assert!(cause == expected && after_ms < within_ms, "{cause:?} after {after_ms} ms");
    rig.machine.take_sent(1);
    rig.run(at + 500 * MS, true).unwrap();
    rig.run(at + 2_000 * MS, false).unwrap();
    let session = rig.sessions().pop().unwrap();
    assert!(session.frames.len() > 500, "{} frames after it", session.frames.len());
    assert!(session.texts.iter().any(|text| text == fault), "not «{fault}» but {:#?}", session.texts);
    let before = session.texts.iter().find_map(|text| text.strip_prefix("restart at "));
    let (_, messages) =
        before.and_then(|text| text.split_once("; last messages: ")).expect("the last messages");
    assert_eq!(messages.split(", ").count(), 8, "{messages}");
    assert_heard(rig, told);
    let compared = rig.compared();
    let missed = if cause == Cause::Watchdog { NOTICED_MS as usize * 2 } else { 0 };
    assert!(compared.wrong == 0 && compared.missing < LOST_MAX + missed, "{compared:?}");
}

#[test]
fn a_task_that_never_comes_back_is_named_by_the_next_start_however_urgent_it_is() {
    for (handler, task, within_ms) in [
        (RECEPTION, "reception", NOTICED_MS),
        (MONITOR, "monitor", NOTICED_MS),
        (STORAGE, "storage", STORAGE_NOTICED_MS),
    ] {
        let mut rig = flying();
        let since = rig.machine.now();
        let address = rig.replace(handler, &HANG, handler != STORAGE).unwrap();
        let fault = format!("fault: hangs in {task} at pc {:08x}", address + 2);
        let told = format!("HUMS: restarted after: watchdog ({task})");
        survives(&mut rig, since, Cause::Watchdog, within_ms, [&fault, &told]);
    }
}

#[test]
fn a_fault_of_the_processor_is_survived_recorded_and_told() {
    let mut rig = flying();
    let since = rig.machine.now();
    let address = rig.replace(STORAGE, &BUS_FAULT, true).unwrap();
    let fault = format!("fault: processor fault in storage at pc {:08x}", address + 4);
    let told = "HUMS: restarted after: processor fault (storage)";
    survives(&mut rig, since, Cause::Software, NOTICED_MS, [&fault, told]);
}

#[test]
fn a_full_stack_hurts_nobody_and_is_survived_recorded_and_told() {
    let mut rig = flying();
    let since = rig.machine.now();
    // The pushed value is not a return address.
    rig.replace(MONITOR, &OVERFLOW, true).unwrap();
    let fault = "fault: stack overflow in monitor at called from 00000000";
    let told = "HUMS: restarted after: stack overflow (monitor)";
    survives(&mut rig, since, Cause::Software, NOTICED_MS, [fault, told]);
}

#[test]
fn a_panic_is_survived_recorded_and_told() {
    const FILE: &[u8] = b"firmware/provoked.rs";
    let mut rig = flying();
    let place = CCM.0 + 64;
    let words = [place + 16, FILE.len() as u32, 7, 1];
    let bytes = words.iter().flat_map(|word| word.to_le_bytes()).chain(FILE.iter().copied());
    for (at, byte) in (place..).zip(bytes) {
        rig.machine.poke(at, |_| byte);
    }
    let panics = rig.machine.image().find("panic_bounds_check").unwrap().address | 1;
    // `movw` and `movt` of each and of the function, `bx r3`
    let code = [load(0, 8), load(1, 8), load(2, place), load(3, panics)].concat();
    let since = rig.machine.now();
    rig.replace(DOWNLINK, &[&code[..], &[0x18, 0x47]].concat(), true).unwrap();
    let fault = "fault: panic in downlink at firmware/provoked.rs:7";
    let told = "HUMS: restarted after: panic (downlink)";
    survives(&mut rig, since, Cause::Software, NOTICED_MS, [fault, told]);
}

fn load(register: u16, word: u32) -> Vec<u8> {
    let half = |first: u16, value: u16| {
        let (imm4, i, imm3, imm8) = (value >> 12, value >> 11 & 1, value >> 8 & 7, value & 0xFF);
        [first | i << 10 | imm4, imm3 << 12 | register << 8 | imm8]
    };
    let code = [half(0xF240, word as u16), half(0xF2C0, (word >> 16) as u16)].concat();
    code.into_iter().flat_map(u16::to_le_bytes).collect()
}
