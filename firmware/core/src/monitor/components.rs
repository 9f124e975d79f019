//! The vehicle's components in the monitor, and their replacement.

use super::Monitor;
use crate::component::{Component, ComponentFigures, ComponentKind, Label, Status};
use crate::lifetime::ItemKey;
use crate::trend::Resistance;

impl Monitor {
    /// Figures and status of a component.
    pub fn component_figures(&self, place: usize) -> Option<(ComponentFigures, Status)> {
        let component =
            self.components.get(place).filter(|component| component.kind != ComponentKind::None)?;
        let totals = &self.usage.counted;
        Some((component.figures(totals), component.status(place, totals, &self.params)))
    }

    /// The part of a component's life that is used, percent; `None` if it has no limit.
    pub fn component_used_percent(&self, place: usize) -> Option<f32> {
        self.components.get(place)?.used_percent(place, &self.usage.counted, &self.params)
    }

    /// Whether the wear of parts is judged. Until a card's settings are read, a stored part may be a replaced one.
    pub const fn set_parts_known(&mut self, known: bool) {
        self.parts_known = known;
    }

    /// Takes a component from another monitor of this vehicle in this session: later counts add to it.
    pub fn learn_component(&mut self, place: usize, known: Component) {
        if let Some(component) = self.components.get_mut(place) {
            *component = known;
            component.set_figures(known.ran, &self.usage.counted);
        }
    }

    /// Puts a new part in a component's place. Returns the old one with its figures, for the record; `None` if there
    /// is no such component.
    pub fn replace_component(&mut self, place: usize, serial: Label) -> Option<Component> {
        let Self { usage, components, saving, .. } = self;
        let component =
            components.get_mut(place).filter(|component| component.kind != ComponentKind::None)?;
        let old = component.replace(serial, &usage.counted);
        saving.hurry(ItemKey::Component(place as u8));
        if old.kind == ComponentKind::Battery {
            for (number, resistance) in (1..).zip(&mut self.derived.resistance) {
                if old.number == 0 || old.number == number {
                    *resistance = Resistance::default();
                }
            }
        }
        Some(old)
    }
}
