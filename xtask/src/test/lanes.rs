//! Runs steps side by side, each as a process of this program, and shows what a step said when it ends.

use std::fs::{self, File};
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::steps::Step;
use super::table::{End, Row, Tally};
use crate::repo;
use crate::shell::Shell;

/// How often running steps are looked at.
const POLL: Duration = Duration::from_millis(50);

/// What came of it.
pub(super) struct Outcome {
    /// In the order of the steps.
    pub(super) rows: Vec<Row>,
    /// The step that failed, if one did.
    pub(super) failed: Option<&'static str>,
}

/// Steps, running and to be run.
pub(super) struct Lanes {
    steps: Vec<(&'static Step, State)>,
    count: usize,
}

enum State {
    Waiting,
    Running(Running),
    Ended(End, Duration, Tally),
}

struct Running {
    child: Child,
    output: PathBuf,
    start: Instant,
}

impl Lanes {
    /// `can_run` says whether the machine has what a step needs.
    pub(super) fn new(steps: &[&'static Step], can_run: impl Fn(&Step) -> bool) -> Self {
        let state = |step: &'static Step| {
            let missing = || State::Ended(End::Missing, Duration::ZERO, Tally::default());
            (step, if can_run(step) { State::Waiting } else { missing() })
        };
        let steps = steps.iter().map(|step| state(step)).collect();
        Self { steps, count: thread::available_parallelism().map_or(1, usize::from) + 1 }
    }

    /// Runs them all; the first that fails ends the others.
    pub(super) fn run(mut self) -> Result<Outcome> {
        // The steps do not get Ctrl-C: each is a process group of its own, so that it ends with its children.
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            flag::register(signal, Arc::clone(&interrupted)).context("a handler of Ctrl-C")?;
        }
        let folder = repo::target().join("test");
        fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
        let mut failed = None;
        loop {
            self.start_what_can()?;
            if self.running() == 0 {
                break;
            }
            thread::sleep(POLL);
            failed = self.collect()?;
            if failed.is_some() || interrupted.load(Ordering::Relaxed) {
                self.stop();
                break;
            }
        }
        let row = |(step, state): (&'static Step, State)| match state {
            State::Ended(end, took, tally) => Row { name: step.name, end, took, tally },
            State::Waiting | State::Running(_) => {
                Row { name: step.name, end: End::NotRun, took: Duration::ZERO, tally: Tally::default() }
            }
        };
        Ok(Outcome { rows: self.steps.into_iter().map(row).collect(), failed })
    }

    fn running(&self) -> usize {
        self.steps.iter().filter(|(_, state)| matches!(state, State::Running(_))).count()
    }

    /// Whether what it needs has passed and its build folder is free. Steps that were not chosen are not waited for.
    fn is_ready(&self, step: &Step) -> bool {
        self.steps.iter().all(|(other, state)| match state {
            State::Ended(End::Passed, ..) => true,
            State::Running(_) if step.builds.is_some() && other.builds == step.builds => false,
            _ => !step.after.contains(&other.name),
        })
    }

    fn start_what_can(&mut self) -> Result<()> {
        for index in 0..self.steps.len() {
            let Some((step, State::Waiting)) = self.steps.get(index) else { continue };
            if self.running() < self.count && self.is_ready(step) {
                let running = start(step)?;
                if let Some((_, state)) = self.steps.get_mut(index) {
                    *state = State::Running(running);
                }
            }
        }
        Ok(())
    }

    /// Shows what ended; the name of the one that failed.
    fn collect(&mut self) -> Result<Option<&'static str>> {
        let mut failed = None;
        for (step, state) in &mut self.steps {
            let State::Running(running) = state else { continue };
            let Some(status) = running.child.try_wait()? else { continue };
            let (took, text) = (running.start.elapsed(), running.said());
            let end = if status.success() { End::Passed } else { End::Failed };
            let word = if status.success() { "passed" } else { "FAILED" };
            println!("\n=== {}: {}\n{}", step.name, step.about, text.trim_end());
            println!("=== {} {word} in {:.1} s", step.name, took.as_secs_f64());
            if !status.success() {
                failed = Some(step.name);
            }
            *state = State::Ended(end, took, Tally::of(&text));
        }
        Ok(failed)
    }

    /// Ends what still runs.
    fn stop(&mut self) {
        for (_, state) in &mut self.steps {
            if let State::Running(running) = state {
                running.stop();
                *state = State::Ended(End::Stopped, running.start.elapsed(), Tally::default());
            }
        }
    }
}

impl Running {
    fn said(&self) -> String {
        fs::read(&self.output).map_or_else(
            |error| format!("{}: {error}", self.output.display()),
            |bytes| String::from_utf8_lossy(&bytes).into_owned(),
        )
    }

    fn stop(&mut self) {
        // POSIX has the program; the system call would need unsafe code or one more library.
        let group = format!("-{}", self.child.id());
        let _ = Shell::new("kill").args(["-TERM", "--", &group]).ask();
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.stop();
        }
    }
}

fn start(step: &Step) -> Result<Running> {
    eprintln!("... {}", step.name);
    let output = repo::target().join("test").join(format!("{}.txt", step.name));
    let file = File::create(&output).with_context(|| format!("{}", output.display()))?;
    // The build of everything replaces this program's file; it itself is still there under this name.
    let this = PathBuf::from("/proc/self/exe");
    let this = if this.exists() { this } else { std::env::current_exe()? };
    let child = Command::new(this)
        .args(["step", step.name])
        .current_dir(repo::root())
        .stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file)
        .process_group(0)
        .spawn()
        .with_context(|| format!("step {} cannot be started", step.name))?;
    Ok(Running { child, output, start: Instant::now() })
}
