//! The monitor as a companion: what it asks of the autopilot, and what it answers to those who ask.
//!
//! Part of the monitor task: a question comes as a frame, from the frame queue (the autopilot's port, which carries
//! ground stations' questions as well) or from the uplink queue (the ground station's own port), and is answered at the
//! port that it came from, within that port's budget. What is asked can change settings, stop the record and ask for
//! data, and nothing else; a flood of it is cut by [`Limiter`] and by the line of answers, which is short.

use core::fmt::Write as _;

use hums_blackbox::record::{Event, Parameter, Record};
use hums_core::Monitor;
use hums_core::health::Level;
use hums_core::params::{Param, Params, TABLE};
use hums_core::time::{Instant, Span};
use hums_link::asking::{Asking, Known};
use hums_link::encode::{Severity, Text};
use hums_link::frame::{Check, Frame};
use hums_link::messages;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::{Fields, Packet};
use hums_link::request::{self, Port, Replies, Reply, Request};
use hums_link::summary;

use crate::monitoring::{Identity, Monitoring};
use crate::queues::{GsIn, Path, SectorsIn, UplinkOut};

/// How often the autopilot hears of us: it routes only to those it has heard.
const HEARTBEAT: Span = Span::from_secs(1);
/// Settings and commands that a port may send at once, and how many more each second.
const REQUESTS_MAX: u32 = 20;
const REQUESTS_PER_S: u32 = 5;
/// Frames of the ground station that one tick looks at: a flood waits in its queue, and is lost there.
const FRAMES_A_TICK: u32 = 16;

/// `MAV_CMD`: `REQUEST_PROTOCOL_VERSION`, `REQUEST_AUTOPILOT_CAPABILITIES`, `REQUEST_MESSAGE`.
const CMD_PROTOCOL: u16 = 519;
const CMD_CAPABILITIES: u16 = 520;
const CMD_MESSAGE: u16 = 512;
/// `RUN_PREARM_CHECKS`: may it fly, as far as we know?
const CMD_PREFLIGHT: u16 = 401;
/// `LOGGING_START`, `LOGGING_STOP`
const CMD_RECORD: u16 = 2510;
const CMD_STOP: u16 = 2511;
/// `MAV_RESULT`
const ACCEPTED: u8 = 0;
const TEMPORARILY_REJECTED: u8 = 1;
const UNSUPPORTED: u8 = 3;
const FAILED: u8 = 4;

/// Number of the event that records a command.
const EVENT_COMMAND: u8 = 2;

/// So many at once, and so many a second.
#[derive(Clone, Copy, Debug)]
struct Limiter {
    left: u32,
    at: Instant,
}

impl Limiter {
    const fn new() -> Self {
        Self { left: REQUESTS_MAX, at: Instant::ZERO }
    }

    fn allows(&mut self, now: Instant) -> bool {
        let gained = now.since(self.at).as_millis() * u64::from(REQUESTS_PER_S) / 1_000;
        if gained > 0 {
            self.left = (u64::from(self.left) + gained).min(u64::from(REQUESTS_MAX)) as u32;
            self.at = now;
        }
        let allows = self.left > 0;
        self.left = self.left.saturating_sub(1);
        allows
    }
}

/// What the monitor task keeps for its conversations.
#[derive(Clone, Debug)]
pub(crate) struct Companion {
    /// The autopilot port's way out.
    outlet: Outlet,
    asking: Asking,
    replies: Replies,
    limits: [Limiter; 2],
    heartbeat_at: Option<Instant>,
    /// Somebody stopped the record.
    pub(crate) stopped: bool,
}

impl Companion {
    pub(crate) const fn new(params: &Params) -> Self {
        Self {
            outlet: Outlet::new(params.get(Param::ApBudget) as u32, params.get(Param::ApBaud) as u32),
            asking: Asking::new(),
            replies: Replies::new(),
            limits: [Limiter::new(); 2],
            heartbeat_at: None,
            stopped: false,
        }
    }
}

