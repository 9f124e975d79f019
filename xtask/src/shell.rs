//! Programs: each command is shown, to be typed by hand.

use std::cell::Cell;
use std::ffi::OsStr;
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use anyhow::{Context as _, Result, bail};
use rustix::io::retry_on_intr;
use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};

/// A command line with a readable form.
pub(crate) struct Shell {
    command: Command,
    shown: String,
}

impl Shell {
    pub(crate) fn new(program: impl AsRef<OsStr>) -> Self {
        let program = program.as_ref();
        let mut command = Command::new(program);
        command.current_dir(crate::repo::root());
        Self { command, shown: program.to_string_lossy().into_owned() }
    }

    /// Runs this xtask: the user's toolchain.
    pub(crate) fn cargo() -> Self {
        let mut shell = Self::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        "cargo".clone_into(&mut shell.shown);
        shell
    }

    /// Instead of the root.
    pub(crate) fn within(mut self, folder: &Path) -> Self {
        self.command.current_dir(folder);
        self.shown = format!("cd {} && {}", quoted(&folder.to_string_lossy()), self.shown);
        self
    }

    pub(crate) fn arg(mut self, argument: impl AsRef<OsStr>) -> Self {
        let argument = argument.as_ref();
        self.shown.push(' ');
        self.shown.push_str(&quoted(&argument.to_string_lossy()));
        self.command.arg(argument);
        self
    }

    pub(crate) fn args<A: AsRef<OsStr>>(self, arguments: impl IntoIterator<Item = A>) -> Self {
        arguments.into_iter().fold(self, Self::arg)
    }

    pub(crate) fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.shown = format!("{name}={} {}", quoted(&value.as_ref().to_string_lossy()), self.shown);
        self.command.env(name, value);
        self
    }

    /// As it can be typed.
    #[cfg(test)]
    pub(crate) fn shown(&self) -> &str {
        &self.shown
    }

    pub(crate) fn quiet(mut self) -> Self {
        self.command.stdout(Stdio::null());
        self
    }

    /// A non-zero exit is an error.
    pub(crate) fn run(mut self) -> Result<()> {
        eprintln!("$ {}", self.shown);
        let Output { status, .. } = self.wait()?;
        if !status.success() {
            bail!("`{}` ended with {status}", self.shown);
        }
        Ok(())
    }

    /// Stdout, and the code: `hums decode`'s 3 is a result.
    pub(crate) fn output_and_code(mut self) -> Result<(String, i32)> {
        eprintln!("$ {}", self.shown);
        self.command.stdin(Stdio::null()).stdout(Stdio::piped());
        let output = self.wait()?;
        let code = output.status.code().with_context(|| format!("`{}` was ended by a signal", self.shown))?;
        Ok((String::from_utf8_lossy(&output.stdout).into_owned(), code))
    }

    /// Ends with the program, and adds to [`TAKEN`].
    fn wait(&mut self) -> Result<Output> {
        let mut child = self.command.spawn().with_context(|| format!("cannot run {}", self.shown))?;
        let mut stdout = Vec::new();
        if let Some(mut pipe) = child.stdout.take() {
            pipe.read_to_end(&mut stdout).with_context(|| format!("cannot read from {}", self.shown))?;
        }
        // Until it is asked for its status, its times can be read.
        let (this, ended) = (Pid::from_child(&child), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT);
        retry_on_intr(|| waitid(WaitId::Pid(this), ended)).with_context(|| self.shown.clone())?;
        let seconds = processor_seconds(&child.id().to_string()).unwrap_or_default();
        TAKEN.set(TAKEN.get() + seconds);
        Ok(Output { status: child.wait()?, stdout, stderr: Vec::new() })
    }

    /// A non-zero exit is an error.
    pub(crate) fn output(self) -> Result<String> {
        let shown = self.shown.clone();
        let (text, code) = self.output_and_code()?;
        if code != 0 {
            bail!("`{shown}` ended with exit code {code}");
        }
        Ok(text)
    }

    /// `None` if it fails.
    pub(crate) fn ask(mut self) -> Option<String> {
        let output = self.command.stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }
}

thread_local! {
    /// Seconds of the processor that this thread's programs took.
    pub(crate) static TAKEN: Cell<f64> = const { Cell::new(0.0) };
}

/// Of a process and its ended children (proc(5): fields 14 to 17, ticks of 10 ms).
pub(crate) fn processor_seconds(process: &str) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The second field: a name in brackets.
    let fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11).take(4);
    Some(fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0)
}

pub(crate) fn is_root() -> bool {
    static ROOT: OnceLock<bool> = OnceLock::new();
    *ROOT.get_or_init(|| Shell::new("id").arg("-u").ask().is_some_and(|id| id.trim() == "0"))
}

/// For a shell; control characters (cargo's flags) become numbers.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.to_owned() } else { format!("{word:?}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_can_be_typed_and_is_text() {
        let shell = Shell::new("printf").arg("%s").arg("it's here").env("A", "b c");
        assert_eq!(shell.shown, r#"A="b c" printf %s "it's here""#);
        let typed = Command::new("sh").args(["-c", &shell.shown]).output().unwrap();
        assert_eq!(typed.stdout, b"it's here");
        assert_eq!(Shell::new("x").arg("a\u{1f}b").shown, r#"x "a\u{1f}b""#);
    }

    #[test]
    fn a_failing_program_is_an_error_that_names_it() {
        let error = Shell::new("false").run().unwrap_err().to_string();
        assert!(error.contains("false"), "{error}");
        assert!(Shell::new("no-such-program-here").run().is_err());
    }

    #[test]
    fn an_exit_code_is_a_result_where_asked_for() {
        let (text, code) = Shell::new("sh").args(["-c", "echo out; exit 3"]).output_and_code().unwrap();
        assert_eq!((text.as_str(), code), ("out\n", 3));
    }

    #[test]
    fn the_processor_time_of_programs_that_ended_is_this_threads() {
        let busy = || Shell::new("sh").args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]);
        let before = TAKEN.get();
        std::thread::spawn(move || busy().run().unwrap()).join().unwrap();
        assert!(TAKEN.get() <= before);
        busy().run().unwrap();
        assert!(TAKEN.get() > before || !cfg!(target_os = "linux"));
    }
}
