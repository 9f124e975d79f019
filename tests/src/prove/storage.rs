//! Tables and logs in object storage, on a server of its own (SeaweedFS): jobs at once, kills, wrong settings, other readers.
//!
//! It is not a campaign of `docs/proof.md`: its figures are of the machine that runs it.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;
use tempfile::TempDir;

use crate::child::{self, Outcome};
use crate::flights::{OWN, own, root};
use crate::live::{Running, free_port};
use crate::oracle;
use crate::program::command;

/// Its name for `prove`.
pub const STORAGE: &str = "storage";
/// Its description for a list.
pub const ABOUT: &str = "tables in object storage: jobs at once, kills, wrong settings, other readers";

/// A killed program's lease is over in three minutes.
const LIMIT: Duration = Duration::from_mins(6);
const START: Duration = Duration::from_mins(1);
const ERROR_LIMIT: Duration = Duration::from_mins(1);
const KEYS: [(&str, &str); 2] = [("AWS_ACCESS_KEY_ID", "hums"), ("AWS_SECRET_ACCESS_KEY", "secret")];
const CONFIG: &str = r#"{"identities": [{"name": "hums", "credentials": [{"accessKey": "hums", "secretKey": "secret"}],
    "actions": ["Admin", "Read", "Write", "List"]}]}"#;
const FLEET: &str = "s3://fleet/all";
/// The recording whose record is a card's image.
const FLOWN: &str = "ap_quad_faults.tlog";
/// Recordings of different lengths, tried until a kill is in the middle of an upload.
const KILLS: usize = 40;

struct Server {
    endpoint: String,
    running: Running,
    _dir: TempDir,
}

impl Server {
    fn start() -> Result<Self> {
        let begun = Instant::now();
        while begun.elapsed() < START {
            let dir = tempfile::tempdir()?;
            fs::write(dir.path().join("s3.json"), CONFIG)?;
            // A port of its own protocol is 10,000 above each of these.
            let port = 20_000 + free_port() % 20_000;
            let mut weed = Command::new(oracle::beside_python("weed"));
            weed.arg("server").arg(format!("-dir={}", dir.path().display()));
            weed.args([
                "-ip=127.0.0.1",
                "-ip.bind=127.0.0.1",
                "-s3",
                "-master.volumeSizeLimitMB=64",
                "-volume.max=32",
                "-s3.port.iceberg=0",
                "-s3.port.lance=0",
            ]);
            weed.arg(format!("-s3.config={}", dir.path().join("s3.json").display()));
            for (number, name) in (0..).zip(["s3.port", "master.port", "volume.port", "filer.port"]) {
                weed.arg(format!("-{name}={}", port + number));
            }
            let running = Running(weed.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?);
            let mut server = Self { endpoint: format!("http://127.0.0.1:{port}"), running, _dir: dir };
            while begun.elapsed() < START && server.running.0.try_wait()?.is_none() {
                if oracle::storage(&server.environment(), &["make".into(), "fleet".into()]).is_some() {
                    return Ok(server);
                }
                thread::sleep(Duration::from_millis(300));
            }
        }
        bail!("the server does not start")
    }

    fn environment(&self) -> Vec<(String, String)> {
        let keys = KEYS.map(|(name, value)| (name.to_owned(), value.to_owned()));
        keys.into_iter().chain([("AWS_ENDPOINT_URL".to_owned(), self.endpoint.clone())]).collect()
    }

    fn command<A: AsRef<OsStr>>(&self, arguments: &[A]) -> Command {
        let mut command = command(arguments);
        command.envs(self.environment());
        command
    }

    fn hums<A: AsRef<OsStr>>(&self, arguments: &[A]) -> Outcome {
        child::run(&mut self.command(arguments), LIMIT)
    }

    fn ask(&self, arguments: &[&str]) -> Result<Value> {
        let arguments: Vec<PathBuf> = arguments.iter().map(PathBuf::from).collect();
        oracle::storage(&self.environment(), &arguments).context("the other client failed")
    }

    fn keys(&self, begin: &str) -> Result<Vec<String>> {
        let keys = self.ask(&["list", "fleet/all"])?;
        let keys = keys.as_array().context("a list")?.iter().filter_map(Value::as_str);
        Ok(keys.filter(|key| key.starts_with(begin)).map(str::to_owned).collect())
    }

    fn answers(&self) -> Result<Value> {
        self.ask(&["query", "fleet/all", &root().join("docs/fleet.md").display().to_string()])
    }
}

fn decode<'a>(input: &'a Path, output: &'a str) -> [&'a OsStr; 6] {
    [
        "decode".as_ref(),
        input.as_os_str(),
        "-o".as_ref(),
        output.as_ref(),
        "--format".as_ref(),
        "parquet".as_ref(),
    ]
}

