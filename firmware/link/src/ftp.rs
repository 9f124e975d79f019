//! MAVLink FTP: requests of a client and the answers, byte for byte as in `FILE_TRANSFER_PROTOCOL`
//! (<https://mavlink.io/en/services/ftp.html>). Reading only.

use crc::{Algorithm, Crc, NoTable};

use crate::packet::Fields;

/// Bytes before the data.
pub const HEAD: usize = 12;
/// Bytes of data in one message.
pub const DATA_MAX: usize = 239;

/// The number of `CalcFileCRC32` (`MAV_FTP_OPCODE_CALCFILECRC`).
pub const CHECKSUM: u8 = 14;
/// The number of `BurstReadFile` (`MAV_FTP_OPCODE_BURSTREADFILE`).
pub const BURST: u8 = 15;

/// The CRC-32 of `CalcFileCRC32` in MAVLink FTP: the reflected polynomial of Ethernet, but from 0 and without a final
/// inversion. PX4 (`crc32part` with 0) and `ArduPilot` (`crc_crc32` with 0) compute it so. Bit by bit: a table would
/// take 1 KiB for a rare request.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&Algorithm {
    width: 32,
    poly: 0x04c1_1db7,
    init: 0,
    refin: true,
    refout: true,
    xorout: 0,
    check: 0x2dfd_2d88,
    residue: 0,
});

/// Known when the program is built.
pub const fn checksum_of(file: &[u8]) -> u32 {
    CRC.checksum(file)
}

/// The checksum of a file: `before` is the checksum of the bytes before `bytes`, 0 for the beginning.
pub fn checksum(before: u32, bytes: &[u8]) -> u32 {
    // The library takes its first value as the polynomial is written, and returns the reflected result.
    let mut digest = CRC.digest_with_initial(before.reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// The error (`MAV_FTP_ERR`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Error {
    /// Unspecified error.
    Fail = 1,
    /// No such session.
    InvalidSession = 4,
    /// Behind the last byte or the last entry.
    EndOfFile = 6,
    /// Not something that we do.
    UnknownCommand = 7,
    /// Logs are not written from outside.
    FileProtected = 9,
    /// No such file.
    FileNotFound = 10,
}

/// A client's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation<'a> {
    /// Nothing: an answer is all.
    None,
    /// Close the file.
    End,
    /// Entries of a directory, from this one on.
    List(&'a str, u32),
    /// Open a file.
    Open(&'a str),
    /// Bytes from an offset: offset and number.
    Read(u32, u8),
    /// Bytes from an offset to the end: offset and size of a message.
    Burst(u32, u8),
    /// The checksum of a file's first bytes; 0 is all of it, as in the protocol. A part is our own extension:
    /// `offset`, which has no other meaning here, is its length.
    Checksum(&'a str, u32),
    /// Writing of any kind.
    Write,
    /// Anything else.
    Unknown,
}

/// A client's message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FtpRequest<'a> {
    /// Counts up with each message, the answer's included.
    pub sequence: u16,
    /// The session that it is about.
    pub session: u8,
    /// The number of the operation, for the answer.
    pub opcode: u8,
    /// The requested operation.
    pub operation: Operation<'a>,
}

/// Reads a client's message.
pub fn read(payload: &[u8]) -> FtpRequest<'_> {
    let fields = Fields(payload);
    let (size, offset) = (fields.u8(4), fields.u32(8));
    let text = || fields.text(HEAD, usize::from(size)).unwrap_or_default();
    // 0 leaves it to us.
    let bytes = if size == 0 { DATA_MAX as u8 } else { size.min(DATA_MAX as u8) };
    let operation = match fields.u8(3) {
        0 => Operation::None,
        1 | 2 => Operation::End,
        3 => Operation::List(text(), offset),
        4 => Operation::Open(text()),
        5 => Operation::Read(offset, bytes),
        CHECKSUM => Operation::Checksum(text(), offset),
        BURST => Operation::Burst(offset, bytes),
        6..=13 => Operation::Write,
        _ => Operation::Unknown,
    };
    FtpRequest { sequence: fields.u16(0), session: fields.u8(2), opcode: fields.u8(3), operation }
}

/// An answer; its data is added by the caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FtpReply {
    /// One more than the message's that it answers, or than the answer's before it in a burst.
    pub sequence: u16,
    /// The session.
    pub session: u8,
    /// The operation that is answered.
    pub opcode: u8,
    /// Offset of the data; for a checksum, the number of covered bytes.
    pub offset: u32,
    /// The last one of a burst.
    pub complete: bool,
}

