//! `hums live` in Chromium: on a recorded flight, and on a link.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hums_tests::flights::{Manifest, own, root};
use hums_tests::frames::build_v2;
use hums_tests::live::{Live, Running, free_port};
use hums_tests::oracle::LivePage;
use hums_tests::program::{command, hums, hums_with};
use serde_json::{Value, json};

use super::report::number;

fn shown(page: &Value, name: &str) -> f64 {
    number(page["values"][name].as_str().unwrap_or_else(|| panic!("the page has no {name}")))
}

fn frames(recording: &Path) -> Vec<Value> {
    let text = hums_with("decode {} -o - --format jsonl", &[&recording]).expect_code(&[0]).text();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn cut(recording: &Path, from_s: f64, to: &Path) -> PathBuf {
    let data = std::fs::read(recording).unwrap();
    let frames = hums_tests::frames::of_tlog(&data, &Manifest::own().seeds, false);
    let start_us = frames[0].time_us.unwrap() + (from_s * 1e6) as u64;
    let late = frames.iter().filter(|frame| frame.time_us.unwrap() >= start_us);
    let bytes = late.flat_map(|frame| [&frame.time_us.unwrap().to_be_bytes()[..], frame.bytes].concat());
    std::fs::write(to, bytes.collect::<Vec<u8>>()).unwrap();
    to.to_owned()
}

fn last<'a>(frames: &'a [Value], message: &str, by_s: f64) -> &'a Value {
    let of_vehicle = |frame: &&Value| frame["message"] == message && frame["component"] == 1;
    let by = |frame: &&Value| frame["time_boot"].as_f64().unwrap() <= by_s;
    let found = frames.iter().filter(of_vehicle).rfind(by);
    &found.unwrap_or_else(|| panic!("no {message} by {by_s} s"))["fields"]
}

/// Its message, its resolution, and its value from the message's fields.
type Panel = (&'static str, &'static str, f64, fn(&Value) -> f64);

fn of(fields: &Value, name: &str) -> f64 {
    fields[name].as_f64().unwrap_or_else(|| panic!("no {name} in {fields}"))
}

const PANELS: [Panel; 24] = [
    ("battery_volts", "BATTERY_STATUS", 0.01, |f| f["voltages"][0].as_f64().unwrap() / 1e3),
    ("battery_percent", "BATTERY_STATUS", 1.0, |f| of(f, "battery_remaining")),
    ("battery_amperes", "BATTERY_STATUS", 0.01, |f| of(f, "current_battery") / 100.0),
    ("pressure", "SCALED_PRESSURE", 1.0, |f| of(f, "press_abs")),
    ("temperature", "SCALED_PRESSURE", 0.1, |f| of(f, "temperature") / 100.0),
    ("esc_rpm:2", "ESC_TELEMETRY_1_TO_4", 1.0, |f| f["rpm"][2].as_f64().unwrap()),
    ("MotorAmperes:1", "ESC_TELEMETRY_1_TO_4", 0.1, |f| f["current"][1].as_f64().unwrap() / 100.0),
    ("MotorVolts:0", "ESC_TELEMETRY_1_TO_4", 0.01, |f| f["voltage"][0].as_f64().unwrap() / 100.0),
    ("airspeed", "VFR_HUD", 0.1, |f| of(f, "airspeed")),
    ("groundspeed", "VFR_HUD", 0.1, |f| of(f, "groundspeed")),
    ("heading", "VFR_HUD", 1.0, |f| of(f, "heading")),
    ("throttle", "VFR_HUD", 1.0, |f| of(f, "throttle")),
    ("climb", "VFR_HUD", 0.1, |f| of(f, "climb")),
    ("velocity_module", "LOCAL_POSITION_NED", 0.1, |f| of(f, "vx").hypot(of(f, "vy")).hypot(of(f, "vz"))),
    ("Velocity:0", "LOCAL_POSITION_NED", 0.01, |f| of(f, "vx")),
    ("Velocity:2", "LOCAL_POSITION_NED", 0.01, |f| of(f, "vz")),
    ("altitude", "GPS_RAW_INT", 0.1, |f| of(f, "alt") / 1e3),
    ("latitude", "GPS_RAW_INT", 1e-7, |f| of(f, "lat") / 1e7),
    ("longitude", "GPS_RAW_INT", 1e-7, |f| of(f, "lon") / 1e7),
    ("satellites", "GPS_RAW_INT", 1.0, |f| of(f, "satellites_visible")),
    ("roll", "ATTITUDE", 0.1, |f| of(f, "roll").to_degrees()),
    ("pitch", "ATTITUDE", 0.1, |f| of(f, "pitch").to_degrees()),
    ("height", "GLOBAL_POSITION_INT", 0.1, |f| of(f, "relative_alt") / 1e3),
    ("vibration_2", "VIBRATION", 0.1, |f| of(f, "vibration_z")),
];

