//! Downlink and requests: the frames for the ground station and for the autopilot out of their ports, one after the
//! other.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::{Duration, with_timeout};
use hums_onboard::Task;
use hums_onboard::queues::{AutopilotOut, FRAME_BYTES_MAX, GsOut};

use crate::boards::board;
use crate::boards::machine::Transmit;
use crate::links::{self, now};
use crate::status::SUPERVISOR;

/// How often it reports in while there is nothing to send.
const REPORT: Duration = Duration::from_millis(500);

/// Baud rates of the ports as the parameters want them; 0: as the board began.
pub(crate) static BAUD_GS: AtomicU32 = AtomicU32::new(0);
pub(crate) static BAUD_AUTOPILOT: AtomicU32 = AtomicU32::new(0);

#[embassy_executor::task]
pub(crate) async fn run(mut port: board::GsTx, mut queue: GsOut<'static>) -> ! {
    let mut frame = [0; FRAME_BYTES_MAX];
    loop {
        SUPERVISOR.report(Task::Downlink, now());
        set_baud(&mut port, &BAUD_GS);
        if let Some(length) = queue.take(&mut frame) {
            port.transmit(frame.get(..length).unwrap_or_default()).await;
        } else {
            links::GS_EMPTY.signal(());
            // Either way it looks into the queue.
            let _ = with_timeout(REPORT, links::GS.wait()).await;
        }
    }
}

/// To the autopilot.
#[embassy_executor::task]
pub(crate) async fn requests(mut port: board::AutopilotTx, mut queue: AutopilotOut<'static>) -> ! {
    let mut frame = [0; FRAME_BYTES_MAX];
    loop {
        set_baud(&mut port, &BAUD_AUTOPILOT);
        if let Some(length) = queue.take(&mut frame) {
            port.transmit(frame.get(..length).unwrap_or_default()).await;
        } else {
            links::AUTOPILOT.wait().await;
        }
    }
}

fn set_baud(port: &mut impl Transmit, wanted: &AtomicU32) {
    match wanted.load(Ordering::Relaxed) {
        0 => {}
        baud => port.set_baud(baud),
    }
}
