//! The update file of a board: header and image, signed (`hums_update::header`).

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
pub(crate) use ed25519_compact::SecretKey;
use ed25519_compact::{KeyPair, Seed};
use hums_update::header::{Header, Version};
use hums_update::{FLOOR, keys, map};

use crate::firmware::Board;
use crate::image::{self, Piece};
use crate::repo;

/// Everybody has its secret.
const TEST_KEY: &str = "firmware/update/keys/test.key";

/// Header and image of an application.
pub(crate) fn file(
    board: &Board,
    pieces: &[Piece],
    commit: &str,
    key: Option<&SecretKey>,
) -> Result<Vec<u8>> {
    if pieces.first().is_none_or(|piece| piece.address != map::VECTORS) {
        bail!("the application does not begin at {:#010x}: see memory.x", map::VECTORS);
    }
    let mut image = image::flat(pieces);
    image.resize(image.len().next_multiple_of(4), 0xFF);
    let version = |text: &str| {
        Version::parse(text).with_context(|| format!("{text} is no version: give MAJOR.MINOR.PATCH"))
    };
    let (now, floor) = (version(env!("CARGO_PKG_VERSION"))?, version(FLOOR)?);
    let mut header = Header::new(&board.name, commit, now, floor, &image);
    if let Some(key) = key {
        header.sign(&image, key);
    }
    let file = [&header.bytes()[..], &image].concat();
    if Header::read(&file).as_ref() != Some(&header) || file.len() > map::APPLICATION_BYTES {
        bail!("the application does not fit its region: see memory.x");
    }
    Ok(file)
}

pub(crate) fn test_key() -> Result<SecretKey> {
    read_key(&repo::root().join(TEST_KEY))
}

pub(crate) fn release_key(path: &Path) -> Result<SecretKey> {
    let key = read_key(path)?;
    let public = *key.public_key();
    if public == keys::TEST {
        bail!("{}: this is the test key, which everybody has. A release wants another one", path.display());
    }
    if !keys::ALL.contains(&public) {
        let digits = public.map(|byte| format!("{byte:02x}")).concat();
        bail!("{}: no box takes this key. Put {digits} into firmware/update/keys/NAME.pub", path.display());
    }
    Ok(key)
}

/// A seed of 64 hexadecimal digits (RFC 8032, 5.1.5).
fn read_key(path: &Path) -> Result<SecretKey> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let digits = text.trim();
    let byte = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    let seed: Option<Vec<u8>> = (0..digits.len()).step_by(2).map(byte).collect();
    let pair = seed.and_then(|seed| KeyPair::try_from_seed(Seed::from_slice(&seed).ok()?).ok());
    let pair = pair.with_context(|| format!("{}: needs 64 hexadecimal digits", path.display()))?;
    Ok(pair.sk)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_key_signs_and_a_release_refuses_it() {
        let key = test_key().unwrap();
        assert_eq!(*key.public_key(), keys::TEST);
        let why = release_key(&repo::root().join(TEST_KEY)).unwrap_err().to_string();
        assert!(why.contains("this is the test key"), "{why}");
        let path = std::env::temp_dir().join(format!("hums-own-{}.key", std::process::id()));
        for (text, wanted) in [("11".repeat(32), "no box takes this key"), ("1".repeat(63), "64 hexadecimal")]
        {
            fs::write(&path, text).unwrap();
            let why = release_key(&path).unwrap_err().to_string();
            assert!(why.contains(wanted), "{why}");
        }
        fs::remove_file(&path).unwrap();
    }

    #[test]
    fn an_update_file_is_the_header_and_the_signed_image() {
        let board = crate::firmware::default_board();
        let pieces = [Piece { address: map::VECTORS, bytes: vec![7; 1_001] }];
        let key = test_key().unwrap();
        let file = file(board, &pieces, "0123456789ab", Some(&key)).unwrap();
        let header = Header::read(&file).unwrap();
        assert_eq!(
            (header.board(), header.commit(), header.image_bytes),
            (&*board.name, "0123456789ab", 1_004)
        );
        let mut check = header.verify(&keys::TEST).unwrap();
        check.absorb(&file[512..]);
        assert_eq!(check.finish(), Ok(()));
        let elsewhere = [Piece { address: map::VECTORS + 4, bytes: vec![7; 8] }];
        assert!(super::file(board, &elsewhere, "", None).is_err());
        let large = [Piece { address: map::VECTORS, bytes: vec![7; map::APPLICATION_BYTES] }];
        assert!(super::file(board, &large, "", None).is_err());
    }
}
