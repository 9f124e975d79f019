//! Building the firmware: its own profile, one board; never by a plain `cargo build`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use anyhow::{Context as _, Result, bail};
pub(crate) use hums_boards::Board;

use crate::dfu;
use crate::image;
use crate::repo::{self, FIRMWARE_TARGET};
use crate::shell::Shell;

/// Of `cargo rustc` for the last crate: inlines only functions below half of the compiler's limit. 4.7 KB of flash less, 0.2 %
/// more load.
pub(crate) const LAST: [&str; 2] = ["--", "-Cllvm-args=-inline-threshold=40"];

/// Every change is tried for it.
pub(crate) fn default_board() -> &'static Board {
    hums_boards::find(hums_boards::DEFAULT).expect("the default board has a file")
}

pub(crate) fn target() -> String {
    format!("--target={FIRMWARE_TARGET}")
}

pub(crate) fn cargo_arguments() -> [String; 3] {
    ["--package=hums-app".into(), "--profile=firmware".into(), target()]
}

pub(crate) fn image_of(board: &Board) -> PathBuf {
    repo::target().join("firmware").join(format!("hums-{}.elf", board.name))
}

/// Of a release from `tree`. Paths become `/hums` and `/cargo`: the same bytes everywhere.
pub(crate) fn flags(tree: &Path) -> Result<OsString> {
    let cargo_home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo_home = cargo_home.or_else(|| Some(env::home_dir()?.join(".cargo")));
    let cargo_home = cargo_home.context("neither CARGO_HOME nor a home folder is known")?;
    let mut flags = OsString::new();
    // The last one that fits counts. A registry's long folder name is in each place of a panic.
    let sources = fs::read_dir(cargo_home.join("registry/src")).into_iter().flatten();
    let registries = sources.filter_map(|entry| Some((entry.ok()?.path(), "/cargo")));
    for (from, to) in [(tree.canonicalize()?, "/hums"), (cargo_home, "/cargo")].into_iter().chain(registries)
    {
        flags.push("--remap-path-prefix=");
        flags.push(from);
        // A folder's name may have a space.
        flags.push(format!("={to}\u{1f}"));
    }
    // Loops: 6 KB of flash less (a few signed frames a second).
    flags.push("--cfg\u{1f}sha2_backend_soft=\"compact\"");
    Ok(flags)
}

pub(crate) const BOARD: &str = "HUMS_BOARD";

pub(crate) fn cargo(board: &Board) -> Result<Shell> {
    Ok(Shell::cargo().env("CARGO_ENCODED_RUSTFLAGS", flags(repo::root())?).env(BOARD, &board.name))
}

/// Returns the compiler's ELF file.
fn compile(board: &Board, further: &[&str]) -> Result<PathBuf> {
    cargo(board)?.arg("rustc").args(cargo_arguments()).args(further).args(LAST).run()?;
    Ok(repo::target().join(FIRMWARE_TARGET).join("firmware/hums-firmware"))
}

pub(crate) fn build_with_log(board: &Board) -> Result<PathBuf> {
    compile(board, &["--features=log"])
}

/// An image as a release; the other files are beside the ELF file.
pub(crate) fn build(board: &Board) -> Result<PathBuf> {
    let built = compile(board, &[])?;
    let elf = fs::read(&built).with_context(|| format!("cannot read {}", built.display()))?;
    let image = image_of(board);
    for (name, data) in files(board, elf)? {
        let path = image.with_file_name(name);
        write_if_different(&path, &data).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(image)
}

/// One after the other, beside this PC's build; each ends with one core's work.
pub(crate) fn build_beside(
    boards: impl IntoIterator<Item = &'static Board> + Send,
    pc: impl FnOnce() -> Result<()>,
) -> Result<()> {
    std::thread::scope(|scope| {
        let firmware = scope.spawn(|| boards.into_iter().try_for_each(|board| build(board).map(drop)));
        pc()?;
        firmware.join().unwrap_or_else(|_| bail!("the build of the firmware panicked"))
    })
}

/// Flashable: name and content, the ELF file last.
pub(crate) fn files(board: &Board, elf: Vec<u8>) -> Result<[(String, Vec<u8>); 4]> {
    let name = format!("hums-{}", board.name);
    let pieces = image::pieces(&elf).with_context(|| name.clone())?;
    Ok([
        (format!("{name}.dfu"), dfu::file(&name, &pieces)),
        (format!("{name}.hex"), image::hex(&pieces)),
        (format!("{name}.bin"), image::flat(&pieces)),
        (format!("{name}.elf"), elf),
    ])
}

pub(crate) fn check_all() -> Result<()> {
    hums_boards::all()
        .iter()
        .try_for_each(|board| cargo(board)?.args(["check", "--quiet"]).args(cargo_arguments()).run())
}

/// A warning is an error.
pub(crate) fn lint(board: &Board) -> Result<()> {
    cargo(board)?.arg("clippy").args(cargo_arguments()).args(["--", "-D", "warnings"]).run()
}

/// An unchanged image keeps its time, and nothing is made anew.
fn write_if_different(to: &Path, new: &[u8]) -> io::Result<()> {
    if fs::read(to).is_ok_and(|old| old == new) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, new)
}
