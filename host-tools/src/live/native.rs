//! Playback of an autopilot's own log. It has no frames for [`super::spool`]: a thread reads it again up to the
//! requested place, a little ahead.

use std::collections::VecDeque;
use std::io;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use hums_core::clock::Instant;
use hums_core::observation::{Observation, Source};

use crate::page::more::{RowValues, rows};
use crate::source::item::{Item, Needs, Stop};
use crate::source::recording::LogPlace;
use crate::statustext::StatusText;

const BATCH: usize = 256;
const BATCHES: usize = 4;

/// A log's entry.
#[derive(Clone, Debug)]
pub enum Entry {
    /// An observation of the vehicle.
    Observation(Source, Box<Observation>),
    /// A text of the vehicle.
    Text(StatusText),
    /// A parameter and its value.
    Parameter(String, f64),
    /// Further values for plots.
    More(RowValues),
    /// The log has a gap between these times.
    Gap(Instant, Instant),
}

impl Entry {
    /// An item's entry, if of use here.
    pub fn of(at: Instant, item: &Item<'_>) -> Option<Self> {
        match *item {
            Item::Observation(source, observation) => Some(Self::Observation(source, Box::new(*observation))),
            Item::Text(text) => {
                Some(Self::Text(StatusText::whole(at, text.source, text.severity, text.words)))
            }
            Item::Parameter(parameter) => Some(Self::Parameter(parameter.name.to_owned(), parameter.value)),
            Item::Row(ref row) => RowValues::of(row).map(Self::More),
            Item::Gap(gap) => gap.from.zip(gap.to).map(|(from, to)| Self::Gap(from, to)),
            _ => None,
        }
    }
}

/// Parts to read.
pub fn want() -> Needs<'static> {
    Needs { observations: true, rows: rows(), ..Needs::default() }
}

type Batch = Vec<(Instant, Entry)>;

/// A played log.
#[derive(Debug)]
pub struct Native {
    place: LogPlace,
    batches: Option<Receiver<Batch>>,
    waiting: VecDeque<(Instant, Entry)>,
}

impl Native {
    /// A log, read from its beginning.
    pub fn new(place: LogPlace) -> Self {
        Self { place, batches: None, waiting: VecDeque::new() }
    }

    /// Goes to the place after this many entries.
    pub fn seek(&mut self, entries: u64) -> io::Result<()> {
        let (sender, batches) = sync_channel(BATCHES);
        let place = self.place.clone();
        // Without a receiver it ends with its next batch.
        thread::Builder::new().name("log".to_owned()).spawn(move || {
            let (mut passed, mut batch) = (0_u64, Batch::new());
            let read = place.open().and_then(|recording| {
                recording.read(want(), &mut |at, item| {
                    let Some(entry) = Entry::of(at, &item) else { return Ok(()) };
                    passed += 1;
                    if passed > entries {
                        batch.push((at, entry));
                    }
                    if batch.len() >= BATCH {
                        sender.send(std::mem::take(&mut batch)).map_err(|_| Stop)?;
                    }
                    Ok(())
                })
            });
            let _ = sender.send(batch);
            // Its unreadable parts were reported.
            drop(read);
        })?;
        self.batches = Some(batches);
        self.waiting.clear();
        Ok(())
    }

    /// The next entry if it came by `until`; otherwise it stays the next.
    pub fn next_until(&mut self, until: Instant) -> io::Result<Option<(Instant, Entry)>> {
        if self.batches.is_none() {
            self.seek(0)?;
        }
        while self.waiting.is_empty() {
            match self.batches.as_ref().map(Receiver::recv) {
                Some(Ok(batch)) => self.waiting.extend(batch),
                _ => return Ok(None),
            }
        }
        if self.waiting.front().is_some_and(|(at, _)| *at > until) {
            return Ok(None);
        }
        Ok(self.waiting.pop_front())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn entries_come_by_their_time_and_again_from_any_place() {
        // Any recording will do: the stream is the same.
        let flight = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/flights/px4_hil_quad_low.tlog");
        let mut native = Native::new(LogPlace::file(&flight));
        let take = |native: &mut Native, until_s: u64| {
            let (until, mut times) = (Instant::from_millis(until_s * 1_000), Vec::new());
            while let Some((at, _)) = native.next_until(until).expect("it is read") {
                assert!(at <= until);
                times.push(at);
            }
            times
        };
        let (first, rest) = (take(&mut native, 10), take(&mut native, 10_000));
        assert!(first.len() > 500 && rest.len() > 10_000, "{} and {}", first.len(), rest.len());
        native.seek(first.len() as u64).expect("it is read");
        assert_eq!(take(&mut native, 10_000), rest, "again from there");
        // While it is read.
        native.seek(0).expect("it is read");
        assert_eq!(take(&mut native, 10), first);
        native.seek(0).expect("it is read");
        assert_eq!(take(&mut native, 10), first);
    }
}
