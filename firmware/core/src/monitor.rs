//! The monitor: vehicle, flight, health and usage, kept together in step.

use crate::baseline::{Baselines, Quantity};
use crate::component::{COMPONENTS_MAX, Component, Figures, Kind, Label, Status};
use crate::derived::Derived;
use crate::exceedance::Exceedances;
use crate::exposure::Exposure;
use crate::flight::{Flight, FlightEvent};
use crate::health::{Finding, Health, Inputs};
use crate::lifetime::{Airframe, ITEM_BYTES_MAX, ItemKey, Lifetime, Saving, Unreadable};
use crate::observation::{MOTORS_MAX, Observation, Source};
use crate::params::Params;
use crate::status::{LinkReading, RecorderStatus};
use crate::time::{Instant, Span};
use crate::usage::{Usage, baseline_number, exposure_number};
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// How often [`Monitor::tick`] is to be called: a finding comes at most this much after its debounce.
pub const TICK: Span = Span::from_millis(50);

/// Everything that the monitor knows and decides.
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    params: Params,
    vehicle: Vehicle,
    flight: Flight,
    derived: Derived,
    health: Health,
    usage: Usage,
    /// What was lived before this session.
    before: Lifetime,
    baselines: Baselines,
    exceedances: Exceedances,
    exposure: Exposure,
    components: [Component; COMPONENTS_MAX],
    saving: Saving,
    was_armed: bool,
}

const _: () = assert!(size_of::<Monitor>() <= 12 * 1024);

impl Monitor {
    /// Before the first observation.
    pub const fn new(params: Params) -> Self {
        Self {
            params,
            vehicle: Vehicle::unknown(),
            flight: Flight::grounded(),
            derived: Derived::new(),
            health: Health::new(),
            usage: Usage::new(),
            before: Lifetime::new(),
            baselines: Baselines::new(),
            exceedances: Exceedances::new(),
            exposure: Exposure::new(),
            components: [Component::NONE; COMPONENTS_MAX],
            saving: Saving::new(),
            was_armed: false,
        }
    }

    /// Takes what somebody on the link said; `false` when it is not of the monitored vehicle.
    pub fn observe(&mut self, at: Instant, source: Source, observation: &Observation) -> bool {
        if !self.vehicle.observe(at, source, observation) {
            return false;
        }
        self.derived.observe(at, &self.vehicle, observation);
        self.usage.observe(at, &self.vehicle, &self.flight, &self.derived, observation);
        true
    }

    /// One step, every [`TICK`]: flight, checks, usage. Each change of a check's level is given to `findings`, once.
    pub fn tick(
        &mut self,
        now: Instant,
        link: &LinkReading,
        recorder: &RecorderStatus,
        findings: &mut impl FnMut(&Finding),
    ) {
        let event = self.flight.step(now, &self.vehicle);
        self.derived.step(now, &self.vehicle, event, recorder.frames_lost);
        self.usage.step(now, &self.vehicle, &self.flight, event, &self.params);
        let inputs = Inputs {
            now,
            vehicle: &self.vehicle,
            flight: &self.flight,
            derived: &self.derived,
            link,
            recorder,
            params: &self.params,
        };
        let mut crossed = false;
        self.health.step(&inputs, &mut self.exceedances, &mut |finding| {
            crossed = true;
            findings(finding);
        });
        if crossed || self.exceedances.lasting() {
            self.saving.change(ItemKey::Exceedances);
        }
        if self.exposure.step(now, &self.vehicle, &self.usage) {
            self.saving.change(ItemKey::Exposure);
        }
        self.step_life(event);
    }

