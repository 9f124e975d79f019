//! Windows programs under Wine; Windows itself may differ.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use crate::repo;
use crate::setup::{WINDOWS_TARGET, find_wine};
use crate::shell::Shell;

/// Do not run on Windows.
const ELSEWHERE: &str =
    "hums-app hums-core-tests hums-fuzz hums-maths hums-tests xtask cortex-m4-model stm32f405-model";

/// Random numbers of Rust's library; in Wine since version 9.
const RANDOM_LIBRARY: &str = "bcryptprimitives.dll";
const RANDOM_SOURCE: &str = "#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE to, SIZE_T count) { return SystemFunction036(to, (ULONG)count); }
";

/// Its Windows is in `target`.
pub(crate) struct Wine {
    program: PathBuf,
    prefix: PathBuf,
}

impl Wine {
    pub(crate) fn start() -> Result<Self> {
        let program = find_wine().context("Wine is not installed; install it, or leave this step out")?;
        let wine = Self { program, prefix: repo::target().join("wine") };
        fs::create_dir_all(&wine.prefix)?;
        wine.shell(&wine.program).args(["wineboot", "--init"]).run()?;
        let library = wine.prefix.join("drive_c/windows/system32").join(RANDOM_LIBRARY);
        if !library.is_file() {
            let source = wine.prefix.join("random.c");
            fs::write(&source, RANDOM_SOURCE)?;
            let compiler = Shell::new("x86_64-w64-mingw32-gcc").args(["-shared", "-O2", "-o"]).arg(&library);
            compiler.arg(&source).arg("-ladvapi32").run()?;
        }
        Ok(wine)
    }

    pub(crate) fn run(&self, program: &Path) -> Shell {
        self.shell(&self.program).arg(program)
    }

    /// `hums` and its crates.
    pub(crate) fn unit_tests(&self) -> Result<()> {
        let others = ELSEWHERE.split(' ').flat_map(|package| ["--exclude", package]);
        self.shell(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .env("CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER", &self.program)
            .env("CARGO_PROFILE_DEV_DEBUG", "0")
            .args(["test", "--quiet", "--lib", "--bins", "--target", WINDOWS_TARGET, "--workspace"])
            .args(others)
            .run()
    }

    fn shell(&self, program: impl AsRef<std::ffi::OsStr>) -> Shell {
        // Its complaints concern unused windows.
        Shell::new(program).env("WINEPREFIX", &self.prefix).env("WINEDEBUG", "-all")
    }
}

/// Reads a flight and makes a report; a second run changes nothing.
pub(crate) fn try_out(wine: &Wine, program: &Path, flight: &Path) -> Result<()> {
    let report = wine.prefix.join("report.html");
    let _ = fs::remove_file(&report);
    let mut made = Vec::new();
    for _ in 0..2 {
        wine.run(program).arg("report").arg(flight).arg("--force").arg("-o").arg(&report).output()?;
        made.push(fs::read(&report)?);
    }
    if made.first() != made.last() {
        bail!("under Wine the second run of hums.exe report has changed its page");
    }
    let into_input = wine.run(program).args(["decode", "--force", "--format", "tlog"]).arg(flight);
    let (_, code) = into_input.arg("-o").arg(flight).output_and_code()?;
    if code != 2 {
        bail!("under Wine hums.exe writes into its input (exit code {code}, not 2)");
    }
    Ok(())
}
