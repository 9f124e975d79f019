//! Monitor: frames to records, findings and the summary. It also feeds the watchdog, because it always runs every 50 ms, and
//! drives the LED.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_futures::select::{Either3, select3};
use embassy_time::{Duration, Ticker, Timer};
use hums_core::clock::Span;
use hums_onboard::monitoring::{Machine, Monitoring, Step, TICK};
use hums_onboard::queues::{FramesOut, UplinkOut};
use hums_onboard::update::UpdateWatch;
use hums_onboard::{Handover, ResetCause, Task};
use hums_recorder::CardState;
use hums_update::message::Message;

use super::downlink::{AUTOPILOT_STOOD_STILL, BAUD_AUTOPILOT, BAUD_GS, GS_STOOD_STILL};
use crate::boards::board;
use crate::boards::machine::Boot;
use crate::card_reader;
use crate::costs::{self, Stage, measure};
use crate::fault::{self, Fault};
use crate::links::{self, now};
use crate::log::log;
use crate::memory;
use crate::status::{CARD_STATUS, LOG_ENDED, LOG_ENDS, PORT_STATUS, STORE_STATUS, SUPERVISOR, UPDATE_STATUS};
use crate::watch;

/// Ticks of one half of the LED's blinking while the card records: 0.5 s.
const BLINK_RECORDING: u32 = 10;
/// Blinks while nothing is recorded: 0.1 s.
const BLINK_TROUBLE: u32 = 2;

/// Longest time from the end of the record to the restart in card-reader mode. A card may stall for 2.5 s.
const END_MAX: Span = Span::from_secs(5);

/// Frames in a row before other tasks run: some 10 ms of work.
const DRAINED_MAX: usize = 64;
/// That turn.
const REST: Duration = Duration::from_millis(1);

#[embassy_executor::task]
pub(crate) async fn run(
    body: &'static mut Monitoring<'static>,
    mut frames: FramesOut<'static>,
    mut requests: UplinkOut<'static>,
    handover: &'static mut Handover<'static>,
    boot: Boot,
    message: Option<Message>,
    mut led: board::Led,
) -> ! {
    body.start(now());
    tell_fault(body, boot.cause);
    let mut told = [false; 6];
    let mut update = UpdateWatch::new(message, boot.cause);
    wake_others();
    let mut ticker = Ticker::every(links::wait(TICK));
    let mut ticks: u32 = 0;
    let mut load = costs::Load::new();
    loop {
        SUPERVISOR.report(Task::Monitor, now());
        let mut is_behind = false;
        // The tick first: if frames arrive faster than they are processed, they are always due.
        match select3(ticker.next(), links::FRAMES.wait(), links::UPLINK.wait()).await {
            Either3::Second(()) => is_behind = drain(body, &mut frames),
            Either3::Third(()) => uplink(body, &mut requests),
            Either3::First(()) => {
                is_behind = drain(body, &mut frames);
                if let Some((cpu_permille, cpu_permille_max)) = load.step(now()) {
                    let (stack_bytes_max, stack_bytes) = memory::stack_used();
                    let (stack_bytes_max, stack_bytes) = (stack_bytes_max as u32, stack_bytes as u32);
                    body.set_machine(Machine {
                        cpu_permille,
                        cpu_permille_max,
                        stack_bytes_max,
                        stack_bytes,
                    });
                }
                tick(body, handover);
                if body.wants_card_reader(now()) {
                    leave(body, handover, card_reader::restart).await;
                }
                if watch_update(body, &mut update) {
                    leave(body, handover, || crate::update::restart(Message::Install)).await;
                }
                tell_board(body, &mut told, boot.entropy.is_some());
                ticks = ticks.wrapping_add(1);
                led.set(lit(ticks, update.is_refused()));
                fault::tick(now());
                let silent = SUPERVISOR.silent(now());
                fault::silent(silent);
                // Otherwise the watchdog resets the machine.
                if silent.is_none() {
                    board::feed_watchdog();
                    watch::fed();
                }
            }
        }
        wake_others();
        if is_behind {
            // Frames that overflow the queue meanwhile are lost and counted.
            links::FRAMES.signal(());
            Timer::after(REST).await;
        }
    }
}

/// Ends the log, saves what the store keeps, and restarts with `restart`. A card that does not take the end in time is left
/// as at a power cut.
async fn leave(body: &mut Monitoring<'static>, handover: &mut Handover<'static>, restart: fn() -> !) -> ! {
    finish(body);
    let end = now() + END_MAX;
    while now() < end {
        let is_saved = save(body, handover);
        if is_saved && LOG_ENDED.load(Ordering::Relaxed) {
            break;
        }
        board::feed_watchdog();
        watch::fed();
        wake_others();
        Timer::after(links::wait(TICK)).await;
    }
    restart()
}

#[inline(never)]
fn finish(body: &mut Monitoring<'static>) {
    body.finish(now());
    LOG_ENDS.store(true, Ordering::Release);
}

#[inline(never)]
fn save(body: &mut Monitoring<'static>, handover: &mut Handover<'static>) -> bool {
    // The handover last: it looks at the mailbox of both.
    let is_signing_handed = body.save_signing(now(), handover);
    handover.finish(now(), body.monitor_mut()) && is_signing_handed
}

