//! `InfluxDB` and `VictoriaMetrics` with an empty database in a folder of their own.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use hums_tests::live::{Running, free_port};
use serde_json::{Value, json};

const START: Duration = Duration::from_mins(1);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Influx,
    Victoria,
}

pub(crate) struct Database {
    kind: Kind,
    folder: tempfile::TempDir,
    pub(crate) port: u16,
    running: Option<Running>,
}

impl Database {
    /// The port changes if a program took the first one.
    pub(crate) fn start(kind: Kind) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut database = Self { kind, folder, port: free_port(), running: None };
        let start = Instant::now();
        while !database.runs() {
            assert!(start.elapsed() < START, "{kind:?} does not start");
            database.port = free_port();
        }
        database
    }

    fn config(&self) -> PathBuf {
        self.folder.path().join("influxdb.conf")
    }

    fn configuration(&self) -> String {
        let (folder, port) = (self.folder.path().display(), self.port);
        format!(
            "reporting-disabled = true\nbind-address = \"127.0.0.1:0\"\n[meta]\ndir = \"{folder}/meta\"\n\
             [data]\ndir = \"{folder}/data\"\nwal-dir = \"{folder}/wal\"\nquery-log-enabled = false\n\
             [http]\nbind-address = \"127.0.0.1:{port}\"\nlog-enabled = false\nmax-row-limit = 0\n\
             [monitor]\nstore-enabled = false\n"
        )
    }

    pub(crate) fn again(&mut self) {
        let start = Instant::now();
        while !self.runs() {
            assert!(start.elapsed() < START, "{:?} does not start again", self.kind);
        }
    }

    fn runs(&mut self) -> bool {
        let mut command = match self.kind {
            Kind::Influx => Command::new(program("HUMS_INFLUXD", "/usr/bin/influxd")),
            Kind::Victoria => Command::new(program("HUMS_VICTORIA", "/usr/bin/victoria-metrics")),
        };
        match self.kind {
            Kind::Influx => {
                fs::write(self.config(), self.configuration()).unwrap();
                command.arg("run").arg("-config").arg(self.config())
            }
            Kind::Victoria => command
                .arg(format!("-httpListenAddr=127.0.0.1:{}", self.port))
                .arg(format!("-storageDataPath={}", self.folder.path().display()))
                .arg("-retentionPeriod=100y")
                // As in the compose file of the dashboards: the newest half minute is not hidden.
                .arg("-search.latencyOffset=1s"),
        };
        let mut running = Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let start = Instant::now();
        let path = if self.kind == Kind::Influx { "/ping" } else { "/health" };
        while running.0.try_wait().unwrap().is_none() {
            if self.get(path).is_ok_and(|(code, _)| code / 100 == 2) {
                self.running = Some(running);
                return true;
            }
            assert!(start.elapsed() < START, "{:?} does not answer", self.kind);
            std::thread::sleep(Duration::from_millis(50));
        }
        false
    }

    /// `InfluxDB` ends at once, like a power cut; `VictoriaMetrics` in order, because it holds accepted data in memory for
    /// seconds.
    pub(crate) fn end(&mut self) {
        let mut running = self.running.take().unwrap();
        running.signal(if self.kind == Kind::Influx { "KILL" } else { "TERM" });
        running.end(Duration::from_mins(1));
    }

    fn get(&self, path: &str) -> std::io::Result<(u16, String)> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
        stream.set_read_timeout(Some(Duration::from_mins(1)))?;
        // HTTP 1.0: the answer ends with the connection.
        write!(stream, "GET {path} HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n")?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
        let code = head.split_whitespace().nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        Ok((code, body.to_owned()))
    }

    pub(crate) fn write(&self, line: &str) {
        for (path, body) in [("/query?q=CREATE%20DATABASE%20hums", ""), ("/write?db=hums&precision=ns", line)]
        {
            let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
            let length = body.len();
            write!(
                stream,
                "POST {path} HTTP/1.0\r\nHost: 127.0.0.1\r\nContent-Length: {length}\r\n\r\n{body}"
            )
            .unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            assert!(answer.starts_with("HTTP/1.0 20"), "{answer}");
        }
    }

    fn json(&self, path: &str) -> Value {
        let (code, body) = self.get(path).unwrap();
        assert_eq!(code, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    pub(crate) fn ask(&self, question: &str) -> Vec<Value> {
        let answer = self.json(&format!("/query?db=hums&epoch=ns&q={}", escaped(question)));
        assert!(answer["results"][0]["error"].is_null(), "{question}: {answer}");
        answer["results"][0]["series"].as_array().cloned().unwrap_or_default()
    }

    /// Values at the end of a span or in each second of it (seconds since 1970).
    pub(crate) fn query(&self, expression: &str, [from_s, to_s]: [f64; 2], instant: bool) -> Vec<Value> {
        self.get("/internal/force_flush").unwrap();
        let (kind, span) = if instant {
            ("query", format!("time={to_s}"))
        } else {
            ("query_range", format!("start={from_s}&end={to_s}&step=1"))
        };
        let answer = self.json(&format!("/api/v1/{kind}?{span}&nocache=1&query={}", escaped(expression)));
        let member = if instant { "value" } else { "values" };
        let series = answer["data"]["result"].as_array().unwrap();
        let number = |pair: &Value| json!(pair[1].as_str().unwrap().parse::<f64>().unwrap());
        let pairs = series.iter().flat_map(|one| match &one[member] {
            Value::Array(pairs) if !instant => pairs.clone(),
            pair => vec![pair.clone()],
        });
        pairs.map(|pair| number(&pair)).collect()
    }

    pub(crate) fn labels(&self, label: &str, of: &str) -> Vec<Value> {
        let of = if of.is_empty() { String::new() } else { format!("?match[]={}", escaped(of)) };
        self.json(&format!("/api/v1/label/{label}/values{of}"))["data"].as_array().unwrap().clone()
    }

    pub(crate) fn points(&self, measurement: &str) -> u64 {
        let series = self.ask(&format!("SELECT * FROM \"{measurement}\""));
        series.iter().map(|one| one["values"].as_array().map_or(0, Vec::len) as u64).sum()
    }

    /// `InfluxDB`: the measurements.
    pub(crate) fn measurements(&self) -> Vec<String> {
        let series = self.ask("SHOW MEASUREMENTS");
        let values = series.iter().flat_map(|one| one["values"].as_array().cloned().unwrap_or_default());
        values.map(|value| value[0].as_str().unwrap().to_owned()).collect()
    }

    pub(crate) fn samples(&self, metric: &str) -> u64 {
        self.get("/internal/force_flush").unwrap();
        let (code, body) = self.get(&format!("/api/v1/export?match[]={metric}")).unwrap();
        assert_eq!(code, 200, "{body}");
        let lines = body.lines().filter(|line| !line.is_empty());
        let count = |line: &str| {
            serde_json::from_str::<Value>(line).unwrap()["values"].as_array().map_or(0, Vec::len)
        };
        lines.map(|line| count(line) as u64).sum()
    }
}

fn escaped(text: &str) -> String {
    text.bytes().fold(String::new(), |text, byte| text + &format!("%{byte:02X}"))
}

fn program(variable: &str, path: &str) -> PathBuf {
    let path = std::env::var_os(variable).map_or_else(|| PathBuf::from(path), PathBuf::from);
    assert!(Path::new(&path).exists(), "{} is missing: `cargo xtask setup` installs it", path.display());
    path
}