#[track_caller]
fn assert_shows(page: &Value, frames: &[Value]) {
    // The page has whole milliseconds.
    let now_s = page["now"].as_f64().unwrap() + 0.0005;
    for (name, message, resolution, value) in PANELS {
        let (says, wanted) = (shown(page, name), value(last(frames, message, now_s)));
        assert!(
            (says - wanted).abs() <= resolution * 0.51,
            "{name} says {says} at {now_s} s, {message} says {wanted}"
        );
    }
}

fn seek(page: &mut LivePage, to_s: f64) -> Value {
    page.run(&format!(
        "const s = document.querySelector('input[type=range]'); s.value = {to_s}; \
         s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change'));"
    ));
    page.wait(&format!("return Math.abs(document.documentElement.dataset.now - {to_s}) < 0.06"), 20);
    page.read()
}

#[track_caller]
fn assert_sound(page: &mut LivePage) {
    assert_eq!(page.console(), json!([]), "the browser complains");
    let width = &page.read()["width"];
    let window = page.run("return outerWidth || innerWidth").as_f64();
    assert!(width[0].as_f64() <= width[1].as_f64(), "it is wider than the window: {width}");
    assert!(width[1].as_f64() <= window, "something sticks out: {width} in a window of {window:?}");
}

/// `HUMS_SHOTS=docs` makes the documents' pictures.
pub(crate) fn shoot(page: &mut LivePage, name: &str) {
    let Some(folder) = std::env::var_os("HUMS_SHOTS") else { return };
    page.run("scrollTo(0, 0); return null");
    page.shot(&root().join(folder).join(format!("{name}.png")), false);
}

#[test]
fn every_panel_shows_the_recorded_flight_at_that_moment_and_seeking_goes_there() {
    let frames = frames(&own("ap_quad_faults.tlog"));
    let live = Live::start(&["flights/ap_quad_faults.tlog"]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1440, 900);
    page.wait("return document.documentElement.dataset.ready === 'true'", 60);
    let start = page.read()["now"].as_f64().unwrap();
    page.wait(&format!("return document.documentElement.dataset.now > {start} + 1"), 20);
    page.press(&[" "]);
    page.wait("return document.getElementById('source').textContent === 'paused'", 10);

    page.press(&["?"]);
    page.wait("return document.querySelector('dialog').open", 10);
    page.press(&["ESCAPE"]);
    page.wait("return !document.querySelector('dialog').open", 10);

    for to_s in [60.0, 90.0, 45.0, 75.0] {
        assert_shows(&seek(&mut page, to_s), &frames);
    }
    let there = page.read()["now"].as_f64().unwrap();
    page.press(&["ARROW_LEFT"]);
    page.wait(&format!("return document.documentElement.dataset.now < {there} - 4"), 10);

    let found = |page: &Value| {
        let notes = page["notes"].as_array().unwrap();
        notes.iter().filter(|note| ["warning", "critical"].contains(&note[1].as_str().unwrap())).count()
    };
    let (early, late) = (found(&seek(&mut page, 5.0)), found(&seek(&mut page, 1e9_f64.min(last_s(&frames)))));
    assert!(late > early, "{early} findings at the beginning, {late} at the end");
    assert_sound(&mut page);

    for (name, scheme, width, height) in [
        (Some("live"), "light", 1440, 900),
        (Some("live-dark"), "dark", 1440, 900),
        (Some("live-phone"), "light", 390, 844),
        (None, "dark", 390, 844),
    ] {
        page.open(&live.address, scheme, width, height);
        page.wait("return document.documentElement.dataset.ready === 'true'", 60);
        assert_shows(&seek(&mut page, 75.0), &frames);
        assert_sound(&mut page);
        if let Some(name) = name {
            shoot(&mut page, name);
        }
        let first = "
            return ['horizon', 'map', 'height', 'groundspeed', 'battery_percent'].every((id) =>
              document.querySelector(`[data-panel=${id}]`).getBoundingClientRect().bottom < innerHeight)";
        assert_eq!(page.run(first), json!(width == 1440), "a pilot sees them first, on a phone the health");
    }
}

