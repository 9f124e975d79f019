//! Any bytes, cut anywhere, through the framer: each is counted, and the cuts make no difference.

use hums_link::{Framer, FramerCounts};

fn frames(bytes: &[u8], piece: usize) -> (Vec<Vec<u8>>, FramerCounts) {
    let mut framer = Box::new(Framer::new());
    let mut frames = Vec::new();
    let mut pushed = 0;
    for piece in bytes.chunks(piece) {
        framer.push(piece, &mut |frame| frames.push(frame.bytes().to_vec()));
        pushed += piece.len();
        let counts = framer.counts();
        let accounted = counts.bytes_in_frames + counts.bytes_not_frames + framer.held() as u64;
        assert_eq!((counts.bytes, accounted), (pushed as u64, pushed as u64));
    }
    framer.idle(&mut |frame| frames.push(frame.bytes().to_vec()));
    assert_eq!(framer.held(), 0, "silence decides everything");
    (frames, framer.counts())
}

/// Takes the first byte for the size of the pieces, the others as bytes of a line.
pub fn check(data: &[u8]) {
    let Some((&piece, bytes)) = data.split_first() else { return };
    let (found, counts) = frames(bytes, usize::from(piece) + 1);
    assert_eq!(counts.bytes_in_frames + counts.bytes_not_frames, bytes.len() as u64);
    assert_eq!(counts.bytes_in_frames, found.iter().map(Vec::len).sum::<usize>() as u64);
    assert_eq!(counts.frames, found.len() as u64);
    let mut rest = bytes;
    for frame in &found {
        let at =
            rest.windows(frame.len()).position(|window| window == frame).expect("in the bytes, in order");
        rest = &rest[at + frame.len()..];
    }
    assert_eq!(frames(bytes, bytes.len().max(1)).0, found);
}
