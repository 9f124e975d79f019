//! USART1 as the autopilot's port (reception by interrupt, a byte at a time as the emulator has no DMA) and USART2 as
//! the ground station's.
//!
//! The emulated USART is flow controlled: the emulator offers the next byte when the last one was taken. So reception
//! is switched on only while bytes are due by the feed, and everything else waits on the host's side without loss.

use core::cell::RefCell;
use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Timer;
use heapless::Vec;

use super::provoke;
use crate::boards::{Overrun, Receive, Transmit};
use crate::tasks::reception::FETCH_BYTES;

/// Bytes that are received as one piece; a feed record of more is several pieces at the same time.
const PIECE_BYTES: usize = FETCH_BYTES;
/// The ground station's port, in baud: as on the real board.
const GS_BAUD: u64 = 57_600;
/// Bits that a byte takes on the line.
const BITS_A_BYTE: u64 = 10;

static RECEIVED: Mutex<RefCell<Vec<u8, PIECE_BYTES>>> = Mutex::new(RefCell::new(Vec::new()));
/// Bytes that were taken out of the port since the start: what the host need not send again after a reset.
static TAKEN: AtomicU32 = AtomicU32::new(0);
/// Bytes still due of the current piece.
static DUE: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();

/// Reception of the autopilot's bytes.
pub(crate) struct AutopilotRx(());

/// Transmission to the ground station.
pub(crate) struct GsTx(());

/// Switches both ports on.
pub(super) fn init() -> (AutopilotRx, GsTx) {
    for usart in [pac::USART1, pac::USART2] {
        usart.cr1().write(|w| {
            w.set_ue(true);
            w.set_re(true);
            w.set_te(true);
        });
    }
    // SAFETY: the handler below shares nothing but what is made for it, and nobody relies on its being masked.
    unsafe { NVIC::unmask(interrupt::USART1) };
    (AutopilotRx(()), GsTx(()))
}

/// Bytes taken out of the port since the start.
pub(super) fn taken() -> u32 {
    TAKEN.load(Ordering::Relaxed)
}

/// Takes `count` bytes from the port, piece by piece, and lets reception have each piece. Returns when all are in; the
/// caller is idle, so no task waits meanwhile.
pub(super) fn receive(count: u32) {
    let mut left = count;
    while left > 0 {
        let piece = left.min(PIECE_BYTES as u32);
        DUE.store(piece, Ordering::Release);
        pac::USART1.cr1().modify(|w| w.set_rxneie(true));
        // Sleeping lets the emulator's other thread go on: ten times faster than to spin.
        while DUE.load(Ordering::Acquire) > 0 {
            cortex_m::interrupt::free(|_| {
                // An interrupt that comes after this look wakes the sleep and is served after it.
                if DUE.load(Ordering::Acquire) > 0 {
                    cortex_m::asm::wfi();
                }
            });
        }
        left -= piece;
        WAKER.wake();
    }
}

#[interrupt]
fn USART1() {
    let usart = pac::USART1;
    let mut due = DUE.load(Ordering::Relaxed);
    critical_section::with(|cs| {
        let mut received = RECEIVED.borrow_ref_mut(cs);
        while due > 0 && usart.sr().read().rxne() {
            // Never full: a piece is asked for when the one before is gone.
            let _ = received.push(usart.dr().read().dr() as u8);
            due -= 1;
            TAKEN.fetch_add(1, Ordering::Relaxed);
        }
    });
    if due == 0 {
        usart.cr1().modify(|w| w.set_rxneie(false));
    }
    DUE.store(due, Ordering::Release);
}

impl Receive for AutopilotRx {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        poll_fn(|context| {
            WAKER.register(context.waker());
            if DUE.load(Ordering::Acquire) > 0 {
                return Poll::Pending;
            }
            critical_section::with(|cs| {
                let mut received = RECEIVED.borrow_ref_mut(cs);
                let count = received.len().min(buffer.len());
                let (Some(to), Some(from)) = (buffer.get_mut(..count), received.get(..count)) else {
                    return Poll::Pending;
                };
                if count == 0 {
                    return Poll::Pending;
                }
                to.copy_from_slice(from);
                received.drain(..count);
                Poll::Ready(Ok(count))
            })
        })
        .await
    }
}

impl Transmit for GsTx {
    async fn transmit(&mut self, bytes: &[u8]) {
        provoke::here().await;
        for &byte in bytes {
            // The emulated port takes a byte at once; there is no TXE to wait for.
            pac::USART2.dr().write(|w| w.set_dr(u16::from(byte)));
        }
        Timer::after_micros(bytes.len() as u64 * BITS_A_BYTE * 1_000_000 / GS_BAUD).await;
    }
}