fn part(page: &mut LivePage) -> (String, f64) {
    page.wait("return document.querySelector('.due li') !== null", 20);
    let level = page.run("return document.querySelector('.due .badge').textContent");
    let words = page.run("return document.querySelector('.due .reason').textContent");
    let words = words.as_str().unwrap();
    assert!(words.contains("% used") && !words.contains("in this session"), "all of its life: {words}");
    (level.as_str().unwrap().to_owned(), number(words.split(' ').next().unwrap()))
}

#[test]
fn each_session_of_a_card_is_played_with_its_parts_as_they_were_then() {
    let dir = tempfile::tempdir().unwrap();
    let (card, store, params) =
        (dir.path().join("card.img"), dir.path().join("store.bin"), dir.path().join("box.param"));
    std::fs::write(&params, "CMP1_KIND 3\nCMP1_NUMBER 2\nCMP1_MOT_HOURS 0.1\n").unwrap();
    for _ in 0..2 {
        let mut sim = command(["sim", "--speed", "max"]);
        sim.arg(own("px4_hil_quad_low.tlog")).arg("--sd").arg(&card);
        sim.arg("--store").arg(&store).arg("--params").arg(&params);
        hums_tests::child::run(&mut sim, hums_tests::program::LIMIT).expect_code(&[0]);
    }
    let info = hums_with("info --json {}", &[&card]).expect_code(&[0]).text();
    let info: Value = serde_json::from_str(&info).unwrap();
    let names: Vec<&str> =
        info["logs"].as_array().unwrap().iter().map(|log| log["name"].as_str().unwrap()).collect();
    assert_eq!(names.len(), 2);
    let input = card.to_str().unwrap();
    let mut page = LivePage::start();
    let mut used = Vec::new();
    for flags in [&["--session", names[0]][..], &["--session", names[1]], &[]] {
        let live = Live::start(&[&[input][..], flags].concat());
        page.open(&live.address, "light", 1440, 900);
        page.wait("return document.documentElement.dataset.ready === 'true'", 60);
        page.press(&[" "]);
        page.wait("return document.getElementById('source').textContent === 'paused'", 20);
        let early = {
            seek(&mut page, 10.0);
            part(&mut page)
        };
        let late = {
            seek(&mut page, 240.0);
            part(&mut page)
        };
        let name = flags.last().unwrap_or(&names[1]);
        let facts = page.run("return document.querySelector('.facts-line').textContent");
        assert!(facts.as_str().unwrap().contains(&format!("session {name}")), "{facts}");
        assert_sound(&mut page);
        used.push((early, late));
    }
    assert_eq!(used[1], used[2], "without a name it is the newest");
    let [first, second] = [&used[0], &used[1]];
    assert!(first.0.1 < 5.0 && first.1.1 > 30.0, "a new motor turns: {used:?}");
    assert!((second.0.1 - first.1.1).abs() < 15.0, "it goes on where it was: {used:?}");
    assert_eq!((first.0.0.as_str(), second.1.0.as_str()), ("good", "due"), "{used:?}");

    let wrong = hums(["live", "--listen", "127.0.0.1:0", input, "--session", "99999"]).expect_code(&[2]);
    assert!(wrong.stderr.contains(names[0]), "it says which there are");
}

