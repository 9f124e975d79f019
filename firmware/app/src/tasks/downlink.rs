//! Downlink and requests: the frames for the ground station and for the autopilot out of their ports, one after the
//! other.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_time::{Duration, with_timeout};
use hums_onboard::Task;
use hums_onboard::queues::{AutopilotOut, GsOut};

use crate::boards::board;
use crate::links::{self, now};
use crate::status::SUPERVISOR;

/// How often it reports in while there is nothing to send.
const REPORT: Duration = Duration::from_millis(500);
/// How long a frame may take: the longest has 73 ms at 38,400 baud. What takes longer does not come to an end; within the second that
/// the supervisor allows.
const SEND_MAX: Duration = Duration::from_millis(500);

/// Baud rates of the ports as the parameters want them; 0: as the board began.
pub(crate) static BAUD_GS: AtomicU32 = AtomicU32::new(0);
pub(crate) static BAUD_AUTOPILOT: AtomicU32 = AtomicU32::new(0);

/// A transmission did not come to its end since the start.
pub(crate) static GS_STOOD_STILL: AtomicBool = AtomicBool::new(false);
pub(crate) static AUTOPILOT_STOOD_STILL: AtomicBool = AtomicBool::new(false);

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::PortTx, mut queue: GsOut<'static>) -> ! {
    loop {
        SUPERVISOR.report(Task::Downlink, now());
        set_baud(&mut port, &BAUD_GS).await;
        if !queue.lend(async |frame| send(&mut port, frame, &GS_STOOD_STILL).await).await {
            // Either way it looks into the queue.
            let _ = with_timeout(REPORT, links::GS.wait()).await;
        }
    }
}

/// To the autopilot.
#[embassy_executor::task]
pub(crate) async fn requests(mut port: board::PortTx, mut queue: AutopilotOut<'static>) -> ! {
    loop {
        set_baud(&mut port, &BAUD_AUTOPILOT).await;
        if !queue.lend(async |frame| send(&mut port, frame, &AUTOPILOT_STOOD_STILL).await).await {
            links::AUTOPILOT.wait().await;
        }
    }
}

/// Sends a frame; gives it up where the port does not take it in time.
async fn send(port: &mut board::PortTx, frame: &[u8], stood_still: &AtomicBool) {
    if with_timeout(SEND_MAX, port.transmit(frame)).await.is_err() {
        port.restart();
        stood_still.store(true, Ordering::Relaxed);
    }
}

async fn set_baud(port: &mut board::PortTx, wanted: &AtomicU32) {
    match wanted.load(Ordering::Relaxed) {
        0 => {}
        baud => port.set_baud(baud).await,
    }
}
