//! The board's logs of one session: the recording from one power-on to the next. A longer log has several
//! files of one number, with the same session in their sectors.

use std::path::Path;

use anyhow::{Result, bail};

use super::compare::heading_of;
use super::ftp::Ftp;
use crate::logs::segment_name;
use crate::outcome::usage;

/// The logs of a session, in their order.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Session {
    pub(super) logs: Vec<String>,
    /// Logs among them, or newer ones, with an unreadable beginning: their session is unknown.
    pub(super) unknown: Vec<String>,
}

/// A log's place among those of its card, by its name: the session's number there, and the number of the
/// file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub(super) session: u32,
    pub(super) segment: u32,
}

impl Place {
    /// Behind all others.
    pub(super) const MAX: Self = Self { session: u32::MAX, segment: u32::MAX };
}

/// The place of a log that has a card's name, on the board or here.
pub(super) fn place(log: &str) -> Option<Place> {
    segment_name(Path::new(log)).map(|name| Place { session: name.session, segment: name.segment })
}

/// The session's number in the name that a board's log has there.
pub(super) fn number(log: &str) -> Option<u32> {
    place(log).map(|place| place.session)
}

/// The newest session of these logs, which are in order. Named logs must all belong to it.
pub(super) fn newest(ftp: &mut Ftp, logs: &[String], are_named: bool) -> Result<Session> {
    let (mut of, mut found) = (None, Session::default());
    for name in logs.iter().rev() {
        let Some(own) = number(name) else { continue };
        if found.logs.first().and_then(|log| number(log)) == Some(own) {
            found.logs.insert(0, name.clone());
            continue;
        }
        let length = ftp.open(name)?;
        match (heading_of(ftp, name, length)?.session, of) {
            (None, _) => found.unknown.insert(0, name.clone()),
            (Some(session), of) if session != of.unwrap_or(session) => {
                if !are_named {
                    break;
                }
                let other = found.logs.first().map_or("", String::as_str);
                return Err(usage(format!(
                    "{name} and {other} are of two sessions, and a moment is of one: name only the logs of one"
                )));
            }
            (session, _) => {
                of = session;
                found.logs.insert(0, name.clone());
            }
        }
    }
    if found.logs.is_empty() {
        // The sectors after its beginning may be readable.
        found.logs.extend(found.unknown.pop());
    }
    if found.logs.is_empty() {
        bail!("the board has no log");
    }
    Ok(found)
}
