//! Pymavlink in the environment of `cargo xtask setup`.

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Mutex;
use std::time::Duration;

use serde_json::Value;

use crate::child;
use crate::flights::{Manifest, root};

/// pymavlink reads some 50,000 frames a second; Spark needs minutes for its queries of a fleet.
const LIMIT: Duration = Duration::from_mins(20);

fn from_environment(name: &str, otherwise: &str) -> PathBuf {
    let path = std::env::var_os(name).map_or_else(|| root().join(otherwise), PathBuf::from);
    assert!(path.exists(), "{} is missing: `cargo xtask setup` makes it", path.display());
    path
}

fn ask(script: &str, files: &[PathBuf]) -> String {
    let dialect = from_environment("HUMS_DIALECT", "target/oracle/hums_dialect.py");
    run(script, &[&[dialect], files].concat())
}

fn run(script: &str, arguments: &[PathBuf]) -> String {
    outcome(script, arguments).text()
}

fn outcome(script: &str, arguments: &[PathBuf]) -> child::Outcome {
    child::run(&mut command(script, arguments), LIMIT).expect_code(&[0])
}

fn command(script: &str, arguments: &[PathBuf]) -> Command {
    let mut command = Command::new(beside_python("python"));
    command.arg(root().join("tests/oracle").join(script)).args(arguments);
    // Compiled once, the dialect's 3 MB above all; and not into the repository.
    command.env_remove("PYTHONDONTWRITEBYTECODE").env("PYTHONPYCACHEPREFIX", beside_python("compiled"));
    command
}

/// A program of the environment.
pub fn beside_python(name: &str) -> PathBuf {
    from_environment("HUMS_PYTHON", "target/venv/bin/python").with_file_name(name)
}

/// Another client of object storage: `tests/oracle/storage.py`. `None` if it fails.
pub fn storage(environment: &[(String, String)], arguments: &[PathBuf]) -> Option<Value> {
    let mut command = command("storage.py", arguments);
    let outcome = child::run(command.envs(environment.iter().map(|(name, value)| (name, value))), LIMIT);
    if outcome.code == Some(0) { Some(json(&outcome.text())) } else { None }
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("the script prints JSON")
}

fn program(variable: &str, path: &str) -> PathBuf {
    std::env::var_os(variable).map_or_else(|| PathBuf::from(path), PathBuf::from)
}

/// Field by field: `tests/oracle/readback.py`.
pub fn readback(recording: &Path, out: &Path) -> Value {
    let influxd = program("HUMS_INFLUXD", "/usr/bin/influxd");
    json(&ask("readback.py", &[recording.to_owned(), out.to_owned(), influxd]))
}

/// `tests/oracle/exports.py`.
pub fn exports(folder: &Path, name: &str) -> Value {
    json(&run("exports.py", &[folder.to_owned(), PathBuf::from(name)]))
}

/// Our reading against pyulog: `tests/oracle/ulog.py`.
pub fn ulog(log: &Path, folder: &Path) -> Value {
    json(&run("ulog.py", &[log.to_owned(), folder.to_owned()]))
}

/// A decoder by the format document alone, `tests/oracle/hums_log`: the lines of JSON; the tlog goes into `tlog`.
pub fn second_decoder(log: &Path, tlog: &Path) -> Vec<u8> {
    outcome("hums_log", &[log.to_owned(), tlog.to_owned()]).stdout
}

/// A line of JSON for each message: `tests/oracle/dataflash.py`.
pub fn dataflash(log: &Path) -> String {
    run("dataflash.py", &[log.to_owned()])
}

/// A document's queries in a folder: `tests/oracle/fleet.py`.
pub fn fleet(document: &Path, folder: &Path) -> Value {
    json(&run("fleet.py", &[document.to_owned(), folder.to_owned()]))
}

