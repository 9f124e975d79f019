//! The monitor as a companion: what it asks of the autopilot, and what it answers to those who ask.
//!
//! Part of the monitor task: a question comes as a frame, from the frame queue (the autopilot's port, which carries
//! ground stations' questions as well) or from the uplink queue (the ground station's own port), and is answered at the
//! port that it came from, within that port's budget. What is asked can change settings, stop the record and ask for
//! data, and nothing else; a flood of it is cut by [`Limiter`] and by the line of answers, which is short.

use hums_blackbox::record::{Parameter, Record};
use hums_core::params::{Param, Params, TABLE};
use hums_core::time::{Instant, Span};
use hums_core::{Monitor, protect};
use hums_link::asking::{Asking, Known};
use hums_link::encode::COMPONENT;
use hums_link::frame::{Check, Frame};
use hums_link::messages;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::{Fields, Packet};
use hums_link::request::{self, Port, Replies, Reply, Request};
use hums_link::summary;
use hums_recorder::LogName;

use crate::commands;
use crate::library::Library;
use crate::monitoring::Monitoring;
use crate::queues::{GsIn, Path, SectorsIn, UplinkOut};
use crate::secure::{Secure, Trust};
use crate::settings::Settings;

/// Bytes that may wait at the autopilot's port. Its queue has room for them, for as many of the summary where the
/// autopilot carries it, and for the longest frame.
const WAITING_BYTES: u32 = 400;
/// How often the autopilot hears of us: it routes only to those it has heard.
const HEARTBEAT: Span = Span::from_secs(1);
/// Settings and commands that a port may send at once, and how many more each second.
const REQUESTS_MAX: u32 = 20;
const REQUESTS_PER_S: u32 = 5;
/// Frames of the ground station that one tick looks at: a flood waits in its queue, and is lost there.
const FRAMES_A_TICK: u32 = 16;

/// So many at once, and so many a second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limiter {
    left: u32,
    at: Instant,
}

impl Limiter {
    const fn new() -> Self {
        Self { left: REQUESTS_MAX, at: Instant::ZERO }
    }

