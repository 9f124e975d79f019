//! Gives the linker the memory map and its scripts, and the program its board and its commit. The board is the one that
//! `HUMS_BOARD` names, from its file in `boards/`. Only for the bare-metal target: a host build of the workspace must not see them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use hums_boards::{Board, Level, Pin, Port, Stream};

/// Input of the chip's PLL (RM0090, 7.3.2): the crystal is divided down to it.
const PLL_INPUT_HZ: u32 = 2_000_000;

fn main() -> Result<(), String> {
    println!("cargo::rustc-env=HUMS_GIT={}", commit());
    println!("cargo::rerun-if-env-changed=DEFMT_LOG");
    println!("cargo::rerun-if-env-changed=HUMS_BOARD");
    if env::var_os("DEFMT_LOG").is_none() {
        // defmt's own default is errors only.
        println!("cargo::rustc-env=DEFMT_LOG=info");
    }
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    copy("memory.x", &out.join("memory.x"));
    let name = env::var("HUMS_BOARD").unwrap_or_else(|_| hums_boards::DEFAULT.to_owned());
    let board = hums_boards::find(&name).map_err(|why| format!("HUMS_BOARD: {why}"))?;
    // Clippy checks the types of every board beside the image's.
    let boards = hums_boards::all().iter().fold(code(board), |boards, other| {
        let code = code(other);
        format!("{boards}#[cfg(clippy)]\n#[allow(dead_code)]\nconst _: () = {{\n{code}}};\n")
    });
    fs::write(out.join("board.rs"), boards).expect("OUT_DIR can be written");
    println!("cargo::rustc-link-search={}", out.display());
    let logs = env::var_os("CARGO_FEATURE_LOG").is_some();
    for argument in ["--nmagic", "-Tlink.x"].into_iter().chain(logs.then_some("-Tdefmt.x")) {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    Ok(())
}

/// The board as a call of the macro in `src/boards/board.rs`, by the names of `embassy_stm32`.
fn code(board: &Board) -> String {
    let Board { name, crystal_hz, autopilot, radio, card, led, button, hold, .. } = board;
    let port = |port: &Port| {
        let [rx, tx] = [channel(port.rx.dma), channel(port.tx.dma)];
        format!("{} {{ {} {} }} {{ {rx} {tx} }}", port.peripheral(), port.rx.pin, port.tx.pin)
    };
    let pins = format!("{} {} {} {}", card.sck, card.mosi, card.miso, card.cs);
    let card = card.bus.as_ref().map_or_else(
        || format!("pins {{ {pins} }}"),
        |bus| format!("SPI{} {{ {pins} }} {{ {} {} }}", bus.spi, channel(bus.tx), channel(bus.rx)),
    );
    let button = button
        .as_ref()
        .map_or_else(String::new, |button| format!("{} {}", button.pin, level(button.pressed)));
    let held = |pins: &BTreeMap<Pin, String>| pins.keys().map(Pin::to_string).collect::<Vec<_>>().join(" ");
    let streams = board
        .streams()
        .into_iter()
        .map(|stream| format!("DMA{}_STREAM{} {}", stream.controller, stream.number, channel(stream)));
    // With thousands apart, as lints want a number.
    let [millions, thousands, ones] =
        [crystal_hz / 1_000_000, crystal_hz / 1_000 % 1_000, crystal_hz % 1_000];
    let crystal = format!("{millions}_{thousands:03}_{ones:03}");
    let tag = format!("{}{name}{}", hums_boards::TAG, hums_boards::TAG_END);
    format!(
        "board! {{\n tag {tag:?} {skip} {end};\n crystal {crystal} DIV{divider};\n autopilot {autopilot};\n gs {gs};\n card {{ {card} }};\n \
         led {led} {lit} {wait};\n button {{ {button} }};\n high {{ {high} }} low {{ {low} }} pull {{ {pull} }}\n streams {{ {streams} }}\n}}\n",
        skip = hums_boards::TAG.len(),
        end = hums_boards::TAG.len() + name.len(),
        divider = crystal_hz / PLL_INPUT_HZ,
        autopilot = port(autopilot),
        gs = port(radio),
        led = led.pin,
        lit = level(led.lit),
        wait = led.pin.is_debug(),
        high = held(&hold.high),
        low = held(&hold.low),
        pull = held(&hold.pull_up),
        streams = streams.collect::<Vec<_>>().join(" "),
    )
}

fn level(level: Level) -> &'static str {
    if level == Level::High { "High" } else { "Low" }
}

fn channel(stream: Stream) -> String {
    format!("DMA{}_CH{}", stream.controller, stream.number)
}

fn copy(from: &str, to: &Path) {
    println!("cargo::rerun-if-changed={from}");
    fs::copy(from, to).expect("the linker script is in the source tree");
}

fn commit() -> String {
    // The log of HEAD grows with every commit, so that the next build looks again.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_default()
}

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
