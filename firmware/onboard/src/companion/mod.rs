//! The monitor as a companion: its requests to the autopilot, and its answers to others.
//!
//! A part of the monitor task. A request comes as a frame from the frame queue (the autopilot's port) or from the
//! uplink queue (the ports for ground stations: the radio's, and the one on USB). The answer goes out at the same port,
//! within its budget. The USB port gets the summary stream too, with numbers and signatures of its own.
//!
//! Requests change settings, stop recording and ask for data, and nothing else. A flood of requests is cut by
//! [`limiter`] and by the short queue of answers.

mod commands;
mod library;
mod limiter;
mod pass;
mod secure;
mod settings;
mod ways;

use embedded_storage::nor_flash::NorFlash;
use hums_blackbox::record::Boot;
use hums_core::clock::{Instant, Span};
use hums_core::observation::CommandAck;
use hums_core::parameters::{Param, Params, TABLE};
use hums_core::{Monitor, protect};
use hums_link::asking::{Asking, KnownVehicle};
use hums_link::encode::COMPONENT;
use hums_link::events::Events;
use hums_link::frame::Frame;
use hums_link::messages;
use hums_link::outlet::Class;
use hums_link::packet::Fields;
use hums_link::request::{self, AddressedRequest, Port, Reply, Request};
use hums_link::signing::{Key, Seal};
use hums_link::summary::{self, Forwards};
use hums_link::{ids, mav_cmd};

use crate::journal::{Journal, Logbook};
use crate::persist::{Handover, StoreWriter};
use crate::queues::{GsIn, SummaryRoute};
use commands::Commands;
use library::Library;
use limiter::Requester;
use pass::BackChannel;
use secure::{RequestSigning, Trust};
use settings::Settings;
use ways::Outlets;

/// Interval of heartbeats to the autopilot, which routes messages only to known systems.
const HEARTBEAT: Span = Span::from_secs(1);
/// The monitor itself: no answer is expected.
const NOBODY: Requester = Requester { port: Port::Gs, by: (0, 0) };

pub(crate) struct Companion<'a> {
    pub(crate) ways: Outlets<'a>,
    asking: Asking,
    events: Events,
    commands: Commands,
    heartbeat_at: Option<Instant>,
    library: Library,
    secure: RequestSigning,
    protect: Option<protect::Request>,
    pass: BackChannel,
    settings: Settings,
}

impl<'a> Companion<'a> {
    pub(crate) fn new(params: &Params, queues: GsIn<'a>) -> Self {
        Self {
            ways: Outlets::new(params, queues),
            asking: Asking::new(),
            events: Events::new(),
            commands: Commands::new(),
            heartbeat_at: None,
            library: Library::new(),
            secure: RequestSigning::new(),
            protect: None,
            pass: BackChannel::new(),
            settings: Settings::new(),
        }
    }

    /// Current ones of the ground station's port and of the autopilot's.
    pub(crate) const fn bauds(&self) -> (u32, u32) {
        (self.ways.summary.outlet.baud(), self.ways.autopilot.baud())
    }

    pub(crate) const fn stopped(&self) -> bool {
        self.commands.stopped()
    }

    pub(crate) fn wants_card_reader(&mut self, now: Instant, monitor: &Monitor) -> bool {
        self.commands.wants_card_reader(now, monitor.vehicle().armed())
    }

    pub(crate) const fn passed_lost(&self) -> u32 {
        self.pass.lost
    }

    pub(crate) const fn requests_refused(&self) -> u32 {
        self.secure.refused
    }

    /// The key from the store: see [`secure`].
    pub(crate) fn restore<F: NorFlash>(&mut self, store_writer: &mut StoreWriter<'_, F>) {
        self.secure.restore(store_writer);
    }

    pub(crate) fn save(&mut self, now: Instant, handover: &mut Handover<'_>) -> bool {
        let seals = self.ways.all().into_iter().filter_map(|outlet| outlet.seal.as_ref());
        self.secure.save(now, seals.map(Seal::last).max(), handover)
    }

