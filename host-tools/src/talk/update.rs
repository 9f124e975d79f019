//! `hums box update`: an update file onto a card, for the box to install.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::{Result, bail};
use hums_update::header::{self, Header, Version};
use hums_update::{keys, map};
use serde::Serialize;

use super::of_newest;
use crate::cli;
use crate::files::{read_short, settle};
use crate::outcome::Outcome;
use crate::output::{self, Schema};

/// On the card: the update, the one before it, and one that is being written.
const UPDATE: &str = "HUMS.UPD";
const PREVIOUS: &str = "HUMS.OLD";
const PARTIAL: &str = "HUMS.NEW";

const SCHEMA: Schema = Schema::first("hums-box-update");

#[derive(Debug, Serialize)]
struct UpdateJson {
    /// Of the file.
    board: String,
    firmware_version: String,
    commit: String,
    /// Signed by the test key, which only development builds take.
    is_test: bool,
    /// Of the newest log on the card.
    box_version: Option<String>,
    /// Whether the card has another image for the same board, with a good signature.
    has_previous: bool,
    /// On the card.
    file: PathBuf,
}

/// Runs `hums box update`.
pub fn run(args: &cli::Update) -> Result<Outcome> {
    let name = args.image.display();
    let mut bytes = read_short(&args.image, map::APPLICATION_BYTES as u64)?;
    let mut header = judge(&bytes).map_err(|why| anyhow::anyhow!("{name}: {why}"))?;
    let version = header.version.to_string();
    let newest = of_newest(&args.card, |contents| {
        contents.boot.map(|boot| Newest { board: boot.board, version: boot.version, commit: boot.git })
    })?;
    if let Some(Newest { board, version: running, .. }) = &newest {
        if board != header.board() {
            bail!("{name} is for the board {}, and the card is of a box with {board}", header.board());
        }
        if Version::parse(running).is_some_and(|running| running > header.version) && !args.older {
            bail!("{name} has version {version}, and the box had {running}. Add --older to go back");
        }
    }
    if args.older {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        header.wish = now.as_secs() as u32;
        bytes[..header::BYTES].copy_from_slice(&header.bytes());
    }
    let file = put(&args.card, &bytes, newest.as_ref())?;
    let is_test = keys::TEST.starts_with(&header.key);
    let update = UpdateJson {
        board: header.board().to_owned(),
        firmware_version: version,
        commit: header.commit().to_owned(),
        is_test,
        box_version: newest.map(|newest| newest.version),
        has_previous: has_previous(&args.card, &header),
        file,
    };
    if args.json {
        output::json(SCHEMA, &update)?;
        return Ok(Outcome::Done);
    }
    let UpdateJson { board, firmware_version: version, commit, file, .. } = &update;
    output::line(&format!("{}: version {version} ({commit}) for {board}, signature good", file.display()))?;
    if is_test {
        output::line("It is signed by the test key: only a box with a development build takes it.")?;
    }
    if update.box_version.is_none() {
        output::line("No log on this card: board and version were not compared with those of the box.")?;
    }
    if !update.has_previous {
        output::line(
            "The card has no HUMS.OLD for this board: if the update fails, the box has no other version to go back to.",
        )?;
    }
    output::line(
        "Put the card into the box and switch on. It installs the file on the ground: disarmed for 10 s, or a minute without an autopilot.",
    )?;
    Ok(Outcome::Done)
}

/// The header of a whole file with a good signature.
fn judge(bytes: &[u8]) -> Result<Header, &'static str> {
    let header = Header::read(bytes).ok_or("is no update file of HUMS (hums-BOARD.upd of a release)")?;
    let image = bytes.get(header::BYTES..).unwrap_or_default();
    if image.len() != header.image_bytes as usize {
        return Err("is incomplete or too long: download it again");
    }
    let all = keys::ALL.iter().chain([&keys::TEST]);
    let key = all.into_iter().find(|key| key.starts_with(&header.key));
    let key = key.ok_or("is not signed by a key that a box knows")?;
    let good = header.verify(key).and_then(|mut check| {
        check.absorb(image);
        check.finish()
    });
    good.map(|()| header).map_err(|_| "is damaged or forged: its signature does not fit")
}

fn has_previous(card: &Path, header: &Header) -> bool {
    let previous = fs::read(card.join(PREVIOUS)).ok().and_then(|bytes| judge(&bytes).ok());
    previous.is_some_and(|previous| previous.board() == header.board() && !header.has_image_of(&previous))
}

