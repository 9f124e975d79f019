//! The steps of `cargo xtask test`.

use std::fs;

use anyhow::{Context as _, Result};

use Stage::{Build, Compute, Lint, Wait};

use crate::browser::{self, TESTED};
use crate::budgets;
use crate::costs;
use crate::demo;
use crate::dist;
use crate::firmware;
use crate::hums;
use crate::lines;
use crate::oracle;
use crate::pc;
use crate::prove;
use crate::repo;
use crate::setup::Need::{
    self, BrowserTarget, Chromium, Clippy, Dosfstools, Firefox, FirmwareTarget, Influx, Mtools, PythonVenv,
    Rustfmt, Victoria,
};
use crate::shell::Shell;

pub(super) struct Step {
    pub(super) stage: Stage,
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) needs: &'static [Need],
    pub(super) run: fn() -> Result<()>,
}

impl Step {
    const fn new(
        stage: Stage,
        name: &'static str,
        about: &'static str,
        needs: &'static [Need],
        run: fn() -> Result<()>,
    ) -> Self {
        Self { stage, name, about, needs, run }
    }

    /// Uses results of the step `build`, `oracle` or `wasm`.
    pub(super) fn follows(&self, other: &str) -> bool {
        match other {
            "build" => self.stage != Build || self.name == "budgets",
            "oracle" => self.name != "oracle" && self.needs.contains(&PythonVenv),
            "wasm" => self.name == "browser",
            _ => false,
        }
    }
}

/// Cargo's lints often keep one core busy, and tests wait: three stages side by side fill two cores.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// First.
    Build,
    /// The compiler's.
    Lint,
    /// Keeps the processor busy.
    Compute,
    /// Waits half of its time for links, browsers and databases.
    Wait,
}

impl Stage {
    /// The stages after the build.
    pub(super) const BESIDE: [Self; 3] = [Self::Lint, Self::Compute, Self::Wait];
}

/// Each after its needs; `--list` and the table have this order.
pub(super) const STEPS: [Step; 19] = [
    Step::new(Build, "fmt", "the formatting", &[Rustfmt], pc::check_format),
    Step::new(Build, "lines", "lines of code by folder, within budgets.toml", &[], lines::check),
    Step::new(Build, "oracle", "pymavlink and other readers, installed", &[PythonVenv], oracle::prepare),
    Step::new(Build, "page", "formatting and lints of the page, by Biome", &[PythonVenv], page),
    Step::new(Build, "build", "hums, all tests and the firmware compile", &[FirmwareTarget], build),
    Step::new(Build, "wasm", "the page of the check compiles", &[BrowserTarget], || browser::build(TESTED)),
    Step::new(Build, "budgets", "the size of the firmware, within budgets.toml", &[FirmwareTarget], size),
    Step::new(
        Lint,
        "clippy-firmware",
        "lints of the firmware, and the types of every board",
        &[Clippy, FirmwareTarget],
        firmware::lint,
    ),
    Step::new(Lint, "clippy", "lints of what runs on this PC", &[Clippy], pc::lint),
    Step::new(Lint, "doc", "the documentation builds without a warning", &[Clippy], pc::document),
    Step::new(Compute, "chip", "the image that is flashed, on the model of its chip", CHIP, chip),
    Step::new(Compute, "unit", "tests of each crate on this PC", &[], pc::unit_tests),
    Step::new(
        Wait,
        "sim",
        "end to end on this PC, against pymavlink",
        &[Mtools, Dosfstools, PythonVenv],
        sim,
    ),
    Step::new(Wait, "browser", "all pages in Chromium, the check in Firefox too", BROWSERS, browser),
    Step::new(Compute, "prove", "the campaigns in their short form", prove::NEEDS, pc::short_campaigns),
    Step::new(Wait, "answer", "every format against other readers", &[PythonVenv, Influx], answer),
    Step::new(Wait, "live", "databases and Grafana dashboards", &[PythonVenv, Influx, Victoria], live),
    Step::new(
        Compute,
        "costs",
        "cycles, load and stack, within budgets.toml",
        &[FirmwareTarget],
        measure_costs,
    ),
    Step::new(Wait, "demo", "cargo xtask demo", &[FirmwareTarget], demo::as_test),
];

const BROWSERS: &[Need] = &[PythonVenv, Chromium, Firefox, BrowserTarget];
const CHIP: &[Need] = &[FirmwareTarget, PythonVenv, Dosfstools];

fn build() -> Result<()> {
    firmware::build_beside([firmware::default_board()], pc::build)
}

fn size() -> Result<()> {
    println!("NOT TESTED: images of the other boards (cargo xtask prove boards)");
    println!("NOT TESTED: licences and sources of the dependencies (cargo xtask dist)");
    budgets::check(&[firmware::default_board()], false)
}

/// By `host-tools/report/src/page/biome.json`. To format: `target/venv/bin/biome format --write` there.
fn page() -> Result<()> {
    let biome = oracle::python().with_file_name("biome");
    let folder = repo::root().join("host-tools/report/src/page");
    Shell::new(biome).args(["ci", "--error-on-warnings", "--colors=off"]).within(&folder).run()
}

/// The flashed files, as of `cargo xtask dist`.
fn chip() -> Result<()> {
    let board = firmware::default_board();
    let read = |ending: &str| {
        let path = firmware::image_of(board).with_extension(ending);
        Ok((path.display().to_string(), fs::read(&path).with_context(|| path.display().to_string())?))
    };
    let files = ["dfu", "hex", "bin", "upd", "elf"].map(read).into_iter().collect::<Result<Vec<_>>>()?;
    print!("{}", dist::sums(&files));
    pc::end_to_end(&["chip::"])
}

fn sim() -> Result<()> {
    // Slow links: each test needs a quarter of a processor.
    let threads = (4 * std::thread::available_parallelism().map_or(1, usize::from)).to_string();
    pc::end_to_end(&[&["sim::", "--test-threads", &threads], further()].concat())
}

fn browser() -> Result<()> {
    pc::end_to_end(&["browser::"])
}

fn answer() -> Result<()> {
    pc::end_to_end(&[&["answer::"], further()].concat())
}

fn live() -> Result<()> {
    pc::end_to_end(&["live::", "--skip", "browser::"])
}

fn measure_costs() -> Result<()> {
    costs::check_built(&hums::program(), &firmware::image_of(firmware::default_board()))
}

/// Without further recordings; on the chip's model they are `cargo xtask prove`'s.
fn further() -> &'static [&'static str] {
    let given = std::env::var_os("HUMS_FLIGHTS").is_some_and(|folder| !folder.is_empty());
    if given { &["--include-ignored"] } else { &[] }
}
