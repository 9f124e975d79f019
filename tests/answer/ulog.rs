//! PX4's logs, field by field, against pyulog.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;

use hums::mavlink::values::Scalar;
use hums::source::item::{Cause, CellValue, Item, Needs, Row, Rows};
use hums::source::recording::LogPlace;
use hums_tests::{flights, oracle};
use serde_json::json;

#[test]
fn every_field_of_a_px4_log_is_what_pyulog_reads() {
    let log = flights::root().join("tests/labelled/px4/p23_motor_dead_quad.cut.ulg.gz");
    let folder = tempfile::tempdir().unwrap();
    write(&log, folder.path());
    let result = oracle::ulog(&log, folder.path());
    assert_eq!(result["wrong"], json!([]), "{result}");
    assert!(result["topics"].as_u64() > Some(20) && result["values"].as_u64() > Some(200_000), "{result}");
    assert!(result["parameters"].as_u64() > Some(800) && result["texts"].as_u64() > Some(5), "{result}");
}

fn write(log: &Path, folder: &Path) {
    let mut tables: BTreeMap<String, (Vec<String>, BufWriter<File>)> = BTreeMap::new();
    let (mut parameters, mut texts, mut dropouts) = (BTreeMap::new(), Vec::new(), Vec::new());
    let want = Needs { rows: Rows::All, ..Needs::default() };
    let take = &mut |_, item: Item<'_>| {
        match item {
            Item::Row(Row {
                table,
                values: &[CellValue::Text(name), CellValue::Number(Scalar::Double(value))],
            }) if table.name == "parameters" => {
                parameters.insert(name.to_owned(), value);
            }
            Item::Row(Row { table, values: &[.., CellValue::Text(words)] })
                if table.name == "logged_messages" =>
            {
                texts.push(words.to_owned());
            }
            Item::Row(row) => {
                let name = &row.table.name;
                let (_, out) = tables.entry(name.clone()).or_insert_with(|| {
                    let columns = row.table.columns.iter().map(|column| column.name.clone()).collect();
                    (columns, BufWriter::new(File::create(folder.join(format!("{name}.bin"))).unwrap()))
                });
                row.values.iter().try_for_each(|value| out.write_all(&bits(value).to_le_bytes()))?;
            }
            Item::Gap(gap) => {
                assert_eq!(gap.cause, Cause::Lost, "{gap:?}");
                dropouts.push(gap.to.zip(gap.from).map_or(0, |(to, from)| to.since(from).as_millis()));
            }
            _ => {}
        }
        Ok(())
    };
    LogPlace::file(log).open().unwrap().read(want, take).unwrap();
    let columns: BTreeMap<&String, &Vec<String>> =
        tables.iter().map(|(name, (columns, _))| (name, columns)).collect();
    fs::write(folder.join("tables.json"), json!(columns).to_string()).unwrap();
    let rest = json!({ "parameters": parameters, "texts": texts, "dropouts": dropouts });
    fs::write(folder.join("rest.json"), rest.to_string()).unwrap();
    for (_, out) in tables.values_mut() {
        out.flush().unwrap();
    }
}

fn bits(value: &CellValue<'_>) -> u64 {
    match *value {
        CellValue::Unknown | CellValue::Text(_) | CellValue::Bytes(_) => 0,
        CellValue::Number(Scalar::Unsigned(number)) => number,
        CellValue::Number(Scalar::Signed(number)) => number as u64,
        CellValue::Number(Scalar::Single(number)) => u64::from(number.to_bits()),
        CellValue::Number(Scalar::Double(number)) => number.to_bits(),
        CellValue::Flag(flag) => u64::from(flag),
    }
}
