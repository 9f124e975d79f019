//! The logbook as a page to print.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use anyhow::Result;

use super::{Aircraft, Book, LogbookEntry, Spot, hours};
use crate::files::{Inputs, Output, make_parent, settle};
use crate::journey::push_xml;
use crate::wear::PartLine;

const STYLE: &str = "@page{size:A4 landscape;margin:12mm}\
body{font:10px/1.35 system-ui,sans-serif;color:#111;margin:1rem auto;max-width:273mm}\
h1{font-size:16px}h2{font-size:13px;margin:1.2em 0 .3em;break-after:avoid}h3{font-size:11px;margin:.8em 0 .2em;break-after:avoid}\
table{border-collapse:collapse;width:100%}th,td{border:1px solid #999;padding:2px 4px;text-align:left;vertical-align:top}\
th{background:#eee}td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}tr{break-inside:avoid}\
thead{display:table-header-group}p{margin:.3em 0}";

pub(super) fn write(book: &Book, path: &Path, inputs: &Inputs) -> Result<()> {
    make_parent(path)?;
    let mut output = Output::create(path, inputs)?;
    settle(output.write_all(page(book).as_bytes()), path)?;
    output.finish()
}

fn page(book: &Book) -> String {
    let mut page = String::from(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>Technical logbook</title><style>",
    );
    page.push_str(STYLE);
    page.push_str("</style></head><body><h1>Technical logbook</h1>\n");
    page.push_str(
        "<p>Fields of UK CAA AMC1 UAS.SPEC.050(1)(g). Times are UTC, places WGS 84. Empty cells are for people: \
         write them into the CSV of this logbook.</p>\n",
    );
    for (name, aircraft) in book {
        of_aircraft(&mut page, name, aircraft);
    }
    page.push_str("</body></html>\n");
    page
}

fn of_aircraft(page: &mut String, name: &str, aircraft: &Aircraft) {
    page.push_str("<h2>Aircraft ");
    push_xml(page, name);
    page.push_str("</h2>\n");
    let last = aircraft.entries.last();
    let said =
        |of: fn(&LogbookEntry) -> &str| aircraft.entries.iter().rev().map(of).find(|text| !text.is_empty());
    let details = said(|entry| entry.by_hand.get("aircraft_details").map_or("", String::as_str));
    let rows = [
        ("Manufacturer, model, serial number", details.unwrap_or_default().to_owned()),
        ("Type", said(|entry| &entry.kind).unwrap_or_default().to_owned()),
        ("Firmware", last.map_or_else(String::new, |entry| entry.firmware.clone())),
    ];
    page.push_str("<table>");
    for (title, text) in rows {
        page.push_str("<tr><th>");
        page.push_str(title);
        page.push_str("</th><td>");
        push_xml(page, &text);
        page.push_str("</td></tr>");
    }
    page.push_str("</table>\n");
    let totals = aircraft.totals();
    // Writing to a string cannot fail.
    let _ = write!(
        page,
        "<p><strong>Total in this logbook: {} flights (take-offs and landings), {} h in the air.</strong>",
        totals.flights,
        hours(totals.flight_s)
    );
    if let Some(life) = aircraft.life {
        let _ = write!(
            page,
            " Counters of the box over the life of the aircraft: {} flights, {} h.",
            life.flights,
            hours(life.flight_s)
        );
    }
    page.push_str("</p>\n<h3>Flights</h3>\n");
    table(
        page,
        &[
            "Take-off",
            "Landing",
            "Place of take-off",
            "Place of landing",
            "Time h:min",
            "Total h:min",
            "Flights",
            "Remote pilot",
            "Activity",
            "Pre-flight inspection",
            "Incidents",
            "Defects",
            "Rectification",
            "Remarks",
        ],
        &flights(&aircraft.entries),
    );
    parts(page, aircraft);
}

fn parts(page: &mut String, aircraft: &Aircraft) {
    let (batteries, others): (Vec<&PartLine>, Vec<&PartLine>) =
        aircraft.parts.iter().partition(|part| part.is_battery);
    for (title, parts) in [("Batteries", batteries), ("Components", others)] {
        if parts.is_empty() {
            continue;
        }
        let _ = writeln!(page, "<h3>{title}</h3>");
        let rows: Vec<Vec<String>> = parts.into_iter().map(of_part).collect();
        table(
            page,
            &[
                "Part",
                "Serial number",
                "Hours in the air",
                "Flights",
                "Battery cycles",
                "Life used",
                "Limit",
                "Status",
            ],
            &rows,
        );
    }
}

fn flights(entries: &[LogbookEntry]) -> Vec<Vec<String>> {
    let (mut seconds, mut count) = (0.0, 0_u64);
    let mut rows = Vec::new();
    for entry in entries {
        if entry.is_flight() {
            seconds += entry.duration_s;
            count += 1;
        }
        let cell = |name: &str| entry.by_hand.get(name).cloned().unwrap_or_default();
        let time = |time: &Option<String>| time.as_deref().map_or_else(String::new, shown);
        let air = |text: String| if entry.is_flight() { text } else { String::new() };
        rows.push(vec![
            time(&entry.take_off),
            time(&entry.landing),
            place(entry.from),
            place(entry.to),
            air(hours(entry.duration_s)),
            hours(seconds),
            count.to_string(),
            cell("pilot"),
            cell("activity"),
            cell("pre_flight_inspection"),
            entry.incident.clone(),
            entry.defects.clone(),
            cell("rectification"),
            cell("remarks"),
        ]);
    }
    rows
}

fn of_part(part: &PartLine) -> Vec<String> {
    vec![
        part.name.clone(),
        part.serial.clone(),
        hours(part.flight_s),
        format!("{:.0}", part.flights),
        format!("{:.1}", part.cycles),
        part.used_percent.map_or_else(String::new, |used| format!("{used:.0} %")),
        part.limit.clone().unwrap_or_default(),
        part.status.to_owned(),
    ]
}

fn shown(utc: &str) -> String {
    utc.get(..19).unwrap_or(utc).replace('T', " ")
}

fn place(spot: Option<Spot>) -> String {
    spot.map_or_else(String::new, |spot| format!("{:.5}, {:.5}", spot.latitude_deg, spot.longitude_deg))
}

fn table(page: &mut String, heading: &[&str], rows: &[Vec<String>]) {
    page.push_str("<table><thead><tr>");
    for name in heading {
        page.push_str("<th>");
        page.push_str(name);
        page.push_str("</th>");
    }
    page.push_str("</tr></thead><tbody>\n");
    for row in rows {
        page.push_str("<tr>");
        for cell in row {
            let is_number = cell.starts_with(|sign: char| sign.is_ascii_digit()) && cell.len() < 24;
            page.push_str(if is_number { "<td class=\"n\">" } else { "<td>" });
            push_xml(page, cell);
            page.push_str("</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table>\n");
}
