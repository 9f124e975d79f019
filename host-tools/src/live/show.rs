//! The present state as text for the pages.

use std::borrow::Cow;

use hums_core::clock::Instant;
use hums_core::component::COMPONENTS_MAX;
use hums_core::usage::UsageCounter;
use serde::Serialize;
use serde_json::Value;

use super::board::{self, HealthBoard};
use super::companion::CompanionJson;
use super::craft::Craft;
use super::values::{self, Values};
use super::world::World;
use crate::counters::{about, is_told, tells_flight};
use crate::names::{autopilot_name, type_name};
use crate::page::json::json;
use crate::page::modes;
use crate::part;

/// The bytes' source and state.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SourceJson {
    /// As the command line names it.
    pub name: String,
    /// Can be paused and sought.
    pub recording: bool,
    /// `waiting`, `live`, `silent`, `lost`, `reading`, `playing`, `paused`, `ended` or `failed`.
    pub phase: &'static str,
    /// More in words.
    pub words: String,
    /// The end of a HUMS log, in words.
    pub log_end: Option<String>,
    /// Progress of reading, 0 to 1.
    pub progress: f64,
    /// A recording's beginning and end, seconds.
    pub start_s: f64,
    /// See `start_s`.
    pub end_s: f64,
    /// Seconds a second.
    pub speed: f64,
}

#[derive(Serialize)]
struct Head<'a> {
    t: &'static str,
    source: &'a SourceJson,
    now_s: f64,
    /// Milliseconds since 1970, if known.
    utc_ms: Option<u64>,
    frames_s: f64,
    vehicles: Vec<VehicleJson>,
    influx: Option<&'a super::influx::Figures>,
}

#[derive(Serialize)]
struct VehicleJson {
    system: u8,
    name: String,
    overall: &'static str,
    heard_ms: u64,
}

/// The head's data, apart from the world.
#[derive(Clone, Debug)]
pub struct HeadInputs<'a> {
    /// The source.
    pub source: &'a SourceJson,
    /// UTC of time zero, microseconds since 1970.
    pub epoch_us: Option<u64>,
    /// Frames a second, lately.
    pub frames_s: f64,
    /// Points for a database.
    pub influx: Option<super::influx::Figures>,
}

/// Source, time and vehicles; each vehicle by system id.
pub fn all(world: &World, now: Instant, around: &HeadInputs<'_>) -> (String, Vec<(u8, String)>) {
    let boards: Vec<_> = world.crafts.values().map(|craft| HealthBoard::of(craft, now)).collect();
    let crafts = || world.crafts.iter().zip(&boards);
    let vehicles = crafts().map(|((system, craft), board)| VehicleJson {
        system: *system,
        name: name(craft),
        overall: board.overall,
        heard_ms: now.since(craft.heard).as_millis(),
    });
    let head = json(&Head {
        t: "head",
        source: around.source,
        now_s: now.as_secs_f64(),
        utc_ms: around.epoch_us.map(|epoch| epoch.saturating_add(now.as_micros()) / 1000),
        frames_s: around.frames_s,
        vehicles: vehicles.collect(),
        influx: around.influx.as_ref(),
    });
    (head, crafts().map(|((system, craft), board)| (*system, state(*system, craft, board, now))).collect())
}

#[derive(Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
struct State<'a> {
    t: &'static str,
    vehicle: u8,
    now_s: f64,
    name: String,
    firmware: Option<String>,
    armed: bool,
    airborne: bool,
    tells_flight: bool,
    phase: &'static str,
    mode: Cow<'static, str>,
    overall: &'static str,
    overall_said: Option<&'a str>,
    /// The last level before it became unknown.
    overall_was: Option<&'static str>,
    heard_ms: u64,
    px4: bool,
    values: Values,
    motors: Vec<Values>,
    cells: Vec<f32>,
    board: &'a [board::SubsystemState],
    usage: Vec<Value>,
    components: Vec<ComponentJson>,
    link: LinkJson,
    companion: Option<CompanionJson>,
}

// Structures keep 32-bit numbers short: a JSON value widens 15.3 to 15.300000190734863.

