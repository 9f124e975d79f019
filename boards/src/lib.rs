//! Boards of the firmware. A board is one file, `boards/NAME.toml`: pins, crystal, card slot, LED, and what an owner needs
//! to know.
//!
//! The build script of `hums-app` makes the board's Rust code from it. `cargo xtask` and `hums sim --firmware` find the board's
//! wiring here. [`page::render`] makes `docs/boards.md`. `boards/facts.csv` names the source of each pin.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::LazyLock;

use serde::Deserialize;

pub mod page;

/// The board whose image is built if none is named.
pub const DEFAULT: &str = "olimex-stm32-h405";

/// The image has its board's name after this mark, up to a [`TAG_END`].
pub const TAG: &str = "hums-board:";
/// End of the board's name in the image.
pub const TAG_END: char = ';';

/// D- and D+ of the USB plug: the chip has its full-speed port on no other pins (DS8626, table 9).
const USB: [(&str, Pin); 2] =
    [("usb-dm", Pin { port: 0, number: 11 }), ("usb-dp", Pin { port: 0, number: 12 })];

/// Multiples of this frequency divide down to the input of the chip's PLL.
const CRYSTAL_STEP_HZ: u32 = 2_000_000;
/// A crystal of the chip (DS8626, table 36).
const CRYSTAL_HZ: std::ops::RangeInclusive<u32> = 4_000_000..=26_000_000;

const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// A board.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Board {
    /// Name of its file without the ending.
    #[serde(skip)]
    pub name: String,
    /// The maker's name of it.
    pub title: String,
    /// Frequency of the crystal.
    pub crystal_hz: u32,
    /// The autopilot's port.
    pub autopilot: Port,
    /// The ground station's port: a telemetry radio.
    pub radio: Port,
    /// The card's slot.
    pub card: Card,
    /// The LED.
    pub led: Led,
    /// A button for the owner: held at power-on it starts the card-reader mode.
    pub button: Option<Button>,
    /// Pins at a fixed level, set before the first clock to the card.
    #[serde(default)]
    pub hold: Hold,
    /// What the owner needs to know.
    pub owner: Owner,
}

/// A serial port.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Number in the reference manual: 1, 2, 3 and 6 are USARTs, 4 and 5 UARTs.
    pub usart: u8,
    /// Output.
    pub tx: Wire,
    /// Input.
    pub rx: Wire,
}

/// A pin of a port.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wire {
    /// The chip's pin.
    pub pin: Pin,
    /// The maker's name of the pad.
    pub pad: String,
    /// DMA stream that serves it.
    pub dma: Stream,
}

/// The card's slot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Whether the board has a slot.
    pub has_slot: bool,
    /// Kind and place of the slot, for people.
    pub slot: String,
    /// The SPI that its pins belong to; without one the processor moves the bits itself.
    pub bus: Option<Bus>,
    /// Clock.
    pub sck: Pin,
    /// From the card.
    pub miso: Pin,
    /// To the card.
    pub mosi: Pin,
    /// Select.
    pub cs: Pin,
    /// Switch of the slot. The firmware does not use it.
    pub detect: Option<Detect>,
}

/// SPI and its DMA streams.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Number of the SPI.
    pub spi: u8,
    /// Stream of the output.
    pub tx: Stream,
    /// Stream of the input.
    pub rx: Stream,
}

/// Switch of a card slot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detect {
    /// Its pin.
    pub pin: Pin,
    /// Level while a card is in the slot.
    pub present: Level,
}

/// The LED.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Led {
    /// Its pin.
    pub pin: Pin,
    /// Level at which it is lit.
    pub lit: Level,
}

/// A button.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Button {
    /// Its pin.
    pub pin: Pin,
    /// The maker's name of it.
    pub name: String,
    /// Level while it is pressed.
    pub pressed: Level,
}

/// Pins at a fixed level, with the part that each belongs to.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hold {
    /// High: mostly selects of other parts.
    #[serde(default)]
    pub high: BTreeMap<Pin, String>,
    /// Low: beepers and switches.
    #[serde(default)]
    pub low: BTreeMap<Pin, String>,
    /// Pulled up: unused lines of the card.
    #[serde(default)]
    pub pull_up: BTreeMap<Pin, String>,
}

