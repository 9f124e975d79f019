//! Downlink: the frames for the ground station out of the port, one after the other.

use embassy_time::{Duration, with_timeout};
use hums_onboard::Task;
use hums_onboard::queues::{GS_FRAME_BYTES_MAX, GsOut};

use super::SUPERVISOR;
use crate::boards::{Transmit, board};
use crate::links::{self, now};

/// How often it reports in while there is nothing to send.
const REPORT: Duration = Duration::from_millis(500);

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::GsTx, mut queue: GsOut<'static>) -> ! {
    let mut frame = [0; GS_FRAME_BYTES_MAX];
    loop {
        SUPERVISOR.report(Task::Downlink, now());
        if let Some(length) = queue.take(&mut frame) {
            port.transmit(frame.get(..length).unwrap_or_default()).await;
        } else {
            links::GS_EMPTY.signal(());
            // Either way it looks into the queue.
            let _ = with_timeout(REPORT, links::GS.wait()).await;
        }
    }
}
