//! How a run ended, and the one place that turns it into an exit code.
//!
//! | code | meaning |
//! |---|---|
//! | 0 | done |
//! | 1 | failed: the message says what, and where it can what to do |
//! | 2 | usage: the command line itself is wrong |
//! | 3 | done, but the log has losses or damage: all that could be read was read |
//! | 4 | done, and `hums check` found something wrong with the vehicle, in a whole or a damaged log |

use std::error::Error as StdError;
use std::fmt;
use std::io;
use std::path::Path;
use std::process::ExitCode;

/// The end of a run without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// Everything, exactly.
    Done,
    /// All possible results; they report losses or damage.
    Losses,
    /// A check of the vehicle found something wrong, whatever was lost.
    Findings,
}

impl Outcome {
    /// `Losses` where `lossy`.
    pub fn lossy(lossy: bool) -> Self {
        if lossy { Self::Losses } else { Self::Done }
    }

    /// The worse of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        self.max(other)
    }
}

/// The command line asks for something that makes no sense: exit code 2.
#[derive(Debug)]
pub struct Usage(pub String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl StdError for Usage {}

/// A usage error with this message.
pub fn usage(message: impl Into<String>) -> anyhow::Error {
    Usage(message.into()).into()
}

/// The reader of our standard output has gone (`hums info | head`). This is not an error and needs no message.
#[derive(Debug)]
pub struct ReaderGone;

impl fmt::Display for ReaderGone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("standard output was closed")
    }
}

impl StdError for ReaderGone {}

/// An output exists, and was not overwritten.
#[derive(Debug)]
pub struct ExistingOutput(String);

impl fmt::Display for ExistingOutput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl StdError for ExistingOutput {}

/// The error of an output that exists; `has_force` if the command has a flag `--force`.
pub fn exists(path: &Path, has_force: bool) -> anyhow::Error {
    let force = if has_force { ", or say --force, which overwrites it" } else { "" };
    ExistingOutput(format!(
        "{}: exists, and was not overwritten; name another output, move it away{force}",
        path.display()
    ))
    .into()
}

/// A result of one of several logs: where its output exists, the remark on it, and the log is skipped.
pub fn or_skipped<T>(result: anyhow::Result<T>) -> anyhow::Result<Result<T, String>> {
    match result {
        Ok(done) => Ok(Ok(done)),
        Err(error) if error.is::<ExistingOutput>() => Ok(Err(format!("{error:#}"))),
        Err(error) => Err(error),
    }
}

fn find<E: StdError + 'static>(error: &anyhow::Error) -> Option<&E> {
    error.chain().find_map(|cause| {
        let inner = || cause.downcast_ref::<io::Error>()?.get_ref()?.downcast_ref();
        cause.downcast_ref().or_else(inner)
    })
}

/// Reports an error on standard error, and returns the exit code.
pub fn exit_code(result: anyhow::Result<Outcome>) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Losses) => ExitCode::from(3),
        Ok(Outcome::Findings) => ExitCode::from(4),
        Err(error) if find::<ReaderGone>(&error).is_some() => ExitCode::SUCCESS,
        Err(error) => {
            note!("{error:#}");
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}

#[cfg(test)]
mod tests {
    use anyhow::Context as _;

    use super::*;

    #[test]
    fn a_reader_that_has_gone_is_found_under_what_else_is_said() {
        let gone = || std::io::Error::other(ReaderGone);
        let told: anyhow::Result<()> = Err(gone()).context("--gs: cannot be written");
        let is_gone = |error: anyhow::Error| find::<ReaderGone>(&error).is_some();
        assert!(is_gone(told.expect_err("an error")) && is_gone(ReaderGone.into()));
        assert!(!is_gone(std::io::Error::other("full").into()));
    }
}