    pub(crate) fn uplink(&mut self, now: Instant, (port, frame): (Port, &Frame<'_>), book: &mut Logbook<'_>) {
        self.asked(now, port, frame, book);
        self.pass.up(now, port, frame, book.monitor, &mut self.ways);
    }

    /// An answer to us, a request, or data.
    pub(crate) fn heard(&mut self, now: Instant, frame: &Frame<'_>, book: &mut Logbook<'_>) {
        if self.asking.of() == Some(frame.source()) {
            self.asking.seen(frame.id());
            self.events.heard(frame.id(), frame.payload());
            if frame.id() == ids::PARAM_VALUE
                && let Some(name) = Fields(frame.payload()).text(8, 16)
            {
                self.asking.told(name);
            }
            if frame.id() == ids::COMMAND_ACK {
                let fields = Fields(frame.payload());
                let target = (fields.u8(8), fields.u8(9));
                if messages::concerns_us(target, self.ways.autopilot.encoder.system()) {
                    self.asking.answered(fields.u16(0), fields.u8(2));
                }
            }
        }
        self.asked(now, Port::Autopilot, frame, book);
        self.pass_down(now, frame, book);
    }

    /// Passed from the autopilot's port to the ground station, if it should be.
    pub(crate) fn pass_down(&mut self, now: Instant, frame: &Frame<'_>, book: &Logbook<'_>) {
        self.pass.down(now, frame, book.monitor, &mut self.ways);
    }

    fn asked(&mut self, now: Instant, port: Port, frame: &Frame<'_>, book: &mut Logbook<'_>) {
        let Some(asked) = request::read(frame) else { return };
        let system = self.ways.autopilot.encoder.system();
        if !messages::concerns_us(asked.target, system) {
            return;
        }
        let asker = Requester { port, by: (frame.system(), frame.component()) };
        if asker.by == (system, COMPONENT) {
            return;
        }
        if let Request::Key(key, stamp) = asked.request {
            // Only if it is addressed to us, by the guide: never a broadcast.
            if asked.target == (system, COMPONENT) {
                self.key_brought(now, asker, key, stamp, book);
            }
            return;
        }
        let trust = self.secure.trust(now, book.monitor.params(), port, frame);
        match asked.request {
            Request::ParamSet(name, value) => {
                let Some(param) = Param::find(name) else { return };
                let may =
                    self.secure.may_set(book.monitor, port, param, trust) && self.commands.allows(now, port);
                // Also after a refusal the answer is the current value.
                if may && book.set_parameter(now, name, value, asker.by) {
                    self.secure.changed(trust);
                }
                self.commands.replies.push(port, Reply::Param(param as u16));
            }
            // Broadcasts to all components are left to the autopilot, unless they are requests for messages.
            Request::Command(command, params)
                if asked.target.1 != 0 || command == mav_cmd::REQUEST_MESSAGE =>
            {
                let result = match trust {
                    Trust::Refused => CommandAck::DENIED,
                    _ => self.commands.command(now, asker, command, params, book),
                };
                if result == CommandAck::ACCEPTED && !commands::only_asks(command) {
                    self.secure.changed(trust);
                }
                let is_broadcast = asked.target.1 == 0;
                if !is_broadcast || result == CommandAck::ACCEPTED {
                    self.commands.replies.push(port, Reply::Ack(command, result, asker.by));
                }
            }
            _ if trust == Trust::Refused => {}
            _ => self.asked_for_data(now, asker, trust, &asked, book),
        }
    }

    fn asked_for_data(
        &mut self,
        now: Instant,
        asker: Requester,
        trust: Trust,
        asked: &AddressedRequest<'_>,
        book: &mut Logbook<'_>,
    ) {
        let replies = &mut self.commands.replies;
        match asked.request {
            Request::ParamList => replies.list(asker.port, TABLE.len() as u16),
            Request::ParamAt(index) if usize::from(index) < TABLE.len() => {
                replies.push(asker.port, Reply::Param(index));
            }
            Request::ParamNamed(name) => {
                if let Some(param) = Param::find(name) {
                    replies.push(asker.port, Reply::Param(param as u16));
                }
            }
            Request::LogErase if asked.target.1 != 0 => self.erase(now, asker, trust, book),
            // Only with our component id: the autopilot has logs and files of its own.
            ref about_logs if asked.target.1 != 0 => {
                self.library.asked(asker, about_logs);
            }
            _ => {}
        }
    }

    fn erase(
        &mut self,
        now: Instant,
        Requester { port, by }: Requester,
        trust: Trust,
        book: &mut Logbook<'_>,
    ) {
        if !self.commands.allows(now, port) {
            return;
        }
        let may = !book.may_fly(now);
        let what = if may { "logs erased" } else { "erasing refused in flight, asked" };
        book.journal.by_hand(now, format_args!("{what} by {}/{}", by.0, by.1));
        if may {
            self.library.erases = true;
            self.commands.replies.push(port, Reply::Erased);
            self.secure.changed(trust);
        }
    }

    fn key_brought(
        &mut self,
        now: Instant,
        Requester { port, by }: Requester,
        key: Key,
        stamp: u64,
        book: &mut Logbook<'_>,
    ) {
        if !self.commands.allows(now, port) {
            return;
        }
        let takes = secure::is_trusted(book.monitor.params(), port);
        let what = match (takes, key.is_none()) {
            (false, _) => "refused",
            (true, false) => "set",
            (true, true) => "removed",
        };
        book.journal.by_hand(now, format_args!("signing key {what} by {}/{}", by.0, by.1));
        if takes {
            self.secure.set_key(now, key, stamp);
            self.commands.replies.push(port, Reply::Keyed(!key.is_none()));
        }
    }

    /// Withholds a key at the autopilot's port from the record, which gets an event.
    pub(crate) fn withhold(&mut self, now: Instant, frame: &Frame<'_>, journal: &mut Journal<'_>) {
        let (system, component) = (frame.system(), frame.component());
        if self.commands.allows(now, Port::Autopilot) {
            journal.by_hand(now, format_args!("a key of {system}/{component} is not recorded"));
        }
    }

    #[inline(never)]
    pub(crate) fn converse(&mut self, now: Instant, book: &mut Logbook<'_>) {
        let Outlets { summary, queues, .. } = &mut self.ways;
        queues.set_route(match book.monitor.params().get(Param::GsPath) as u8 {
            0 => SummaryRoute::Nobody,
            2 => SummaryRoute::Autopilot,
            _ => SummaryRoute::Port,
        });
        summary.forwards = match queues.route() {
            SummaryRoute::Port => Forwards::Budgeted,
            _ if queues.is_open(Port::Usb) => Forwards::Apart,
            _ => Forwards::Nothing,
        };
        if self.commands.stopped() && book.monitor.vehicle().armed() {
            self.commands.stop_or_record(now, false, NOBODY, &mut book.journal);
        }
        self.secure.seal(now, book.monitor, &mut self.ways);
        self.tell_autopilot(now, book.monitor);
        self.settings.tick(now, &mut self.library, book, &mut self.ways.queues.shelf);
    }

    fn tell_autopilot(&mut self, now: Instant, monitor: &mut Monitor) {
        let Self { ways, asking, events, heartbeat_at, protect, .. } = self;
        let Outlets { autopilot: outlet, usb, queues, .. } = ways;
        if let Some(request) = monitor.take_request() {
            *protect = Some(request);
        }
        let params = monitor.params();
        outlet.set(now, params.get(Param::ApBudget) as u32, params.get(Param::ApBaud) as u32);
        let mut out = |bytes: &[u8]| queues.autopilot.put(bytes);
        if let Some(source) = monitor.vehicle().source {
            outlet.encoder.set_system(source.system);
            usb.encoder.set_system(source.system);
            // Before the vehicle's first heartbeat its system id is not known. With GS_PATH 2 the summary sends one at once, as
            // system 1.
            if heartbeat_at.is_none_or(|at| now.since(at) >= HEARTBEAT)
                && outlet.send(now, Class::Own, &summary::heartbeat(monitor), &mut out)
            {
                *heartbeat_at = Some(now);
            }
        }
        // The protective action; the monitor evaluates the autopilot's answer.
        if let (Some(request), Some(source)) = (*protect, monitor.vehicle().source) {
            let packet = messages::command_long(request.command, &[], source.system, source.component);
            if outlet.send(now, Class::Critical, &packet.u8(32, request.confirmation), &mut out) {
                *protect = None;
            }
        }
        if params.get(Param::ApStreams) > 0.5 {
            let known = known(now, monitor);
            asking.tick(now, known.as_ref(), &mut |packet| outlet.send(now, Class::Own, packet, &mut out));
            if let Some(known) = known {
                events.tick(now, known.source, &mut |packet| outlet.send(now, Class::Own, packet, &mut out));
            }
            let is_vehicle = |known: &KnownVehicle| Some(known.source) == monitor.vehicle().source;
            if known.filter(is_vehicle).is_some_and(|known| asking.has_parameters(&known)) {
                monitor.parameters_asked();
            }
        }
    }

    pub(crate) fn answer(&mut self, now: Instant, monitor: &Monitor, identity: &Boot<'_>) {
        let Self { ways, commands: Commands { replies, .. }, .. } = self;
        for _ in 0..replies.len() {
            let Some((port, reply)) = replies.first() else { break };
            let packet = commands::packet(now, reply, monitor, identity);
            let sent = ways.send(now, port, Class::Own, &packet);
            replies.done(sent || !ways.queues.is_open(port));
        }
        for port in Port::ALL {
            if !ways.queues.is_open(port) {
                replies.end_list(port);
            }
            while let Some(index) = replies.listed(port) {
                let packet = commands::packet(now, Reply::Param(index), monitor, identity);
                if !ways.send(now, port, Class::Bulk, &packet) {
                    break;
                }
                replies.listed_done(port, TABLE.len() as u16);
            }
        }
        // Meanwhile the card's answers are not for downloads.
        if !self.settings.is_reading()
            && let Some((port, told)) = self.library.lend(now, &mut self.ways)
        {
            self.commands.replies.push(port, told);
        }
    }
}

/// The systems to ask: the vehicle, or, until it is settled, each autopilot on the port in turn.
fn known(now: Instant, monitor: &Monitor) -> Option<KnownVehicle> {
    let vehicle = monitor.vehicle();
    let (source, autopilot) = vehicle.asks(now.into())?;
    Some(KnownVehicle {
        source,
        autopilot,
        reboots: vehicle.reboots,
        identified: vehicle.identity.get().is_some() || vehicle.source != Some(source),
        baud: monitor.params().get(Param::ApBaud) as u32,
    })
}

#[cfg(test)]
mod tests {
    use hums_link::encode::Encoder;
    use hums_link::packet::Packet;
    use hums_link::statustext::Severity;