fn last_s(frames: &[Value]) -> f64 {
    frames.iter().filter_map(|frame| frame["time_boot"].as_f64()).fold(0.0, f64::max) - 1.0
}

#[test]
fn a_flight_over_udp_is_followed_until_it_stops_and_then_looks_stale() {
    let dir = tempfile::tempdir().unwrap();
    let recording = cut(&own("ap_quad_faults.tlog"), 75.0, &dir.path().join("late.tlog"));
    let frames = frames(&recording);
    let port = free_port();
    let live = Live::start(&["--setup", &format!("udpin:127.0.0.1:{port}")]);
    let mut page = LivePage::start();
    page.open(&live.address, "dark", 1440, 900);
    page.wait("return document.getElementById('source').textContent === 'waiting'", 20);
    page.run("document.querySelector('[data-panel=bench] button').click()");
    page.wait("return document.querySelector('[data-panel=bench]').textContent.includes('checking')", 5);
    let mut sim = command(["sim", "--speed", "real"]);
    sim.arg(&recording).arg("--sd").arg(dir.path().join("card.img"));
    sim.arg("--gs").arg(format!("udpout:127.0.0.1:{port}")).stdout(Stdio::null()).stderr(Stdio::null());
    let began = Instant::now();
    let sim = Running(sim.spawn().unwrap());
    page.wait("return document.getElementById('source').textContent === 'live'", 20);
    page.wait("return document.querySelector('[data-panel=bench]').hidden", 20);
    page.wait("return document.querySelector('[data-value=satellites]').textContent.length > 1", 30);

    let until = Instant::now() + Duration::from_secs(8);
    let mut agreed = 0;
    while Instant::now() < until {
        let seen = page.read();
        let now_s = began.elapsed().as_secs_f64();
        let lately = |message: &str, field: &str, scale: f64, wanted: f64, close: f64| {
            frames.iter().any(|frame| {
                let at_s = frame["time_boot"].as_f64().unwrap();
                frame["message"] == message
                    && (now_s - 6.0..now_s + 1.0).contains(&at_s)
                    && (of(&frame["fields"], field) * scale - wanted).abs() <= close
            })
        };
        if seen["values"]["latitude"] == "\u{2013}" {
            continue;
        }
        assert!(lately("GPS_RAW_INT", "lat", 1e-7, shown(&seen, "latitude"), 0.6e-7), "{}", seen["values"]);
        assert!(lately("ATTITUDE", "roll", 57.295_779_5, shown(&seen, "roll"), 0.06), "{}", seen["values"]);
        agreed += 1;
        std::thread::sleep(Duration::from_millis(250));
    }
    assert!(agreed > 10, "only {agreed} looks");
    page.wait("return document.querySelector('[data-subsystem=recorder] .badge').textContent === 'ok'", 20);
    let seen = page.read();
    assert_eq!(seen["board"]["recorder"]["by"], "on board", "{}", seen["board"]);
    let loss = seen["values"]["link:loss"].as_str().unwrap();
    assert!(loss == "0.0 %" || loss == "not known yet", "what the box leaves out is no loss: {loss}");
    page.wait("return [...document.querySelectorAll('.notes li .badge')].some((b) => ['warning', 'critical'].includes(b.textContent))", 60);
    assert_sound(&mut page);

    drop(sim);
    page.wait("return document.querySelector('[data-panel=horizon]').classList.contains('stale')", 10);
    page.wait(
        "return document.querySelector('[data-panel=horizon] .corner').textContent === 'stale 6 s'",
        20,
    );
    let seen = page.read();
    assert_eq!(seen["source"], "silent");
    for panel in ["horizon", "map", "groundspeed", "place"] {
        assert_eq!(seen["panels"][panel]["stale"], true, "{panel}: {}", seen["panels"]);
    }
}

