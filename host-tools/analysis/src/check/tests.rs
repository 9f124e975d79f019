//! Pauses of an autopilot's logging are no events of the vehicle.

#[path = "../../../formats/src/source/dataflash/tests/writer.rs"]
#[allow(dead_code, reason = "a writer for the tests of the reader, too")]
mod writer;

use super::judge::{Judge, Limits};
use crate::source::dataflash::binary;
use crate::source::item::Needs;
use crate::source::recording::Format;
use writer::Writer;

fn fly(log: &mut Writer, tenths: std::ops::Range<u64>, silent: bool) {
    for tenth in tenths {
        let time = (tenth * 100_000).to_le_bytes();
        if tenth % 10 == 0 {
            log.attitudes(tenth / 10..tenth / 10 + 1);
        }
        if silent {
            continue;
        }
        for instance in 0..4 {
            log.raw(164, &[&time, &[instance], &5_000_f32.to_le_bytes(), &16_f32.to_le_bytes()]);
        }
    }
}

fn silences(log: &Writer) -> usize {
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    let want = Needs { observations: true, ..Needs::default() };
    binary(&log.bytes[..], want, &mut |at, item| {
        judge.item(at, item);
        Ok(())
    })
    .expect("a log");
    let judged = judge.end();
    assert!(judged.judged.contains(&"esc_silent"), "{:?}", judged.not_judged);
    judged.problems.iter().filter(|problem| problem.check == "esc_silent").count()
}

fn begun() -> Writer {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(161, "EV", "QB", "TimeUS,Id");
    log.format(164, "ESC", "QBff", "TimeUS,Instance,RPM,Volt");
    log.message(1.0, "ArduCopter V4.6.3 (92b0cd78)");
    log.raw(161, &[&1_000_000_u64.to_le_bytes(), &[10]]);
    fly(&mut log, 10..200, false);
    log
}

#[test]
fn a_pause_of_20_seconds_is_no_silence_of_the_escs() {
    let mut log = begun();
    fly(&mut log, 400..600, false);
    assert_eq!(silences(&log), 0);
}

#[test]
fn escs_that_fall_silent_while_all_else_is_logged_are_found() {
    let mut log = begun();
    fly(&mut log, 200..400, true);
    fly(&mut log, 400..600, false);
    assert_eq!(silences(&log), 4);
}
