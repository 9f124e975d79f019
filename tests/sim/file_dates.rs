//! Files on the card have the flight's date.

use std::fs;
use std::path::Path;
use std::process::Command;

use hums_tests::fat::drive;
use hums_tests::flights::own;
use hums_tests::program::{hums, hums_with};

/// `mdir`: name and date.
fn dates(image: &Path) -> Vec<(String, String)> {
    let listed = Command::new("mdir").args(["-i", &drive(image), "-a", "::"]).output().unwrap();
    assert!(listed.status.success(), "{}", String::from_utf8_lossy(&listed.stderr));
    let text = String::from_utf8(listed.stdout).unwrap();
    let logs = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let logs = logs.filter(|words| words.get(1) == Some(&"HUM"));
    logs.map(|words| (words[0].to_owned(), format!("{} {}", words[3], words[4]))).collect()
}

#[test]
fn a_log_has_the_date_of_its_flight_and_none_before_it_is_known() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    let record = |input: &Path, codes: &[i32]| {
        let arguments = ["sim".as_ref(), input.as_os_str(), "--sd".as_ref(), image.as_os_str()];
        hums(arguments).expect_code(codes);
    };
    record(&own("ap_quad_guided.tlog"), &[0]);
    // Before the autopilot knew the time.
    let whole = fs::read(own("ap_quad_guided.tlog")).unwrap();
    let early = dir.path().join("early.tlog");
    fs::write(&early, &whole[..600]).unwrap();
    // Its last record is cut.
    record(&early, &[0, 3]);
    record(&own("ap_quad_faults.tlog"), &[0]);
    let dates = dates(&image);
    let day = |index: usize| dates[index].1.split(' ').next().unwrap().to_owned();
    println!("{dates:?}");
    assert_eq!(dates.len(), 3, "{dates:?}");
    assert_eq!((day(0), day(1)), (utc_day(&image, 1), "1980-01-01".to_owned()), "{dates:?}");
    assert_eq!(day(2), utc_day(&image, 3), "{dates:?}");
    hums_with("info --verify {}", &[&image]).expect_code(&[0, 3]);
}

fn utc_day(image: &Path, session: u32) -> String {
    let session = format!("{session:05}");
    let text =
        hums(["info".as_ref(), image.as_os_str(), "--session".as_ref(), session.as_ref(), "--json".as_ref()])
            .expect_code(&[0])
            .text();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let utc = find_utc(&json).unwrap_or_else(|| panic!("no time of day: {text}"));
    utc[..10].to_owned()
}

fn find_utc(json: &serde_json::Value) -> Option<String> {
    match json {
        serde_json::Value::Object(map) => map.iter().find_map(|(key, value)| match value.as_str() {
            Some(text) if key.contains("utc") && text.len() >= 10 => Some(text.to_owned()),
            _ => find_utc(value),
        }),
        serde_json::Value::Array(list) => list.iter().find_map(find_utc),
        _ => None,
    }
}
