//! Results on standard output. A reader that has gone away ends the program quietly (see [`ReaderGone`]), where
//! `println!` would panic.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock};

use anyhow::Result;
use serde::Serialize;

use crate::colour;
use crate::outcome::ReaderGone;
use crate::printable;

static TAKEN: AtomicBool = AtomicBool::new(false);

/// Folders of this computer that are shown by other names.
static ALIASES: RwLock<Vec<(String, String)>> = RwLock::new(Vec::new());

/// From now on paths in `folder` are shown below `name`: the folder has copies of distant files.
pub fn alias(folder: &Path, name: &str) {
    let alias = (folder.display().to_string(), name.to_owned());
    ALIASES.write().unwrap_or_else(PoisonError::into_inner).push(alias);
}

/// A text with the names by which folders are shown.
pub fn aliased(text: &str) -> Cow<'_, str> {
    let aliases = ALIASES.read().unwrap_or_else(PoisonError::into_inner);
    aliases.iter().fold(text.into(), |text, (folder, name)| text.replace(folder, name).into())
}

/// Reserves standard output for a command's output: results go to standard error from now on.
pub fn leave_standard_output() {
    TAKEN.store(true, Ordering::Relaxed);
}

/// Name and version of the output of `--json`. The version rises when a name goes or changes its meaning, not when
/// one is added (`docs/json.md`).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Schema {
    schema: &'static str,
    version: u32,
}

impl Schema {
    /// The first version of a command's object.
    pub const fn first(schema: &'static str) -> Self {
        Self { schema, version: 1 }
    }
}

#[derive(Serialize)]
struct Named<'a, T> {
    #[serde(flatten)]
    schema: Schema,
    #[serde(flatten)]
    value: &'a T,
}

/// Prints one line, or several, with the colours of its levels, and without control characters from foreign texts.
pub fn line(text: &str) -> Result<()> {
    raw_line(&colour::shown(&printable::lines(text), is_in_colour()))
}

/// Whether results go to a terminal that wants colours.
pub fn is_in_colour() -> bool {
    let choice = if TAKEN.load(Ordering::Relaxed) {
        anstream::AutoStream::choice(&io::stderr())
    } else {
        anstream::AutoStream::choice(&io::stdout())
    };
    choice != anstream::ColorChoice::Never
}

/// Prints a text made for a terminal, with escape sequences. It must have no foreign text.
pub fn terminal_only(text: &str) -> Result<()> {
    raw_line(text)
}

/// Prints a line of JSON.
pub fn json_line(text: &str) -> Result<()> {
    raw_line(&printable::json(text))
}

/// Says something on standard error, with our name before it.
pub fn note(text: &str) {
    aside(&format!("hums: {}", printable::message(text)));
}

/// Prints a line on standard error. One that is gone, or lies on a full disk, changes nothing: `eprintln!` would panic, in the middle of
/// a recording too.
pub fn aside(text: &str) {
    let _ = io::stderr().lock().write_all(format!("{}\n", aliased(text)).as_bytes());
}

fn raw_line(text: &str) -> Result<()> {
    print(&format!("{text}\n"))?;
    settle(io::stdout().lock().flush())
}

/// Prints one JSON object, indented.
pub fn json(schema: Schema, value: &impl Serialize) -> Result<()> {
    json_line(&serde_json::to_string_pretty(&Named { schema, value })?)
}

/// The JSON as the text of a file.
pub fn json_text(schema: Schema, value: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(&Named { schema, value })?))
}

/// A JSON object that is printed step by step: some members, then a list that is too long for memory. It prints the
/// same text as [`json`].
pub struct JsonList {
    empty: bool,
}

impl JsonList {
    /// Prints the schema, further members, and the beginning of the list.
    pub fn begin(schema: Schema, members: &impl Serialize, list: &str) -> Result<Self> {
        let before = serde_json::to_string_pretty(&Named { schema, value: members })?;
        print(&format!("{},\n  \"{list}\": [", printable::json(before.trim_end_matches("\n}"))))?;
        Ok(Self { empty: true })
    }

    /// Prints an element of the list.
    pub fn element(&mut self, value: &impl Serialize) -> Result<()> {
        let comma = if self.empty { "" } else { "," };
        self.empty = false;
        print(&format!("{comma}\n    {}", indented(value, "    ")?))
    }

    /// Prints the end of the list and of the object.
    pub fn end(self) -> Result<()> {
        raw_line(&format!("{}\n}}", self.end_of_list()))
    }

    /// Prints the end of the list, a last member, which is known only now, and the end of the object.
    pub fn end_with(self, name: &str, value: &impl Serialize) -> Result<()> {
        raw_line(&format!("{},\n  \"{name}\": {}\n}}", self.end_of_list(), indented(value, "  ")?))
    }

    fn end_of_list(&self) -> &'static str {
        if self.empty { "]" } else { "\n  ]" }
    }
}

/// A value as JSON whose lines after the first begin so. No string of JSON has a line's end in it.
fn indented(value: &impl Serialize, by: &str) -> Result<String> {
    Ok(printable::json(&serde_json::to_string_pretty(value)?).replace('\n', &format!("\n{by}")))
}

fn print(text: &str) -> Result<()> {
    let text = aliased(text);
    let bytes = text.as_bytes();
    // `anstream` has an older Windows show colours too.
    settle(match (TAKEN.load(Ordering::Relaxed), is_in_colour()) {
        (true, true) => anstream::stderr().lock().write_all(bytes),
        (true, false) => io::stderr().lock().write_all(bytes),
        (false, true) => anstream::stdout().lock().write_all(bytes),
        (false, false) => io::stdout().lock().write_all(bytes),
    })
}

/// A broken pipe on standard output becomes [`ReaderGone`].
pub fn settle(result: io::Result<()>) -> Result<()> {
    result.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => ReaderGone.into(),
        _ => anyhow::Error::new(error).context("standard output"),
    })
}

/// Standard output as a writer that reports a broken pipe as [`ReaderGone`] inside the `io::Error`.
#[derive(Debug)]
pub struct Stdout(io::Stdout);

impl Default for Stdout {
    fn default() -> Self {
        Self(io::stdout())
    }
}

fn gone(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::BrokenPipe { io::Error::other(ReaderGone) } else { error }
}

impl Write for Stdout {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.0.write(buffer).map_err(gone)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush().map_err(gone)
    }
}
