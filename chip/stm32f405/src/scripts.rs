//! Register scripts over several devices.

use cortex_m4_model::{Bus, Size};

use crate::chip::{Chip, Note, Trouble};
use crate::line::chars;
use crate::map;
use crate::time::{Now, US};

const RCC: u32 = 0x4002_3800;
const GPIOA: u32 = 0x4002_0000;
const USART1: u32 = 0x4001_1000;
const DMA2: u32 = 0x4002_6400;
const RAM: u32 = 0x2000_1000;

fn chip() -> Chip {
    Chip::new(8_000_000, 32_000, 1)
}

fn write(chip: &mut Chip, address: u32, value: u32) {
    let now = chip.moment.cycle;
    assert_eq!(chip.write(address, Size::Word, value, now), Ok(()), "{address:#x}");
    assert_eq!(chip.trouble, None, "{address:#x}");
}

fn read(chip: &mut Chip, address: u32) -> u32 {
    let now = chip.moment.cycle;
    chip.read(address, Size::Word, now).expect("something is there")
}

fn port(chip: &mut Chip) {
    for (address, value) in [
        (RCC + 0x30, 1 | 1 << 22 | 0x0010_0000),
        (RCC + 0x44, 1 << 4),
        // PA9 and PA10 by function 7.
        (GPIOA, 0xA800_0000 | 2 << 18 | 2 << 20),
        (GPIOA + 0x24, 7 << 4 | 7 << 8),
        (USART1 + 0x08, 138),
        (USART1 + 0x0C, 1 << 13 | 1 << 3 | 1 << 2),
        (USART1 + 0x14, 1 << 6 | 1 << 7),
        // Stream 2, channel 4: a ring with both interrupts.
        (DMA2 + 0x10 + 2 * 0x18 + 0x04, 8),
        (DMA2 + 0x10 + 2 * 0x18 + 0x08, USART1 + 4),
        (DMA2 + 0x10 + 2 * 0x18 + 0x0C, RAM),
        (DMA2 + 0x10 + 2 * 0x18, 4 << 25 | 1 << 10 | 1 << 8 | 1 << 4 | 1 << 3 | 1),
    ] {
        write(chip, address, value);
    }
}

fn is_high(chip: &Chip, line: u16) -> bool {
    chip.lines >> line & 1 == 1
}

#[test]
fn characters_go_round_the_ring_and_tell_half_and_full() {
    let mut chip = chip();
    port(&mut chip);
    chip.usarts[0].line.extend(chars(b"0123456789", 10 * US, 115_200.0).0);
    chip.line_changed(0);
    // 87 us a character: the fourth after 357 us, the eighth after 704.
    for (us, flags, left) in
        [(350, 0, 5), (360, 1 << 20, 4), (695, 1 << 20, 1), (705, 3 << 20, 8), (900, 3 << 20, 6)]
    {
        let until = chip.time.cycle(us * US);
        chip.happen(until);
        chip.moment = chip.time.at(until);
        assert_eq!(read(&mut chip, DMA2), flags, "{us} us");
        assert_eq!(read(&mut chip, DMA2 + 0x44), left, "{us} us");
        assert_eq!(is_high(&chip, map::DMA[1][2]), flags != 0, "{us} us");
    }
    assert_eq!(chip.sram.all()[0x1000..0x1008], *b"89234567");
    write(&mut chip, DMA2 + 0x08, 3 << 20);
    assert!(!is_high(&chip, map::DMA[1][2]));
    assert_eq!(chip.usarts[0].counts.overruns, 0);
}