#[test]
fn a_page_that_has_lost_hums_says_at_once_that_the_vehicles_state_is_not_known() {
    let recording = own("px4_hil_quad_low.tlog");
    let live = Live::start(&[recording.to_str().unwrap()]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1440, 900);
    page.wait("return document.documentElement.dataset.ready === 'true'", 60);
    let overall = "document.getElementById('overall')";
    let before = page.run(&format!("return {overall}.textContent"));
    assert_ne!(before, "not known");
    live.program.signal("KILL");
    page.wait("return document.getElementById('source').textContent === 'no connection'", 10);
    page.wait(&format!("return {overall}.textContent === 'not known'"), 1);
    assert_eq!(page.run(&format!("return {overall}.classList.contains('stale')")), true);
    let mut again = command(["live", "--listen", live.host()]);
    let again = again.arg(&recording).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let _again = Running(again);
    page.wait("return document.getElementById('source').textContent === 'playing'", 20);
    page.wait(&format!("return {overall}.textContent !== 'not known'"), 5);
}

#[test]
fn a_hidden_page_gives_its_connection_up_unless_its_sound_is_on() {
    let live = Live::start(&[own("px4_hil_quad_low.tlog").to_str().unwrap()]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1440, 900);
    page.wait("return document.documentElement.dataset.ready === 'true'", 60);
    page.run(
        "let away = false;
         Object.defineProperty(document, 'hidden', { get: () => away });
         window.EventSource = class extends EventSource { constructor(url) { super(url); window.events = this; } };
         window.turn = (hidden) => { away = hidden; document.dispatchEvent(new Event('visibilitychange')); };
         turn(false);",
    );
    page.wait("return events.readyState === EventSource.OPEN", 10);
    assert_eq!(page.run("turn(true); return events.readyState"), 2, "closed");
    page.run("turn(false)");
    page.wait("return events.readyState === EventSource.OPEN", 10);
    page.press(&["m"]);
    assert_eq!(page.run("turn(true); return events.readyState"), 1, "open");
}

#[test]
fn words_of_a_hostile_vehicle_stay_words_on_the_live_page() {
    const HOSTILE: [&str; 4] = [
        "<img src=x onerror=\"document.title='owned'\">",
        "</script><script>document.title='owned'</script>",
        "{{now}} & \"quotes\" 'n' \\u003c <b>",
        // Right to left from here on: "live".
        "rtl \u{202e}evil\u{2066}",
    ];
    let seeds = &Manifest::own().seeds;
    let port = free_port();
    let live = Live::start(&[&format!("udpin:127.0.0.1:{port}")]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 390, 844);
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for sequence in 0..60_u8 {
        let heartbeat = build_v2(sequence.wrapping_mul(2), 0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3], seeds[&0]);
        let mut payload = vec![4];
        payload.extend(HOSTILE[usize::from(sequence) % HOSTILE.len()].bytes());
        payload.resize(51, 0);
        let text = build_v2(sequence.wrapping_mul(2).wrapping_add(1), 253, &payload, seeds[&253]);
        for frame in [heartbeat, text] {
            socket.send_to(&frame, ("127.0.0.1", port)).unwrap();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    page.wait("return document.querySelectorAll('.notes li').length >= 4", 20);
    let seen = page.read();
    assert!(!seen["title"].as_str().unwrap().contains("owned"), "{}", seen["title"]);
    let words: Vec<&str> =
        seen["notes"].as_array().unwrap().iter().map(|note| note[2].as_str().unwrap()).collect();
    for hostile in HOSTILE {
        let said =
            hostile[..hostile.len().min(50)].replace('\u{202e}', "<U+202E>").replace('\u{2066}', "<U+2066>");
        assert!(words.contains(&said.as_str()), "{said:?} is not among {words:?}");
    }
    assert_eq!(page.run("return document.querySelectorAll('main img, main script').length"), 0);
    assert_sound(&mut page);
}

fn ask(address: &str, line: &str, headers: &[(&str, &str)]) -> String {
    let host = address.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).unwrap();
    let own = [("Host", host)].into_iter().filter(|_| headers.iter().all(|(name, _)| *name != "Host"));
    let lines: Vec<String> =
        own.chain(headers.iter().copied()).map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let request = format!("{line} HTTP/1.1\r\n{}", lines.concat());
    stream.write_all(format!("{request}\r\n").as_bytes()).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let mut line = String::new();
    BufReader::new(stream.take(4_096)).read_line(&mut line).unwrap();
    line.trim().to_owned()
}

