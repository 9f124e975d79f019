//! Reports of recorded flights in Chromium.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;

use hums_tests::flights::{Manifest, own};
use hums_tests::frames::build_v2;
use hums_tests::oracle::LivePage;
use hums_tests::program::{LIMIT, Machine, Recording, command, hums_with};
use hums_tests::{child, oracle};
use serde_json::Value;

use super::live::shoot;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[track_caller]
fn report(source: &Path, codes: &[i32]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("report.html");
    hums_with("report {} -o {}", &[&source, &page]).expect_code(codes);
    (dir, page)
}

#[track_caller]
fn assert_sound(shown: &Value) {
    assert_eq!(shown["console"], serde_json::json!([]), "the browser complains");
    assert_eq!(shown["requests"], serde_json::json!([]), "the page asks for something");
    let width = shown["width"].as_array().unwrap();
    assert!(width[0].as_f64() <= width[1].as_f64(), "it is wider than a phone: {width:?}");
    for (id, plot) in shown["plots"].as_object().unwrap() {
        let pixels = plot["pixels"].as_array().unwrap().iter().filter_map(Value::as_u64);
        assert!(pixels.sum::<u64>() > 50, "{id} has no line: {plot}");
    }
}

/// The first words of a text.
pub(crate) fn number(text: &str) -> f64 {
    let plain: String =
        text.chars().filter(|c| *c != '\u{202f}').map(|c| if c == '\u{2212}' { '-' } else { c }).collect();
    let end = plain.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-'))).unwrap_or(plain.len());
    plain[..end].parse().unwrap_or_else(|_| panic!("no number: {text:?}"))
}

