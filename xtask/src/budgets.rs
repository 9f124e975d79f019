//! The firmware's size against `budgets.toml`.
//!
//! Flash: code, constants, initial values; RAM and CCM: static variables; the stack has the rest.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use anyhow::{Context as _, Result, bail};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, FileHeader as _, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSection as _, SectionFlags};
use serde::Deserialize;

use crate::firmware::{self, Board, Programs};
use crate::repo;

/// Name, first address, one past the last, bytes for the program (`memory.x`): the application's flash, the resident program's
/// (sectors 0 and 4), RAM, CCM without the stack; the resident program's memory, which is the same CCM at another time.
const MEMORIES: [(&str, u64, u64, u64); 5] = [
    ("flash", 0x0802_0000, 0x0810_0000, 896 * 1024),
    ("resident", 0x0800_0000, 0x0802_0000, 80 * 1024),
    ("ram", 0x2000_0000, 0x2002_0000, 128 * 1024),
    ("ccm", 0x1000_0000, 0x1001_0000, 48 * 1024),
    ("resident_ram", 0, 0, 48 * 1024),
];
/// The rest of CCM.
const STACK_BYTES: u64 = 16 * 1024;

const FILE: &str = "budgets.toml";
/// The table of usage stands between these lines.
const TABLE_FILE: &str = "ARCHITECTURE.md";
const TABLE: [&str; 2] = ["<!-- taken: cargo xtask size --write -->\n", "<!-- end of taken -->\n"];

/// Bytes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Limit {
    /// When set, or at the last `--write`.
    pub(crate) taken: u64,
    /// One rest for all urgencies' stacks.
    free: Option<u64>,
    pub(crate) bytes_max: u64,
    pub(crate) reason: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cycles {
    pub(crate) taken: f64,
    pub(crate) per_frame_max: f64,
    pub(crate) reason: String,
}

