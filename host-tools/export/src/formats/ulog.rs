//! `PX4`'s ULog with the topics that Flight Review and `PlotJuggler` draw, made of any vehicle's observations.
//!
//! Field names and units are those of `PX4`'s message definitions (v1.13: places in 1e-7 degrees and millimetres). A value that the vehicle does not report is NaN,
//! or zero in an integer. Times are those of the record.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use anyhow::Result;
use hums_blackbox::Gap;
use hums_core::clock::Instant;
use hums_core::observation::{
    Autopilot, Battery, Gnss, Heartbeat, Imu, LandedState, Observation, VehicleKind, VtolState,
};
use hums_core::vehicle::Vehicle;

use crate::checked::finding_words;
use crate::context::Context;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, SingleFile, Spool, Totals, Writer};
use crate::made::OutputFile;
use crate::mavlink::ids::RC_CHANNELS;
use crate::mavlink::values::{FieldValue, Scalar};
use crate::motion::{Motion, quaternion};
use crate::plural::count;
use crate::source::told::Finding;
use crate::source::ulog::nav_state;
use crate::story::{Story, StoryEntry};

const MAGIC: [u8; 8] = [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
/// Parameters at most: autopilots have some 1,500.
const PARAMETERS_MAX: usize = 16_384;
/// Bytes of a text: a message has a length of 16 bits.
const TEXT_BYTES_MAX: usize = 1_024;

const TOPICS: [(&str, &str); 14] = [
    ("vehicle_attitude", "float[4] q;"),
    ("vehicle_angular_velocity", "float[3] xyz;"),
    (
        "vehicle_local_position",
        "float x;float y;float z;float vx;float vy;float vz;float heading;bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;",
    ),
    ("vehicle_global_position", "double lat;double lon;float alt;"),
    (
        "vehicle_gps_position",
        "uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;float hdop;float eph;float vel_m_s;float cog_rad;uint8_t fix_type;uint8_t satellites_used;",
    ),
    (
        "battery_status",
        "float voltage_v;float current_a;float discharged_mah;float remaining;float temperature;float[14] voltage_cell_v;uint8_t cell_count;uint8_t id;bool connected;",
    ),
    (
        "vehicle_status",
        "uint8_t arming_state;uint8_t nav_state;uint8_t vehicle_type;uint8_t system_type;uint8_t system_id;bool is_vtol;bool in_transition_mode;",
    ),
    ("sensor_combined", "float[3] gyro_rad;float[3] accelerometer_m_s2;"),
    ("sensor_mag", "float x;float y;float z;"),
    ("vehicle_air_data", "float baro_pressure_pa;float baro_temp_celcius;"),
    ("actuator_outputs", "uint32_t noutputs;float[12] output;"),
    ("input_rc", "uint16_t[18] values;int32_t rssi;uint8_t channel_count;"),
    ("vehicle_land_detected", "bool landed;"),
    ("cpuload", "float load;"),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    Attitude,
    AngularVelocity,
    LocalPosition,
    GlobalPosition,
    Gnss,
    Battery,
    Status,
    Imu,
    Magnetometer,
    Air,
    Outputs,
    RadioControl,
    Landed,
    Load,
}

#[derive(Default)]
pub(crate) struct Words {
    channels: Vec<(Instant, Vec<u8>)>,
    findings: Vec<Finding>,
}

impl GroupEncoder for Words {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let Some(payload) = entry.known.filter(|_| entry.frame.id() == RC_CHANNELS) else { return };
        let number = |name: &str| payload.number(name).unwrap_or(0.0);
        let channel = |(field, value): (&hums_dialect::Field, FieldValue<'_>)| match value {
            FieldValue::Scalar(Scalar::Unsigned(value))
                if field.name.starts_with("chan") && field.units == "us" =>
            {
                Some(value as u16)
            }
            _ => None,
        };
        let mut fields = Fields::default();
        payload.fields().filter_map(channel).for_each(|value| fields.bytes(value.to_le_bytes()));
        fields.bytes((number("rssi") as i32).to_le_bytes());
        fields.bytes([number("chancount") as u8]);
        self.channels.push((entry.at, fields.0));
    }

    fn finding(&mut self, _: &Context, finding: &Finding) {
        self.findings.push(finding.clone());
    }

    fn held_bytes(&self) -> usize {
        128 * self.channels.len() + 2 * size_of::<Finding>() * self.findings.len()
    }
}

