//! The tag `vehicle` is the autopilot's unique id, as in `hums decode`. It is reported only on request,
//! perhaps seconds after the first frame. Until then points wait with a mark, at most [`WAIT`] and
//! [`WAITING_BYTES_MAX`]. A vehicle without an id is `system-1`, until it reports one.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant as Wall, SystemTime, UNIX_EPOCH};

use anyhow::{Result, anyhow};

use super::batch::Batch;
use crate::decode::formats::influx::Tags;
use crate::live::world::World;

/// The id is requested at once, and again after some seconds.
pub const WAIT: Duration = Duration::from_secs(10);
/// A fast link in that time.
pub const WAITING_BYTES_MAX: usize = 8 * 1024 * 1024;

/// Sorted by the second; two of one second agree once in four thousand million.
pub fn session(now: SystemTime) -> Result<String> {
    let seconds = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    Ok(format!("s{:08x}{:08x}", seconds as u32, u32::from_le_bytes(random()?)))
}

fn random<const N: usize>() -> Result<[u8; N]> {
    let mut random = [0; N];
    getrandom::fill(&mut random).map_err(|error| anyhow!("this PC has no random numbers: {error}"))?;
    Ok(random)
}

/// Names of vehicles and sessions, as far as known.
#[derive(Debug)]
pub struct Names {
    session: String,
    /// Vehicles by system, with their unique ids; 0 if unknown.
    vehicles: BTreeMap<u8, u64>,
    tags: BTreeMap<u8, (String, Tags)>,
    /// No vehicle can guess it.
    mark: String,
    waiting: Option<Waiting>,
}

#[derive(Debug, Default)]
struct Waiting {
    batch: Batch,
    since: Option<Wall>,
    systems: BTreeSet<u8>,
}

impl Names {
    /// `session` tags every point.
    pub fn new(session: String) -> Result<Self> {
        let mark = format!("mark-{:016x}-", u64::from_le_bytes(random()?));
        let (vehicles, tags) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { session, vehicles, tags, mark, waiting: Some(Waiting::default()) })
    }

    /// All facts, before a recording's first point.
    pub fn know(&mut self, world: &World) {
        self.learn(world);
        self.waiting = None;
    }

    fn learn(&mut self, world: &World) {
        for (system, craft) in &world.crafts {
            let told = craft.monitor.vehicle().identity.get().map_or(0, |identity| identity.uid);
            let uid = self.vehicles.entry(*system).or_default();
            *uid = if told == 0 { *uid } else { told };
        }
    }

    /// Whether points wait for a name.
    pub fn is_waiting(&self) -> bool {
        self.waiting.is_some()
    }

    /// Number of points that wait for a name.
    pub fn points_waiting(&self) -> u64 {
        self.waiting.as_ref().map_or(0, |waiting| waiting.batch.points)
    }

    /// The tags of a system's points. Senders that are no vehicle get the first vehicle's.
    pub fn tags(&mut self, system: u8, world: &World) -> Tags {
        let name = if let Some(waiting) = &mut self.waiting {
            waiting.systems.insert(system);
            self.place(system)
        } else {
            self.learn(world);
            self.name(system)
        };
        match self.tags.get(&system) {
            Some((known, tags)) if *known == name => tags.clone(),
            _ => {
                let tags = Tags::new(&self.session, &name);
                self.tags.insert(system, (name, tags.clone()));
                tags
            }
        }
    }

    fn place(&self, system: u8) -> String {
        format!("{}{system:03}", self.mark)
    }

    fn name(&self, system: u8) -> String {
        let own = self.vehicles.get_key_value(&system);
        match own.or_else(|| self.vehicles.first_key_value()) {
            None => "unknown".to_owned(),
            Some((owner, 0)) => format!("system-{owner}"),
            Some((_, uid)) => format!("uid-{uid:016x}"),
        }
    }

    /// Returns them if no name is awaited.
    pub fn pass(&mut self, batch: Batch) -> Option<Batch> {
        let Some(waiting) = &mut self.waiting else { return Some(batch) };
        waiting.since.get_or_insert_with(Wall::now);
        waiting.batch.text.extend_from_slice(&batch.text);
        waiting.batch.points += batch.points;
        None
    }

    /// Waiting points, once all vehicles are named, or their time is over.
    pub fn settle(&mut self, world: &World) -> Option<Batch> {
        let waiting = self.waiting.as_ref()?;
        let late = waiting.since.is_some_and(|since| since.elapsed() >= WAIT)
            || waiting.batch.text.len() >= WAITING_BYTES_MAX;
        self.learn(world);
        let told = !self.vehicles.is_empty() && self.vehicles.values().all(|uid| *uid != 0);
        if told || late { self.end() } else { None }
    }

    /// The waiting points, with the names known so far.
    pub fn end(&mut self) -> Option<Batch> {
        let Waiting { mut batch, systems, .. } = self.waiting.take()?;
        // Already replaced as a field.
        let mut text = String::from_utf8_lossy(&batch.text).into_owned();
        for system in systems {
            text = text.replace(&self.place(system), &self.name(system));
        }
        batch.text = text.into_bytes();
        Some(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_that_begin_in_one_second_have_names_of_their_own_in_the_order_of_time() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        let names: BTreeSet<String> =
            (0..100).map(|_| session(at(0x6a0f_3c21)).expect("random numbers")).collect();
        assert_eq!(names.len(), 100);
        assert!(names.iter().all(|name| name.starts_with("s6a0f3c21") && name.len() == 17), "{names:?}");
        assert!(session(at(0x6a0f_3c22)).expect("random numbers") > *names.last().expect("some"));
    }
}
