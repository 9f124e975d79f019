//! Random instructions of every class against QEMU, on edges of their operands.
//!
//! A batch is a program (`programs/steps.rs`) with some thousand states and instructions as data. After each, registers, flags,
//! fault status, return address and memory are compared. `CORTEX_BATCHES` is the number of batches (1), `CORTEX_SEED` the seed.
mod cases;
use crate::common;
mod patterns;
mod random;

use cases::{Case, generate, sequence};
use random::Random;
use std::collections::{BTreeMap, BTreeSet};

/// Addresses of a batch's parts in QEMU's mps2-an386.
const TESTS: usize = 12_000;
const SLOTS: u32 = 0x2100_1000;
const SLOT: u32 = 64;
/// Halfwords before it are for IT, or LDREX before STREX.
const AT: u32 = 24;
const SCRATCH: u32 = 0x2029_0000;
const SCRATCH_WORDS: usize = 96;
const STACK: u32 = SCRATCH + 0x100;
const PATTERN: u32 = 0x202A_0000;
const INPUTS: u32 = 0x2120_0000;
const OUTPUTS: u32 = 0x2160_0000;
const POINTERS: u32 = 0x2028_0000;
/// r4 to r11, s0 to s31, the frame, six of status, the scratch memory.
const RECORD: usize = 8 + 32 + 8 + 6 + SCRATCH_WORDS_STORED;
const SCRATCH_WORDS_STORED: usize = 96;

fn batch(seed: u64) -> Vec<Case> {
    let mut random = Random(seed | 1);
    let mut cases = Vec::new();
    let mut missing: BTreeSet<&str> = patterns::PATTERNS.iter().map(|&(name, _)| name).collect();
    while cases.len() < TESTS {
        let number = cases.len() as u32;
        let several = random.one_in(4).then(|| sequence(&mut random, number));
        if let Some(case) = several.or_else(|| generate(&mut random, number)) {
            missing.remove(case.name);
            cases.push(case);
        }
    }
    assert!(missing.is_empty(), "no instruction of {missing:?} can be tested");
    cases
}

fn bytes_of(words: impl IntoIterator<Item = u32>) -> Vec<u8> {
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

fn parts(cases: &[Case], seed: u64) -> Vec<(u32, Vec<u8>)> {
    let mut random = Random(seed ^ 0x5EED | 1);
    let mut pattern: Vec<u32> = (0..SCRATCH_WORDS)
        .map(|_| {
            // Odd, or a word's address.
            let word = random.next() & 0x0FFF_FFFF | random.of(&[3u32, 7, 9, 11]) << 28;
            if word & 1 == 1 { word } else { word & !3 }
        })
        .collect();
    // Small distances for TBB and TBH.
    pattern[92..].copy_from_slice(&[0x0003_0004, 0x0005_0006, 0x0001_0006, 0x0004_0002]);
    let pattern = bytes_of(pattern);
    let code = cases.iter().flat_map(|case| case.code).flat_map(u16::to_le_bytes).collect();
    vec![
        (POINTERS, bytes_of([OUTPUTS, INPUTS, cases.len() as u32, OUTPUTS])),
        (SCRATCH, pattern.clone()),
        (PATTERN, pattern),
        (SLOTS, code),
        (INPUTS, bytes_of(cases.iter().flat_map(Case::input))),
    ]
}

fn word_name(i: usize) -> String {
    const FRAME: [&str; 8] = ["r0", "r1", "r2", "r3", "r12", "lr", "pc", "xpsr"];
    const STATUS: [&str; 6] = ["psp", "fpscr", "ipsr", "cfsr", "exc_return", "hfsr"];
    match i {
        0..8 => format!("r{}", i + 4),
        8..40 => format!("s{}", i - 8),
        40..48 => FRAME[i - 40].into(),
        48..54 => STATUS[i - 48].into(),
        _ => format!("memory {:#x}", (i - 54) * 4),
    }
}

#[test]
#[ignore = "needs qemu-system-arm and some seconds a batch: cargo test -p cortex-m4-model steps:: -- --ignored"]
fn every_instruction_does_what_it_does_in_qemu() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let (batches, seed): (u64, u64) =
        (number("CORTEX_BATCHES").unwrap_or(1), number("CORTEX_SEED").unwrap_or(1));
    let folder = common::folder("steps");
    let elf = common::build("steps", &folder);
    let (mut differing, mut compared) = (BTreeMap::<String, u32>::new(), 0);
    for seed in (seed..).take(batches as usize) {
        let seed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let cases = batch(seed);
        let parts = parts(&cases, seed);
        let parts: Vec<(u32, &[u8])> = parts.iter().map(|(address, bytes)| (*address, &bytes[..])).collect();
        common::qemu(&elf, &parts, &folder);
        let theirs = std::fs::read(folder.join("out.bin")).expect("what the program stored");
        let (_, memory, _) = common::model(&elf, &parts, u64::MAX);
        assert_eq!(theirs.len(), (TESTS + 1) * RECORD * 4, "all tests were done in QEMU");
        for (i, case) in cases.iter().enumerate() {
            compared += 1;
            let first = (i + 1) * RECORD;
            let word =
                |at: usize| u32::from_le_bytes(theirs[at * 4..at * 4 + 4].try_into().expect("four bytes"));
            let differences: Vec<String> = (0..RECORD)
                .map(|j| (j, word(first + j), memory.word(OUTPUTS + ((first + j) * 4) as u32)))
                .filter(|(_, theirs, ours)| theirs != ours)
                .map(|(j, theirs, ours)| format!("{} is {ours:#x}, in QEMU {theirs:#x}", word_name(j)))
                .collect();
            if !differences.is_empty() {
                let count = differing.entry(case.name.into()).or_default();
                *count += 1;
                if *count <= 3 {
                    show(case, &differences);
                }
            }
        }
    }
    std::fs::remove_dir_all(&folder).expect("the folder goes");
    println!("{compared} instructions compared");
    assert!(differing.is_empty(), "{differing:?}");
}

fn show(case: &Case, differences: &[String]) {
    let place = (AT / 2) as usize;
    println!(
        "{}: {:?}\n  code {:04x?} start {:#x}",
        case.name,
        case.op,
        &case.code[place - 2..place + 2],
        case.start
    );
    println!("  r {:x?}\n  xpsr {:#x} fpscr {:#x}", case.r, case.xpsr, case.fpscr);
    if case.name.starts_with('v') {
        println!("  s {:x?}", case.s);
    }
    for difference in differences.iter().take(12) {
        println!("    {difference}");
    }
}