#[derive(Default)]
struct Fields(Vec<u8>);

impl Fields {
    fn of(values: [f32; 3]) -> Self {
        let mut fields = Self::default();
        fields.floats(values);
        fields
    }

    fn bytes<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.extend_from_slice(&bytes);
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f32>) {
        values.into_iter().for_each(|value| self.bytes(value.to_le_bytes()));
    }

    fn maybe(&mut self, values: impl IntoIterator<Item = Option<f32>>) {
        self.floats(values.into_iter().map(|value| value.unwrap_or(f32::NAN)));
    }

    fn gnss(&mut self, gnss: &Gnss, utc_us: Option<u64>) {
        self.bytes(utc_us.unwrap_or(0).to_le_bytes());
        let place = gnss.position.map(|place| [place.latitude_deg, place.longitude_deg]);
        for degrees in place.unwrap_or_default() {
            self.bytes(((degrees * 1e7).round() as i32).to_le_bytes());
        }
        let altitude_mm = gnss.altitude.map_or(0.0, |altitude| altitude.0 * 1e3);
        self.bytes((altitude_mm.round() as i32).to_le_bytes());
        self.maybe([
            gnss.hdop,
            gnss.accuracy.map(|accuracy| accuracy.0),
            gnss.speed.map(|speed| speed.0),
            gnss.course.map(|course| course.0),
        ]);
        self.bytes([gnss.fix, gnss.satellites.unwrap_or(0)]);
    }

    fn battery(&mut self, battery: &Battery) {
        self.maybe([
            battery.voltage.map(|value| value.0),
            battery.current.map(|value| value.0),
            battery.consumed.map(|value| value.0 * 1e3),
            battery.remaining.map(|value| value.0),
            battery.temperature.map(|value| value.0),
        ]);
        self.floats(battery.cells.map(|cell| cell.map_or(0.0, |cell| cell.volts().0)));
        self.bytes([battery.cells_reported() as u8, battery.id, 1]);
    }

    fn status(&mut self, heartbeat: &Heartbeat, vehicle: &Vehicle) {
        // `ARMING_STATE_ARMED`, `ARMING_STATE_STANDBY`
        let arming = if heartbeat.armed { 2 } else { 1 };
        let nav = if heartbeat.autopilot == Autopilot::Px4 { nav_state(heartbeat.mode) } else { None };
        let kind = match heartbeat.kind {
            VehicleKind::Rotorcraft => 1,
            VehicleKind::Plane => 2,
            VehicleKind::Vtol => {
                if vehicle.vtol == VtolState::Forward {
                    2
                } else {
                    1
                }
            }
            VehicleKind::Surface => 3,
            VehicleKind::Other => 0,
        };
        let system = vehicle.source.map_or(0, |source| source.system);
        let flags = [heartbeat.kind == VehicleKind::Vtol, vehicle.vtol == VtolState::Transition];
        self.bytes([arming, nav.unwrap_or(NO_MODE), kind, heartbeat.type_number, system]);
        self.bytes(flags.map(u8::from));
    }
}

/// The open file. Parameters stand at its beginning, and are known last.
pub(crate) struct Ulog {
    file: SingleFile,
    data: Spool,
    motion: Motion,
    numbers: BTreeMap<(Topic, u8), u16>,
    /// First values.
    parameters: BTreeMap<String, f64>,
    parameters_left_out: u64,
    first: Option<Instant>,
    messages: u64,
    /// Findings still to be written, by time.
    findings: VecDeque<Finding>,
}

