//! The header of an image: its first block in the update file and in flash.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 8 | `HUMSAPP1`. In flash its first word is written last: with it the image is complete |
//! | 8 | 4 | bytes of the image behind the header: whole words |
//! | 12 | 4 | version: major, minor, patch (16 bits), as one number |
//! | 16 | 4 | oldest version that may follow this image |
//! | 20 | 4 | CRC-32 of the image |
//! | 24 | 32 | name of the board, filled with zeros |
//! | 56 | 16 | commit, filled with zeros |
//! | 72 | 8 | first bytes of the public key; zeros: not signed |
//! | 80 | 64 | Ed25519 signature over bytes 0 to 79 and the image |
//! | 144 | 4 | not signed: `0xFFFFFFFF`, or the number of a wish for an image that others replaced (`hums box update --older`) |
//! | 148 | 360 | `0xFF` |
//! | 508 | 4 | CRC-32 of all before |
//!
//! Numbers are little-endian. An image without a signature is for a cable only.

use ed25519_compact::{PublicKey, Signature, VerifyingState};

use crate::crc32;
use crate::map::APPLICATION_BYTES;

/// Bytes of the header: a block of a card. The vector table behind it is aligned to as many (ARMv7-M, B3.2.5).
pub const BYTES: usize = 512;
/// First bytes of an image.
pub const MAGIC: [u8; 8] = *b"HUMSAPP1";
/// Bytes of a board's name.
pub const BOARD_BYTES: usize = 32;
/// Bytes of a commit's name.
pub const COMMIT_BYTES: usize = 16;
/// Bytes of a key's name.
pub const KEY_BYTES: usize = 8;

/// A header as it was released.
pub const NO_WISH: u32 = u32::MAX;

const SIGNED: usize = 80;
const SIGNATURE: core::ops::Range<usize> = SIGNED..SIGNED + 64;
const WISH: usize = SIGNATURE.end;
const CHECKED: usize = BYTES - 4;

/// A version as one number: a newer one is greater.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version(pub u32);

impl Version {
    /// Reads `major.minor.patch`; `None` for another text.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('.');
        let mut part = |max: u32| parts.next()?.parse::<u32>().ok().filter(|part| *part <= max);
        let version = part(0xFF)? << 24 | part(0xFF)? << 16 | part(0xFFFF)?;
        parts.next().is_none().then_some(Self(version))
    }
}

impl core::fmt::Display for Version {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}.{}.{}", self.0 >> 24, self.0 >> 16 & 0xFF, self.0 & 0xFFFF)
    }
}

/// A header without an error of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Bytes of the image behind the header.
    pub image_bytes: u32,
    /// Of the firmware.
    pub version: Version,
    /// Oldest version that may follow it.
    pub floor: Version,
    /// CRC-32 of the image.
    pub image_crc: u32,
    /// The board's name, filled with zeros.
    pub board: [u8; BOARD_BYTES],
    /// The commit, filled with zeros.
    pub commit: [u8; COMMIT_BYTES],
    /// First bytes of the public key.
    pub key: [u8; KEY_BYTES],
    /// Over the fields above and the image.
    pub signature: [u8; 64],
    /// Number of a wish for this image; [`NO_WISH`]: an older or a replaced one is not installed.
    pub wish: u32,
}

/// A fault of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// No file, or the card does not answer.
    NoFile,
    /// Its header or its length is wrong.
    Damaged,
    /// It is for another board.
    OtherBoard,
    /// It is older than the floor.
    TooOld,
    /// None of the public keys has its name: signed by somebody else, or not at all.
    ForeignKey,
    /// Its signature does not fit.
    BadSignature,
    /// It failed on trial.
    FailedBefore,
    /// It was confirmed, and another one took its place.
    Replaced,
    /// The flash did not take it.
    Flash,
}

impl Refusal {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::NoFile,
        Self::Damaged,
        Self::OtherBoard,
        Self::TooOld,
        Self::ForeignKey,
        Self::BadSignature,
        Self::FailedBefore,
        Self::Replaced,
        Self::Flash,
    ];
}

impl Header {
    /// A header without a signature. A long name is cut.
    pub fn new(board: &str, commit: &str, version: Version, floor: Version, image: &[u8]) -> Self {
        Self {
            image_bytes: image.len() as u32,
            version,
            floor,
            image_crc: crc32(0, image),
            board: padded(board),
            commit: padded(commit),
            key: [0; KEY_BYTES],
            signature: [0; 64],
            wish: NO_WISH,
        }
    }

