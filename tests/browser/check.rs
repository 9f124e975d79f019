//! `hums-check.html`: what it says of a log is what `hums check` and `hums report` say.

use std::fs;
use std::io::ErrorKind;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

use hums_tests::child;
use hums_tests::flights::{own, root};
use hums_tests::oracle::{self, LivePage};
use hums_tests::program::{LIMIT, Machine, Recording, browser, command};

use super::live::shoot;

/// The page is opened within a second or two; a phone's flash is no faster than this.
const PAGE_BYTES_MAX: usize = 6_000_000;

/// The page in Chromium, and the folder with what it reads and saves.
struct Page {
    dir: tempfile::TempDir,
    shown: LivePage,
}

impl Page {
    fn open(width: u32) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let html = hums_report::browser::page(&fs::read(browser()).unwrap()).unwrap();
        assert!(html.len() < PAGE_BYTES_MAX, "{} bytes", html.len());
        let path = dir.path().join("hums-check.html");
        fs::write(&path, html).unwrap();
        let mut shown = LivePage::start();
        shown.open(&format!("file://{}", path.display()), "light", width, 844);
        shown.wait("return document.documentElement.dataset.ready === 'true'", 30);
        fs::create_dir(dir.path().join("saved")).unwrap();
        shown.downloads(&dir.path().join("saved"));
        Self { dir, shown }
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    #[track_caller]
    fn check(&mut self, selector: &str, paths: &[PathBuf]) {
        self.shown.run("document.documentElement.dataset.state = ''; return null");
        self.shown.files(selector, paths);
        self.shown.wait("return document.documentElement.dataset.state === 'done'", 300);
    }

    fn text(&mut self, selector: &str) -> String {
        let script = format!(
            "return [...document.querySelectorAll({selector:?})].map((node) => node.textContent).join('\\n')"
        );
        self.shown.run(&script).as_str().unwrap().to_owned()
    }