fn around(jsonl: &str, message: &str, at_s: f64, around_s: f64, value: impl Fn(&Value) -> f64) -> (f64, f64) {
    let wanted = format!("\"message\":\"{message}\"");
    let values = jsonl.lines().filter(|line| line.contains(&wanted)).map(json).filter_map(|entry| {
        let near = (entry["time_boot"].as_f64().unwrap() - at_s).abs() <= around_s;
        near.then(|| value(&entry["fields"]))
    });
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

#[test]
fn a_flights_page_shows_the_flight() {
    let recording = Recording::make(Machine::Sim, &own("ap_quad_faults.tlog"), &[]);
    let (_dir, page) = report(&recording.image(), &[0]);
    let shown = LivePage::start().look(&page, &[0.3, 0.5, 0.7]);
    assert_sound(&shown);

    let info = json(&hums_with("info --json {}", &[&recording.image()]).text());
    let log = &info["logs"][0];
    let findings = shown["findings"].as_array().unwrap();
    let expected = log["findings"].as_array().unwrap();
    assert_eq!(findings.len(), expected.len());
    assert!(!expected.is_empty());
    for (row, finding) in findings.iter().zip(expected) {
        let ended = finding["level"] == "ok" && finding["value"].is_null();
        let level = if ended { &serde_json::json!("ended") } else { &finding["level"] };
        assert_eq!((&row[1], &row[2]), (level, &finding["check"]));
    }
    let tiles = &shown["tiles"];
    let tile = |name: &str| number(tiles[name].as_str().unwrap_or_else(|| panic!("no {name} in {tiles}")));
    assert!((tile("frames recorded") - log["frames"].as_f64().unwrap()).abs() < 0.5);
    assert!((tile("greatest height") - log["usage"]["height_max_m"].as_f64().unwrap()).abs() <= 0.051);
    assert!((tile("lowest battery voltage") - 10.2).abs() < 0.006, "by the recording's own description");
    assert!(shown["map"][0].as_f64().unwrap() > 0.02, "no track: {}", shown["map"]);
    assert!(shown["timeline"].as_f64().unwrap() > 0.2, "no phases: {}", shown["timeline"]);
    for plot in [
        "Height",
        "Speed",
        "PackVolts",
        "MotorRpm",
        "MotorVolts",
        "MotorAmperes",
        "MotorCelsius",
        "Vibration",
        "Clips",
        "Estimator",
        "Satellites",
        "Frames",
    ] {
        assert!(shown["plots"][plot].is_object(), "there is no plot {plot}");
    }
    for motor_plot in ["MotorRpm", "MotorVolts"] {
        assert_eq!(shown["plots"][motor_plot]["lines"], 4, "{motor_plot}");
    }
    assert_pointed_values(&recording.image(), &shown);
    assert!(shown["cursor"].as_str().unwrap().contains(':'), "no time under the cursor: {}", shown["cursor"]);
    // The defaults of docs/parameters.md.
    assert_eq!(shown["limits"]["Vibration"], serde_json::json!([[30, 60]]));
    assert_eq!(shown["limits"]["Attitude"], serde_json::json!([[45, 60], [-45, -60]]));
    assert_eq!(shown["plots"]["Altitude"]["lines"], 4, "receiver, EKF, what is wanted and AHRS2 are apart");
    assert!(!shown["why"].as_array().unwrap().is_empty(), "no finding says what it means");
}

/// The values of a pixel's width and of an interval on both sides.
const AROUND_S: f64 = 1.6;

/// A plot, one of its lines, its message, its resolution, and its value from the message's fields.
type Line = (&'static str, &'static str, &'static str, f64, fn(&Value) -> f64);

fn assert_modes(jsonl: &str, shown: &Value) {
    let beats = jsonl.lines().filter(|line| line.contains("\"message\":\"HEARTBEAT\"")).map(json);
    let of_autopilot = beats.filter(|entry| entry["component"] == 1);
    let mut modes: Vec<u64> =
        of_autopilot.filter_map(|entry| entry["fields"]["custom_mode"].as_u64()).collect();
    modes.dedup();
    // ArduCopter's mode.h.
    let names = modes.iter().map(|mode| match mode {
        0 => "STABILIZE",
        3 => "AUTO",
        4 => "GUIDED",
        5 => "LOITER",
        6 => "RTL",
        9 => "LAND",
        _ => "?",
    });
    assert_eq!(shown["modes"], serde_json::json!(names.collect::<Vec<_>>()));
    assert!(!modes.is_empty());
}

fn assert_pointed_values(image: &Path, shown: &Value) {
    let jsonl = hums_with("decode {} -o - --format jsonl", &[&image]).expect_code(&[0]).text();
    assert_modes(&jsonl, shown);
    let lines: [Line; 6] = [
        ("Wind", "Wind", "WIND", 0.06, |fields| fields["speed"].as_f64().unwrap()),
        ("Altitude", "Wanted", "POSITION_TARGET_GLOBAL_INT", 0.06, |fields| fields["alt"].as_f64().unwrap()),
        ("Height", "Height", "GLOBAL_POSITION_INT", 0.01, |fields| {
            fields["relative_alt"].as_f64().unwrap() / 1e3
        }),
        ("PackVolts", "Battery 1", "BATTERY_STATUS", 0.001, |fields| {
            fields["voltages"][0].as_f64().unwrap() / 1e3
        }),
        ("MotorRpm", "Motor 3", "ESC_TELEMETRY_1_TO_4", 1.0, |fields| fields["rpm"][2].as_f64().unwrap()),
        ("Vibration", "Down", "VIBRATION", 0.001, |fields| fields["vibration_z"].as_f64().unwrap()),
    ];
    for (plot, line, message, resolution, value) in lines {
        for point in shown["plots"][plot]["points"].as_array().unwrap() {
            let at_s = point["time_s"].as_f64().unwrap();
            let text =
                point["values"][line].as_str().unwrap_or_else(|| panic!("{plot} has no {line}: {point}"));
            let (low, high) = around(&jsonl, message, at_s, AROUND_S, value);
            let said = number(text);
            assert!(
                (low - resolution..=high + resolution).contains(&said),
                "{plot} says {said} at {at_s} s, the flight {low} to {high}"
            );
        }
    }
}

#[test]
fn a_px4_flights_page_shows_its_cells_of_the_recorder_and_a_gap() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("flight.hum");
    hums_with("decode --format hum {} -o {}", &[&own("px4_hil_quad_low.tlog"), &log]).expect_code(&[0]);
    let mut bytes = fs::read(&log).unwrap();
    bytes[150 * 512 + 100] ^= 0x10;
    fs::write(&log, bytes).unwrap();
    let (_dir, page) = report(&log, &[3]);
    let shown = LivePage::start().look(&page, &[0.5]);
    assert_sound(&shown);
    let gaps = shown["gaps"].as_array().unwrap();
    assert_eq!(gaps.len(), 1);
    assert!(gaps[0].as_str().unwrap().contains("damaged"), "{gaps:?}");
    assert_eq!(shown["plots"]["MotorCelsius"]["lines"], 4);
}

#[test]
fn words_of_a_hostile_vehicle_stay_words() {
    const HOSTILE: [&str; 3] = [
        "</script><script>document.title='owned'</script>",
        "<img src=x onerror=\"document.title='owned'\">",
        "{{program}} & \"quotes\" 'n' \\u003c <b>",
    ];
    let seeds = &Manifest::own().seeds;
    let mut data = Vec::new();
    for sequence in 0..120_u8 {
        data.extend(build_v2(sequence.wrapping_mul(2), 0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3], seeds[&0]));
        let mut payload = vec![4];
        payload.extend(HOSTILE[usize::from(sequence) % 3].bytes());
        payload.resize(51, 0);
        data.extend(build_v2(sequence.wrapping_mul(2).wrapping_add(1), 253, &payload, seeds[&253]));
    }
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("hostile.raw");
    fs::write(&file, &data).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    let (_dir, page) = report(&recording.image(), &[0]);
    let shown = LivePage::start().look(&page, &[0.5]);
    assert_sound(&shown);
    assert!(!shown["title"].as_str().unwrap().contains("owned"), "{}", shown["title"]);
    let texts = shown["texts"].as_array().unwrap();
    for hostile in HOSTILE {
        let said = &hostile[..hostile.len().min(50)];
        assert!(texts.iter().any(|text| text == said), "{said} is not in {texts:?}");
    }
}

