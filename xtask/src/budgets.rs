//! The firmware's size against `budgets.toml`.
//!
//! Flash is what is programmed (code, constants and the initial values of variables); RAM and CCM are the static
//! variables in each memory, so that what is left is the stack's.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context as _, Result, bail};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, FileHeader as _, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSection as _, SectionFlags};
use serde::Deserialize;

use crate::firmware::{self, Board};
use crate::repo;

/// The memories: name, first address, one past the last of the board that has most of it.
const MEMORIES: [(&str, u64, u64); 3] = [
    ("flash", 0x0800_0000, 0x0820_0000),
    ("ram", 0x2000_0000, 0x2003_0000),
    ("ccm", 0x1000_0000, 0x1001_0000),
];

/// One limit of `budgets.toml`, in bytes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bytes {
    pub(crate) bytes_max: u64,
    pub(crate) reason: String,
}

/// One limit of `budgets.toml`, in cycles of the processor.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cycles {
    /// For each frame.
    pub(crate) per_frame_max: f64,
    pub(crate) reason: String,
}

/// What the processor may be busy at the fastest line.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Load {
    /// In percent, of all of it, in the worst second.
    pub(crate) percent_max: f64,
    pub(crate) reason: String,
}

/// A board's limits.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfBoard {
    spare_min: u64,
    memory: BTreeMap<String, Bytes>,
}

/// All of `budgets.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Budgets {
    f405: OfBoard,
    f429: OfBoard,
    /// By urgency.
    pub(crate) stack: BTreeMap<String, Bytes>,
    /// By stage.
    pub(crate) cycles: BTreeMap<String, Cycles>,
    pub(crate) load: Load,
}

impl Budgets {
    pub(crate) fn read() -> Result<Self> {
        let path = repo::root().join("budgets.toml");
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        toml::from_str(&text).with_context(|| format!("{}", path.display()))
    }

    /// What the stack takes when every urgency interrupts the one below it at its deepest.
    pub(crate) fn stack_bytes(&self) -> u64 {
        self.stack.values().map(|budget| budget.bytes_max).sum()
    }

    fn of(&self, board: Board) -> &OfBoard {
        match board {
            Board::F405 => &self.f405,
            Board::F429 => &self.f429,
        }
    }
}

/// Builds for these boards, prints what they take and fails if any takes more than its budget.
pub(crate) fn check(boards: &[Board]) -> Result<()> {
    let budgets = Budgets::read()?;
    let stack_bytes = budgets.stack_bytes();
    let (mut rows, mut spares) = (Vec::new(), Vec::new());
    for &board in boards {
        let image = firmware::build(board)?;
        let data = fs::read(&image)?;
        let used = sizes(&data).with_context(|| format!("{}", image.display()))?;
        let of_board = budgets.of(board);
        rows.extend(compare(board.name(), &used, &of_board.memory)?);
        spares.push(spare(board, &used, stack_bytes, of_board.spare_min));
    }
    println!(
        "{:<10} {:<6} {:>9} {:>9} {:>6}  reason of the limit",
        "board", "memory", "bytes", "limit", "used"
    );
    for row in rows.iter().chain(&spares) {
        println!("{}", row.text);
    }
    if rows.iter().chain(&spares).any(|row| row.over) {
        bail!("the firmware is over its budget: see the table");
    }
    Ok(())
}

/// What is free of all that can be written to.
fn spare(board: Board, used: &BTreeMap<&str, u64>, stack_bytes: u64, spare_min: u64) -> Row {
    let all = board.ram_bytes();
    let taken = ["ram", "ccm"].iter().filter_map(|memory| used.get(memory)).sum::<u64>() + stack_bytes;
    let spare = 100.0 - taken as f64 * 100.0 / all as f64;
    let over = spare < spare_min as f64;
    let text = format!(
        "{:<10} of {all} bytes of RAM and CCM {taken} are taken, {stack_bytes} of stack with them: {spare:.1} % to \
         spare{}",
        board.name(),
        if over { format!(", OVER: {spare_min} % are asked") } else { String::new() }
    );
    Row { text, over }
}

