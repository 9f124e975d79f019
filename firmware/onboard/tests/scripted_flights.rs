//! Scripted flights of `tests/monitor`, judged as its README describes.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use flate2::read::GzDecoder;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::happening::Happening;
use hums_core::health::{Finding, Level};
use hums_core::parameters::Params;
use hums_core::protect::{Request, Stage};
use hums_core::status::{RecorderStatus, Recording};
use hums_link::frame::Frame;
use hums_link::sequence::Sequences;
use hums_onboard::monitoring::TICK;

/// `MAV_CMD_NAV_RETURN_TO_LAUNCH`
const RETURN: Request = Request { command: 20, confirmation: 0 };

struct Outcome {
    findings: Vec<(f32, Finding)>,
    happenings: Vec<(f32, Happening)>,
    requests: Vec<(f32, Request)>,
    monitor: Box<Monitor>,
    end: Instant,
}

impl Outcome {
    fn reported_s(&self, check: &str, from_s: f32) -> Option<f32> {
        let is_alarm = |finding: &Finding| {
            finding.check == check
                && finding.because.is_empty()
                && matches!(finding.level, Level::Warning | Level::Critical)
        };
        self.findings
            .iter()
            .find(|(at_s, finding)| *at_s >= from_s && is_alarm(finding))
            .map(|(at_s, _)| *at_s)
    }

    /// First time.
    fn changed_s(&self, check: &str, level: Level) -> Option<f32> {
        let mut of_check = self.findings.iter().filter(|(_, finding)| finding.check == check);
        of_check.find(|(_, finding)| finding.level == level).map(|(at_s, _)| *at_s)
    }

    fn reports(&self, check: &str, from_s: f32, until_s: f32) -> bool {
        self.reported_s(check, from_s).is_some_and(|at_s| at_s <= until_s)
    }

    fn requests_return(&self, from_s: f32, until_s: f32) -> bool {
        matches!(self.requests.first(), Some((at_s, RETURN)) if (from_s..until_s).contains(at_s))
    }

    fn count(&self, happening: Happening) -> usize {
        self.happenings.iter().filter(|(_, happened)| *happened == happening).count()
    }

    fn is_one_flight(&self) -> bool {
        let begun = self.count(Happening::TakeOff) + self.count(Happening::FlightResumed);
        begun == 1 && self.count(Happening::Landing) == 0 && self.monitor.flight().airborne()
    }

    fn announcements(&self) -> usize {
        let announced = |happening: &Happening| matches!(happening, Happening::Protect(step) if step.stage == Stage::Announced);
        self.happenings.iter().filter(|(_, happening)| announced(happening)).count()
    }

    fn exceeded_s(&self, check: &str) -> f32 {
        let of_check = self.monitor.exceedances().iter(self.end.into()).filter(|it| it.check.name == check);
        of_check.map(|it| (it.session.warning_tenths + it.session.critical_tenths) as f32 / 10.0).sum()
    }
}

fn frames(tlog: &[u8]) -> Vec<(u64, &[u8])> {
    let (mut frames, mut rest) = (Vec::new(), tlog);
    while let Some((time, tail)) = rest.split_first_chunk::<8>() {
        let len = match *tail {
            [0xfe, len, ..] => usize::from(len) + 8,
            [0xfd, len, ..] => usize::from(len) + 12,
            _ => panic!("no frame"),
        };
        let (frame, tail) = tail.split_at(len);
        frames.push((u64::from_be_bytes(*time), frame));
        rest = tail;
    }
    let start = frames[0].0;
    frames.iter().map(|(at, frame)| (at - start, *frame)).collect()
}

