//! A checksum, a sort, floating point, text.
#![no_std]
#![no_main]

use core::arch::{asm, global_asm};
use core::fmt::Write;

global_asm!(
    r#"
    .syntax unified
    .cpu cortex-m4
    .fpu fpv4-sp-d16
    .section .vectors, "a"
    .word 0x203F0000
    .word start
    .rept 14
    .word stop
    .endr
    .rept 32
    .word clobber
    .endr
    .section .text
    .thumb_func
    .global start
start:
    ldr r0, =0xE000ED88
    ldr r1, =0x00F00000
    str r1, [r0]
    ldr r0, =0xE000E100            // All interrupts, of eight priorities in turn.
    mov r1, #-1
    str r1, [r0]
    ldr r0, =0xE000E400
    movs r1, #0
1:  lsls r2, r1, #5
    strb r2, [r0, r1]
    adds r1, #1
    cmp r1, #32
    bne 1b
    dsb
    isb
    bl work
    .thumb_func
stop:
    movs r0, #0x18
    ldr r1, =0x20026
    bkpt #0xAB
    b .

    .thumb_func
clobber:
    mrs r0, ipsr
    tst r0, #1
    itt ne
    vmovne s0, r0
    vmovne s15, r0
    it ne
    vmsrne fpscr, r0
    mvn r1, r0
    mov r2, r1
    mov r3, r1
    mov r12, r1
    msr apsr_nzcvqg, r1
    clrex
    bx lr
    "#
);

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe { asm!("movs r0, #0x18", "ldr r1, =0x20026", "bkpt #0xAB", options(noreturn)) }
}

struct Line {
    bytes: [u8; 256],
    used: usize,
}

impl Write for Line {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for byte in text.bytes() {
            self.bytes[self.used] = byte;
            self.used += 1;
        }
        Ok(())
    }
}

fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}

static mut NUMBERS: [u32; 4096] = [0; 4096];

#[unsafe(no_mangle)]
extern "C" fn work() {
    let numbers = unsafe { &mut *(&raw mut NUMBERS) };
    let (mut state, mut total, mut mean) = (1u32, 0u64, 0f32);
    let mut line = Line { bytes: [0; 256], used: 0 };
    for round in 0..60u32 {
        for number in numbers.iter_mut() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *number = state >> 7;
        }
        numbers.sort_unstable();
        let bytes: &[u8] = unsafe { core::slice::from_raw_parts(numbers.as_ptr().cast(), 16384) };
        total = total.wrapping_mul(31).wrapping_add(u64::from(checksum(bytes)));
        for pair in numbers.windows(2) {
            let step = (pair[1] - pair[0]) as f32;
            mean += (step - mean) / (1.0 + (round as f32));
            total ^= u64::from(pair[0] % (pair[1] | 1)) << (round & 31);
        }
        line.used = 0;
        let _ = write!(line, "{round} {total:x} {:?} {}\n\0", mean, u64::MAX / (total | 1));
        unsafe { asm!("bkpt #0xAB", inout("r0") 4 => _, in("r1") line.bytes.as_ptr()) }
    }
}
