//! Building the firmware: its own profile, one board; never by a plain `cargo build`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use anyhow::{Context as _, Result, bail};
pub(crate) use hums_boards::Board;
use hums_update::{header, map};

use crate::dfu;
use crate::image::{self, Piece};
use crate::repo::{self, FIRMWARE_TARGET};
use crate::shell::{Shell, TAKEN};
use crate::update::{self, SecretKey};

/// Of `cargo rustc` for the last crate: inlines only functions below half of the compiler's limit. 4.7 KB of flash less, 0.2 %
/// more load.
pub(crate) const LAST: [&str; 2] = ["--", "-Cllvm-args=-inline-threshold=40"];

/// Packages that only cross-compile.
pub(crate) const APPLICATION: &str = "hums-app";
pub(crate) const RESIDENT: &str = "hums-resident";
pub(crate) const CHIP: &str = "hums-stm32f4";

/// The board that each change is tried with.
pub(crate) fn default_board() -> &'static Board {
    hums_boards::find(hums_boards::DEFAULT).expect("the default board has a file")
}

pub(crate) fn target() -> String {
    format!("--target={FIRMWARE_TARGET}")
}

pub(crate) fn cargo_arguments(package: &str) -> [String; 3] {
    [format!("--package={package}"), "--profile=firmware".into(), target()]
}

pub(crate) fn image_of(board: &Board) -> PathBuf {
    repo::target().join("firmware").join(format!("hums-{}.elf", board.name))
}

/// Of a release from `tree`. Paths become `/hums` and `/cargo`: the same bytes everywhere.
pub(crate) fn flags(tree: &Path) -> Result<OsString> {
    let cargo_home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo_home = cargo_home.or_else(|| Some(env::home_dir()?.join(".cargo")));
    let cargo_home = cargo_home.context("there is no home folder; set CARGO_HOME")?;
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

/// Returns the compiler's ELF files.
fn compile(board: &Board, further: &[&str]) -> Result<Programs> {
    cargo(board)?.arg("build").args(cargo_arguments(RESIDENT)).run()?;
    cargo(board)?.arg("rustc").args(cargo_arguments(APPLICATION)).args(further).args(LAST).run()?;
    Programs::read(&repo::target())
}

/// With a log for a debugger: the flashable file and the one with the names.
pub(crate) fn build_with_log(board: &Board) -> Result<PathBuf> {
    let programs = compile(board, &["--features=log"])?;
    write(board, &programs, "-log")
}

/// An image as a release, signed by the test key; the other files are beside the ELF file.
pub(crate) fn build(board: &Board) -> Result<PathBuf> {
    let programs = compile(board, &[])?;
    write(board, &programs, "")
}

fn write(board: &Board, programs: &Programs, suffix: &str) -> Result<PathBuf> {
    let image = image_of(board);
    let commit = Shell::new("git").args(["rev-parse", "--short=12", "HEAD"]).ask().unwrap_or_default();
    for (name, data) in files(board, programs, commit.trim(), Some(&update::test_key()?))? {
        let name = name.replace('.', &format!("{suffix}."));
        let path = image.with_file_name(name);
        write_if_different(&path, &data).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(image.with_file_name(format!("hums-{}{suffix}.elf", board.name)))
}

pub(crate) struct Programs {
    application: Vec<u8>,
    pub(crate) resident: Vec<u8>,
}

impl Programs {
    /// Reads the programs of a build's folder.
    pub(crate) fn read(target: &Path) -> Result<Self> {
        let read = |name: &str| {
            let path = target.join(FIRMWARE_TARGET).join("firmware").join(name);
            fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
        };
        Ok(Self { application: read("hums-firmware")?, resident: read("hums-resident")? })
    }
}

/// One after the other, beside this PC's build; each ends with one core's work.
pub(crate) fn build_beside(
    boards: impl IntoIterator<Item = &'static Board> + Send,
    pc: impl FnOnce() -> Result<()>,
) -> Result<()> {
    std::thread::scope(|scope| {
        let firmware = scope.spawn(|| {
            let built = boards.into_iter().try_for_each(|board| build(board).map(drop));
            (built, TAKEN.get())
        });
        pc()?;
        let Ok((built, taken)) = firmware.join() else { bail!("the build of the firmware panicked") };
        TAKEN.set(TAKEN.get() + taken);
        built
    })
}

pub(crate) fn files(
    board: &Board,
    programs: &Programs,
    commit: &str,
    key: Option<&SecretKey>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let name = format!("hums-{}", board.name);
    let mut added = image::pieces(&programs.resident)
        .with_context(|| format!("{name}: the resident program cannot be built"))?;
    let application = image::pieces(&programs.application).with_context(|| name.clone())?;
    let update = update::file(board, &application, commit, key).with_context(|| name.clone())?;
    // Not signed: another id, so an image that a cable loads has no trial behind it.
    let bytes = update::file(board, &application, commit, None)?[..header::BYTES].to_vec();
    added.push(Piece { address: map::APPLICATION, bytes });
    let elf = image::with_pieces(&programs.application, &added)?;
    let pieces = image::pieces(&elf)?;
    let mut files = vec![
        (format!("{name}.dfu"), dfu::file(&name, &pieces)),
        (format!("{name}.hex"), image::hex(&pieces)),
        (format!("{name}.bin"), image::flat(&pieces)),
    ];
    files.extend(key.map(|_| (format!("{name}.upd"), update)));
    files.push((format!("{name}.elf"), elf));
    Ok(files)
}

/// And the types of every board; the whole firmware is checked with those of a card on plain pins too. A warning is an error.
pub(crate) fn lint() -> Result<()> {
    let others = ["--package", RESIDENT, "--package", CHIP, "--", "-D", "warnings"];
    cargo(default_board())?.arg("clippy").args(cargo_arguments(APPLICATION)).args(others).run()?;
    hums_boards::all().iter().find(|board| board.card.bus.is_none()).map_or(Ok(()), |board| {
        cargo(board)?
            .args(["check", "--quiet", "--package", RESIDENT])
            .args(cargo_arguments(APPLICATION))
            .run()
    })
}

/// An unchanged image keeps its time, and nothing is made anew.
fn write_if_different(to: &Path, new: &[u8]) -> io::Result<()> {
    if fs::read(to).is_ok_and(|old| old == new) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, new)
}
