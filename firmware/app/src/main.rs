//! probe
#![no_std]
#![no_main]

mod boards;
use boards::{board, Receive, Transmit};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m_rt::entry;
use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_time::{Duration, Ticker};

pub(crate) static COUNT: AtomicU32 = AtomicU32::new(0);
pub(crate) static TICKS: AtomicU32 = AtomicU32::new(0);
static RECEPTION: InterruptExecutor = InterruptExecutor::new();
static MONITOR: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn CAN1_TX() { unsafe { RECEPTION.on_interrupt() } }
#[interrupt]
unsafe fn CAN1_RX0() { unsafe { MONITOR.on_interrupt() } }

#[embassy_executor::task]
async fn reception(mut rx: board::AutopilotRx, mut tx: board::GsTx) {
    let mut b = [0; 2048];
    loop {
        let n = rx.receive(&mut b).await.unwrap_or(0);
        COUNT.fetch_add(n as u32, Ordering::Relaxed);
        if n == 3 { tx.transmit(&b[..n]).await; }
    }
}
#[embassy_executor::task]
async fn monitor() {
    let mut t = Ticker::every(Duration::from_millis(50));
    loop { t.next().await; TICKS.fetch_add(1, Ordering::Relaxed); }
}

#[entry]
fn main() -> ! {
    let mut parts = board::take();
    interrupt::USART1.set_priority(Priority::P1);
    unsafe { cortex_m::peripheral::NVIC::unmask(interrupt::USART1) };
    interrupt::CAN1_TX.set_priority(Priority::P3);
    interrupt::CAN1_RX0.set_priority(Priority::P5);
    RECEPTION.start(interrupt::CAN1_TX).spawn(reception(parts.autopilot, parts.gs).unwrap());
    MONITOR.start(interrupt::CAN1_RX0).spawn(monitor().unwrap());
    parts.idle.run()
}
#[defmt::global_logger]
struct L;
unsafe impl defmt::Logger for L {
    fn acquire() {}
    unsafe fn flush() {}
    unsafe fn release() {}
    unsafe fn write(_: &[u8]) {}
}
#[panic_handler]
fn panic(i: &core::panic::PanicInfo) -> ! { semihosting::println!("{i}"); semihosting::process::exit(9) }