#[test]
fn memory_goes_out_by_dma_at_the_ports_rate() {
    let mut chip = chip();
    port(&mut chip);
    chip.sram.all_mut()[0x1100..0x1104].copy_from_slice(b"HUMS");
    for (offset, value) in
        [(4, 4), (8, USART1 + 4), (0xC, RAM + 0x100), (0, 4 << 25 | 1 << 10 | 1 << 6 | 1 << 4 | 1)]
    {
        write(&mut chip, DMA2 + 0x10 + 7 * 0x18 + offset, value);
    }
    chip.happen(chip.time.cycle(1_000 * US));
    let sent: Vec<_> = chip.usarts[0].sent.iter().map(|(at, byte)| (at / US, *byte)).collect();
    assert_eq!(sent, [(86, b'H'), (172, b'U'), (258, b'M'), (345, b'S')]);
    assert!(is_high(&chip, map::DMA[1][7]));
}

#[test]
fn the_supplys_detector_interrupts_by_line_16() {
    let mut chip = chip();
    for (address, value) in [
        (RCC + 0x40, 1 << 28),
        (0x4000_7000, 0x4000 | 5 << 5 | 1 << 4),
        (0x4001_3C08, 1 << 16),
        (0x4001_3C00, 1 << 16),
    ] {
        write(&mut chip, address, value);
    }
    for (mv, low) in [(2_900, false), (2_800, true), (2_900, true), (3_000, true)] {
        chip.pwr.set_supply(mv);
        chip.look_at_lines();
        assert_eq!(is_high(&chip, map::PVD), low, "{mv} mV");
    }
    write(&mut chip, 0x4001_3C14, 1 << 16);
    assert!(!is_high(&chip, map::PVD));
}

#[test]
fn a_device_without_its_clock_is_deaf_and_that_is_noted() {
    let mut chip = chip();
    write(&mut chip, USART1 + 8, 91);
    assert_eq!(read(&mut chip, USART1 + 8), 0);
    assert_eq!(chip.notes.get(&Note::NoClock(USART1 + 8)), Some(&2));
    write(&mut chip, RCC + 0x44, 1 << 4);
    write(&mut chip, USART1 + 8, 91);
    assert_eq!(read(&mut chip, USART1 + 8), 91);
    write(&mut chip, RCC + 0x24, 1 << 4);
    write(&mut chip, RCC + 0x24, 0);
    assert_eq!(read(&mut chip, USART1 + 8), 0, "its reset");
}

#[test]
fn what_is_not_modelled_is_told_with_its_address() {
    let cases = [
        (0x4001_2000, 1, Trouble::Register(0x4001_2000, Some(1))),
        (RCC + 0x0C, 0x100, Trouble::Register(RCC + 0x0C, Some(0x100))),
        (0x5005_0000, 0, Trouble::Register(0x5005_0000, Some(0))),
        (0x4002_3C14, 2, Trouble::Register(0x4002_3C14, Some(2))),
    ];
    for (address, value, trouble) in cases {
        let mut chip = chip();
        for key in [0x0819_2A3B, 0x4C5D_6E7F] {
            write(&mut chip, 0x4002_3C08, key);
        }
        assert_eq!(chip.write(address, Size::Word, value, 0), Ok(()));
        assert_eq!(chip.trouble, Some(trouble));
    }
    let mut chip = chip();
    assert!(chip.read(0x6000_0000, Size::Word, 0).is_err() && chip.read(0x0FFF_FFFC, Size::Word, 0).is_err());
    assert!(chip.fetch(0x1000_0000).is_err(), "no instructions out of CCM");
}

#[test]
fn a_clock_that_the_flash_does_not_follow_is_told() {
    let mut chip = chip();
    write(&mut chip, RCC, 0x83 | 1 << 16);
    write(&mut chip, RCC + 4, 4 | 168 << 6 | 1 << 22 | 7 << 24);
    write(&mut chip, RCC, 0x83 | 1 << 16 | 1 << 24);
    chip.moment = Now { cycle: 160_000, ps: 10_000 * US };
    chip.write(RCC + 8, Size::Word, 2, 160_000).expect("the register is there");
    assert_eq!(chip.trouble, Some(Trouble::FlashTooSlow(168_000_000, 0)));
}
