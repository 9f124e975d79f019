//! Downlink and requests: send the frames for the ground station and the autopilot to their ports, one by one.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_time::{Duration, with_timeout};
use hums_onboard::Task;
use hums_onboard::queues::{AutopilotOut, GsOut};

use crate::boards::board;
use crate::links::{self, now};
use crate::status::SUPERVISOR;

const REPORT: Duration = Duration::from_millis(500);
/// Timeout of a frame. The longest frame takes 73 ms at 38,400 baud; the supervisor allows 1 s.
const SEND_MAX: Duration = Duration::from_millis(500);

/// Baud rates set by the parameters; 0: the board's initial rate.
pub(crate) static BAUD_GS: AtomicU32 = AtomicU32::new(0);
pub(crate) static BAUD_AUTOPILOT: AtomicU32 = AtomicU32::new(0);

pub(crate) static GS_STOOD_STILL: AtomicBool = AtomicBool::new(false);
pub(crate) static AUTOPILOT_STOOD_STILL: AtomicBool = AtomicBool::new(false);

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::PortTx, mut queue: GsOut<'static>) -> ! {
    loop {
        SUPERVISOR.report(Task::Downlink, now());
        set_baud(&mut port, &BAUD_GS).await;
        if queue.lend(async |frame| send(&mut port, frame, &GS_STOOD_STILL).await).await.is_none() {
            let _ = with_timeout(REPORT, links::GS.wait()).await;
        }
    }
}

#[embassy_executor::task]
pub(crate) async fn requests(mut port: board::PortTx, mut queue: AutopilotOut<'static>) -> ! {
    loop {
        set_baud(&mut port, &BAUD_AUTOPILOT).await;
        if queue.lend(async |frame| send(&mut port, frame, &AUTOPILOT_STOOD_STILL).await).await.is_none() {
            links::AUTOPILOT.wait().await;
        }
    }
}

/// Whether the frame was sent in time.
async fn send(port: &mut board::PortTx, frame: &[u8], stood_still: &AtomicBool) -> bool {
    let is_sent = with_timeout(SEND_MAX, port.transmit(frame)).await.is_ok();
    if !is_sent {
        port.restart();
        stood_still.store(true, Ordering::Relaxed);
    }
    is_sent
}

async fn set_baud(port: &mut board::PortTx, wanted: &AtomicU32) {
    match wanted.load(Ordering::Relaxed) {
        0 => {}
        baud => port.set_baud(baud).await,
    }
}
