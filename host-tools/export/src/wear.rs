//! Wear records as rows: `HUMS_LIFETIME`, `HUMS_EXCEEDANCE`, `HUMS_COMPONENT`.

use hums_analysis::log_json::finite;
use hums_blackbox::record::{Component, Exceedance, Lifetime};

use serde::Serialize;

use super::row::{Cell, Row};
use crate::names::counter_name;
use crate::summary::Contents;

/// A part of the vehicle by the last record of it, also as JSON of the table `sessions`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PartLine {
    #[serde(rename = "part")]
    pub(crate) name: String,
    #[serde(skip)]
    pub(crate) is_battery: bool,
    pub(crate) serial: String,
    pub(crate) status: &'static str,
    /// `None` without a limit.
    pub(crate) used_percent: Option<f32>,
    pub(crate) limit: Option<String>,
    pub(crate) flight_s: f64,
    pub(crate) flights: f64,
    pub(crate) cycles: f64,
}

pub(crate) fn parts_of(contents: &Contents) -> Vec<PartLine> {
    let line = |(place, line): (&u8, &crate::summary::ComponentLine)| {
        let (name, limit) = contents.part(*place, line);
        PartLine {
            name,
            is_battery: line.kind == "battery",
            serial: line.serial.clone(),
            status: line.status,
            used_percent: finite(line.used_percent).filter(|_| limit.is_some()),
            limit,
            flight_s: line.figures.flight_s,
            flights: line.figures.flights,
            cycles: line.figures.cycles,
        }
    };
    contents.components.iter().map(line).collect()
}

pub(super) fn lifetime(life: &Lifetime<'_>) -> Vec<Row> {
    let row = |(number, value)| {
        let cells = vec![
            ("moment", Cell::Text(life.moment.name().to_owned())),
            ("system", Cell::Count(u64::from(life.system))),
            ("uid", Cell::Text(format!("{:016x}", life.uid))),
            ("boots", Cell::Count(u64::from(life.boots))),
            ("sessions", Cell::Count(u64::from(life.sessions))),
            ("counter", Cell::Text(counter_name(number))),
            ("value", Cell::Single(value)),
        ];
        Row::new("HUMS_LIFETIME", cells)
    };
    life.iter().map(row).collect()
}

pub(super) fn exceedance(exceedance: &Exceedance<'_>) -> Vec<Row> {
    let row = |(of, crossings): (&str, hums_core::health::exceedance::Crossings)| {
        let cells = vec![
            ("moment", Cell::Text(exceedance.moment.name().to_owned())),
            ("of", Cell::Text(of.to_owned())),
            ("check", Cell::Text(exceedance.check.to_owned())),
            ("instance", Cell::Count(u64::from(exceedance.instance))),
            ("warnings", Cell::Count(u64::from(crossings.warnings))),
            ("criticals", Cell::Count(u64::from(crossings.criticals))),
            ("warning[s]", Cell::Double(f64::from(crossings.warning_tenths) / 10.0)),
            ("critical[s]", Cell::Double(f64::from(crossings.critical_tenths) / 10.0)),
            ("peak", Cell::Single(crossings.peak)),
            ("unit", Cell::Text(exceedance.unit.to_owned())),
        ];
        Row::new("HUMS_EXCEEDANCE", cells)
    };
    [("session", exceedance.session), ("lifetime", exceedance.lifetime)].into_iter().map(row).collect()
}

pub(super) fn component(component: &Component<'_>) -> Row {
    let figures = &component.figures;
    let by = format!("{}:{}", component.by.0, component.by.1);
    let cells = vec![
        ("why", Cell::Text(component.why.name().to_owned())),
        ("place", Cell::Count(u64::from(component.place) + 1)),
        ("kind", Cell::Text(component.kind.name().to_owned())),
        ("number", Cell::Count(u64::from(component.number))),
        ("name", Cell::Text(component.name.to_owned())),
        ("serial", Cell::Text(component.serial.to_owned())),
        ("status", Cell::Text(component.status.name().to_owned())),
        ("used[%]", Cell::Single(component.used_percent)),
        ("powered[s]", Cell::Double(figures.powered_s)),
        ("flight[s]", Cell::Double(figures.flight_s)),
        ("motor[s]", Cell::Double(figures.motor_s)),
        ("flights", Cell::Double(figures.flights)),
        ("cycles", Cell::Double(figures.cycles)),
        ("replaced", Cell::Count(u64::from(component.replaced))),
        ("new_serial", Cell::Text(component.new_serial.to_owned())),
        ("by", Cell::Text(by)),
    ];
    Row::new("HUMS_COMPONENT", cells)
}