#[test]
fn several_sessions_of_a_card_become_a_trend() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    for flight in ["ap_quad_guided.tlog", "ap_quad_faults.tlog"] {
        let mut sim = command(["sim", "--speed", "max"]);
        child::run(sim.arg(own(flight)).arg("--sd").arg(&image), LIMIT).expect_code(&[0]);
    }
    let (_dir, page) = report(&image, &[0]);
    let shown = LivePage::start().look(&page, &[0.5]);
    assert_sound(&shown);
    let text = shown["text"].as_str().unwrap();
    assert!(text.contains("This session against the 1 session before it on the same card"), "no trend");
}

fn labelled(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("labelled").join(name)
}

fn standing(seconds: u8, more: impl Fn(u8) -> Vec<(u32, Vec<u8>)>) -> Vec<u8> {
    let seeds = &Manifest::own().seeds;
    let (mut data, mut sequence, start_us) = (Vec::new(), 0_u8, 1_700_000_000_000_000_u64);
    for second in 0..seconds {
        let beat = (0, vec![4, 0, 0, 0, 2, 3, 0x51, 4, 3]);
        for (id, payload) in std::iter::once(beat).chain(more(second)) {
            data.extend((start_us + u64::from(second) * 1_000_000).to_be_bytes());
            data.extend(build_v2(sequence, id, &payload, seeds[&id]));
            sequence = sequence.wrapping_add(1);
        }
    }
    data
}

#[test]
fn each_battery_has_its_own_lines_and_two_barometers_are_two() {
    let battery = |id: u8, millivolts: u16| {
        let mut payload = vec![0xff; 36];
        payload[..10].copy_from_slice(&[0; 10]);
        for cell in 0..2 {
            payload[10 + 2 * cell..12 + 2 * cell].copy_from_slice(&millivolts.to_le_bytes());
        }
        payload[32..36].copy_from_slice(&[id, 0, 1, 50]);
        payload
    };
    let pressure = || [&[0; 4][..], &1_000_f32.to_le_bytes(), &[0; 4], &1_180_i16.to_le_bytes()].concat();
    let highres = || {
        [&[0; 8][..], &[0; 36], &1_001_f32.to_le_bytes(), &[0; 8], &15_f32.to_le_bytes(), &[255, 31]].concat()
    };
    let data = standing(20, |_| {
        let batteries = (0..6).map(|id| (147, battery(id, 3_500 + 50 * u16::from(id))));
        batteries.chain([(29, pressure()), (105, highres())]).collect()
    });
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("six.tlog");
    fs::write(&file, data).unwrap();
    let (_dir, path) = report(&file, &[0]);
    let mut page = LivePage::start();
    page.open(&format!("file://{}", path.display()), "light", 1280, 900);
    let lines = |page: &mut LivePage, plot: &str| {
        let keys = format!("document.querySelectorAll('#plot-{plot} .keys button')");
        page.run(&format!(
            "return [...{keys}].map((key) => [key.childNodes[1].textContent, key.lastChild.textContent])"
        ))
    };
    let volts = lines(&mut page, "PackVolts");
    let volts = volts.as_array().unwrap();
    assert_eq!(volts.len(), 6, "{volts:?}");
    assert_eq!(volts[5], serde_json::json!(["Battery 6", "7.500"]));
    let cells = lines(&mut page, "CellVolts");
    assert_eq!(cells[0], serde_json::json!(["Cell 1", "3.500"]));
    assert_eq!(cells[11], serde_json::json!(["Battery 6, cell 2", "3.750"]));
    let celsius = lines(&mut page, "Temperature");
    assert_eq!(
        celsius,
        serde_json::json!([
            ["Barometer", "11.8"],
            ["Inertial sensor", "15.0"],
            ["Air, by HIGHRES_IMU", "15.0"]
        ])
    );
}