/// Percent in the worst second, at the fastest line.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Load {
    pub(crate) taken: f64,
    pub(crate) free: f64,
    pub(crate) percent_max: f64,
    pub(crate) reason: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lines {
    pub(crate) code_max: usize,
    pub(crate) tests_max: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Budgets {
    /// Static memory, of every board.
    memory: BTreeMap<String, Limit>,
    /// By urgency.
    pub(crate) stack: BTreeMap<String, Limit>,
    /// By stage.
    pub(crate) cycles: BTreeMap<String, Cycles>,
    pub(crate) load: Load,
    /// By folder.
    pub(crate) lines: BTreeMap<String, Lines>,
}

impl Budgets {
    pub(crate) fn read() -> Result<Self> {
        let path = repo::root().join(FILE);
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        toml::from_str(&text).with_context(|| format!("{}", path.display()))
    }

    /// Every urgency interrupts the one below at its deepest.
    pub(crate) fn stack_bytes(&self) -> u64 {
        self.stack.values().map(|budget| budget.bytes_max).sum()
    }

    /// KiB and percent.
    fn table(&self) -> String {
        let mut table = "\n| | of | taken | free | limit |\n|---|---|---|---|---|\n".to_owned();
        let kib = |bytes: u64| bytes as f64 / 1024.0;
        let mut row = |what: &str, unit: &str, [all, taken, free, limit]: [f64; 4]| {
            // Cannot fail: it is a text.
            let _ = writeln!(table, "| {what} | {all:.0} {unit} | {taken:.1} | {free:.1} | {limit:.1} |");
        };
        for (name, _, _, all) in MEMORIES {
            if let Some(budget) = self.memory.get(name) {
                let free = budget.free.unwrap_or_default();
                row(name, "KiB", [all, budget.taken, free, budget.bytes_max].map(kib));
            }
        }
        let taken: u64 = self.stack.values().map(|budget| budget.taken).sum();
        row("stack", "KiB", [STACK_BYTES, taken, STACK_BYTES - taken, self.stack_bytes()].map(kib));
        row("processor", "%", [100.0, self.load.taken, self.load.free, self.load.percent_max]);
        table + "\n"
    }
}

/// Builds, prints usage, fails above a budget. `write`: the first board's usage goes into the budgets and ARCHITECTURE.md.
pub(crate) fn check(boards: &[&Board], write: bool) -> Result<()> {
    let budgets = Budgets::read()?;
    let mut rows = Vec::new();
    for (index, board) in boards.iter().enumerate() {
        let image = firmware::build(board)?;
        let mut used = sizes(&fs::read(&image)?).with_context(|| format!("{}", image.display()))?;
        let resident = sizes(&Programs::read(&repo::target())?.resident)?;
        used.insert("resident_ram", resident.get("ccm").copied().unwrap_or(0));
        rows.extend(compare(&board.name, &used, &budgets.memory)?);
        if write && index == 0 {
            write_taken(&used)?;
        }
    }
    println!(
        "{:<20} {:<8} {:>9} {:>9} {:>9}  reason of the limit",
        "board", "memory", "bytes", "limit", "free"
    );
    for row in &rows {
        println!("{}", row.text);
    }
    if rows.iter().any(|row| row.over) {
        bail!("the firmware is over its budget: see the table");
    }
    Ok(())
}

fn write_taken(used: &BTreeMap<&str, u64>) -> Result<()> {
    let path = repo::root().join(FILE);
    let mut section = String::new();
    let line = |line: &str| {
        if line.starts_with('[') {
            line.clone_into(&mut section);
        }
        let memory = section.strip_prefix("[memory.").and_then(|name| name.strip_suffix(']'));
        let memory = MEMORIES.iter().find(|(name, ..)| Some(*name) == memory);
        let taken = memory.and_then(|(name, .., all)| Some((used.get(name)?, all)));
        match (taken, line.split(" = ").next()) {
            (Some((taken, _)), Some("taken")) => format!("taken = {taken}\n"),
            (Some((taken, all)), Some("free")) => format!("free = {}\n", all.saturating_sub(*taken)),
            _ => format!("{line}\n"),
        }
    };
    let text: String = fs::read_to_string(&path)?.lines().map(line).collect();
    fs::write(&path, text)?;
    let path = repo::root().join(TABLE_FILE);
    let text = fs::read_to_string(&path)?;
    let [before, _, after] = around_table(&text)?;
    fs::write(&path, [before, &Budgets::read()?.table(), after].concat())?;
    Ok(())
}

fn around_table(text: &str) -> Result<[&str; 3]> {
    let place = |mark: &str| text.find(mark).with_context(|| format!("{TABLE_FILE} has no {mark}"));
    let (from, to) = (place(TABLE[0])? + TABLE[0].len(), place(TABLE[1])?);
    let parts = (text.get(..from), text.get(from..to), text.get(to..));
    let (Some(before), Some(table), Some(after)) = parts else {
        bail!("{TABLE_FILE}: the table has no end mark; add it")
    };
    Ok([before, table, after])
}

pub(crate) struct Row {
    pub(crate) text: String,
    pub(crate) over: bool,
}

fn compare(board: &str, used: &BTreeMap<&str, u64>, limits: &BTreeMap<String, Limit>) -> Result<Vec<Row>> {
    MEMORIES
        .iter()
        .map(|(memory, _, _, all)| {
            let budget = limits.get(*memory).with_context(|| format!("{FILE} has no [memory.{memory}]"))?;
            let bytes = used.get(memory).copied().unwrap_or(0);
            let over = bytes > budget.bytes_max;
            let text = format!(
                "{board:<20} {memory:<8} {bytes:>9} {:>9} {:>9}  {}{}",
                budget.bytes_max,
                all.saturating_sub(bytes),
                if over { "OVER: " } else { "" },
                budget.reason
            );
            Ok(Row { text, over })
        })
        .collect()
}

/// Bytes by memory.
fn sizes(elf: &[u8]) -> Result<BTreeMap<&'static str, u64>> {
    let file = ElfFile32::<Endianness>::parse(elf)?;
    let endian = file.endian();
    let memory_at = |address: u64| MEMORIES.iter().find(|(_, from, to, _)| (*from..*to).contains(&address));
    let mut sizes: BTreeMap<&'static str, u64> = BTreeMap::new();
    for segment in file.elf_header().program_headers(endian, elf)? {
        let stored = u64::from(segment.p_filesz(endian));
        if segment.p_type(endian) != PT_LOAD || stored == 0 {
            continue;
        }
        match memory_at(u64::from(segment.p_paddr(endian))) {
            Some((name @ ("flash" | "resident"), ..)) => *sizes.entry(name).or_default() += stored,
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

    fn limits(bytes_max: u64) -> BTreeMap<String, Limit> {
        let limit = |name: &str| {
            (name.to_owned(), Limit { taken: 0, free: None, bytes_max, reason: "because".into() })
        };
        MEMORIES.iter().map(|(name, ..)| limit(name)).collect()
    }

    #[test]
    fn one_byte_over_is_over() {
        let used = BTreeMap::from([("flash", 100), ("ram", 101)]);
        let rows = compare("matek", &used, &limits(100)).unwrap();
        assert_eq!(rows.iter().map(|row| row.over).collect::<Vec<_>>(), [false, false, true, false, false]);
        assert!(rows[2].text.contains("OVER: because"));
    }

    #[test]
    fn a_memory_without_a_budget_is_an_error() {
        let mut limits = limits(100);
        limits.remove("ccm");
        assert!(compare("matek", &BTreeMap::new(), &limits).is_err());
    }

    /// A high limit hides growth.
    #[test]
    fn each_limit_is_a_little_above_what_is_taken() {
        let budgets = Budgets::read().unwrap();
        let bytes = budgets.memory.iter().chain(&budgets.stack);
        let bytes = bytes.map(|(name, budget)| (name, budget.taken as f64, budget.bytes_max as f64));
        let cycles = budgets.cycles.iter().map(|(name, budget)| (name, budget.taken, budget.per_frame_max));
        for (name, taken, limit) in bytes.chain(cycles) {
            // Small stacks grow in steps of a saved register file.
            assert!(limit >= taken && limit <= taken * 1.06 + 64.0, "{name}: {taken} of {limit}");
        }
        assert!(budgets.load.percent_max <= budgets.load.taken * 1.06);
        assert!(budgets.stack_bytes() <= STACK_BYTES);
        for (name, _, _, all) in MEMORIES {
            let Limit { taken, free, bytes_max, .. } = budgets.memory[name];
            assert!(bytes_max <= all && free == Some(all - taken), "{name}");
        }
        assert!((budgets.load.taken + budgets.load.free - 100.0).abs() < 0.01);
    }

    #[test]
    fn the_table_is_that_of_the_budgets() {
        let text = fs::read_to_string(repo::root().join(TABLE_FILE)).unwrap();
        let [_, table, _] = around_table(&text).unwrap();
        assert_eq!(table, Budgets::read().unwrap().table(), "cargo xtask size --write");
    }

    #[test]
    fn what_is_no_elf_file_is_an_error() {
        assert!(sizes(b"no elf").is_err());
    }
}
