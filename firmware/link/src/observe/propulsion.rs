//! Motors, ESCs, engines and generators.

use hums_core::observation::{ESC_GROUP, Engine, Esc, EscGroup, Generator, SpeedSensor};
use hums_core::units::{Amperes, Celsius, Fraction, Hectopascals, Rpm, Volts};
use hums_dialect::ardupilotmega as ap;
use hums_dialect::ids;

use super::fields::{read, unless};
use crate::packet::Fields;

/// PX4: failure flags, errors, temperature. The connection type may be newer than our list.
pub(super) fn esc_info(payload: &[u8]) -> Option<EscGroup> {
    let info = read::<ap::ESC_INFO_DATA>(payload, &[44])?;
    let mut group = group(info.index);
    for (place, esc) in group.escs.iter_mut().enumerate() {
        if usize::from(info.index) + place >= usize::from(info.count) {
            continue;
        }
        let temperature_cdeg = info.temperature[place];
        *esc = Some(Esc {
            temperature: (temperature_cdeg != i16::MAX).then(|| Celsius(f32::from(temperature_cdeg) / 100.0)),
            failures: Some(info.failure_flags[place]),
            errors: Some(info.error_count[place]),
            ..Esc::default()
        });
    }
    Some(group)
}

/// PX4: speed, voltage, current. A place where all three are zero or NaN has no ESC, or one without power.
pub(super) fn esc_status(payload: &[u8]) -> Option<EscGroup> {
    let status = read::<ap::ESC_STATUS_DATA>(payload, &[])?;
    let mut group = group(status.index);
    for (place, esc) in group.escs.iter_mut().enumerate() {
        let (rpm, volts, amperes) = (status.rpm[place], status.voltage[place], status.current[place]);
        let nothing = |value: f32| value == 0.0 || value.is_nan();
        if rpm == 0 && nothing(volts) && nothing(amperes) {
            continue;
        }
        *esc = Some(Esc {
            rpm: Some(Rpm(rpm as f32)),
            voltage: Volts(volts).finite(),
            current: Amperes(amperes).finite(),
            ..Esc::default()
        });
    }
    Some(group)
}

/// ArduPilot: everything but flags. A place whose packet count and speed are zero has no ESC.
pub(super) fn esc_telemetry(id: u32, payload: &[u8]) -> Option<EscGroup> {
    // The messages for motors 1 to 4, 5 to 8 and 9 to 12 have the same fields.
    let telemetry = read::<ap::ESC_TELEMETRY_1_TO_4_DATA>(payload, &[])?;
    let mut group = group(((id - ids::ESC_TELEMETRY_1_TO_4) * ESC_GROUP as u32) as u8);
    for (place, esc) in group.escs.iter_mut().enumerate() {
        let (packets, rpm) = (telemetry.count[place], telemetry.rpm[place]);
        if packets == 0 && rpm == 0 && telemetry.voltage[place] == 0 {
            continue;
        }
        *esc = Some(Esc {
            rpm: Some(Rpm(f32::from(rpm))),
            voltage: Some(Volts(f32::from(telemetry.voltage[place]) / 100.0)),
            current: Some(Amperes(f32::from(telemetry.current[place]) / 100.0)),
            // An ESC without a sensor sends 0.
            temperature: unless(telemetry.temperature[place], 0).map(|degrees| Celsius(f32::from(degrees))),
            ..Esc::default()
        });
    }
    Some(group)
}

fn group(first: u8) -> EscGroup {
    EscGroup { first, escs: [None; ESC_GROUP] }
}

/// The fuel pressure, an extension field, is unknown at 0; a temperature of absolute zero is a sensor that is not
/// there.
pub(super) fn engine(payload: &[u8]) -> Option<Engine> {
    let efi = read::<ap::EFI_STATUS_DATA>(payload, &[])?;
    let temperature = |degrees: f32| Celsius(degrees).finite().filter(|celsius| celsius.0 > -100.0);
    let pressure_kpa = Some(efi.fuel_pressure).filter(|value| value.is_finite() && *value != 0.0);
    Some(Engine {
        healthy: efi.health != 0,
        rpm: Rpm(efi.rpm).finite(),
        fuel_consumed: efi.fuel_consumed.is_finite().then_some(efi.fuel_consumed),
        fuel_flow: efi.fuel_flow.is_finite().then_some(efi.fuel_flow),
        load: Fraction(efi.engine_load / 100.0).finite(),
        cylinder_head: temperature(efi.cylinder_head_temperature),
        exhaust: temperature(efi.exhaust_gas_temperature),
        fuel_pressure: pressure_kpa.map(|kilopascals| Hectopascals(kilopascals * 10.0)),
    })
}

pub(super) fn generator(payload: &[u8]) -> Option<Generator> {
    let message = read::<ap::GENERATOR_STATUS_DATA>(payload, &[])?;
    Some(Generator {
        is_off: message.status.contains(ap::MavGeneratorStatusFlag::MAV_GENERATOR_STATUS_FLAG_OFF),
        speed: unless(message.generator_speed, u16::MAX).map(|speed| Rpm(f32::from(speed))),
    })
}

/// ArduPilot: two sensors; a negative speed is a sensor that is not there.
pub(super) fn rpm(payload: &[u8]) -> Option<[Option<SpeedSensor>; 2]> {
    let rpm = read::<ap::RPM_DATA>(payload, &[])?;
    let sensor =
        |index, rpm: f32| Rpm(rpm).finite().filter(|rpm| rpm.0 >= 0.0).map(|rpm| SpeedSensor { index, rpm });
    Some([sensor(0, rpm.rpm1), sensor(1, rpm.rpm2)])
}

/// PX4: one sensor a message.
pub(super) fn raw_rpm(payload: &[u8]) -> Option<[Option<SpeedSensor>; 2]> {
    let rpm = read::<ap::RAW_RPM_DATA>(payload, &[]).map(|rpm| rpm.frequency)?;
    let index = Fields(payload).u8(4);
    Some([Rpm(rpm).finite().map(|rpm| SpeedSensor { index, rpm }), None])
}