#[test]
fn a_track_across_the_180th_meridian_is_as_wide_as_the_flight() {
    let place = |second: u8| {
        let degrees = 179.9990 + f64::from(second) * 20.0 / 111_320.0;
        let longitude = (if degrees > 180.0 { degrees - 360.0 } else { degrees } * 1e7) as i32;
        let mut payload = vec![0; 28];
        payload[8..12].copy_from_slice(&longitude.to_le_bytes());
        payload[16..20].copy_from_slice(&50_000_i32.to_le_bytes());
        payload
    };
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("east.tlog");
    fs::write(&file, standing(20, |second| vec![(33, place(second))])).unwrap();
    let (_dir, path) = report(&file, &[0]);
    let mut page = LivePage::start();
    page.open(&format!("file://{}", path.display()), "light", 1280, 900);
    page.wait("return document.querySelector('p.legend')?.textContent.includes('from the start')", 20);
    let legend = page.run("return document.querySelector('p.legend').textContent");
    assert!(legend.as_str().unwrap().contains("380 m"), "{legend}");
}

#[test]
fn a_finding_stands_with_its_cause_and_with_its_consequences() {
    let (_dir, page) = report(&labelled("f10_gps_off.tlog.gz"), &[0]);
    let shown = LivePage::start().look(&page, &[0.5]);
    assert_sound(&shown);
    let says = |kind: &str, words: &str| {
        shown[kind].as_array().unwrap().iter().any(|text| text.as_str().unwrap().contains(words))
    };
    assert!(says("because", "Because of: GPS"), "{}", shown["because"]);
    assert!(says("consequences", "Consequences: "), "{}", shown["consequences"]);
}

fn table(page: &mut LivePage, selector: &str) -> Vec<Vec<String>> {
    let rows = page.run(&format!(
        "return [...document.querySelectorAll('{selector} tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))"
    ));
    serde_json::from_value(rows).unwrap()
}

/// All cells of a table are in view, each as wide as its text.
fn assert_uncut(page: &mut LivePage, selector: &str, width: u32) {
    let cut = page.run(&format!(
        "const cells = [...document.querySelectorAll('{selector} td')].filter((cell) => cell.textContent);
         const isCut = (cell) => cell.getBoundingClientRect().right > innerWidth || cell.scrollWidth > cell.clientWidth;
         return [cells.length, document.documentElement.scrollWidth, cells.filter(isCut).map((cell) => cell.textContent)]"
    ));
    assert!(cut[0].as_u64() > Some(5) && cut[1].as_u64() <= Some(width.into()), "{selector}, {width}: {cut}");
    assert_eq!(cut[2], serde_json::json!([]), "{selector}, {width}");
}

fn data_of(path: &Path) -> Value {
    let text = fs::read_to_string(path).unwrap();
    let data = text.split_once("id=\"data\">").unwrap().1;
    json(data.split_once("</script>").unwrap().0)
}

fn parameters(recording: &Path) -> BTreeMap<String, u32> {
    let lines = hums_with("decode {} -o - --format jsonl", &[&recording]).expect_code(&[0]).text();
    let values = lines.lines().filter(|line| line.contains("\"PARAM_VALUE\"")).map(json);
    let of_autopilot = values.filter(|entry| entry["component"] == 1);
    let fields = of_autopilot.map(|entry| entry["fields"].clone());
    let mut values = BTreeMap::new();
    for fields in fields {
        let value = (fields["param_value"].as_f64().unwrap() as f32).to_bits();
        let name = fields["param_id"].as_str().unwrap().to_owned();
        values.insert(name, value);
    }
    values
}

#[test]
fn a_folder_of_pages_has_a_table_and_flights_stand_side_by_side() {
    let dir = tempfile::tempdir().unwrap();
    let pages = dir.path().join("pages");
    let flights = ["ap_quad_guided.tlog", "ap_quad_faults.tlog"].map(own);
    let mut make = command(["report", "--compare"]);
    make.args(&flights).arg("-o").arg(format!("{}/", pages.display()));
    child::run(&mut make, LIMIT).expect_code(&[0]);
    let mut page = LivePage::start();
    let index = format!("file://{}/index.html", pages.display());
    page.open_ready(&index, "light", 1280, 340);
    shoot(&mut page, "index");
    page.open_ready(&index, "light", 1280, 900);
    let rows = table(&mut page, "#pages");
    assert_eq!(rows.len(), 2);
    let air = |rows: &[Vec<String>]| rows.iter().map(|row| row[7].clone()).collect::<Vec<_>>();
    page.run("document.querySelectorAll('#pages .sort')[7].focus()");
    page.press(&["ENTER"]);
    let (falling, other) = (air(&table(&mut page, "#pages")), {
        page.press(&["ENTER"]);
        air(&table(&mut page, "#pages"))
    });
    assert_ne!(falling, other);
    page.run("const word = document.querySelector('input'); word.value = 'faults'; word.dispatchEvent(new Event('input'))");
    assert_eq!(table(&mut page, "#pages").len(), 1);
    assert_eq!(page.console(), serde_json::json!([]));
    page.run("document.querySelector('#pages a').click()");
    page.wait("return document.title.includes('ap_quad_faults') && document.documentElement.dataset.ready === 'true'", 20);
    assert_times(&mut page, &flights[1]);
    let [before, now] = [0, 1].map(|flight: usize| parameters(&flights[flight]));
    let is_own = |name: &str| name.starts_with("STAT_") || name.ends_with("_GND_PRESS");
    let differ: Vec<&String> = now
        .iter()
        .filter(|(name, value)| !is_own(name) && before.get(*name).is_some_and(|before| before != *value))
        .map(|(name, _)| name)
        .collect();
    let changed: Vec<String> =
        table(&mut page, "#parameters-before").into_iter().map(|row| row[0].clone()).collect();
    assert_eq!(changed.iter().collect::<Vec<_>>(), differ);
    assert!(
        page.run("return document.getElementById('parameters-other').textContent")
            .as_str()
            .unwrap()
            .contains("does not tell which parameters are at their defaults")
    );

    for width in [800, 390] {
        page.open_ready(&index, "light", width, 844);
        assert_uncut(&mut page, "#pages", width);
    }
    page.run("document.querySelector('#comparisons a').click()");
    page.wait(
        "return document.title.includes('side by side') && document.documentElement.dataset.ready === 'true'",
        20,
    );
    page.open_ready(page_of(&pages, "compare-").as_str(), "light", 1280, 900);
    assert_compared(&mut page, &pages, &now, &before);
}