    /// Whose life it is, and what of it is to be saved.
    fn step_life(&mut self, event: Option<FlightEvent>) {
        let uid = self.vehicle.identity.get().map_or(0, |identity| identity.uid);
        let seen = Airframe { system: self.vehicle.source.map_or(0, |source| source.system), uid };
        if self.before.airframe.differs(seen) {
            // A lifetime belongs to an airframe: this one's begins with this session.
            self.before = Lifetime { boots: self.before.boots, ..Lifetime::new() };
            self.baselines = Baselines::new();
            self.exceedances.forget_life();
            self.exposure.forget_life();
            for key in [ItemKey::Lifetime, ItemKey::Baselines, ItemKey::Exceedances, ItemKey::Exposure] {
                self.saving.hurry(key);
            }
        }
        self.before.airframe = self.before.airframe.learn(seen);
        self.saving.change(ItemKey::Lifetime);
        for place in 0..COMPONENTS_MAX {
            self.describe_component(place);
        }
        let armed = self.vehicle.armed();
        if event == Some(FlightEvent::Landing) || (self.was_armed && !armed) {
            self.saving.hurry_all();
        }
        self.was_armed = armed;
    }

    fn describe_component(&mut self, place: usize) {
        let Self { usage, params, components, saving, .. } = self;
        let wear = usage.wear();
        let Some(component) = components.get_mut(place) else { return };
        let key = ItemKey::Component(place as u8);
        if component.describe(place, &wear, params) {
            saving.hurry(key);
        } else if component.kind != Kind::None {
            saving.change(key);
        }
    }

    /// The vehicle as it is known.
    pub const fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// On the ground or in the air.
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

    /// Takes an item that was saved in an earlier session; to be called before the first tick. One that cannot be read
    /// is as if there were none.
    pub fn restore(&mut self, key: ItemKey, stored: &[u8]) -> Result<(), Unreadable> {
        match key {
            ItemKey::Lifetime => self.before = Lifetime::decode(stored)?,
            ItemKey::Baselines => self.baselines = Baselines::decode(stored)?,
            ItemKey::Exceedances => self.exceedances = Exceedances::decode(stored)?,
            ItemKey::Exposure => self.exposure = Exposure::decode(stored)?,
            ItemKey::Component(place) => {
                let component = Component::decode(stored)?;
                *self.components.get_mut(usize::from(place)).ok_or(Unreadable)? = component;
            }
        }
        Ok(())
    }

    /// The item to be saved next, if any is due; the same until it is [`Self::saved`].
    pub fn save_due(&mut self, now: Instant) -> Option<ItemKey> {
        self.saving.due(now)
    }

    /// Everything that changed is due: the session ends, or the power is about to go.
    pub const fn save_all(&mut self) {
        self.saving.hurry_all();
    }

    /// Writes an item as it is to be saved; gives its length.
    pub fn encode_item(&self, key: ItemKey, out: &mut [u8; ITEM_BYTES_MAX]) -> usize {
        match key {
            ItemKey::Lifetime => encoded(out, |out| self.lifetime().encode(out)),
            ItemKey::Baselines => encoded(out, |out| self.baselines.encode(out)),
            ItemKey::Exceedances => {
                out.first_chunk_mut().map_or(0, |out| self.exceedances.encode(self.usage.until(), out))
            }
            ItemKey::Exposure => encoded(out, |out| self.exposure.encode(out)),
            ItemKey::Component(place) => {
                let component = self.components.get(usize::from(place)).unwrap_or(&Component::NONE);
                encoded(out, |out| component.encode(&self.usage.wear(), out))
            }
        }
    }

    /// The item's bytes are with the store.
    pub const fn saved(&mut self, key: ItemKey) {
        self.saving.saved(key);
    }

    /// The airframe's life, this session included.
    pub fn lifetime(&self) -> Lifetime {
        let heard = self.vehicle.source.is_some();
        Lifetime {
            airframe: self.before.airframe,
            boots: self.before.boots.saturating_add(1),
            sessions: self.before.sessions.saturating_add(u32::from(heard)),
            totals: self.before.totals.join(&self.usage.totals()),
        }
    }

    /// Every figure of this session that has something to say: its stored number and its value.
    pub fn for_each_counter(&self, mut each: impl FnMut(u8, f64)) {
        self.usage.for_each(&mut each);
        self.exposure.for_each(|quantity, bin, seconds| each(exposure_number(quantity, bin), seconds));
    }