fn fly(name: &str) -> Outcome {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../tests/monitor/{name}.tlog.gz"));
    let mut tlog = Vec::new();
    GzDecoder::new(File::open(path).unwrap()).read_to_end(&mut tlog).unwrap();
    let mut params = Params::defaults();
    params.set("PROT_ACTION", 1.0).unwrap();
    let mut monitor = Box::new(Monitor::new(params));
    let recorder =
        RecorderStatus { recording: Recording::Running, room: Some(0.9), ..RecorderStatus::default() };
    let mut sequences = Sequences::new();
    let (mut findings, mut happenings, mut requests) = (Vec::new(), Vec::new(), Vec::new());
    let mut tick_at = Instant::ZERO + TICK;
    for (micros, bytes) in frames(&tlog) {
        let at = Instant::from_micros(micros);
        while tick_at <= at {
            let at_s = tick_at.as_micros() as f32 / 1e6;
            let link = sequences.reading(tick_at, monitor.vehicle().source);
            monitor.tick(tick_at.into(), &link, &recorder, &mut |finding| findings.push((at_s, *finding)));
            happenings.extend(core::iter::from_fn(|| monitor.take_happening()).map(|it| (at_s, it)));
            requests.extend(monitor.take_request().map(|it| (at_s, it)));
            tick_at = tick_at + TICK;
        }
        let frame = Frame::parse(bytes).unwrap();
        sequences.frame(at, &frame);
        if let Some((source, observation)) = hums_link::observe(&frame) {
            monitor.observe(at.into(), source, &observation);
        }
    }
    Outcome { findings, happenings, requests, monitor, end: tick_at }
}

fn is_right(name: &str, it: &Outcome) -> bool {
    match name {
        "d1_ok" | "d1_one" | "d1_all" => {
            it.reports("roll", 200.0, 208.0) && it.reports("autopilot_state", 200.0, 215.0)
        }
        "d2_a" => it.requests_return(72.0, 75.0),
        "d2_b" => it.requests_return(72.0, 80.0),
        "d2_c" => it.requests_return(70.0, 90.0),
        "d2_d" => it.announcements() == 2 && it.requests_return(72.0, 85.0),
        "d2_e" => it.requests_return(72.0, 90.0) && it.is_one_flight(),
        "d3_a" => it.is_one_flight() && it.requests_return(80.0, 110.0),
        "d3_b" | "d3_c" => it.is_one_flight() && it.requests_return(100.0, 120.0),
        "d3_d" => it.is_one_flight() && it.reported_s("baro_stuck", 0.0).is_some(),
        "d3_e" => it.is_one_flight() && it.reported_s("baro_stuck", 0.0).is_none(),
        "d4_a" => {
            it.reports("ekf_variance", 200.0, 215.0)
                && it.changed_s("accel_mismatch", Level::Stale).is_some_and(|at_s| at_s < 80.0)
        }
        "d4_b" => it.reports("ekf_variance", 200.0, 215.0),
        // The temperature of an ESC is stale after 12 s.
        "d4_e" => it.changed_s("esc_temperature", Level::Stale).is_some_and(|at_s| at_s < 43.0),
        // docs/health.md: an alarm that outlives its cause is reported 7 to 15 s after the cause's end.
        "d6_0" => it
            .changed_s("gps_fix", Level::Ok)
            .is_some_and(|at_s| it.reports("ekf_variance", at_s + 7.0, at_s + 15.0)),
        "d7" => (20.0..36.0).contains(&it.exceeded_s("heartbeat")),
        "d8" => it.reported_s("esc_failure", 0.0).is_none(),
        _ => panic!("{name}: the README says nothing of it"),
    }
}

#[test]
fn each_flight_is_judged_as_its_readme_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/monitor");
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().to_str()?.strip_suffix(".tlog.gz").map(str::to_owned))
        .collect();
    names.sort();
    assert!(names.len() >= 19);
    let shown = std::env::var("SCRIPTED_FLIGHT").ok();
    let mut wrong = Vec::new();
    for name in names {
        let outcome = fly(&name);
        if shown.as_ref() == Some(&name) {
            outcome.findings.iter().for_each(|it| println!("{it:?}"));
            outcome.happenings.iter().for_each(|it| println!("{it:?}"));
            outcome.requests.iter().for_each(|it| println!("{it:?}"));
        }
        if !is_right(&name, &outcome) {
            wrong.push(name);
        }
    }
    assert!(wrong.is_empty(), "judged wrongly: {wrong:?}");
}