#[test]
fn a_foreign_page_a_foreign_name_and_a_stranger_are_refused() {
    let recording = own("ap_quad_guided.tlog");
    let input = [recording.to_str().unwrap()];
    let open = Live::start(&input);
    for (line, headers, code) in [
        ("GET /", vec![], "200"),
        ("GET /events", vec![], "200"),
        ("GET /nothing", vec![], "404"),
        ("PUT /", vec![], "501"),
        ("POST /command", vec![], "400"),
        // A foreign page, which also may not command.
        ("GET /events", vec![("Origin", "http://evil.example")], "403"),
        ("POST /command", vec![("Origin", "http://evil.example")], "403"),
        // A name that was bent to here.
        ("GET /", vec![("Host", "evil.example")], "403"),
        ("GET /events", vec![("Host", "evil.example:80")], "403"),
    ] {
        let answer = ask(&open.address, line, &headers);
        assert!(answer.contains(code), "{line} {headers:?}: {answer}");
    }

    let closed = Live::start(&[&input[..], &["--listen-token", "correct-horse"]].concat());
    let (address, token) = closed.address.split_once("#token=").expect("the address has the token");
    assert_eq!(token, "correct-horse");
    for (line, code) in [
        ("GET /events", "401"),
        ("GET /events?token=wrong-horse", "401"),
        ("GET /events?token=correct-horse", "200"),
        ("POST /command", "401"),
        ("POST /command?token=correct-horse", "400"),
    ] {
        assert!(ask(address, line, &[]).contains(code), "{line}");
    }
}

/// Notes changes of the roll's number, with their times in milliseconds since 1970.
const WATCH: &str = "
const roll = document.querySelector('[data-value=roll]');
window.seen = [];
const note = () => window.seen.push([performance.timeOrigin + performance.now(), roll.textContent]);
new MutationObserver(note).observe(roll, { childList: true, characterData: true, subtree: true });
";

#[test]
fn a_packet_changes_the_page_within_a_tenth_of_a_second() {
    let port = free_port();
    let live = Live::start(&[&format!("udpin:127.0.0.1:{port}")]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1440, 900);
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let seeds = &Manifest::own().seeds;
    let mut sequence = 0_u8;
    let mut send = |id: u32, payload: &[u8]| {
        sequence = sequence.wrapping_add(1);
        socket.send_to(&build_v2(sequence, id, payload, seeds[&id]), ("127.0.0.1", port)).unwrap();
        SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64() * 1e3
    };
    send(0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3]);
    page.wait("return document.documentElement.dataset.ready === 'true'", 20);
    page.run(WATCH);
    let mut sent = Vec::new();
    for number in 1..=60_u16 {
        let roll_deg = f32::from(number) / 2.0;
        let mut attitude = vec![0; 28];
        attitude[4..8].copy_from_slice(&roll_deg.to_radians().to_le_bytes());
        sent.push((format!("{roll_deg:.1}"), send(30, &attitude)));
        std::thread::sleep(Duration::from_millis(137));
    }
    let seen = page.run("return window.seen");
    let changed = |text: &str| {
        let seen = seen.as_array().unwrap().iter().find(|one| one[1] == text);
        seen.and_then(|one| one[0].as_f64())
    };
    let mut latencies: Vec<f64> = sent.iter().filter_map(|(text, at)| Some(changed(text)? - at)).collect();
    assert!(latencies.len() > 50, "only {} of 60 were seen", latencies.len());
    latencies.sort_by(f64::total_cmp);
    let median_ms = latencies[latencies.len() / 2];
    println!(
        "from packet to page: {median_ms:.0} ms at the median, {:.0} ms at most",
        latencies[latencies.len() - 1]
    );
    assert!(median_ms < 100.0, "{latencies:?}");
}

