//! The monitor: vehicle, flight, health and usage, kept together in step.

mod components;
mod stored;

use core::mem::MaybeUninit;

use crate::apart::{apart, made_in_place};
use crate::battery_cells;
use crate::component::{COMPONENTS_MAX, Component, ComponentKind};
use crate::derived::Derived;
use crate::figures::{Figures, Quantity};
use crate::flight::{Flight, FlightEvent, Phase};
use crate::happening::{Happening, Happenings};
use crate::health::exceedance::Exceedances;
use crate::health::{Finding, Health, Inputs, Subsystem};
use crate::latest::Latest;
use crate::lifetime::{ItemKey, Lifetime, Saving};
use crate::observation::{Feeds, Observation, Source};
use crate::parameters::{Param, Params};
use crate::protect::{Protect, Request};
use crate::status::{LinkReading, RecorderStatus};
use crate::time::{BootMs, Millis};
use crate::usage::{Usage, UsageCounter, figure_number};
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// How often [`Monitor::tick`] is to be called: a finding comes at most this much after its debounce.
pub const TICK: Millis = Millis::from_millis(50);

made_in_place! {
    /// Everything that the monitor knows and decides.
    #[derive(Clone, Copy, Debug)]
    pub struct Monitor(params: &Params) {
        params: Params = *params,
        vehicle: Vehicle,
        flight: Flight,
        derived: Derived,
        health: Health,
        usage: Usage,
        /// Totals of earlier sessions.
        before: Lifetime,
        exceedances: Exceedances,
        components: [Component; COMPONENTS_MAX] = [Component::default(); COMPONENTS_MAX],
        /// For each component its subsystem and the used part of its life, percent; one is updated each tick.
        wear: [Option<(Subsystem, f32)>; COMPONENTS_MAX] = [None; COMPONENTS_MAX],
        wear_next: u8,
        figures: Figures,
        protect: Protect,
        saving: Saving,
        happenings: Happenings,
        before_tick: Before,
        ticked_at: BootMs,
        cells_told: bool,
        parameters_asked: bool,
        parts_known: bool = true,
    }
}

state! {
    struct Before {
        armed: bool,
        reboots: u32,
        phase: Phase = Phase::Ground,
        changes: u32,
        next_phase: Phase = Phase::Ground,
        next_since: BootMs,
    }
}

/// A phase that lasts less is not reported: speeds cross their limits back and forth.
const PHASE_LASTS: Millis = Millis::from_secs(1);

/// After this time unknown cells are reported, if the parameters were not asked for.
const CELLS_COME: Millis = Millis::from_secs(45);

const _: () = assert!(size_of::<Monitor>() <= 16 * 1024 - 64);

fn carries(vehicle: &Vehicle, battery: usize) -> bool {
    let known = vehicle.batteries.get(battery).and_then(Latest::get);
    known.map_or(battery == 0, |known| known.lithium && known.feeds == Feeds::Vehicle)
}

fn lacks_cells(vehicle: &Vehicle, derived: &Derived, battery: usize, count: u8) -> bool {
    count == 0 && carries(vehicle, battery) && derived.cells.has_voltage(battery)
}

impl Monitor {
    /// Before the first observation.
    pub fn new(params: Params) -> Self {
        *Self::begin(&mut MaybeUninit::uninit(), &params)
    }

    /// Takes an observation from the link; `false` if it is not of the monitored vehicle.
    pub fn observe(&mut self, at: BootMs, source: Source, observation: &Observation) -> bool {
        let known = self.vehicle.observe(at, source, observation);
        if self.before_tick.changes != self.vehicle.changes {
            self.begin_with_another();
        }
        if !known {
            return false;
        }
        self.flight.observe(at, &self.vehicle, observation, &self.params);
        self.derived.observe(at, &self.vehicle, &self.flight, observation);
        self.usage.observe(at, &self.vehicle, &self.flight, &self.derived, observation);
        true
    }

    #[inline(never)] // Its new states are large: not on the stack of every observation.
    fn begin_with_another(&mut self) {
        self.before_tick = Before { changes: self.vehicle.changes, ..Before::default() };
        apart(|| self.flight = Flight::default());
        apart(|| self.derived = Derived::default());
        apart(|| self.figures = Figures::default());
        self.wear = [None; COMPONENTS_MAX];
        self.health.clear();
        self.exceedances.end(self.ticked_at);
        self.protect = Protect::default();
        self.usage.break_off();
        self.parameters_asked = false;
        self.happenings.push(Happening::OtherVehicle);
    }

    /// The autopilot was powered on again since the last observation: ends the previous flight, whose end is unknown.
    pub fn begin_anew(&mut self) {
        self.flight = Flight::default();
        self.protect = Protect::default();
        self.usage.break_off();
    }