pub(crate) struct Row {
    pub(crate) text: String,
    pub(crate) over: bool,
}

fn compare(board: &str, used: &BTreeMap<&str, u64>, limits: &BTreeMap<String, Bytes>) -> Result<Vec<Row>> {
    MEMORIES
        .iter()
        .map(|(memory, ..)| {
            let budget = limits
                .get(*memory)
                .with_context(|| format!("budgets.toml has no [{board}.memory.{memory}]"))?;
            let bytes = used.get(memory).copied().unwrap_or(0);
            let over = bytes > budget.bytes_max;
            let percent = bytes * 100 / budget.bytes_max.max(1);
            let text = format!(
                "{board:<10} {memory:<6} {bytes:>9} {:>9} {percent:>5}%  {}{}",
                budget.bytes_max,
                if over { "OVER: " } else { "" },
                budget.reason
            );
            Ok(Row { text, over })
        })
        .collect()
}

/// How many bytes of each memory the image takes.
fn sizes(elf: &[u8]) -> Result<BTreeMap<&'static str, u64>> {
    let file = ElfFile32::<Endianness>::parse(elf)?;
    let endian = file.endian();
    let memory_at = |address: u64| MEMORIES.iter().find(|(_, from, to)| (*from..*to).contains(&address));
    let mut sizes: BTreeMap<&'static str, u64> = BTreeMap::new();
    for segment in file.elf_header().program_headers(endian, elf)? {
        let stored = u64::from(segment.p_filesz(endian));
        if segment.p_type(endian) != PT_LOAD || stored == 0 {
            continue;
        }
        match memory_at(u64::from(segment.p_paddr(endian))) {
            Some(("flash", ..)) => *sizes.entry("flash").or_default() += stored,
            _ => bail!("a segment is loaded at {:#x}, which is not flash", segment.p_paddr(endian)),
        }
    }
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
        if sh_flags.0 & object::elf::SHF_ALLOC.0 == 0 {
            continue;
        }
        if let Some((name @ ("ram" | "ccm"), ..)) = memory_at(section.address()) {
            *sizes.entry(name).or_default() += section.size();
        }
    }
    Ok(sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(bytes_max: u64) -> BTreeMap<String, Bytes> {
        MEMORIES
            .iter()
            .map(|(name, ..)| ((*name).to_owned(), Bytes { bytes_max, reason: "because".into() }))
            .collect()
    }

    #[test]
    fn one_byte_over_is_over() {
        let used = BTreeMap::from([("flash", 100), ("ram", 101)]);
        let rows = compare("f405", &used, &limits(100)).unwrap();
        assert_eq!(rows.iter().map(|row| row.over).collect::<Vec<_>>(), [false, true, false]);
        assert!(rows[1].text.contains("OVER: because"));
    }

    #[test]
    fn a_memory_without_a_budget_is_an_error() {
        let mut limits = limits(100);
        limits.remove("ccm");
        assert!(compare("f405", &BTreeMap::new(), &limits).is_err());
    }

    #[test]
    fn the_stack_counts_for_what_is_to_spare() {
        let used = BTreeMap::from([("flash", 300_000), ("ram", 100_000), ("ccm", 40_000)]);
        let (all, taken) = (Board::F405.ram_bytes() as f64, 146_000.0);
        let row = spare(Board::F405, &used, 6_000, 25);
        assert!(
            !row.over && row.text.contains(&format!("{:.1} %", 100.0 - taken * 100.0 / all)),
            "{}",
            row.text
        );
        assert!(spare(Board::F405, &used, 16_000, 25).over);
    }

    #[test]
    fn the_file_of_budgets_is_whole() {
        let budgets = Budgets::read().unwrap();
        for board in Board::ALL {
            assert!(MEMORIES.iter().all(|(memory, ..)| budgets.of(board).memory.contains_key(*memory)));
        }
        assert!(budgets.stack_bytes() > 0 && !budgets.cycles.is_empty());
    }

    #[test]
    fn what_is_no_elf_file_is_an_error() {
        assert!(sizes(b"no elf").is_err());
    }
}
