//! Memory of `hums sim --firmware`, as `tests/sim/memory.rs` has it of the other commands.

use std::fs;

use hums_tests::hostile;
use hums_tests::program::{Machine, Recording};

/// KiB beyond an empty run: 20 bytes for each byte of the input.
const ABOVE_KIB_MAX: u64 = 20 << 10;

#[test]
fn an_input_that_comes_faster_than_the_line_takes_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let memory = |zeros: usize| {
        let input = hostile::raw_heartbeats(dir.path(), 100);
        let mut bytes = fs::read(&input).unwrap();
        bytes.resize(bytes.len() + zeros, 0);
        fs::write(&input, bytes).unwrap();
        // All of it within a millisecond, which the line carries in eleven seconds.
        let flags = ["--line-rate", "4294967295", "--card-size", "64"];
        let run = Recording::attempt(Machine::Chip, &input, &flags).expect_code(&[0, 3]);
        assert_eq!(run.number("frames_in"), 100);
        run.outcome.memory_kib_max
    };
    let (empty, most) = (memory(0), memory(1 << 20));
    assert!(most <= empty + ABOVE_KIB_MAX, "{most} KiB, an empty run {empty} KiB");
}
