//! Each board file against `facts.csv`: facts by function, with a source for each.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;

/// Board, function, pin.
type Fact = (String, String, String);

fn facts() -> BTreeSet<Fact> {
    let mut lines = include_str!("../facts.csv").lines();
    assert_eq!(lines.next(), Some("board,function,pin,source,commit"));
    let fact = |line: &str| {
        let [board, function, pin, source, commit] =
            <[&str; 5]>::try_from(line.split(',').collect::<Vec<_>>()).expect("five fields");
        assert!(!source.is_empty() && !commit.is_empty(), "no source: {line}");
        (board.to_owned(), function.to_owned(), pin.to_owned())
    };
    lines.map(fact).collect()
}

#[test]
fn each_pin_price_and_page_of_each_board_is_that_of_its_sources_and_none_is_missing() {
    let in_files: BTreeSet<Fact> = hums_boards::all()
        .iter()
        .flat_map(|board| {
            let crystal = ("crystal-mhz", (board.crystal_hz / 1_000_000).to_string());
            let pins = board.pins().into_iter().map(|(function, pin)| (function, pin.to_string()));
            let owner = &board.owner;
            let words = [("price", &owner.price), ("page", &owner.page), ("usb-plug", &owner.usb)];
            let words = words.map(|(function, word)| (function, word.clone()));
            pins.chain([crystal])
                .chain(words)
                .map(|(function, pin)| (board.name.clone(), function.to_owned(), pin))
        })
        .collect();
    let facts = facts();
    let no_source = |(_, function, word): &&Fact| word == "price unknown" || function == "usb-plug";
    let unsourced: Vec<_> = in_files.difference(&facts).filter(|fact| !no_source(fact)).collect();
    let missing: Vec<_> = facts.difference(&in_files).collect();
    assert!(
        unsourced.is_empty() && missing.is_empty(),
        "without a source: {unsourced:?}; not in a file: {missing:?}"
    );
}

#[test]
fn the_page_is_that_of_the_files() {
    let read = |path| std::fs::read_to_string(format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    assert!(
        read("docs/boards.md") == hums_boards::page::render(),
        "docs/boards.md is old: cargo xtask boards"
    );
    assert!(
        read("README.md").contains(&hums_boards::page::table("docs/boards.md")),
        "README.md: cargo xtask boards"
    );
    let hums_boards::Board { card, radio, autopilot, led, .. } =
        hums_boards::find("olimex-stm32-h405").unwrap();
    let wires = [autopilot.rx.pin, autopilot.tx.pin, radio.tx.pin, radio.rx.pin];
    let pins = [&wires[..], &[card.cs, card.sck, card.miso, card.mosi, led.pin]].concat();
    let svg = read("docs/wiring.svg");
    let drawn = svg.split(">P").skip(1).map(|rest| format!("P{}", &rest[..rest.find('<').unwrap()]));
    assert!(drawn.eq(pins.iter().map(ToString::to_string)), "docs/wiring.svg");
}
