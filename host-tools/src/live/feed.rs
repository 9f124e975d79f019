//! A live source: bytes as they come, on this PC's clock, until Ctrl-C.
//!
//! The thread waits for bytes at most `SILENCE`, takes them through the framer into the world, and publishes twenty
//! to twenty-five times a second. A connection that breaks is opened again; meanwhile the values grow old, and the page says so.

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
/// The largest UDP datagram.
const BUFFER_BYTES: usize = 65_536;
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
            rate: Rate::default(),
        })
    }

    /// Runs until Ctrl-C; gives what is still to be written.
    pub fn run(mut self) -> Option<Influx> {
        let mut buffer = vec![0; BUFFER_BYTES];
        let (mut published, mut shown, mut news) = (Wall::now(), Wall::now(), false);
        while !interrupt::requested() {
            let frames = self.world.frames;
            self.read(&mut buffer);
            news |= self.world.frames != frames;
            if (news && shown.elapsed() >= SOON) || published.elapsed() >= PUBLISH {
                published = Wall::now();
                if std::mem::take(&mut news) {
                    shown = published;
                }
                self.publish();
            }
        }
        self.influx
    }

    fn now(&self) -> Instant {
        Instant::from_micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    fn read(&mut self, buffer: &mut [u8]) {
        let Some(port) = &mut self.port else { return self.open_again() };
        let got = match port.read(buffer) {
            Ok(0) => return self.lose("the other side has closed the connection".to_owned()),
            Ok(got) => got,
            Err(error) if duplex::is_silence(&error) => 0,
            Err(error) => return self.lose(error.to_string()),
        };
        let at = self.now();
        let Self { hub, world, framer, influx, epoch_us, .. } = self;
        let mut histories = hub.histories();
        let mut take = |frame: hums_link::Frame<'_>| {
            world.frame(at, &frame, Some(&mut histories));
            if let Some(influx) = influx {
                influx.frame(at, *epoch_us, &frame, world);
            }
        };
        if got == 0 {
            // Nobody finishes a frame after such a pause.
            framer.idle(&mut take);
        } else {
            framer.push(buffer.get(..got).unwrap_or_default(), &mut take);
            self.heard = Some(Wall::now());
        }
        world.advance(at, Some(&mut histories));
        if let Some(influx) = influx {
            influx.found(*epoch_us, world);
            influx.usage(at, *epoch_us, world);
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
        let at = self.now();
        self.world.advance(at, Some(&mut self.hub.histories()));
    }

    fn publish(&mut self) {
        let now = self.now();
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
        self.hub.publish(Published {
            epoch: 0,
            now,
            head: show::head(&self.world, now, &around),
            timeline: Arc::default(),
            crafts: show::crafts(&self.world, now),
        });
    }
}