    /// Another recording begins, of another day or vehicle: only the counters stay.
    pub fn begin_another_recording(&mut self) {
        self.vehicle = Vehicle::default();
        self.begin_with_another();
        self.cells_told = false;
    }

    /// One step, every [`TICK`]: flight, checks, usage. Each change of a check's level goes to `findings`, once.
    pub fn tick(
        &mut self,
        now: BootMs,
        link: &LinkReading,
        recorder: &RecorderStatus,
        findings: &mut dyn FnMut(&Finding),
    ) {
        self.ticked_at = now;
        let event = self.step_flight(now);
        self.derived.step(now, &self.vehicle, &self.flight, event, recorder);
        self.step_wear();
        let Self { vehicle, flight, derived, wear, params, .. } = self;
        let inputs = Inputs { now, vehicle, flight, derived, link, recorder, wear, params };
        self.figures.step(&inputs, event);
        self.usage.step(&inputs, event);
        let mut crossed = false;
        self.health.step(&inputs, &mut self.exceedances, &mut |finding| {
            crossed = true;
            findings(finding);
        });
        if crossed || self.exceedances.lasting() {
            self.saving.change(ItemKey::Exceedances);
        }
        self.usage.expose(now, inputs.vehicle);
        if let Some(step) = self.protect.step(&inputs, &self.health) {
            self.happenings.push(Happening::Protect(step));
        }
        self.step_cells(now);
        self.step_life(now, event);
        self.step_happenings(now, event);
    }

