//! Talking with a board like a ground station.

pub mod card_reader;
pub mod format;
pub mod params;
pub mod pull;
pub mod replaced;
pub mod report;
pub mod setup;
#[cfg(test)]
mod tests;
pub mod update;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, anyhow, bail};
use hums_core::observation::CommandAck;
use hums_link::encode::{COMPONENT, Encoder, FRAME_BYTES_MAX};
use hums_link::mav_cmd::REQUEST_MESSAGE;
use hums_link::packet::{Fields, Packet};
use hums_link::signing::{Clock, Key, Seal, stamp};
use hums_link::{Check, Frame, Framer, messages};

use crate::check;
use crate::cli::Link;
use crate::duplex::{self, Duplex};
use crate::files::read_short;
use crate::hex;
use crate::interrupt;
use crate::logs::board::Board;
use crate::mavlink::ids::{AUTOPILOT_VERSION, COMMAND_ACK, HEARTBEAT};
use crate::outcome::usage;
use crate::source::find::find;
use crate::summary::Contents;

/// Offset of `uid2` in `AUTOPILOT_VERSION`.
const UID_AT: usize = 60;
/// A ground station's.
const SYSTEM: u8 = 255;
/// `MAV_COMP_ID_MISSIONPLANNER`
const OUR_COMPONENT: u8 = 190;
/// Timeout for the box's first message.
const CONNECT: Duration = Duration::from_secs(15);
/// Time for further boxes: two heartbeats of each, since a radio may lose one.
const LISTEN: Duration = Duration::from_millis(2_200);
/// Radios and UDP peers learn from them where to answer.
const PRESENCE: Duration = Duration::from_secs(1);
const READ: Duration = Duration::from_millis(20);
const KEY_FILE_BYTES_MAX: u64 = 4096;
/// Unlike a ground station's first, so that each counts its own time.
const LINK: u8 = 17;

/// A conversation with one box.
pub struct Client {
    duplex: Duplex,
    framer: Framer,
    encoder: Encoder,
    /// Signs outgoing frames with this PC's time.
    seal: Option<Seal>,
    begun: Instant,
    /// 0 until known.
    system: u8,
    component: u8,
    frames: VecDeque<Vec<u8>>,
    heartbeat_at: Option<Instant>,
}

impl Client {
    /// Finds the box of `--system`, or the only one on the link, and prints which.
    pub fn connect(link: &Link) -> Result<Self> {
        // No wait for other boxes.
        Self::connect_to(link, &[COMPONENT])
    }

    /// As [`Self::connect`], with the first of these components that is heard.
    pub fn connect_to(link: &Link, components: &[u8]) -> Result<Self> {
        Self::find_on(link, components, if link.system.is_some() { Duration::ZERO } else { LISTEN })
    }

    /// A connection for a command that cannot be undone: looks for further boxes even with `--system`.
    pub fn connect_alone(link: &Link) -> Result<Self> {
        Self::find_on(link, &[COMPONENT], LISTEN)
    }

    fn find_on(link: &Link, components: &[u8], listen: Duration) -> Result<Self> {
        let endpoint = &link.link;
        if !endpoint.is_live() {
            return Err(usage(format!("--link {endpoint}: a file does not answer; give udp, tcp or serial")));
        }
        let seal = link.key.as_deref().map(key).transpose()?.map(|key| Seal::new(key, LINK, our_time(), 0));
        interrupt::watch();
        let client = Self::over(duplex::open(endpoint, READ)?, seal);
        let client = client.found(link, components, listen)?;
        note!("system {}: its {} is heard", client.system, who(client.component));
        Ok(client)
    }

    fn found(mut self, link: &Link, components: &[u8], listen: Duration) -> Result<Self> {
        self.find(components, link.system, listen).with_context(|| link.link.to_string())?;
        Ok(self)
    }

    fn over(duplex: Duplex, seal: Option<Seal>) -> Self {
        Self {
            duplex,
            framer: Framer::new(),
            encoder: Encoder::of(SYSTEM, OUR_COMPONENT),
            seal,
            begun: Instant::now(),
            system: 0,
            component: COMPONENT,
            frames: VecDeque::new(),
            heartbeat_at: None,
        }
    }

    /// The component of this system, or the only one within `listen` after the first. Two of one system differ in unique ids,
    /// so each is asked.
    fn find(&mut self, components: &[u8], wanted: Option<u8>, listen: Duration) -> Result<()> {
        let mut heard = BTreeMap::new();
        for component in components {
            self.component = *component;
            heard = self.listen(wanted, listen)?;
            if wanted.map_or(!heard.is_empty(), |wanted| heard.contains_key(&wanted)) {
                break;
            }
        }
        let meant = |system: &u8| wanted.map_or(heard.len() == 1, |wanted| wanted == *system);
        let Some((system, ids)) = heard.iter().find(|(system, _)| meant(system)) else {
            return Err(not_found(components, wanted, heard.keys()));
        };
        if ids.len() > 1 {
            bail!(
                "{} boxes answer as system {system}; give their vehicles different system ids, or switch all but one off",
                ids.len()
            );
        }
        self.system = *system;
        Ok(())
    }

