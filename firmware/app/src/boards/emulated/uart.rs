//! USART1 as the autopilot's port (reception by interrupt, a byte at a time as the emulator has no DMA) and USART2 as
//! the ground station's.
//!
//! The emulated USART is flow controlled: the emulator offers the next byte when the last one was taken. So reception
//! is switched on only while bytes are due by the feed, and everything else waits on the host's side without loss.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use critical_section::Mutex;
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Vec;

use crate::boards::{LineFault, Receive, Transmit};

/// Bytes taken in before the reception task is given them. A feed record up to this size is received as one piece.
pub(crate) const RX_BYTES: usize = 2048;

static RECEIVED: Mutex<RefCell<Vec<u8, RX_BYTES>>> = Mutex::new(RefCell::new(Vec::new()));
/// Bytes still due of the current piece.
static DUE: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();

/// Reception of the autopilot's bytes.
pub(crate) struct AutopilotRx(());

/// Transmission to the ground station.
pub(crate) struct GsTx(());

/// Switches both ports on.
pub(crate) fn init() -> (AutopilotRx, GsTx) {
    for usart in [pac::USART1, pac::USART2] {
        usart.cr1().write(|w| {
            w.set_ue(true);
            w.set_re(true);
            w.set_te(true);
        });
    }
    (AutopilotRx(()), GsTx(()))
}

/// Takes `count` bytes (at most `RX_BYTES`) from the port, then wakes the reception task once. Returns when they are
/// all in; the caller is the idle loop, so no task waits meanwhile.
pub(crate) fn receive_exactly(count: u32) {
    DUE.store(count, Ordering::Release);
    pac::USART1.cr1().modify(|w| w.set_rxneie(true));
    while DUE.load(Ordering::Acquire) > 0 {
        cortex_m::asm::wfi();
    }
    WAKER.wake();
}

#[interrupt]
fn USART1() {
    let usart = pac::USART1;
    let mut due = DUE.load(Ordering::Relaxed);
    critical_section::with(|cs| {
        let mut received = RECEIVED.borrow_ref_mut(cs);
        while due > 0 && usart.sr().read().rxne() {
            // Never full: `receive_exactly` asks for no more than the buffer holds.
            let _ = received.push(usart.dr().read().dr() as u8);
            due -= 1;
        }
    });
    if due == 0 {
        usart.cr1().modify(|w| w.set_rxneie(false));
    }
    DUE.store(due, Ordering::Release);
}

impl Receive for AutopilotRx {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LineFault> {
        core::future::poll_fn(|context| {
            WAKER.register(context.waker());
            if DUE.load(Ordering::Acquire) > 0 {
                return Poll::Pending;
            }
            critical_section::with(|cs| {
                let mut received = RECEIVED.borrow_ref_mut(cs);
                let count = received.len().min(buffer.len());
                if count == 0 {
                    return Poll::Pending;
                }
                let (Some(to), Some(from)) = (buffer.get_mut(..count), received.get(..count)) else {
                    return Poll::Pending;
                };
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
        for &byte in bytes {
            // The emulated port takes a byte at once; there is no TXE to wait for.
            pac::USART2.dr().write(|w| w.set_dr(u16::from(byte)));
        }
    }
}
