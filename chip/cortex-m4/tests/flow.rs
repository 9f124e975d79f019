//! Cycles and paths without a counterpart in QEMU, by the manual's tables and the TRM.
use crate::common;

use common::Flat;
use cortex_m4_model::{Core, Outcome};

const NOP: u16 = 0xBF00;
const STAY: u16 = 0xE7FE;
const BX_LR: u16 = 0x4770;
const WFI: u16 = 0xBF30;
const WFE: u16 = 0xBF20;
const SVC: u16 = 0xDF00;
const UDF: u16 = 0xDE00;
const CPSID_I: u16 = 0xB672;
const CPSID_F: u16 = 0xB671;
/// LDR r0, [r1] and STR r0, [r1].
const LDR: u16 = 0x6808;
const STR: u16 = 0x6008;

const PROGRAM: u32 = 0x1000;
const HANDLERS: u32 = 0x2000;
const STACK: u32 = 0x2000_8000;

struct Rig {
    core: Core,
    memory: Flat,
}

const fn handler(number: u32) -> u32 {
    HANDLERS + number * 0x20
}

impl Rig {
    fn new(program: &[u16]) -> Self {
        let mut memory = Flat::default();
        let mut vectors = vec![STACK, PROGRAM | 1];
        vectors.extend((2..98).map(|number| handler(number) | 1));
        for (i, word) in vectors.iter().enumerate() {
            memory.load(i as u32 * 4, &word.to_le_bytes());
        }
        let mut rig = Rig { core: Core::new(82, 4), memory };
        rig.code(PROGRAM, program);
        for number in 2..98 {
            rig.code(handler(number), &[BX_LR]);
        }
        rig.core.reset(&mut rig.memory, 0);
        for word in 0..3 {
            rig.set(0xE000_E100 + word * 4, u32::MAX);
        }
        rig
    }

    fn code(&mut self, address: u32, halfwords: &[u16]) {
        let bytes: Vec<u8> = halfwords.iter().flat_map(|halfword| halfword.to_le_bytes()).collect();
        self.memory.load(address, &bytes);
        self.core.forget_code(address, bytes.len() as u32);
    }

    fn set(&mut self, address: u32, value: u32) {
        let before = (self.core.register(0), self.core.register(1), self.core.register(15));
        self.code(0x3000, &[STR]);
        self.core.set_register(0, value);
        self.core.set_register(1, address);
        self.core.set_register(15, 0x3000);
        assert_eq!(self.core.step(&mut self.memory), Outcome::Ran);
        self.core.set_register(0, before.0);
        self.core.set_register(1, before.1);
        self.core.set_register(15, before.2);
    }

    fn get(&mut self, address: u32) -> u32 {
        let before = (self.core.register(0), self.core.register(1), self.core.register(15));
        self.code(0x3000, &[LDR]);
        self.core.set_register(1, address);
        self.core.set_register(15, 0x3000);
        assert_eq!(self.core.step(&mut self.memory), Outcome::Ran);
        let value = self.core.register(0);
        self.core.set_register(0, before.0);
        self.core.set_register(1, before.1);
        self.core.set_register(15, before.2);
        value
    }

    fn priority(&mut self, interrupt: u32, value: u32) {
        let word = 0xE000_E400 + interrupt / 4 * 4;
        let shift = interrupt % 4 * 8;
        let old = self.get(word) & !(0xFF << shift);
        self.set(word, old | value << shift);
    }

    fn step(&mut self) -> Outcome {
        self.core.step(&mut self.memory)
    }

    /// Returns the cycles.
    fn until(&mut self, address: u32) -> u64 {
        let start = self.core.cycles();
        for _ in 0..200 {
            if self.core.register(15) == address {
                return self.core.cycles() - start;
            }
            let outcome = self.step();
            assert_eq!(outcome, Outcome::Ran, "at {:#x}", self.core.register(15));
        }
        unreachable!("at {:#x}, not at {address:#x}", self.core.register(15));
    }

    fn exception(&self) -> u32 {
        self.core.xpsr() & 0x1FF
    }
}