fn message(kind: u8, content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len()).unwrap_or(u16::MAX);
    let content = content.get(..usize::from(length)).unwrap_or(content);
    [&length.to_le_bytes()[..], &[kind], content].concat()
}

fn keyed(kind: u8, key: &str, value: &[u8]) -> Vec<u8> {
    let key = key.as_bytes().get(..255).unwrap_or(key.as_bytes());
    message(kind, &[&[key.len() as u8][..], key, value].concat())
}

fn parameter(name: &str, value: f64) -> Vec<u8> {
    // A whole number is written as one: a float has 24 bits.
    if value.fract() == 0.0 && value.abs() < f64::from(i32::MAX) {
        keyed(b'P', &format!("int32_t {name}"), &(value as i32).to_le_bytes())
    } else {
        keyed(b'P', &format!("float {name}"), &(value as f32).to_le_bytes())
    }
}

impl Ulog {
    fn put(&mut self, (topic, instance): (Topic, u8), at: Instant, fields: &Fields) -> Result<()> {
        let next = self.numbers.len() as u16;
        let number = *self.numbers.entry((topic, instance)).or_insert(next);
        if number == next {
            let name = TOPICS.get(topic as usize).map_or("", |(name, _)| name);
            let content = [&[instance][..], &next.to_le_bytes(), name.as_bytes()].concat();
            self.data.write(&message(b'A', &content))?;
        }
        self.first.get_or_insert(at);
        self.messages += 1;
        let content = [&number.to_le_bytes()[..], &at.as_micros().to_le_bytes(), &fields.0].concat();
        self.data.write(&message(b'D', &content))
    }

    fn text(&mut self, at: Instant, severity: u8, words: &str) -> Result<()> {
        let end = (0..=TEXT_BYTES_MAX.min(words.len())).rev().find(|end| words.is_char_boundary(*end));
        let words = words.get(..end.unwrap_or(0)).unwrap_or_default();
        let content =
            [&[b'0' + severity.min(7)][..], &at.as_micros().to_le_bytes(), words.as_bytes()].concat();
        self.data.write(&message(b'L', &content))
    }

    /// Writes the findings until this time.
    fn found(&mut self, until: Instant) -> Result<()> {
        while let Some(finding) = self.findings.pop_front_if(|finding| finding.at <= until) {
            let severity = if finding.level == hums_core::health::Level::Critical { 2 } else { 4 };
            self.text(finding.at, severity, &format!("HUMS: {}", finding_words(&finding)))?;
        }
        Ok(())
    }

    fn said(&mut self, said: &StoryEntry) -> Result<()> {
        match said {
            StoryEntry::Text { at, severity, words } => self.text(*at, *severity, words),
            StoryEntry::Parameter { name, value, .. } => match self.parameters.get(name).copied() {
                Some(known) if known.to_bits() == value.to_bits() => Ok(()),
                Some(_) => self.data.write(&parameter(name, *value)),
                None if self.parameters.len() < PARAMETERS_MAX => {
                    self.parameters.insert(name.clone(), *value);
                    Ok(())
                }
                None => {
                    self.parameters_left_out += 1;
                    Ok(())
                }
            },
        }
    }