struct Newest {
    board: String,
    version: String,
    commit: String,
}

impl Newest {
    /// Whether this image wrote it. A release's header has more of the commit's digits.
    fn is_of(&self, header: &Header) -> bool {
        let is_commit = !self.commit.is_empty() && header.commit().starts_with(&self.commit);
        is_commit && Version::parse(&self.version) == Some(header.version)
    }
}

/// Written whole under another name first. The update that is there becomes the one before, if it wrote the newest log.
fn put(card: &Path, bytes: &[u8], newest: Option<&Newest>) -> Result<PathBuf> {
    let [update, previous, partial] = [UPDATE, PREVIOUS, PARTIAL].map(|name| card.join(name));
    let mut file = settle(File::create(&partial), &partial)?;
    settle(file.write_all(bytes).and_then(|()| file.sync_all()), &partial)?;
    drop(file);
    let before = fs::read(&update).ok().and_then(|before| judge(&before).ok());
    let ran = |before: &Header| newest.is_some_and(|newest| newest.is_of(before));
    let is_same = |before: &Header| Header::read(bytes).is_some_and(|new| new.has_image_of(before));
    if before.is_some_and(|before| ran(&before) && !is_same(&before)) {
        settle(fs::rename(&update, &previous), &previous)?;
    }
    settle(fs::rename(&partial, &update), &update)?;
    Ok(update)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8032's first test vector is no key of a box; `firmware/update/keys/test.key` is.
    fn signed(number: u8) -> Vec<u8> {
        let commit = format!("{number:02}{:014}", 0);
        let text = include_str!("../../../firmware/update/keys/test.key");
        let seed: Vec<u8> = (0..64)
            .step_by(2)
            .map(|at| u8::from_str_radix(&text[at..at + 2], 16).expect("hexadecimal"))
            .collect();
        let pair =
            ed25519_compact::KeyPair::from_seed(ed25519_compact::Seed::from_slice(&seed).expect("32 bytes"));
        let image = [number; 64];
        let mut header = Header::new("matek-f405-std", &commit, Version(0x0001_0000), Version(0), &image);
        header.sign(&image, &pair.sk);
        [&header.bytes()[..], &image].concat()
    }

    #[test]
    fn a_wrong_file_is_refused_with_its_reason() {
        let good = signed(1);
        assert_eq!(judge(&good).expect("good").board(), "matek-f405-std");
        let mut forged = good.clone();
        forged[520] ^= 1;
        for (file, wanted) in [
            (&good[..100], "no update file"),
            (&good[..good.len() - 1], "incomplete"),
            (&forged[..], "signature does not fit"),
        ] {
            assert!(judge(file).expect_err("refused").contains(wanted), "{wanted}");
        }
        let mut unsigned = Header::read(&good).expect("a header");
        unsigned.key = *b"somebody";
        let unsigned = [&unsigned.bytes()[..], &good[512..]].concat();
        assert!(judge(&unsigned).expect_err("refused").contains("not signed by a key"));
    }

    #[test]
    fn the_update_that_ran_stays_on_the_card_and_one_that_failed_does_not_take_its_place() {
        let dir = tempfile::tempdir().expect("a folder");
        let read = |name: &str| fs::read(dir.path().join(name)).ok();
        let ran = |file: u8| Newest {
            board: String::new(),
            version: "0.1.0".into(),
            commit: format!("{file:02}{:010}", 0),
        };
        let other = Newest { commit: "abc".into(), ..ran(1) };
        for (file, newest, previous) in [
            (1, None, None),
            (2, Some(ran(1)), Some(1)),
            (2, Some(ran(2)), Some(1)),
            // The update failed: the box runs the first one.
            (3, Some(other), Some(1)),
            (4, None, Some(1)),
            (5, Some(Newest { version: "0.2.0".into(), ..ran(4) }), Some(1)),
            (6, Some(ran(5)), Some(5)),
        ] {
            put(dir.path(), &signed(file), newest.as_ref()).expect("written");
            assert_eq!(read(UPDATE), Some(signed(file)));
            assert_eq!(read(PREVIOUS), previous.map(signed));
            assert_eq!(read(PARTIAL), None);
        }
        fs::write(dir.path().join(UPDATE), b"damaged").expect("written");
        put(dir.path(), &signed(7), Some(&ran(7))).expect("written");
        assert_eq!(read(PREVIOUS), Some(signed(5)), "a damaged file is not kept");
    }
}
