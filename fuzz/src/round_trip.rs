//! Any pieces of bytes, most of them no frames, through writer and reader: they come back unchanged.

use hums_blackbox::{Entry, FRAME_BYTES_MAX, Sector, SectorSink, Writer};
use hums_core::clock::Instant;

use crate::log::{self, Item};

#[derive(Default)]
struct Card(Vec<Sector>);

impl SectorSink for Card {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(0x4855_4d53);
        self.0.push(sector);
    }
}

fn pieces(mut data: &[u8]) -> Vec<(u64, Vec<u8>)> {
    let (mut pieces, mut at_ms) = (Vec::new(), 0);
    while let [len, step, kind, rest @ ..] = data {
        let (piece, rest) = rest.split_at(usize::from(*len).min(rest.len()));
        data = rest;
        at_ms += if *step < 0xf0 { u64::from(*step) } else { u64::from(*step) << 20 };
        let mut bytes = match kind % 4 {
            0 => vec![],
            1 => vec![0xfe, piece.len() as u8, at_ms as u8, 1, 1, *kind],
            2 => vec![0xfd, piece.len() as u8, 0, 0, at_ms as u8, 1, 1, *kind, 0, 0],
            _ => vec![0xfd, piece.len() as u8, 1, 0, at_ms as u8, 1, 1, *kind, 0, 0],
        };
        bytes.extend_from_slice(piece);
        let tail = [0, 2, 2, 15][usize::from(kind % 4)];
        bytes.extend_from_slice(&[*step; 15][..tail]);
        bytes.truncate(FRAME_BYTES_MAX);
        pieces.push((at_ms, bytes));
    }
    pieces
}

/// Writes the pieces, reads them back and compares.
pub fn check(data: &[u8]) {
    let pieces = pieces(data);
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    for (at_ms, bytes) in &pieces {
        writer.frame(Instant::from_millis(*at_ms), bytes, false, &mut card).expect("room");
    }
    assert!(writer.finish(&mut card));
    let mut expected = pieces.iter();
    let end = log::read(card.0.iter().map(Sector::bytes), |item| match item {
        Item::Entry(Entry::Frame { at, bytes, verified }) => {
            let (at_ms, frame) = expected.next().expect("no more frames than were written");
            assert_eq!((at.as_millis(), bytes, verified), (*at_ms, &frame[..], false));
        }
        Item::Entry(Entry::Record { .. }) => unreachable!("none was written"),
        Item::Gap(gap) => unreachable!("nothing is missing: {gap:?}"),
    });
    assert!(end.closed && expected.next().is_none());
}
