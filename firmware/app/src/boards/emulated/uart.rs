//! USART1 as the autopilot's port and USART2 as the ground station's: reception by interrupt, a byte at a time as the
//! emulator has no DMA.
//!
//! The emulated USART is flow controlled: the emulator offers the next byte when the last one was taken. So reception
//! is switched on only while bytes are due by the feed, and everything else waits on the host's side without loss.

use core::cell::RefCell;
use core::future::{pending, poll_fn};
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Timer;
use heapless::Vec;
use hums_onboard::Task;

use super::{provoke, reset};
use crate::boards::machine::{FETCH_BYTES, Overrun, Receive, Transmit};

/// Bytes that are received as one piece; a feed record of more is several pieces at the same time.
const PIECE_BYTES: usize = FETCH_BYTES;
/// The same from the ground station.
const GS_PIECE_BYTES: usize = 256;
/// The ground station's port, in baud: as on the real board.
const GS_BAUD: u64 = 57_600;
/// The autopilot's.
const AUTOPILOT_BAUD: u64 = 921_600;
/// Bits that a byte takes on the line.
const BITS_A_BYTE: u64 = 10;

static AUTOPILOT: Inbox<PIECE_BYTES> = Inbox::new(pac::USART1);
static GS: Inbox<GS_PIECE_BYTES> = Inbox::new(pac::USART2);

/// What one port received.
struct Inbox<const BYTES: usize> {
    registers: pac::usart::Usart,
    received: Mutex<RefCell<Vec<u8, BYTES>>>,
    /// Bytes still due of the current piece.
    due: AtomicU32,
    waker: AtomicWaker,
}

/// Reception of a port's bytes.
pub(crate) struct PortRx<const BYTES: usize>(&'static Inbox<BYTES>);

/// Reception from the autopilot.
pub(crate) type AutopilotRx = PortRx<PIECE_BYTES>;
/// Reception from the ground station.
pub(crate) type GsRx = PortRx<GS_PIECE_BYTES>;

/// Transmission to the ground station.
pub(crate) struct GsTx {
    baud: u64,
}

/// Transmission to the autopilot.
pub(crate) struct AutopilotTx {
    baud: u64,
}

/// Switches both ports on.
pub(super) fn init() -> ((AutopilotRx, AutopilotTx), (GsRx, GsTx)) {
    for usart in [pac::USART1, pac::USART2] {
        usart.cr1().write(|w| {
            w.set_ue(true);
            w.set_re(true);
            w.set_te(true);
        });
    }
    // SAFETY: the handlers below share nothing but what is made for it, and nobody relies on their being masked.
    unsafe {
        NVIC::unmask(interrupt::USART1);
        NVIC::unmask(interrupt::USART2);
    }
    let autopilot = (PortRx(&AUTOPILOT), AutopilotTx { baud: AUTOPILOT_BAUD });
    (autopilot, (PortRx(&GS), GsTx { baud: GS_BAUD }))
}

/// Takes `count` bytes from the autopilot's port, or from the ground station's, piece by piece, and lets the port's task
/// have each piece. Returns when all are in; the caller is idle, so no task waits meanwhile.
pub(super) fn receive(from_gs: bool, count: u32) {
    if from_gs {
        GS.fetch(count);
    } else {
        AUTOPILOT.fetch(count);
    }
}

impl<const BYTES: usize> Inbox<BYTES> {
    const fn new(registers: pac::usart::Usart) -> Self {
        let received = Mutex::new(RefCell::new(Vec::new()));
        Self { registers, received, due: AtomicU32::new(0), waker: AtomicWaker::new() }
    }

    fn fetch(&self, count: u32) {
        let mut left = count;
        while left > 0 {
            let piece = left.min(BYTES as u32);
            self.due.store(piece, Ordering::Release);
            self.registers.cr1().modify(|w| w.set_rxneie(true));
            // Sleeping lets the emulator's other thread go on: ten times faster than to spin.
            while self.due.load(Ordering::Acquire) > 0 {
                cortex_m::interrupt::free(|_| {
                    // An interrupt that comes after this look wakes the sleep and is served after it.
                    if self.due.load(Ordering::Acquire) > 0 {
                        cortex_m::asm::wfi();
                    }
                });
            }
            left -= piece;
            self.waker.wake();
        }
    }

    /// Gives how many bytes it took.
    fn on_interrupt(&self) -> u32 {
        let before = self.due.load(Ordering::Relaxed);
        let mut due = before;
        critical_section::with(|cs| {
            let mut received = self.received.borrow_ref_mut(cs);
            while due > 0 && self.registers.sr().read().rxne() {
                // Never full: a piece is asked for when the one before is gone.
                let _ = received.push(self.registers.dr().read().dr() as u8);
                due -= 1;
            }
        });
        if due == 0 {
            self.registers.cr1().modify(|w| w.set_rxneie(false));
        }
        self.due.store(due, Ordering::Release);
        before - due
    }
}

#[interrupt]
fn USART1() {
    reset::took(AUTOPILOT.on_interrupt());
}

#[interrupt]
fn USART2() {
    let _ = GS.on_interrupt();
}

impl<const BYTES: usize> Receive for PortRx<BYTES> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        let Self(inbox) = self;
        // The ground station's port has no task that anybody misses.
        if BYTES == PIECE_BYTES {
            let _ = provoke::here(Task::Reception);
        }
        poll_fn(|context| {
            inbox.waker.register(context.waker());
            if inbox.due.load(Ordering::Acquire) > 0 {
                return Poll::Pending;
            }
            critical_section::with(|cs| {
                let mut received = inbox.received.borrow_ref_mut(cs);
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
        if provoke::here(Task::Downlink) {
            pending::<()>().await;
        }
        send(pac::USART2, bytes, self.baud).await;
    }

    fn set_baud(&mut self, baud: u32) {
        self.baud = u64::from(baud.max(1));
    }
}

impl Transmit for AutopilotTx {
    async fn transmit(&mut self, bytes: &[u8]) {
        send(pac::USART1, bytes, self.baud).await;
    }

    fn set_baud(&mut self, baud: u32) {
        self.baud = u64::from(baud.max(1));
    }
}

async fn send(port: pac::usart::Usart, bytes: &[u8], baud: u64) {
    for &byte in bytes {
        // The emulated port takes a byte at once; there is no TXE to wait for.
        port.dr().write(|w| w.set_dr(u16::from(byte)));
    }
    Timer::after_micros(bytes.len() as u64 * BITS_A_BYTE * 1_000_000 / baud).await;
}