impl Monitoring<'_> {
    /// Takes one frame of the ground station from its queue; `false` when there is none.
    pub fn uplink(
        &mut self,
        now: Instant,
        uplink: &mut UplinkOut,
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
    ) -> bool {
        uplink.take(|_, verified, bytes| {
            // Where the autopilot carries our stream, the port is nobody's.
            if gs.path() == Path::Autopilot {
                return;
            }
            let check = if verified { Check::Verified } else { Check::Unverified };
            if let Some(frame) = Frame::again(bytes, check) {
                self.asked(now, Port::Gs, &frame, sectors);
            }
            self.answer(now, gs);
        })
    }

    /// Looks at a frame of the autopilot's port: an answer to us, a question, or what we need to know is there.
    pub(crate) fn heard(&mut self, now: Instant, frame: &Frame<'_>, sectors: &mut SectorsIn) {
        let vehicle = self.monitor.vehicle().source;
        if vehicle
            .is_some_and(|source| (source.system, source.component) == (frame.system(), frame.component()))
        {
            self.companion.asking.seen(frame.id());
            if frame.id() == 77 {
                let fields = Fields(frame.payload());
                let target = (fields.u8(8), fields.u8(9));
                if messages::concerns_us(target, self.companion.outlet.encoder.system()) {
                    self.companion.asking.answered(fields.u16(0), fields.u8(2));
                }
            }
        }
        self.asked(now, Port::Autopilot, frame, sectors);
    }

    fn asked(&mut self, now: Instant, port: Port, frame: &Frame<'_>, sectors: &mut SectorsIn) {
        let Some(asked) = request::read(frame) else { return };
        let system = self.companion.outlet.encoder.system();
        if !messages::concerns_us(asked.target, system) {
            return;
        }
        let by = (frame.system(), frame.component());
        let replies = &mut self.companion.replies;
        match asked.request {
            Request::ParamList => replies.list(port, TABLE.len() as u16),
            Request::ParamAt(index) if usize::from(index) < TABLE.len() => {
                replies.push(port, Reply::Param(index));
            }
            Request::ParamNamed(name) => {
                if let Some(index) = index_of(name) {
                    replies.push(port, Reply::Param(index));
                }
            }
            Request::ParamSet(name, value) => {
                let Some(index) = index_of(name) else { return };
                if self.companion.limits[port as usize].allows(now) {
                    // Refused or not, the answer is the value that counts now.
                    let _ = self.set_by_link(now, name, value, by, sectors);
                }
                self.companion.replies.push(port, Reply::Param(index));
            }
            // What is for all components of the vehicle is for the autopilot to answer, unless it is a question.
            Request::Command(command, params) if asked.target.1 != 0 || command == CMD_MESSAGE => {
                let broadcast = asked.target.1 == 0;
                let result = self.command(now, port, command, params, by, sectors);
                if !broadcast || result == ACCEPTED {
                    self.companion.replies.push(port, Reply::Ack(command, result, by));
                }
            }
            _ => {}
        }
    }

    /// Does what a command says; its `MAV_RESULT`.
    fn command(
        &mut self,
        now: Instant,
        port: Port,
        command: u16,
        params: [f32; 2],
        by: (u8, u8),
        sectors: &mut SectorsIn,
    ) -> u8 {
        let mut reply = |reply| {
            self.companion.replies.push(port, reply);
            ACCEPTED
        };
        match (command, params[0] as u32) {
            (CMD_CAPABILITIES, _) | (CMD_MESSAGE, 148) => reply(Reply::Version),
            (CMD_PROTOCOL, _) | (CMD_MESSAGE, 300) => reply(Reply::Protocol),
            (CMD_MESSAGE, 0) => reply(Reply::Heartbeat),
            (CMD_PREFLIGHT, _) => {
                reply(Reply::Preflight);
                if preflight(self.monitor).is_none() { ACCEPTED } else { FAILED }
            }
            (CMD_RECORD | CMD_STOP, _) => {
                if !self.companion.limits[port as usize].allows(now) {
                    return TEMPORARILY_REJECTED;
                }
                if command == CMD_STOP && self.monitor.vehicle().armed() {
                    return TEMPORARILY_REJECTED;
                }
                self.stop_or_record(now, command == CMD_STOP, port, by, sectors);
                ACCEPTED
            }
            _ => UNSUPPORTED,
        }
    }

    /// Never unnoticed: it is an event in the record, a text on the ground station, and a finding for as long as it
    /// lasts; and it ends when the vehicle is armed.
    fn stop_or_record(
        &mut self,
        now: Instant,
        stop: bool,
        port: Port,
        by: (u8, u8),
        sectors: &mut SectorsIn,
    ) {
        if self.companion.stopped == stop {
            return;
        }
        self.companion.stopped = stop;
        let mut text = Text::default();
        let what = if stop { "stopped" } else { "started" };
        // Fits: 50 characters.
        let _ = write!(text, "recording {what} by {}/{}", by.0, by.1);
        let event = Event { number: EVENT_COMMAND, text: text.as_str() };
        self.record(now, &Record::Event(event), sectors);
        if stop {
            self.companion.replies.push(port, Reply::Stopped);
        }
    }

    /// Sets a parameter because somebody on a port asked for it: recorded, and in force at once.
    fn set_by_link(
        &mut self,
        now: Instant,
        name: &str,
        value: f32,
        by: (u8, u8),
        sectors: &mut SectorsIn,
    ) -> bool {
        let before = index_of(name).and_then(|index| value_at(self.monitor.params(), index));
        if self.monitor.params_mut().set(name, value).is_err() {
            return false;
        }
        if before.map(f32::to_bits) != Some(value.to_bits()) {
            let parameter = Parameter { name, value: f64::from(value), changed: true, by };
            self.record(now, &Record::Parameter(parameter), sectors);
        }
        true
    }

    /// What time alone asks for, every tick: our heartbeat to the autopilot, what we ask of it, answers that wait.
    pub(crate) fn converse(&mut self, now: Instant, sectors: &mut SectorsIn, gs: &mut GsIn) {
        gs.set_path(match self.monitor.params().get(Param::GsPath) as u8 {
            0 => Path::Nobody,
            2 => Path::Autopilot,
            _ => Path::Port,
        });
        self.summary.forwards = gs.path() == Path::Port;
        if self.companion.stopped && self.monitor.vehicle().armed() {
            self.stop_or_record(now, false, Port::Gs, (0, 0), sectors);
        }
        let Self { companion, monitor, .. } = self;
        let Companion { outlet, asking, heartbeat_at, .. } = companion;
        let params = monitor.params();
        outlet.set(params.get(Param::ApBudget) as u32, params.get(Param::ApBaud) as u32);
        let mut out = |bytes: &[u8]| gs.autopilot.put(bytes);
        if let Some(source) = monitor.vehicle().source {
            outlet.encoder.set_system(source.system);
            // Before it is known whose system we are part of, the autopilot need not hear of us.
            if heartbeat_at.is_none_or(|at| now.since(at) >= HEARTBEAT)
                && outlet.send(now, Class::Own, &summary::heartbeat(monitor), &mut out)
            {
                *heartbeat_at = Some(now);
            }
        }
        if params.get(Param::ApStreams) > 0.5 {
            let known = known(monitor);
            asking.tick(now, known.as_ref(), &mut |packet| outlet.send(now, Class::Own, packet, &mut out));
        }
        self.answer(now, gs);
    }

    /// Sends what can be sent of the answers in line.
    fn answer(&mut self, now: Instant, gs: &mut GsIn) {
        for _ in 0..self.companion.replies.len() {
            let Some((port, reply)) = self.companion.replies.first() else { break };
            let packet = packet(reply, self.monitor, &self.identity);
            let sent = self.send(now, port, Class::Own, &packet, gs);
            self.companion.replies.done(sent);
        }
        let count = TABLE.len() as u16;
        for port in Port::ALL {
            while let Some(index) = self.companion.replies.listed(port) {
                let packet = packet(Reply::Param(index), self.monitor, &self.identity);
                if !self.send(now, port, Class::Bulk, &packet, gs) {
                    break;
                }
                self.companion.replies.listed_done(port, count);
            }
        }
    }

    fn send(&mut self, now: Instant, port: Port, class: Class, packet: &Packet, gs: &mut GsIn) -> bool {
        match port {
            Port::Gs => self.summary.outlet.send(now, class, packet, &mut |bytes| gs.put(bytes)),
            Port::Autopilot => {
                self.companion.outlet.send(now, class, packet, &mut |bytes| gs.autopilot.put(bytes))
            }
        }
    }

    /// Takes what the ground station sent since the last tick, as much of it as one tick should.
    pub fn uplink_some(
        &mut self,
        now: Instant,
        uplink: &mut UplinkOut,
        sectors: &mut SectorsIn,
        gs: &mut GsIn,
    ) {
        for _ in 0..FRAMES_A_TICK {
            if !self.uplink(now, uplink, sectors, gs) {
                break;
            }
        }
    }
}