    fn listen(&mut self, wanted: Option<u8>, listen: Duration) -> Result<BTreeMap<u8, BTreeSet<Board>>> {
        let mut heard: BTreeMap<u8, BTreeSet<Board>> = BTreeMap::new();
        let (mut end, mut is_found) = (Instant::now() + CONNECT, false);
        while let Some((system, id)) = self.next(end, told)? {
            heard.entry(system).or_default().extend(id);
            if wanted.is_some_and(|wanted| wanted != system) || id.is_some() {
                continue;
            }
            if !std::mem::replace(&mut is_found, true) {
                end = Instant::now() + listen;
            }
            if !listen.is_zero() {
                let about = [AUTOPILOT_VERSION as f32];
                self.send(&messages::command_long(REQUEST_MESSAGE, &about, system, self.component))?;
            }
        }
        Ok(heard)
    }

    /// The box's system id.
    pub const fn system(&self) -> u8 {
        self.system
    }

    /// System and component that is spoken to: the box, unless [`Self::turn_to`] named another one.
    pub const fn target(&self) -> (u8, u8) {
        (self.system, self.component)
    }

    /// Speaks with this component of the vehicle from now on.
    pub const fn turn_to(&mut self, component: u8) {
        self.component = component;
    }

    /// Sends a message.
    pub fn send(&mut self, packet: &Packet) -> Result<()> {
        let mut buffer = [0; FRAME_BYTES_MAX];
        let now = hums_core::clock::Instant::from_micros(self.begun.elapsed().as_micros() as u64);
        let frame = match &mut self.seal {
            Some(seal) => self.encoder.frame_signed(&mut buffer, packet, now, seal),
            None => self.encoder.frame(&mut buffer, packet),
        };
        self.duplex.writer.write_all(frame).and_then(|()| self.duplex.writer.flush()).context("--link")
    }

