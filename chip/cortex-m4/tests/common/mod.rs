//! For comparisons with QEMU.
#![allow(dead_code, unreachable_pub, reason = "each test program uses a part")]
#![allow(clippy::panic, reason = "tests")]

use cortex_m4_model::{Bus, Core, Fault, Outcome, Size};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The memories of QEMU's mps2-an386 that programs use.
pub const MEMORIES: [(u32, usize); 3] = [(0, 0x40_0000), (0x2000_0000, 0x40_0000), (0x2100_0000, 0x100_0000)];

/// Flat memories, errors elsewhere.
pub struct Flat {
    pub memories: [Vec<u8>; 3],
    /// Of each fetch, and of each load or store.
    pub waits: (u32, u32),
    /// A store here asks for attention.
    pub bell: Option<u32>,
    rung: bool,
}

impl Default for Flat {
    fn default() -> Self {
        Flat { memories: MEMORIES.map(|(_, bytes)| vec![0; bytes]), waits: (0, 0), bell: None, rung: false }
    }
}

impl Flat {
    fn place(address: u32) -> Option<(usize, usize)> {
        match address >> 24 {
            0 => Some((0, address as usize)),
            0x20 => Some((1, (address & 0xFF_FFFF) as usize)),
            0x21 => Some((2, (address & 0xFF_FFFF) as usize)),
            _ => None,
        }
    }

    fn bytes<const N: usize>(&self, address: u32) -> Option<[u8; N]> {
        let (memory, at) = Self::place(address)?;
        self.memories[memory].get(at..at + N)?.try_into().ok()
    }

    pub fn word(&self, address: u32) -> u32 {
        u32::from_le_bytes(self.bytes(address).expect("within a memory"))
    }

    pub fn load(&mut self, address: u32, bytes: &[u8]) {
        let (memory, at) = Self::place(address).expect("within a memory");
        self.memories[memory][at..at + bytes.len()].copy_from_slice(bytes);
    }
}

impl Bus for Flat {
    fn read(&mut self, address: u32, size: Size, _now: u64) -> Result<u32, Fault> {
        let value = match size {
            Size::Byte => self.bytes::<1>(address).map(|bytes| u32::from(bytes[0])),
            Size::Half => self.bytes(address).map(|bytes| u32::from(u16::from_le_bytes(bytes))),
            Size::Word => self.bytes(address).map(u32::from_le_bytes),
        };
        value.ok_or(Fault::Bus)
    }

    fn write(&mut self, address: u32, size: Size, value: u32, _now: u64) -> Result<(), Fault> {
        self.rung = self.bell == Some(address);
        let (memory, at) = Self::place(address).ok_or(Fault::Bus)?;
        let bytes = size.bytes() as usize;
        let place = self.memories[memory].get_mut(at..at + bytes).ok_or(Fault::Bus)?;
        place.copy_from_slice(&value.to_le_bytes()[..bytes]);
        Ok(())
    }

    fn fetch(&mut self, address: u32) -> Result<u16, Fault> {
        self.bytes(address).map(u16::from_le_bytes).ok_or(Fault::Bus)
    }

    fn fetch_wait(&mut self, _address: u32, _bytes: u32, _branched: bool, _now: u64) -> u32 {
        self.waits.0
    }

    fn take_wait(&mut self) -> u32 {
        self.waits.1
    }

    fn attention(&self) -> bool {
        self.rung
    }
}

/// A folder of this process.
pub fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("cortex-m4-model-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files");
    folder
}

/// Returns the ELF file.
pub fn build(name: &str, folder: &Path) -> PathBuf {
    let programs = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs");
    let elf = folder.join(format!("{name}.elf"));
    let status = Command::new(std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into()))
        .args([
            "--edition",
            "2024",
            "--target",
            "thumbv7em-none-eabihf",
            "-C",
            "opt-level=2",
            "-C",
            "panic=abort",
            "-Awarnings",
        ])
        .arg("-C")
        .arg(format!("link-arg=-T{}", programs.join("link.x").display()))
        .arg("-o")
        .args([&elf, &programs.join(format!("{name}.rs"))])
        .status();
    assert!(status.expect("rustc runs").success(), "{name} does not build");
    elf
}