/// Words for the owner of a board: price, supply, hazards.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Owner {
    /// Shops.
    pub buy: String,
    /// The maker's page.
    pub page: String,
    /// Price with its year.
    pub price: String,
    /// Power input.
    pub power: String,
    /// Whether the maker documents an input for 5 V.
    pub takes_5v: bool,
    /// The USB plug.
    pub usb: String,
    /// How to reach the chip's boot loader.
    pub boot: String,
    /// Hazards and remarks.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// A level of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Ground.
    Low,
    /// 3.3 V.
    High,
}

impl Level {
    /// Its word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::High => "high",
        }
    }
}

/// A pin of the chip, such as `PA9`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct Pin {
    /// Port: 0 is A.
    pub port: u8,
    /// Number, 0 to 15.
    pub number: u8,
}

impl Pin {
    /// A pin of the debug port (SWDIO, SWCLK): a probe cannot connect while it is an output.
    pub const fn is_debug(self) -> bool {
        self.port == 0 && matches!(self.number, 13 | 14)
    }
}

impl TryFrom<String> for Pin {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let parts = || {
            let (port, number) = text.strip_prefix('P')?.split_at_checked(1)?;
            let port = port.bytes().next().filter(|port| (b'A'..=b'D').contains(port))? - b'A';
            let number = number.parse().ok().filter(|parsed| *parsed < 16_u8)?;
            Some(Self { port, number }).filter(|pin| pin.to_string() == text)
        };
        parts().ok_or_else(|| format!("{text} is no pin of the STM32F405RG: PA0 to PD2"))
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}{}", char::from(b'A' + self.port), self.number)
    }
}

/// A DMA stream, such as `DMA2 stream 7`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(try_from = "String")]
pub struct Stream {
    /// Controller, 1 or 2.
    pub controller: u8,
    /// Number, 0 to 7.
    pub number: u8,
}

impl TryFrom<String> for Stream {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let all = (1..=2).flat_map(|controller| (0..8).map(move |number| Self { controller, number }));
        all.into_iter()
            .find(|stream| stream.to_string() == text)
            .ok_or_else(|| format!("{text} is no DMA stream"))
    }
}

impl fmt::Display for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DMA{} stream {}", self.controller, self.number)
    }
}

impl Port {
    /// Name in the reference manual.
    pub fn peripheral(&self) -> String {
        let kind = if matches!(self.usart, 4 | 5) { "UART" } else { "USART" };
        format!("{kind}{}", self.usart)
    }
}

impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Board {}

impl Board {
    /// Reads the text of a board's file.
    pub fn parse(name: &str, text: &str) -> Result<Self, String> {
        let board: Self = toml::from_str(text).map_err(|error| format!("boards/{name}.toml: {error}"))?;
        let board = Self { name: name.to_owned(), ..board };
        board.check().map_err(|why| format!("boards/{name}.toml: {why}"))?;
        Ok(board)
    }

    /// Every pin with its function; a shared pin appears twice.
    pub fn pins(&self) -> Vec<(&'static str, Pin)> {
        let Self { autopilot, radio, card, led, button, hold, .. } = self;
        let mut pins = vec![
            ("autopilot-tx", autopilot.tx.pin),
            ("autopilot-rx", autopilot.rx.pin),
            ("radio-tx", radio.tx.pin),
            ("radio-rx", radio.rx.pin),
            ("card-sck", card.sck),
            ("card-miso", card.miso),
            ("card-mosi", card.mosi),
            ("card-cs", card.cs),
            (if led.lit == Level::High { "led-high" } else { "led-low" }, led.pin),
        ];
        let detect = card.detect.iter().map(|detect| match detect.present {
            Level::Low => ("detect-low", detect.pin),
            Level::High => ("detect-high", detect.pin),
        });
        pins.extend(detect);
        pins.extend(USB);
        pins.extend(button.iter().map(|button| match button.pressed {
            Level::Low => ("button-low", button.pin),
            Level::High => ("button-high", button.pin),
        }));
        pins.extend(hold.high.keys().map(|pin| ("hold-high", *pin)));
        pins.extend(hold.low.keys().map(|pin| ("hold-low", *pin)));
        pins.extend(hold.pull_up.keys().map(|pin| ("pull-up", *pin)));
        pins
    }