#[track_caller]
fn assert_times(page: &mut LivePage, recording: &Path) {
    let info = json(&hums_with("info --json {}", &[&recording]).text());
    let findings = info["logs"][0]["findings"].as_array().unwrap();
    let tenths = findings.iter().map(|finding| (finding["time_s"].as_f64().unwrap() * 10.0).round() as u64);
    let expected: Vec<String> =
        tenths.map(|t| format!("{}:{:02}.{}", t / 600, t / 10 % 60, t % 10)).collect();
    let shown = page
        .run("return [...document.querySelectorAll('.notes .finding time')].map((time) => time.textContent)");
    assert!(!expected.is_empty());
    assert_eq!(shown, serde_json::json!(expected));
}

fn page_of(pages: &Path, begins: &str) -> String {
    let mut files = fs::read_dir(pages).unwrap().map(|entry| entry.unwrap().path());
    let file = files.find(|file| file.file_name().unwrap().to_string_lossy().starts_with(begins)).unwrap();
    format!("file://{}", file.display())
}

fn assert_compared(
    page: &mut LivePage,
    pages: &Path,
    now: &BTreeMap<String, u32>,
    before: &BTreeMap<String, u32>,
) {
    let figures = table(page, "#figures");
    let figure = |name: &str| {
        let row =
            figures.iter().find(|row| row[0] == name).unwrap_or_else(|| panic!("no {name}: {figures:?}"));
        [number(&row[1]), number(&row[2])]
    };
    let page_data = |name: &str| data_of(Path::new(page_of(pages, name).trim_start_matches("file://")));
    for (column, name) in ["ap_quad_faults", "ap_quad_guided"].into_iter().enumerate() {
        let data = page_data(name);
        let height = data["flights"]
            .as_array()
            .unwrap()
            .iter()
            .map(|f| f["height_max_m"].as_f64().unwrap())
            .fold(0.0, f64::max);
        assert!((figure("Greatest height")[column] - height).abs() < 0.051, "{name}: {height} {figures:?}");
    }
    assert_tracks(
        page,
        &["ap_quad_faults", "ap_quad_guided"].map(page_data),
        figure("Farthest from take-off"),
    );
    let names = "return [...document.querySelectorAll('#plot-PackVolts-0 .keys button')].map((key) => key.textContent)";
    assert_eq!(page.run(names).as_array().unwrap().len(), 2, "both in one plot, on one scale");
    page.run("document.querySelectorAll('#figures input')[1].click()");
    let off = page.run("return [...document.querySelectorAll('.plot')].filter((plot) => plot.querySelectorAll('.keys .off').length !== 1).length");
    let whole = page.run("return [...document.querySelectorAll('.plot')].filter((plot) => plot.querySelectorAll('.keys button').length === 2).length");
    let all = page.run("return document.querySelectorAll('.plot').length");
    assert!(
        whole.as_u64() > Some(10)
            && off.as_u64() == all.as_u64().zip(whole.as_u64()).map(|(all, whole)| all - whole),
        "{off} {whole} {all}"
    );
    page.run("document.querySelectorAll('#figures input')[1].click()");
    let differ =
        now.iter().filter(|(name, value)| before.get(*name).is_some_and(|before| before != *value)).count();
    let shown = if differ == 0 { 0 } else { table(page, "#parameters").len() };
    assert_eq!(shown, differ);
    assert_eq!(page.console(), serde_json::json!([]));
    shoot(page, "compare");
}

