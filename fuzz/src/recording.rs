//! Any file as a recording of any kind. Reading ends, its times never fall, and as a stream of bytes it has only
//! bytes of the file.

use std::path::Path;

use hums::endpoint::Endpoint;
use hums::source::item::{Needs, Rows};
use hums::source::recording::LogPlace;
use hums::source::{self, Timing};

use crate::file::with_file;

/// Maximum items from one byte of a recording: a small frame, its observation, its text and its fact.
const ITEMS_PER_BYTE: usize = 4;

/// Takes the input for the file.
pub fn check(data: &[u8]) {
    with_file(data, |path| {
        stream(path, data.len());
        if !data.starts_with(&[0x1f, 0x8b]) {
            items(path, data.len());
        }
    });
}

fn stream(path: &Path, length: usize) {
    let endpoint = Endpoint::File(path.to_owned());
    let Ok(mut source) = source::open(&endpoint, Timing { line_rate: None }) else { return };
    let (mut bytes, mut last_us, mut chunks) = (0, 0, 0);
    while let Some(chunk) = source.next().expect("a file that can be read") {
        assert!(chunk.at_us >= last_us, "time falls from {last_us} to {} us", chunk.at_us);
        last_us = chunk.at_us;
        bytes += chunk.bytes.len();
        chunks += 1;
        assert!(chunks <= length + 1, "no end");
    }
    assert!(bytes <= length, "{bytes} bytes of {length}");
    source.remark();
}

fn items(path: &Path, length: usize) {
    let Ok(recording) = LogPlace::file(path).open() else { return };
    let mut count = 0;
    let want = Needs { frames: true, observations: true, rows: Rows::All, ..Needs::default() };
    let _ = recording.read(want, &mut |_, _| {
        count += 1;
        assert!(count <= ITEMS_PER_BYTE * length + 64, "no end");
        Ok(())
    });
}
