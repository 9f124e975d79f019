//! Wear records as rows: `HUMS_LIFETIME`, `HUMS_EXCEEDANCE`, `HUMS_COMPONENT`.

use hums_analysis::log_json::finite;
use hums_blackbox::record::{Component, Exceedance, Lifetime};

use serde::Serialize;

use super::row::{Row, count, quantity, single, text};
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
            ("moment", text(life.moment.name())),
            ("system", count(life.system)),
            ("uid", text(format!("{:016x}", life.uid))),
            ("boots", count(life.boots)),
            ("sessions", count(life.sessions)),
            ("counter", text(counter_name(number))),
            ("value", single(value)),
        ];
        Row::new("HUMS_LIFETIME", cells)
    };
    life.iter().map(row).collect()
}

pub(super) fn exceedance(exceedance: &Exceedance<'_>) -> Vec<Row> {
    let row = |(of, crossings): (&str, hums_core::health::exceedance::Crossings)| {
        let cells = vec![
            ("moment", text(exceedance.moment.name())),
            ("of", text(of)),
            ("check", text(exceedance.check)),
            ("instance", count(exceedance.instance)),
            ("warnings", count(crossings.warnings)),
            ("criticals", count(crossings.criticals)),
            ("warning[s]", quantity(f64::from(crossings.warning_tenths) / 10.0)),
            ("critical[s]", quantity(f64::from(crossings.critical_tenths) / 10.0)),
            ("peak", single(crossings.peak)),
            ("unit", text(exceedance.unit)),
        ];
        Row::new("HUMS_EXCEEDANCE", cells)
    };
    [("session", exceedance.session), ("lifetime", exceedance.lifetime)].into_iter().map(row).collect()
}

pub(super) fn component(component: &Component<'_>) -> Row {
    let figures = &component.figures;
    let by = format!("{}:{}", component.by.0, component.by.1);
    let cells = vec![
        ("why", text(component.why.name())),
        ("place", count(u64::from(component.place) + 1)),
        ("kind", text(component.kind.name())),
        ("number", count(component.number)),
        ("name", text(component.name)),
        ("serial", text(component.serial)),
        ("status", text(component.status.name())),
        ("used[%]", single(component.used_percent)),
        ("powered[s]", quantity(figures.powered_s)),
        ("flight[s]", quantity(figures.flight_s)),
        ("motor[s]", quantity(figures.motor_s)),
        ("flights", quantity(figures.flights)),
        ("cycles", quantity(figures.cycles)),
        ("replaced", count(component.replaced)),
        ("new_serial", text(component.new_serial)),
        ("by", text(by)),
    ];
    Row::new("HUMS_COMPONENT", cells)
}
