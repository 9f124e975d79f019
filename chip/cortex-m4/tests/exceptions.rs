//! Scenarios of exceptions against QEMU.
use crate::common;

/// QEMU's differences: its line, and ours.
///
/// SCR has three bits; feature registers are the Cortex-M4 TRM's; FPCCR bit 10 (UFRDY) is ARMv8-M's.
const DIFFERENT: &[(&str, &str)] = &[
    ("  e000ed10 fffffff3", "  e000ed10 16"),
    ("  e000ed50 30", "  e000ed50 100030"),
    ("  e000ed60 1141110", "  e000ed60 1101110"),
    ("    fpccr c0000479 c0000478 control 4", "    fpccr c0000079 c0000078 control 4"),
    (
        "  s0 3f800000 s15 40400000 fpscr 81400010 (c0000478, 4)",
        "  s0 3f800000 s15 40400000 fpscr 81400010 (c0000078, 4)",
    ),
    ("  fpccr c0000478", "  fpccr c0000078"),
    ("  s1 12345678 (c0000478, 4)", "  s1 12345678 (c0000078, 4)"),
    ("  s2 33333333 (c0000470, 4)", "  s2 33333333 (c0000070, 4)"),
];

#[test]
#[ignore = "needs qemu-system-arm: cargo test -p cortex-m4-model exceptions:: -- --ignored"]
fn exceptions_go_as_they_go_in_qemu() {
    let folder = common::folder("exceptions");
    let elf = common::build("exceptions", &folder);
    let theirs = common::qemu(&elf, &[], &folder);
    let (ours, _, _) = common::model(&elf, &[], 100_000_000);
    std::fs::remove_dir_all(&folder).expect("the folder goes");
    let (mut scenario, mut wrong) = (String::new(), 0);
    for (line, (theirs, ours)) in theirs.lines().zip(ours.lines()).enumerate() {
        if !ours.starts_with(' ') {
            scenario = ours.into();
        }
        if theirs != ours && !DIFFERENT.contains(&(theirs, ours)) {
            wrong += 1;
            println!("{scenario}, line {line}:\n  QEMU:  {theirs}\n  model: {ours}");
        }
    }
    assert_eq!(wrong, 0, "lines differ");
    assert_eq!(theirs.lines().count(), ours.lines().count());
    println!("{} lines compared", ours.lines().count());
}
