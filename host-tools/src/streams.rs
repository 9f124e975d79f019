//! Where standard output and standard error may lead. A shell sends them anywhere (`>> FILE`, `2>> FILE`, `1<> FILE`), and what
//! is said there is not to spoil what somebody has. Refused is, whatever the command, a stream that goes
//! 1. over bytes that are there (`1<>`),
//! 2. into a file that the command line names, or that is standard input,
//! 3. behind a recording, what this program made of one, or what is no text, wherever that lies: in a folder that is named, too.
//!
//! This is checked once, before anything is said, and nothing else is done then. What a command makes on standard output itself
//! (`-o -`) goes into an empty file only ([`crate::files::check_standard_output`]).

use std::ffi::{OsStr, OsString};
use std::path::Path;

use crate::decode::naming::{is_made, is_made_by_content};
use crate::files::{FileId, Folder, Opened, STANDARD_ERROR, STANDARD_INPUT, STANDARD_OUTPUT, descriptor};
use crate::source::find::is_no_text;

/// Refuses what standard output leads to; the words are for standard error.
pub fn check_output(words: &[OsString]) -> Result<(), String> {
    check(STANDARD_OUTPUT, words).map_err(|why| format!("standard output: {why}"))
}

/// Refuses what standard error leads to: then nothing may be said there.
pub fn check_error(words: &[OsString]) -> Result<(), String> {
    check(STANDARD_ERROR, words).map_err(|why| format!("standard error: {why}"))
}

fn check(number: u32, words: &[OsString]) -> Result<(), String> {
    let Some(opened) = Opened::of(number) else { return Ok(()) };
    opened.check()?;
    let why = match opened.id().and_then(|id| named(&id, words)) {
        Some(word) => format!("goes into {word}, which this command line names"),
        None if opened.is_empty() || !is_kept(&opened) => return Ok(()),
        None => {
            let path = opened.path();
            format!(
                "goes into {}, which is a recording, is what hums made of one, or is no text",
                path.display()
            )
        }
    };
    Err(format!("{why}; nothing was written; send it elsewhere"))
}

/// The word of a command line, or standard input, that is this file. A word that means the stream itself (`-o /dev/stdout`)
/// is none.
fn named(stream: &FileId, words: &[OsString]) -> Option<String> {
    let is_it = |word: &&OsStr| {
        let path = Path::new(*word);
        let is_stream = matches!(descriptor(path), Some(STANDARD_OUTPUT | STANDARD_ERROR));
        !is_stream && FileId::of(path).is_ok_and(|id| id == *stream)
    };
    let word = words.iter().flat_map(|word| spellings(word)).flatten().find(is_it);
    let is_input = || Opened::of(STANDARD_INPUT).and_then(|input| input.id()).is_some_and(|id| id == *stream);
    let name = word.map(|word| word.display().to_string());
    name.or_else(|| is_input().then(|| "standard input".to_owned()))
}

/// What a word may name: itself, `--flag=VALUE`, `-fVALUE`.
fn spellings(word: &OsStr) -> [Option<&OsStr>; 3] {
    let text = word.to_str();
    let behind_sign = text.and_then(|word| word.split_once('=')).map(|(_, value)| value);
    let behind_flag =
        text.and_then(|word| word.strip_prefix('-')?.get(1..)).filter(|value| !value.is_empty());
    [Some(word), behind_sign.map(OsStr::new), behind_flag.map(OsStr::new)]
}

/// Whether words behind what is in it would spoil it.
fn is_kept(opened: &Opened) -> bool {
    let (path, content) = (opened.path(), opened.content());
    // Tables lie in a folder that is ours.
    let is_table = || path.parent().is_some_and(|folder| Folder::made_of(folder).is_some());
    is_no_text(&path, &content) || is_made(&path) || is_table() || is_made_by_content(&content)
}