    fn observe(&mut self, at: Instant, utc_us: Option<u64>, observation: &Observation) -> Result<()> {
        let mut fields = Fields::default();
        if let Some(battery) = self.motion.battery_by(observation) {
            fields.battery(&battery);
            self.put((Topic::Battery, battery.id), at, &std::mem::take(&mut fields))?;
        }
        let topic = match observation {
            Observation::Attitude(attitude) => {
                if let Some(rates) = attitude.rates {
                    self.put((Topic::AngularVelocity, 0), at, &Fields::of(rates.map(|rate| rate.0)))?;
                }
                fields.floats(quaternion(attitude).map(|part| part as f32));
                (Topic::Attitude, 0)
            }
            Observation::LocalPosition(_) => {
                self.local(&mut fields);
                (Topic::LocalPosition, 0)
            }
            Observation::GlobalPosition(global) => {
                let Some(position) = global.position else { return Ok(()) };
                if self.motion.vehicle().local.get().is_none() {
                    let mut fields = Fields::default();
                    self.local(&mut fields);
                    self.put((Topic::LocalPosition, 0), at, &fields)?;
                }
                fields.bytes(position.latitude_deg.to_le_bytes());
                fields.bytes(position.longitude_deg.to_le_bytes());
                fields.floats([global.altitude.0]);
                (Topic::GlobalPosition, 0)
            }
            Observation::Gnss(gnss) => {
                fields.gnss(gnss, utc_us);
                (Topic::Gnss, gnss.instance)
            }
            Observation::Heartbeat(heartbeat) => {
                fields.status(heartbeat, self.motion.vehicle());
                (Topic::Status, 0)
            }
            Observation::Imu(imu) | Observation::ImuAndAir(imu, _) => {
                if let Observation::ImuAndAir(_, air) = observation {
                    self.observe(at, utc_us, &Observation::Air(*air))?;
                }
                self.magnetometer(at, imu)?;
                fields.maybe(axes(imu.rate.map(|rate| rate.map(|part| part.0))));
                fields.maybe(axes(imu.acceleration.map(|force| force.map(|part| part.0))));
                (Topic::Imu, imu.instance)
            }
            Observation::Air(air) => {
                let pascals = air.pressure.map(|value| value.0 * 100.0);
                fields.maybe([pascals, air.temperature.map(|value| value.0)]);
                (Topic::Air, air.instance)
            }
            Observation::Outputs(outputs) => {
                let used = outputs.pulses.iter().rposition(|pulse| *pulse > 0).map_or(0, |last| last + 1);
                fields.bytes((used as u32).to_le_bytes());
                fields.floats(outputs.pulses.map(f32::from));
                (Topic::Outputs, outputs.port)
            }
            Observation::Landed(landed, _) => {
                fields.bytes([u8::from(*landed == LandedState::OnGround)]);
                (Topic::Landed, 0)
            }
            Observation::SystemStatus(status) => {
                let Some(load) = status.load else { return Ok(()) };
                fields.floats([load.0]);
                (Topic::Load, 0)
            }
            _ => return Ok(()),
        };
        self.put(topic, at, &fields)
    }

    fn local(&self, fields: &mut Fields) {
        let (place, velocity) = (self.motion.local(), self.motion.velocity());
        fields.maybe(axes(place.map(|place| place.map(|part| part as f32))));
        fields.maybe(axes(velocity));
        fields.maybe([self.motion.vehicle().attitude.get().map(|attitude| attitude.yaw.0)]);
        let valid = [place.is_some(), place.is_some(), velocity.is_some(), velocity.is_some()];
        fields.bytes(valid.map(u8::from));
    }

    fn magnetometer(&mut self, at: Instant, imu: &Imu) -> Result<()> {
        let Some(field) = imu.field else { return Ok(()) };
        self.put((Topic::Magnetometer, imu.instance), at, &Fields::of(field.map(|part| part.0)))
    }

    fn head(&self) -> Vec<u8> {
        let first_us = self.first.unwrap_or(Instant::ZERO).as_micros();
        let mut out = [&MAGIC[..], &first_us.to_le_bytes()].concat();
        out.extend(message(b'B', &[0; 40]));
        for (name, fields) in TOPICS {
            out.extend(message(b'F', format!("{name}:uint64_t timestamp;{fields}").as_bytes()));
        }
        let vehicle = self.motion.vehicle();
        let autopilot = match vehicle.heartbeat.get().map(|heartbeat| heartbeat.autopilot) {
            Some(Autopilot::Px4) => "PX4",
            Some(Autopilot::ArduPilot) => "ArduPilot",
            _ => "unknown",
        };
        let text =
            |key: &str, text: &str| keyed(b'I', &format!("char[{}] {key}", text.len()), text.as_bytes());
        out.extend(text("sys_name", autopilot));
        out.extend(text("ver_hw", "unknown"));
        out.extend(text("ver_sw", concat!("hums ", env!("CARGO_PKG_VERSION"))));
        if let Some(identity) = vehicle.identity.get() {
            out.extend(keyed(b'I', "uint32_t ver_sw_release", &identity.firmware.to_le_bytes()));
            if identity.uid != 0 {
                out.extend(text("sys_uuid", &format!("{:016x}", identity.uid)));
            }
        }
        self.parameters.iter().for_each(|(name, value)| out.extend(parameter(name, *value)));
        out
    }
}

