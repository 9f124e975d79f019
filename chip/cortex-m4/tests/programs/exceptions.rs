//! Scenarios of exceptions: each prints its observations, which are compared between QEMU and the model.
//!
//! `on_exception` steps over a fault's instruction.
#![no_std]
#![no_main]

mod faults;
mod support;

use core::arch::asm;
use core::ptr::{read_volatile, write_volatile};
use faults::{bad_returns, bad_stack, escalation, faults};
use support::*;

#[unsafe(no_mangle)]
extern "C" fn scenarios() {
    let all: [(&str, fn()); 17] = [
        ("supervisor call", supervisor),
        ("priorities", priorities),
        ("tail chaining", tail_chaining),
        ("groups", groups),
        ("masks", masks),
        ("system handlers", system_handlers),
        ("nvic registers", nvic_registers),
        ("scb registers", scb_registers),
        ("faults", faults),
        ("escalation", escalation),
        ("bad returns", bad_returns),
        ("late floating-point state", lazy),
        ("privilege", privilege),
        ("sleep", sleep),
        ("mpu", mpu),
        ("vector table", vector_table),
        ("systick", systick),
    ];
    for (name, scenario) in all {
        reset();
        print!("{name}\n\0");
        scenario();
    }
}

fn supervisor() {
    on(11, |frame, _| {
        print!("    r0 {:x} r1 {:x} r2 {:x} r3 {:x}\n\0", frame.r[0], frame.r[1], frame.r[2], frame.r[3]);
        frame.r[0] = 0x55;
    });
    let mut result = 1u32;
    for shift in [0u32, 4] {
        // With the stack pointer at a multiple of eight, and not.
        unsafe {
            asm!("mov {t}, sp", "sub sp, sp, {s}", "msr apsr_nzcvq, {f}", "svc #7", "mov sp, {t}",
                t = out(reg) _, s = in(reg) shift, f = in(reg) 0xA800_0000u32,
                inout("r0") result, in("r1") 2, in("r2") 3, in("r3") 4);
        }
        print!("  r0 {result:x}\n\0");
    }
    put(CCR, 0);
    unsafe {
        asm!("mov {t}, sp", "sub sp, sp, #4", "svc #7", "mov sp, {t}", t = out(reg) _,
            inout("r0") result, in("r1") 2, in("r2") 3, in("r3") 4);
    }
    print!("  r0 {result:x}\n\0");
}

fn priorities() {
    enable(&[16, 17, 18]);
    priority(16, 0xC0);
    priority(17, 0x80);
    priority(18, 0x40);
    on(16, |_, _| pend(17));
    on(17, |_, _| {
        print!("    active {:x}\n\0", get(IABR));
        pend(18);
        pend(16);
    });
    on(18, |_, _| {
        print!("    active {:x} pending {:x}\n\0", get(IABR), get(ISPR));
        on(16, |_, _| print!("    again\n\0"));
        pend(17);
        on(17, |_, _| {});
    });
    pend(16);
}

fn tail_chaining() {
    let numbers = [20, 25, 30, 22, 40];
    enable(&numbers);
    for (number, value) in numbers.into_iter().zip([0x80, 0x40, 0x40, 0xE0, 0]) {
        priority(number, value);
        on(number, |_, _| {});
    }
    priority(14, 0xFF);
    on(14, |_, _| {});
    unsafe { asm!("cpsid i") };
    for number in numbers {
        pend(number);
    }
    put(ICSR, 1 << 28);
    print!("  pending {:x} icsr {:x}\n\0", get(ISPR), get(ICSR) & !(1 << 23));
    unsafe { asm!("cpsie i", "isb") };
    print!("  pending {:x}\n\0", get(ISPR));
}

fn groups() {
    for group in [0, 4, 5, 6, 7] {
        put(AIRCR, 0x05FA_0000 | group << 8);
        print!("  group {group} aircr {:x}\n\0", get(AIRCR));
        enable(&[16, 17, 18]);
        for (number, value) in [(16, 0xB0), (17, 0xA0), (18, 0x90)] {
            priority(number, value);
            on(number, |_, _| {});
        }
        on(16, |_, _| {
            pend(17);
            pend(18);
            print!("    icsr {:x}\n\0", get(ICSR) & !(1 << 23));
        });
        pend(16);
        msr!("basepri", 0xA0);
        pend(18);
        pend(17);
        pend(16);
        on(16, |_, _| {});
        print!("  basepri {:x} pending {:x}\n\0", mrs!("basepri"), get(ISPR));
        msr!("basepri", 0);
    }
}

