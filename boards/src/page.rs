//! `docs/boards.md`: a section for each board, and the table "What to buy" of the README.

use std::fmt::Write as _;

use crate::{Board, Owner, Port, all};

const HEAD: &str = "\
# Boards

For the buyer and the builder of a box. Afterwards you can choose a board, and know its pads, its supply and its boot loader.
[wiring.md](wiring.md) has the autopilot's side and its settings. `cargo xtask boards` makes this page from the files in [`boards/`](../boards).

**No board of this page was tried on hardware.** `cargo xtask prove boards` runs the image of each on the [model of the chip](chip.md). Pins,
crystals, levels and prices come from the sources in [`boards/facts.csv`](../boards/facts.csv). Each price was seen in its year, and may have
changed. If you try a board, please report it with the file of `hums box report`.

* A flight controller is used here as a recorder only. Its own sensors, OSD and motor outputs stay unused. Do not connect motors.
* The USB plug loads the firmware, is a [serial port](companion.md#the-usb-port), and can show the card as a [disk](runbook.md#read-the-card-over-usb).
* **Supply:** *documented* means that the maker names a pad as an input for 5 V. On other flight controllers the 5 V pad is an output. Feed their
  battery pads within the range of the row *power*. Leave the 5 V of the telemetry port open.
* Rows *held* and *pulled up*: the firmware keeps these pins at a level, so that other chips of the board stay silent. Connect nothing there.
";

const TAIL: &str = "
## Add a board
For a board with an STM32F405RG and a crystal of 4 to 26 MHz (an even number). No code changes.

1. Copy the file of the most similar board to `boards/NAME.toml`, and change it. The chip's manual (RM0090) has the DMA streams in tables 42 and 43.
   Without `bus` the processor moves the card's pins itself.
2. Add a line to `boards/facts.csv` for each pin, the price and the page, with its source and the commit of the source.
3. `cargo test -p hums-boards` compares both, after `cargo xtask boards` has made this page.
4. `cargo xtask firmware --board NAME` builds it. A pin without the wanted function, or a DMA stream that does not serve a port, does not compile.
5. `cargo xtask prove boards` runs the image: boot, flight, stall, card pulled, power cut, USB host, update.
";

/// The page.
pub fn render() -> String {
    let mut page = format!("{HEAD}\n{}", table(""));
    for board in all() {
        let _ = section(&mut page, board);
    }
    page + TAIL
}

/// What to buy: a line for each board, with links to the page at this path.
pub fn table(page: &str) -> String {
    let mut table = "| board | card | plug | to buy | 5 V input |\n|---|---|---|---|---|\n".to_owned();
    for Board { name, title, card, owner, .. } in all() {
        let slot = if card.has_slot { "slot on the board" } else { "no slot: wire a socket" };
        let input = if owner.takes_5v { "documented" } else { "not documented" };
        let (anchor, usb, buy) = (anchor(title), &owner.usb, to_buy(owner));
        let _ = writeln!(table, "| [{title}]({page}#{anchor}) `{name}` | {slot} | {usb} | {buy} | {input} |");
    }
    table
}

fn to_buy(Owner { buy, page, price, .. }: &Owner) -> String {
    format!("[{buy}]({page}); {price}")
}

fn anchor(title: &str) -> String {
    let letters = title.chars().filter(|letter| letter.is_alphanumeric() || matches!(letter, ' ' | '-'));
    letters.map(|letter| if letter == ' ' { '-' } else { letter.to_ascii_lowercase() }).collect()
}

fn section(page: &mut String, board: &Board) -> std::fmt::Result {
    let Board { name, title, crystal_hz, autopilot, radio, card, led, button, hold, owner } = board;
    write!(page, "\n## {title}\n`cargo xtask flash --dfu --board {name}`\n\n")?;
    page.push_str("| | pad | pin of the chip |\n|---|---|---|\n");
    let ports = [("autopilot's telemetry port", autopilot), ("radio", radio)];
    for (other, port) in ports {
        let Port { rx, tx, .. } = port;
        let usart = port.peripheral();
        writeln!(page, "| {other}: its TX to | {} | {} ({usart} RX) |", rx.pad, rx.pin)?;
        writeln!(page, "| {other}: its RX to | {} | {} ({usart} TX) |", tx.pad, tx.pin)?;
    }
    let bus = card.bus.as_ref().map_or_else(|| "by software".to_owned(), |bus| format!("SPI{}", bus.spi));
    let (sck, miso, mosi, cs) = (card.sck, card.miso, card.mosi, card.cs);
    writeln!(page, "| card | {} | SCK {sck}, MISO {miso}, MOSI {mosi}, CS {cs} ({bus}) |", card.slot)?;
    if let Some(detect) = &card.detect {
        writeln!(page, "| card's switch | unused | {}, {} with a card |", detect.pin, detect.present.name())?;
    }
    let waits = if led.pin.is_debug() { "; a debug probe can connect in the first second only" } else { "" };
    writeln!(page, "| LED | on the board | {}, lit when {}{waits} |", led.pin, led.lit.name())?;
    if let Some(button) = button {
        let (pin, pressed) = (button.pin, button.pressed.name());
        writeln!(
            page,
            "| button for the [card reader](runbook.md#read-the-card-over-usb) | {} | {pin}, {pressed} when pressed |",
            button.name
        )?;
    }
    for (level, pins) in [("held high", &hold.high), ("held low", &hold.low), ("pulled up", &hold.pull_up)] {
        if !pins.is_empty() {
            let pins: Vec<_> = pins.iter().map(|(pin, part)| format!("{pin} ({part})")).collect();
            writeln!(page, "| {level} | | {} |", pins.join(", "))?;
        }
    }
    writeln!(page, "| crystal | | {} MHz |", crystal_hz / 1_000_000)?;
    writeln!(page, "| power | {} | |", owner.power)?;
    writeln!(page, "| boot loader | {}; USB plug: {} | |", owner.boot, owner.usb)?;
    writeln!(page, "| to buy | {} | |", to_buy(owner))?;
    for note in owner.notes.iter().take(1) {
        write!(page, "\n* {note}\n")?;
    }
    owner.notes.iter().skip(1).try_for_each(|note| writeln!(page, "* {note}"))
}