#[track_caller]
fn assert_tracks(page: &mut LivePage, pages: &[Value; 2], far_m: [f64; 2]) {
    for (data, far_m) in pages.iter().zip(far_m) {
        let last = data["flights"].as_array().unwrap().last().unwrap();
        let within =
            |at: &Value| at.as_f64() >= last["from_s"].as_f64() && at.as_f64() <= last["to_s"].as_f64();
        let track = data["flight"]["track"].as_array().unwrap().iter().filter(|place| within(&place[0]));
        let places: Vec<[f64; 2]> =
            track.map(|place| [1, 2].map(|axis: usize| place[axis].as_f64().unwrap())).collect();
        let [north, east] = places[0];
        let metres = |[latitude, longitude]: &[f64; 2]| {
            let shrink = north.to_radians().cos();
            (latitude - north).hypot((longitude - east) * shrink) * 111_320.0
        };
        let expected = places.iter().map(metres).fold(0.0, f64::max);
        assert!(expected > 10.0 && (expected - far_m).abs() < 1.5, "{expected} {far_m}");
    }
    let scales =
        "return [...document.querySelectorAll('#tracks canvas')].map((map) => Number(map.dataset.scale))";
    let both = page.run(scales);
    assert!(both[0].as_f64() > Some(0.0) && both[0] == both[1] && both[2].is_null(), "{both}");
    let hide = |number: usize| format!("document.querySelectorAll('#figures input')[{number}].click()");
    for number in 0..2 {
        page.run(&hide(number));
        let one = page.run(scales)[1 - number].as_f64();
        assert!(one >= both[0].as_f64(), "{one:?} {both}");
        page.run(&hide(number));
    }
    assert_eq!(page.run(scales), both);
}

#[test]
fn flights_of_one_file_and_a_single_one_cannot_be_compared() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("one.html");
    let mut make = command(["report", "--compare"]);
    make.arg(own("ap_quad_guided.tlog")).arg("-o").arg(&out);
    let refused = child::run(&mut make, LIMIT).expect_code(&[1]);
    assert!(refused.stderr.contains("fewer than two flights"), "{}", refused.stderr);
    assert!(!out.exists());
}

#[test]
fn parameters_that_are_not_at_their_default_are_those_of_which_the_log_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("flight.bin");
    let mut input = hums::source::input::Input::open(&labelled("bin/n03_wind9_gusty.bin.gz")).unwrap();
    std::io::copy(&mut input, &mut fs::File::create(&log).unwrap()).unwrap();
    let (_dir, path) = report(&log, &[0]);
    // By pymavlink.
    let lines = oracle::dataflash(&log);
    let rows = lines.lines().map(json).filter(|row| row[0] == "PARM");
    let (mut other, mut defaults) = (BTreeMap::new(), BTreeMap::new());
    for row in rows {
        let name = row[1][1].as_str().unwrap().to_owned();
        if let Some(default) = row[1][3].as_f64() {
            defaults.insert(name.clone(), default);
        }
        let differs = defaults
            .get(&name)
            .is_some_and(|default| default.total_cmp(&row[1][2].as_f64().unwrap()).is_ne());
        other.insert(name, differs);
    }
    let wanted: Vec<&String> = other.iter().filter(|(_, other)| **other).map(|(name, _)| name).collect();
    let mut page = LivePage::start();
    page.open(&format!("file://{}", path.display()), "light", 1280, 900);
    let shown: Vec<String> =
        table(&mut page, "#parameters-other").into_iter().map(|row| row[0].clone()).collect();
    assert!(!wanted.is_empty() && other.len() > wanted.len(), "{} of {}", wanted.len(), other.len());
    assert_eq!(shown.iter().collect::<Vec<_>>(), wanted);
}

/// The contrast of each text with its background, by WCAG 2.2: the lowest, with its text.
const CONTRAST: &str = "
const channel = (c) => (c /= 255) <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4;
const light = ([r, g, b]) => .2126 * channel(r) + .7152 * channel(g) + .0722 * channel(b);
const colour = (text) => { const n = text.match(/[0-9.]+/g).map(Number); return n.length < 4 ? [...n, 1] : n; };
const over = ([r, g, b, a], under) => [r, g, b].map((c, i) => c * a + under[i] * (1 - a));
const behind = (node) => {
  const layers = [];
  for (let one = node; one; one = one.parentElement) {
    const c = colour(getComputedStyle(one).backgroundColor);
    if (c[3] > 0) layers.push(c);
    if (c[3] === 1) break;
  }
  return layers.reverse().reduce((under, layer) => over(layer, under), [255, 255, 255]);
};
let worst = [99, ''];
const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
for (let text = walk.nextNode(); text; text = walk.nextNode()) {
  const node = text.parentElement;
  if (!text.data.trim() || !node.checkVisibility({ visibilityProperty: true }) || node.closest('script, svg, .off, noscript')) continue;
  const ground = behind(node), ink = over(colour(getComputedStyle(node).color), ground);
  const [a, b] = [light(ink), light(ground)].sort((x, y) => y - x), ratio = (a + .05) / (b + .05);
  if (ratio < worst[0]) worst = [ratio, text.data.slice(0, 40), getComputedStyle(node).color, String(ground)];
}
return worst;
";