    /// Until `look` accepts a frame of the component that is spoken to, or time is up.
    pub fn until<T>(
        &mut self,
        end: Instant,
        mut look: impl FnMut(&Frame<'_>) -> Option<T>,
    ) -> Result<Option<T>> {
        let system = self.system;
        self.next(end, |frame| if frame.system() == system { look(frame) } else { None })
    }

    /// As [`Self::until`], of all boxes.
    fn next<T>(&mut self, end: Instant, mut look: impl FnMut(&Frame<'_>) -> Option<T>) -> Result<Option<T>> {
        loop {
            while let Some(bytes) = self.frames.pop_front() {
                let frame =
                    Frame::again(&bytes, Check::Verified).filter(|frame| frame.component() == self.component);
                let Some(frame) = frame else { continue };
                if frame.id() == HEARTBEAT && (self.system == 0 || frame.system() == self.system) {
                    self.duplex.reader.keep_to();
                }
                if let Some(found) = look(&frame) {
                    return Ok(Some(found));
                }
            }
            if interrupt::requested() {
                bail!("interrupted");
            }
            if Instant::now() >= end {
                return Ok(None);
            }
            self.receive()?;
        }
    }

    /// Repeats until `look` accepts; `None` after the last try.
    pub fn ask<T>(
        &mut self,
        packet: &Packet,
        patience: Duration,
        tries: usize,
        mut look: impl FnMut(&Frame<'_>) -> Option<T>,
    ) -> Result<Option<T>> {
        for _ in 0..tries {
            self.send(packet)?;
            if let Some(found) = self.until(Instant::now() + patience, &mut look)? {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// Sends a command until it is answered: a `MAV_RESULT`.
    pub fn command(
        &mut self,
        command: u16,
        params: &[f32],
        patience: Duration,
        tries: usize,
    ) -> Result<Option<u8>> {
        let (system, component) = self.target();
        let packet = messages::command_long(command, params, system, component);
        self.ask(&packet, patience, tries, |frame| result_of(frame, command))
    }

    fn receive(&mut self) -> Result<()> {
        if self.heartbeat_at.is_none_or(|at| at.elapsed() >= PRESENCE) {
            self.heartbeat_at = Some(Instant::now());
            // MAV_TYPE_GCS, MAV_AUTOPILOT_INVALID, MAV_STATE_ACTIVE.
            self.send(&Packet::new(HEARTBEAT).u8(4, 6).u8(5, 8).u8(7, 4).u8(8, 3))?;
        }
        // The largest UDP datagram.
        let mut buffer = vec![0; 65_536];
        let Self { duplex, framer, frames, .. } = self;
        let count = match duplex.reader.read(&mut buffer) {
            Ok(0) => bail!("--link: the other side has closed the connection"),
            Ok(count) => count,
            Err(error) if duplex::is_silence(&error) => {
                framer.idle(&mut |frame| keep(frames, &frame));
                return Ok(());
            }
            Err(error) => return Err(error).context("--link"),
        };
        framer.push(buffer.get(..count).unwrap_or_default(), &mut |frame| keep(frames, &frame));
        Ok(())
    }
}

/// Its system, and on request its unique id.
fn told(frame: &Frame<'_>) -> Option<(u8, Option<Board>)> {
    match frame.id() {
        HEARTBEAT => Some((frame.system(), None)),
        AUTOPILOT_VERSION => Some((frame.system(), Some(Fields(frame.payload()).bytes(UID_AT)))),
        _ => None,
    }
}

const fn who(component: u8) -> &'static str {
    if component == COMPONENT { "HUMS box" } else { "autopilot" }
}

/// `heard`: systems on the link.
fn not_found<'a>(
    components: &[u8],
    wanted: Option<u8>,
    heard: impl Iterator<Item = &'a u8>,
) -> anyhow::Error {
    let systems = heard.map(u8::to_string).collect::<Vec<_>>().join(", ");
    let names = components.iter().map(|component| who(*component)).collect::<Vec<_>>().join(" or ");
    match wanted {
        _ if systems.is_empty() => {
            anyhow!(
                "no {names} is heard on this link: is it powered, are address, port or baud rate of --link right, and does it talk on this \
                 link (the box's parameter GS_PATH)?"
            )
        }
        None => usage(format!("several are heard, of the systems {systems}; say which: --system N")),
        Some(wanted) => {
            anyhow!("no {names} of system {wanted} is heard, but of {systems}; is --system as it should be?")
        }
    }
}

fn result_of(frame: &Frame<'_>, command: u16) -> Option<u8> {
    let fields = Fields(frame.payload());
    let is_it = frame.id() == COMMAND_ACK && fields.u16(0) == command;
    (is_it && is_for_us(fields.u8(8), fields.u8(9))).then(|| fields.u8(2))
}

/// An error for a command that was not accepted. `denied`: the reasons of a denial.
fn accepted(result: u8, denied: &str) -> Result<()> {
    match result {
        CommandAck::ACCEPTED | CommandAck::IN_PROGRESS => Ok(()),
        CommandAck::TEMPORARILY_REJECTED => bail!(
            "refused for now: the vehicle is armed, or too many requests came at once; disarm, and try again"
        ),
        CommandAck::DENIED => bail!("the box refused: {denied}"),
        result => bail!("the box refused (MAV_RESULT {result})"),
    }
}

const fn is_for_us(system: u8, component: u8) -> bool {
    (system == SYSTEM || system == 0) && (component == OUR_COMPONENT || component == 0)
}

/// 64 hexadecimal digits, or a passphrase.
pub fn key(path: &Path) -> Result<Key> {
    let bytes = read_short(path, KEY_FILE_BYTES_MAX).context("--key")?;
    let text = str::from_utf8(&bytes).unwrap_or_default().trim_end_matches(['\r', '\n']);
    if text.is_empty() {
        return Err(usage(format!(
            "--key {}: is empty or no text; it wants 64 hexadecimal digits, or a passphrase",
            path.display()
        )));
    }
    Ok(hex::bytes_of(text).map_or_else(|| Key::of_passphrase(text), Key))
}

/// From a mounted card's newest log that has it.
fn of_newest<T>(card: &Path, of_log: impl Fn(Contents) -> Option<T>) -> Result<Option<T>> {
    if !card.is_dir() {
        return Err(usage(format!(
            "--card {}: is no folder; mount the card, and name its root",
            card.display()
        )));
    }
    let Ok(found) = find(&[card.to_owned()], false) else { return Ok(None) };
    let mut logs = found.places.iter().rev().filter(|place| place.own().is_some());
    logs.find_map(|log| check::overview(log).map(|found| of_log(found.contents)).transpose()).transpose()
}

/// This PC's time, as signatures count it.
pub fn stamp_now() -> u64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    stamp(since_1970.as_micros() as u64)
}

/// Starts with this PC's time.
fn our_time() -> Clock {
    let mut clock = Clock::default();
    clock.is_at_least(hums_core::clock::Instant::ZERO, stamp_now());
    clock
}

fn keep(frames: &mut VecDeque<Vec<u8>>, frame: &Frame<'_>) {
    if frame.check() == Check::Verified {
        frames.push_back(frame.bytes().to_vec());
    }
}