/// Loaded parts: address and bytes.
pub fn segments(elf: &Path) -> Vec<(u32, Vec<u8>)> {
    let file = std::fs::read(elf).expect("the program's file");
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes"));
    let half = |at: usize| usize::from(u16::from_le_bytes(file[at..at + 2].try_into().expect("two bytes")));
    let (table, size, count) = (word(28) as usize, half(42), half(44));
    (0..count)
        .map(|i| table + i * size)
        .filter(|&header| word(header) == 1 && word(header + 16) != 0)
        .map(|header| {
            let (at, bytes) = (word(header + 4) as usize, word(header + 16) as usize);
            (word(header + 12), file[at..at + bytes].to_vec())
        })
        .collect()
}

/// With parts of memory; returns the output.
pub fn qemu(elf: &Path, parts: &[(u32, &[u8])], folder: &Path) -> String {
    let mut command = Command::new("timeout");
    command.args(["20", "qemu-system-arm"]);
    command.current_dir(folder).args([
        "-M",
        "mps2-an386",
        "-display",
        "none",
        "-serial",
        "none",
        "-monitor",
        "none",
    ]);
    command.args(["-semihosting-config", "enable=on,target=native"]);
    command.arg("-kernel").arg(elf);
    for (i, (address, bytes)) in parts.iter().enumerate() {
        let file = folder.join(format!("part{i}.bin"));
        std::fs::write(&file, bytes).expect("a part of memory");
        command.args(["-device", &format!("loader,file={},addr={address:#x},force-raw=on", file.display())]);
    }
    let output = command.output().expect("qemu-system-arm runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout)
}

fn boot(elf: &Path, parts: &[(u32, &[u8])]) -> (Flat, Core) {
    let mut memory = Flat::default();
    for (address, bytes) in segments(elf) {
        memory.load(address, &bytes);
    }
    for (address, bytes) in parts {
        memory.load(*address, bytes);
    }
    let mut core = Core::new(32, 8);
    core.stop_at_breakpoints(true);
    core.reset(&mut memory, 0);
    (memory, core)
}

/// False at `SYS_EXIT`; adds the text of `SYS_WRITE0`.
fn serve(core: &mut Core, memory: &mut Flat, outcome: Outcome, printed: &mut String) -> bool {
    match outcome {
        Outcome::Ran => {}
        Outcome::Breakpoint(0xAB) if core.register(0) == 0x18 => return false,
        Outcome::Breakpoint(0xAB) => {
            let mut at = core.register(1);
            while core.register(0) == 4
                && let Ok(byte @ 1..) = memory.read(at, Size::Byte, 0)
            {
                printed.push(byte as u8 as char);
                at += 1;
            }
            core.skip();
        }
        Outcome::Sleeping if core.next_event().is_some() => {
            core.advance_to(core.next_event().unwrap_or_default());
        }
        outcome => panic!(
            "{outcome:?} at {:#x}, faults {:#x?}, trace {:#x?}",
            core.register(15),
            core.fault_status(),
            core.trace()
        ),
    }
    true
}

/// Up to `SYS_EXIT`, or `limit` cycles. Returns output, memory, processor.
pub fn model(elf: &Path, parts: &[(u32, &[u8])], limit: u64) -> (String, Flat, Core) {
    let (mut memory, mut core) = boot(elf, parts);
    let mut printed = String::new();
    loop {
        let outcome = core.run(&mut memory, limit);
        assert!(core.cycles() < limit, "it does not end: {:#x}", core.register(15));
        if !serve(&mut core, &mut memory, outcome, &mut printed) {
            return (printed, memory, core);
        }
    }
}

/// Until so many lines were printed. `disturb` returns the cycles until its next call.
pub fn interrupted(elf: &Path, lines: usize, mut disturb: impl FnMut(&mut Core) -> u64) -> String {
    let (mut memory, mut core) = boot(elf, &[]);
    let (mut printed, mut next) = (String::new(), 1000);
    while printed.lines().count() < lines {
        let outcome = core.run(&mut memory, next);
        if core.cycles() >= next {
            next = core.cycles() + disturb(&mut core);
        }
        assert!(serve(&mut core, &mut memory, outcome, &mut printed), "it ended");
    }
    printed
}
