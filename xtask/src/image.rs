//! An ELF file's parts in the flash.

use std::fmt::Write as _;

use anyhow::{Context as _, Result, bail};
use object::Endianness;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader as _, ProgramHeader as _};

/// Sectors never touched by programming: the store, and the state of an update (ARCHITECTURE.md).
pub(crate) const KEPT: std::ops::Range<u32> = 0x0800_4000..0x0801_0000;

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) address: u32,
    pub(crate) bytes: Vec<u8>,
}

pub(crate) fn pieces(elf: &[u8]) -> Result<Vec<Piece>> {
    let header = FileHeader32::<Endianness>::parse(elf)
        .context("the file is no ELF file; build the firmware again")?;
    let endian = header.endian()?;
    let mut pieces = Vec::new();
    for segment in header.program_headers(endian, elf)? {
        if segment.p_type(endian) != PT_LOAD || segment.p_filesz(endian) == 0 {
            continue;
        }
        let bytes = segment
            .data(endian, elf)
            .ok()
            .context("the ELF file ends within a segment; build the firmware again")?;
        pieces.push(Piece { address: segment.p_paddr(endian), bytes: bytes.to_vec() });
    }
    joined(pieces)
}

/// The ELF file with these pieces beside its own. Debuggers and the chip's model load them; symbols stay.
pub(crate) fn with_pieces(elf: &[u8], pieces: &[Piece]) -> Result<Vec<u8>> {
    const ENTRY_BYTES: usize = 32;
    let header = FileHeader32::<Endianness>::parse(elf)
        .context("the file is no ELF file; build the firmware again")?;
    let endian = header.endian()?;
    let (from, count) = (header.e_phoff(endian) as usize, usize::from(header.e_phnum(endian)));
    let table = elf
        .get(from..from + count * ENTRY_BYTES)
        .context("the ELF file ends within its headers; build the firmware again")?;
    let mut file = elf.to_vec();
    let mut entries = table.to_vec();
    for Piece { address, bytes } in pieces {
        file.resize(file.len().next_multiple_of(4), 0);
        let length = bytes.len() as u32;
        // Kind, offset, two addresses, two lengths, flags (readable), alignment.
        let entry = [PT_LOAD.0, file.len() as u32, *address, *address, length, length, 4, 4];
        entries.extend(entry.into_iter().flat_map(u32::to_le_bytes));
        file.extend(bytes);
    }
    file.resize(file.len().next_multiple_of(4), 0);
    let table = file.len() as u32;
    file.extend(entries);
    // Offset and number of program headers (ELF-32, header).
    file[28..32].copy_from_slice(&table.to_le_bytes());
    file[44..46].copy_from_slice(&((count + pieces.len()) as u16).to_le_bytes());
    Ok(file)
}

/// In order of address, with adjacent pieces joined.
fn joined(mut pieces: Vec<Piece>) -> Result<Vec<Piece>> {
    pieces.sort_by_key(|piece| piece.address);
    let mut joined: Vec<Piece> = Vec::new();
    for piece in pieces {
        let end = u64::from(piece.address) + piece.bytes.len() as u64;
        if piece.address < KEPT.end && end > u64::from(KEPT.start) {
            bail!(
                "the image has bytes at {:#010x}, where the store or the state of an update is: see memory.x",
                piece.address
            );
        }
        match joined.last_mut() {
            Some(before) if before.address + before.bytes.len() as u32 > piece.address => {
                bail!("two segments of the image lie at {:#010x}: see memory.x", piece.address)
            }
            Some(before) if before.address + before.bytes.len() as u32 == piece.address => {
                before.bytes.extend(piece.bytes);
            }
            _ => joined.push(piece),
        }
    }
    Ok(joined)
}

/// From the first address on; gaps are erased flash: this file empties the board's store.
pub(crate) fn flat(pieces: &[Piece]) -> Vec<u8> {
    let mut flat = Vec::new();
    let Some(first) = pieces.first() else { return flat };
    for piece in pieces {
        flat.resize((piece.address - first.address) as usize, 0xFF);
        flat.extend(&piece.bytes);
    }
    flat
}

