//! Text by semihosting, registers, one handler for every vector.

use core::arch::{asm, global_asm};
use core::fmt::Write;
use core::ptr::{read_volatile, write_volatile};

global_asm!(
    r#"
    .syntax unified
    .cpu cortex-m4
    .fpu fpv4-sp-d16
    .section .vectors, "a"
    .global vectors
vectors:
    .word 0x203F0000
    .word start
    .rept 62
    .word common
    .endr

    .section .text
    .thumb_func
    .global start
start:
    ldr r0, =0xE000ED88
    ldr r1, =0x00F00000
    str r1, [r0]
    dsb
    isb
    bl scenarios
    movs r0, #0x18
    ldr r1, =0x20026
    bkpt #0xAB
    b .

    .thumb_func
    .global common
common:
    mrs r0, ipsr
    tst lr, #4
    ite eq
    mrseq r1, msp
    mrsne r1, psp
    push {{r3, lr}}
    add r2, sp, #4
    bl on_exception
    pop {{r3, pc}}
    .ltorg
    "#
);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    say("panic\n\0");
    exit()
}

pub fn exit() -> ! {
    unsafe { asm!("movs r0, #0x18", "ldr r1, =0x20026", "bkpt #0xAB", options(noreturn)) }
}

pub fn say(text: &str) {
    unsafe { asm!("bkpt #0xAB", inout("r0") 4 => _, in("r1") text.as_ptr()) }
}

pub struct Line {
    pub bytes: [u8; 256],
    pub used: usize,
}

impl Write for Line {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for byte in text.bytes() {
            if self.used < 255 {
                self.bytes[self.used] = byte;
                self.used += 1;
            }
        }
        Ok(())
    }
}

#[macro_export]
macro_rules! print {
    ($($part:tt)*) => {{
        let mut line = $crate::support::Line { bytes: [0; 256], used: 0 };
        let _ = core::fmt::Write::write_fmt(&mut line, format_args!($($part)*));
        $crate::support::say(unsafe { core::str::from_utf8_unchecked(&line.bytes) });
    }};
}

pub fn get(address: u32) -> u32 {
    unsafe { read_volatile(address as *const u32) }
}

pub fn put(address: u32, value: u32) {
    unsafe {
        write_volatile(address as *mut u32, value);
        asm!("dsb", "isb");
    }
}

pub const ISER: u32 = 0xE000_E100;
pub const ICER: u32 = 0xE000_E180;
pub const ISPR: u32 = 0xE000_E200;
pub const ICPR: u32 = 0xE000_E280;
pub const IABR: u32 = 0xE000_E300;
pub const IPR: u32 = 0xE000_E400;
pub const ICSR: u32 = 0xE000_ED04;
pub const VTOR: u32 = 0xE000_ED08;
pub const AIRCR: u32 = 0xE000_ED0C;
pub const SCR: u32 = 0xE000_ED10;
pub const CCR: u32 = 0xE000_ED14;
pub const SHPR: u32 = 0xE000_ED18;
pub const SHCSR: u32 = 0xE000_ED24;
pub const CFSR: u32 = 0xE000_ED28;
pub const FPCCR: u32 = 0xE000_EF34;
pub const MPU: u32 = 0xE000_ED90;

#[macro_export]
macro_rules! mrs {
    ($name:literal) => {{
        let value: u32;
        unsafe { core::arch::asm!(concat!("mrs {0}, ", $name), out(reg) value) };
        value
    }};
}

#[macro_export]
macro_rules! msr {
    ($name:literal, $value:expr) => {
        unsafe { core::arch::asm!(concat!("msr ", $name, ", {0}"), "isb", in(reg) $value) }
    };
}

#[repr(C)]
pub struct Frame {
    pub r: [u32; 4],
    pub r12: u32,
    pub lr: u32,
    pub pc: u32,
    pub xpsr: u32,
}

/// The action of a handler beside printing.
pub type Action = fn(&mut Frame, &mut u32);
pub static mut ACTIONS: [Option<Action>; 64] = [None; 64];
pub static mut QUIET: bool = false;
pub static mut TAKEN: u32 = 0;

pub fn on(number: u32, action: Action) {
    unsafe { ACTIONS[number as usize] = Some(action) }
}

#[unsafe(no_mangle)]
extern "C" fn on_exception(number: u32, frame: &mut Frame, exc_return: &mut u32) {
    let quiet = unsafe { QUIET };
    unsafe {
        TAKEN += 1;
        if TAKEN > 600 {
            say("too many\n\0");
            exit();
        }
    }
    if !quiet {
        print!(
            "  [{number} lr {:x} xpsr {:x} icsr {:x} shcsr {:x} control {}",
            *exc_return,
            frame.xpsr,
            get(ICSR) & !(1 << 23),
            get(SHCSR),
            mrs!("control"),
        );
    }
    if (3..=6).contains(&number) {
        let (cfsr, hfsr, mmfar, bfar) = (get(CFSR), get(CFSR + 4), get(CFSR + 12), get(CFSR + 16));
        print!(" cfsr {cfsr:x} hfsr {hfsr:x}");
        if cfsr & 0x80 != 0 {
            print!(" mmfar {mmfar:x}");
        }
        if cfsr & 0x8000 != 0 {
            print!(" bfar {bfar:x}");
        }
        put(CFSR, cfsr);
        put(CFSR + 4, hfsr);
        if unsafe { ACTIONS[number as usize] }.is_none() {
            // Over the instruction; out of a place without one.
            if cfsr & 0x0002_0101 != 0 {
                print!(" pc {:x}", frame.pc);
                frame.pc = frame.lr & !1;
                frame.xpsr |= 1 << 24;
            } else if cfsr & !0x0004_0000 != 0 {
                let halfword = unsafe { read_volatile(frame.pc as *const u16) };
                frame.pc += if halfword >= 0xE800 { 4 } else { 2 };
            }
        }
    }
    print!("\n\0");
    if let Some(action) = unsafe { ACTIONS[number as usize] } {
        action(frame, exc_return);
        if !quiet {
            print!("  {number}]\n\0");
        }
    }
}

pub fn priority(number: u32, value: u8) {
    let address = if number < 16 { SHPR + number - 4 } else { IPR + number - 16 };
    unsafe { write_volatile(address as *mut u8, value) }
}

pub fn enable(numbers: &[u32]) {
    for number in numbers {
        put(ISER, 1 << (number - 16));
    }
}

pub fn pend(number: u32) {
    put(ISPR, 1 << (number - 16));
}

pub fn reset() {
    put(ICER, u32::MAX);
    put(ICPR, u32::MAX);
    put(ICSR, 1 << 27 | 1 << 25);
    put(AIRCR, 0x05FA_0000);
    for number in (4..7).chain([11, 12, 14, 15]).chain(16..48) {
        priority(number, 0);
    }
    put(SHCSR, 0x7_0000);
    put(CCR, 0x200);
    put(SCR, 0);
    unsafe {
        ACTIONS = [None; 64];
        QUIET = false;
    }
}

/// Jumps to an address.
pub fn call(address: u32) {
    unsafe { asm!("blx {0}", in(reg) address, clobber_abi("C")) }
}
