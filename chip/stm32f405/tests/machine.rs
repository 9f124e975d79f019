//! Small programs, measured from outside.

use stm32f405_model::gpio::Pin;
use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, Ps, SECOND, US};

/// `ldr r0, =0x30000001; bx r0`
const NOWHERE: [u16; 4] = [0x4800, 0x4700, 0x0001, 0x3000];
/// `ldr r0, =0x40012000 (the ADC's status); ldr r1, [r0]; b .`
const ADC: [u16; 6] = [0x4801, 0x6801, 0xE7FE, 0x0000, 0x2000, 0x4001];
const WATCHDOG: [u16; 8] = [0x4802, 0xF64C, 0x41CC, 0x6001, 0xE7FE, 0x0000, 0x3000, 0x4000];
/// Erases sector 1 by x32, waits, makes PC0 high.
const ERASE: [u16; 34] = [
    0x480B, 0x490C, 0x6041, 0x490C, 0x6041, 0xF240, 0x210A, 0x6101, 0xF441, 0x3180, 0x6101, 0x68C1, 0x03C9,
    0xD4FC, 0x4A07, 0xF04F, 0x0104, 0x6011, 0x4A06, 0xF04F, 0x0101, 0x6011, 0x6151, 0xE7FE, 0x3C00, 0x4002,
    0x0123, 0x4567, 0x89AB, 0xCDEF, 0x3830, 0x4002, 0x0800, 0x4002,
];
const START: Ps = 1_500 * US;

/// Sector 1 is filled with zeros.
fn machine(program: &[u16], board: Board) -> Machine {
    let mut flash = vec![0; 0x8000];
    flash[..4].copy_from_slice(&0x2000_1000_u32.to_le_bytes());
    flash[4..8].copy_from_slice(&0x0800_0041_u32.to_le_bytes());
    for (place, half) in flash[0x40..].chunks_mut(2).zip(program) {
        place.copy_from_slice(&half.to_le_bytes());
    }
    Machine::new(Image::parse(&flash).expect("the image is whole"), board)
}

#[test]
fn what_cannot_go_on_stops_with_the_reason_and_the_place() {
    let cases: [(&[u16], &str, u32); 2] = [
        (&NOWHERE, "locked up", 0x0800_0042),
        (&ADC, "the register at 0x40012000 is not modelled (read)", 0x0800_0042),
    ];
    for (program, reason, last) in cases {
        let mut machine = machine(program, Board::default());
        let report = machine.run_until(SECOND).expect_err("it cannot go on");
        assert!(report.reason.contains(reason), "{report}");
        assert!(report.trace.iter().any(|(address, _)| *address == last), "{report}");
        assert!(report.to_string().contains("08000042"), "{report}");
    }
}

#[test]
fn a_fault_stops_before_the_programs_own_handler_if_it_is_asked_to() {
    let cases: [(&[u16], &str, u32); 3] = [
        (&NOWHERE, "an instruction is wanted from 0x30000000, where none may be", 0x3000_0000),
        // `ldr r0, =0x30000000; ldr r1, [r0]`
        (
            &[0x4800, 0x6801, 0x0000, 0x3000],
            "a load or store at 0x30000000, where nothing answers",
            0x0800_0042,
        ),
        // `udf`
        (&[0xDE00], "what is there is no instruction", 0x0800_0040),
    ];
    for (program, reason, place) in cases {
        let mut machine = machine(program, Board::default());
        machine.core.stop_at_faults(true);
        let report = machine.run_until(SECOND).expect_err("it cannot go on");
        assert_eq!(report.reason, format!("a fault of the processor: {reason}"), "{report}");
        assert_eq!(report.registers[15], place, "{report}");
    }
}

#[test]
fn a_watchdog_that_nobody_feeds_resets_again_and_again() {
    for (lsi_hz, period) in [(17_000, 964), (32_000, 512), (47_000, 349)] {
        let mut machine = machine(&WATCHDOG, Board { lsi_hz, ..Board::default() });
        machine.run_until(3 * SECOND).expect("it goes on");
        let times: Vec<Ps> = machine.resets.iter().map(|(at, _)| (at - START) / MS).collect();
        let wanted: Vec<Ps> = (0..=2_998 / period).map(|number| number * period).collect();
        assert!(times.iter().zip(&wanted).all(|(time, wanted)| time.abs_diff(*wanted) <= 8), "{times:?}");
        assert!(times.len().abs_diff(wanted.len()) <= 1, "{times:?} {wanted:?}");
        assert!(machine.resets[1..].iter().all(|(_, cause)| *cause == Cause::Watchdog));
        assert_eq!(machine.chip.rcc.read(0x74, machine.chip.time.at(0)).map(|csr| csr >> 24), Some(0x2E));
    }
}

#[test]
fn an_erase_stops_the_program_and_a_cut_leaves_the_sector_between() {
    for (until, erased) in [(249, false), (251, true)] {
        let mut machine = machine(&ERASE, Board::default());
        machine.run_until(START + until * MS).expect("it goes on");
        assert_eq!(machine.chip.gpio.is_high(Pin(2, 0)), erased, "{until} ms");
        machine.power_off();
        machine.run_until(SECOND).expect("nothing happens");
        let ones: u32 = machine.memory(0x0800_4000, 0x4000).iter().map(|byte| byte.count_ones()).sum();
        assert_eq!(ones == 8 * 0x4000, erased, "{ones} ones");
        assert!(ones > 0);
        machine.power_on();
        machine.run_until(2 * SECOND).expect("it begins anew");
        assert!(machine.chip.gpio.is_high(Pin(2, 0)));
        assert!(machine.memory(0x0800_4000, 0x4000).iter().all(|byte| *byte == 0xFF));
    }
}

#[test]
fn a_supply_that_sags_holds_the_chip_in_reset() {
    let mut machine = machine(&ERASE, Board::default());
    machine.run_until(SECOND).expect("it goes on");
    for (mv, high) in [(1_700, true), (1_600, false), (1_700, false), (3_300, true)] {
        machine.set_supply(mv);
        machine.run_until(machine.now() + SECOND).expect("it goes on");
        assert_eq!(!machine.chip.pwr.is_off && machine.chip.gpio.is_high(Pin(2, 0)), high, "{mv} mV");
    }
    assert_eq!(machine.resets.len(), 2);
}

#[test]
fn a_dead_crystal_that_the_program_does_not_use_does_not_matter() {
    let mut machine = machine(&ERASE, Board::default());
    machine.set_crystal(false);
    machine.run_until(SECOND).expect("it goes on");
    assert!(machine.chip.gpio.is_high(Pin(2, 0)));
}
