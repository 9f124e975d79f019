//! A live source: bytes as they arrive, on this PC's clock, until Ctrl-C.
//!
//! Waits at most `SILENCE` for bytes, and publishes 20 to 25 times a second; the first bytes after a pause at
//! once. In between it gathers bytes (`GATHER`). A thread reopens a broken connection, which may take ten
//! seconds; meanwhile values grow old.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant as Wall, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use hums_core::clock::Instant;
use hums_link::framer::Framer;

use super::bench::Bench;
use super::hub::{Hub, PageCommand, PublishedState};
use super::influx::Influx;
use super::rate::{PUBLISH, Rate};
use super::show::{self, HeadInputs, SourceJson};
use super::told::Limits;
use super::world::World;
use crate::duplex::{self, Duplex};
use crate::endpoint::Endpoint;
use crate::interrupt;

/// Timeout of a read: the clock goes on.
const SILENCE: Duration = Duration::from_millis(10);
/// While no update is due: a wake-up for each message would cost several times the message.
const GATHER: Duration = Duration::from_millis(20);
/// Half of that time at 921,600 baud ends the gathering.
const GATHERED_BYTES: usize = 1_024;
/// Gathered bytes are spread over the time since the last look.
const PIECES: usize = 8;
/// Between two updates. Pages that draw in 10 ms keep up.
const SOON: Duration = Duration::from_millis(40);
/// How soon a broken connection is tried again.
const AGAIN: Duration = Duration::from_secs(1);
const SILENT: Duration = Duration::from_secs(3);

/// Follows a live source until Ctrl-C.
pub struct Feed {
    endpoint: Endpoint,
    link: Link,
    hub: Arc<Hub>,
    commands: Receiver<PageCommand>,
    bench: Option<Bench>,
    world: World,
    framer: Framer,
    influx: Option<Influx>,
    source: SourceJson,
    start: Wall,
    /// UTC at `start`, see [`epoch_us`].
    epoch_us: u64,
    /// The first bytes.
    first: Option<Wall>,
    heard: Option<Wall>,
    looked: Instant,
    rate: Rate,
}

enum Link {
    Open(Duplex),
    /// It is tried again at this time.
    Lost(Wall),
    /// Sent by a thread.
    Opening(Receiver<Result<Duplex>>),
}

impl Link {
    fn opening(endpoint: &Endpoint) -> Result<Self> {
        let (opened, link) = sync_channel(1);
        let endpoint = endpoint.clone();
        std::thread::Builder::new().name("opening".to_owned()).spawn(move || {
            // Nobody waits at the program's end.
            let _ = opened.send(duplex::open(&endpoint, SILENCE));
        })?;
        Ok(Self::Opening(link))
    }
}

impl Feed {
    /// Opens it.
    pub fn open(
        endpoint: &Endpoint,
        limits: Limits,
        (hub, commands): (Arc<Hub>, Receiver<PageCommand>),
        bench: Option<Bench>,
        influx: Option<Influx>,
    ) -> Result<Self> {
        Ok(Self {
            endpoint: endpoint.clone(),
            link: Link::Open(duplex::open(endpoint, SILENCE)?),
            hub,
            commands,
            bench,
            world: World::new(limits),
            framer: Framer::new(),
            influx,
            source: SourceJson { name: endpoint.to_string(), phase: "waiting", ..SourceJson::default() },
            start: Wall::now(),
            epoch_us: epoch_us(SystemTime::now(), Instant::ZERO),
            first: None,
            heard: None,
            looked: Instant::ZERO,
            rate: Rate::default(),
        })
    }