/// Plots of a wide window too are as wide as A4 within its margins.
#[track_caller]
fn assert_fits_on_paper(page: &mut LivePage, address: &str) {
    page.open_ready(address, "light", 1920, 1000);
    let beyond = "
        const right = document.querySelector('main').getBoundingClientRect().left + 704;
        // Plots that are folded away are not on paper.
        return [...document.querySelectorAll('.plot .uplot, #timeline')].filter((plot) => plot.checkVisibility()).filter((plot) => {
          const [own, around] = [plot, plot.parentElement].map((node) => node.getBoundingClientRect());
          return own.right > right || own.right > around.right + 1;
        }).length";
    let plots = page.run("return document.querySelectorAll('.plot .uplot').length");
    assert!(plots.as_u64() > Some(10) && page.run(beyond).as_u64() > Some(0), "{plots} plots are wide");
    page.run("dispatchEvent(new Event('beforeprint'))");
    assert_eq!(page.run(beyond), 0);
    page.run("dispatchEvent(new Event('afterprint'))");
    assert!(page.run(beyond).as_u64() > Some(0), "as it was");
}

#[test]
fn a_report_is_read_on_paper_in_the_dark_with_high_contrast_on_a_phone_and_from_the_keyboard() {
    let recording = Recording::make(Machine::Sim, &own("ap_quad_faults.tlog"), &[]);
    let (dir, path) = report(&recording.image(), &[0]);
    let address = format!("file://{}", path.display());
    let mut page = LivePage::start();
    page.open_ready(&address, "light", 1280, 900);
    for (name, media, scheme, contrast, least) in [
        (Some("report"), "", "light", "no-preference", 4.5),
        (Some("report-dark"), "", "dark", "no-preference", 4.5),
        (None, "", "light", "more", 7.0),
        (None, "", "dark", "more", 7.0),
        (None, "print", "light", "no-preference", 4.5),
    ] {
        let features = serde_json::json!({ "prefers-color-scheme": scheme, "prefers-contrast": contrast });
        page.media(media, &features);
        let worst = page.run(CONTRAST);
        assert!(worst[0].as_f64() >= Some(least), "{media} {scheme} {contrast}: {worst}");
        let tops =
            page.run("return ['findings', 'summary'].map((id) => document.getElementById(id).offsetTop)");
        assert_eq!(tops[0].as_f64() < tops[1].as_f64(), media == "print", "findings first on paper: {tops}");
        if let Some(name) = name {
            shoot(&mut page, name);
        }
    }
    page.media("", &serde_json::json!({ "forced-colors": "active" }));
    let framed = page.run("return getComputedStyle(document.querySelector('.badge')).borderTopStyle");
    assert_eq!(framed, "solid", "a level without its colour");
    page.media("", &serde_json::json!({}));
    page.run("document.getElementById('timeline').focus()");
    page.press(&["HOME", "ARROW_RIGHT", "ARROW_RIGHT"]);
    let cursor = page.run("return document.querySelector('.cursor-time').textContent");
    assert!(cursor.as_str().unwrap().contains(':'), "{cursor}");
    let span = "return Number(document.getElementById('timeline').getAttribute('aria-valuenow'))";
    let first = page.run(span).as_f64();
    page.press(&["ARROW_RIGHT"]);
    assert!(page.run(span).as_f64() > first);
    page.press(&["ENTER"]);
    page.wait("return !document.querySelector('.back').hidden", 5);
    page.press(&["ESCAPE"]);
    page.wait("return document.querySelector('.back').hidden", 5);
    let mute = page.run("return [...document.querySelectorAll('[onclick], tr.go, .notes .when, canvas[role=slider]')].filter((node) => node.tabIndex < 0).length");
    assert_eq!(mute, 0);
    assert_fits_on_paper(&mut page, &address);
    let pdf = dir.path().join("report.pdf");
    page.pdf(&pdf);
    let bytes = fs::read(&pdf).unwrap();
    assert!(bytes.starts_with(b"%PDF") && bytes.len() > 50_000, "{} bytes", bytes.len());
    for width in [800, 390] {
        page.open_ready(&address, "light", width, 844);
        assert_uncut(&mut page, "#flights", width);
    }
    shoot(&mut page, "report-phone");
    assert_eq!(page.console(), serde_json::json!([]));
}

