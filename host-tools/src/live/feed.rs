//! A live source: bytes as they come, on this PC's clock, until Ctrl-C.
//!
//! The thread waits for bytes at most `SILENCE`, takes them through the framer into the world, and publishes twenty
//! to twenty-five times a second, at once what comes after a pause; between that it rests for moments (`GATHER`). A connection that breaks is opened again; meanwhile the values grow old, and the page says so.

use std::sync::Arc;
use std::time::{Duration, Instant as Wall, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use hums_core::time::Instant;
use hums_link::framer::Framer;

use super::hub::{Hub, Published};
use super::influx::Influx;
use super::rate::{PUBLISH, Rate};
use super::show::{self, Around, SourceJson};
use super::told::Limits;
use super::world::World;
use crate::duplex::{self, Port};
use crate::endpoint::Endpoint;
use crate::interrupt;

/// How long a byte is waited for: the page's clock goes on meanwhile.
const SILENCE: Duration = Duration::from_millis(10);
/// While nothing is due, what comes is gathered so long: a vehicle sends hundreds of messages a second, and to wake for
/// each would cost several times what the message does. Radios and USB adapters gather as long.
const GATHER: Duration = Duration::from_millis(20);
/// More than the fastest port brings in half of that (921,600 baud) is not waited on.
const GATHERED_BYTES: usize = 1_024;
/// What was gathered counts as having come evenly since the last look, in so many pieces.
const PIECES: usize = 8;
/// What has come is shown so long after what came before was: at once where nothing came for a while. Pages that draw in
/// 10 ms have time for it.
const SOON: Duration = Duration::from_millis(40);
/// How soon a broken connection is tried again.
const AGAIN: Duration = Duration::from_secs(1);
/// A source that says nothing for so long is silent.
const SILENT: Duration = Duration::from_secs(3);

/// Follows a live source until Ctrl-C.
pub struct Feed {
    endpoint: Endpoint,
    port: Option<Box<dyn Port>>,
    again_at: Wall,
    hub: Arc<Hub>,
    world: World,
    framer: Framer,
    influx: Option<Influx>,
    source: SourceJson,
    start: Wall,
    epoch_us: u64,
    heard: Option<Wall>,
    /// When the port was looked at last.
    looked: Instant,
    rate: Rate,
}

impl Feed {
    /// Opens the source: a slip in its name is told at once.
    pub fn open(endpoint: &Endpoint, limits: Limits, hub: Arc<Hub>, influx: Option<Influx>) -> Result<Self> {
        let port = duplex::open(endpoint, SILENCE)?.reader;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            endpoint: endpoint.clone(),
            port: Some(port),
            again_at: Wall::now(),
            hub,
            world: World::new(limits),
            framer: Framer::new(),
            influx,
            source: SourceJson { name: endpoint.to_string(), phase: "waiting", ..SourceJson::default() },
            start: Wall::now(),
            epoch_us: u64::try_from(now.as_micros()).unwrap_or(0),
            heard: None,
            looked: Instant::ZERO,
            rate: Rate::default(),
        })
    }

    /// Runs until Ctrl-C; gives what is still to be written.
    pub fn run(mut self) -> Option<Influx> {
        let mut buffer = vec![0; duplex::ALL_BYTES];
        let (mut published, mut shown, mut news) = (Wall::now(), Wall::now(), false);
        while !interrupt::requested() {
            let frames = self.world.frames;
            let got = self.read(&mut buffer);
            let now = self.now();
            self.pass(now);
            news |= self.world.frames != frames;
            if (news && shown.elapsed() >= SOON) || published.elapsed() >= PUBLISH {
                published = Wall::now();
                if std::mem::take(&mut news) {
                    shown = published;
                }
                self.publish(now);
            }
            if (1..GATHERED_BYTES).contains(&got) {
                std::thread::sleep(GATHER.min(SOON.saturating_sub(shown.elapsed())));
            }
        }
        self.influx
    }

    fn now(&self) -> Instant {
        Instant::from_micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// Takes what has come, or waits for it a while; gives how many bytes there were.
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let Some(port) = &mut self.port else {
            self.open_again();
            return 0;
        };
        let got = match port.read_all(buffer) {
            Ok(0) => Err("the other side has closed the connection".to_owned()),
            Ok(got) => Ok(got),
            Err(error) if duplex::is_silence(&error) => Ok(0),
            Err(error) => Err(error.to_string()),
        };
        let got = match got {
            Ok(got) => got,
            Err(why) => {
                self.lose(why);
                return 0;
            }
        };
        let now = self.now();
        let Self { hub, world, framer, influx, epoch_us, .. } = self;
        let mut histories = hub.histories();
        let mut take = |at, frame: hums_link::Frame<'_>| {
            world.frame(at, &frame, Some(&mut histories));
            if let Some(influx) = influx {
                influx.frame(at, *epoch_us, &frame, world);
            }
        };
        if got == 0 {
            // Nobody finishes a frame after such a pause.
            framer.idle(&mut |frame| take(now, frame));
        } else {
            for (at, piece) in evenly(buffer.get(..got).unwrap_or_default(), self.looked, now) {
                framer.push(piece, &mut |frame| take(at, frame));
            }
            self.heard = Some(Wall::now());
        }
        got
    }

    /// All that time asks for until now: what is shown of a moment is whole.
    fn pass(&mut self, now: Instant) {
        self.looked = now;
        let Self { hub, world, influx, epoch_us, .. } = self;
        world.advance(now, Some(&mut hub.histories()));
        if let Some(influx) = influx {
            influx.found(*epoch_us, world);
            influx.usage(now, *epoch_us, world);
        }
        world.found.clear();
    }

    fn lose(&mut self, why: String) {
        self.port = None;
        self.again_at = Wall::now() + AGAIN;
        (self.source.phase, self.source.words) = ("lost", why);
    }

    fn open_again(&mut self) {
        if Wall::now() >= self.again_at {
            match duplex::open(&self.endpoint, SILENCE) {
                Ok(duplex) => {
                    self.port = Some(duplex.reader);
                    self.source.words = String::new();
                }
                Err(error) => self.lose(format!("{error:#}")),
            }
        } else {
            std::thread::sleep(SILENCE);
        }
    }

    fn publish(&mut self, now: Instant) {
        if self.port.is_some() {
            self.source.phase = match self.heard {
                None => "waiting",
                Some(heard) if heard.elapsed() > SILENT => "silent",
                Some(_) => "live",
            };
        }
        self.rate.count(self.world.frames);
        let around = Around {
            source: &self.source,
            epoch_us: Some(self.epoch_us),
            frames_s: self.rate.frames_s,
            influx: self.influx.as_mut().map(Influx::figures),
        };
        let (head, crafts) = show::all(&self.world, now, &around);
        self.hub.publish(Published { epoch: 0, now, head, timeline: Arc::default(), crafts });
    }
}