#[derive(Serialize)]
struct LinkJson {
    frames: u64,
    missing: u64,
    loss_percent: Option<f32>,
    reboots: u32,
}

#[derive(Serialize)]
struct ComponentJson {
    kind: &'static str,
    number: u8,
    name: String,
    status: &'static str,
    used_percent: Option<f32>,
    /// Reached first.
    limit: Option<String>,
    flight_h: f64,
    flights: f64,
    life: bool,
}

fn state(system: u8, craft: &Craft, board: &HealthBoard, now: Instant) -> String {
    let vehicle = craft.monitor.vehicle();
    let heartbeat = vehicle.heartbeat.get().copied().unwrap_or_default();
    let px4 = heartbeat.autopilot == hums_core::observation::Autopilot::Px4;
    let identity = vehicle.identity.get().filter(|identity| identity.firmware != 0);
    let [major, minor, patch, _] = identity.map_or(0, |identity| identity.firmware).to_be_bytes();
    json(&State {
        t: "state",
        vehicle: system,
        now_s: now.as_secs_f64(),
        name: name(craft),
        firmware: identity.map(|_| format!("{major}.{minor}.{patch}")),
        armed: heartbeat.armed,
        airborne: craft.monitor.flight().airborne(),
        tells_flight: tells_flight(vehicle),
        phase: craft.phase(now).name(),
        mode: modes::name(&heartbeat),
        overall: board.overall,
        overall_said: board.said.as_deref(),
        overall_was: board.was,
        heard_ms: now.since(craft.heard).as_millis(),
        px4,
        values: values::of_vehicle(craft, now),
        motors: values::of_motors(craft, now),
        cells: vehicle.batteries[0]
            .get()
            .map(|battery| battery.cells.iter().flatten().map(|cell| cell.volts().0).collect())
            .unwrap_or_default(),
        board: &board.parts,
        usage: usage(craft),
        components: components(craft),
        link: LinkJson {
            frames: craft.frames,
            missing: craft.missing,
            loss_percent: craft.loss.map(|loss| loss * 100.0),
            reboots: vehicle.reboots,
        },
        companion: craft.companion.json(now),
    })
}

fn name(craft: &Craft) -> String {
    let heartbeat = craft.monitor.vehicle().heartbeat.get().copied().unwrap_or_default();
    format!("{} {}", autopilot_name(heartbeat.autopilot_number), type_name(heartbeat.type_number))
}

const SHOWN: [UsageCounter; 12] = [
    UsageCounter::Flight,
    UsageCounter::Flights,
    UsageCounter::Armed,
    UsageCounter::Distance,
    UsageCounter::HeightMax,
    UsageCounter::SpeedMax,
    UsageCounter::Charge,
    UsageCounter::Energy,
    UsageCounter::VoltageMin,
    UsageCounter::CurrentMax,
    UsageCounter::HardLandings,
    UsageCounter::LoadFactorMax,
];

/// A counter's value is `null` if unknown.
fn usage(craft: &Craft) -> Vec<Value> {
    let (usage, vehicle) = (craft.monitor.usage(), craft.monitor.vehicle());
    let counter = |counter: UsageCounter| {
        let (title, unit, decimals) = about(counter);
        let value = usage.value(counter).filter(|_| is_told(counter.name(), vehicle));
        serde_json::json!({ "name": counter.name(), "title": title, "unit": unit, "decimals": decimals, "value": value })
    };
    SHOWN.into_iter().map(counter).collect()
}

fn components(craft: &Craft) -> Vec<ComponentJson> {
    let of_place = |place: usize| {
        let component = craft.monitor.components().get(place)?;
        let (figures, status) = craft.monitor.component_figures(place)?;
        Some(ComponentJson {
            kind: component.kind.name(),
            number: component.number,
            name: component.name.as_str().to_owned(),
            status: status.name(),
            used_percent: craft.monitor.component_used_percent(place).filter(|percent| percent.is_finite()),
            limit: part::of(&craft.monitor, place).and_then(|(_, limit)| limit),
            flight_h: figures.flight_s / 3_600.0,
            flights: figures.flights,
            life: craft.knows_life(place),
        })
    };
    (0..COMPONENTS_MAX).filter_map(of_place).collect()
}
