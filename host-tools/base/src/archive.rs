//! Files that are not read but known by their first bytes: archives, compressed and encrypted logs, text in UTF-16.

/// First bytes, and advice: the end of a sentence that begins with the file's name.
const KNOWN: [(&[u8], &str); 8] = [
    (b"PK\x03\x04", "is a ZIP archive; unpack it, and give what is in it"),
    (b"\xfd7zXZ\0", "is compressed with xz; unpack it, or compress it with gzip instead"),
    (b"\x28\xb5\x2f\xfd", "is compressed with Zstandard; unpack it, or compress it with gzip instead"),
    (b"7z\xbc\xaf\x27\x1c", "is a 7-Zip archive; unpack it, and give what is in it"),
    (b"Rar!\x1a\x07", "is a RAR archive; unpack it, and give what is in it"),
    (
        b"ULogEnc",
        "is an encrypted log of PX4 (.ulge); decrypt it with the key of its vehicle (PX4: Tools/decrypt_ulog.py)",
    ),
    (b"PK\x05\x06", "is a ZIP archive with nothing in it"),
    (b"PK\x07\x08", "is a part of a ZIP archive; unpack it, and give what is in it"),
];
const BZIP2: &str = "is compressed with bzip2; unpack it, or compress it with gzip instead";
const TAR: &str = "is a tar archive; unpack it, and give what is in it";
const UTF_16: &str = "is text in UTF-16; a text log is read as UTF-8: convert it";
/// The first bytes of a gzip file (RFC 1952), with the only compression method there is.
pub const GZIP: [u8; 3] = [0x1f, 0x8b, 8];
/// Offset of the format's name in a tar's first header (POSIX.1-1988 and later, GNU).
const USTAR_AT: usize = 257;

/// PX4's logs from before 2017 look like ArduPilot's, with a format of another kind: its `TIME` is a message of its own.
const SDLOG2: &str = "is a log of PX4 from before 2017 (sdlog2, .px4log), which is not read; PX4's Tools/sdlog2/sdlog2_dump.py makes CSV of it";
/// The first bytes of such a log and of ArduPilot's: the definition of definitions.
const FMT: [u8; 3] = [0xA3, 0x95, 0x80];

/// The kind of a file with this beginning (some hundred bytes, some thousand of a log), and the advice for it, if
/// known.
pub fn hint(start: &[u8]) -> Option<&'static str> {
    if let Some((_, what)) = KNOWN.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Some(what);
    }
    if start.starts_with(&FMT) && is_sdlog2(start) {
        return Some(SDLOG2);
    }
    match *start.first_chunk()? {
        [b'B', b'Z', b'h', b'1'..=b'9'] => return Some(BZIP2),
        // FE FF alone is also the beginning of a MAVLink frame of version 1.
        [0xff, 0xfe, character, 0] | [0xfe, 0xff, 0, character] if character > 0 => return Some(UTF_16),
        _ => {}
    }
    start.get(USTAR_AT..).is_some_and(|start| start.starts_with(b"ustar")).then_some(TAR)
}

/// Whether a message `TIME` of one column is defined: all definitions stand first, 50 of 89 bytes.
fn is_sdlog2(start: &[u8]) -> bool {
    const DEFINITIONS_BYTES: usize = 16 * 1_024;
    let start = start.get(..DEFINITIONS_BYTES).unwrap_or(start);
    start.windows(14).any(|window| window == b"TIMEQ\0\0\0\0\0\0\0\0\0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_is_told_by_its_first_bytes_and_a_frame_is_none() {
        let mut tar = vec![b'a'; 600];
        tar[USTAR_AT..USTAR_AT + 5].copy_from_slice(b"ustar");
        for (start, what) in [
            (&b"PK\x03\x04...."[..], "ZIP"),
            (b"BZh91AY&SY", "bzip2"),
            (b"\xff\xfeF\0M\0T\0", "UTF-16"),
            (b"ULogEnc\x01", "encrypted"),
            (&tar, "tar"),
            (b"\xa3\x95\x80\x80\x59FMT\0BBnNZ\xa3\x95\x80\x81\x0bTIMEQ\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0StartTime", "sdlog2"),
        ] {
            assert!(hint(start).is_some_and(|words| words.contains(what)), "{what}");
        }
        for start in [&b""[..], b"PK", b"\xfe\xff\x01\x01\x01\x00", b"BZhello", b"ULog\x01\x12\x35\x01"] {
            assert_eq!(hint(start), None, "{start:?}");
        }
    }
}
