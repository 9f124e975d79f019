//! Every instruction of an image decodes: `CORTEX_IMAGE` is the ELF file, with its symbols (`$t` and `$d` mark code and data).
use cortex_m4_model::decode;
use cortex_m4_model::op::Op;
use std::collections::BTreeMap;

struct Elf(Vec<u8>);

impl Elf {
    fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[at..at + 4].try_into().expect("four bytes"))
    }

    fn half(&self, at: usize) -> usize {
        usize::from(u16::from_le_bytes(self.0[at..at + 2].try_into().expect("two bytes")))
    }

    /// Offset, size, type, address, flags and link of each section.
    fn sections(&self) -> Vec<[u32; 6]> {
        let (table, size, count) = (self.word(32) as usize, self.half(46), self.half(48));
        let headers = (0..count).map(|i| table + i * size);
        headers.map(|at| [16, 20, 4, 12, 8, 24].map(|field| self.word(at + field))).collect()
    }

    fn name(&self, strings: u32, at: u32) -> &str {
        let start = (strings + at) as usize;
        let end = self.0[start..].iter().position(|byte| *byte == 0).map_or(start, |bytes| start + bytes);
        core::str::from_utf8(&self.0[start..end]).unwrap_or("")
    }

    /// Code or data from here on.
    fn marks(&self) -> BTreeMap<u32, bool> {
        let sections = self.sections();
        let mut marks = BTreeMap::new();
        for &[offset, size, kind, _, _, link] in &sections {
            if kind == 2 {
                for at in (offset..offset + size).step_by(16).map(|at| at as usize) {
                    let name = self.name(sections[link as usize][0], self.word(at));
                    if name.starts_with("$t") || name.starts_with("$d") {
                        marks.insert(self.word(at + 4), name.starts_with("$t"));
                    }
                }
            }
        }
        marks
    }
}

#[test]
#[ignore = "needs CORTEX_IMAGE, the firmware's ELF file"]
fn every_instruction_of_the_image_decodes() {
    let path = std::env::var("CORTEX_IMAGE").expect("CORTEX_IMAGE");
    let elf = Elf(std::fs::read(path).expect("the image"));
    let marks = elf.marks();
    let (mut instructions, mut undefined) = (0, Vec::new());
    for [offset, size, kind, start, flags, _] in elf.sections() {
        if kind != 1 || flags & 4 == 0 {
            continue;
        }
        let (mut at, mut it) = (start, 0u32);
        let mut code = false;
        while at < start + size {
            code = marks.get(&at).copied().unwrap_or(code);
            if !code {
                at += 1;
                continue;
            }
            let halfword = |address: u32| match (address - start + offset) as usize {
                place if address + 2 <= start + size => elf.half(place) as u16,
                _ => 0,
            };
            let (op, bytes) = decode(at, it != 0, [halfword(at), halfword(at + 2)]);
            it = it.saturating_sub(1);
            match op {
                Op::IfThen { state } => it = 4 - u32::from(state).trailing_zeros(),
                Op::Undefined if halfword(at) >> 8 != 0xDE => {
                    undefined.push((at, halfword(at), halfword(at + 2)));
                }
                Op::Branch { target }
                | Op::BranchIf { target, .. }
                | Op::BranchZero { target, .. }
                | Op::Call { target }
                    if std::env::var_os("CORTEX_TARGETS").is_some() =>
                {
                    println!("target {at:x} {target:x}");
                }
                _ => {}
            }
            instructions += 1;
            at += bytes;
        }
    }
    println!("{instructions} instructions");
    assert!(undefined.is_empty(), "{undefined:x?}");
}
