//! The bench check: the state of the box, and both ends of its present log.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use hums_analysis::log_json::duration_s;
use hums_boards::Board;
use hums_core::observation::Autopilot;
use hums_link::asking::wanted;
use hums_link::mav_cmd::RUN_PREARM_CHECKS;
use hums_link::messages;
use hums_link::packet::Fields;

use super::{ARDUPILOT, BoxSettings, CheckLine, HeardAutopilot, PX4, TRIES, line};
use crate::mavlink::ids::{
    ATTITUDE, BATTERY_STATUS, EKF_STATUS_REPORT, ESTIMATOR_STATUS, GLOBAL_POSITION_INT, GPS_RAW_INT,
    HEARTBEAT, STATUSTEXT, SYS_STATUS, SYSTEM_TIME, VFR_HUD, VIBRATION,
};
use crate::names::message_name;
use crate::plural::count;
use crate::summary::Overview;
use crate::talk::{Client, pull};
use crate::utc::date_and_time;

const ANSWER: Duration = Duration::from_secs(3);
const HEAD_SECTORS: u32 = 8;
/// The checks of every vehicle need them; of the last two one autopilot has one.
const NEEDED: [u32; 10] = [
    SYS_STATUS,
    ATTITUDE,
    GLOBAL_POSITION_INT,
    GPS_RAW_INT,
    BATTERY_STATUS,
    VFR_HUD,
    VIBRATION,
    SYSTEM_TIME,
    ESTIMATOR_STATUS,
    EKF_STATUS_REPORT,
];
/// A message is slow below this part of its rate. An ArduPilot that only knows `REQUEST_DATA_STREAM` sends 2 Hz of 5.
const SLOW: f64 = 0.35;

pub(super) fn own(own: &BoxSettings, link: &str) -> CheckLine {
    let path = match own.path {
        1 => "its own radio port (GS_PATH 2 if no radio is there)",
        2 => "the autopilot's radio",
        _ => "nobody: GS_PATH is 0",
    };
    let streams = if own.has_streams { "requests its streams" } else { "requests no streams" };
    let detail =
        format!("reached over {link}; {} baud to the autopilot, {streams}, texts to {path}", own.baud);
    line("box", own.path > 0, detail)
}

/// The box's answer to the command for the checks before arming.
pub(super) fn prearm(client: &mut Client) -> Result<CheckLine> {
    const READY: &str = "HUMS: ready";
    let (system, component) = client.target();
    let packet = messages::command_long(RUN_PREARM_CHECKS, &[], system, component);
    let text = client.ask(&packet, ANSWER, TRIES, |frame| {
        let text = Fields(frame.payload()).text(1, 50).filter(|_| frame.id() == STATUSTEXT)?;
        (text.starts_with(READY) || text.starts_with("HUMS: not ready")).then(|| text.to_owned())
    })?;
    let text = text.unwrap_or_else(|| "no answer".to_owned());
    Ok(line("checks", text.starts_with(READY), text.trim_start_matches("HUMS: ")))
}

/// Takes the image's `board` if none is known.
pub(super) fn recorded(
    client: Client,
    own: &BoxSettings,
    board: &mut Option<&'static Board>,
    heard: Option<HeardAutopilot>,
) -> Result<Vec<CheckLine>> {
    let checks = pull::newest(client, HEAD_SECTORS, |newest| {
        let (end, mut boot) = (Overview::verified(&newest.end)?, None);
        if !newest.begin.pieces.is_empty() {
            boot = Overview::verified(&newest.begin)?.contents.boot;
        }
        let mut checks = Vec::new();
        if let Some(boot) = boot.or_else(|| end.contents.boot.clone()) {
            let is_it = board.is_none_or(|board| board.name == boot.board);
            *board = board.or_else(|| hums_boards::find(&boot.board).ok());
            checks.push(line("image", is_it, format!("{} {} for {}", boot.version, boot.git, boot.board)));
        }
        let lost = end.contents.stats.map_or(0, |stats| stats.frames_lost);
        let words = match (newest.is_growing, lost) {
            (false, _) => "the newest log does not grow: the box does not record".to_owned(),
            (true, 0) => "it records".to_owned(),
            (true, lost) => format!("it records, and has lost {}", count(lost, "frame")),
        };
        checks.push(line("card", newest.is_growing && lost == 0, words));
        let autopilot = end.contents.vehicle.map(|vehicle| vehicle.autopilot);
        let autopilot = autopilot.or(heard.map(|heard| heard.autopilot));
        checks.extend([clock(&end), received(&end, own, autopilot)]);
        Ok(checks)
    })?;
    Ok(checks.unwrap_or_else(|| vec![line("card", false, "no log on it: is a card in the slot?")]))
}

