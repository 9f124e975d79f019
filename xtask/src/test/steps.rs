//! The steps of `cargo xtask test`.

use std::fs;

use anyhow::{Context as _, Result};

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
use crate::setup::Need;
use crate::shell::Shell;

/// One thing that is checked.
pub(super) struct Step {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) needs: &'static [Need],
    pub(super) stage: Stage,
    /// Steps whose results it uses.
    pub(super) after: &'static [&'static str],
    pub(super) run: fn() -> Result<()>,
}

/// When a step runs. The compiler of the lints has one core busy while tests wait for links and browsers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// First.
    Build,
    /// After the build, beside the tests.
    Lint,
    /// After the build.
    Test,
}

/// Each after those that it needs. `--list` and the table of seconds have this order.
pub(super) const STEPS: [Step; 18] = [
    Step {
        name: "fmt",
        about: "the formatting",
        needs: &[Need::Rustfmt],
        stage: Stage::Build,
        after: &[],
        run: || Shell::cargo().args(["fmt", "--all", "--", "--check"]).run(),
    },
    Step {
        name: "lines",
        about: "lines of code by folder, within budgets.toml",
        needs: &[],
        stage: Stage::Build,
        after: &[],
        run: lines::check,
    },
    Step {
        name: "oracle",
        about: "pymavlink and the other readers that the tests compare with are there",
        needs: &[Need::PythonVenv],
        stage: Stage::Build,
        after: &[],
        run: oracle::prepare,
    },
    Step {
        name: "build",
        about: "hums, the campaigns, all tests and the examples of this PC compile, and the firmware beside them",
        needs: &[Need::FirmwareTarget],
        stage: Stage::Build,
        after: &[],
        run: || firmware::build_beside(hums_boards::families(), pc::build),
    },
    Step {
        name: "budgets",
        about: "the firmware of the default board is within budgets.toml",
        needs: &[Need::FirmwareTarget],
        stage: Stage::Build,
        after: &["build"],
        run: check_budgets,
    },
    Step {
        name: "chip",
        about: "end to end with the image that is flashed, on the model of its chip",
        needs: &[Need::FirmwareTarget, Need::PythonVenv, Need::Dosfstools],
        stage: Stage::Test,
        after: &["oracle", "build"],
        run: chip,
    },
    Step {
        name: "clippy-firmware",
        about: "lints of the firmware, and types of every board's, warnings as errors",
        needs: &[Need::Clippy, Need::FirmwareTarget],
        stage: Stage::Lint,
        after: &["build"],
        run: || firmware::lint(firmware::default_board()).and_then(|()| firmware::check_all()),
    },
    Step {
        name: "clippy",
        about: "lints of what runs on this PC, warnings as errors",
        needs: &[Need::Clippy],
        stage: Stage::Lint,
        after: &["build"],
        run: pc::lint,
    },
    Step {
        name: "unit",
        about: "tests of each crate on this PC",
        needs: &[],
        stage: Stage::Test,
        after: &["build"],
        run: pc::unit_tests,
    },
    Step {
        name: "sim",
        about: "end to end on this PC, against pymavlink",
        needs: &[Need::Mtools, Need::Dosfstools, Need::PythonVenv],
        stage: Stage::Test,
        after: &["oracle", "build"],
        run: sim,
    },
    Step {
        name: "doc",
        about: "the documentation builds without a warning",
        needs: &[],
        stage: Stage::Lint,
        after: &["build"],
        run: pc::document,
    },
    Step {
        name: "page",
        about: "formatting and lints of the page's scripts and style, by Biome",
        needs: &[Need::PythonVenv],
        stage: Stage::Lint,
        after: &["oracle"],
        run: page,
    },
    Step {
        name: "browser",
        about: "the report and the live page in Chromium",
        needs: &[Need::PythonVenv, Need::Chromium],
        stage: Stage::Test,
        after: &["oracle", "build"],
        run: || pc::end_to_end("browser", &[]),
    },
    Step {
        name: "prove",
        about: "the campaigns in their short form",
        needs: prove::NEEDS,
        stage: Stage::Test,
        after: &["build"],
        run: pc::short_campaigns,
    },
    Step {
        name: "answer",
        about: "every format against pymavlink, with pyarrow, DuckDB and InfluxDB as readers",
        needs: &[Need::PythonVenv, Need::Influx],
        stage: Stage::Test,
        after: &["oracle", "build"],
        run: || pc::end_to_end("answer", further()),
    },
    Step {
        name: "live",
        about: "live writing to InfluxDB and VictoriaMetrics, and the Grafana dashboards",
        needs: &[Need::PythonVenv, Need::Influx, Need::Victoria],
        stage: Stage::Test,
        after: &["oracle", "build"],
        run: || pc::end_to_end("live", &[]),
    },
    Step {
        name: "costs",
        about: "cycles, load and stack of the firmware against budgets.toml",
        needs: &[Need::FirmwareTarget],
        stage: Stage::Test,
        after: &["build"],
        run: || costs::check_built(&hums::program(), &firmware::image_of(firmware::default_board())),
    },
    Step {
        name: "demo",
        about: "cargo xtask demo",
        needs: &[Need::FirmwareTarget],
        stage: Stage::Test,
        after: &["build"],
        run: demo::as_test,
    },
];

fn check_budgets() -> Result<()> {
    println!("NOT TESTED: images of the other boards (cargo xtask prove boards)");
    println!("NOT TESTED: licences and sources of the dependencies (cargo xtask dist)");
    budgets::check(&[firmware::default_board()], false)
}

/// As `host-tools/src/page/biome.json` has it. To format: `target/venv/bin/biome format --write` in that folder.
fn page() -> Result<()> {
    let biome = oracle::python().with_file_name("biome");
    let folder = repo::root().join("host-tools/src/page");
    Shell::new(biome).args(["ci", "--error-on-warnings", "--colors=off"]).within(&folder).run()
}

/// The tested files are the flashed ones: the sums are those of `cargo xtask dist` of the same sources.
fn chip() -> Result<()> {
    let board = firmware::default_board();
    let elf = firmware::image_of(board);
    let files = firmware::files(board, fs::read(&elf).with_context(|| elf.display().to_string())?)?;
    print!("{}", dist::sums(&files));
    pc::end_to_end("chip", &[])
}

fn sim() -> Result<()> {
    // Half of their time they wait: links are as slow as radios are.
    let threads = (2 * std::thread::available_parallelism().map_or(1, usize::from)).to_string();
    let mut options = vec!["--test-threads", &threads];
    options.extend(further());
    pc::end_to_end("sim", &options)
}

/// The tests of further recordings are left out without such recordings. On the model of the chip they are for `cargo xtask prove`.
fn further() -> &'static [&'static str] {
    let given = std::env::var_os("HUMS_FLIGHTS").is_some_and(|folder| !folder.is_empty());
    if given { &["--include-ignored"] } else { &[] }
}
