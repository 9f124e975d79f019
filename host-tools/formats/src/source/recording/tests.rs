//! Logs that lack their beginning.

use std::io::Cursor;

use super::*;

/// A log with one definition and many messages.
pub(in crate::source) fn dataflash() -> (Vec<u8>, Vec<u8>) {
    let mut fmt = [&[0xa3, 0x95, 128, 150, 13][..], b"ATT\0Qc"].concat();
    fmt.resize(3 + 2 + 4 + 16, 0);
    fmt.extend(b"TimeUS,Roll");
    fmt.resize(89, 0);
    let message = |time: u64| [&[0xa3, 0x95, 150][..], &time.to_le_bytes(), &[1, 0]].concat();
    (fmt, (0..200_u64).flat_map(|second| message(second * 1_000_000)).collect())
}

#[test]
fn a_gzip_file_that_is_cut_in_its_header_is_not_called_empty() {
    let header = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    for bytes in [&header[..], &header[..5]] {
        let input = Input::new(Cursor::new(bytes.to_vec())).expect("memory");
        let words = Recording::new(input, "cut.gz").err().map(|error| error.to_string());
        assert!(words.as_ref().is_some_and(|words| words.contains("ends too soon")), "{words:?}");
    }
}

#[test]
fn an_autopilots_log_without_its_beginning_is_one_that_is_damaged() {
    use crate::mavlink::frame::tests::HEARTBEAT;
    let (_, messages) = dataflash();
    assert_eq!(format_of(&messages), Some(Format::DataFlash));
    // By chance.
    assert_eq!(format_of(&[&messages[..], &HEARTBEAT].concat()), Some(Format::DataFlash));
    let mut gaps = Vec::new();
    let recording = Recording::new(Input::new(Cursor::new(messages)).expect("memory"), "cut.bin");
    let summary = recording.expect("a log").read(Needs::default(), &mut |_, item| {
        if let Item::Gap(gap) = item {
            gaps.push((gap.cause, gap.place));
        }
        Ok(())
    });
    assert!(summary.is_ok());
    assert_eq!(gaps, [(Cause::Damaged, Some(0))]);
    // The log is downloaded over the port.
    assert_eq!(format_of(&[&HEARTBEAT[..], &[0xa3, 0x95, 1]].concat().repeat(50)), Some(Format::Raw));
}
