//! The autopilot's, the pilot's and the ground station's links.

use super::prelude::*;
use crate::observation::TelemetryRadio;

const HEARTBEAT: Check = Check {
    name: "heartbeat",
    subsystem: Subsystem::Link,
    unit: Unit::of("s"),
    limits: Limits::above(Some(Param::LinkAgeWarn), Some(Param::LinkAgeCrit), 0.0),
    read: |inputs, _| inputs.reading(inputs.now.since(inputs.vehicle.heartbeat.at()?).as_secs_f32()),
    ..PLAIN
};

const RADIO: Check = Check {
    name: "rc_rssi",
    unit: Unit::of(""),
    limits: Limits::below(Some(Param::RcRssiWarn), Some(Param::RcRssiCrit), 2.0),
    debounce_ms: [2_000, 1_000],
    when: CheckPhase::Armed,
    stale_s: STALE,
    read: |inputs, _| inputs.vehicle.rc.read(|rc| rc.rssi.map(f32::from)),
    ..HEARTBEAT
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Silence, 0), ..HEARTBEAT },
    row!("frames_lost" HEARTBEAT, above(LinkLossWarn LinkLossCrit 0.2),
        role: Role::of(Group::FramesLost, Group::Silence.bit()), unit: Unit::of("%"),
        debounce_ms: [2_000, 2_000],
        read: |inputs, _| Some(Reading { at: inputs.link.at, value: inputs.link.frames_lost? * 100.0 })),
    // Positions that come tell nothing about their quality.
    row!("position_silent" HEARTBEAT, above(PosAgeWarn _ 0.0),
        role: Role::of(Group::Other, Group::Silence.bit() | Group::FramesLost.bit() | RECEIVERS),
        when: CheckPhase::InFlight, alarm_only: true, read: position_age_s),
    RADIO,
    row!("radio_rssi" RADIO, below(RadioRssiWarn _ 2.0), read: |inputs, _| {
        let weaker = |ends: [Option<u8>; 2]| ends.into_iter().flatten().min().map(f32::from);
        inputs.vehicle.radio.read(|radio| weaker([radio.rssi, radio.remote_rssi]))
    }),
    row!("radio_margin" RADIO, below(RadioMargWarn _ 2.0),
        read: |inputs, _| inputs.vehicle.radio.read(radio_margin)),
    alert!(RemoteControl Link, Role::of(Group::FailsafeCause, 0)),
    alert!(GroundStation Link, Role::of(Group::FailsafeCause, Group::Silence.bit())),
];

fn position_age_s(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let vehicle = inputs.vehicle;
    let at = match (vehicle.global.at(), vehicle.local.at()) {
        (Some(global), Some(local)) => global.later(local),
        (global, local) => global.or(local)?,
    };
    let heard = vehicle.heartbeat.at()?.later(vehicle.attitude.at()?);
    inputs.reading(heard.since(at).as_secs_f32())
}

/// The weaker end's signal above its noise. A radio without a partner (remote signal 0) has no link, and repeats its
/// last values. An end with 0 for both does not measure.
fn radio_margin(radio: &TelemetryRadio) -> Option<f32> {
    let margin = |rssi: Option<u8>, noise: Option<u8>| {
        let (rssi, noise) = (rssi?, noise?);
        ((rssi, noise) != (0, 0)).then(|| f32::from(rssi) - f32::from(noise))
    };
    let ends = [margin(radio.rssi, radio.noise), margin(radio.remote_rssi, radio.remote_noise)];
    ends.into_iter().flatten().reduce(f32::min).filter(|_| radio.remote_rssi != Some(0))
}
