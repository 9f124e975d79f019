//! The reference system's four tables, one row a second (`docs/decode.md`).
//!
//! Only latitude and longitude have seven decimals (1 cm) instead of two (1 km). The flight time counts whole
//! seconds from the box's power-on, as the reference counts from its program's start; in a gap it jumps.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Result;
use hums_blackbox::Gap;
use hums_core::clock::{Instant, Span};

use crate::context::Context;
use crate::files::{Folder, FolderFile, buffered, settle};
use crate::format::{Files, Finished, FormatDetails, Totals, Writer};
use crate::made::OutputFile;
use crate::mavlink::values::Scalar;
use crate::reference::{MOTORS, Quantity, Reference};
use crate::story::{HeldObservation, Story};

/// After a silence of this length, the vehicle's values do not count for the second.
const SILENCE_MAX: Span = Span::from_secs(10);
const SECOND_US: u64 = 1_000_000;

const FLIGHT_VALUES: &str = "Flight Time [s]; Battery %; Battery (V); Temp [degC]; Air Pressure [hPa]; \
     NED Velocity [n, e, d m/s]; Speed [m/s]; Velocity [m/s]; FRD Accel [f, r, d m/s2]; Accel module [m/s2]; \
     Altitude [m]; Latitude [deg]; Longitude [deg]";
const ESC_STATUS: &str = "esc_rpm1; esc_rpm2; esc_rpm3; esc_rpm4; esc_voltage1 [V]; esc_voltage2 [V]; \
     esc_voltage3 [V]; esc_voltage4 [V]; esc_current1 [A]; esc_current2 [A]; esc_current3 [A]; esc_current4 [A]";
const ESC_INFO: &str = "escfail1; escfail2; escfail3; escfail4; esc1_fails; esc2_fails; esc3_fails; esc4_fails; \
     esc_temperature1 [degC]; esc_temperature2 [degC]; esc_temperature3 [degC]; esc_temperature4 [degC]";
const VFR_HUD: &str =
    "Airspeed [m/s]; Groundspeed [m/s]; Heading [deg]; Throttle [%]; Altitude [m]; Climbrate [m/s]";
const GAPS: &str = "From [s]; To [s]; Cause; Frames missing";

pub(super) struct Thesis {
    folder: Folder,
    tables: [(BufWriter<FolderFile>, PathBuf); 5],
    reference: Reference,
    /// The next whole second, once the first frame has set it.
    next: Option<u64>,
    rows: u64,
}

impl Thesis {
    fn observe(&mut self, context: &Context, observed: &HeldObservation) -> Result<()> {
        let at_us = observed.at.as_micros();
        let mut next = *self.next.get_or_insert(at_us.next_multiple_of(SECOND_US));
        while next <= at_us {
            let now = Instant::from_micros(next);
            let heard = self.reference.heard().is_some_and(|heard| now.since(heard) <= SILENCE_MAX);
            if !heard {
                next = at_us.next_multiple_of(SECOND_US).max(next + SECOND_US);
                break;
            }
            if context.selection.has_time(now, &context.epochs) {
                self.rows(now)?;
            }
            next += SECOND_US;
        }
        self.next = Some(next);
        self.reference.observe(observed.at, observed.source, &observed.observation);
        Ok(())
    }

    fn rows(&mut self, now: Instant) -> Result<()> {
        self.rows += 1;
        self.line(0, &flight_values(&self.reference, now))?;
        let motors = |of: &[fn(usize) -> Quantity], decimals| -> Vec<String> {
            of.iter()
                .flat_map(|of| (0..MOTORS).map(|motor| number(&self.reference, now, of(motor), decimals)))
                .collect()
        };
        let mut status = motors(&[Quantity::EscRpm], 0);
        status.extend(motors(&[Quantity::EscVoltage, Quantity::EscCurrent], 2));
        let mut info = motors(&[Quantity::EscFailures, Quantity::EscErrors], 0);
        info.extend(motors(&[Quantity::EscTemperature], 2));
        let hud = [
            (Quantity::AirSpeed, 2),
            (Quantity::GroundSpeed, 2),
            (Quantity::Heading, 0),
            (Quantity::Throttle, 0),
            (Quantity::HudAltitude, 2),
            (Quantity::ClimbRate, 2),
        ];
        let hud = hud.map(|(quantity, decimals)| number(&self.reference, now, quantity, decimals));
        self.line(1, &status)?;
        self.line(2, &info)?;
        self.line(3, &hud)
    }

