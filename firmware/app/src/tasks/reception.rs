//! Reception: the autopilot's bytes to frames. The most urgent task, because bytes wait nowhere but in the port's ring.

use embassy_time::with_timeout;
use hums_onboard::Task;
use hums_onboard::queues::FramesIn;
use hums_onboard::reception::{Reception, SILENCE};

use crate::boards::board;
use crate::costs::{Stage, measure};
use crate::links::{self, now};
use crate::status::{PORT_STATUS, SUPERVISOR};

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::PortRx, mut frames: FramesIn<'static>) -> ! {
    let mut body = Reception::new(&PORT_STATUS);
    loop {
        SUPERVISOR.report(Task::Reception, now());
        match with_timeout(links::wait(SILENCE), port.receive(body.room())).await {
            Ok(Ok(count)) => {
                measure(Stage::Framer, || body.received(now(), count, &mut frames));
            }
            Ok(Err(overrun)) => PORT_STATUS.change(|port| {
                port.overrun += 1;
                port.blind_ms += u64::from(overrun.blind_ms);
            }),
            Err(_silence) => body.idle(now(), &mut frames),
        }
        links::FRAMES.signal(());
    }
}
