//! Processor, radios, and a plane's state.

use hums_core::cause::{Alert, Cause, Urgency};
use hums_core::clock::Span;
use hums_core::observation::{LandedState, Observation, RadioControl, TelemetryRadio};

use super::handler::{Given, Handler, handler};
use super::out::Out;
use super::state::State;
use super::words::Craft;

/// `MAV_SEVERITY_WARNING`
const WARNING: u8 = 4;

pub(super) const HANDLERS: &[Handler] = &[
    handler("PM", "Load IntE", performance).said(),
    handler("RAD", "RSSI RemRSSI Noise RemNoise RxErrors", radio),
    handler("RSSI", "RXRSSI", rc),
    handler("STAT", "isFlying Armed", status),
];

/// Load in thousandths, as in `SYS_STATUS`; internal errors as bits (`AP_InternalError`).
fn performance(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let errors = given.unsigned(1).unwrap_or(0);
    let new = errors & !std::mem::replace(&mut state.internal_errors, errors);
    if new != 0 {
        let alert = Alert { cause: Cause::Processor, urgency: Urgency::Warning };
        let words = format!("Internal errors {errors:#x}");
        out.text(WARNING, &words, Some(alert));
    }
    if let Some(permille) = given.single(0).filter(|permille| (0.0..=1_000.0).contains(permille)) {
        state.load.set(given.at, permille / 1e3);
    }
}

fn radio(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let known = |slot: usize| given.byte(slot).filter(|value| *value != u8::MAX);
    out.observe(&Observation::TelemetryRadio(TelemetryRadio {
        rssi: known(0),
        remote_rssi: known(1),
        noise: known(2),
        remote_noise: known(3),
        errors: given.unsigned(4).and_then(|errors| errors.try_into().ok()).unwrap_or_default(),
    }));
}

/// A part of one (`RC_CHANNELS`: 0 to 254); always 0 without a sensor.
fn rc(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    if !state.facts.has_rssi {
        return;
    }
    let rssi =
        given.single(0).filter(|part| (0.0..=1.0).contains(part)).map(|part| (part * 254.0).round() as u8);
    out.observe(&Observation::RadioControl(RadioControl { rssi }));
}

/// A plane's own idea of flying.
fn status(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    /// A brisk walk.
    const CARRIED_MPS: f32 = 2.5;
    const SPEED_AGE: Span = Span::from_secs(2);
    if let Some(armed) = given.unsigned(1) {
        state.arm(armed != 0);
    }
    if let Some(flying) = given.unsigned(0) {
        // A carried, armed plane calls itself flying.
        let is_carried = state.landed != LandedState::InAir
            && state.facts.craft == Craft::Plane
            && !state.facts.quadplane
            && state
                .ground_speed
                .within(given.at, SPEED_AGE)
                .is_some_and(|speed_mps| speed_mps < CARRIED_MPS);
        state.landed = if flying == 0 || is_carried { LandedState::OnGround } else { LandedState::InAir };
    }
}
