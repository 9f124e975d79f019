//! Component information: the words of the table of parameters, in files by MAVLink's schemas, over the link.
//! `HUMS_WRITE_DOCS=1 cargo test -p hums-tests --features oracle metadata` writes `firmware/onboard/metadata`.
#![cfg(feature = "oracle")]

use std::fs;
use std::path::{Path, PathBuf};

use hums_core::parameters::Param;
use hums_core_tests::{DECIMAL_PLACES, group, short};
use hums_link::ftp;
use hums_tests::flights::root;
use hums_tests::oracle;
use serde_json::{Value, json};

use super::board::Board;

/// `QGroundControl` reads this version; the schema of parameters has 3 as its minimum (mavlink/mavlink f368676f).
const VERSION: u32 = 1;
/// `COMP_METADATA_TYPE_PARAMETER`
const PARAMETER: u32 = 1;
const PACKED: &str = "parameters.json.xz";

fn folder() -> PathBuf {
    root().join("firmware/onboard/metadata")
}

/// A number in common form: not 0.30000001 for 0.3.
fn number(value: f32) -> Value {
    serde_json::from_str(&value.to_string()).unwrap()
}

fn parameters() -> String {
    let rows = Param::ALL.map(|param| {
        let (spec, words) = (param.spec(), param.words());
        let mut row = json!({
            "name": spec.name,
            "type": "Float",
            "shortDesc": short(param).to_string(),
            "group": group(param),
            "category": "HUMS",
            "default": number(spec.default),
            "min": number(spec.min),
            "max": number(spec.max),
            "decimalPlaces": if words.options.is_empty() { DECIMAL_PLACES } else { 0 },
            "rebootRequired": false,
        });
        if !words.unit.is_empty() {
            row["units"] = words.unit.into();
        }
        if !words.options.is_empty() {
            let option =
                |(value, description): (usize, &&str)| json!({ "value": value, "description": description });
            row["values"] = words.options.iter().enumerate().map(option).collect();
        }
        row
    });
    json!({ "version": VERSION, "parameters": &rows[..] }).to_string()
}

fn general(packed: &[u8]) -> String {
    let uri = format!("mftp://[;comp=191]/{PACKED}");
    let types = json!([{ "type": PARAMETER, "uri": uri, "fileCrc": ftp::checksum(0, packed) }]);
    json!({ "version": VERSION, "modelName": "HUMS", "metadataTypes": types }).to_string()
}

#[test]
fn what_the_firmware_holds_is_what_the_table_says() {
    let (packed, wanted) = (folder().join(PACKED), parameters());
    if std::env::var_os("HUMS_WRITE_DOCS").is_some() {
        let text = tempfile::NamedTempFile::new().unwrap();
        fs::write(text.path(), &wanted).unwrap();
        oracle::pack(text.path(), &packed);
        fs::write(folder().join("general.json"), general(&fs::read(&packed).unwrap())).unwrap();
    }
    assert!(
        oracle::unpack(&packed) == wanted,
        "firmware/onboard/metadata is not what the table says: write it anew (see above)"
    );
    let found = fs::read_to_string(folder().join("general.json")).unwrap();
    assert_eq!(found, general(&fs::read(&packed).unwrap()));
    // The head of an xz stream, with CRC32 as its check: the smallest decoders have no other.
    assert_eq!(fs::read(&packed).unwrap()[..8], [0xFD, b'7', b'z', b'X', b'Z', 0, 0, 1]);
}

/// `parameter.schema.json` and `general.schema.json` (mavlink/mavlink f368676f), beyond the rules of JSON.
#[test]
fn both_files_are_as_the_public_schemas_want_them() {
    let general: Value = serde_json::from_slice(&fs::read(folder().join("general.json")).unwrap()).unwrap();
    assert_members(
        &general,
        &["version", "metadataTypes"],
        &["vendorName", "modelName", "firmwareVersion", "hardwareVersion"],
    );
    for entry in general["metadataTypes"].as_array().unwrap() {
        let optional =
            ["fileCrc", "uriFallback", "fileCrcFallback", "translationUri", "translationUriFallback"];
        assert_members(entry, &["type", "uri"], &optional);
        assert!(entry["type"].is_u64() && entry["fileCrc"].is_u64(), "{entry}");
    }
    let packed = folder().join(PACKED);
    let parameters: Value = serde_json::from_str(&oracle::unpack(&packed)).unwrap();
    assert_members(&parameters, &["version", "parameters"], &["translation"]);
    let texts = ["type", "shortDesc", "longDesc", "units", "group", "category"];
    let numbers = ["default", "decimalPlaces", "min", "max", "increment"];
    let others = ["rebootRequired", "volatile", "readOnly", "values", "bitmask"];
    for row in parameters["parameters"].as_array().unwrap() {
        assert_members(row, &["name"], &[&texts[..], &numbers, &others].concat());
        let name = row["name"].as_str().unwrap();
        let is_name = |letter: char| letter.is_ascii_alphanumeric() || "._-{}".contains(letter);
        assert!((1..=16).contains(&name.len()) && name.chars().all(is_name), "{row}");
        assert!(texts.iter().all(|text| row.get(text).is_none_or(Value::is_string)), "{row}");
        assert!(numbers.iter().all(|number| row.get(number).is_none_or(Value::is_number)), "{row}");
        assert!(row["decimalPlaces"].is_u64() && row["rebootRequired"].is_boolean(), "{row}");
        for option in row.get("values").and_then(Value::as_array).into_iter().flatten() {
            assert!(option["value"].is_number() && option["description"].is_string(), "{row}");
        }
    }
}

#[track_caller]
fn assert_members(object: &Value, required: &[&str], optional: &[&str]) {
    let object = object.as_object().expect("an object");
    assert!(required.iter().all(|name| object.contains_key(*name)), "{object:?} wants {required:?}");
    let known = |name: &str| required.contains(&name) || optional.contains(&name);
    assert!(object.keys().all(|name| known(name)), "{object:?}");
}

#[test]
fn mission_planner_finds_every_parameter_in_its_file() {
    let found = oracle::descriptions(&root().join("docs/stations/ParameterMetaData.xml"));
    assert_eq!(found.as_object().unwrap().len(), Param::ALL.len());
    for param in Param::ALL {
        let (spec, words, found) = (param.spec(), param.words(), &found[param.spec().name]);
        assert_eq!(found["DisplayName"], short(param).to_string(), "{}", spec.name);
        assert_eq!(found["Range"], format!("{} {}", spec.min, spec.max));
        assert_eq!(found["Units"].as_str().unwrap_or_default(), words.unit);
        let values = found["Values"].as_str().map_or(0, |values| values.split(',').count());
        assert_eq!(values, words.options.len(), "{}", spec.name);
    }
}

#[test]
fn a_ground_station_fetches_it_whole_and_knows_it_by_its_checksum() {
    let dir = tempfile::tempdir().unwrap();
    let params = dir.path().join("params.txt");
    fs::write(&params, "GS_BUDGET 5000\n").unwrap();
    let board = Board::start(&["--params", params.to_str().unwrap()]);
    let said = oracle::metadata(board.port, dir.path());
    board.switch_off();
    let expected = json!({
        "uri": "mftp://[;comp=191]/general.json",
        "booted": true,
        "crc": true,
        "types": [[PARAMETER, format!("/{PACKED}"), true]],
    });
    assert_eq!(said, expected);
    let same = |name: &str| {
        let read = |folder: &Path| fs::read(folder.join(name)).unwrap();
        read(dir.path()) == read(&folder())
    };
    assert!(same("general.json") && same(PACKED));
}
