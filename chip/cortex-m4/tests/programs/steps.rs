//! Runs instructions one by one, each from a given state.
//!
//! Each test is in thread mode on the process stack, and ends by SVC or a fault. `handler` gets every exception: it stores
//! registers and scratch memory, and returns into a frame with the next test's state.
#![no_std]
#![no_main]

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

core::arch::global_asm!(
    r#"
    .syntax unified
    .cpu cortex-m4
    .fpu fpv4-sp-d16
    .section .vectors, "a"
    .word 0x20300000
    .word start
    .rept 254
    .word handler
    .endr

    .section .text
    .thumb_func
    .global start
start:
    ldr r0, =0xE000ED88            // CPACR: all may use the FPU
    ldr r1, =0x00F00000
    str r1, [r0]
    ldr r0, =0xE000ED24            // SHCSR: each fault has its handler
    ldr r1, =0x00070000
    str r1, [r0]
    dsb
    isb
    ldr r0, =0x20270000
    msr psp, r0
    movs r0, #2
    msr control, r0
    isb
    vmov s0, r0
    svc #0                         // The first record is of nothing.
    .ltorg

    .thumb_func
handler:
    mrs r0, psp
    ldr r1, =0x20280000            // outputs, inputs, count
    ldr r2, [r1]
    stmia r2!, {{r4-r11}}
    vstmia r2!, {{s0-s31}}
    mov r3, r0
    ldmia r3!, {{r4-r11}}
    stmia r2!, {{r4-r11}}
    ldr r4, [r0, #0x60]            // FPSCR
    mrs r5, ipsr
    ldr r6, =0xE000ED28            // CFSR, HFSR
    ldr r7, [r6]
    str r7, [r6]
    ldr r9, [r6, #4]
    str r9, [r6, #4]
    mov r8, lr
    stmia r2!, {{r0, r4, r5, r7, r8, r9}}
    clrex
    ldr r3, =0x20290000            // scratch
    ldr r4, =0x202A0000            // what it holds before each test
    .rept 12
    ldmia r3, {{r5-r12}}
    stmia r2!, {{r5-r12}}
    ldmia r4!, {{r5-r12}}
    stmia r3!, {{r5-r12}}
    .endr
    str r2, [r1]
    ldr r3, [r1, #8]
    subs r3, r3, #1
    str r3, [r1, #8]
    bmi finish
    ldr r2, [r1, #4]
    ldr r0, =0x20290100-0x68       // the frame: the stack pointer is in the middle of the scratch memory
    mov r4, r0
    .rept 3
    ldmia r2!, {{r5-r12}}
    stmia r4!, {{r5-r12}}
    .endr
    ldmia r2!, {{r5-r6}}
    stmia r4!, {{r5-r6}}
    vldmia r2!, {{s16-s31}}
    ldmia r2!, {{r4-r11}}
    str r2, [r1, #4]
    msr psp, r0
    mvn lr, #0x12
    bx lr

finish:
    ldr r1, =arguments             // SYS_OPEN, SYS_WRITE, SYS_EXIT
    movs r0, #1
    bkpt #0xAB
    ldr r1, =arguments
    str r0, [r1, #12]
    adds r1, r1, #12
    ldr r2, =0x20280000
    ldr r3, [r2, #12]
    ldr r2, [r2]
    str r3, [r1, #4]
    subs r2, r2, r3
    str r2, [r1, #8]
    movs r0, #5
    bkpt #0xAB
    movs r0, #0x18
    ldr r1, =0x20026
    bkpt #0xAB
    b .
    .ltorg

    .section .data, "aw"
arguments:
    .word name, 5, 7               // name, mode "wb", length of the name
    .word 0, 0, 0                  // handle, address, length
name:
    .asciz "out.bin"
    "#
);
