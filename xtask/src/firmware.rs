//! Building the firmware: always with its own profile and for one board, so never by a plain `cargo build`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use anyhow::{Context as _, Result, bail};
pub(crate) use hums_boards::Board;

use crate::dfu;
use crate::image;
use crate::repo::{self, FIRMWARE_TARGET};
use crate::shell::Shell;

/// Flags of `cargo rustc` for the last crate, into which all of the program is inlined: only functions below half of
/// the compiler's own limit. 4.7 KB of flash less, at 0.2 % more load.
pub(crate) const LAST: [&str; 2] = ["--", "-Cllvm-args=-inline-threshold=40"];

/// The board that every change is tried for.
pub(crate) fn default_board() -> &'static Board {
    hums_boards::find(hums_boards::DEFAULT).expect("the default board has a file")
}

/// The target, for any cargo command on the firmware's package.
pub(crate) fn target() -> String {
    format!("--target={FIRMWARE_TARGET}")
}

/// The same with package and profile, for builds from the root.
pub(crate) fn cargo_arguments() -> [String; 3] {
    ["--package=hums-app".into(), "--profile=firmware".into(), target()]
}

/// Where [`build`] leaves the image: one file a board, so that building one does not replace the other.
pub(crate) fn image_of(board: &Board) -> PathBuf {
    repo::target().join("firmware").join(format!("hums-{}.elf", board.name))
}

/// The compiler's flags of everything that is released from `tree`, as cargo takes them. Paths of the machine are
/// replaced by `/hums` and `/cargo`: the same commit gives the same bytes everywhere.
pub(crate) fn flags(tree: &Path) -> Result<OsString> {
    let cargo_home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo_home = cargo_home.or_else(|| Some(env::home_dir()?.join(".cargo")));
    let cargo_home = cargo_home.context("neither CARGO_HOME nor a home folder is known")?;
    let mut flags = OsString::new();
    // Of several that fit the compiler takes the last one. The folder of a registry has a long name, which is in each place of a panic.
    let sources = fs::read_dir(cargo_home.join("registry/src")).into_iter().flatten();
    let registries = sources.filter_map(|entry| Some((entry.ok()?.path(), "/cargo")));
    for (from, to) in [(tree.canonicalize()?, "/hums"), (cargo_home, "/cargo")].into_iter().chain(registries)
    {
        flags.push("--remap-path-prefix=");
        flags.push(from);
        // Not separated by spaces: a folder may have one in its name.
        flags.push(format!("={to}\u{1f}"));
    }
    // SHA-256 (the signatures of a few frames a second) as loops: 6 KB of flash less than unrolled.
    flags.push("--cfg\u{1f}sha2_backend_soft=\"compact\"");
    Ok(flags)
}

/// The variable that names the board to the firmware's build script.
pub(crate) const BOARD: &str = "HUMS_BOARD";

/// cargo with the flags of a release, for the firmware of this board.
pub(crate) fn cargo(board: &Board) -> Result<Shell> {
    Ok(Shell::cargo().env("CARGO_ENCODED_RUSTFLAGS", flags(repo::root())?).env(BOARD, &board.name))
}

/// Compiles the firmware with these further arguments; the compiler's ELF file.
fn compile(board: &Board, further: &[&str]) -> Result<PathBuf> {
    cargo(board)?.arg("rustc").args(cargo_arguments()).args(further).args(LAST).run()?;
    Ok(repo::target().join(FIRMWARE_TARGET).join("firmware/hums-firmware"))
}

/// Builds the firmware with logs for a debug probe, and returns its ELF file's path.
pub(crate) fn build_with_log(board: &Board) -> Result<PathBuf> {
    compile(board, &["--features=log"])
}

/// Builds the firmware for `board` as a release does and returns its ELF file's path; beside it are the other files of a release.
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

/// [`build`] for these boards, one after the other, beside the build for this PC. The last part of each is one core's work.
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

/// The flashable files of the firmware of `board`: the name and the content of each file, the ELF file last.
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

/// Type-checks the firmware for each board.
pub(crate) fn check_all() -> Result<()> {
    hums_boards::all()
        .iter()
        .try_for_each(|board| cargo(board)?.args(["check", "--quiet"]).args(cargo_arguments()).run())
}

/// Lints the firmware for `board`, which is built; a warning is an error.
pub(crate) fn lint(board: &Board) -> Result<()> {
    cargo(board)?.arg("clippy").args(cargo_arguments()).args(["--", "-D", "warnings"]).run()
}

/// An unchanged image keeps its time, so that nothing that depends on it is made anew.
fn write_if_different(to: &Path, new: &[u8]) -> io::Result<()> {
    if fs::read(to).is_ok_and(|old| old == new) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, new)
}
