//! A whole program against QEMU, and the model's speed.
use crate::common;

#[test]
fn a_program_does_not_notice_that_it_is_interrupted() {
    let folder = common::folder("interrupted");
    let elf = common::build("work", &folder);
    let (undisturbed, _, _) = common::model(&elf, &[], u64::MAX);
    let mut state = 1u64;
    let mut random = |limit: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % limit
    };
    let (mut interrupts, mut deepest) = (0, 0);
    let disturbed = common::interrupted(&elf, 1, |core| {
        let count = 1 + random(3);
        for _ in 0..count {
            core.set_pending(random(32) as u16);
        }
        interrupts += count;
        deepest = deepest.max(0x203F_0000 - core.register(13));
        20 + random(400)
    });
    std::fs::remove_dir_all(&folder).expect("the folder goes");
    let lines: Vec<&str> = undisturbed.lines().take(1).collect();
    assert_eq!(disturbed.lines().collect::<Vec<_>>(), lines);
    assert!(interrupts > 5_000, "{interrupts}");
    assert!(deepest > 0x400, "nested: {deepest:#x} bytes of stack");
}

/// Others may be busy too.
fn on_processor() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[test]
#[ignore = "needs qemu-system-arm: cargo test -p cortex-m4-model work:: -- --ignored --nocapture"]
fn a_program_prints_what_it_prints_in_qemu() {
    let folder = common::folder("work");
    let elf = common::build("work", &folder);
    let theirs = common::qemu(&elf, &[], &folder);
    let start = on_processor();
    let (ours, _, core) = common::model(&elf, &[], u64::MAX);
    let seconds = (on_processor() - start) as f64 / 1e9;
    std::fs::remove_dir_all(&folder).expect("the folder goes");
    let (instructions, cycles) = (core.instructions() as f64, core.cycles() as f64);
    println!(
        "{:.0} million instructions in {seconds:.2} s: {:.0} million a second; {:.2} cycles each",
        instructions / 1e6,
        instructions / seconds / 1e6,
        cycles / instructions
    );
    assert_eq!(theirs, ours);
}
