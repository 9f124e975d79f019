//! Costs on the bus, and results of faults (`docs/cards.md`).
//!
//! `cargo test -p hums-sdcard costs:: -- --nocapture` prints them.

use hums_recorder::{Block, CardDevice as _, SpiCard};
use hums_sdcard::{Counts, Fault, Kind, MS, Medium, Model, Plan, Slot};

const BLOCKS: u32 = 64;
const IDENTIFIED_NS: u64 = 200 * MS;

fn model(medium: &Medium) -> Model {
    Model::new(Kind::Sdhc, medium.clone())
}

#[derive(Debug)]
struct Run {
    is_content: bool,
    /// Writes that failed.
    failed: u32,
    on_medium: bool,
    bytes: u64,
    selects: u64,
    ms: u64,
    violations: u64,
}

fn run(model: impl Fn(&Medium) -> Model, per_write: u32) -> Run {
    let medium = Medium::new(1 << 17);
    let slot = Slot::new(Some(model(&medium)));
    let driver = SpiCard::new(slot.port());
    assert!(driver.num_blocks().is_ok());
    slot.advance_to(IDENTIFIED_NS);
    let blocks: Vec<Block> = (0..BLOCKS).map(|index| [index as u8 + 1; 512]).collect();
    let (before, started_ns): (Counts, u64) = (slot.counts(), slot.now_ns());
    let violations = |slot: &Slot| slot.violations().values().map(|count| u64::from(*count)).sum::<u64>();
    let wrong = violations(&slot);
    let mut failed = 0;
    for (index, blocks) in blocks.chunks(per_write as usize).enumerate() {
        failed += u32::from(driver.write(blocks, 1_000 + index as u32 * per_write).is_err());
    }
    let after = slot.counts();
    Run {
        is_content: failed == 0,
        failed,
        on_medium: (0..BLOCKS).all(|index| medium.get(1_000 + index) == [index as u8 + 1; 512]),
        bytes: after.bytes - before.bytes,
        selects: after.selects - before.selects,
        ms: (slot.now_ns() - started_ns) / MS,
        violations: violations(&slot) - wrong,
    }
}

#[test]
fn bytes_on_the_bus_for_a_block() {
    // Only the protocol takes time.
    let quick = |medium: &Medium| Model { write_ns: (0, 0), ..model(medium) };
    println!("| blocks a write | bytes a block | selects a block | ms for {BLOCKS} on a usual card |");
    println!("|---|---|---|---|");
    for per_write in [1, 8] {
        let (at_once, usual) = (run(quick, per_write), run(model, per_write));
        assert!(at_once.is_content && at_once.on_medium && usual.is_content && usual.on_medium);
        let each = |count: u64| count as f64 / f64::from(BLOCKS);
        let (bytes, selects) = (each(at_once.bytes), each(at_once.selects));
        println!("| {per_write} | {bytes:.1} | {selects:.1} | {} |", usual.ms);
        assert_eq!(at_once.violations + usual.violations, 0);
        assert!(bytes < if per_write == 1 { 560.0 } else { 530.0 }, "{bytes}");
        assert!(selects <= 1.0);
    }
    assert!(run(model, 8).ms * 2 < run(model, 1).ms, "rows are what cards are fast at");
}

#[test]
fn what_the_driver_makes_of_a_fault() {
    let cases = [
        ("busy for 2.5 s, once", Plan::always(Fault::Busy(2_500 * MS)).skip(20).times(1), true),
        ("a block damaged on its way, once", Plan::always(Fault::DamagedWrite).skip(20).times(1), true),
        ("a command damaged on its way, once", Plan::always(Fault::DamagedCommand).skip(20).times(1), true),
        ("a command without answer, once", Plan::always(Fault::Silent).skip(20).times(1), true),
        ("a write error, once", Plan::always(Fault::WriteError).skip(20).times(1), false),
        ("a block taken and not programmed", Plan::always(Fault::NotProgrammed).skip(20).times(1), false),
    ];
    println!("| fault in a row of 8 | result |");
    println!("|---|---|");
    let told = |run: &Run| match (run.is_content, run.on_medium) {
        (true, true) => "on the card".to_owned(),
        (false, _) => format!("told: {} of {} rows fail", run.failed, BLOCKS / 8),
        (true, false) => "**lost, not told**".to_owned(),
    };
    for (name, plan, is_mended) in cases {
        let faulty = |medium: &Medium| model(medium).with(plan.from(IDENTIFIED_NS));
        let run = run(faulty, 8);
        println!("| {name} | {} |", told(&run));
        assert_eq!(run.is_content, is_mended, "{name}");
        assert_eq!(run.on_medium, is_mended, "{name}");
        assert!(run.failed <= 1, "{name}: one fault costs one row");
        assert_eq!(run.violations, 0, "{name}");
    }
}