#[test]
fn a_link_is_paused_and_rewound_while_it_goes_on() {
    let port = free_port();
    let live = Live::start(&[&format!("udpin:127.0.0.1:{port}")]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1440, 900);
    let flies = AtomicBool::new(true);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let seeds = &Manifest::own().seeds;
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            for number in (0..1_500_u16).take_while(|_| flies.load(Ordering::Relaxed)) {
                let mut attitude = vec![0; 28];
                attitude[4..8].copy_from_slice(&(f32::from(number) / 10.0).to_radians().to_le_bytes());
                for (id, payload) in [(0, vec![4, 0, 0, 0, 2, 3, 0x51, 4, 3]), (30, attitude)] {
                    let frame = build_v2(number as u8, id, &payload, seeds[&id]);
                    socket.send_to(&frame, ("127.0.0.1", port)).unwrap();
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        let now = |page: &mut LivePage| page.read()["now"].as_f64().unwrap();
        page.wait("return document.documentElement.dataset.ready === 'true'", 20);
        let start_s = now(&mut page);
        page.wait(&format!("return document.documentElement.dataset.now > {start_s} + 3"), 20);
        page.press(&[" "]);
        page.wait("return document.getElementById('notice').textContent.startsWith('Paused')", 5);
        let (paused_s, roll) = (now(&mut page), shown(&page.read(), "roll"));
        std::thread::sleep(Duration::from_millis(800));
        assert_eq!((now(&mut page), shown(&page.read(), "roll")), (paused_s, roll), "it stands still");
        page.press(&["HOME"]);
        page.wait(&format!("return document.documentElement.dataset.now < {paused_s} - 1"), 5);
        assert!(shown(&page.read(), "roll") < roll, "what stood there then");
        page.press(&["END"]);
        page.wait(&format!("return document.documentElement.dataset.now > {paused_s} + 0.8"), 5);
        assert!(shown(&page.read(), "roll") > roll, "nothing was lost meanwhile");
        flies.store(false, Ordering::Relaxed);
    });
    assert_sound(&mut page);
}

#[test]
fn two_vehicles_on_one_link_are_told_apart() {
    let port = free_port();
    let live = Live::start(&[&format!("udpin:127.0.0.1:{port}")]);
    let mut page = LivePage::start();
    page.open(&live.address, "light", 1024, 768);
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let seeds = &Manifest::own().seeds;
    for sequence in 0..20_u8 {
        for (system, roll) in [(7_u8, 0.25_f32), (9, -0.5)] {
            let mut attitude = vec![0; 28];
            attitude[4..8].copy_from_slice(&roll.to_le_bytes());
            let frames = [
                build_v2(sequence.wrapping_mul(2), 0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3], seeds[&0]),
                build_v2(sequence.wrapping_mul(2).wrapping_add(1), 30, &attitude, seeds[&30]),
            ];
            for frame in frames {
                socket.send_to(&sent_by(system, frame, seeds), ("127.0.0.1", port)).unwrap();
            }
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    page.wait("return document.querySelectorAll('.vehicles button').length === 2", 20);
    for (key, system, roll) in [("1", "7", 14.3), ("2", "9", -28.6), ("1", "7", 14.3)] {
        page.press(&[key]);
        let pressed = "document.querySelector('.vehicles [aria-pressed=true]')?.textContent";
        page.wait(&format!("return ({pressed} ?? '').startsWith('{system} ')"), 10);
        assert!((shown(&page.read(), "roll") - roll).abs() < 0.06, "vehicle {system}");
    }
    assert_sound(&mut page);
}

fn sent_by(system: u8, mut frame: Vec<u8>, seeds: &hums_tests::frames::Seeds) -> Vec<u8> {
    frame[5] = system;
    let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
    let end = frame.len() - 2;
    let sum = hums_tests::frames::checksum(&frame[1..end], seeds[&id]);
    frame[end..].copy_from_slice(&sum.to_le_bytes());
    frame
}
