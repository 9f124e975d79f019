//! Gives the linker the memory map, and the program its board's pins (`HUMS_BOARD`), only for the bare-metal target.

use std::path::{Path, PathBuf};
use std::{env, fs};

use hums_boards::{Board, Level, Pin};

fn main() -> Result<(), String> {
    println!("cargo::rerun-if-env-changed=HUMS_BOARD");
    println!("cargo::rerun-if-changed=memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let name = env::var("HUMS_BOARD").unwrap_or_else(|_| hums_boards::DEFAULT.to_owned());
    let board = hums_boards::find(&name).map_err(|why| format!("HUMS_BOARD: {why}"))?;
    fs::write(out.join("board.rs"), code(board)).expect("OUT_DIR can be written");
    fs::copy(Path::new("memory.x"), out.join("memory.x")).expect("the linker script is in the source tree");
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    Ok(())
}

fn code(board: &Board) -> String {
    let Board { name, card, led, hold, .. } = board;
    let pins = |pins: Vec<Pin>| pins.into_iter().map(|each| pin(each) + ", ").collect::<String>();
    let held = |pins_of: &std::collections::BTreeMap<Pin, String>| pins(pins_of.keys().copied().collect());
    let bus = card.bus.as_ref().map_or(0, |bus| bus.spi);
    let [sck, mosi, miso, cs] = [card.sck, card.mosi, card.miso, card.cs].map(pin);
    format!(
        "pub(crate) const NAME: &str = {name:?};\n\
         pub(crate) const SCK: Pin = {sck};\npub(crate) const MOSI: Pin = {mosi};\npub(crate) const MISO: Pin = {miso};\npub(crate) const CS: Pin = {cs};\n\
         const SPI: u8 = {bus};\n\
         const LED: Pin = {led_pin};\nconst LED_LIT: bool = {lit};\nconst LED_WAITS: bool = {waits};\n\
         const HIGH: &[Pin] = &[{high}];\nconst LOW: &[Pin] = &[{low}];\nconst PULLED: &[Pin] = &[{pulled}];\n",
        led_pin = pin(led.pin),
        lit = led.lit == Level::High,
        waits = led.pin.is_debug(),
        high = held(&hold.high),
        low = held(&hold.low),
        pulled = held(&hold.pull_up),
    )
}

fn pin(pin: Pin) -> String {
    format!("Pin::new({}, {})", pin.port, pin.number)
}