/// What came between two looks, in pieces, each with the time at which it counts as having come.
fn evenly(bytes: &[u8], from: Instant, to: Instant) -> impl Iterator<Item = (Instant, &[u8])> {
    let pieces = bytes.chunks(bytes.len().div_ceil(PIECES).max(1));
    let count = pieces.len() as u64;
    let step_us = to.since(from).as_micros() / count.max(1);
    let at = move |later| Instant::from_micros(to.as_micros() - later * step_us);
    (0..count).rev().map(at).zip(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_gathered_came_evenly_and_the_last_of_it_now() {
        let times = |bytes: usize| -> Vec<(u64, usize)> {
            let gathered = vec![0; bytes];
            let (from, to) = (Instant::from_millis(100), Instant::from_millis(116));
            evenly(&gathered, from, to).map(|(at, piece)| (at.as_millis(), piece.len())).collect()
        };
        assert_eq!(times(0), []);
        assert_eq!(times(1), [(116, 1)]);
        assert_eq!(times(2), [(108, 1), (116, 1)]);
        assert_eq!(times(800), [102, 104, 106, 108, 110, 112, 114, 116].map(|at_ms| (at_ms, 100)));
        assert_eq!(times(801).iter().map(|(_, bytes)| bytes).sum::<usize>(), 801);
    }
}
