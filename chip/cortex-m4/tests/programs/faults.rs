//! Faults: kinds, escalation, refused returns.

use crate::support::*;
use crate::{mrs, msr, print};
use core::arch::asm;
use core::ptr::{read_volatile, write_volatile};

pub fn faults() {
    unsafe {
        asm!("udf #1", ".hword 0xF7F0, 0xA000");
        // Coprocessor 1.
        asm!(".hword 0xEE01, 0x0110");
        asm!("ldr {0}, [{1}]", out(reg) _, in(reg) 0x3000_0000);
        asm!("ldrb {0}, [{1}]", out(reg) _, in(reg) 0x3000_0003);
        asm!("ldm {0}, {{r1, r2}}", in(reg) 0x2000_1001, out("r1") _, out("r2") _);
        asm!("ldrd {1}, {2}, [{0}]", in(reg) 0x2000_1002, out(reg) _, out(reg) _);
        asm!("ldrex {1}, [{0}]", in(reg) 0x2000_1002, out(reg) _);
        asm!("vldr s0, [{0}]", in(reg) 0x2000_1002, out("s0") _);
        asm!("sdiv {0}, {1}, {2}", out(reg) _, in(reg) 5, in(reg) 0);
    }
    put(CCR, 0x218);
    unsafe {
        asm!("sdiv {0}, {1}, {2}", out(reg) _, in(reg) 5, in(reg) 0);
        asm!("udiv {0}, {1}, {2}", out(reg) _, in(reg) 5, in(reg) 0);
        asm!("ldr {0}, [{1}]", out(reg) _, in(reg) 0x2000_1001);
        asm!("strh {0}, [{1}]", in(reg) 0, in(reg) 0x2000_1001);
        asm!("ldrh {0}, [{1}]", out(reg) _, in(reg) 0x2000_1002);
    }
    put(CCR, 0x200);
    call(0x3000_0001);
    call(0x4000_0001);
    call(0xE000_E001);
    call(0x2000_0000);
    put(0xE000_ED88, 0);
    unsafe { asm!("vmov {0}, s1", out(reg) _) };
    put(0xE000_ED88, 0x00F0_0000);
    // The IT state is in the frame.
    let mut value = 0u32;
    unsafe {
        asm!("cmp {0}, {0}", "itete eq", "ldreq {1}, [{1}]", "movne {0}, #1", "addeq {0}, #2", "addne {0}, #4",
            inout(reg) value, inout(reg) 0x3000_0000 => _);
    }
    print!("  value {value}\n\0");
    bad_stack(5, 0x3000_1000);
}

/// The process stack is at a forbidden place; the fault of this number leads back.
pub fn bad_stack(number: u32, stack: u32) {
    let main = mrs!("msp");
    on(number, |_, exc_return| {
        print!("    psp {:x}\n\0", mrs!("psp"));
        msr!("psp", 0x2030_0000u32);
        let frame = 0x2030_0000 as *mut u32;
        for (i, word) in [0, 1, 2, 3, 12, 14, 0, 0x0100_0000].into_iter().enumerate() {
            unsafe { write_volatile(frame.add(i), word) };
        }
        unsafe { write_volatile(frame.add(6), RESUME) };
        *exc_return |= 0x10;
    });
    unsafe {
        asm!(
            "msr psp, r0", "adr r2, 2f", "str r2, [r1]", "movs r2, #2", "msr control, r2", "isb",
            "svc #1", "b .", ".p2align 2", "2:", "movs r2, #0", "msr control, r2", "isb",
            inout("r0") stack => _, inout("r1") &raw mut RESUME => _, out("r2") _, clobber_abi("C")
        );
    }
    print!("  msp {} control {}\n\0", mrs!("msp") == main, mrs!("control") & 3);
}

static mut RESUME: u32 = 0;

pub fn escalation() {
    put(SHCSR, 0);
    unsafe {
        asm!("udf #1");
        asm!("ldr {0}, [{1}]", out(reg) _, in(reg) 0x3000_0000);
    }
    call(0x4000_0001);
    put(SHCSR, 0x7_0000);
    // A fault of the priority that runs.
    priority(6, 0x80);
    priority(16, 0x80);
    enable(&[16]);
    on(16, |_, _| unsafe { asm!("udf #2") });
    pend(16);
    priority(16, 0xC0);
    pend(16);
    unsafe { asm!("cpsid i", "udf #3", "cpsie i") };
    priority(11, 0x80);
    msr!("basepri", 0x40);
    unsafe { asm!("svc #1") };
    msr!("basepri", 0);
    on(16, |_, _| unsafe { asm!("svc #2") });
    priority(16, 0x80);
    pend(16);
    // A fault in NMI or HardFault would be the end.
}

pub fn bad_returns() {
    on(11, |frame, exc_return| {
        print!("    {exc_return:x}\n\0");
        *exc_return = unsafe { RESUME };
        frame.r[0] += 1;
    });
    on(6, |frame, exc_return| {
        print!("    usage: lr {exc_return:x} xpsr {:x} r0 {:x}\n\0", frame.xpsr, frame.r[0]);
        *exc_return = 0xFFFF_FFF9;
        if frame.xpsr & 0x1FF != 0 {
            frame.xpsr &= !0x1FF;
        }
    });
    for code in [0xFFFF_FFF1, 0xFFFF_FFF5, 0xFFFF_FFF0, 0xFFFF_FFFF] {
        unsafe {
            RESUME = code;
            let mut value = 7u32;
            // Small frames.
            asm!("mrs {t}, control", "bic {t}, #4", "msr control, {t}", "isb", "svc #1", t = out(reg) _, inout("r0") value);
            print!("  r0 {value:x}\n\0");
        }
    }
}
