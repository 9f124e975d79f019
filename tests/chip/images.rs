//! What is flashed is what the model has, and a bad image is told.

use std::fs;

use hums_tests::program;
use sha2::{Digest as _, Sha256};
use stm32f405_model::image::{Image, Refused};
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::memory::FLASH;
use stm32f405_model::time::SECOND;

/// `ldr r0, [pc]; bx r0`, and where there is nothing.
const NOWHERE: [u8; 8] = [0x00, 0x48, 0x00, 0x47, 0x01, 0x00, 0x00, 0x30];

/// The files of a release: ELF, DFU, raw image.
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
        println!("hums-f405.{kind}: what the model has loaded is {hex}, as hums-f405.bin");
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

#[test]
fn a_jump_into_nowhere_stops_with_registers_place_and_the_last_instructions() {
    let [elf, ..] = files();
    let mut image = Image::parse(&elf).unwrap();
    let main = image.symbols.iter().find(|symbol| symbol.name == "main").unwrap().address;
    for (at, bytes) in [(main, &NOWHERE[..]), (FLASH.0 + 12, &NOWHERE[4..])] {
        let inside =
            |(address, bytes): &&mut (u32, Vec<u8>)| (*address..*address + bytes.len() as u32).contains(&at);
        let (address, piece) = image.pieces.iter_mut().find(inside).unwrap();
        let offset = (at - *address) as usize;
        piece[offset..offset + bytes.len()].copy_from_slice(bytes);
    }
    let report = Machine::new(image, Board::default()).run_until(SECOND).unwrap_err();
    assert!(report.reason.contains("locked up"), "{report}");
    assert_eq!(report.registers[15], 0x3000_0000, "{report}");
    assert_eq!(report.trace.len(), 32);
    let (address, name) = report.trace.last().unwrap();
    assert_eq!((*address, &**name), (main + 2, "main+0x2"), "{report}");
}
