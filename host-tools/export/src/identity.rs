//! Vehicle and date of a log, known before the first byte is written. They are the tags of every point of the
//! line protocol, and the path of the Parquet tables.

use anyhow::Result;
use hums_blackbox::Record;
use hums_blackbox::record::Vehicle;
use hums_core::clock::Instant;
use hums_core::observation::Observation;

use super::checked::Checked;
use crate::check::judge::{Judge, Limits};
use crate::ending::Ending;
use crate::hex::hex;
use crate::source::epochs::Epochs;
use crate::source::item::{Item, Want};
use crate::source::recording::Place;
use crate::utc::iso8601;

/// A session's names. Each begins with a letter: a tool that guesses types must not make a number of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// `uid-0031002a3035510a` from the autopilot's unique id, otherwise `box-3f0042000d51373435363338` from
    /// the board's own; without both `system-1` or `unknown`.
    pub vehicle: String,
    /// The day of its first entry, UTC: `2026-11-21`; `None` if unknown.
    pub date: Option<String>,
    /// `s1a2b3c4d`: the session number of a HUMS log; `r1a2b3c4d`: a number made of a recording's bytes.
    pub session: String,
    /// UTC by the clock of each part.
    pub epochs: Epochs,
}

/// Vehicle, date and UTC of a recording. If `judges`, also the findings by the monitor here, as in `hums
/// check`, unless one on board checked it. Its `session` is taken from its files' names, so it does not
/// depend on the messages that this version understands.
pub fn identity(place: &Place, session: String, judges: bool) -> Result<(Identity, Option<Checked>)> {
    let (mut known, mut epochs) = (Known::default(), Epochs::default());
    let want = Want { observations: true, ..Want::default() };
    let recording = place.open()?;
    let mut judge = judges.then(|| Judge::new(&Limits::default(), recording.format));
    let summary = recording.read(want, &mut |at, item| {
        if let Some(judge) = &mut judge {
            judge.item(at, item);
        }
        epochs.take(at, &item);
        known.take(at, &item);
        Ok(())
    })?;
    let vehicle = known.vehicle();
    let first = match &summary.ending {
        Some(Ending { summary, .. }) => {
            // One power-on has one clock, also if a packed recording has several.
            epochs = Epochs::of(summary.epoch_us);
            summary.first
        }
        None => known.first,
    };
    // A recording without an observation begins at time zero.
    let utc_us = epochs.utc_us(first.unwrap_or(Instant::ZERO));
    let date = utc_us.map(|utc| iso8601(utc).chars().take(10).collect());
    let checked = judge.and_then(|judge| Checked::new(judge.end()));
    Ok((Identity { vehicle, date, session, epochs }, checked))
}

#[derive(Default)]
struct Known {
    /// The monitor's record of the vehicle. A packed log has no such record, so the vehicle's own messages
    /// count too.
    recorded: Option<Vehicle>,
    board: Option<[u8; 12]>,
    /// The first system whose autopilot sends a heartbeat.
    heard: Option<u8>,
    uid: Option<u64>,
    first: Option<Instant>,
}

impl Known {
    fn take(&mut self, at: Instant, item: &Item<'_>) {
        match item {
            Item::Record(Record::Vehicle(vehicle)) => self.recorded = Some(*vehicle),
            Item::Record(Record::Boot(boot)) if boot.uid != [0; 12] => {
                self.board.get_or_insert(boot.uid);
            }
            Item::Observation(source, observation) => {
                self.first.get_or_insert(at);
                match observation {
                    Observation::Heartbeat(_) => {
                        self.heard.get_or_insert(source.system);
                    }
                    Observation::Identity(told) if told.uid != 0 => {
                        self.uid.get_or_insert(told.uid);
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    fn vehicle(&self) -> String {
        let system = self.recorded.map(|vehicle| vehicle.system).or(self.heard);
        let uid = self.recorded.map(|vehicle| vehicle.uid).filter(|uid| *uid != 0).or(self.uid);
        match (uid, self.board, system) {
            (Some(uid), _, _) => format!("uid-{uid:016x}"),
            (None, Some(board), _) => format!("box-{}", hex(&board)),
            (None, None, Some(system)) => format!("system-{system}"),
            (None, None, None) => "unknown".to_owned(),
        }
    }
}
