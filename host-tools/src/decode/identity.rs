//! Who flew and when, known before the first byte is written: what the line protocol tags every point with, and where
//! the Parquet tables lie.

use anyhow::Result;
use hums_blackbox::record::Vehicle;
use hums_blackbox::{Entry, Gap, Record};
use hums_core::observation::Observation;
use hums_link::{Check, Frame, observe};

use crate::hex::hex;
use crate::logs::Log;
use crate::logs::reader::{Collect, Deliver, read};
use crate::mavlink::ids::{AUTOPILOT_VERSION, HEARTBEAT};
use crate::source::epochs::Epochs;
use crate::utc::iso8601;

/// A session's names. Each begins with a letter: a tool that guesses types must not make a number of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// `uid-0031002a3035510a` where the autopilot told its unique id, otherwise the board's own,
    /// `box-3f0042000d51373435363338`; where there is neither, `system-1` or `unknown`.
    pub vehicle: String,
    /// The day of its first entry, UTC: `2026-11-21`; `None` where nobody told it.
    pub date: Option<String>,
    /// `s1a2b3c4d`: the session that the sectors name, which is as good as unique.
    pub session: String,
    /// UTC by the clock of each part.
    pub epochs: Epochs,
}

impl Identity {
    /// Reads a log through for it.
    pub fn of(log: &Log) -> Result<Self> {
        let mut known = Known::default();
        let summary = read(log, Known::default, &mut known, |_| ())?;
        let system = known.recorded.map(|vehicle| vehicle.system).or(known.heard);
        let uid = known.recorded.map(|vehicle| vehicle.uid).filter(|uid| *uid != 0).or(known.uid);
        let board = known.board.map(|uid| hex(&uid));
        let vehicle = match (uid, board, system) {
            (Some(uid), _, _) => format!("uid-{uid:016x}"),
            (None, Some(board), _) => format!("box-{board}"),
            (None, None, Some(system)) => format!("system-{system}"),
            (None, None, None) => "unknown".to_owned(),
        };
        let utc_us =
            summary.epoch_us.zip(summary.first).map(|(epoch, first)| epoch.saturating_add(first.as_micros()));
        let session =
            summary.session.map_or_else(|| "unknown".to_owned(), |session| format!("s{session:08x}"));
        let date = utc_us.map(|utc| iso8601(utc).chars().take(10).collect());
        Ok(Self { vehicle, date, session, epochs: Epochs::of(summary.epoch_us) })
    }
}

/// What the monitor recorded of the vehicle; a packed log has no such record, so the vehicle's own frames count too.
#[derive(Default)]
struct Known {
    recorded: Option<Vehicle>,
    /// The board's unique id.
    board: Option<[u8; 12]>,
    /// The first system whose autopilot sends a heartbeat.
    heard: Option<u8>,
    uid: Option<u64>,
}

/// What tells who it is.
const TELLING: [u32; 2] = [HEARTBEAT, AUTOPILOT_VERSION];

impl Collect for Known {
    fn entry(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::Record { record: Record::Vehicle(vehicle), .. } => self.recorded = Some(*vehicle),
            Entry::Record { record: Record::Boot(boot), .. } if boot.uid != [0; 12] => {
                self.board = Some(boot.uid);
            }
            Entry::Frame { bytes, verified: true, .. } => {
                let frame =
                    Frame::again(bytes, Check::Verified).filter(|frame| TELLING.contains(&frame.id()));
                match frame.and_then(|frame| observe(&frame)) {
                    Some((source, Observation::Heartbeat(_))) => {
                        self.heard.get_or_insert(source.system);
                    }
                    Some((_, Observation::Identity(identity))) if identity.uid != 0 => {
                        self.uid.get_or_insert(identity.uid);
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        0
    }
}

impl Deliver<Self> for Known {
    fn gap(&mut self, _: &Gap) -> Result<()> {
        Ok(())
    }

    fn group(&mut self, next: Self) -> Result<()> {
        self.recorded = next.recorded.or(self.recorded);
        self.board = self.board.or(next.board);
        self.heard = self.heard.or(next.heard);
        self.uid = self.uid.or(next.uid);
        Ok(())
    }
}
