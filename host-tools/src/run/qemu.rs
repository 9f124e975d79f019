//! QEMU with the firmware in it: its command line, its pipes, and how it ends.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tempfile::TempDir;

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";
/// The first version that models this chip's memory.
const VERSION_MIN: u32 = 8;
/// How long the firmware may take until it listens.
const BOOT: Duration = Duration::from_mins(1);
/// How long it may take to work off what was sent and to close the log.
const SHUTDOWN: Duration = Duration::from_mins(3);
/// How long to wait for a socket to appear.
const CONNECT: Duration = Duration::from_secs(10);

const ADVICE: &str = "\n  Debian 12:        add bookworm-backports, then apt-get install -t bookworm-backports qemu-system-arm\
                      \n  Debian 13, Ubuntu 24.04:  apt-get install qemu-system-arm\
                      \n  in the source tree:       cargo xtask setup\
                      \n  without an emulator:      hums sim runs the same pipeline on this PC";

/// Says what to do where QEMU is missing or too old.
pub fn check() -> Result<()> {
    let output = match Command::new(PROGRAM).arg("--version").stdin(Stdio::null()).output() {
        Ok(output) => output,
        Err(error) => bail!(
            "{PROGRAM} cannot be started ({error}); version {VERSION_MIN}.0 or later is needed:{ADVICE}"
        ),
    };
    let text = String::from_utf8_lossy(&output.stdout);
    let version = text.split("version ").nth(1).unwrap_or_default();
    let major: Option<u32> = version.split('.').next().and_then(|major| major.trim().parse().ok());
    match major {
        Some(major) if major < VERSION_MIN => {
            let found = version.split_whitespace().next().unwrap_or_default();
            bail!(
                "{PROGRAM} is {found}; it models this chip's memory only from version {VERSION_MIN}.0 on:{ADVICE}"
            )
        }
        Some(_) => Ok(()),
        None => bail!(
            "{PROGRAM} --version says nothing that is understood; version {VERSION_MIN}.0 is needed:{ADVICE}"
        ),
    }
}

/// The bit of a count in the clock's pipe that says that the bytes are the ground station's.
const FROM_GS: u32 = 1 << 31;

/// A line of the firmware's.
enum Line {
    Ready,
    Result(String),
}

/// The firmware, running.
pub struct Qemu {
    child: Child,
    lines: Receiver<Line>,
    /// The clock: 12-byte records of time and count.
    feed: Option<File>,
    /// The autopilot UART.
    uart: Option<UnixStream>,
    /// The ground station's.
    ground: Option<UnixStream>,
    downlink: Option<JoinHandle<std::io::Result<u64>>>,
    complaints: JoinHandle<String>,
    dir: TempDir,
}