fn masks() {
    enable(&[16, 17]);
    priority(16, 0x80);
    priority(17, 0x40);
    on(16, |_, _| {});
    on(17, |_, _| {});
    msr!("basepri", 0x60);
    msr!("basepri_max", 0x80);
    print!("  basepri {:x}\n\0", mrs!("basepri"));
    msr!("basepri_max", 0x50);
    print!("  basepri {:x}\n\0", mrs!("basepri_max"));
    pend(16);
    pend(17);
    print!("  pending {:x}\n\0", get(ISPR));
    msr!("basepri", 0);
    unsafe { asm!("cpsid f", "isb") };
    pend(17);
    print!("  faultmask {} primask {}\n\0", mrs!("faultmask"), mrs!("primask"));
    unsafe { asm!("cpsie f", "isb") };
    unsafe { asm!("cpsid if", "isb") };
    pend(16);
    print!("  faultmask {} primask {}\n\0", mrs!("faultmask"), mrs!("primask"));
    msr!("faultmask", 0);
    msr!("primask", 0);
    on(17, |_, _| unsafe { asm!("cpsid f") });
    pend(17);
    print!("  faultmask {}\n\0", mrs!("faultmask"));
    put(ISPR, 2);
    put(ICPR, 2);
    print!("  pending {:x}\n\0", get(ISPR));
}

fn system_handlers() {
    for number in [14, 15, 2, 11] {
        on(number, |_, _| {});
    }
    priority(14, 0x80);
    priority(15, 0x40);
    priority(11, 0x20);
    unsafe { asm!("cpsid i") };
    put(ICSR, 1 << 28);
    put(ICSR, 1 << 26);
    print!("  icsr {:x} shcsr {:x}\n\0", get(ICSR) & !(1 << 23), get(SHCSR));
    put(ICSR, 1 << 27);
    print!("  icsr {:x}\n\0", get(ICSR) & !(1 << 23));
    unsafe { asm!("cpsie i", "isb") };
    put(ICSR, 1 << 31);
    on(14, |_, _| {
        put(ICSR, 1 << 26);
        unsafe { asm!("svc #1") };
    });
    put(ICSR, 1 << 28);
    on(15, |_, _| put(ICSR, 1 << 28));
    on(14, |_, _| {});
    put(ICSR, 1 << 26);
}

fn nvic_registers() {
    put(ISER, 0x00F0_F00F);
    put(ICER, 0x0000_F001);
    print!("  enabled {:x} {:x}\n\0", get(ISER), get(ICER));
    put(ICER, u32::MAX);
    put(ISPR, 0x0000_0F0F);
    put(ICPR, 0x0000_0100);
    print!("  pending {:x} {:x} active {:x}\n\0", get(ISPR), get(ICPR), get(IABR));
    put(IPR + 4, 0x1234_5678);
    put(IPR + 28, 0xFFFF_FFFF);
    print!("  priorities {:x} {:x} ictr {:x}\n\0", get(IPR + 4), get(IPR + 28), get(0xE000_E004));
    unsafe { write_volatile((IPR + 6) as *mut u8, 0xAB) };
    print!("  priorities {:x}\n\0", get(IPR + 4));
    enable(&[26]);
    on(26, |_, _| {});
    put(0xE000_EF00, 10);
}

fn scb_registers() {
    for (address, value) in [
        (CCR, 0xFFFF_FFFF), (CCR, 0x200), (SCR, 0xFFFF_FFFF), (SCR, 0), (SHPR, 0xFFFF_FFFF), (SHPR + 4, 0xFFFF_FFFF),
        (SHPR + 8, 0x8040_20FF), (VTOR, 0x2000_01FF), (VTOR, 0), (0xE000_ED88, 0xFFFF_FFFF), (0xE000_EF3C, 0xFFFF_FFFF),
        (0xE000_EF3C, 0), (0xE000_EF38, 0xFFFF_FFFF), (SHCSR, 0x7_0000), (AIRCR, 0x1234_0700), (0xE000_ED34, 0x1234_5678),
        (0xE000_ED38, 0x8765_4321),
    ] {
        put(address, value);
        print!("  {address:x} {:x}\n\0", get(address));
    }
    for address in [0xE000_EF40, 0xE000_EF44, MPU, 0xE000_ED40, 0xE000_ED44, 0xE000_ED50, 0xE000_ED60, 0xE000_ED70] {
        print!("  {address:x} {:x}\n\0", get(address));
    }
}

