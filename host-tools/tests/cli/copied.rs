//! Copies of logs from cards: all commands that read report the same about them, with the same exit code.

use std::fs;
use std::path::Path;

use hums_analysis::soundness::Soundness;
use hums_blackbox::Header;
use hums_blackbox::parity::Parity;
use tempfile::TempDir;

use crate::support::{attempt, end_of, made_once};

pub(crate) const BLOCK: usize = 512;
pub(crate) const SEGMENT: usize = 7_999 * BLOCK;

/// The commands that read; the first one is the judge.
const READERS: [&str; 5] =
    ["info --verify", "decode -o out --format csv", "report -o pages/", "info", "check"];

/// A command with these inputs: its exit code and its output on both streams. A finding about the vehicle's health is
/// not damage.
fn read(dir: &Path, command: &'static str, inputs: &str) -> (&'static str, i32, String) {
    let ended = attempt(dir, &format!("{command} {inputs}"));
    for made in ["out", "pages"] {
        let _ = fs::remove_dir_all(dir.join(made));
    }
    let said = [ended.stdout, ended.stderr].concat();
    let code = ended.status.code().filter(|code| *code != 4).unwrap_or_default();
    (command, code, String::from_utf8_lossy(&said).into_owned())
}

pub(crate) fn readers(dir: &Path, inputs: &str) -> Vec<(&'static str, i32, String)> {
    READERS.map(|command| read(dir, command, inputs)).to_vec()
}

/// They end with this code and print this: the judge, and by the words one of the others. All print one list of
/// findings; [`each_says`] tries that.
#[track_caller]
pub(crate) fn all_say(dir: &Path, inputs: &str, code: i32, words: &[&str]) {
    let turn = words.iter().flat_map(|words| words.bytes()).map(usize::from).sum::<usize>() % 4;
    assert_said([READERS[0], READERS[1 + turn]].map(|command| read(dir, command, inputs)), code, words);
}

#[track_caller]
pub(crate) fn each_says(dir: &Path, inputs: &str, code: i32, words: &[&str]) {
    assert_said(readers(dir, inputs), code, words);
}

/// The states that a log has in the words of the program, as far as this prints them.
fn states(said: &str) -> Vec<&'static str> {
    use Soundness as S;
    let all = [S::Repaired, S::Unprotected, S::NotProved, S::NotFrames, S::Lossy, S::Damaged];
    all.map(Soundness::words).into_iter().filter(|words| said.contains(words)).collect()
}

#[track_caller]
fn assert_said(ended: impl IntoIterator<Item = (&'static str, i32, String)>, code: i32, words: &[&str]) {
    let mut known = None;
    for (command, ended, said) in ended {
        if ["info --verify", "info", "check"].contains(&command) {
            let states = states(&said);
            assert_eq!(*known.get_or_insert_with(|| states.clone()), states, "hums {command}: {said}");
        }
        assert_eq!(ended, code, "hums {command}: {said}");
        for words in words {
            assert!(said.contains(words), "hums {command}: `{words}` is not in {said}");
        }
    }
}

/// A folder `copied` with the first segments of a card's sessions, as a copy has them: each with its allocated
/// length.
pub(crate) fn copied(sessions: usize) -> TempDir {
    made_once(&format!("copied {sessions}"), |dir| copy(dir, sessions))
}

fn copy(dir: &Path, sessions: usize) {
    let recordings = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"].map(|name| end_of(name, dir));
    for session in 0..sessions {
        let recording = recordings[session % 2].display();
        attempt(dir, &format!("sim {recording} --sd card.img --card-size 64"));
    }
    let image = fs::read(dir.join("card.img")).expect("an image");
    let mut starts: Vec<usize> = Vec::new();
    let mut last = None;
    for (at, block) in image.as_chunks::<BLOCK>().0.iter().enumerate() {
        let session = block.starts_with(&[0x48, 0xb3]).then(|| block[7..11].to_vec());
        if session.is_some() && session != last {
            starts.push(at * BLOCK);
            last = session;
        }
    }
    assert_eq!(starts.len(), sessions);
    fs::create_dir(dir.join("copied")).expect("made");
    for (session, start) in (1..).zip(starts) {
        let name = format!("copied/{session:05}_00.HUM");
        fs::write(dir.join(name), &image[start..start + SEGMENT]).expect("written");
    }
}

/// The only log of a card's image or of a copy, up to the last of its parity, which ends it.
pub(crate) fn with_parity(file: &Path) -> Vec<u8> {
    let bytes = fs::read(file).expect("a log");
    let all = bytes.as_chunks::<BLOCK>().0;
    let begin = all.iter().position(|block| Header::read(block).is_ok()).expect("a sector");
    let end = all.iter().rposition(|block| Parity::read(block).is_some()).expect("parity") + 1;
    bytes[begin * BLOCK..end * BLOCK].to_vec()
}

pub(crate) fn without(bytes: &[u8], most: usize, with: u8) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let parity = bytes.as_chunks_mut::<BLOCK>().0.iter_mut().filter(|block| Parity::read(block).is_some());
    parity.take(most).for_each(|block| block.fill(with));
    bytes
}
