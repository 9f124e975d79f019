//! A running `hums live`, and a vehicle for it.

use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::net::{TcpStream, UdpSocket};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// A program that is ended when dropped.
#[derive(Debug)]
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Sends it a signal by name, for instance `INT`.
    pub fn signal(&self, name: &str) {
        let status = Command::new("kill").arg(format!("-{name}")).arg(self.0.id().to_string()).status();
        assert!(status.unwrap().success(), "no such process");
    }

    /// Exit code within `limit`.
    #[track_caller]
    pub fn end(&mut self, limit: Duration) -> Option<i32> {
        let start = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status.code();
            }
            assert!(start.elapsed() < limit, "it does not end within {limit:?}");
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Processor time, seconds; memory at most, KiB.
    pub fn cost(&self) -> Option<(f64, u64)> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.0.id())).ok()?;
        // After the name, which may contain spaces.
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks: u64 = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.0.id())).ok()?;
        let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        // Linux counts in hundredths here.
        Some((ticks as f64 / 100.0, most.split_whitespace().next()?.parse().ok()?))
    }
}

/// `hums live`, and the address that it printed.
#[derive(Debug)]
pub struct Live {
    /// The program.
    pub program: Running,
    /// The page's address.
    pub address: String,
    stderr: ChildStderr,
}

impl Live {
    /// Starts it with these arguments, at a free port.
    #[track_caller]
    pub fn start(arguments: &[&str]) -> Self {
        Self::start_or_words(arguments).unwrap_or_else(|words| panic!("no address: {words}"))
    }

    /// None if it ends with an error.
    #[track_caller]
    pub fn attempt(arguments: &[&str]) -> Option<Self> {
        Self::start_or_words(arguments).ok()
    }

    #[track_caller]
    fn start_or_words(arguments: &[&str]) -> Result<Self, String> {
        let mut command = Command::new(crate::program::path());
        command
            .args(["live", "--listen", "127.0.0.1:0"])
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        let mut stderr = child.stderr.take().unwrap();
        if !address.starts_with("http://127.0.0.1:") {
            let mut words = String::new();
            let _ = stderr.read_to_string(&mut words);
            let code = Running(child).end(Duration::from_secs(10));
            assert!(code == Some(1) && !words.contains("panicked"), "{code:?}: {address:?} {words}");
            return Err(words);
        }
        Ok(Self { program: Running(child), address: address.trim().to_owned(), stderr })
    }

    /// An end by Ctrl-C: exit code and output.
    #[track_caller]
    pub fn interrupt(self, limit: Duration) -> (Option<i32>, String) {
        self.end_by("INT", limit)
    }

    /// Like a service; as [`Self::interrupt`].
    #[track_caller]
    pub fn terminate(self, limit: Duration) -> (Option<i32>, String) {
        self.end_by("TERM", limit)
    }

    /// The address of the server.
    pub fn host(&self) -> &str {
        self.address.trim_start_matches("http://").trim_end_matches('/')
    }

    /// Opens its page, or gives the status line of the answer.
    pub fn page(&self) -> Result<Page, String> {
        let stream = ask_for_events(self.host());
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let mut lines = BufReader::new(stream).lines();
        let head: Vec<String> =
            lines.by_ref().map_while(Result::ok).take_while(|line| !line.is_empty()).collect();
        if head.iter().any(|line| line == "Content-Type: text/event-stream") {
            Ok(Page(lines))
        } else {
            Err(head.into_iter().next().unwrap_or_default())
        }
    }

    #[track_caller]
    fn end_by(mut self, signal: &str, limit: Duration) -> (Option<i32>, String) {
        self.program.signal(signal);
        let code = self.program.end(limit);
        let mut words = String::new();
        self.stderr.read_to_string(&mut words).unwrap();
        assert!(!words.contains("panicked"), "{words}");
        (code, words)
    }
}

/// Asks for the page's events.
pub fn ask_for_events(host: &str) -> TcpStream {
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    stream
}

/// The events of a page of `hums live`: lines of an answer without a length.
#[derive(Debug)]
pub struct Page(Lines<BufReader<TcpStream>>);

impl Page {
    /// The data of the next event; comments are passed over.
    #[track_caller]
    pub fn message(&mut self) -> String {
        let lines = self.0.by_ref().map(Result::unwrap);
        let mut lines = lines.skip_while(|line| line.is_empty() || line.starts_with(':'));
        let line = lines.next().expect("the connection is open");
        assert_eq!(lines.next().as_deref(), Some(""), "an event has one line");
        line.strip_prefix("data: ").expect("only data").to_owned()
    }
}

/// A free port.
pub fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Evenly, at a rate each second; `each` gets the number so far.
pub fn send<'a>(
    frames: impl Iterator<Item = &'a [u8]>,
    rate: f64,
    mut put: impl FnMut(&[u8]),
    mut each: impl FnMut(u64),
) {
    let start = Instant::now();
    for (number, frame) in (0_u64..).zip(frames) {
        let due = Duration::from_secs_f64(number as f64 / rate);
        if let Some(wait) = due.checked_sub(start.elapsed()).filter(|wait| *wait > Duration::from_millis(1)) {
            thread::sleep(wait);
        }
        put(frame);
        each(number + 1);
    }
}