fn index_of(name: &str) -> Option<u16> {
    TABLE.iter().position(|spec| spec.name == name).map(|index| index as u16)
}

fn value_at(params: &Params, index: u16) -> Option<f32> {
    params.iter().nth(usize::from(index)).map(|(_, value)| value)
}

fn known(monitor: &Monitor) -> Option<Known> {
    let vehicle = monitor.vehicle();
    Some(Known {
        source: vehicle.source?,
        autopilot: vehicle.heartbeat.get()?.autopilot,
        reboots: vehicle.reboots,
        identified: vehicle.identity.get().is_some(),
        baud: monitor.params().get(Param::ApBaud) as u32,
    })
}

/// The first thing that stands against a flight.
fn preflight(monitor: &Monitor) -> Option<&'static str> {
    let bad = |level| matches!(level, Level::Warning | Level::Critical);
    monitor.health().levels().find(|(_, _, level)| bad(*level)).map(|(check, ..)| check.name)
}

fn packet(reply: Reply, monitor: &Monitor, identity: &Identity<'_>) -> Packet {
    match reply {
        Reply::Param(index) => match monitor.params().iter().nth(usize::from(index)) {
            Some((spec, value)) => messages::param_value(spec.name, value, index, TABLE.len() as u16),
            // Only indices of the table are put in line.
            None => messages::heartbeat(0),
        },
        Reply::Ack(command, result, (system, component)) => {
            messages::command_ack(command, result, system, component)
        }
        Reply::Version => messages::autopilot_version(version(identity.version), identity.git, &identity.uid),
        Reply::Protocol => messages::protocol_version(),
        Reply::Heartbeat => summary::heartbeat(monitor),
        Reply::Preflight => match preflight(monitor) {
            Some(check) => {
                let words = hums_core::health::words(check);
                messages::status_text(
                    Severity::Warning,
                    Text::new(format_args!("HUMS: not ready: {words}")).as_str(),
                )
            }
            None => messages::status_text(Severity::Info, "HUMS: ready"),
        },
        Reply::Stopped => messages::status_text(Severity::Warning, "HUMS: recording stopped by command"),
    }
}

/// `1.2.3` as three numbers.
fn version(text: &str) -> [u8; 3] {
    let mut numbers = text.split(['.', '-', '+']).map(|part| part.parse().unwrap_or(0));
    [(); 3].map(|()| numbers.next().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_three_numbers_whatever_it_says() {
        assert_eq!(version("1.22.3"), [1, 22, 3]);
        assert_eq!((version("0.1.0-rc1"), version("")), ([0, 1, 0], [0, 0, 0]));
    }

    #[test]
    fn a_flood_of_settings_is_cut_to_a_few_a_second() {
        let mut limiter = Limiter::new();
        let allowed = (0..10_000).filter(|now_ms| limiter.allows(Instant::from_millis(*now_ms))).count();
        assert!((60..=75).contains(&allowed), "{allowed} in ten seconds");
    }
}