#[test]
fn an_entry_takes_12_cycles_a_return_10_and_one_handler_follows_another_in_6() {
    let mut rig = Rig::new(&[NOP, NOP, STAY]);
    rig.core.set_pending(5);
    assert_eq!(rig.until(handler(21)), 12);
    rig.step();
    // BX is 1, its refill 3, the return 10.
    assert_eq!(rig.core.register(15), PROGRAM);
    let mut rig = Rig::new(&[NOP, STAY]);
    rig.core.set_pending(5);
    rig.until(handler(21));
    assert_eq!(rig.until(PROGRAM), 1 + 3 + 10);
    rig.core.set_pending(5);
    rig.core.set_pending(6);
    rig.until(handler(21));
    assert_eq!(rig.until(handler(22)), 1 + 3 + 6, "tail-chained: nothing is unstacked");
    assert_eq!(rig.core.register(13), STACK - 0x20);
    assert_eq!(rig.until(PROGRAM), 1 + 3 + 10);
}

#[test]
fn an_interrupt_that_arrives_while_another_is_stacked_goes_first_if_it_is_more_urgent() {
    for (priority, first, second) in [(0x10, 7, 5), (0xF0, 5, 7)] {
        let mut rig = Rig::new(&[NOP, STAY]);
        rig.priority(5, 0x80);
        rig.priority(7, priority);
        rig.core.set_pending(5);
        let now = rig.core.cycles();
        // Within the twelve cycles of stacking.
        assert_eq!(rig.core.run(&mut rig.memory, now + 4), Outcome::Ran);
        assert!(rig.core.cycles() > now + 4, "the registers are on the stack");
        rig.core.set_line(7, true);
        rig.until(handler(16 + first));
        assert_eq!(rig.core.register(13), STACK - 0x20, "stacked once");
        rig.core.set_line(7, false);
        rig.until(handler(16 + second));
        rig.until(PROGRAM);
        assert_eq!(rig.core.register(13), STACK);
    }
}

#[test]
fn a_line_that_stays_high_interrupts_again_and_one_that_fell_does_not() {
    let mut rig = Rig::new(&[NOP, NOP, STAY]);
    rig.core.set_line(9, true);
    for _ in 0..3 {
        rig.until(handler(25));
        rig.step();
    }
    rig.core.set_line(9, false);
    // Made pending as its handler returned.
    rig.until(handler(25));
    rig.until(PROGRAM);
    rig.until(PROGRAM + 4);
    for _ in 0..5 {
        rig.step();
    }
    assert_eq!(rig.core.register(15), PROGRAM + 4);
}

#[test]
fn a_fault_in_a_fault_is_the_end() {
    // Name, program, HardFault's handler; with the escalated fault's priority.
    let cases: [(&str, &[u16], &[u16]); 4] = [
        ("undefined in HardFault", &[UDF], &[UDF]),
        ("supervisor call in HardFault", &[UDF], &[SVC]),
        ("breakpoint in HardFault", &[UDF], &[0xBE00]),
        ("undefined with FAULTMASK", &[CPSID_F, UDF], &[BX_LR]),
    ];
    for (name, program, hard_fault) in cases {
        let mut rig = Rig::new(program);
        rig.code(handler(3), hard_fault);
        let ended = (0..20).any(|_| rig.step() == Outcome::Lockup);
        assert!(ended, "{name}");
        assert_eq!(rig.step(), Outcome::Lockup, "{name}: for ever");
    }
    let mut rig = Rig::new(&[UDF]);
    rig.memory.load(12, &0x3000_0001u32.to_le_bytes());
    assert!((0..20).any(|_| rig.step() == Outcome::Lockup), "HardFault's own handler is nowhere");
}

