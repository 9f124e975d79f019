//! The sector: 512 bytes with an identity and a check, so that a torn, stale, flipped or missing one is always
//! noticed.
//!
//! ```text
//!   0  magic 0x48 'H'
//!   1  0xB0 | format version (3)
//!   2  bits 0..=5: sectors since the first of the group; bit 6: partial; bit 7: closed
//!   3  u16: bits 0..=8: bytes of the body in use; bits 9..=15: records completed
//!   5  u16: frames completed
//!   7  u32: session
//!  11  u32: number, counted from 0 in the session
//!  15  u32: check of the session's entries that are complete with this sector ([`crate::chain`])
//!  19  body, 489 bytes
//! 508  u32: CRC-32C of bytes 0..508
//! ```
//! Integers are little endian. *Completed* counts the entries that can be decoded once this sector and those before
//! it in its group are there. *Partial* marks a copy of a sector still in progress: a later, fuller version with the
//! same number supersedes it. *Closed* marks the last sector of a session that ended in order.

use zerocopy::FromZeros;

use crate::crc::crc32c;
use crate::preamble::Preamble;

/// Bytes of a sector: a block of an SD card.
pub const SECTOR_BYTES: usize = 512;

/// Sectors of a group at most: 32 KiB.
pub const GROUP_SECTORS: usize = 64;

/// Bytes of a sector's body.
pub const BODY_BYTES: usize = CRC_AT - BODY_AT;

/// The format's version.
pub const VERSION: u8 = 3;

pub(crate) const BODY_AT: usize = 19;
const CRC_AT: usize = SECTOR_BYTES - 4;
const MAGIC: u8 = b'H';
/// Byte 1, with the format version.
const PLAIN: u8 = 0xb0;
const SEALED: u8 = 0xa0;
const PARTIAL: u8 = 0x40;
const CLOSED: u8 = 0x80;
const SINCE_FIRST: u8 = 0x3f;

pub(crate) const RECORDS_MAX: u8 = 127;

const _: () = assert!(GROUP_SECTORS == SINCE_FIRST as usize + 1 && BODY_BYTES < 1 << 9);

/// One sector of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sector {
    bytes: [u8; SECTOR_BYTES],
}

impl Default for Sector {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Sector {
    /// All zeros, an invalid sector.
    pub const fn zeroed() -> Self {
        Self { bytes: [0; SECTOR_BYTES] }
    }

    /// `Header::read` checks them.
    pub const fn from_bytes(bytes: [u8; SECTOR_BYTES]) -> Self {
        Self { bytes }
    }

    /// The last step before it is written.
    pub fn seal(&mut self, session: u32) {
        self.bytes[7..11].copy_from_slice(&session.to_le_bytes());
        let crc = crc32c(&self.bytes[..CRC_AT]);
        self.bytes[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
    }

    pub(crate) fn made_again(bytes: &[u8; SECTOR_BYTES], session: u32, number: u32) -> Self {
        let mut sector = Self { bytes: *bytes };
        (sector.bytes[0], sector.bytes[1]) = (MAGIC, PLAIN | VERSION);
        sector.bytes[11..15].copy_from_slice(&number.to_le_bytes());
        sector.seal(session);
        sector
    }

    /// The bytes to write.
    pub const fn bytes(&self) -> &[u8; SECTOR_BYTES] {
        &self.bytes
    }

    /// A copy in progress: a later one with its number supersedes it.
    pub const fn is_partial(&self) -> bool {
        self.bytes[2] & PARTIAL != 0
    }

    /// The last one of a log that ended in order.
    pub const fn is_closed(&self) -> bool {
        self.bytes[2] & CLOSED != 0
    }

    /// Marks a copy in progress; to be sealed after that.
    pub const fn set_partial(&mut self, partial: bool) {
        self.bytes[2] = self.bytes[2] & !PARTIAL | if partial { PARTIAL } else { 0 };
    }

    /// Reading can start here.
    pub const fn starts_group(&self) -> bool {
        self.bytes[2] & SINCE_FIRST == 0
    }

    /// The sector's number in its session, from 0.
    pub fn number(&self) -> u32 {
        self.u32_at(11)
    }

    /// 0 before it is sealed.
    pub fn session(&self) -> u32 {
        self.u32_at(7)
    }

    /// Completed frames.
    pub fn frames(&self) -> u16 {
        u16::from_le_bytes([self.bytes[5], self.bytes[6]])
    }

    /// `None` if no group begins.
    pub fn preamble(&self) -> Option<Preamble> {
        Preamble::read(self.body()).filter(|_| self.starts_group())
    }

    pub(crate) fn body(&self) -> &[u8] {
        &self.bytes[BODY_AT..CRC_AT]
    }

    pub(crate) fn body_mut(&mut self) -> &mut [u8] {
        &mut self.bytes[BODY_AT..CRC_AT]
    }

    pub(crate) fn set_header(&mut self, header: &Header) {
        let flags = if header.partial { PARTIAL } else { 0 } | if header.closed { CLOSED } else { 0 };
        let body_bytes = (header.body_bytes).min(BODY_BYTES);
        let lengths = body_bytes as u16 | u16::from(header.records.min(RECORDS_MAX)) << 9;
        self.bytes[0] = MAGIC;
        self.bytes[1] = PLAIN | VERSION;
        self.bytes[2] = flags | (header.since_first & SINCE_FIRST);
        self.bytes[3..5].copy_from_slice(&lengths.to_le_bytes());
        self.bytes[5..7].copy_from_slice(&header.frames.to_le_bytes());
        self.bytes[7..11].copy_from_slice(&header.session.to_le_bytes());
        self.bytes[11..15].copy_from_slice(&header.number.to_le_bytes());
        self.bytes[15..19].copy_from_slice(&header.check.to_le_bytes());
        self.body_mut()[body_bytes..].fill(0);
    }

    fn u32_at(&self, at: usize) -> u32 {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&self.bytes[at..at + 4]);
        u32::from_le_bytes(bytes)
    }
}

/// Header of a sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, FromZeros)]
pub struct Header {
    /// Others are left over from an earlier file.
    pub session: u32,
    /// The sector's number in its session, from 0.
    pub number: u32,
    /// How many sectors after the first one of its group it is: 0 to 63.
    pub since_first: u8,
    /// A copy of a sector in progress: the group is readable up to here and no further.
    pub partial: bool,
    /// The last sector of a session that was ended in order.
    pub closed: bool,
    /// Bytes of the body in use, at most `BODY_BYTES`.
    pub body_bytes: usize,
    /// Frames completed in it.
    pub frames: u16,
    /// Records completed in it, at most 127.
    pub records: u8,
    /// Over all entries of the session that are complete with it, as they came.
    pub check: u32,
}

/// The reason that a block is no sector of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotASector {
    /// All zeros: space that was set aside and not written yet.
    Empty,
    /// All ones: flash memory that was erased and not written, or whose writing failed.
    Erased,
    /// It does not begin as a sector does: parity ([`crate::parity`]), or some other file's data.
    Foreign,
    /// It begins as a sector of another format version does, and its check is right.
    OtherVersion(u8),
    /// It is sealed (encrypted or signed), and its check is right: a newer reader is needed.
    Sealed,
    /// It begins as a sector does, but the check (or a length in it) is wrong: torn or damaged.
    Damaged,
}