    /// The DMA streams of ports and card.
    pub fn streams(&self) -> Vec<Stream> {
        let Self { autopilot, radio, card, .. } = self;
        let ports = [autopilot, radio].into_iter().flat_map(|port| [port.rx.dma, port.tx.dma]);
        ports.chain(card.bus.iter().flat_map(|bus| [bus.rx, bus.tx])).collect()
    }

    fn check(&self) -> Result<(), String> {
        if !CRYSTAL_HZ.contains(&self.crystal_hz) || !self.crystal_hz.is_multiple_of(CRYSTAL_STEP_HZ) {
            return Err(format!(
                "crystal_hz = {} is no even number of megahertz from 4 to 26",
                self.crystal_hz
            ));
        }
        let mut seen = BTreeSet::new();
        if let Some((function, pin)) = self.pins().into_iter().find(|(_, pin)| !seen.insert(*pin)) {
            return Err(format!("{pin} ({function}) has two functions"));
        }
        let mut seen = BTreeSet::new();
        if let Some(stream) = self.streams().into_iter().find(|stream| !seen.insert(*stream)) {
            return Err(format!("{stream} is used twice"));
        }
        let is_tag = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-';
        if self.name.is_empty() || !self.name.chars().all(is_tag) {
            return Err("the file's name may have small letters, digits and - only".to_owned());
        }
        Ok(())
    }
}

/// All boards, by name.
///
/// # Panics
/// If a file is wrong. A test reads them all.
pub fn all() -> &'static [Board] {
    static ALL: LazyLock<Vec<Board>> = LazyLock::new(|| {
        let read = |(name, text): &(&str, &str)| Board::parse(name, text).expect("a test reads every file");
        FILES.iter().map(read).collect()
    });
    &ALL
}

/// The board of this name. The error names all of them.
pub fn find(name: &str) -> Result<&'static Board, String> {
    let names = || all().iter().map(|board| board.name.as_str()).collect::<Vec<_>>().join(", ");
    all()
        .iter()
        .find(|board| board.name == name)
        .ok_or_else(|| format!("there is no board {name}. The boards are: {}", names()))
}

/// The name of an image's board, from the bytes of its flash.
pub fn name_in(image: &[u8]) -> Option<&str> {
    let at = image.windows(TAG.len()).position(|bytes| bytes == TAG.as_bytes())? + TAG.len();
    let rest = image.get(at..)?;
    let end = rest.iter().position(|byte| *byte == TAG_END as u8)?;
    std::str::from_utf8(rest.get(..end)?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_file_is_refused_with_its_place() {
        let (name, text) = FILES.iter().find(|(name, _)| *name == DEFAULT).expect("the default board");
        let cases = [
            ("8_000_000", "25_000_000", "crystal_hz = 25000000 is no even number"),
            ("pin = \"PA9\"", "pin = \"PA10\"", "PA10 (autopilot-rx) has two functions"),
            ("pin = \"PA9\"", "pin = \"PD16\"", "PD16 is no pin"),
            ("DMA2 stream 7", "DMA2 stream 2", "DMA2 stream 2 is used twice"),
            ("DMA2 stream 7", "DMA3 stream 7", "DMA3 stream 7 is no DMA stream"),
            ("lit = \"low\"", "lit = \"red\"", "unknown variant `red`"),
        ];
        for (from, to, wanted) in cases {
            assert!(text.contains(from), "{from}");
            let error = Board::parse(name, &text.replacen(from, to, 1)).unwrap_err();
            assert!(
                error.starts_with("boards/olimex-stm32-h405.toml: ") && error.contains(wanted),
                "{error}"
            );
        }
        assert!(Board::parse("Olimex", text).unwrap_err().contains("small letters"));
        assert!(find("f407").unwrap_err().contains(DEFAULT));
    }

    #[test]
    fn an_image_names_its_board() {
        assert_eq!(name_in(b"\0\0hums-board:matek;\0"), Some("matek"));
        for image in [&b"hums-board:matek"[..], b"hums-boar", b"", b"hums-board:\xFF;"] {
            assert_eq!(name_in(image), None);
        }
    }
}
