//! The model loads exactly the flashed files, and refuses a bad image.

use std::fs;

use hums_tests::{child, hostile, program};
use sha2::{Digest as _, Sha256};
use stm32f405_model::image::{Image, Refused};
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::memory::FLASH;
use stm32f405_model::time::SECOND;

/// The application's, behind its header.
const VECTORS: u32 = 0x0802_0200;
/// `movs r0, #3; lsls r0, r0, #28; adds r0, #1; bx r0`: a jump to an address without memory.
const TO_NOWHERE: [u16; 4] = [0x2003, 0x0700, 0x3001, 0x4700];
/// `movw r0, #0xED0C; movt r0, #0xE000; movs r1, #4; movt r1, #0x05FA; str r1, [r0]; b .`: AIRCR.SYSRESETREQ.
const RESET: [u16; 9] = [0xF64E, 0x500C, 0xF2CE, 0x0000, 0x2104, 0xF2C0, 0x51FA, 0x6001, 0xE7FE];

fn files() -> [Vec<u8>; 3] {
    ["elf", "dfu", "bin"].map(|kind| fs::read(program::firmware().with_extension(kind)).unwrap())
}

#[test]
fn what_is_flashed_is_what_the_model_has() {
    let [elf, dfu, bin] = files();
    let wanted = Sha256::digest(&bin);
    for (kind, file) in [("elf", elf), ("dfu", dfu), ("bin", bin.clone())] {
        let machine = Machine::new(Image::parse(&file).unwrap(), Board::default());
        let flash = machine.memory(FLASH.0, FLASH.1);
        let (image, rest) = flash.split_at(bin.len());
        let loaded = Sha256::digest(image);
        assert_eq!(loaded, wanted, "{kind}");
        assert!(rest.iter().all(|byte| *byte == 0xFF), "{kind} has more than the image");
        let hex = loaded.iter().fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"));
        println!("{kind}: what the model has loaded is {hex}, as in the raw image");
    }
}

#[test]
fn what_is_no_image_of_this_chip_is_refused() {
    let [elf, dfu, bin] = files();
    for part in [1_usize, 2, 3] {
        for file in [&elf, &dfu] {
            let refused = Image::parse(&file[..file.len() * part / 4]).unwrap_err();
            assert!(matches!(refused, Refused::Truncated(..)), "{refused}");
        }
    }
    assert!(matches!(Image::parse(&bin[..256]), Err(Refused::Vectors(..))));
    let mut damaged = dfu.clone();
    damaged[dfu.len() / 2] ^= 1;
    assert!(matches!(Image::parse(&damaged), Err(Refused::Damaged(_))));
    let mut other = elf.clone();
    // e_machine: RISC-V.
    other[18] = 243;
    assert!(matches!(Image::parse(&other), Err(Refused::OtherProcessor)));
    // An STM32H7's RAM.
    let mut other = bin;
    other[..4].copy_from_slice(&0x2408_0000_u32.to_le_bytes());
    assert!(matches!(Image::parse(&other), Err(Refused::Vectors(..))));
}

fn with_main(code: &[u16]) -> (Vec<u8>, u32) {
    let [mut elf, ..] = files();
    let machine = Machine::new(Image::parse(&elf).unwrap(), Board::default());
    let main = machine.image().symbols.iter().find(|symbol| symbol.name == "main").unwrap();
    let was = machine.memory(main.address, main.bytes);
    let places: Vec<_> = elf.windows(was.len()).enumerate().filter(|(_, bytes)| *bytes == was).collect();
    let [(at, _)] = places[..] else { panic!("main is there {} times", places.len()) };
    let (code, main) = (code.iter().flat_map(|half| half.to_le_bytes()), main.address);
    elf.iter_mut().skip(at).zip(code).for_each(|(byte, new)| *byte = new);
    (elf, main)
}

fn emulated(elf: &[u8], code: i32) -> String {
    let dir = tempfile::tempdir().unwrap();
    let (image, card) = (dir.path().join("hums.elf"), dir.path().join("card.img"));
    fs::write(&image, elf).unwrap();
    let mut command = program::command(["sim", "--card-size", "64"]);
    command.arg(hostile::raw_heartbeats(dir.path(), 10)).arg("--sd").arg(card).arg("--firmware").arg(image);
    child::run(&mut command, program::LIMIT).expect_code(&[code]).stderr
}

#[test]
fn a_jump_into_nowhere_stops_with_registers_place_and_the_last_instructions() {
    let (elf, main) = with_main(&TO_NOWHERE);
    let said = emulated(&elf, 1);
    assert!(said.contains("an instruction is wanted from 0x30000000, where none may be"), "{said}");
    assert!(said.contains(" us, in no function, come from main+0x6\n  r0  30000001"), "{said}");
    let registers = said.split_once("  r15 30000000\n").expect("the registers");
    assert_eq!(registers.1.lines().count(), 32, "{said}");
    assert!(said.ends_with(&format!("  {:08x} main+0x6\n", main + 6)), "{said}");
    let mut image = Image::parse(&elf).unwrap();
    let (_, vectors) = image.pieces.iter_mut().find(|(address, _)| *address == VECTORS).unwrap();
    vectors[12..16].copy_from_slice(&0x3000_0001_u32.to_le_bytes());
    let report = Machine::new(image, Board::default()).run_until(SECOND).unwrap_err();
    assert!(report.reason.contains("locked up"), "{report}");
    assert_eq!(report.registers[15], 0x3000_0000, "{report}");
}

#[test]
fn an_image_of_no_known_board_is_refused() {
    let [elf, ..] = files();
    let name = format!("{}{}{}", hums_boards::TAG, hums_boards::DEFAULT, hums_boards::TAG_END);
    for (new, wanted) in
        [("hums-boarD:", "does not name its board"), ("hums-board:x", "there is no board xlimex")]
    {
        let mut other = elf.clone();
        let at = other.windows(name.len()).position(|bytes| bytes == name.as_bytes()).unwrap();
        other[at..at + new.len()].copy_from_slice(new.as_bytes());
        let said = emulated(&other, 1);
        assert!(said.contains(wanted), "{said}");
    }
}

#[test]
fn a_board_that_resets_itself_again_and_again_is_told() {
    let (elf, _) = with_main(&RESET);
    let said = emulated(&elf, 3);
    let times = said.split_once("the board reset itself ").and_then(|(_, rest)| rest.split_once(" times"));
    assert!(times.is_some_and(|(times, _)| times.parse::<u32>().unwrap() > 50), "{said}");
}
