//! Uplink: the ground station's bytes to frames. They are untrusted; the monitor checks them.

use embassy_time::with_timeout;
use hums_onboard::queues::UplinkIn;
use hums_onboard::uplink::{Port, SILENCE, Uplink};

use crate::boards::board;
use crate::links;

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::PortRx, frames: &'static UplinkIn<'static>) -> ! {
    let mut body = Uplink::new(Port::Gs);
    let mut begun = false;
    loop {
        let received = if begun {
            with_timeout(links::wait(SILENCE), port.receive(body.room())).await
        } else {
            Ok(port.receive(body.room()).await)
        };
        begun = received.is_ok();
        match received {
            Ok(Ok(count)) => body.received(count, frames),
            // A checksum detects lost bytes, and the ground station repeats the message.
            Ok(Err(_overrun)) => {}
            Err(_silence) => body.idle(frames),
        }
        links::UPLINK.signal(());
    }
}
