//! A simulated board in real time, for clients.
#![cfg_attr(not(feature = "oracle"), allow(dead_code, reason = "comparisons use the rest of it"))]

use std::ffi::OsStr;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use hums_tests::child::Outcome;
use hums_tests::flights::own;
use hums_tests::live::free_port;
use hums_tests::program::{self, hums, hums_with};
use tempfile::TempDir;

pub(crate) struct Board {
    dir: Option<TempDir>,
    child: Child,
    pub(crate) port: u16,
}

impl Board {
    pub(crate) fn start(flags: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), flags)
    }

    pub(crate) fn start_in(dir: TempDir, flags: &[&str]) -> Self {
        Self::start_with(own("ap_quad_guided.tlog").as_os_str(), dir, flags)
    }

    /// With another input.
    pub(crate) fn start_with(input: &OsStr, dir: TempDir, flags: &[&str]) -> Self {
        let port = free_port();
        let mut command: Command = program::command(["sim", "--json", "--speed", "real"]);
        let image = dir.path().join("card.img");
        if !image.exists() {
            // Tests read all of it.
            command.args(["--card-size", "64"]);
        }
        command.arg(input).arg("--sd").arg(image);
        command.args(["--gs", &format!("udpin:127.0.0.1:{port}")]).args(flags);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        Self { dir: Some(dir), child, port }
    }

    /// The ground station's port.
    pub(crate) fn address(&self) -> String {
        format!("udpout:127.0.0.1:{}", self.port)
    }

    /// Ends it as by Ctrl-C; returns the lines of its log.
    pub(crate) fn end(self) -> String {
        let dir = self.switch_off();
        let image = dir.path().join("card.img");
        hums_with("decode {} -o - --format jsonl", &[&image]).expect_code(&[0]).text()
    }

    /// Keeps the folder with card and store.
    pub(crate) fn switch_off(mut self) -> TempDir {
        let kill = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let start = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < Duration::from_secs(30), "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        self.dir.take().expect("it is switched off once")
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `hums box WORDS --link ADDRESS --system 1`
#[track_caller]
pub(crate) fn on(address: &str, words: &str) -> Outcome {
    hums(["box"].into_iter().chain(words.split(' ')).chain(["--link", address, "--system", "1"]))
}

/// One finished session: this part of a recording, and parameters. All such cards have logs of the same names.
pub(crate) fn card(part: Range<usize>, seed: &str) -> (TempDir, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let recording = fs::read(own("ap_quad_signed.raw")).unwrap();
    let (input, image) = (dir.path().join("short.raw"), dir.path().join("card.img"));
    fs::write(&input, &recording[part]).unwrap();
    fs::write(dir.path().join("params.txt"), "GS_BUDGET 5000\n").unwrap();
    hums_with("sim --card-size 64 --seed {} {} --sd {}", &[&seed, &input, &image]).expect_code(&[0]);
    let card = fs::read(&image).unwrap();
    (dir, card)
}

#[track_caller]
pub(crate) fn assert_on_card(log: &Path, card: &[u8]) {
    let log = fs::read(log).unwrap();
    assert!(log.len() > 4_000 && log.len().is_multiple_of(512), "{} bytes", log.len());
    let first = card.chunks_exact(512).position(|block| block == &log[..512]).expect("its first sector");
    assert!(card[first * 512..].starts_with(&log), "the download differs from the card");
}

/// `hums box pull` adds the session to the segment's name.
pub(crate) fn pulled_log(folder: &Path, number: &str) -> PathBuf {
    let all: Vec<PathBuf> = pulled_logs(folder, number);
    assert_eq!(all.len(), 1, "{all:?}");
    all[0].clone()
}

/// The downloaded logs of several boxes and cards.
pub(crate) fn pulled_logs(folder: &Path, number: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().file_name());
    let names = entries.map(|name| name.into_string().unwrap());
    let is_it = |name: &String| name.starts_with(&format!("{number}-")) && name.ends_with("_00.HUM");
    let mut all: Vec<PathBuf> = names.filter(is_it).map(|name| folder.join(name)).collect();
    all.sort();
    all
}
