//! A battery's capacity: the charge that it gave, divided by the fall of its cells' state of charge since the rest
//! before take-off.
//!
//! The state of charge follows from the cell voltage without load: in flight the measured one without its sag. The
//! curve belongs to one polymer lithium-ion cell, and another cell differs. So the figure is not the capacity on the
//! label, and is compared only with its own past.

use crate::derived::Derived;
use crate::latest::Latest;
use crate::parameters::Params;
use crate::units::Amperes;
use crate::vehicle::Vehicle;

/// The highest state on the curve: 4.25 V.
const FULL: f32 = 1.15;
/// The least fall of the state of charge. An error of 10 mV is 5 % of it in the flat part of the curve.
const FALL_MIN: f32 = 0.3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Charge {
    state: f32,
    consumed_ah: f32,
}

impl Charge {
    /// The state of a battery; `None` unless it is a lithium battery with known cells and charge.
    pub(crate) fn of(vehicle: &Vehicle, derived: &Derived, params: &Params, battery: u8) -> Option<Self> {
        let known = vehicle.batteries.get(usize::from(battery)).and_then(Latest::get)?;
        let consumed_ah = known.consumed?.0;
        let cell_v = derived.cell_voltage(vehicle, params, battery)?.value;
        (consumed_ah.is_finite() && cell_v.is_finite())
            .then(|| Self { state: state_of_charge(cell_v), consumed_ah })
    }

    /// The whole capacity, Ah, from the state `now` in flight; `None` if too little was taken, or if the sag under
    /// load is not known.
    pub(crate) fn capacity_ah(&self, now: &Self, derived: &Derived, battery: u8) -> Option<f32> {
        let sags = derived.resistance.get(usize::from(battery))?.sag_v(Amperes(1.0)) > 0.0;
        let fall = self.state - now.state;
        (sags && fall >= FALL_MIN).then(|| (now.consumed_ah - self.consumed_ah) / fall)
    }
}

/// The state of charge, 0 empty and 1 full, of a cell with this voltage without load. The voltage over it: M. Chen and G. A. Rincon-Mora,
/// Accurate electrical battery model, IEEE Transactions on Energy Conversion 21(2), 2006.
fn state_of_charge(cell_v: f32) -> f32 {
    let volts = |state: f32| {
        -1.031 * libm::expf(-35.0 * state) + 3.685 + state * (0.2156 + state * (-0.1178 + state * 0.3201))
    };
    let (mut low, mut high) = (0.0, FULL);
    // To a thousandth.
    for _ in 0..11 {
        let middle = f32::midpoint(low, high);
        if volts(middle) < cell_v {
            low = middle;
        } else {
            high = middle;
        }
    }
    f32::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_of_charge_rises_with_the_voltage() {
        assert!((state_of_charge(4.103) - 1.0).abs() < 0.01);
        assert!((state_of_charge(3.80) - 0.49).abs() < 0.02);
        assert!(state_of_charge(3.0) < 0.02);
        assert!(state_of_charge(4.2) > 1.05);
        assert!((state_of_charge(9.0) - FULL).abs() < 0.01 && state_of_charge(0.0) < 0.01);
    }
}
