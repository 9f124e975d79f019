//! GNSS receivers.
//!
//! Since v1.12 receivers are instances of `sensor_gps`, and `vehicle_gps_position` is the estimator's input; before,
//! instances of the latter. MAVLink reports "no receiver" after a second of silence; in a log, with a message each
//! second, it takes [`SILENCE`].

use std::num::NonZeroU32;

use hums_core::clock::{Instant, Span};
use hums_core::observation::{Gnss, GnssIntegrity, Observation};
use hums_core::units::{Metres, MetresPerSecond, Radians};

use super::motion::place;
use super::state::{MEDIUM_US, Px4, RECEIVERS_MAX, Receivers, Report, Sample, Topic, topic};

/// A receiver is gone.
const SILENCE: Span = Span::from_millis(2_500);
/// A fix with a position: `FIX_TYPE_2D`.
const FIX_2D: u8 = 2;

const FIELDS: &str = "fix_type satellites_used hdop eph latitude_deg longitude_deg altitude_msl_m lat lon alt vel_m_s \
    time_utc_usec jamming_state spoofing_state cog_rad";

pub(super) const TOPICS: &[Topic] = &[
    topic("sensor_gps", RECEIVERS_MAX as u8, MEDIUM_US, FIELDS, sensor),
    topic("vehicle_gps_position", RECEIVERS_MAX as u8, MEDIUM_US, FIELDS, used),
];

/// Silence counts after a receiver's next message.
pub(super) fn dropout(receivers: &mut Receivers) {
    receivers.heard = [None; RECEIVERS_MAX];
}

/// MAVLink's report about silent receivers.
pub(super) fn silence(receivers: &Receivers, now: Instant, observe: &mut dyn FnMut(Observation)) {
    for (instance, heard) in receivers.heard.iter().enumerate() {
        if heard.is_some_and(|heard| now.since(heard) > SILENCE) {
            observe(Observation::Gnss(Gnss { instance: instance as u8, ..Gnss::default() }));
        }
    }
}

fn sensor(px4: &mut Px4, sample: &Sample<'_>) {
    px4.receivers.sensors = true;
    receiver(px4, sample);
}

/// Before v1.12 a receiver; since then the first one's sign of life.
fn used(px4: &mut Px4, sample: &Sample<'_>) {
    if !px4.receivers.sensors {
        receiver(px4, sample);
    } else if sample.instance == 0 && px4.receivers.heard[1].is_none() {
        px4.receivers.heard[0] = Some(sample.at);
    }
}

fn receiver(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let fix = fields.byte(0).unwrap_or(0);
    let has_position = fix >= FIX_2D;
    // Until v1.14 1e-7 degrees and millimetres.
    let degrees = |new, old: usize| fields.get(new).or_else(|| fields.get(old).map(|value| value / 1e7));
    let position = place(degrees(4, 7), degrees(5, 8));
    let altitude = fields.finite(6).or_else(|| fields.get(9).map(|millimetres| (millimetres / 1e3) as f32));
    px4.observe(Observation::Gnss(Gnss {
        instance: sample.instance,
        fix,
        satellites: fields.byte(1).filter(|&count| count < u8::MAX),
        // As in MAVLink: hundredths in 16 bits, millimetres; 0 unknown.
        hdop: fields.finite(2).filter(|hdop| (0.01..655.35).contains(hdop)),
        accuracy: fields.finite(3).filter(|metres| (0.001..4_294_967.0).contains(metres)).map(Metres),
        position: position.filter(|_| has_position),
        altitude: altitude.filter(|_| has_position).map(Metres),
        speed: fields.finite(10).filter(|speed| (0.0..655.35).contains(speed)).map(MetresPerSecond),
        // From north.
        course: fields.finite(14).map(|course| Radians(course.rem_euclid(core::f32::consts::TAU))),
        // 0: unknown.
        measured_ms: fields.count(11).and_then(|us| NonZeroU32::new((us / 1_000) as u32)),
    }));
    if let Some(heard) = px4.receivers.heard.get_mut(usize::from(sample.instance)) {
        *heard = Some(sample.at);
    }
    // Newer than our list: unknown.
    let state = |field| fields.byte(field).filter(|&state| state <= 3).unwrap_or(0);
    if fields.get(12).is_some() {
        let (jamming, spoofing) = (state(12), state(13));
        px4.observe(Observation::GnssIntegrity(GnssIntegrity {
            instance: sample.instance,
            jamming,
            spoofing,
        }));
    }
    utc(px4, sample);
}

fn utc(px4: &mut Px4, sample: &Sample<'_>) {
    /// 2000 and 2200.
    const UTC_US: std::ops::Range<u64> = 946_684_800_000_000..7_258_118_400_000_000;
    let (fix, utc_us) = (sample.fields.byte(0).unwrap_or(0), sample.fields.count(11).unwrap_or(0));
    if px4.receivers.told_utc || fix <= FIX_2D || !UTC_US.contains(&utc_us) {
        return;
    }
    px4.receivers.told_utc = true;
    px4.system.utc(utc_us, sample.recorded_us);
    px4.reports.push(Report::Utc { utc_us, recorded_us: sample.recorded_us });
}