impl Qemu {
    /// Starts the firmware and waits until it listens. `costs`: it counts the instructions of each stage.
    pub fn start(
        firmware: &Path,
        card: &Path,
        gs: Box<dyn Write + Send>,
        autopilot: Box<dyn Write + Send>,
        costs: bool,
    ) -> Result<Self> {
        let dir = tempfile::Builder::new().prefix("hums-").tempdir().context("no temporary directory")?;
        let at = |name: &str| dir.path().join(name);
        // Links keep the paths in QEMU's argument short and free of characters that it would read.
        let card = std::path::absolute(card)?;
        symlink(&card, at("card")).with_context(|| format!("{}: cannot be linked", card.display()))?;
        make_fifo(&at("feed"))?;
        let mut child = command(firmware, dir.path(), costs)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("{PROGRAM} cannot be started"))?;
        let (lines, complaints) = listen(&mut child)?;
        let mut qemu =
            Self { child, lines, feed: None, uart: None, ground: None, downlink: None, complaints, dir };
        // It waits for this one before it starts the firmware, so that not one byte is missed.
        let ground = qemu.connect("gs")?;
        qemu.ground = Some(ground.try_clone().context("the ground station's port")?);
        qemu.downlink = Some(forward(ground, gs));
        let uart = qemu.connect("ap")?;
        // What is sent to the autopilot must be read, or the emulator would wait for that.
        let _ = forward(uart.try_clone().context("the autopilot's port")?, autopilot);
        qemu.uart = Some(uart);
        match qemu.lines.recv_timeout(BOOT) {
            Ok(Line::Ready) => {}
            Ok(Line::Result(_)) | Err(RecvTimeoutError::Disconnected) => {
                let why = qemu.end()?;
                bail!("the firmware ended before it listened{why}");
            }
            Err(RecvTimeoutError::Timeout) => bail!("the firmware did not start to listen within {BOOT:?}"),
        }
        // For reading as well: that never waits, and the firmware sees the end when this handle is dropped.
        let feed = OpenOptions::new().read(true).write(true).open(qemu.dir.path().join("feed"));
        qemu.feed = Some(feed.context("the clock's pipe cannot be opened")?);
        Ok(qemu)
    }

    fn connect(&mut self, name: &str) -> Result<UnixStream> {
        let path = self.dir.path().join(name);
        let start = Instant::now();
        loop {
            if let Ok(stream) = UnixStream::connect(&path) {
                return Ok(stream);
            }
            if self.child.try_wait()?.is_some() {
                let why = self.end()?;
                bail!("{PROGRAM} ended at once{why}");
            }
            if start.elapsed() > CONNECT {
                bail!("{PROGRAM} does not listen at its {name} port");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// "At this time these bytes have arrived."
    pub fn arrive(&mut self, at_us: u64, bytes: &[u8]) -> Result<()> {
        self.give(at_us, bytes, false)
    }

    /// The same for bytes of the ground station.
    pub fn hear(&mut self, at_us: u64, bytes: &[u8]) -> Result<()> {
        self.give(at_us, bytes, true)
    }

    fn give(&mut self, at_us: u64, bytes: &[u8], from_gs: bool) -> Result<()> {
        let mut record = [0; 12];
        record[..8].copy_from_slice(&at_us.to_le_bytes());
        let count = bytes.len() as u32 | if from_gs { FROM_GS } else { 0 };
        record[8..].copy_from_slice(&count.to_le_bytes());
        let port = if from_gs { &mut self.ground } else { &mut self.uart };
        let sent = match (&mut self.feed, port) {
            (Some(feed), Some(uart)) => feed.write_all(&record).and_then(|()| uart.write_all(bytes)),
            _ => Ok(()),
        };
        if let Err(error) = sent {
            let why = self.end()?;
            bail!("the firmware stopped taking bytes ({error}){why}");
        }
        Ok(())
    }

    /// No more bytes: the firmware closes the log and prints its counters, one JSON object.
    pub fn finish(mut self) -> Result<String> {
        self.feed = None;
        let result = match self.lines.recv_timeout(SHUTDOWN) {
            Ok(Line::Result(json)) => Some(json),
            Ok(Line::Ready) | Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) => {
                bail!("the firmware did not end within {SHUTDOWN:?} after its input")
            }
        };
        let status = self.child.wait().context("the emulator's end")?;
        (self.uart, self.ground) = (None, None);
        if let Some(downlink) = self.downlink.take()
            && let Ok(result) = downlink.join()
        {
            result.context("--gs: cannot be written")?;
        }
        if let (Some(0), Some(json)) = (status.code(), result) {
            Ok(json)
        } else {
            let why = self.end()?;
            bail!("the firmware failed{why}")
        }
    }

    /// How it ended, as the end of a sentence.
    fn end(&mut self) -> Result<String> {
        (self.feed, self.uart, self.ground) = (None, None, None);
        let status = if let Some(status) = self.child.try_wait()? {
            status
        } else {
            std::thread::sleep(Duration::from_millis(200));
            let _ = self.child.kill();
            self.child.wait()?
        };
        let mut why = match status.code() {
            Some(0) => String::new(),
            Some(2) => ": it could not open its clock's pipe".to_owned(),
            Some(101) => ": it panicked (see above)".to_owned(),
            Some(102) => ": all its tasks wait for ever".to_owned(),
            Some(code) => format!(": {PROGRAM} exit code {code}"),
            None => ": it was killed".to_owned(),
        };
        let complaints = std::mem::replace(&mut self.complaints, std::thread::spawn(String::new));
        let complaints = complaints.join().unwrap_or_default();
        // What it says in passing is no complaint, and a register dump is for the few who can read it.
        for line in complaints.lines().filter(|line| line.starts_with("qemu") && !line.contains(": info: ")) {
            let _ = write!(why, "\n{line}");
        }
        Ok(why)
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // Only one that is still running, after an error, takes notice.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn command(firmware: &Path, dir: &Path, costs: bool) -> Command {
    let socket =
        |id: &str, more: &str| format!("socket,id={id},path={},server=on,{more}", escaped(&dir.join(id)));
    let arguments = format!(
        "enable=on,target=native,arg=\"sd={}\" \"feed={}\" \"cost={}\"",
        escaped(&dir.join("card")),
        escaped(&dir.join("feed")),
        u8::from(costs)
    );
    let mut command = Command::new(PROGRAM);
    command
        .args(["-M", "netduinoplus2", "-nodefaults", "-display", "none", "-monitor", "none", "-kernel"])
        .arg(firmware)
        // The mux puts a buffer before the UART, which quadruples its pace; -echr takes its escape byte away.
        .args(["-chardev", &socket("ap", "wait=off,mux=on"), "-serial", "chardev:ap", "-echr", "256"])
        .args(["-chardev", &socket("gs", "wait=on"), "-serial", "chardev:gs"])
        .args(["-semihosting-config", &arguments])
        .current_dir(dir)
        // With this its clock counts instructions, as the firmware takes it for granted when it counts costs.
        .args(if costs { &["-icount", "shift=3"][..] } else { &[] })
        // Ctrl-C is for this program, which then lets the firmware close its log.
        .process_group(0);
    command
}

/// A path inside one of QEMU's options, where a comma ends the value.
fn escaped(path: &Path) -> String {
    path.display().to_string().replace(',', ",,")
}

fn make_fifo(path: &PathBuf) -> Result<()> {
    // POSIX has the program; the system call would need unsafe code or one more library.
    let status = Command::new("mkfifo").arg(path).status().context("mkfifo cannot be started")?;
    if status.success() { Ok(()) } else { bail!("mkfifo {}: failed", path.display()) }
}

/// The firmware's lines, and QEMU's complaints.
fn listen(child: &mut Child) -> Result<(Receiver<Line>, JoinHandle<String>)> {
    let stdout = child.stdout.take().context("the emulator has no output")?;
    let mut stderr = child.stderr.take().context("the emulator has no error output")?;
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            let sent = match line.as_str() {
                "ready" => sender.send(Line::Ready),
                json if json.starts_with('{') => sender.send(Line::Result(json.to_owned())),
                message => {
                    eprintln!("firmware: {message}");
                    Ok(())
                }
            };
            if sent.is_err() {
                break;
            }
        }
    });
    let complaints = std::thread::spawn(move || {
        let mut text = String::new();
        // Whatever could be read is told.
        let _ = stderr.read_to_string(&mut text);
        text
    });
    Ok((lines, complaints))
}

fn forward(mut from: UnixStream, mut to: Box<dyn Write + Send>) -> JoinHandle<std::io::Result<u64>> {
    std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        let mut total = 0;
        loop {
            let got = match from.read(&mut buffer) {
                Ok(0) => break,
                Ok(got) => got,
                // The emulator's end resets the connection.
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(_) => break,
            };
            to.write_all(buffer.get(..got).unwrap_or_default())?;
            to.flush()?;
            total += got as u64;
        }
        Ok(total)
    })
}