fn lazy() {
    let status = || (get(FPCCR), mrs!("control") & 4);
    for fpccr in [0xC000_0000u32, 0x8000_0000, 0x4000_0000, 0] {
        put(FPCCR, fpccr);
        msr!("control", 0);
        print!("  fpccr {:x}\n\0", get(FPCCR));
        on(11, |frame, exc_return| {
            let before = get(FPCCR);
            let address = get(FPCCR + 4).wrapping_sub(&raw const *frame as u32);
            let lazy = before & 1 != 0 || *exc_return & 0x10 == 0;
            if lazy {
                print!("    at {address:x}\n\0");
            }
            unsafe {
                asm!("vmov s0, {0}", "vmov s15, {0}", "vmsr fpscr, {1}", in(reg) 0x4000_0000, in(reg) 0x0300_0000, out("s0") _, out("s15") _)
            };
            let after = get(FPCCR);
            print!("    fpccr {before:x} {after:x} control {}\n\0", mrs!("control"));
            if *exc_return & 0x10 == 0 {
                let words = &raw const *frame as *const u32;
                unsafe { print!("    s0 {:x} s15 {:x} fpscr {:x}\n\0", *words.add(8), *words.add(23), *words.add(24)) };
            }
        });
        let (mut s0, mut s15, status_register): (u32, u32, u32);
        unsafe {
            asm!("vmov s0, {0}", "vmov s15, {1}", "vmsr fpscr, {2}", "svc #1", "vmov {0}, s0", "vmov {1}, s15", "vmrs {2}, fpscr",
                inout(reg) 0x3F80_0000u32 => s0, inout(reg) 0x4040_0000u32 => s15, inout(reg) 0x8140_0010u32 => status_register,
                out("s0") _, out("s15") _);
        }
        print!("  s0 {s0:x} s15 {s15:x} fpscr {status_register:x} {:x?}\n\0", status());
        // A handler that leaves the FPU alone.
        on(11, |_, _| {});
        msr!("control", 0);
        unsafe {
            asm!("vmov s1, {0}", "svc #1", "vmov {0}, s1", inout(reg) 0x1234_5678u32 => s0, out("s1") _);
        }
        print!("  s1 {s0:x} {:x?}\n\0", status());
        // The reserved space is free again, before anything touches the FPU.
        let after: u32;
        unsafe {
            asm!("vmov s1, {0}", "svc #1", "ldr {1}, [{2}]", in(reg) 1, out(reg) after, in(reg) FPCCR, out("s1") _);
        }
        print!("  fpccr {after:x}\n\0");
        // One in another, both use it.
        priority(11, 0x80);
        enable(&[16]);
        priority(16, 0x40);
        on(16, |_, _| unsafe { asm!("vmov s2, {0}", in(reg) 0x1111_1111, out("s2") _) });
        on(11, |_, _| {
            let mut value = 0x2222_2222u32;
            unsafe { asm!("vmov s2, {0}", "str {1}, [{2}]", "dsb", "isb", "vmov {0}, s2", inout(reg) value, in(reg) 1, in(reg) ISPR, out("s2") _) };
            print!("    s2 {value:x}\n\0");
        });
        unsafe {
            asm!("vmov s2, {0}", "svc #1", "vmov {0}, s2", inout(reg) 0x3333_3333u32 => s0, out("s2") _);
        }
        print!("  s2 {s0:x} {:x?}\n\0", status());
    }
    put(FPCCR, 0xC000_0000);
    // FPDSCR is a new context's status.
    put(0xE000_EF3C, 0x0340_0000);
    msr!("control", 0);
    let value: u32;
    unsafe { asm!("vmrs {0}, fpscr", out(reg) value) };
    print!("  fpscr {:x}\n\0", value & 0x07C0_0000);
    put(0xE000_EF3C, 0);
}

fn privilege() {
    on(11, |_, _| msr!("control", mrs!("control") & !1));
    on(5, |frame, _| frame.pc += if unsafe { read_volatile(frame.pc as *const u16) } >= 0xE800 { 4 } else { 2 });
    msr!("control", 1);
    unsafe {
        asm!("cpsid i", "cpsid f");
        asm!("msr basepri, {0}", in(reg) 0x40);
        asm!("msr msp, {0}", in(reg) 0x40);
        let (mut a, mut b, mut c, mut d): (u32, u32, u32, u32);
        asm!("mrs {0}, primask", "mrs {1}, basepri", "mrs {2}, control", "mrs {3}, msp", out(reg) a, out(reg) b, out(reg) c, out(reg) d);
        let mut loaded = 7u32;
        asm!("ldr {0}, [{1}]", inout(reg) loaded, in(reg) ICSR);
        asm!("str {0}, [{1}]", in(reg) 0, in(reg) ICSR);
        asm!("str {0}, [{1}]", in(reg) 4, in(reg) 0xE000_EF00u32);
        asm!("msr control, {0}", in(reg) 0);
        asm!("svc #1");
        print!("  {a:x} {b:x} {:x} {d:x} {loaded:x} {}\n\0", c & 3, mrs!("control") & 3);
        (a, b, c, d) = (0, 0, 0, 0);
        asm!("mrs {0}, primask", "mrs {1}, basepri", "mrs {2}, faultmask", out(reg) a, out(reg) b, out(reg) c);
        print!("  {a:x} {b:x} {c:x} {d}\n\0");
    }
    // The software trigger, if allowed.
    put(CCR, 0x202);
    enable(&[20]);
    on(20, |_, _| {});
    msr!("control", 1);
    unsafe { asm!("str {0}, [{1}]", "dsb", "isb", in(reg) 4, in(reg) 0xE000_EF00u32) };
    unsafe { asm!("svc #1") };
    // Unprivileged loads and stores of privileged code.
    unsafe { asm!("ldrt {0}, [{1}]", out(reg) _, in(reg) ICSR) };
    unsafe { asm!("strt {0}, [{1}]", in(reg) 0, in(reg) ICSR) };
}