/// Starts the server, and tries all cases. Returns the figures as text.
///
/// # Errors
/// A promise is broken.
pub fn run() -> Result<String> {
    let server = Server::start()?;
    let dir = tempfile::tempdir()?;
    let cards = dir.path().join("cards");
    fs::create_dir(&cards)?;
    // Two records of one flight have the same worst values: which session has them would be open.
    for name in OWN.into_iter().filter(|name| *name != FLOWN) {
        fs::copy(own(name), cards.join(name))?;
    }
    let image = cards.join("box.img");
    let sim = ["sim", "--speed", "max", "--seed", "1", "--sd"].map(OsStr::new);
    child::run(command(sim).arg(&image).arg(own(FLOWN)), LIMIT).expect_code(&[0]);
    let mut text = String::new();
    wrong_settings(&server, &cards)?;
    jobs(&server, &cards, &mut text)?;
    kill_upload(&server, dir.path(), &mut text)?;
    kill_compact(&server, &mut text)?;
    other_readers(&server, dir.path(), &cards)?;
    inputs(&server, dir.path())?;
    Ok(text)
}

/// Variables of the environment; without a value they are removed.
type Settings = &'static [(&'static str, Option<&'static str>)];

fn wrong_settings(server: &Server, cards: &Path) -> Result<()> {
    let tlog = cards.join(OWN[0]);
    let cases: [(&str, Settings, &str); 4] = [
        ("s3://no-such-bucket/all", &[], "create the bucket"),
        (FLEET, &[("AWS_SECRET_ACCESS_KEY", Some("wrong"))], "check AWS_ACCESS_KEY_ID"),
        (FLEET, &[("AWS_ACCESS_KEY_ID", None), ("AWS_SECRET_ACCESS_KEY", None)], "no credentials"),
        (FLEET, &[("AWS_ENDPOINT_URL", Some("http://127.0.0.1:1"))], "check AWS_ENDPOINT_URL"),
    ];
    for (output, settings, said) in cases {
        let mut command = server.command(&decode(&tlog, output));
        for (name, value) in settings {
            match value {
                Some(value) => command.env(name, value),
                None => command.env_remove(name),
            };
        }
        let begun = Instant::now();
        let outcome = child::run(&mut command, LIMIT).expect_clear_failure();
        ensure!(outcome.stderr.contains(said), "{said} is not in: {}", outcome.stderr);
        ensure!(begun.elapsed() < ERROR_LIMIT, "{said}: after {:?}", begun.elapsed());
    }
    ensure!(server.keys("")?.is_empty(), "something was written");
    Ok(())
}

/// Three programs add the same sessions at once.
fn jobs(server: &Server, cards: &Path, text: &mut String) -> Result<()> {
    let begun = Instant::now();
    thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| server.hums(&decode(cards, FLEET)).expect_code(&[0, 3]));
        }
    });
    let seconds = begun.elapsed().as_secs_f64();
    let all = server.keys("")?;
    let sessions = server.keys("sessions/")?.len();
    ensure!(sessions == OWN.len(), "{sessions} sessions");
    ensure!(server.keys(".hums-fleet/lease/")?.is_empty(), "leases are left");
    let again = server.hums(&decode(cards, FLEET)).expect_code(&[0, 3]);
    let told = format!("skipped: {sessions} sessions are there already");
    ensure!(again.stderr.contains(&told) && server.keys("")? == all, "{}", again.stderr);
    let _ =
        writeln!(text, "three jobs at once: {sessions} sessions, {} objects in {seconds:.1} s", all.len());
    Ok(())
}

/// The session of a killed upload is not in the summary, and is complete after the next call.
fn kill_upload(server: &Server, dir: &Path, text: &mut String) -> Result<()> {
    let before = server.keys("sessions/")?.len();
    let recording = fs::read(own(OWN[0]))?;
    let path = dir.join("more.tlog");
    for attempt in 0..KILLS {
        let known = server.keys("sessions/")?.len();
        fs::write(&path, recording.get(..400_000 + 1_000 * attempt).context("a long recording")?)?;
        let mut program =
            server.command(&decode(&path, FLEET)).stderr(Stdio::null()).stdout(Stdio::null()).spawn()?;
        thread::sleep(Duration::from_millis(60 + 20 * attempt as u64));
        program.kill()?;
        program.wait()?;
        let (leases, sessions) = (server.keys(".hums-fleet/lease/")?, server.keys("sessions/")?.len());
        let Some(lease) = leases.first().and_then(|key| key.rsplit('/').next()).filter(|_| sessions == known)
        else {
            continue;
        };
        let files =
            server.keys("")?.iter().filter(|key| key.contains(lease) && !key.starts_with('.')).count();
        let begun = Instant::now();
        server.hums(&decode(&path, FLEET)).expect_code(&[0, 3]);
        let now = server.keys("sessions/")?;
        ensure!(now.len() == known + 1 && now.iter().any(|key| key.contains(lease)), "{now:?}");
        ensure!(server.keys(".hums-fleet/lease/")?.is_empty(), "the lease is left");
        let _ = writeln!(
            text,
            "an upload killed after {files} files: complete {:.0} s after the next call",
            begun.elapsed().as_secs_f64()
        );
        return Ok(());
    }
    bail!(
        "no kill was in the middle of an upload; there are {} sessions more",
        server.keys("sessions/")?.len() - before
    )
}