    /// Returns points to write.
    pub fn run(mut self) -> Option<Influx> {
        let mut buffer = vec![0; duplex::ALL_BYTES];
        let (mut published, mut shown, mut news) = (Wall::now(), Wall::now(), false);
        while !interrupt::requested() {
            let frames = self.world.frames;
            let got = self.read(&mut buffer);
            self.check(buffer.get(..got).unwrap_or_default());
            let now = self.now();
            self.epoch_us = epoch_us(SystemTime::now(), now);
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

    fn check(&mut self, received: &[u8]) {
        let Self { link, bench: Some(bench), world, commands, first, .. } = self else { return };
        let is_armed = world.crafts.values().any(|craft| craft.monitor.vehicle().armed());
        while let Ok(command) = commands.try_recv() {
            if let PageCommand::Check(system) = command {
                bench.start(system);
            }
        }
        let Link::Open(duplex) = link else { return };
        if !received.is_empty() {
            first.get_or_insert_with(Wall::now);
        }
        let knows_arming = first.is_some_and(|first| first.elapsed() >= SILENT);
        bench.pass(received, is_armed, knows_arming.then_some(&mut duplex.writer));
    }

    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let Link::Open(Duplex { reader, .. }) = &mut self.link else {
            self.open_again();
            return 0;
        };
        let got = match reader.read_all(buffer) {
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
        let mut take = |at, frame: hums_link::Frame<'_>| {
            // Pages wait only for a frame, never for the database's queue.
            world.frame(at, &frame, Some(&mut hub.histories()));
            if let Some(influx) = influx {
                influx.frame(at, *epoch_us, &frame, world);
            }
        };
        if got == 0 {
            // No frame continues after such a pause.
            framer.idle(&mut |frame| take(now, frame));
        } else {
            for (at, piece) in evenly(buffer.get(..got).unwrap_or_default(), self.looked, now) {
                framer.push(piece, &mut |frame| take(at, frame));
            }
            self.heard = Some(Wall::now());
        }
        got
    }

    /// Publishes one consistent state.
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
        self.link = Link::Lost(Wall::now() + AGAIN);
        (self.source.phase, self.source.words) = ("lost", why);
    }

    fn open_again(&mut self) {
        let opened = match &self.link {
            Link::Opening(link) => link.recv_timeout(SILENCE),
            Link::Lost(again_at) if Wall::now() >= *again_at => match Link::opening(&self.endpoint) {
                Ok(opening) => return self.link = opening,
                Err(error) => Ok(Err(error)),
            },
            _ => return std::thread::sleep(SILENCE),
        };
        match opened {
            Ok(Ok(duplex)) => {
                self.link = Link::Open(duplex);
                self.source.words = String::new();
            }
            Ok(Err(error)) => self.lose(format!("{error:#}")),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => self.lose("opening it has failed".to_owned()),
        }
    }

    fn publish(&mut self, now: Instant) {
        if matches!(self.link, Link::Open(_)) {
            self.source.phase = match self.heard {
                None => "waiting",
                Some(heard) if heard.elapsed() > SILENT => "silent",
                Some(_) => "live",
            };
        }
        self.rate.count(self.world.frames);
        let around = HeadInputs {
            source: &self.source,
            epoch_us: Some(self.epoch_us),
            frames_s: self.rate.frames_s,
            influx: self.influx.as_mut().map(Influx::figures),
        };
        let (head, crafts) = show::all(&self.world, now, &around);
        let aside = self.bench.as_ref().map_or_else(Arc::default, |bench| Arc::clone(&bench.shown));
        self.hub.publish(PublishedState { epoch: 0, now, head, aside, crafts });
    }
}

/// Microseconds since 1970 at the monotonic clock's zero. Computed again and again: that clock stops in
/// sleep, and UTC may be set.
fn epoch_us(utc: SystemTime, now: Instant) -> u64 {
    let utc_us = utc.duration_since(UNIX_EPOCH).unwrap_or_default().as_micros();
    u64::try_from(utc_us).unwrap_or(0).saturating_sub(now.as_micros())
}

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
    fn arming_ends_the_bench_check() {
        let link = "udpin:127.0.0.1:1".parse().expect("a link");
        let (mut bench, mut sent) = (Bench::new(crate::cli::Setup::of_page(link, 2)), Vec::new());
        bench.start(Some(1));
        while sent.is_empty() {
            bench.pass(b"bytes", false, Some(&mut sent));
        }
        bench.pass(b"", true, Some(&mut sent));
        assert!(bench.shown.contains("not checked: the vehicle is armed"), "{}", bench.shown);
    }

    #[test]
    fn utc_is_right_after_the_computer_has_slept() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        let (start, later) = (Instant::ZERO, Instant::from_millis(5_000));
        assert_eq!(epoch_us(at(1_000), start), epoch_us(at(1_005), later));
        // Asleep for an hour.
        assert_eq!(epoch_us(at(4_605), later) + later.as_micros(), 4_605_000_000);
    }

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