fn clock(end: &Overview) -> CheckLine {
    let last = end.ending.summary.last;
    let Some(utc_us) =
        last.zip(end.ending.summary.epoch_us).map(|(last, epoch)| epoch.saturating_add(last.as_micros()))
    else {
        return line("clock", false, "no UTC from the autopilot: it needs GPS time, or a ground station");
    };
    let here_us = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_micros() as u64;
    let apart_s = here_us.abs_diff(utc_us) / 1_000_000;
    let utc = format!("{} UTC", date_and_time(utc_us));
    if apart_s <= 60 {
        return line("clock", true, utc);
    }
    let detail = format!("{utc}, {apart_s} s from this computer's clock: one of them is wrong");
    CheckLine { check: "clock", state: "unknown", detail }
}

/// Messages and rates at the box's port.
fn received(end: &Overview, own: &BoxSettings, autopilot: Option<u8>) -> CheckLine {
    let autopilot = match autopilot {
        Some(ARDUPILOT) => Autopilot::ArduPilot,
        Some(PX4) => Autopilot::Px4,
        _ => Autopilot::Other,
    };
    let seconds = duration_s(end);
    let rate = |id: u32| {
        let its = |message: &&crate::source::item::MessageCount| message.id.is_some_and(|(of, _)| of == id);
        let frames = end.contents.messages.iter().find(its).map_or(0, |message| message.amount.count);
        if seconds > 0.0 { frames as f64 / seconds } else { 0.0 }
    };
    if rate(HEARTBEAT) <= 0.0 {
        return line(
            "messages",
            false,
            "the box does not hear the autopilot: check its TX wire and the rate",
        );
    }
    let (mut bad, mut all, mut other) = (Vec::new(), 0_u64, 0_u64);
    for (id, wanted_hz) in wanted(autopilot, own.baud) {
        let (hz, wanted_hz) = (rate(id), f64::from(wanted_hz));
        let is_slow = hz < wanted_hz * SLOW;
        if NEEDED.contains(&id) {
            all += 1;
            if is_slow {
                bad.push(format!("{} {hz:.1} of {wanted_hz:.1} Hz", message_name(id)));
            }
        } else {
            other += u64::from(!is_slow);
        }
    }
    let words = if bad.is_empty() {
        format!(
            "{} at their rates, and {other} for parts that not every vehicle has",
            count(all, "needed message")
        )
    } else if own.has_streams {
        format!("{}; connect the autopilot's RX, over which the box requests them", bad.join(", "))
    } else {
        format!("{}; AP_STREAMS 1 has the box request them", bad.join(", "))
    };
    line("messages", bad.is_empty(), words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::item::{Amount, MessageCount};

    const OWN: BoxSettings = BoxSettings { baud: 57_600, path: 2, has_streams: false };

    #[test]
    fn the_messages_that_a_box_lacks_are_named_with_their_rates() {
        let mut end = Overview::default();
        let received = |end: &Overview, own: &BoxSettings| received(end, own, Some(ARDUPILOT));
        assert!(received(&end, &OWN).detail.contains("does not hear"));
        let instant = |s: u64| hums_core::clock::Instant::from_millis(s * 1_000);
        (end.ending.summary.first, end.ending.summary.last) = (Some(instant(100)), Some(instant(110)));
        let own = BoxSettings { baud: 921_600, ..OWN };
        end.contents.messages = [&NEEDED[..], &[HEARTBEAT]]
            .concat()
            .into_iter()
            .map(|id| MessageCount {
                id: Some((id, true)),
                name: String::new(),
                amount: Amount { count: if id == ATTITUDE { 30 } else { 19 }, bytes: 0 },
            })
            .collect();
        let told = received(&end, &own);
        assert!(told.detail.starts_with("ATTITUDE 3.0 of 10.0 Hz; AP_STREAMS 1"), "{}", told.detail);
        // A slow line carries less.
        assert_eq!(received(&end, &OWN).state, "ok");
        assert_eq!(clock(&end).state, "missing");
        end.ending.summary.epoch_us = Some(1_700_000_000_000_000);
        assert_eq!(clock(&end).state, "unknown");
    }
}