impl Header {
    /// Checks a block and reads its header.
    pub fn read(block: &[u8; SECTOR_BYTES]) -> Result<Self, NotASector> {
        // A search for lost logs calls this for each block of a card: it copies nothing before the magic byte fits.
        if block[0] != MAGIC {
            return Err(match block[0] {
                0 if *block == [0; SECTOR_BYTES] => NotASector::Empty,
                0xff if *block == [0xff; SECTOR_BYTES] => NotASector::Erased,
                _ => NotASector::Foreign,
            });
        }
        let sector = Sector { bytes: *block };
        let is_sound = || crc32c(&block[..CRC_AT]) == sector.u32_at(CRC_AT);
        if block[1] & 0xf0 == SEALED && is_sound() {
            return Err(NotASector::Sealed);
        }
        if block[1] & 0xf0 != PLAIN {
            return Err(NotASector::Foreign);
        }
        if !is_sound() {
            return Err(NotASector::Damaged);
        }
        if block[1] & 0x0f != VERSION {
            return Err(NotASector::OtherVersion(block[1] & 0x0f));
        }
        let lengths = u16::from_le_bytes([block[3], block[4]]);
        let body_bytes = usize::from(lengths & 0x1ff);
        if body_bytes > BODY_BYTES {
            return Err(NotASector::Damaged);
        }
        Ok(Self {
            session: sector.u32_at(7),
            number: sector.u32_at(11),
            since_first: block[2] & SINCE_FIRST,
            partial: block[2] & PARTIAL != 0,
            closed: block[2] & CLOSED != 0,
            body_bytes,
            frames: sector.frames(),
            records: (lengths >> 9) as u8,
            check: sector.u32_at(15),
        })
    }

    /// A group begins.
    pub const fn starts_group(&self) -> bool {
        self.since_first == 0
    }

    /// The sector that began the group.
    pub const fn group(&self) -> u32 {
        self.number.wrapping_sub(self.since_first as u32)
    }

    /// Completed entries.
    pub const fn entries(&self) -> u32 {
        self.frames as u32 + self.records as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> (Header, Sector) {
        let header = Header {
            session: 0x1234_5678,
            number: 70_000,
            since_first: 63,
            partial: true,
            closed: false,
            body_bytes: BODY_BYTES,
            frames: 65_535,
            records: 127,
            check: 0xfedc_ba98,
        };
        let mut sector = Sector::zeroed();
        sector.body_mut().fill(0xa5);
        sector.set_header(&header);
        sector.seal(header.session);
        (header, sector)
    }

    #[test]
    fn a_header_reads_back_with_every_field_at_its_end_of_range() {
        let (header, sector) = sample();
        assert_eq!(Header::read(sector.bytes()), Ok(header));
        assert_eq!((sector.number(), sector.frames(), sector.starts_group()), (70_000, 65_535, false));
        assert_eq!(header.group(), 70_000 - 63);
    }

    #[test]
    fn every_single_bit_error_is_noticed() {
        let (_, sector) = sample();
        for bit in 0..SECTOR_BYTES * 8 {
            let mut bytes = *sector.bytes();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(Header::read(&bytes).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn zeros_other_data_and_other_versions_are_told_apart() {
        assert_eq!(Header::read(&[0; SECTOR_BYTES]), Err(NotASector::Empty));
        assert_eq!(Header::read(&[0xff; SECTOR_BYTES]), Err(NotASector::Erased));
        assert_eq!(Header::read(&[7; SECTOR_BYTES]), Err(NotASector::Foreign));
        let (_, mut sector) = sample();
        sector.bytes[1] = 0xb1;
        assert_eq!(Header::read(sector.bytes()), Err(NotASector::Damaged));
        sector.seal(1);
        assert_eq!(Header::read(sector.bytes()), Err(NotASector::OtherVersion(1)));
        sector.bytes[1] = 0xa2;
        assert_eq!(Header::read(sector.bytes()), Err(NotASector::Foreign));
        sector.seal(1);
        assert_eq!(Header::read(sector.bytes()), Err(NotASector::Sealed));
    }
}