/// `nav_state` without a meaning.
const NO_MODE: u8 = 255;

fn axes(values: Option<[f32; 3]>) -> [Option<f32>; 3] {
    values.map_or([None; 3], |values| values.map(Some))
}

impl Writer for Ulog {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        has_words: true,
        needs_identity: true,
        omits: "messages beyond some twenty quantities, the box's records",
        ..FormatDetails::new(
            "ulog",
            "PX4's log with the main quantities, for Flight Review and PlotJuggler",
            Files::One("ulg"),
        )
    };
    type Encoder = Words;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        // Those of this program are known before; those of a board come in order.
        let findings = context.checked.iter().flat_map(|checked| &checked.findings);
        let findings = findings.filter(|finding| context.selection.has_time(finding.at, &context.epochs));
        Ok(Self {
            findings: findings.cloned().collect(),
            file: SingleFile::open(context, path)?,
            data: Spool::new()?,
            motion: Motion::default(),
            numbers: BTreeMap::new(),
            parameters: BTreeMap::new(),
            parameters_left_out: 0,
            first: None,
            messages: 0,
        })
    }

    fn part(&mut self, context: &Context, part: Words, story: &Story) -> Result<()> {
        if context.checked.is_none() {
            self.findings.extend(part.findings);
        }
        let mut said = story.said.iter().peekable();
        let mut channels = part.channels.into_iter().peekable();
        for observed in &story.observed {
            let at = observed.at;
            self.found(at)?;
            while let Some(said) = said.next_if(|said| said.at() <= at) {
                self.said(said)?;
            }
            while let Some((at, fields)) = channels.next_if(|(of, _)| *of <= at) {
                self.put((Topic::RadioControl, 0), at, &Fields(fields))?;
            }
            if self.motion.observe(observed) && context.selection.has_time(at, &context.epochs) {
                self.observe(at, context.epochs.utc_us(at), &observed.observation)?;
            }
        }
        for (at, fields) in channels {
            self.put((Topic::RadioControl, 0), at, &Fields(fields))?;
        }
        said.try_for_each(|said| self.said(said))
    }

    /// A dropout of at most 65 s: its length has 16 bits.
    fn gap(&mut self, _: &Context, gap: &Gap) -> Result<()> {
        let (Some(from), Some(to)) = (gap.from, gap.to) else { return Ok(()) };
        let ms = u16::try_from(to.since(from).as_micros() / 1000).unwrap_or(u16::MAX);
        self.data.write(&message(b'O', &ms.to_le_bytes()))
    }

    fn is_empty(&self) -> bool {
        self.messages == 0
    }

    fn finish(mut self, _: &Context, _: Totals) -> Result<Finished> {
        self.found(Instant::from_micros(u64::MAX))?;
        let head = self.head();
        self.file.write(&head)?;
        self.data.copy(&mut self.file)?;
        let counts = [(self.messages, "message"), (self.parameters.len() as u64, "parameter")];
        let left_out = (self.parameters_left_out > 0)
            .then(|| format!("{} left out", count(self.parameters_left_out, "report of a parameter")));
        let made = vec![OutputFile::of(self.file.finish()?, "ulog", &counts)];
        Ok(Finished { made, remarks: left_out.into_iter().collect() })
    }
}