    #[track_caller]
    fn save(&mut self, words: &str, count: usize) -> Vec<PathBuf> {
        let saved = self.dir.path().join("saved");
        let files = || fs::read_dir(&saved).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
        let before = files();
        self.shown.run(&format!(
            "for (const button of document.querySelectorAll('button')) if (button.textContent === {words:?}) button.click(); return null"
        ));
        for _ in 0..600 {
            let new: Vec<_> = files().into_iter().filter(|path| !before.contains(path)).collect();
            let is_part = |path: &PathBuf| path.extension().is_none_or(|end| end == "crdownload");
            if new.len() == count && !new.iter().any(is_part) {
                return new;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("{words}: {:?} were saved, not {count} files", files());
    }
}

#[track_caller]
fn hums_in(folder: &Path, arguments: &[&str], names: &[String]) -> child::Outcome {
    let mut hums = command(arguments.iter().map(ToString::to_string).chain(names.iter().cloned()));
    child::run(hums.current_dir(folder), LIMIT)
}

fn recordings(folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for from in [
        "tests/flights",
        "tests/labelled",
        "tests/labelled/bin",
        "tests/labelled/px4",
        "tests/field",
        "tests/monitor",
        "host-tools/tests/inputs",
    ] {
        for entry in fs::read_dir(root().join(from)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let is_log = [".tlog", ".raw", ".bin", ".ulg", ".gz"].iter().any(|end| name.ends_with(end));
            if is_log {
                let name = format!("{}-{name}", from.replace('/', "-"));
                fs::copy(&path, folder.join(&name)).unwrap();
                names.push(name);
            }
        }
    }
    names.sort();
    assert!(names.len() > 100, "{} recordings", names.len());
    names
}

#[test]
fn every_recording_of_the_repository_is_judged_to_the_byte_as_on_the_command_line() {
    let mut page = Page::open(1280);
    let folder = page.dir.path().join("logs");
    fs::create_dir(&folder).unwrap();
    let names = recordings(&folder);
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    page.shown.run("document.documentElement.dataset.state = ''; return null");
    page.shown.files("#files", &paths);
    page.shown.wait("return ['checked', 'done'].includes(document.documentElement.dataset.state)", 300);
    let saved = page.save("Save all findings (JSON lines)", 1);
    let expected = hums_in(&folder, &["check", "--json"], &names);
    let (shown, expected) = (fs::read_to_string(&saved[0]).unwrap(), expected.text());
    // A recording of two vehicles has a line for each.
    let counts = [shown.lines().count(), expected.lines().count()];
    assert!(counts[0] == counts[1] && counts[1] >= names.len(), "{counts:?} of {}", names.len());
    for (shown, expected) in shown.lines().zip(expected.lines()) {
        assert_eq!(shown, expected);
    }
    assert_eq!(page.shown.console(), serde_json::json!([]));
}

#[test]
fn the_reports_are_those_of_the_command_line_also_of_a_card_and_side_by_side() {
    let mut page = Page::open(1280);
    let folder = page.dir.path().join("logs");
    fs::create_dir(&folder).unwrap();
    let card = Recording::make(Machine::Sim, &own("ap_quad_faults.tlog"), &[]);
    fs::copy(card.image(), folder.join("card.img")).unwrap();
    for (from, name) in [
        ("tests/flights/px4_hil_quad_low.tlog", "a.tlog"),
        ("tests/labelled/bin/f12_gps_jump.bin.gz", "b.bin.gz"),
        ("tests/labelled/px4/p23_motor_dead_quad.cut.ulg.gz", "c.ulg.gz"),
    ] {
        fs::copy(root().join(from), folder.join(name)).unwrap();
    }
    let names: Vec<String> = ["a.tlog", "b.bin.gz", "c.ulg.gz", "card.img"].map(str::to_owned).into();
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    page.check("#files", &paths);
    hums_in(&folder, &["report", "--compare", "-o", "../pages/"], &names).expect_code(&[0, 3]);
    let pages = page.dir.path().join("pages");
    let expected: Vec<_> = fs::read_dir(&pages).unwrap().map(|entry| entry.unwrap().path()).collect();
    let saved = page.save("Save it", expected.len() - 1);
    for path in saved {
        let name = path.file_name().unwrap();
        assert!(
            fs::read(&path).unwrap() == fs::read(pages.join(name)).unwrap(),
            "{} differs",
            name.display()
        );
    }
    // A report runs inside the page.
    let screen = hums_in(&folder, &["check"], &names[..1]).text();
    assert!(
        page.text("[data-log='a.tlog'] .screen") == screen.trim_end(),
        "{}",
        page.text("[data-log='a.tlog'] .screen")
    );
    page.shown.run(
        "document.querySelector('[data-log=\"a.tlog\"]').querySelectorAll('button')[1].click(); return null",
    );
    page.shown.wait("return document.querySelector('iframe')?.srcdoc.length > 10000", 10);
    shoot(&mut page.shown, "check");
    assert_eq!(page.shown.console(), serde_json::json!([]), "a script of the report is refused");
}

#[test]
fn what_is_dropped_is_judged_also_folders_and_two_files_of_one_name() {
    let mut page = Page::open(1280);
    let folder = page.dir.path().join("logs");
    let flight = |to: &str, from: &str| {
        let to = folder.join(to);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(root().join(from), &to).unwrap();
        to
    };
    let one = flight("one/flight.tlog", "tests/flights/px4_hil_quad_low.tlog");
    let two = flight("two/flight.tlog", "tests/flights/ap_quad_faults.tlog");
    let both = flight("card/a/b.bin.gz", "tests/labelled/bin/f12_gps_jump.bin.gz");
    page.check("#files", &[one.clone(), two.clone()]);
    let shown = page.text("#logs h2");
    assert!(shown.contains("flight.tlog") && shown.contains("flight (2).tlog"), "{shown}");
    page.shown.run("document.documentElement.dataset.state = ''; return null");
    // The browser itself numbers files of one name that are dropped.
    page.shown.drop_files(&[one, two, both.ancestors().nth(2).unwrap().to_owned()]);
    page.shown.wait("return document.documentElement.dataset.state === 'done'", 300);
    let shown = page.text("#logs h2");
    for name in ["flight.tlog", "flight (1).tlog", "card/a/b.bin.gz"] {
        assert!(shown.contains(name), "{name}: {shown}");
    }
    // A link of a report inside the page scrolls the report.
    page.shown.run("document.querySelector('[data-log=\"flight.tlog\"]').querySelectorAll('button')[1].click(); return null");
    page.shown.wait("return document.querySelector('iframe')?.srcdoc.length > 10000", 10);
    assert_eq!(page.shown.console(), serde_json::json!([]));
}

#[test]
fn firefox_judges_and_saves_what_the_command_line_does() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("hums-check.html");
    fs::write(&page, hums_report::browser::page(&fs::read(browser()).unwrap()).unwrap()).unwrap();
    let flights = ["tests/flights/px4_hil_quad_low.tlog", "tests/labelled/bin/f12_gps_jump.bin.gz"];
    let names = ["a.tlog", "b.bin.gz"].map(str::to_owned);
    let logs = names.clone().map(|name| folder.path().join(name));
    for (from, to) in flights.iter().zip(&logs) {
        fs::copy(root().join(from), to).unwrap();
    }
    let shown = oracle::firefox(&page, &logs);
    let expected = hums_in(folder.path(), &["check", "--json"], &names).text();
    assert_eq!(shown["saved"], expected);
    let reports: Vec<&str> =
        shown["reports"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let [a, b] = reports[..] else { panic!("{reports:?}") };
    assert!(a.starts_with("a.tlog-") && b.starts_with("b.bin.gz-"), "{reports:?}");
}

/// A module of WebAssembly whose program ends as one without memory does: by a trap.
const TRAP: &str = "0061736d0100000001040160000003020100050301000107130206\
                    6d656d6f72790200065f737461727400000a05010300000b";

#[test]
fn a_program_that_stops_by_itself_ends_with_a_sentence() {
    let mut page = Page::open(1280);
    page.shown.run(&format!(
        "const bytes = Uint8Array.from({TRAP:?}.match(/../g), (two) => parseInt(two, 16));
         const text = document.getElementById('worker').textContent;
         const worker = new Worker(URL.createObjectURL(new Blob([text], {{ type: 'text/javascript' }})));
         worker.onmessage = (event) => {{ window.ended = event.data; }};
         WebAssembly.compile(bytes).then((module) => worker.postMessage({{ module, command: 'check', inputs: [], files: [] }}));
         return null"
    ));
    let ended = page.shown.wait("return window.ended", 20);
    let why = ended["why"].as_str().unwrap();
    assert!(why.contains("the program stopped") && why.contains("unreachable"), "{why}");
}

#[test]
fn a_card_folder_is_one_card_and_a_phone_shows_all_of_the_page() {
    let mut page = Page::open(390);
    let card = Recording::make(Machine::Sim, &own("ap_quad_guided.tlog"), &[]);
    let folder = page.dir.path().join("card");
    fs::create_dir(&folder).unwrap();
    fs::copy(card.image(), folder.join("card.img")).unwrap();
    fs::copy(own("ap_quad_signed.raw"), folder.join("other.raw")).unwrap();
    page.check("#folder", &[folder]);
    let expected = hums_in(page.dir.path(), &["check", "--json"], &["card".to_owned()]).text();
    let saved = page.save("Save all findings (JSON lines)", 1);
    assert_eq!(fs::read_to_string(&saved[0]).unwrap(), expected);
    let width = page.shown.run("return [document.documentElement.scrollWidth, innerWidth]");
    assert!(width[0].as_f64() <= width[1].as_f64(), "wider than a phone: {width}");
}

#[test]
fn a_damaged_file_ends_with_a_sentence_and_the_page_goes_on() {
    let mut page = Page::open(1280);
    let flight = fs::read(own("ap_quad_faults.tlog")).unwrap();
    let ulog = [&b"ULog\x01\x12\x35\x01"[..], &[0xff; 5_000]].concat();
    for (name, bytes, words) in [
        ("empty.tlog", vec![], "is empty"),
        (
            "noise.bin",
            (0..200_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect(),
            "is neither",
        ),
        ("logs.zip", b"PK\x03\x04 stored".to_vec(), "ZIP"),
        ("cut.tlog.gz", [&[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3][..], &[0xff; 40]].concat(), "gz"),
        ("bad.ulg", ulog, ""),
        ("half.tlog", flight[..flight.len() / 2 + 7].to_vec(), "1 warning"),
    ] {
        let path = page.file(name, &bytes);
        page.check("#files", &[path]);
        let shown = page.text("#logs .screen, [role=status], #remarks");
        assert!(shown.contains(words) && !shown.contains("panicked"), "{name}: {shown}");
        let expected = hums_in(page.dir.path(), &["check", "--json"], &[name.to_owned()]).text();
        let error =
            serde_json::from_str::<serde_json::Value>(expected.lines().next().unwrap_or("{}")).unwrap();
        if let Some(error) = error["error"].as_str() {
            assert!(shown.contains(error), "{name}: {shown}");
        }
    }
    // A run is cancelled, and the next one is whole.
    page.shown.files("#files", &[own("ap_quad_faults.tlog")]);
    page.shown.run("[...document.querySelectorAll('button')].find((one) => one.textContent === 'Cancel').click(); return null");
    assert_eq!(page.text("[role=status]"), "Cancelled.");
    page.check("#files", &[own("ap_quad_faults.tlog")]);
    assert!(page.text("#logs .screen").contains("2 critical findings"), "{}", page.text("#logs"));
}

#[test]
fn nothing_leaves_the_page_whatever_runs_in_it() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    server.set_nonblocking(true).unwrap();
    let address = server.local_addr().unwrap();
    let mut page = Page::open(1280);
    let script = format!(
        "window.ended = [];
         const worker = (text) => new Worker(URL.createObjectURL(new Blob([text])));
         const ends = (name, promise) => promise.then(() => ended.push(name + ' passed'), () => ended.push(name + ' refused'));
         ends('fetch', fetch('http://{address}/'));
         ends('image', new Promise((good, bad) => {{ const image = new Image(); image.onload = good; image.onerror = bad; image.src = 'http://{address}/a.png'; }}));
         ends('socket', new Promise((good, bad) => {{ try {{ const socket = new WebSocket('ws://{address}'); socket.onopen = good; socket.onerror = bad; }} catch {{ bad(); }} }}));
         ends('worker', new Promise((good, bad) => {{
           const one = worker(\"fetch('http://{address}/').then(() => postMessage(1), () => postMessage(0))\");
           one.onmessage = (event) => event.data ? good() : bad(); one.onerror = bad;
         }}));
         return null"
    );
    page.shown.run(&script);
    page.shown.wait("return ended.length === 4", 20);
    let mut ended: Vec<String> = serde_json::from_value(page.shown.run("return ended")).unwrap();
    ended.sort();
    assert_eq!(ended, ["fetch refused", "image refused", "socket refused", "worker refused"]);
    assert_eq!(server.accept().map(drop).map_err(|error| error.kind()), Err(ErrorKind::WouldBlock));
    assert!(page.text("footer").contains("opens no connection and stores nothing"));
}
