//! Options of the command line.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};

/// When the limits were chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    Yes,
    No,
    /// No labels, and no limit was fitted; but their findings were seen.
    Seen,
}

/// Flights to judge, and the results' use.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Flights {
    pub(super) folders: Vec<(PathBuf, Known)>,
    pub(super) short: bool,
    pub(super) write: bool,
}

impl Flights {
    /// The short form.
    pub fn short() -> Self {
        Self { short: true, ..Self::default() }
    }

    /// From the words of a command line.
    pub fn parse(words: &[String]) -> Result<Self> {
        let (mut options, mut words) = (Self::default(), words.iter());
        while let Some(word) = words.next() {
            match word.as_str() {
                "--short" => options.short = true,
                "--write" => options.write = true,
                "--unseen" => {
                    let folder = words.next().context("--unseen wants a folder")?;
                    options.folders.push((folder.into(), Known::No));
                }
                other if other.starts_with('-') => bail!("diagnosis takes no {other}"),
                folder => options.folders.push((folder.into(), Known::Yes)),
            }
        }
        if options.short && (options.write || !options.folders.is_empty()) {
            bail!("--short is of the repository's flights alone and writes nothing");
        }
        Ok(options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Flights> {
        Flights::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn folders_are_known_to_whoever_chose_the_limits_unless_it_is_said_otherwise() {
        let folders = parse("dev --unseen frozen --write").unwrap().folders;
        assert_eq!(folders, [("dev".into(), Known::Yes), ("frozen".into(), Known::No)]);
        for line in ["--unseen", "--unsen frozen", "--short --write", "--short dev"] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