fn kill_compact(server: &Server, text: &mut String) -> Result<()> {
    let before = sorted(&server.answers()?);
    let many = server.keys("")?.len();
    let mut killed = 0;
    for after_ms in [300, 1_500, 3_000] {
        let mut program =
            server.command(&["compact", FLEET]).stderr(Stdio::null()).stdout(Stdio::null()).spawn()?;
        thread::sleep(Duration::from_millis(after_ms));
        program.kill()?;
        killed += u32::from(!program.wait()?.success());
    }
    let begun = Instant::now();
    server.hums(&["compact", FLEET]).expect_code(&[0]);
    let seconds = begun.elapsed().as_secs_f64();
    ensure!(sorted(&server.answers()?) == before, "the answers differ after compact");
    ensure!(server.keys(".hums-fleet/new/")?.is_empty() && killed > 0, "a change is left; {killed} kills");
    let again = server.hums(&["compact", FLEET]).expect_code(&[0]).text();
    ensure!(again.contains("0 sessions"), "{again}");
    let _ = writeln!(
        text,
        "compact, killed {killed} times, then {seconds:.0} s: {many} objects became {}",
        server.keys("")?.len()
    );
    Ok(())
}

/// `DuckDB` answers as from a folder with the same sessions.
fn other_readers(server: &Server, dir: &Path, cards: &Path) -> Result<()> {
    let fleet = dir.join("fleet");
    let fleet = fleet.to_str().context("a path")?;
    let sessions = server.keys(".hums-fleet/index/")?.len();
    child::run(&mut command(decode(cards, fleet)), LIMIT).expect_code(&[0, 3]);
    let local = oracle::fleet(&root().join("docs/fleet.md"), dir);
    let other = server.answers()?;
    let rows = |answers: &Value, heading: &str| {
        let answers = answers.as_array().into_iter().flatten();
        let answer = answers.clone().find(|answer| answer["heading"] == heading);
        answer.and_then(|answer| answer["rows"].as_array()).cloned().unwrap_or_default()
    };
    let headings: Vec<&str> =
        local.as_array().into_iter().flatten().filter_map(|one| one["heading"].as_str()).collect();
    ensure!(headings.len() > 10, "{headings:?}");
    let (here, there) =
        (rows(&local, "Sessions and their checks"), rows(&other, "Sessions and their checks"));
    ensure!(there.len() == sessions && here.iter().all(|row| there.contains(row)), "{here:?}\n{there:?}");
    Ok(())
}

/// Rows without an order.
fn sorted(answers: &Value) -> Vec<String> {
    let mut rows: Vec<String> = answers
        .as_array()
        .into_iter()
        .flatten()
        .flat_map(|answer| {
            answer["rows"].as_array().into_iter().flatten().map(|row| format!("{} {row}", answer["heading"]))
        })
        .collect();
    rows.sort();
    rows
}

/// A log and a folder in object storage are as files; other formats go there too.
fn inputs(server: &Server, dir: &Path) -> Result<()> {
    let log = own(OWN[0]);
    let copy = [
        OsStr::new("decode"),
        log.as_os_str(),
        "-o".as_ref(),
        "s3://fleet/logs/a.tlog".as_ref(),
        "--format".as_ref(),
        "tlog".as_ref(),
    ];
    server.hums(&copy).expect_code(&[0]);
    let twice = server.hums(&copy).expect_clear_failure();
    ensure!(twice.stderr.contains("s3://fleet/logs/a.tlog: exists"), "{}", twice.stderr);
    let verdict = |outcome: Outcome| -> Result<Value> {
        let line: Value = serde_json::from_str(&outcome.text())?;
        Ok(serde_json::json!([line["verdict"], line["findings"], line["log"]]))
    };
    let near = verdict(child::run(command(["check", "--json"]).arg(&log), LIMIT).expect_code(&[0, 4]))?;
    for name in ["s3://fleet/logs/a.tlog", "s3://fleet/logs"] {
        let far = verdict(server.hums(&["check", "--json", name]).expect_code(&[0, 4]))?;
        ensure!(far[0] == near[0] && far[1] == near[1] && far[2] == "s3://fleet/logs/a.tlog", "{far}");
    }
    let page = dir.join("fleet.html");
    server.hums(&["report".as_ref(), FLEET.as_ref(), "-o".as_ref(), page.as_os_str()]).expect_code(&[0]);
    let page = fs::read_to_string(page)?;
    ensure!(page.contains("uid-") || page.contains("system-1-"), "the page has no vehicle");
    server.hums(&["check", "s3://fleet/nothing.tlog"]).expect_clear_failure();
    Ok(())
}
