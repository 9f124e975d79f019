//! Any coded stream in sound sectors, through the decoder of a group. A writer may never make such a stream, but its
//! output is bounded.

use hums_blackbox::{BODY_BYTES, Entry, GROUP_SECTORS, GroupDecoder, Header, SECTOR_BYTES, Sector};
use hums_blackbox::{SectorSink, Writer};

/// Bytes of a group's first body before its coded stream.
const PREAMBLE_BYTES: usize = 26;

const BODY_AT: usize = 19;

const ENTRY_BYTES_MAX: usize = 512;

struct First(Option<Sector>);

impl SectorSink for First {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        self.0.get_or_insert(*sector);
    }
}

fn preamble() -> [u8; PREAMBLE_BYTES] {
    let (mut writer, mut first) = (Box::new(Writer::new()), First(None));
    writer.finish(&mut first);
    let sector = first.0.expect("an empty log has one sector");
    sector.bytes()[BODY_AT..].first_chunk().copied().expect("a sector is longer")
}

/// Sectors with this stream; each claims to complete `entries`.
pub fn sectors(stream: &[u8], entries: u16) -> Vec<[u8; SECTOR_BYTES]> {
    let body = [&preamble(), stream].concat();
    let bodies = body.chunks(BODY_BYTES).take(GROUP_SECTORS);
    bodies.enumerate().map(|(number, body)| sector(number as u8, body, entries)).collect()
}

fn sector(number: u8, body: &[u8], entries: u16) -> [u8; SECTOR_BYTES] {
    let mut bytes = [0; SECTOR_BYTES];
    bytes[..3].copy_from_slice(&[0x48, 0xb3, number]);
    bytes[3..5].copy_from_slice(&(body.len() as u16).to_le_bytes());
    bytes[5..7].copy_from_slice(&entries.to_le_bytes());
    bytes[11] = number;
    bytes[BODY_AT..BODY_AT + body.len()].copy_from_slice(body);
    let mut sector = Sector::from_bytes(bytes);
    sector.seal(7);
    *sector.bytes()
}

/// Takes the first two bytes for the number of entries in a sector, the others for the stream.
pub fn check(data: &[u8]) {
    let Some((&entries, stream)) = data.split_first_chunk::<2>() else { return };
    let entries = u16::from_le_bytes(entries) % 2_048;
    let mut decoder = Box::new(GroupDecoder::new());
    let (mut said, mut given) = (0_u32, 0_u32);
    for block in sectors(stream, entries) {
        let header = Header::read(&block).expect("it was made so");
        said += header.entries();
        if decoder.push(&header, &Sector::from_bytes(block)).is_err() {
            return;
        }
        while let Some(entry) = decoder.next_entry() {
            match entry {
                Ok(Entry::Frame { bytes, .. }) => assert!(bytes.len() <= ENTRY_BYTES_MAX),
                Ok(Entry::Record { .. }) => {}
                Err(_) => return,
            }
            given += 1;
            assert!(given <= said);
        }
    }
}