    /// The same of the airframe's life, with its baselines.
    pub fn for_each_counter_of_life(&self, mut each: impl FnMut(u8, f64)) {
        self.lifetime().totals.for_each(&mut each);
        self.exposure
            .for_each_of_life(|quantity, bin, seconds| each(exposure_number(quantity, bin), seconds));
        for quantity in (0..Quantity::COUNT).filter_map(Quantity::from_index) {
            let baseline = self.baselines.get(quantity);
            if baseline.flights > 0 {
                each(baseline_number(quantity), f64::from(baseline.value));
            }
        }
    }

    /// What is normal for this airframe.
    pub const fn baselines(&self) -> &Baselines {
        &self.baselines
    }

    /// Limits that were crossed.
    pub const fn exceedances(&self) -> &Exceedances {
        &self.exceedances
    }

    /// Time in ranges.
    pub const fn exposure(&self) -> &Exposure {
        &self.exposure
    }

    /// The components by place; those without a kind are none.
    pub const fn components(&self) -> &[Component; COMPONENTS_MAX] {
        &self.components
    }

    /// What a component has run, and whether it may go on.
    pub fn component_figures(&self, place: usize) -> Option<(Figures, Status)> {
        let component = self.components.get(place).filter(|component| component.kind != Kind::None)?;
        let wear = self.usage.wear();
        Some((component.figures(&wear), component.status(place, &wear, &self.params)))
    }

    /// The part of a component's life that is used, percent; `None` where it has no limit.
    pub fn component_used_percent(&self, place: usize) -> Option<f32> {
        self.components.get(place)?.used_percent(place, &self.usage.wear(), &self.params)
    }

    /// Another part is in a component's place. Gives the old one with what it had run, to be recorded; `None` where
    /// there is no such component.
    pub fn replace_component(&mut self, place: usize, serial: Label) -> Option<Component> {
        let Self { usage, components, saving, .. } = self;
        let component = components.get_mut(place).filter(|component| component.kind != Kind::None)?;
        let old = component.replace(serial, &usage.wear());
        saving.hurry(ItemKey::Component(place as u8));
        self.forget_baselines(old.kind, old.number);
        Some(old)
    }

    /// What the operator calls a component, and its serial number, without replacing it.
    pub fn name_component(&mut self, place: usize, name: Label, serial: Label) -> bool {
        let Some(component) = self.components.get_mut(place) else { return false };
        (component.name, component.serial) = (name, serial);
        self.saving.hurry(ItemKey::Component(place as u8));
        true
    }

    /// What was normal for the old part is not for the new one.
    fn forget_baselines(&mut self, kind: Kind, number: u8) {
        let concerned = |index: usize| number == 0 || usize::from(number) == index + 1;
        match kind {
            Kind::Airframe => self.baselines = Baselines::new(),
            Kind::Battery => {
                for battery in (0..BATTERIES_MAX).filter(|battery| concerned(*battery)) {
                    self.baselines.forget(Quantity::Resistance(battery as u8));
                }
            }
            Kind::Motor | Kind::Propeller | Kind::Esc => {
                for motor in (0..MOTORS_MAX).filter(|motor| concerned(*motor)) {
                    self.baselines.forget(Quantity::MotorSpeed(motor as u8));
                }
                self.baselines.forget(Quantity::Vibration);
                self.baselines.forget(Quantity::HoverThrottle);
            }
            Kind::None | Kind::Card | Kind::Engine | Kind::Other => return,
        }
        self.saving.hurry(ItemKey::Baselines);
    }
}

/// Writes at the start of the buffer; gives the length.
fn encoded<const N: usize>(out: &mut [u8; ITEM_BYTES_MAX], encode: impl FnOnce(&mut [u8; N])) -> usize {
    const { assert!(N <= ITEM_BYTES_MAX) };
    out.first_chunk_mut().map_or(0, |out| {
        encode(out);
        N
    })
}