/// The same on a large fleet, with times and files read, in Spark too if asked for: `tests/oracle/fleet_proof.py`.
pub fn fleet_proof(document: &Path, folder: &Path, spark: bool) -> Value {
    let spark = spark.then(|| PathBuf::from("--spark"));
    json(&run(
        "fleet_proof.py",
        &[document.to_owned(), folder.to_owned()].into_iter().chain(spark).collect::<Vec<_>>(),
    ))
}

/// The output of each block of Python: `tests/oracle/snippets.py`.
pub fn snippets(document: &Path, folder: &Path) -> Value {
    json(&run("snippets.py", &[document.to_owned(), folder.to_owned()]))
}

/// A verdict by Grafana's own model: `tests/oracle/grafana.py`.
pub fn grafana(dashboards: &[PathBuf]) -> Value {
    json(&run("grafana.py", dashboards))
}

/// The check in Firefox: `tests/oracle/firefox.py`.
pub fn firefox(page: &Path, logs: &[PathBuf]) -> Value {
    let arguments = [&[program("HUMS_FIREFOX", "/usr/bin/firefox-esr"), page.to_owned()], logs].concat();
    json(&run("firefox.py", &arguments))
}

/// A Chromium and the script that moves it: `tests/oracle/live.py`, which ends at the end of its input.
struct Browser {
    script: Child,
    asked: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
}

impl Browser {
    fn start() -> Self {
        let programs =
            [("HUMS_CHROMIUM", "/usr/bin/chromium"), ("HUMS_CHROMEDRIVER", "/usr/bin/chromedriver")];
        let mut command = command("live.py", &programs.map(|(variable, path)| program(variable, path)));
        let mut script = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python runs");
        let asked = script.stdin.take().expect("it is piped");
        let answers = BufReader::new(script.stdout.take().expect("it is piped")).lines();
        Self { script, asked, answers }
    }
}

/// Started ones that no test uses: a start takes seconds.
static IDLE: Mutex<Vec<Browser>> = Mutex::new(Vec::new());

/// A page in a tab of its own, which is closed at its end.
pub struct LivePage {
    /// None: at its end.
    browser: Option<Browser>,
    is_shared: bool,
}

impl LivePage {
    /// A tab of a browser that other tests use one after the other.
    ///
    /// # Panics
    /// There is no browser.
    pub fn start() -> Self {
        let idle = IDLE.lock().expect("nothing fails under it").pop();
        let mut page = Self { browser: Some(idle.unwrap_or_else(Browser::start)), is_shared: true };
        page.ask(&serde_json::json!({ "do": "new" }));
        page
    }

    /// The page of a browser of its own, which no other page has used memory of.
    ///
    /// # Panics
    /// There is no browser.
    pub fn alone() -> Self {
        Self { browser: Some(Browser::start()), is_shared: false }
    }

    #[track_caller]
    fn ask(&mut self, what: &Value) -> Value {
        let browser = self.browser.as_mut().expect("it has one until its end");
        writeln!(browser.asked, "{what}").expect("the browser's script has ended");
        let answer = browser.answers.next().and_then(Result::ok);
        json(&answer.unwrap_or_else(|| panic!("the browser's script has ended at {what}")))
    }

    /// A report with the mouse at these parts of each plot: `tests/oracle/report.py`.
    #[track_caller]
    pub fn look(&mut self, report: &Path, parts: &[f32]) -> Value {
        self.ask(&serde_json::json!({ "do": "look", "page": report, "parts": parts }))
    }

    /// Opens an address, in a window of this size.
    #[track_caller]
    pub fn open(&mut self, url: &str, scheme: &str, width: u32, height: u32) {
        // Another fragment alone would not reload the page.
        self.ask(&serde_json::json!({ "do": "open", "url": "about:blank", "scheme": scheme, "width": width, "height": height }));
        self.ask(&serde_json::json!({ "do": "open", "url": url, "scheme": scheme, "width": width, "height": height }));
    }