    use super::*;
    use crate::queues::{Ends, MonitorEnds, Queues};
    use hums_link::encode::FRAME_BYTES_MAX;

    const NOW: Instant = Instant::from_millis(5_000);

    #[test]
    fn critical_texts_have_room_behind_all_the_bulk_that_a_usb_port_takes() {
        let text = messages::status_text(Severity::Critical, &"x".repeat(50));
        for bytes in [20, 40, 109, 263] {
            let mut queues = Box::new(Queues::new());
            let (MonitorEnds { gs, .. }, Ends { usb_out, .. }) = queues.split();
            usb_out.open();
            let mut ways = Outlets::new(&Params::defaults(), gs);
            let bulk = Packet::new(ids::LOG_DATA).bytes(0, &vec![1; bytes - 12][..]);
            let taken = (0..99).take_while(|_| ways.send(NOW, Port::Usb, Class::Bulk, &bulk)).count();
            assert!(taken >= 2, "{taken} of {bytes} bytes");
            let mut out = [0; FRAME_BYTES_MAX];
            for _ in 0..3 {
                ways.summarise(NOW, |_, tell| tell(Encoder::new().frame(&mut out, &text)));
            }
            assert_eq!(ways.queues.lost(), 0, "behind {bytes} bytes");
        }
    }

    #[test]
    fn the_autopilot_never_gets_its_own_frames_whether_usb_is_open_or_not() {
        let mut queues = Box::new(Queues::new());
        let (MonitorEnds { gs, .. }, Ends { mut usb_out, .. }) = queues.split();
        let mut ways = Outlets::new(&Params::defaults(), gs);
        ways.queues.set_route(SummaryRoute::Autopilot);
        let (mut out, mut usb_frames) = ([0; FRAME_BYTES_MAX], 0);
        let text = messages::status_text(Severity::Notice, "x");
        for is_open in [true, false] {
            if is_open {
                usb_out.open();
            } else {
                usb_out.close();
            }
            let mut frame = [0; FRAME_BYTES_MAX];
            let theirs = Encoder::of(1, 1).frame(&mut frame, &text);
            ways::queue_forwarded(NOW, theirs, &mut ways.usb, &mut ways.queues);
            ways.summarise(NOW, |_, tell| tell(Encoder::new().frame(&mut frame, &text)));
            while usb_out.take(&mut out).is_some() {
                usb_frames += 1;
            }
        }
        assert_eq!((ways.queues.autopilot.frames(), usb_frames, ways.queues.lost()), (2, 2, 0));
    }
}
