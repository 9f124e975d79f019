//! The codec's computed floats on the model of the chip equal those of `docs/log-format.md` ("Links") on this PC.

use std::f32::consts::PI;
use std::time::Instant;

use cortex_m4_model::Outcome;
use hums_tests::damage::Random;
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::memory::SRAM;
use stm32f405_model::time::{SECOND, US};

use super::bench;

/// Registers behind an instruction to return to.
const REGISTERS: u32 = SRAM.0 + 0x100;
const STACK: u32 = SRAM.0 + 0x1000;
/// `bkpt`
const BREAKPOINT: [u8; 2] = [0x00, 0xBE];
/// The angles, the quaternion, the last received one, and their number.
const ANGLES: u32 = 0;
const MADE: u32 = 23;
const TOLD: u32 = 27;
const ALL: u32 = 45;

fn begun() -> Machine {
    let mut machine = Machine::new(bench().image, Board::default());
    let begun = |machine: &Machine| {
        let symbol = machine.image().symbol(machine.core.register(15));
        // An IT block would continue in the called function.
        symbol.is_some_and(|(name, _)| name.contains("hums_firmware"))
            && machine.core.xpsr() & 0x0600_FC00 == 0
    };
    while !begun(&machine) {
        machine.run_until(machine.now() + US).unwrap();
        assert!(machine.now() < SECOND, "the program does not begin");
    }
    machine.core.stop_at_breakpoints(true);
    machine.chip.sram.all_mut()[..2].copy_from_slice(&BREAKPOINT);
    machine.core.forget_code(SRAM.0, 2);
    machine
}

fn words(machine: &mut Machine, register: u32) -> &mut [[u8; 4]] {
    let at = (REGISTERS - SRAM.0 + 4 * register) as usize;
    machine.chip.sram.all_mut()[at..at + 16].as_chunks_mut().0
}

fn call(machine: &mut Machine, function: u32, angles: [f32; 3], told: [f32; 4]) -> [f32; 4] {
    for (first, numbers) in [(ANGLES, &angles[..]), (TOLD, &told[..])] {
        for (word, number) in words(machine, first).iter_mut().zip(numbers) {
            *word = number.to_le_bytes();
        }
    }
    for (number, value) in [(0, REGISTERS), (13, STACK), (14, SRAM.0 | 1), (15, function)] {
        machine.core.set_register(number, value);
    }
    let until = machine.core.cycles() + 100_000;
    let outcome = machine.core.run(&mut machine.chip, until);
    assert!(matches!(outcome, Outcome::Breakpoint(_)), "{outcome:?}");
    let made = words(machine, MADE);
    [0, 1, 2, 3].map(|part| f32::from_le_bytes(made[part]))
}

fn documented(angles: [f32; 3], told: [f32; 4]) -> [f32; 4] {
    let series = |terms: [f32; 6], z: f32| terms.iter().fold(0.0_f32, |sum, term| (sum + term) * z);
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| {
        let x = angle * 0.5;
        let z = x * x;
        let s = [
            1.0 / 6_227_020_800.0,
            -1.0 / 39_916_800.0,
            1.0 / 362_880.0,
            -1.0 / 5_040.0,
            1.0 / 120.0,
            -1.0 / 6.0,
        ];
        let c =
            [1.0 / 479_001_600.0, -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -1.0 / 2.0];
        (x + x * series(s, z), 1.0 + series(c, z))
    });
    let (cc, ss, cs, sc) = (cr * cp, sr * sp, cr * sp, sr * cp);
    let made = [cc * cy + ss * sy, sc * cy - cs * sy, cs * cy + sc * sy, cc * sy - ss * cy];
    let [a, b, c, d] = [0, 1, 2, 3].map(|part| made[part] * told[part]);
    if (a + b) + (c + d) < 0.0 { made.map(|part| -part) } else { made }
}

/// Three of four times plausible angles and parts of a quaternion, else any bits. NaN differs between machines, and
/// does not count.
fn compare(count: u64, seed: u64) {
    let mut machine = begun();
    let function = machine.image().find("Registers10quaternion").expect("the codec's function").address;
    machine.chip.sram.all_mut()[(REGISTERS - SRAM.0) as usize..][..4 * ALL as usize].fill(0);
    let (start, cycles) = (Instant::now(), machine.core.cycles());
    let (mut random, mut turned, mut no_numbers) = (Random::new(seed), 0_u64, 0_u64);
    for number in 0..count {
        let bits = [(); 7].map(|()| random.bits() as u32);
        let [r, p, y, told @ ..] = if number % 4 == 3 {
            bits.map(f32::from_bits)
        } else {
            bits.map(|bits| bits.cast_signed() as f32 / 2_147_483_648.0)
        };
        let scale = if number % 4 == 3 { 1.0 } else { PI * 2_f32.powi(-((number / 4 % 24) as i32)) };
        let angles = [r, p, y].map(|angle| angle * scale);
        let (made, expected) = (call(&mut machine, function, angles, told), documented(angles, told));
        let bits = |parts: [f32; 4]| parts.map(|part| if part.is_nan() { u32::MAX } else { part.to_bits() });
        assert_eq!(
            bits(made),
            bits(expected),
            "number {number}: {angles:?}, {told:?}: {made:?}, {expected:?}"
        );
        turned += u64::from(made[0] < 0.0);
        no_numbers += u64::from(made.iter().any(|part| part.is_nan()));
    }
    println!(
        "{count} attitudes equal to the bit, {turned} of them turned, {no_numbers} with what is no number; {} cycles each; {:.1} s",
        (machine.core.cycles() - cycles) / count,
        start.elapsed().as_secs_f64()
    );
    assert!(turned > count / 8 && no_numbers < count / 4, "this has tried little");
}

#[test]
fn attitudes_become_the_same_quaternions_on_the_chip_and_here() {
    compare(20_000, 1);
}

#[test]
#[ignore = "10 million attitudes on the model of the chip (cargo xtask prove chip)"]
fn ten_million_attitudes_become_the_same_quaternions_on_the_chip_and_here() {
    compare(10_000_000, 2);
}
