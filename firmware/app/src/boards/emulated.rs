//! QEMU's `netduinoplus2`: the same chip, without what QEMU does not model (clocks, GPIO, DMA, watchdog, SPI card).
//! So `embassy_stm32::init` is never called here; the USARTs are driven by their registers.
//!
//! Time is virtual (`clock`): idle moves it, to the next alarm or to the next arrival of the feed, whichever is
//! earlier, alarms first where both fall together. No task ever waits for the host, so runs repeat to the byte.

mod card;
mod clock;
mod feed;
mod uart;

use heapless::CString;
use semihosting::experimental::env;
use semihosting::fs::File;
use semihosting::{println, process};

pub(crate) use card::ImageCard as Card;
use feed::Feed;
pub(crate) use uart::{AutopilotRx, GsTx};

pub(crate) struct Parts {
    pub(crate) autopilot: AutopilotRx,
    pub(crate) gs: GsTx,
    pub(crate) card: Card,
    pub(crate) idle: Idle,
}

pub(crate) struct Idle { feed: Option<Feed> }

pub(crate) fn take() -> Parts {
    let mut feed = None;
    let mut image = None;
    if let Ok(args) = env::args::<1024>() {
        for arg in &args {
            let Ok(arg) = arg else { continue };
            let Some((key, value)) = arg.split_once('=') else { continue };
            let mut path = CString::<512>::new();
            if path.extend_from_bytes(value.as_bytes()).is_err() { continue }
            match key {
                "feed" => feed = Some(path),
                "sd" => image = File::options().read(true).write(true).open(path.as_c_str()).ok(),
                _ => {}
            }
        }
    }
    let (autopilot, gs) = uart::init();
    println!("ready");
    let feed = feed.and_then(|p| File::open(p.as_c_str()).ok()).map(Feed::new);
    Parts { autopilot, gs, card: Card::new(image), idle: Idle { feed } }
}

impl Idle {
    pub(crate) fn run(&mut self) -> ! {
        let mut max = 0u64;
        loop {
            let alarm = clock::next_alarm();
            match self.feed.as_mut().and_then(Feed::peek) {
                Some(arrival) if arrival.time_us < alarm => {
                    clock::advance(arrival.time_us);
                    let mut left = arrival.bytes;
                    while left > 0 {
                        let n = left.min(uart::RX_BYTES as u32);
                        uart::receive_exactly(n);
                        left -= n;
                    }
                    max = arrival.time_us;
                    self.feed.as_mut().unwrap().take();
                }
                Some(_) => clock::advance(alarm),
                None => {
                    println!("{{\"end_us\":{max},\"count\":{}}}", crate::COUNT.load(core::sync::atomic::Ordering::Relaxed));
                    process::exit(0);
                }
            }
        }
    }
}