    /// Signs the header with its image, the same each time.
    #[cfg(any(test, feature = "sign"))]
    pub fn sign(&mut self, image: &[u8], key: &ed25519_compact::SecretKey) {
        self.key.copy_from_slice(&key.public_key()[..KEY_BYTES]);
        let mut message = alloc::vec::Vec::from(&self.bytes()[..SIGNED]);
        message.extend_from_slice(image);
        self.signature.copy_from_slice(&*key.sign(message, None));
    }

    /// The block.
    pub fn bytes(&self) -> [u8; BYTES] {
        let mut block = [0xFF; BYTES];
        let mut rest = &mut block[..];
        let mut put = |bytes: &[u8]| {
            let (to, behind) = core::mem::take(&mut rest).split_at_mut(bytes.len());
            to.copy_from_slice(bytes);
            rest = behind;
        };
        put(&MAGIC);
        for number in [self.image_bytes, self.version.0, self.floor.0, self.image_crc] {
            put(&number.to_le_bytes());
        }
        put(&self.board);
        put(&self.commit);
        put(&self.key);
        put(&self.signature);
        put(&self.wish.to_le_bytes());
        let crc = crc32(0, &block[..CHECKED]);
        block[CHECKED..].copy_from_slice(&crc.to_le_bytes());
        block
    }

    /// Reads the block; `None` if it is no header, or damaged, or if its image does not fit the region.
    pub fn read(block: &[u8]) -> Option<Self> {
        let block: &[u8; BYTES] = block.first_chunk()?;
        let word = |at: usize| u32::from_le_bytes([block[at], block[at + 1], block[at + 2], block[at + 3]]);
        if !block.starts_with(&MAGIC) || word(CHECKED) != crc32(0, &block[..CHECKED]) {
            return None;
        }
        let header = Self {
            image_bytes: word(8),
            version: Version(word(12)),
            floor: Version(word(16)),
            image_crc: word(20),
            board: *block[24..].first_chunk()?,
            commit: *block[56..].first_chunk()?,
            key: *block[72..].first_chunk()?,
            signature: *block[SIGNATURE].first_chunk()?,
            wish: word(WISH),
        };
        let fits = (8..=APPLICATION_BYTES - BYTES).contains(&(header.image_bytes as usize));
        (fits && header.image_bytes.is_multiple_of(4)).then_some(header)
    }

    /// Tells images apart: the CRC-32 of the header, which covers that of the image.
    pub fn id(&self) -> u32 {
        self.bytes().last_chunk().map_or(0, |crc| u32::from_le_bytes(*crc))
    }

    /// The name of the board; empty if it is no text.
    pub fn board(&self) -> &str {
        text(&self.board)
    }

    /// Whether both have the same image, whoever signed it.
    pub fn has_image_of(&self, other: &Self) -> bool {
        let image = |header: &Self| (header.image_bytes, header.image_crc, header.version, header.commit);
        image(self) == image(other)
    }

    /// The commit; empty if it is no text.
    pub fn commit(&self) -> &str {
        text(&self.commit)
    }

    /// All but the signature: board, version and key.
    pub fn check(&self, board: &str, floor: Version, keys: &[[u8; 32]]) -> Result<[u8; 32], Refusal> {
        if self.board() != board {
            return Err(Refusal::OtherBoard);
        }
        if self.version < floor {
            return Err(Refusal::TooOld);
        }
        keys.iter().find(|key| key.starts_with(&self.key)).copied().ok_or(Refusal::ForeignKey)
    }

    /// The check of the signature by `key`, for the parts of the image.
    pub fn verify(&self, key: &[u8; 32]) -> Result<Check, Refusal> {
        let state = PublicKey::new(*key).verify_incremental(&Signature::new(self.signature));
        let mut state = state.map_err(|_| Refusal::BadSignature)?;
        state.absorb(&self.bytes()[..SIGNED]);
        Ok(Check { state, left: self.image_bytes })
    }
}

/// A check of a signature in progress.
pub struct Check {
    state: VerifyingState,
    left: u32,
}

impl Check {
    /// The next part of the image.
    pub fn absorb(&mut self, part: &[u8]) {
        self.left = self.left.wrapping_sub(part.len() as u32);
        self.state.absorb(part);
    }

    /// Compares the sum after the last part.
    pub fn finish(self) -> Result<(), Refusal> {
        if self.left == 0 && self.state.verify().is_ok() { Ok(()) } else { Err(Refusal::BadSignature) }
    }
}

fn padded<const LENGTH: usize>(text: &str) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    for (to, from) in bytes.iter_mut().zip(text.bytes()) {
        *to = from;
    }
    bytes
}

fn text(bytes: &[u8]) -> &str {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    bytes.get(..end).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or("")
}