    pub(crate) fn allows(&mut self, now: Instant) -> bool {
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
    pub(crate) outlet: Outlet,
    asking: Asking,
    pub(crate) replies: Replies,
    pub(crate) limits: [Limiter; 2],
    heartbeat_at: Option<Instant>,
    pub(crate) downloads: Library,
    /// The log that is open over FTP.
    file: Option<LogName>,
    /// Somebody stopped the record.
    pub(crate) stopped: bool,
    pub(crate) secure: Secure,
    /// What the protective action asks of the autopilot, until it is sent.
    protect: Option<protect::Request>,
    /// Frames that passed through for others, and found no room.
    pub(crate) not_passed: u32,
    /// When a frame of a definition that we do not have was passed down last.
    pub(crate) passed_at: Option<Instant>,
    pub(crate) settings: Settings,
}

impl Companion {
    pub(crate) const fn new(params: &Params) -> Self {
        Self {
            outlet: Outlet::new(
                params.get(Param::ApBudget) as u32,
                params.get(Param::ApBaud) as u32,
                WAITING_BYTES,
            ),
            asking: Asking::new(),
            replies: Replies::new(),
            limits: [Limiter::new(); 2],
            heartbeat_at: None,
            downloads: Library::new(),
            file: None,
            stopped: false,
            secure: Secure::new(),
            protect: None,
            not_passed: 0,
            passed_at: None,
            settings: Settings::new(),
        }
    }
}

impl Monitoring<'_> {
    /// The line rates that count now, in baud: of the ground station's port and of the autopilot's.
    pub const fn bauds(&self) -> (u32, u32) {
        (self.summary.outlet.baud(), self.companion.outlet.baud())
    }

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
                self.pass_up(now, &frame, gs);
            }
            self.answer(now, gs);
        })
    }

    /// Looks at a frame of the autopilot's port: an answer to us, a question, or what we need to know is there.
    pub(crate) fn heard(&mut self, now: Instant, frame: &Frame<'_>, sectors: &mut SectorsIn, gs: &mut GsIn) {
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
        self.pass_down(now, frame, gs);
    }

    fn asked(&mut self, now: Instant, port: Port, frame: &Frame<'_>, sectors: &mut SectorsIn) {
        let Some(asked) = request::read(frame) else { return };
        let system = self.companion.outlet.encoder.system();
        if !messages::concerns_us(asked.target, system) {
            return;
        }
        let by = (frame.system(), frame.component());
        if by == (system, COMPONENT) {
            // Our own, that came back; or somebody who says that he is us.
            return;
        }
        if let Request::Key(key, stamp) = asked.request {
            // Never for all, says the guide: only for who is named.
            if asked.target == (system, COMPONENT) {
                self.key_brought(now, port, key, stamp, by, sectors);
            }
            return;
        }
        let trust = self.trust(now, port, frame);
        match asked.request {
            Request::ParamSet(name, value) => {
                let Some(index) = index_of(name) else { return };
                let may = self.may_set(port, name, trust) && self.companion.limits[port as usize].allows(now);
                // Refused or not, the answer is the value that counts now.
                if may && self.set_by_link(now, name, value, by, sectors) {
                    self.changed(trust);
                }
                self.companion.replies.push(port, Reply::Param(index));
            }
            // What is for all components of the vehicle is for the autopilot to answer, unless it is a question.
            Request::Command(command, params) if asked.target.1 != 0 || command == commands::MESSAGE => {
                let broadcast = asked.target.1 == 0;
                let result = match trust {
                    Trust::Refused => commands::DENIED,
                    _ => self.command(now, port, command, params, by, sectors),
                };
                if result == commands::ACCEPTED {
                    self.changed(trust);
                }
                if !broadcast || result == commands::ACCEPTED {
                    self.companion.replies.push(port, Reply::Ack(command, result, by));
                }
            }
            _ if trust == Trust::Refused => {}
            Request::ParamList => self.companion.replies.list(port, TABLE.len() as u16),
            Request::ParamAt(index) if usize::from(index) < TABLE.len() => {
                self.companion.replies.push(port, Reply::Param(index));
            }
            Request::ParamNamed(name) => {
                if let Some(index) = index_of(name) {
                    self.companion.replies.push(port, Reply::Param(index));
                }
            }
            Request::LogErase if asked.target.1 != 0 => self.erase(now, port, trust, by, sectors),
            // Of the broadcasts of a vehicle only those that name us: the autopilot has logs and files of its own.
            ref about_logs if asked.target.1 != 0 => {
                let Companion { downloads, file, .. } = &mut self.companion;
                downloads.asked(port, by, about_logs, file);
            }
            _ => {}
        }
    }

    /// Sets a parameter because somebody asked for it: recorded, and in force at once. `false` where it is refused.
    pub(crate) fn set_by_link(
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
    #[inline(never)]
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
        self.seal(gs.path());
        let Self { companion, monitor, .. } = self;
        let Companion { outlet, asking, heartbeat_at, protect, .. } = companion;
        if let Some(request) = monitor.take_request() {
            *protect = Some(request);
        }
        let params = monitor.params();
        outlet.set(now, params.get(Param::ApBudget) as u32, params.get(Param::ApBaud) as u32);
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
        // The protective action: what the autopilot answers is the monitor's to see.
        if let (Some(request), Some(source)) = (*protect, monitor.vehicle().source) {
            let packet = messages::command_long(request.command, &[], source.system, source.component);
            if outlet.send(now, Class::Critical, &packet.u8(32, request.confirmation), &mut out) {
                *protect = None;
            }
        }
        if params.get(Param::ApStreams) > 0.5 {
            let known = known(monitor);
            asking.tick(now, known.as_ref(), &mut |packet| outlet.send(now, Class::Own, packet, &mut out));
        }
        self.settings(now, sectors, gs);
        self.answer(now, gs);
    }

    /// Sends what can be sent of the answers in line.
    fn answer(&mut self, now: Instant, gs: &mut GsIn) {
        for _ in 0..self.companion.replies.len() {
            let Some((port, reply)) = self.companion.replies.first() else { break };
            let packet = commands::packet(reply, self.monitor, &self.identity);
            let sent = self.send(now, port, Class::Own, &packet, gs);
            self.companion.replies.done(sent);
        }
        let count = TABLE.len() as u16;
        for port in Port::ALL {
            while let Some(index) = self.companion.replies.listed(port) {
                let packet = commands::packet(Reply::Param(index), self.monitor, &self.identity);
                if !self.send(now, port, Class::Bulk, &packet, gs) {
                    break;
                }
                self.companion.replies.listed_done(port, count);
            }
        }
        self.lend(now, gs);
    }

    pub(crate) fn bulk_frame_max(&self, port: Port) -> usize {
        match port {
            Port::Gs => self.summary.outlet.bulk_frame_max(),
            Port::Autopilot => self.companion.outlet.bulk_frame_max(),
        }
    }

    pub(crate) fn send(
        &mut self,
        now: Instant,
        port: Port,
        class: Class,
        packet: &Packet,
        gs: &mut GsIn,
    ) -> bool {
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

pub(crate) fn index_of(name: &str) -> Option<u16> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_settings_is_cut_to_a_few_a_second() {
        let mut limiter = Limiter::new();
        let allowed = (0..10_000).filter(|now_ms| limiter.allows(Instant::from_millis(*now_ms))).count();
        assert!((60..=75).contains(&allowed), "{allowed} in ten seconds");
    }
}
