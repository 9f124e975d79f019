//! Reception: the autopilot's bytes to frames. The most urgent task, because bytes wait nowhere but in the port's ring.

use embassy_time::with_timeout;
use hums_onboard::Task;
use hums_onboard::queues::FramesIn;
use hums_onboard::reception::{Reception, SILENCE};

use crate::boards::board;
use crate::boards::machine::FETCH_BYTES;
use crate::costs::{Stage, measure};
use crate::links::{self, now};
use crate::status::{PORT_STATUS, SUPERVISOR};

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::PortRx, mut frames: FramesIn<'static>) -> ! {
    let mut body = Reception::new(&PORT_STATUS);
    let mut bytes = [0; FETCH_BYTES];
    loop {
        SUPERVISOR.report(Task::Reception, now());
        match with_timeout(links::wait(SILENCE), port.receive(&mut bytes)).await {
            Ok(Ok(count)) => {
                let bytes = bytes.get(..count).unwrap_or_default();
                measure(Stage::Framer, || body.bytes(now(), bytes, &mut frames));
            }
            Ok(Err(overrun)) => PORT_STATUS.count_overrun(overrun.blind_ms),
            Err(_silence) => body.idle(now(), &mut frames),
        }
        links::FRAMES.signal(());
    }
}