fn tile_server() -> (String, mpsc::Receiver<String>) {
    const TILE: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" width="256" height="256"/>"#;
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap().to_string();
    let (asked, paths) = mpsc::channel();
    thread::spawn(move || {
        for stream in server.incoming() {
            let (mut stream, mut head) = (stream.unwrap(), [0; 4096]);
            let length = stream.read(&mut head).unwrap();
            let head = String::from_utf8_lossy(&head[..length]).into_owned();
            let _ = write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: image/svg+xml\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{TILE}",
                TILE.len()
            );
            if asked.send(head.split(' ').nth(1).unwrap_or_default().to_owned()).is_err() {
                break;
            }
        }
    });
    (address, paths)
}

#[test]
fn the_map_has_tiles_of_the_server_that_the_user_named_at_the_place_of_the_flight() {
    let (address, paths) = tile_server();
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("report.html");
    let map = format!("http://{address}/{{z}}/{{x}}/{{y}}.png");
    let flight = own("ap_quad_guided.tlog");
    hums_with("report {} -o {} --map {}", &[&flight, &page, &map]).expect_code(&[0]);
    let mut shown = LivePage::start();
    shown.open(&format!("file://{}", page.display()), "light", 1280, 900);
    let legend = "return document.querySelector('.mapped + .legend')?.textContent.includes('map tiles from')";
    shown.wait(legend, 20);
    let first = paths.recv_timeout(std::time::Duration::from_secs(20)).unwrap();
    let numbers: Vec<f64> = first
        .trim_matches('/')
        .trim_end_matches(".png")
        .split('/')
        .map(|part| part.parse().unwrap())
        .collect();
    let [zoom, x, y] = numbers[..] else { panic!("{first}") };
    // The flight begins at home; a tile is no further away than the map is wide.
    let begins = shown
        .run("return document.querySelector('.mapped + .legend').textContent")
        .as_str()
        .unwrap()
        .to_owned();
    let place: Vec<f64> = begins
        .split("begins at ")
        .nth(1)
        .unwrap()
        .split([',', ' ', 'e'])
        .filter_map(|part| part.parse().ok())
        .take(2)
        .collect();
    let count = zoom.exp2();
    let wanted = [
        (place[1] + 180.0) / 360.0 * count,
        (1.0 - place[0].to_radians().tan().asinh() / std::f64::consts::PI) / 2.0 * count,
    ];
    assert!((x - wanted[0]).abs() < 6.0 && (y - wanted[1]).abs() < 6.0, "{first}, home is at {wanted:?}");
    assert_eq!(shown.console(), serde_json::json!([]), "the policy refuses a tile");
}

#[test]
fn a_fleet_has_a_page_of_its_vehicles_and_worst_findings() {
    let dir = tempfile::tempdir().unwrap();
    let (fleet, html) = (dir.path().join("fleet"), dir.path().join("fleet.html"));
    let mut decode = command(["decode", "--format", "parquet", "-o"]);
    decode.arg(&fleet).args(["ap_quad_guided.tlog", "ap_quad_faults.tlog"].map(own));
    child::run(&mut decode, LIMIT).expect_code(&[0]);
    // Beside the folder, with its name.
    child::run(command(["report"]).arg(&fleet), LIMIT).expect_code(&[0]);
    child::run(command(["report"]).arg(&fleet), LIMIT).expect_code(&[1]);
    child::run(command(["report", "--compare", "--force"]).arg(&fleet), LIMIT).expect_code(&[2]);
    let mut page = LivePage::start();
    page.open_ready(&format!("file://{}", html.display()), "light", 1280, 900);
    let vehicles = table(&mut page, "#vehicles-table");
    let [vehicle] = vehicles.as_slice() else { panic!("{vehicles:?}") };
    assert_eq!(
        (vehicle[1].as_str(), vehicle[3].as_str(), vehicle[4].as_str()),
        ("ArduPilot quadrotor", "2", "2")
    );
    let findings = table(&mut page, "#findings-table");
    assert!(findings[0][0] == "critical" && findings[4][0] == "warning", "{findings:?}");
    assert!(findings.iter().any(|row| row[2] == "battery 1 cell low" && row[5] == "3.4 V"), "{findings:?}");
    page.run("const word = document.querySelector('#findings input'); word.value = 'nothing has this'; word.dispatchEvent(new Event('input'))");
    assert!(table(&mut page, "#findings-table").is_empty());
    assert_eq!(page.console(), serde_json::json!([]));
    page.open_ready(&format!("file://{}", html.display()), "light", 390, 844);
    let width = page.run("return [document.documentElement.scrollWidth, innerWidth]");
    assert!(width[0].as_f64() <= width[1].as_f64(), "{width}");
}