#[test]
fn each_fault_has_its_bits_and_escalates_without_its_handler() {
    /// Program, r1, CFSR, handler if enabled, address.
    type Fault = (&'static [u16], u32, u32, u32, Option<u32>);
    const LDR_BAD: &[u16] = &[LDR];
    let cases: [(&str, Fault); 7] = [
        ("undefined", (&[UDF], 0, 1 << 16, 6, None)),
        ("no coprocessor", (&[0xEE01, 0x0110], 0, 1 << 19, 6, None)),
        ("floating point that is off", (&[0xEE30, 0x0A00], 0, 1 << 19, 6, None)),
        ("even address", (&[0x4708], 0x2000, 1 << 17, 6, None)),
        ("refused load", (LDR_BAD, 0x3000_0000, 1 << 9 | 1 << 15, 5, Some(0x3000_0000))),
        ("fetch from nowhere", (&[0x4708], 0x3000_0001, 1 << 8, 5, None)),
        ("fetch from a device", (&[0x4708], 0x4000_0001, 1, 4, None)),
    ];
    for (name, (program, r1, bits, number, address)) in cases {
        for enabled in [true, false] {
            let mut rig = Rig::new(program);
            rig.set(0xE000_ED24, if enabled { 0x7_0000 } else { 0 });
            rig.core.set_register(1, r1);
            rig.until(handler(if enabled { number } else { 3 }));
            let [cfsr, hfsr, _, bfar] = rig.core.fault_status();
            assert_eq!(cfsr, bits, "{name}");
            assert_eq!(hfsr, if enabled { 0 } else { 1 << 30 }, "{name}");
            if let Some(address) = address {
                assert_eq!(bfar, address, "{name}");
            }
        }
    }
}

#[test]
fn a_refused_store_is_told_late_unless_the_write_buffer_is_off() {
    for (actlr, bits, return_to) in [(0, 1 << 10, PROGRAM + 2), (2, 1 << 9 | 1 << 15, PROGRAM)] {
        let mut rig = Rig::new(&[STR, NOP, NOP, STAY]);
        rig.set(0xE000_ED24, 0x7_0000);
        rig.set(0xE000_E008, actlr);
        rig.core.set_register(1, 0x3000_0000);
        rig.until(handler(5));
        assert_eq!(rig.core.fault_status()[0], bits);
        assert_eq!(rig.memory.word(rig.core.register(13) + 24), return_to);
    }
}

#[test]
fn a_refused_store_without_its_handler_is_a_hard_fault() {
    let mut rig = Rig::new(&[STR, NOP, NOP, STAY]);
    rig.core.set_register(1, 0x3000_0000);
    rig.until(handler(3));
    assert_eq!(rig.core.fault_status()[..2], [1 << 10, 1 << 30]);
    assert_eq!(rig.memory.word(rig.core.register(13) + 24), PROGRAM + 2);
    // Its handler is not locked up.
    let mut rig = Rig::new(&[UDF]);
    rig.core.set_register(1, 0x3000_0000);
    rig.code(handler(3), &[STR, NOP, STAY]);
    rig.until(handler(3) + 4);
    assert_eq!(rig.exception(), 3);
}

#[test]
fn a_fault_stops_before_its_handler_if_it_is_asked_to() {
    /// Program, r1, the address then.
    type Fault = (&'static [u16], u32, u32);
    let cases: [(&str, Fault); 5] = [
        ("undefined", (&[NOP, UDF], 0, PROGRAM + 2)),
        ("jump to nowhere", (&[NOP, 0x4708], 0x3000_0001, 0x3000_0000)),
        ("refused load", (&[NOP, LDR], 0x3000_0000, PROGRAM + 2)),
        ("refused store", (&[NOP, STR, NOP], 0x3000_0000, PROGRAM + 4)),
        ("breakpoint", (&[NOP, 0xBE00], 0, PROGRAM + 2)),
    ];
    for (name, (program, r1, place)) in cases {
        for enabled in [0x7_0000, 0] {
            let mut rig = Rig::new(program);
            rig.set(0xE000_ED24, enabled);
            rig.core.stop_at_faults(true);
            rig.core.set_register(1, r1);
            let outcome = rig.core.run(&mut rig.memory, 1_000);
            assert_eq!((outcome, rig.core.register(15)), (Outcome::Fault, place), "{name}");
            assert_eq!(rig.core.register(14), u32::MAX, "{name}: nothing is entered");
            assert_eq!(rig.core.run(&mut rig.memory, 1_000), Outcome::Fault, "{name}: for ever");
        }
    }
    let mut rig = Rig::new(&[SVC, NOP, STAY]);
    rig.core.stop_at_faults(true);
    rig.core.set_pending(5);
    rig.until(handler(21));
    rig.until(handler(11));
    rig.until(PROGRAM + 4);
    let mut rig = Rig::new(&[NOP, STAY]);
    rig.core.stop_at_faults(true);
    rig.core.set_register(13, 0x3000_8000);
    rig.core.set_pending(5);
    assert_eq!(rig.core.run(&mut rig.memory, 1_000), Outcome::Fault);
    assert_eq!(rig.core.fault_status()[..2], [1 << 12, 1 << 30]);
}

#[test]
fn a_vector_that_cannot_be_read_is_a_hard_fault() {
    let mut rig = Rig::new(&[NOP, STAY]);
    let table: Vec<u8> = (0..16u32).flat_map(|number| (handler(number) | 1).to_le_bytes()).collect();
    // At a memory's end, with the system exceptions' vectors.
    rig.memory.load(0x2040_0000 - 0x80, &table);
    rig.set(0xE000_ED08, 0x2040_0000 - 0x80);
    rig.core.set_pending(60);
    rig.until(handler(3));
    assert_eq!(rig.core.fault_status()[1], 1 << 1);
}

#[test]
fn sleep_ends_by_an_interrupt_even_a_masked_one_and_cycles_of_sleep_are_counted_apart() {
    let mut rig = Rig::new(&[WFI, NOP, STAY]);
    // DEMCR.TRCENA, DWT_CTRL.CYCCNTENA.
    rig.set(0xE000_EDFC, 1 << 24);
    // The unit has no lock.
    rig.set(0xE000_1FB0, 0xC5AC_CE55);
    assert_eq!(rig.get(0xE000_1FB4), 0);
    rig.set(0xE000_1000, 1);
    let count = rig.get(0xE000_1004);
    assert_eq!((0..3).map(|_| rig.step()).last(), Some(Outcome::Sleeping));
    let now = rig.core.cycles();
    rig.core.advance_to(now + 1000);
    assert_eq!(rig.step(), Outcome::Sleeping);
    rig.core.set_line(3, true);
    rig.until(handler(19));
    assert!(rig.get(0xE000_1004) - count < 60, "CYCCNT stands still in sleep");
    assert_eq!(rig.core.slept(), 1000);
    let mut rig = Rig::new(&[CPSID_I, WFI, NOP, STAY]);
    assert_eq!((0..3).map(|_| rig.step()).last(), Some(Outcome::Sleeping));
    rig.core.set_line(3, true);
    rig.until(PROGRAM + 6);
    assert_eq!(rig.exception(), 0, "PRIMASK holds the handler back");
    let mut rig = Rig::new(&[WFE, NOP, WFE, STAY]);
    rig.step();
    rig.step();
    rig.core.event();
    rig.until(PROGRAM + 4);
}

#[test]
fn sleep_on_exit_sleeps_as_the_last_handler_returns() {
    let mut rig = Rig::new(&[NOP, STAY]);
    rig.set(0xE000_ED10, 2);
    rig.core.set_pending(3);
    rig.until(handler(19));
    assert_eq!((0..3).map(|_| rig.step()).last(), Some(Outcome::Sleeping));
    rig.core.set_pending(4);
    rig.until(handler(20));
}

#[test]
fn systick_wakes_and_its_time_is_known_before() {
    let mut rig = Rig::new(&[WFI, STAY]);
    rig.set(0xE000_E014, 999);
    rig.set(0xE000_E018, 0);
    rig.set(0xE000_E010, 7);
    assert_eq!((0..3).map(|_| rig.step()).last(), Some(Outcome::Sleeping));
    let next = rig.core.next_event().expect("it interrupts");
    rig.core.advance_to(next - 1);
    assert_eq!(rig.step(), Outcome::Sleeping);
    rig.core.advance_to(next);
    rig.until(handler(15));
    assert_eq!(rig.core.next_event(), Some(next + 1000));
}

#[test]
fn changed_code_is_decoded_anew() {
    // STRH r2, [r1]; NOP; NOP; stored over the second NOP: MOVS r3, #7.
    let program = &[0x800A, NOP, NOP, STAY];
    let mut rig = Rig::new(program);
    rig.code(0x2000_0100, program);
    rig.core.set_register(15, 0x2000_0102);
    rig.until(0x2000_0106);
    rig.core.set_register(15, 0x2000_0100);
    rig.core.set_register(1, 0x2000_0104);
    rig.core.set_register(2, 0x2307);
    rig.until(0x2000_0106);
    assert_eq!(rig.core.register(3), 7);
    // Not by the processor's stores.
    rig.memory.load(0x2000_0104, &0x2309u16.to_le_bytes());
    rig.core.set_register(15, 0x2000_0104);
    rig.step();
    assert_eq!(rig.core.register(3), 7, "not yet told");
    rig.core.forget_code(0x2000_0104, 2);
    rig.core.set_register(15, 0x2000_0104);
    rig.step();
    assert_eq!(rig.core.register(3), 9);
}

#[test]
fn bits_have_words_of_their_own() {
    let mut rig = Rig::new(&[STAY]);
    rig.memory.load(0x2000_0040, &0x8000_0001u32.to_le_bytes());
    let alias = |bit: u32| 0x2200_0000 + 0x40 * 32 + bit * 4;
    assert_eq!([0, 1, 31].map(|bit| rig.get(alias(bit))), [1, 0, 1]);
    rig.set(alias(9), 0xFFFF_FFFF);
    rig.set(alias(31), 0xFFFF_FFFE);
    assert_eq!(rig.memory.word(0x2000_0040), 0x0000_0201);
}

#[test]
fn registers_that_the_model_lacks_are_told() {
    for address in [0xE000_2000, 0xE000_1008, 0xE004_0000] {
        let mut rig = Rig::new(&[LDR, STAY]);
        rig.core.set_register(1, address);
        assert_eq!(rig.core.run(&mut rig.memory, 1000), Outcome::Unmodelled(address));
        assert_eq!(rig.core.register(15), PROGRAM + 2, "the instruction is done");
        assert_eq!(rig.core.trace()[31], PROGRAM);
    }
}

#[test]
fn a_request_for_reset_is_told_and_reset_begins_anew() {
    let mut rig = Rig::new(&[STR, STAY]);
    rig.core.set_register(0, 0x05FA_0004);
    rig.core.set_register(1, 0xE000_ED0C);
    rig.priority(3, 0x40);
    assert_eq!(rig.step(), Outcome::ResetRequested);
    let cycles = rig.core.cycles();
    rig.core.reset(&mut rig.memory, 0);
    assert_eq!((rig.core.register(13), rig.core.register(15)), (STACK, PROGRAM));
    assert_eq!(rig.get(0xE000_E400), 0);
    assert!(rig.core.cycles() > cycles, "time goes on");
}

#[test]
fn instructions_take_the_cycles_of_the_table() {
    // Name, code, r0 to r3, cycles of the code.
    let cases: [(&str, &[u16], [u32; 4], u64); 17] = [
        ("add", &[0x1840], [1, 2, 0, 0], 1),
        ("branch", &[0xE000, NOP], [0; 4], 1 + 2),
        ("branch not taken", &[0xD100], [0; 4], 1),
        ("load", &[0x6808], [0, 0x2000_0000, 0, 0], 2),
        ("two loads", &[0x6808, 0x684A], [0, 0x2000_0000, 0, 0], 3),
        ("two loads, the second's base by the first", &[0x6809, 0x6808], [0, 0x2000_0000, 0, 0], 4),
        ("a base that was just computed", &[0x3104, 0x6808], [0, 0x2000_0000, 0, 0], 1 + 3),
        ("store", &[0x6008], [0, 0x2000_0000, 0, 0], 1),
        ("load, store", &[0x6808, 0x6048], [0, 0x2000_0000, 0, 0], 3),
        ("three of several", &[0xC90D], [0, 0x2000_0000, 0, 0], 4),
        ("multiply", &[0x4348], [3, 4, 0, 0], 1),
        ("long multiply", &[0xFB80, 0x2301], [3, 4, 0, 0], 1),
        ("short division", &[0xFBB0, 0xF2F1], [3, 4, 0, 0], 2),
        ("long division", &[0xFBB0, 0xF2F1], [0xFFFF_FFFF, 1, 0, 0], 12),
        ("unaligned load", &[0x6808], [0, 0x2000_0001, 0, 0], 2 + 2),
        ("load of two", &[0xE9D1, 0x2300], [0, 0x2000_0000, 0, 0], 3),
        ("table branch", &[0xE8D1, 0xF000, NOP, NOP], [0, 0x2000_0000, 0, 0], 6),
    ];
    for (name, code, registers, cycles) in cases {
        let mut program = code.to_vec();
        program.push(STAY);
        let mut rig = Rig::new(&program);
        for (number, value) in registers.into_iter().enumerate() {
            rig.core.set_register(number as u8, value);
        }
        rig.set(0xE000_ED14, 0x200);
        if name == "branch not taken" {
            rig.code(0x3010, &[0x2400]);
            rig.core.set_register(15, 0x3010);
            rig.step();
            rig.core.set_register(15, PROGRAM);
        }
        if name == "two loads, the second's base by the first" {
            rig.memory.load(0x2000_0000, &0x2000_0010u32.to_le_bytes());
        }
        rig.code(PROGRAM - 2, &[NOP]);
        rig.core.set_register(15, PROGRAM - 2);
        rig.step();
        let start = rig.core.cycles();
        let end = PROGRAM + 2 * code.len() as u32;
        while rig.core.register(15)
            < end
                - if name.contains("branch") && code.len() > 1 {
                    2 * (code.len() as u32 - code.len().min(2) as u32)
                } else {
                    0
                }
        {
            rig.step();
        }
        assert_eq!(rig.core.cycles() - start, cycles, "{name}");
    }
}

#[test]
fn floating_point_takes_the_cycles_of_the_table() {
    for (name, code, cycles) in [
        ("vadd", [0xEE30u16, 0x0A81], 1),
        ("vmul", [0xEE20, 0x0A81], 1),
        ("vmla", [0xEE00, 0x0A81], 3),
        ("vfma", [0xEEA0, 0x0A81], 3),
        ("vdiv", [0xEE80, 0x0A81], 14),
        ("vsqrt", [0xEEB1, 0x0AC0], 14),
        ("vldr", [0xED91, 0x0A00], 2),
    ] {
        let mut rig = Rig::new(&[code[0], code[1], code[0], code[1], STAY]);
        rig.set(0xE000_ED88, 0xF << 20);
        rig.core.set_register(1, 0x2000_0000);
        rig.until(PROGRAM + 4);
        assert_eq!(rig.until(PROGRAM + 8), cycles, "{name}");
    }
}

#[test]
fn a_store_that_asks_for_attention_ends_the_run_and_wait_states_count() {
    let mut rig = Rig::new(&[STR, STR, NOP, STAY]);
    rig.core.set_register(1, 0x2000_0040);
    rig.memory.bell = Some(0x2000_0040);
    let start = rig.core.cycles();
    assert_eq!(rig.core.run(&mut rig.memory, start + 1000), Outcome::Ran);
    assert_eq!((rig.core.register(15), rig.core.cycles() - start), (PROGRAM + 2, 1));
    rig.memory.waits = (5, 3);
    assert_eq!(rig.core.run(&mut rig.memory, start + 1000), Outcome::Ran);
    assert_eq!((rig.core.register(15), rig.core.cycles() - start), (PROGRAM + 4, 2 + 5 + 3));
    rig.memory.bell = None;
    assert_eq!(rig.core.run(&mut rig.memory, start + 1000), Outcome::Ran);
    assert!(rig.core.cycles() - start >= 1000);
}

#[test]
fn an_exception_closes_the_exclusive_monitor() {
    for (interrupted, result) in [(false, 0), (true, 1)] {
        // LDREX r2, [r1]; STREX r3, r2, [r1].
        let mut rig = Rig::new(&[0xE851, 0x2F00, 0xE841, 0x2300, STAY]);
        rig.core.set_register(1, 0x2000_0000);
        rig.until(PROGRAM + 4);
        if interrupted {
            rig.core.set_pending(3);
            rig.until(handler(19));
        }
        rig.until(PROGRAM + 8);
        assert_eq!(rig.core.register(3), result);
    }
}