/// The previous start's end, for record and ground station.
// Own stack frame (ARCHITECTURE.md, Memory).
#[inline(never)]
fn tell_fault(body: &mut Monitoring<'static>, cause: ResetCause) {
    let noted = fault::take();
    fault::begin(false);
    let unnoted = noted.is_none() && cause == ResetCause::Watchdog;
    if let Some(fault) = noted.or_else(|| unnoted.then(Fault::without_note)) {
        body.fault(now(), &fault.record(), fault.last_messages());
    }
}

#[inline(never)]
fn tell_board(body: &mut Monitoring<'static>, told: &mut [bool; 6], has_random: bool) {
    let stood_still = |port: &AtomicBool| port.load(Ordering::Relaxed);
    let faults = [
        (board::chip_is_wrong(), 2, "HUMS: wrong chip, it needs an STM32F405"),
        (board::crystal_is_wrong(), 4, "HUMS: wrong crystal, load this board's firmware"),
        (
            board::crystal_failed() && !board::crystal_is_wrong(),
            4,
            "HUMS: crystal failed, times may be off by 4 %",
        ),
        (stood_still(&AUTOPILOT_STOOD_STILL), 4, "HUMS: sending to the autopilot stands still"),
        (stood_still(&GS_STOOD_STILL), 4, "HUMS: sending to the radio stands still"),
        (!has_random, 5, "HUMS: no random numbers, starts are counted"),
    ];
    for ((is_so, severity, text), told) in faults.into_iter().zip(told) {
        if is_so && !core::mem::replace(told, true) {
            body.note(now(), severity, text);
        }
    }
}

// Own stack frame (ARCHITECTURE.md, Memory). As all that follow.

#[inline(never)]
fn drain(body: &mut Monitoring<'static>, frames: &mut FramesOut<'static>) -> bool {
    let mut begin = |step| {
        costs::enter(match step {
            Step::Encode { at, id } => {
                fault::seen(at, id);
                Stage::Encode
            }
            Step::Observe => Stage::Observe,
            Step::Summary => Stage::Summary,
        });
    };
    let mut drain = || measure(Stage::Monitor, || body.drain_in_steps(frames, &mut begin));
    (0..DRAINED_MAX).all(|_| drain())
}

#[inline(never)]
fn uplink(body: &mut Monitoring<'static>, uplink: &mut UplinkOut<'static>) {
    while measure(Stage::Monitor, || body.uplink(now(), uplink)) {}
}

#[inline(never)]
fn note(body: &mut Monitoring<'static>, handover: &mut Handover<'static>) {
    while let Some(news) = handover.news() {
        log!(info, "{=str}", news.text);
        body.note(now(), news.severity, news.text);
    }
}

#[inline(never)]
fn tick(body: &mut Monitoring<'static>, handover: &mut Handover<'static>) {
    let (gs, autopilot) = body.bauds();
    BAUD_GS.store(gs, Ordering::Relaxed);
    BAUD_AUTOPILOT.store(autopilot, Ordering::Relaxed);
    measure(Stage::Tick, || {
        body.tick(now(), &mut |finding| {
            log!(
                info,
                "{=str} {=str} {=str} {=f32} {=str}",
                finding.subsystem.name(),
                finding.check,
                finding.level.name(),
                finding.value,
                finding.unit
            );
        });
        hand_over(body, handover);
    });
    note(body, handover);
}

#[inline(never)]
fn watch_update(body: &mut Monitoring<'static>, update: &mut UpdateWatch) -> bool {
    if let Some((severity, text)) = update.news(&UPDATE_STATUS) {
        body.note(now(), severity, text);
    }
    let (calm, frames) = (STORE_STATUS.read().calm, PORT_STATUS.read().frames);
    let is_due = update.is_due(now(), &UPDATE_STATUS, calm, frames, crate::update::is_on_trial());
    if is_due {
        body.note(now(), 5, "HUMS: update begins, nothing is recorded");
    }
    is_due
}

#[inline(never)]
fn hand_over(body: &mut Monitoring<'static>, handover: &mut Handover<'static>) {
    handover.step(now(), body.monitor_mut(), PORT_STATUS.read().frames);
    body.save_signing(now(), handover);
}

fn wake_others() {
    links::GS.signal(());
    links::AUTOPILOT.signal(());
    links::SECTORS.signal(());
}

/// Slow blinking: recording. Two short flashes a second: recording with a fault of the board; three: an update is refused. Fast: no
/// usable card.
fn lit(ticks: u32, is_refused: bool) -> bool {
    let half = match CARD_STATUS.read().state {
        CardState::Recording if board::crystal_failed() || board::chip_is_wrong() => {
            return matches!(ticks % (2 * BLINK_RECORDING) / BLINK_TROUBLE, 0 | 2);
        }
        CardState::Recording if is_refused => {
            return matches!(ticks % (2 * BLINK_RECORDING) / BLINK_TROUBLE, 0 | 2 | 4);
        }
        CardState::Recording => BLINK_RECORDING,
        _ => BLINK_TROUBLE,
    };
    (ticks / half).is_multiple_of(2)
}