fn sleep() {
    enable(&[16]);
    on(16, |_, _| {});
    unsafe { asm!("cpsid i") };
    pend(16);
    unsafe { asm!("wfi") };
    print!("  awake, pending {:x}\n\0", get(ISPR));
    unsafe { asm!("cpsie i", "isb") };
    unsafe { asm!("sev", "wfe") };
    print!("  event\n\0");
    put(ICER, 1);
    put(SCR, 0x10);
    unsafe { asm!("sev", "wfe") };
    pend(16);
    unsafe { asm!("wfe") };
    print!("  pending is an event\n\0");
    put(ICPR, 1);
}

fn mpu() {
    // All of memory for privileged code by the default map; regions of their own.
    let region = |number: u32, base: u32, attributes: u32| {
        put(MPU + 8, number);
        put(MPU + 0x0C, base);
        put(MPU + 0x10, attributes);
        print!("  region {:x} {:x} {:x}\n\0", get(MPU + 8), get(MPU + 0x0C), get(MPU + 0x10));
    };
    region(0, 0x2010_0000, 6 << 24 | 11 << 1 | 1);
    region(1, 0x2010_1000, 1 << 28 | 3 << 24 | 11 << 1 | 1);
    region(2, 0x2010_2000, 3 << 24 | 0x81 << 8 | 10 << 1 | 1);
    region(3, 0x2010_3000, 11 << 1 | 1);
    unsafe {
        write_volatile(0x2010_0000 as *mut u16, 0x4770);
        write_volatile(0x2010_1000 as *mut u16, 0x4770);
    }
    put(MPU + 4, 5);
    print!("  control {:x}\n\0", get(MPU + 4));
    let touch = |address: u32| unsafe {
        asm!("ldr {0}, [{1}]", out(reg) _, in(reg) address);
        asm!("str {0}, [{1}]", in(reg) 0x4770, in(reg) address);
    };
    for address in [0x2010_0000, 0x2010_1000, 0x2010_2000, 0x2010_2100, 0x2010_2700, 0x2010_3000, 0x2010_4000] {
        print!("  {address:x}\n\0");
        touch(address);
    }
    call(0x2010_0001);
    call(0x2010_1001);
    bad_stack(4, 0x2010_3400);
    put(MPU + 4, 0);
    touch(0x2010_3000);
}

fn vector_table() {
    let new = 0x2020_0000 as *mut u32;
    for i in 0..64 {
        unsafe { write_volatile(new.add(i), get(i as u32 * 4)) };
    }
    unsafe { write_volatile(new.add(17), new.add(17).read_volatile()) };
    put(VTOR, 0x2020_0000);
    priority(17, 0x80);
    enable(&[17]);
    on(17, |_, _| {});
    pend(17);
    // A handler without bit 0.
    unsafe { write_volatile(new.add(17), get(17 * 4) & !1) };
    on(6, |frame, _| {
        frame.xpsr |= 1 << 24;
        print!("    pc {}\n\0", frame.pc == get(17 * 4) & !1);
    });
    pend(17);
    put(VTOR, 0);
}

fn systick() {
    // The place of the interrupt depends on time: the frame is not shown.
    unsafe { QUIET = true };
    on(15, |_, _| {
        put(0xE000_E010, 0);
        put(ICSR, 1 << 25);
    });
    put(0xE000_E014, 1_000_000);
    put(0xE000_E018, 0);
    put(0xE000_E010, 7);
    while get(0xE000_E010) & 1 != 0 {}
    print!("  control {:x} reload {:x}\n\0", get(0xE000_E010) & !(1 << 16), get(0xE000_E014));
    put(0xE000_E010, 0);
}