    /// The inputs of the checks now.
    pub const fn inputs<'a>(
        &'a self,
        now: BootMs,
        link: &'a LinkReading,
        recorder: &'a RecorderStatus,
    ) -> Inputs<'a> {
        let Self { vehicle, flight, derived, wear, params, .. } = self;
        Inputs { now, vehicle, flight, derived, link, recorder, wear, params }
    }

    fn step_flight(&mut self, now: BootMs) -> Option<FlightEvent> {
        let Self { vehicle, flight, params, happenings, .. } = self;
        let (change, event) = flight.step(now, vehicle, params);
        if let Some(change) = change {
            happenings.push(Happening::Mishap(change));
        }
        if flight.is_at_rest(now, vehicle) {
            vehicle.inertial.rest(now);
        }
        match event {
            // A recording that begins in the air: this flight is not counted yet.
            Some(FlightEvent::Resumed) if !self.has_open_flight() => Some(FlightEvent::TakeOff),
            event => event,
        }
    }

    fn has_open_flight(&self) -> bool {
        let count = |counter| self.before.totals.raw(counter);
        count(UsageCounter::Flights) > count(UsageCounter::Landings) + count(UsageCounter::Mishaps)
    }

    fn step_wear(&mut self) {
        let place = usize::from(self.wear_next);
        self.describe_component(place);
        let subsystem = self.components.get(place).and_then(|component| component.kind.subsystem());
        let used_percent = self.component_used_percent(place);
        if let Some(wear) = self.wear.get_mut(place) {
            *wear = subsystem.zip(used_percent).filter(|_| self.parts_known);
        }
        self.wear_next = (self.wear_next + 1) % COMPONENTS_MAX as u8;
    }

    /// Cells of the first battery; 0 if unknown, or if there are several batteries.
    pub fn cell_count(&self) -> u8 {
        let several = self.vehicle.batteries.iter().skip(1).any(|battery| battery.get().is_some());
        if several { 0 } else { self.derived.cell_count(&self.vehicle, 0, &self.params) }
    }

    /// The figure from which on vibration counts as risen in this flight; `None` until its baseline is known.
    pub fn vibration_limit(&self) -> Option<f32> {
        let times = self.params.get(Param::VibeRiseWarn);
        self.derived.crosschecks.vibration_limit(&self.vehicle, times)
    }

    /// Whether the cells of a carrying battery are unknown: then its voltage raises no alarm.
    pub fn lacks_cells(&self) -> bool {
        let Self { vehicle, derived, params, .. } = self;
        let count = |battery| derived.cell_count(vehicle, battery, params);
        (0..BATTERIES_MAX).any(|battery| lacks_cells(vehicle, derived, battery, count(battery)))
    }

    /// Keeps known cells for the next power-on, reports unknown ones once.
    fn step_cells(&mut self, now: BootMs) {
        let Self { vehicle, derived, params, before, saving, happenings, cells_told, .. } = self;
        let come = self.parameters_asked || vehicle.known_for(now) >= CELLS_COME;
        for (battery, kept) in before.cells.iter_mut().enumerate() {
            let count = derived.cell_count(vehicle, battery, params);
            let unknown = lacks_cells(vehicle, derived, battery, count);
            if unknown && come && !*cells_told {
                *cells_told = true;
                happenings.push(Happening::CellsUnknown);
            }
            let keeps = match count {
                0 if unknown && come && *kept > 0 => *kept | battery_cells::DOUBTED,
                0 => *kept,
                _ => count,
            };
            if keeps != *kept && vehicle.is_settled(now) {
                *kept = keeps;
                saving.hurry(ItemKey::Lifetime);
            }
        }
    }

    /// A parameter of the autopilot in a recording, by its name; others than those of batteries are ignored.
    pub fn learn_parameter(&mut self, name: &str, value: f32) {
        if let Some(place) = battery_cells::known(name) {
            self.derived.cells.take_setting(place, value);
        }
    }

    /// All parameters about cells were asked for: unknown cells stay unknown.
    pub const fn parameters_asked(&mut self) {
        self.parameters_asked = true;
    }

    fn step_happenings(&mut self, now: BootMs, event: Option<FlightEvent>) {
        let Self { vehicle, flight, happenings, before_tick: before, .. } = self;
        let armed = vehicle.armed();
        if armed && !before.armed {
            happenings.push(Happening::Armed);
        }
        match event {
            Some(FlightEvent::TakeOff) if flight.was_on_ground() => happenings.push(Happening::TakeOff),
            Some(FlightEvent::TakeOff | FlightEvent::Resumed) => happenings.push(Happening::FlightResumed),
            Some(FlightEvent::Landing) => happenings.push(Happening::Landing),
            None => {}
        }
        if before.armed && !armed {
            happenings.push(Happening::Disarmed);
        }
        before.armed = armed;
        if vehicle.reboots != before.reboots {
            before.reboots = vehicle.reboots;
            happenings.push(Happening::AutopilotReboot);
        }
        let phase = flight.phase(now, vehicle);
        if phase != before.next_phase {
            (before.next_phase, before.next_since) = (phase, now);
        }
        if phase != before.phase && now.since(before.next_since) >= PHASE_LASTS {
            before.phase = phase;
            happenings.push(Happening::Phase(phase));
        }
    }

    /// A component is what its parameters say, from now on.
    pub fn describe_component(&mut self, place: usize) {
        let boots = self.boots();
        let Self { usage, params, components, saving, .. } = self;
        let Some(component) = components.get_mut(place) else { return };
        let key = ItemKey::Component(place as u8);
        if component.describe(place, &usage.counted, params) {
            saving.hurry(key);
        }
        if component.kind != ComponentKind::None && component.begin(boots) {
            saving.change(key);
        }
    }

    /// The vehicle as it is known.
    pub const fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// The state of the flight.
    pub const fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Levels and roll-ups.
    pub const fn health(&self) -> &Health {
        &self.health
    }

    /// Usage since power-on.
    pub const fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Limits and settings.
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Limits and settings, to be changed.
    pub const fn params_mut(&mut self) -> &mut Params {
        &mut self.params
    }

    const fn boots(&self) -> u32 {
        self.before.boots.saturating_add(1)
    }

    const fn heard(&self) -> bool {
        self.vehicle.source.is_some()
    }

    /// The airframe's life, this session included.
    pub fn lifetime(&self) -> Lifetime {
        let mut totals = self.usage.totals();
        totals.join(&self.before.totals);
        Lifetime {
            airframe: self.before.airframe,
            boots: self.boots(),
            sessions: self.before.sessions.saturating_add(u32::from(self.heard())),
            cells: self.before.cells,
            totals,
        }
    }

    /// Every known figure of this session: its stored number and its value.
    pub fn for_each_counter(&self, mut each: impl FnMut(u8, f64)) {
        self.usage.totals().for_each(&mut each);
        for quantity in Quantity::all() {
            if let Some(figure) = self.figures.get(quantity) {
                each(figure_number(quantity), f64::from(figure));
            }
        }
    }

    /// Limits that were crossed.
    pub const fn exceedances(&self) -> &Exceedances {
        &self.exceedances
    }

    /// The components by place; without a kind there is none.
    pub const fn components(&self) -> &[Component; COMPONENTS_MAX] {
        &self.components
    }

    /// The events, in order, each once.
    pub fn take_happening(&mut self) -> Option<Happening> {
        self.happenings.take()
    }

    /// Events without a place since the last call.
    pub const fn take_happenings_lost(&mut self) -> u16 {
        core::mem::replace(&mut self.happenings.lost, 0)
    }

    /// The protective action to request from the autopilot now, once.
    pub const fn take_request(&mut self) -> Option<Request> {
        self.protect.take_request()
    }

    /// Cancels the protective action; `true` if one is on its way.
    pub const fn cancel_protection(&mut self) -> bool {
        self.protect.cancel()
    }

    /// Figures of the flight.
    pub const fn figures(&self) -> &Figures {
        &self.figures
    }
}