    fn line(&mut self, table: usize, cells: &[String]) -> Result<()> {
        let Some((file, path)) = self.tables.get_mut(table) else { return Ok(()) };
        settle(writeln!(file, "{}", cells.join("; ")), path)
    }
}

impl Writer for Thesis {
    const ABOUT: FormatDetails = FormatDetails {
        has_records: false,
        has_observations: true,
        omits: "messages besides flight, ESC and speed values, the box's records, findings",
        ..FormatDetails::new(
            "thesis",
            "Four tables with a row a second, as the thesis has them on which HUMS is built: flight, ESC status, ESC errors, speeds",
            Files::Tables(Some("thesis"), "csv"),
        )
    };
    type Encoder = ();

    fn open(context: &Context, path: &Path) -> Result<Self> {
        let folder = Folder::create(path, &context.inputs, &context.session)?;
        let table = |name: &str, header: &str| -> Result<(BufWriter<FolderFile>, PathBuf)> {
            let path = folder.path().join(name);
            let mut file = buffered(folder.file(name)?);
            settle(writeln!(file, "{header}"), &path)?;
            Ok((file, path))
        };
        let tables = [
            table("flightvalues.csv", FLIGHT_VALUES)?,
            table("esc_status.csv", ESC_STATUS)?,
            table("esc_info.csv", ESC_INFO)?,
            table("vfr_hud.csv", VFR_HUD)?,
            table("gaps.csv", GAPS)?,
        ];
        Ok(Self { folder, tables, reference: Reference::default(), next: None, rows: 0 })
    }

    fn part(&mut self, context: &Context, (): (), story: &Story) -> Result<()> {
        story.observed.iter().try_for_each(|observed| self.observe(context, observed))
    }

    fn gap(&mut self, _: &Context, gap: &Gap) -> Result<()> {
        let seconds =
            |at: Option<Instant>| at.map_or_else(String::new, |at| format!("{:.3}", at.as_secs_f64()));
        let frames = gap.frames.map_or_else(String::new, |frames| frames.to_string());
        self.line(4, &[seconds(gap.from), seconds(gap.to), gap.cause.name().to_owned(), frames])?;
        if let (Some(next), Some(to)) = (self.next, gap.to) {
            self.next = Some(next.max(to.as_micros().next_multiple_of(SECOND_US)));
        }
        Ok(())
    }

    fn is_empty(&self) -> bool {
        self.rows == 0
    }

    fn finish(mut self, _: &Context, _: Totals) -> Result<Finished> {
        self.tables.iter_mut().try_for_each(|(file, path)| settle(file.flush(), path))?;
        drop(self.tables);
        let path = self.folder.path().to_owned();
        self.folder.finish()?;
        Ok(OutputFile::of(path, "thesis", &[(self.rows, "second")]).into())
    }
}

fn flight_values(reference: &Reference, now: Instant) -> Vec<String> {
    let with_unit = |quantity, decimals, unit: &str| {
        let text = number(reference, now, quantity, decimals);
        if text.is_empty() { text } else { format!("{text} {unit}") }
    };
    let vector = |of: fn(usize) -> Quantity, unit: &str| {
        let parts = [0, 1, 2].map(|axis| number(reference, now, of(axis), 2));
        if parts.iter().any(String::is_empty) {
            String::new()
        } else {
            format!("{} {unit}", parts.join(", "))
        }
    };
    vec![
        format!("{}s", now.as_micros() / SECOND_US),
        with_unit(Quantity::BatteryPercent, 0, "%"),
        with_unit(Quantity::BatteryVolts, 2, "V"),
        with_unit(Quantity::Temperature, 2, "C"),
        with_unit(Quantity::Pressure, 2, "hPa"),
        vector(Quantity::Velocity, "m/s"),
        with_unit(Quantity::VelocityModule, 2, "m/s"),
        with_unit(Quantity::GnssSpeed, 2, "m/s"),
        vector(Quantity::Acceleration, "m/s2"),
        with_unit(Quantity::AccelerationModule, 2, "m/s2"),
        with_unit(Quantity::Altitude, 2, "m"),
        with_unit(Quantity::Latitude, 7, "deg"),
        with_unit(Quantity::Longitude, 7, "deg"),
    ]
}

fn number(reference: &Reference, now: Instant, quantity: Quantity, decimals: usize) -> String {
    let value = reference.value(now, quantity).map(Scalar::as_f64).filter(|value| value.is_finite());
    value.map_or_else(String::new, |value| format!("{value:.decimals$}"))
}
