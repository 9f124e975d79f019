//! Which part of a log is wanted: `--from`, `--to`, `--message`.

use std::cmp::Ordering;

use anyhow::Result;
use hums_blackbox::Gap;
use hums_core::clock::Instant;

use crate::args::Decode;
use crate::outcome::usage;
use crate::source::epochs::Epochs;
use crate::utc::TimePoint;

/// The selected entries.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    from: Option<TimePoint>,
    to: Option<TimePoint>,
    ids: Vec<u32>,
    /// The names as they were given: those of other messages than MAVLink's.
    names: Vec<String>,
}

impl Selection {
    /// As the command line says it; `native` says that there are messages other than MAVLink's, with names of their own.
    pub fn new(args: &Decode, native: bool) -> Result<Self> {
        let ids = args.message.iter().map(|name| id_of(name));
        // A name other than an id selects a number that does not occur, because an empty list would select
        // all.
        let other = |id: Result<u32>| id.or_else(|error| if native { Ok(u32::MAX) } else { Err(error) });
        let ids = ids.map(other).collect::<Result<_>>()?;
        let is_backwards = match (args.from, args.to) {
            (Some(TimePoint::Seconds(from)), Some(TimePoint::Seconds(to)))
            | (Some(TimePoint::Utc(from)), Some(TimePoint::Utc(to))) => from > to,
            _ => false,
        };
        if is_backwards {
            return Err(usage("--from is later than --to: nothing lies between them"));
        }
        Ok(Self { from: args.from, to: args.to, ids, names: args.message.clone() })
    }

    /// The selection within this time.
    pub fn within(&self, (from, to): (Instant, Instant)) -> Self {
        let limit = |at: Instant| Some(TimePoint::Seconds(at.as_micros()));
        Self { from: limit(from), to: limit(to), ..self.clone() }
    }

    /// The names of the wanted messages; all if empty.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether the selection has a time limit.
    pub fn has_limits(&self) -> bool {
        self.from.is_some() || self.to.is_some()
    }

    /// Whether it selects less than all.
    pub fn is_part(&self) -> bool {
        self.has_limits() || !self.names.is_empty()
    }

    /// A time in UTC selects nothing in a log without UTC: that is an error, not a guess.
    pub fn check_without_utc(&self, log: &str) -> Result<()> {
        if [self.from, self.to].iter().any(|when| matches!(when, Some(TimePoint::Utc(_)))) {
            return Err(usage(format!(
                "{log}: the time of day is not known in this log; give --from and --to as seconds of its own time, as its tables have them"
            )));
        }
        Ok(())
    }

    /// Whether this time is wanted.
    pub fn has_time(&self, at: Instant, epochs: &Epochs) -> bool {
        !self.is_before(at, epochs) && !self.is_after(at, epochs)
    }

    /// Whether any of a gap is in the time wanted.
    pub fn overlaps(&self, gap: &Gap, epochs: &Epochs) -> bool {
        !gap.to.is_some_and(|to| self.is_before(to, epochs))
            && !gap.from.is_some_and(|from| self.is_after(from, epochs))
    }

    fn is_before(&self, at: Instant, epochs: &Epochs) -> bool {
        self.from.and_then(|from| compare(at, from, epochs)).is_some_and(Ordering::is_lt)
    }

    fn is_after(&self, at: Instant, epochs: &Epochs) -> bool {
        self.to.and_then(|to| compare(at, to, epochs)).is_some_and(Ordering::is_gt)
    }

    /// Whether frames of this message are wanted.
    pub fn has_id(&self, id: u32) -> bool {
        self.ids.is_empty() || self.ids.contains(&id)
    }
}

fn compare(at: Instant, limit: TimePoint, epochs: &Epochs) -> Option<Ordering> {
    match limit {
        TimePoint::Seconds(limit) => Some(at.as_micros().cmp(&limit)),
        TimePoint::Utc(limit) => Some(epochs.utc_us(at)?.cmp(&limit)),
    }
}

fn id_of(name: &str) -> Result<u32> {
    let upper = name.to_ascii_uppercase();
    if let Some(message) = hums_dialect::messages().iter().find(|message| message.name == upper) {
        return Ok(message.id);
    }
    let number = upper.strip_prefix("UNKNOWN_").unwrap_or(&upper);
    number.parse().map_err(|_| {
        let mut near: Vec<&str> = hums_dialect::messages().iter().map(|message| message.name).collect();
        near.retain(|known| known.contains(&upper) || upper.contains(known));
        near.truncate(5);
        let hint = if near.is_empty() { String::new() } else { format!("; there is {}", near.join(", ")) };
        usage(format!("--message {name}: no message has this name{hint}; `hums info LOG` lists a log's"))
    })
}
