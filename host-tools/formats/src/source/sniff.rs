//! Tells a tlog from raw bytes by content, never by name.
//!
//! A tlog has eight bytes of time before every frame. Each valid frame is a vote: damage or boot text at the
//! beginning does not matter.

use std::io::{self, Cursor, Read};

use super::stream::read_some;
use crate::mavlink::frame::FRAME_BYTES_MAX;
use crate::mavlink::frame::{Peek, is_good, peek};

/// A few hundred frames.
const WINDOW_BYTES: usize = 64 * 1024;

/// Enough votes: a live pipe need not fill the window.
const LEAD: i32 = 3;

/// The kind of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputKind {
    /// Not one byte.
    Empty,
    /// Time, frame, time, frame.
    Tlog,
    /// A port's bytes.
    Raw,
}

/// The input with its beginning put back.
pub type Sniffed<R> = io::Chain<Cursor<Vec<u8>>, R>;

/// Looks at the beginning of `input`.
pub fn sniff<R: Read>(mut input: R) -> io::Result<(InputKind, Sniffed<R>)> {
    let mut window = vec![0; WINDOW_BYTES];
    let mut filled = 0;
    let mut votes = 0;
    loop {
        let got = read_some(&mut input, window.get_mut(filled..).unwrap_or_default())?;
        filled += got;
        let seen = window.get(..filled).unwrap_or_default();
        if got == 0 || filled >= 4 * FRAME_BYTES_MAX {
            votes = count_votes(seen);
        }
        if got == 0 || filled == WINDOW_BYTES || votes.abs() >= LEAD {
            break;
        }
    }
    window.truncate(filled);
    let kind = match (filled, votes) {
        (0, _) => InputKind::Empty,
        (_, 1..) => InputKind::Tlog,
        (_, ..=-1) => InputKind::Raw,
        (_, 0) => single_record(&window),
    };
    Ok((kind, Cursor::new(window).chain(input)))
}

/// The kind, with the number of valid frames.
pub fn sniff_bytes(bytes: &[u8]) -> (InputKind, usize) {
    let (votes, good) = count(bytes);
    let kind = match votes {
        _ if bytes.is_empty() => InputKind::Empty,
        1.. => InputKind::Tlog,
        ..=-1 => InputKind::Raw,
        0 => single_record(bytes),
    };
    (kind, good)
}

fn count_votes(bytes: &[u8]) -> i32 {
    count(bytes).0
}

fn count(bytes: &[u8]) -> (i32, usize) {
    let (mut votes, mut good) = (0, 0);
    let mut at = 0;
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
        match peek(rest) {
            Peek::Frame(frame) if is_good(&frame) => {
                good += 1;
                let next = at + frame.bytes().len();
                let begins =
                    |at: usize| bytes.get(at..).is_some_and(|rest| matches!(peek(rest), Peek::Frame(_)));
                match (begins(next), begins(next + 8)) {
                    (false, true) => votes += 1,
                    (true, false) => votes -= 1,
                    _ => {}
                }
                at = next;
            }
            _ => at += 1,
        }
    }
    (votes, good)
}

/// A lone record at the beginning is a tlog.
fn single_record(bytes: &[u8]) -> InputKind {
    match bytes.get(8..).map(peek) {
        Some(Peek::Frame(_)) if !matches!(peek(bytes), Peek::Frame(_)) => InputKind::Tlog,
        _ => InputKind::Raw,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::frame::tests::HEARTBEAT;

    fn kind(bytes: &[u8]) -> InputKind {
        let (kind, mut rest) = sniff(bytes).expect("memory");
        let mut back = Vec::new();
        rest.read_to_end(&mut back).expect("memory");
        assert_eq!(back, bytes, "what was looked at is put back");
        kind
    }

    fn record(time: u64) -> Vec<u8> {
        [&time.to_be_bytes()[..], &HEARTBEAT].concat()
    }

    #[test]
    fn frames_alone_are_raw_and_with_times_a_tlog() {
        assert_eq!(kind(&HEARTBEAT.repeat(20)), InputKind::Raw);
        assert_eq!(
            kind(&(0..20).flat_map(|at| record(1_700_000_000_000_000 + at)).collect::<Vec<_>>()),
            InputKind::Tlog
        );
        assert_eq!(kind(&(0..20).flat_map(record).collect::<Vec<_>>()), InputKind::Tlog, "times since boot");
    }

    #[test]
    fn a_damaged_beginning_does_not_mislead() {
        let tlog: Vec<u8> = (0..20).flat_map(|at| record(1_700_000_000_000_000 + at)).collect();
        assert_eq!(kind(&tlog[5..]), InputKind::Tlog);
        assert_eq!(
            kind(&[b"Init ArduCopter\n\xfd\xfe\xfd", &HEARTBEAT.repeat(3)[..]].concat()),
            InputKind::Raw
        );
    }

    #[test]
    fn a_single_frame_tells_by_where_it_begins() {
        assert_eq!(kind(&record(5)), InputKind::Tlog);
        assert_eq!(kind(&HEARTBEAT), InputKind::Raw);
    }

    #[test]
    fn nothing_and_garbage() {
        assert_eq!(kind(b""), InputKind::Empty);
        assert_eq!(kind(b"garbage"), InputKind::Raw);
        assert_eq!(kind(&vec![0xfd; 100_000]), InputKind::Raw);
    }
}
