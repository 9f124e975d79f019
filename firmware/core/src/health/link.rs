//! The autopilot's, the pilot's and the ground station's links.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, alert};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{Group, RECEIVERS, Role};
use crate::cause::Cause;
use crate::latest::Reading;
use crate::params::Param;
use crate::time::Instant;

const HEARTBEAT: Check = Check {
    name: "heartbeat",
    subsystem: Subsystem::Link,
    unit: Unit::of("s"),
    side: Side::Above,
    warn: Some(Param::LinkAgeWarn),
    critical: Some(Param::LinkAgeCrit),
    hysteresis: 0.0,
    debounce_warn: Debounce::NONE,
    debounce_critical: Debounce::NONE,
    when: When::Always,
    stale_s: None,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: heartbeat_age_s,
};

const RADIO: Check = Check {
    name: "rc_rssi",
    unit: Unit::of(""),
    side: Side::Below,
    warn: Some(Param::RcRssiWarn),
    critical: Some(Param::RcRssiCrit),
    hysteresis: 2.0,
    debounce_warn: Debounce::secs(2),
    debounce_critical: Debounce::secs(1),
    when: When::Armed,
    stale_s: STALE,
    of: InstanceOf::Vehicle,
    read: rc_rssi,
    ..HEARTBEAT
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Silence, 0), ..HEARTBEAT },
    Check {
        name: "frames_lost",
        role: Role::of(Group::FramesLost, Group::Silence.bit()),
        unit: Unit::of("%"),
        warn: Some(Param::LinkLossWarn),
        critical: Some(Param::LinkLossCrit),
        hysteresis: 0.2,
        debounce_warn: Debounce::secs(2),
        debounce_critical: Debounce::secs(2),
        read: frames_lost_percent,
        ..HEARTBEAT
    },
    Check {
        name: "position_silent",
        role: Role::of(Group::Other, Group::Silence.bit() | Group::FramesLost.bit() | RECEIVERS),
        warn: Some(Param::PosAgeWarn),
        critical: None,
        when: When::InFlight,
        // That positions come says nothing about how good they are.
        alarm_only: true,
        read: position_age_s,
        ..HEARTBEAT
    },
    RADIO,
    Check {
        name: "radio_rssi",
        warn: Some(Param::RadioRssiWarn),
        critical: None,
        read: |inputs, _| {
            let slot = &inputs.vehicle.radio;
            let ends = slot.get().map(|radio| [radio.rssi, radio.remote_rssi]).into_iter().flatten();
            Reading::new(slot.at(), ends.flatten().map(f32::from).reduce(f32::min))
        },
        ..RADIO
    },
    Check {
        name: "radio_margin",
        warn: Some(Param::RadioMargWarn),
        critical: None,
        read: radio_margin,
        ..RADIO
    },
    alert::<{ Cause::RemoteControl as usize }>(Subsystem::Link, Role::of(Group::FailsafeCause, 0)),
    alert::<{ Cause::GroundStation as usize }>(
        Subsystem::Link,
        Role::of(Group::FailsafeCause, Group::Silence.bit()),
    ),
];

fn heartbeat_age_s(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let at = inputs.vehicle.heartbeat.at()?;
    Some(Reading { at: inputs.now, value: inputs.now.since(at).as_secs_f32() })
}

/// The later one of two times, of which either may be unknown.
fn later(one: Option<Instant>, other: Option<Instant>) -> Option<Instant> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.later(other)),
        (one, other) => one.or(other),
    }
}

/// Since the last position, global or local, while the autopilot is heard.
fn position_age_s(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let Inputs { now, vehicle, .. } = *inputs;
    let at = later(vehicle.global.at(), vehicle.local.at())?;
    let heard = vehicle.heartbeat.at()?.later(vehicle.attitude.at()?);
    Some(Reading { at: now, value: heard.since(at).as_secs_f32() })
}

fn frames_lost_percent(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    Reading::new(Some(inputs.link.at), inputs.link.frames_lost.map(|lost| lost * 100.0))
}

fn rc_rssi(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.rc;
    Reading::new(slot.at(), slot.get()?.rssi.map(f32::from))
}

/// The weaker end's signal above its noise. A radio that does not hear another one (its signal at the other end is 0) has no link
/// that could be weak, and goes on telling what it heard last. An end that tells 0 of both tells nothing: a radio that does not
/// measure.
fn radio_margin(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.radio;
    let radio = slot.get().filter(|radio| radio.remote_rssi != Some(0))?;
    let margin = |rssi: Option<u8>, noise: Option<u8>| {
        let (rssi, noise) = (rssi?, noise?);
        ((rssi, noise) != (0, 0)).then(|| f32::from(rssi) - f32::from(noise))
    };
    let ends = [margin(radio.rssi, radio.noise), margin(radio.remote_rssi, radio.remote_noise)];
    Reading::new(slot.at(), ends.into_iter().flatten().reduce(f32::min))
}