impl FtpReply {
    /// A reply to `asked`.
    pub const fn to(asked: &FtpRequest<'_>) -> Self {
        Self {
            sequence: asked.sequence.wrapping_add(1),
            session: asked.session,
            opcode: asked.opcode,
            offset: 0,
            complete: false,
        }
    }

    /// "Done", with data.
    pub fn ack<'a>(&self, data: &[u8], buffer: &'a mut [u8; HEAD + DATA_MAX]) -> &'a [u8] {
        self.put(128, data, buffer)
    }

    /// "Not done".
    pub fn nak<'a>(&self, error: Error, buffer: &'a mut [u8; HEAD + DATA_MAX]) -> &'a [u8] {
        self.put(129, &[error as u8], buffer)
    }

    fn put<'a>(&self, opcode: u8, data: &[u8], buffer: &'a mut [u8; HEAD + DATA_MAX]) -> &'a [u8] {
        let size = data.len().min(DATA_MAX);
        let [s0, s1] = self.sequence.to_le_bytes();
        let head = [s0, s1, self.session, opcode, size as u8, self.opcode, u8::from(self.complete), 0];
        buffer[..8].copy_from_slice(&head);
        buffer[8..HEAD].copy_from_slice(&self.offset.to_le_bytes());
        buffer[HEAD..HEAD + size].copy_from_slice(&data[..size]);
        &buffer[..HEAD + size]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_reads_as_the_protocol_says() {
        let asked = [7, 0, 0, 5, 100, 0, 0, 0, 0x10, 0x20, 0, 0];
        let asked = read(&asked);
        assert_eq!((asked.sequence, asked.operation), (7, Operation::Read(0x2010, 100)));
        let mut buffer = [0; HEAD + DATA_MAX];
        let reply = FtpReply { offset: 0x2010, ..FtpReply::to(&asked) };
        assert_eq!(reply.ack(&[1, 2], &mut buffer), [8, 0, 0, 128, 2, 5, 0, 0, 0x10, 0x20, 0, 0, 1, 2]);
        assert_eq!(reply.nak(Error::EndOfFile, &mut buffer)[3..5], [129, 1]);
    }

    #[test]
    fn a_checksum_is_the_one_that_autopilots_compute_in_one_piece_or_in_many() {
        // The check value of this CRC, by its definition bit by bit.
        let bitwise = b"123456789".iter().fold(0_u32, |crc, byte| {
            (0..8)
                .fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
        });
        assert_eq!((checksum(0, b"123456789"), bitwise), (0x2dfd_2d88, 0x2dfd_2d88));
        assert_eq!(checksum(checksum(checksum(0, b"1234"), b""), b"56789"), 0x2dfd_2d88);
        assert_eq!(checksum_of(b"123456789"), 0x2dfd_2d88);
    }

    #[test]
    fn whatever_comes_is_read() {
        assert_eq!(read(&[]).operation, Operation::None);
        assert_eq!(read(&[0, 0, 0, 4, 255]).operation, Operation::Open(""));
        assert_eq!(read(&[0, 0, 0, 9]).operation, Operation::Write);
        assert_eq!(read(&[0, 0, 0, 15]).operation, Operation::Burst(0, DATA_MAX as u8));
        assert_eq!(
            read(&[0, 0, 0, 14, 2, 0, 0, 0, 3, 0, 0, 0, b'a', b'b']).operation,
            Operation::Checksum("ab", 3)
        );
        assert_eq!(read(&[0, 0, 0, 200]).operation, Operation::Unknown);
    }
}