    /// As [`Self::open`], and waits until our script is done.
    #[track_caller]
    pub fn open_ready(&mut self, url: &str, scheme: &str, width: u32, height: u32) {
        self.open(url, scheme, width, height);
        self.wait("return document.documentElement.dataset.ready === 'true'", 20);
    }

    /// The page on a screen or on paper (`print`), with a reader's preferences.
    #[track_caller]
    pub fn media(&mut self, media: &str, features: &Value) {
        self.ask(&serde_json::json!({ "do": "media", "media": media, "features": features }));
    }

    /// Prints it as a PDF.
    #[track_caller]
    pub fn pdf(&mut self, path: &Path) {
        self.ask(&serde_json::json!({ "do": "pdf", "path": path }));
    }

    /// Its content at one moment.
    #[track_caller]
    pub fn read(&mut self) -> Value {
        self.ask(&serde_json::json!({ "do": "read" }))
    }

    /// Waits until a script returns something true.
    #[track_caller]
    pub fn wait(&mut self, script: &str, limit_s: u32) -> Value {
        self.ask(&serde_json::json!({ "do": "wait", "script": script, "limit_s": limit_s }))
    }

    /// A script's result.
    #[track_caller]
    pub fn run(&mut self, script: &str) -> Value {
        self.ask(&serde_json::json!({ "do": "run", "script": script }))
    }

    /// Presses keys.
    #[track_caller]
    pub fn press(&mut self, keys: &[&str]) {
        self.ask(&serde_json::json!({ "do": "press", "keys": keys }));
    }

    /// Into the input of the selector.
    #[track_caller]
    pub fn files(&mut self, selector: &str, paths: &[PathBuf]) {
        self.ask(&serde_json::json!({ "do": "files", "selector": selector, "paths": paths }));
    }

    /// Drops files and folders onto the window.
    #[track_caller]
    pub fn drop_files(&mut self, paths: &[PathBuf]) {
        self.ask(&serde_json::json!({ "do": "drop", "paths": paths }));
    }

    /// The folder of saved files.
    #[track_caller]
    pub fn downloads(&mut self, folder: &Path) {
        self.ask(&serde_json::json!({ "do": "downloads", "path": folder }));
    }

    /// The window, or the whole page.
    #[track_caller]
    pub fn shot(&mut self, path: &Path, whole: bool) {
        self.ask(&serde_json::json!({ "do": "shot", "path": path, "whole": whole }));
    }

    /// The most memory that one of its processes with a page ever had (`VmHWM`), in bytes.
    ///
    /// # Panics
    /// No process has a page.
    pub fn peak_bytes(&self) -> u64 {
        let of = |pid: &u32, file: &str| {
            std::fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap_or_default()
        };
        let number = |pid: &u32, name: &str| {
            let status = of(pid, "status");
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            line.split_whitespace().next()?.parse::<u64>().ok()
        };
        let all = std::fs::read_dir("/proc").expect("processes").flatten();
        let all: Vec<u32> = all.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
        let (mut family, mut peak): (Vec<u32>, _) =
            (self.browser.iter().map(|one| one.script.id()).collect(), None);
        while let Some(pid) = family.pop() {
            family.extend(all.iter().filter(|child| number(child, "PPid:") == Some(u64::from(pid))));
            if of(&pid, "cmdline").contains("--type=renderer") {
                peak = peak.max(number(&pid, "VmHWM:").map(|kib| kib * 1_024));
            }
        }
        peak.expect("a browser has pages")
    }

