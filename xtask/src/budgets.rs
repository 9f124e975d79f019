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

/// The STM32F405's memories: name, first address, one past the last.
const MEMORIES: [(&str, u64, u64); 3] = [
    ("flash", 0x0800_0000, 0x0810_0000),
    ("ram", 0x2000_0000, 0x2002_0000),
    ("ccm", 0x1000_0000, 0x1001_0000),
];

/// One limit of `budgets.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Budget {
    bytes_max: u64,
    reason: String,
}

/// Per board, per memory.
type Budgets = BTreeMap<String, BTreeMap<String, Budget>>;

/// Builds both boards, prints what they take and fails if any takes more than its budget.
pub(crate) fn check_all() -> Result<()> {
    let path = repo::root().join("budgets.toml");
    let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let budgets: Budgets = toml::from_str(&text).with_context(|| format!("{}", path.display()))?;
    let mut rows = Vec::new();
    for board in Board::ALL {
        let image = firmware::build(board)?;
        let data = fs::read(&image)?;
        let used = sizes(&data).with_context(|| format!("{}", image.display()))?;
        let limits =
            budgets.get(board.name()).with_context(|| format!("budgets.toml has no [{}]", board.name()))?;
        rows.extend(compare(board.name(), &used, limits)?);
    }
    println!(
        "{:<10} {:<6} {:>9} {:>9} {:>6}  reason of the limit",
        "board", "memory", "bytes", "limit", "used"
    );
    for row in &rows {
        println!("{}", row.text);
    }
    if rows.iter().any(|row| row.over) {
        bail!("the firmware is over its budget: see the table");
    }
    Ok(())
}

struct Row {
    text: String,
    over: bool,
}

fn compare(board: &str, used: &BTreeMap<&str, u64>, limits: &BTreeMap<String, Budget>) -> Result<Vec<Row>> {
    MEMORIES
        .iter()
        .map(|(memory, ..)| {
            let budget =
                limits.get(*memory).with_context(|| format!("budgets.toml has no [{board}.{memory}]"))?;
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

    fn limits(bytes_max: u64) -> BTreeMap<String, Budget> {
        MEMORIES
            .iter()
            .map(|(name, ..)| ((*name).to_owned(), Budget { bytes_max, reason: "because".into() }))
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
    fn what_is_no_elf_file_is_an_error() {
        assert!(sizes(b"no elf").is_err());
    }
}
