//! Vehicle and date of a log, read before the first output. They are tags of the line protocol, and paths of
//! Parquet tables.

use std::path::Path;

use anyhow::Result;
use hums_analysis::track::Track;
use hums_blackbox::Record;
use hums_blackbox::record::Vehicle;
use hums_core::clock::Instant;
use hums_core::observation::Observation;
use hums_core::units::Position;

use super::checked::Checked;
use crate::check::overview_telling;
use crate::hex::hex;
use crate::motion::{Fix, Motion};
use crate::names::{autopilot_name, type_name};
use crate::naming::Traits;
use crate::source::epochs::Epochs;
use crate::source::item::Item;
use crate::source::recording::LogPlace;
use crate::story::HeldObservation;
use crate::summary::Overview;
use crate::utc::iso8601;

/// Letters of a vehicle's name at most: a name in a file system has 255 bytes.
const NAME_MAX: usize = 60;

/// A session's names. Each begins with a letter: a tool that guesses types must not make a number of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// `uid-0031002a3035510a` from the autopilot's unique id. Without it the user's name, else
    /// `box-3f0042000d51373435363338` from the board's id, else `system-1-quadrotor-PX4-logs`, from system
    /// id, kind, autopilot and folder, or `unknown`.
    pub vehicle: String,
    /// The day of its first entry, UTC: `2026-11-21`; `None` if unknown.
    pub date: Option<String>,
    /// `s1a2b3c4d`: the session number of a HUMS log; `r1a2b3c4d`: a number made of a recording's bytes.
    pub session: String,
    /// A name that no other recording has, for the tables of a fleet: `s1a2b3c4d-3f0042000d51373435363338`.
    pub recording: String,
    /// UTC by the clock of each part.
    pub epochs: Epochs,
}

/// Content of a recording for tables of sessions and logbooks.
#[derive(Clone, Debug, Default)]
pub struct RecordingContent {
    /// Counts, findings, usage.
    pub overview: Overview,
    /// The way of the vehicle; its heights are above mean sea level.
    pub track: Track,
    /// Speed over ground at the same places, m/s.
    pub speeds: Track,
    /// Unique id of the box.
    pub board: Option<[u8; 12]>,
    /// Hash of its sectors' numbers and checksums; of another recording, of all its bytes.
    pub fingerprint: [u8; 16],
}

/// A recording, read once before the first byte is written.
#[derive(Clone, Debug)]
pub struct Preview {
    /// Its names.
    pub identity: Identity,
    /// The findings by the monitor here, as in `hums check`; `None` if one on board checked it.
    pub checked: Option<Checked>,
    /// Its content.
    pub about: RecordingContent,
}

/// Vehicle, date, UTC and content of a recording, read once. With `judges`, also the findings by the monitor
/// here. `session` comes from the files' names, so it does not depend on this version's messages.
pub fn identity(place: &LogPlace, traits: &Traits, judges: bool, given: Option<&str>) -> Result<Preview> {
    let (mut sources, mut epochs) = (Sources::default(), Epochs::default());
    let (mut motion, mut track, mut speeds) = (Motion::default(), Track::default(), Track::default());
    let (overview, judged) = overview_telling(place, &mut |at, item| {
        epochs.take(at, &item);
        sources.take(at, &item);
        if let Item::Observation(source, observation) = item {
            let observed = HeldObservation { at, source, observation: *observation };
            if motion.observe(&observed)
                && let Some(fix) = motion.fix_by(&observed.observation)
            {
                let Fix { latitude_deg, longitude_deg, altitude_m, .. } = fix;
                let position = Position { latitude_deg, longitude_deg };
                track.push(at, position, Some(altitude_m));
                speeds.push(at, position, motion.velocity().map(|[north, east, _]| north.hypot(east)));
            }
        }
        Ok(())
    })?;
    let vehicle = sources.vehicle(place, given);
    let first = match place.own() {
        Some(_) => {
            // One power-on has one clock, also if a packed recording has several.
            epochs = Epochs::of(overview.ending.summary.epoch_us);
            overview.ending.summary.first
        }
        None => sources.first,
    };
    let utc_us = epochs.utc_us(first.unwrap_or(Instant::ZERO));
    let date = utc_us.map(|utc| iso8601(utc).chars().take(10).collect());
    let checked = judged.filter(|_| judges).and_then(Checked::new);
    let (session, recording) = (traits.identity(), traits.unique(place, &vehicle));
    let about = RecordingContent {
        overview,
        track,
        speeds,
        board: traits.board(),
        fingerprint: traits.fingerprint(),
    };
    Ok(Preview { identity: Identity { vehicle, date, session, recording, epochs }, checked, about })
}

/// Evidence of a recording's vehicle.
#[derive(Default)]
pub(crate) struct Sources {
    /// A packed log has no such record, so the vehicle's own messages count too.
    recorded: Option<Vehicle>,
    board: Option<[u8; 12]>,
    heard: Option<(u8, u8, u8)>,
    uid: Option<u64>,
    first: Option<Instant>,
}

impl Sources {
    pub(crate) fn take(&mut self, at: Instant, item: &Item<'_>) {
        match item {
            Item::Record(Record::Vehicle(vehicle)) => self.recorded = Some(*vehicle),
            Item::Record(Record::Boot(boot)) if boot.uid != [0; 12] => {
                self.board.get_or_insert(boot.uid);
            }
            Item::Observation(source, observation) => {
                self.first.get_or_insert(at);
                match observation {
                    Observation::Heartbeat(heartbeat) => {
                        let kind = (source.system, heartbeat.type_number, heartbeat.autopilot_number);
                        self.heard.get_or_insert(kind);
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

    pub(crate) fn vehicle(&self, place: &LogPlace, given: Option<&str>) -> String {
        let recorded = self.recorded.map(|of| (of.system, of.vehicle_type, of.autopilot));
        let uid = self.recorded.map(|vehicle| vehicle.uid).filter(|uid| *uid != 0).or(self.uid);
        match (uid, given, self.board, recorded.or(self.heard)) {
            (Some(uid), ..) => format!("uid-{uid:016x}"),
            (None, Some(given), ..) => path_name(given),
            (None, None, Some(board), _) => format!("box-{}", hex(&board)),
            (None, None, None, Some((system, kind, autopilot))) => {
                let folder = place.folder();
                let folder =
                    folder.as_deref().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
                let (kind, autopilot) = (type_name(kind), autopilot_name(autopilot));
                path_name(&format!("system-{system}-{kind}-{autopilot}-{folder}"))
            }
            (None, None, None, None) => "unknown".to_owned(),
        }
    }
}

fn path_name(name: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || matches!(letter, '.' | '_' | '-');
    let plain: String = name.chars().map(|letter| if is_plain(letter) { letter } else { '-' }).collect();
    let plain: String = plain.trim_end_matches('-').chars().take(NAME_MAX).collect();
    if plain.starts_with(char::is_alphabetic) { plain } else { format!("vehicle-{plain}") }
}