    /// The browser's complaints.
    #[track_caller]
    pub fn console(&mut self) -> Value {
        self.ask(&serde_json::json!({ "do": "console" }))
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        let Some(mut browser) = self.browser.take() else { return };
        if self.is_shared && !std::thread::panicking() {
            IDLE.lock().expect("nothing fails under it").push(browser);
            return;
        }
        // Ends at end of input; a hanging script is ended.
        let _ = browser.asked.write_all(b"{\"do\": \"quit\"}\n");
        for _ in 0..100 {
            if !matches!(browser.script.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = browser.script.kill();
        let _ = browser.script.wait();
    }
}

/// Pymavlink's results.
pub fn manifest(files: &[PathBuf]) -> Manifest {
    Manifest::parse(&manifest_text(files))
}

/// The manifest as a file.
pub fn manifest_text(files: &[PathBuf]) -> String {
    ask("manifest.py", files)
}

/// Usage by pymavlink's messages: `tests/oracle/usage.py`.
pub fn usage(files: &[PathBuf]) -> Value {
    json(&ask("usage.py", files))
}

/// Parses a stream strictly: `tests/oracle/gs_stream.py`.
///
/// # Panics
///
/// A byte is not part of a valid frame.
pub fn ground_station(stream: &Path) -> Value {
    json(&ask("gs_stream.py", &[stream.to_owned()]))
}

/// Like a ground station, by UDP: `tests/oracle/companion.py`.
pub fn companion(port: u16) -> Value {
    json(&ask("companion.py", &[PathBuf::from(port.to_string())]))
}

/// A text as the firmware stores it: `tests/oracle/metadata.py`.
pub fn pack(text: &Path, into: &Path) {
    run("metadata.py", &["pack".into(), text.to_owned(), into.to_owned()]);
}

/// The content of a packed file, by Python's xz.
pub fn unpack(file: &Path) -> String {
    run("metadata.py", &["unpack".into(), file.to_owned()])
}

/// Mission Planner's reading of its file of descriptions.
pub fn descriptions(file: &Path) -> Value {
    json(&run("metadata.py", &["words".into(), file.to_owned()]))
}

/// Component information over pymavlink's FTP: `tests/oracle/metadata.py`.
pub fn metadata(port: u16, folder: &Path) -> Value {
    json(&ask("metadata.py", &["fetch".into(), port.to_string().into(), folder.to_owned()]))
}

/// A talk with pymavlink's signing; `state` passes from run to run: `tests/oracle/signing.py`.
pub fn signing(port: u16, state: &Path) -> Value {
    json(&ask("signing.py", &[PathBuf::from(port.to_string()), state.to_owned()]))
}

/// An autopilot in flight, with an emptying battery: `tests/oracle/autopilot.py`.
pub fn autopilot(autopilot: u16, gs: u16, pilot: &str) -> Value {
    let arguments = [autopilot.to_string(), gs.to_string(), pilot.to_owned()];
    json(&ask("autopilot.py", &arguments.map(PathBuf::from)))
}

/// Autopilot (`px4` or `ardupilot`) and ground station: `tests/oracle/vehicle.py`.
pub fn vehicle(autopilot: u16, ground: u16, kind: &str) -> Value {
    let arguments = [autopilot.to_string(), ground.to_string(), kind.to_owned()];
    json(&ask("vehicle.py", &arguments.map(PathBuf::from)))
}

/// MAVProxy's prompt: `tests/oracle/gs_mavproxy.py`.
pub fn mavproxy(port: u16, folder: &Path) -> Value {
    json(&run("gs_mavproxy.py", &[PathBuf::from(port.to_string()), folder.to_owned()]))
}

/// A recorded stream, without and with our module: `tests/oracle/gs_mavproxy_alerts.py`.
pub fn mavproxy_alerts(stream: &Path, modules: &Path, folder: &Path) -> Value {
    json(&run("gs_mavproxy_alerts.py", &[stream.to_owned(), modules.to_owned(), folder.to_owned()]))
}

/// The oldest log, with a `loss` of frames: `tests/oracle/log_download.py`.
pub fn log_download(port: u16, out: &Path, loss: f64) -> Value {
    let arguments = [PathBuf::from(port.to_string()), out.to_owned(), PathBuf::from(loss.to_string())];
    json(&ask("log_download.py", &arguments))
}
