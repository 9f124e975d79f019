//! Runs a program with a time limit.

use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Shorter at first: many programs run for a few milliseconds.
const POLL: Duration = Duration::from_millis(5);
const POLL_FIRST: Duration = Duration::from_micros(300);

/// How a program ended.
#[derive(Debug)]
pub struct Outcome {
    /// The exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Its output on stdout.
    pub stdout: Vec<u8>,
    /// Its output on stderr.
    pub stderr: String,
    /// KiB of resident memory, polled every 5 ms, at first more often.
    pub memory_kib_max: u64,
}

impl Outcome {
    /// Ended by itself with one of `codes`, without a panic.
    #[track_caller]
    #[allow(clippy::return_self_not_must_use, reason = "most callers are done when it ended well")]
    pub fn expect_code(self, codes: &[i32]) -> Self {
        assert!(!self.stderr.contains("panicked at"), "it panicked: {}", self.stderr);
        let code = self.code.unwrap_or_else(|| panic!("a signal ended it; stderr: {}", self.stderr));
        assert!(
            codes.contains(&code),
            "exit code {code}, expected one of {codes:?}; stderr: {}",
            self.stderr
        );
        self
    }

    /// Code 1, and the reason in a few lines.
    #[track_caller]
    #[allow(clippy::return_self_not_must_use, reason = "most callers are done when it ended so")]
    pub fn expect_clear_failure(self) -> Self {
        let outcome = self.expect_code(&[1]);
        let words = outcome.stderr.trim();
        assert!(words.len() > 10, "a failure without a message: {words:?}");
        assert!(words.lines().count() <= 12, "a message is no dump: {words}");
        assert!(!words.contains("RUST_BACKTRACE"), "a message, not a panic's: {words}");
        outcome
    }

    /// Stdout as text.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.stdout).into_owned()
    }
}

/// With nothing on stdin.
///
/// # Panics
/// After `limit` the program is ended, and the test fails.
#[track_caller]
pub fn run(command: &mut Command, limit: Duration) -> Outcome {
    run_with_input(command, None, limit)
}

/// As [`run`], with `input` on stdin.
///
/// # Panics
/// After `limit` the program is ended, and the test fails.
#[track_caller]
pub fn run_with_input(command: &mut Command, input: Option<File>, limit: Duration) -> Outcome {
    let dir = tempfile::tempdir().unwrap();
    // Files need no reader while the program runs.
    let (out, err) = (dir.path().join("stdout"), dir.path().join("stderr"));
    let mut child = command
        .stdin(input.map_or_else(Stdio::null, Stdio::from))
        .stdout(File::create(&out).unwrap())
        .stderr(File::create(&err).unwrap())
        .spawn()
        .unwrap_or_else(|error| panic!("cannot run {command:?}: {error}"));
    let (status, memory_kib_max) = wait(&mut child, limit);
    let stderr = String::from_utf8_lossy(&fs::read(&err).unwrap()).into_owned();
    let Some(status) = status else {
        panic!("{command:?} did not end within {limit:?}; stderr: {stderr}");
    };
    assert_ne!(status.signal(), Some(11), "{command:?} crashed; stderr: {stderr}");
    Outcome { code: status.code(), stdout: fs::read(&out).unwrap(), stderr, memory_kib_max }
}

/// Also its highest memory. After a timeout it is killed and has no status.
fn wait(child: &mut Child, limit: Duration) -> (Option<ExitStatus>, u64) {
    let start = Instant::now();
    let mut memory_kib_max = 0;
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return (Some(status), memory_kib_max);
        }
        memory_kib_max = memory_kib_max.max(resident_kib_max(child.id()).unwrap_or(0));
        if start.elapsed() > limit {
            child.kill().unwrap();
            child.wait().unwrap();
            return (None, memory_kib_max);
        }
        thread::sleep((start.elapsed() / 4).clamp(POLL_FIRST, POLL));
    }
}

/// None between `vfork` and `exec`: the memory is then this program's own.
fn resident_kib_max(process: u32) -> Option<u64> {
    let program = |of: &str| fs::read_link(format!("/proc/{of}/exe")).ok();
    if program(&process.to_string())? == program("self")? {
        return None;
    }
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "did not end within")]
    fn a_program_that_hangs_fails_the_test() {
        run(Command::new("sleep").arg("60"), Duration::from_millis(50));
    }

    #[test]
    fn code_and_output_are_told_apart() {
        let outcome =
            run(Command::new("sh").args(["-c", "echo out; echo err >&2; exit 3"]), Duration::from_secs(10));
        assert_eq!(
            (outcome.code, outcome.text().as_str(), outcome.stderr.as_str()),
            (Some(3), "out\n", "err\n")
        );
    }

    #[test]
    #[should_panic(expected = "it panicked")]
    fn a_panic_is_never_an_expected_end() {
        let script = "echo \"thread 'main' panicked at src/main.rs\" >&2; exit 1";
        run(Command::new("sh").args(["-c", script]), Duration::from_secs(10)).expect_code(&[1]);
    }
}