/// Intel HEX, with gaps: for Betaflight Configurator and `STM32CubeProgrammer`.
pub(crate) fn hex(pieces: &[Piece]) -> Vec<u8> {
    let mut text = String::new();
    let mut upper = None;
    for piece in pieces {
        let mut at = piece.address;
        let mut rest = &piece.bytes[..];
        while !rest.is_empty() {
            if upper != Some(at >> 16) {
                upper = Some(at >> 16);
                record(&mut text, 0, 4, &((at >> 16) as u16).to_be_bytes());
            }
            // Within a line of 16 bytes, and so a bank of 64 KiB.
            let (line, behind) = rest.split_at(rest.len().min(16 - at as usize % 16));
            record(&mut text, at as u16, 0, line);
            (at, rest) = (at + line.len() as u32, behind);
        }
    }
    record(&mut text, 0, 1, &[]);
    text.into_bytes()
}

/// Length, address, kind, bytes, check sum.
fn record(text: &mut String, address: u16, kind: u8, bytes: &[u8]) {
    let [high, low] = address.to_be_bytes();
    let head = [bytes.len() as u8, high, low, kind];
    let all = head.iter().chain(bytes);
    let sum = all.clone().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)).wrapping_neg();
    text.push(':');
    for byte in all.chain([&sum]) {
        // Cannot fail: it is a text.
        let _ = write!(text, "{byte:02X}");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wikipedia's example.
    #[test]
    fn a_hex_file_has_each_address_and_the_gap() {
        let bytes = b"\x21\x46\x01\x36\x01\x21\x47\x01\x36\x00\x7E\xFE\x09\xD2\x19\x01".to_vec();
        let pieces = [Piece { address: 0x0800_0100, bytes }, piece(0x0800_FFFF, 2)];
        let wanted = ":020000040800F2\n:10010000214601360121470136007EFE09D2190140\n:01FFFF0007FA\n:020000040801F1\n\
                      :0100000007F8\n:00000001FF\n";
        assert_eq!(String::from_utf8(hex(&pieces)).unwrap(), wanted);
    }

    fn piece(address: u32, bytes: usize) -> Piece {
        Piece { address, bytes: vec![7; bytes] }
    }

    #[test]
    fn pieces_are_joined_where_they_touch_and_kept_apart_where_the_store_lies_between() {
        let pieces = vec![piece(0x0801_0010, 16), piece(0x0800_0000, 392), piece(0x0801_0000, 16)];
        assert_eq!(joined(pieces).unwrap(), [piece(0x0800_0000, 392), piece(0x0801_0000, 32)]);
    }

    #[test]
    fn an_image_that_would_overwrite_the_store_is_refused() {
        for at in [0x0800_3FFF, 0x0800_4000, 0x0800_BFFF, 0x0800_FFFF] {
            assert!(joined(vec![piece(at, 2)]).unwrap_err().to_string().contains("store"), "{at:#x}");
        }
        assert!(joined(vec![piece(0x0800_3FFE, 2), piece(0x0801_0000, 2)]).is_ok());
    }

    #[test]
    fn segments_that_overlap_are_refused() {
        assert!(joined(vec![piece(0x0801_0000, 4), piece(0x0801_0002, 4)]).is_err());
    }

    #[test]
    fn a_flat_image_has_an_erased_store() {
        let flat = flat(&[piece(0x0800_0000, 2), piece(0x0800_0004, 1)]);
        assert_eq!(flat, [7, 7, 0xFF, 0xFF, 7]);
    }

    #[test]
    fn added_pieces_are_loaded_with_those_of_the_file() {
        // No program header.
        let mut elf = vec![0; 52];
        elf[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        elf[42] = 32;
        let added = [piece(0x0800_0000, 6), piece(0x0802_0000, 3)];
        let once = with_pieces(&elf, &added[1..]).unwrap();
        assert_eq!(pieces(&with_pieces(&once, &added[..1]).unwrap()).unwrap(), added);
        assert!(with_pieces(b"no elf", &added).is_err());
    }

    #[test]
    fn what_is_no_elf_file_is_an_error() {
        assert!(pieces(b"no elf").is_err());
    }
}
