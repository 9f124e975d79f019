//! `cargo xtask prove foreign`: foreign programs on the chip's model, a second opinion on our reading of the manual.
//!
//! Examples in registry packages, fetched and built; only their names are here. Embassy's come from a checkout, if any.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use cargo_metadata::MetadataCommand;

use crate::repo::{self, FIRMWARE_TARGET};
use crate::setup::{self, Need};
use crate::shell::Shell;

struct Package {
    name: &'static str,
    version: &'static str,
    features: &'static str,
    /// Separated by spaces.
    examples: &'static str,
}

const PACKAGES: [Package; 3] = [
    Package {
        name: "stm32f4xx-hal",
        version: "0.23.0",
        features: "stm32f405,rtic1",
        examples: "serial-dma rtic-serial-dma-rx-idle spi-dma rtic-button rtic-tick rtic-usart-shell \
                   delay-timer-blinky blinky-timer-irq delay-syst-blinky",
    },
    Package { name: "feather-f405", version: "0.2.0", features: "", examples: "flash" },
    Package {
        name: "stm32f407g-disc",
        version: "0.4.1",
        features: "",
        examples: "serial_echo gpio_hal_blinky",
    },
];

/// Programs in `examples/stm32f4/src/bin`, at the tag of [`EMBASSY_MANIFEST`].
const EMBASSY: &[&str] = &["wdt", "flash", "usart_dma", "usart_buffered", "button_exti", "multiprio"];
const EMBASSY_TAG: &str = "embassy-stm32-v0.6.0";
/// Packages of that tag, for an STM32F405.
const EMBASSY_MANIFEST: &str = include_str!("../../chip/stm32f405/examples/foreign/embassy.toml");
const EMBASSY_BUILD: &str = r#"fn main() {
    ["--nmagic", "-Tlink.x", "-Tdefmt.x"].map(|argument| println!("cargo:rustc-link-arg-bins={argument}"));
}"#;

/// `embassy`: a checkout's folder.
pub(crate) fn run(arguments: &[String]) -> Result<()> {
    let embassy = match arguments {
        [] => None,
        [folder] => Some(PathBuf::from(folder).join("examples/stm32f4/src/bin")),
        _ => bail!("prove foreign takes at most one argument: a checkout of embassy's repository"),
    };
    setup::require(&[Need::Linker, Need::FirmwareTarget])?;
    let programs = folder().join("programs");
    empty(&programs)?;
    for package in &PACKAGES {
        let source = fetch(package)?;
        let examples = package.examples.split(' ').flat_map(|name| ["--example", name]);
        build(&source, ["--locked", "--features", package.features].into_iter().chain(examples))?;
        for name in package.examples.split(' ') {
            keep(&format!("examples/{name}"), &programs.join(format!("{}.{name}", package.name)))?;
        }
    }
    match embassy {
        Some(sources) => {
            build(&embassys(&sources)?, [])?;
            for name in EMBASSY {
                keep(name, &programs.join(format!("embassy.{name}")))?;
            }
        }
        None => println!(
            "without embassy's programs: they are in no package (prove foreign FOLDER, a checkout of its tag {EMBASSY_TAG})"
        ),
    }
    let judge = ["run", "--release", "--quiet", "--package=stm32f405-model", "--example=foreign", "--"];
    Shell::cargo().args(judge).arg(programs).run()
}

fn folder() -> PathBuf {
    repo::target().join("foreign")
}

fn empty(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}

/// A copy that builds by itself, for any chip of the family.
fn fetch(package: &Package) -> Result<PathBuf> {
    let Package { name, version, .. } = package;
    let asks = folder().join("asks");
    empty(&asks)?;
    fs::create_dir(asks.join("src"))?;
    fs::write(asks.join("src/lib.rs"), "")?;
    let manifest = format!(
        "[package]\nname = \"asks\"\nversion = \"0.0.0\"\n[workspace]\n[dependencies]\n{name} = \"={version}\"\n"
    );
    fs::write(asks.join("Cargo.toml"), manifest)?;
    let metadata = MetadataCommand::new().manifest_path(asks.join("Cargo.toml")).exec()?;
    let found = metadata
        .packages
        .iter()
        .find(|one| one.name.as_str() == *name && one.version.to_string() == *version);
    let from = found.with_context(|| format!("cargo does not find {name} {version}"))?.manifest_path.parent();
    let from = from.context("the manifest has no folder")?.as_std_path();
    let to = folder().join("sources").join(format!("{name}-{version}"));
    empty(&to)?;
    Shell::new("cp").arg("-R").arg(from.join(".")).arg(&to).run()?;
    let manifest = fs::read_to_string(from.join("Cargo.toml"))?;
    fs::write(to.join("Cargo.toml"), for_any_chip(&manifest)?)?;
    Ok(to)
}

fn for_any_chip(manifest: &str) -> Result<String> {
    let mut manifest: toml::Table = manifest.parse()?;
    let examples = manifest.get_mut("example").and_then(toml::Value::as_array_mut);
    for example in examples.into_iter().flatten().filter_map(toml::Value::as_table_mut) {
        example.remove("required-features");
    }
    manifest.insert("workspace".to_owned(), toml::Table::new().into());
    Ok(toml::to_string(&manifest)?)
}

fn embassys(sources: &Path) -> Result<PathBuf> {
    let to = folder().join("sources/embassy");
    empty(&to.join("src/bin"))?;
    fs::write(to.join("Cargo.toml"), EMBASSY_MANIFEST)?;
    fs::write(to.join("build.rs"), EMBASSY_BUILD)?;
    for name in EMBASSY {
        let from = sources.join(format!("{name}.rs"));
        fs::copy(&from, to.join(format!("src/bin/{name}.rs"))).with_context(|| {
            format!("cannot read {}: is it a checkout of embassy's tag {EMBASSY_TAG}?", from.display())
        })?;
    }
    Ok(to)
}

/// A package in its own folder, for its linker settings.
fn build<'a>(source: &Path, arguments: impl IntoIterator<Item = &'a str>) -> Result<()> {
    // Foreign sources' warnings do not count.
    let silent = format!("target.{FIRMWARE_TARGET}.rustflags=[\"-Awarnings\", \"--cap-lints=warn\"]");
    Shell::cargo()
        .args(["build", "--release", "--quiet", "--target", FIRMWARE_TARGET, "--config", &silent])
        .args(arguments)
        .env("CARGO_TARGET_DIR", folder().join("build"))
        .env("DEFMT_LOG", "trace")
        .within(source)
        .run()
}

/// Two packages may share a name.
fn keep(built: &str, to: &Path) -> Result<()> {
    let from = folder().join("build").join(FIRMWARE_TARGET).join("release").join(built);
    fs::copy(&from, to).with_context(|| format!("cannot copy {}", from.display()))?;
    Ok(())
}
