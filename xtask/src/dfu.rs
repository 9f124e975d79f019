//! The firmware as a `DfuSe` file, for the boot loader that each STM32 has in its system memory (ST's UM0391; suffix: USB DFU
//! 1.1, appendix B). Each piece has its address: the store stays.

use crate::image::Piece;

/// `DfuSe`, version, size, number of targets.
const PREFIX_BYTES: usize = 11;
/// `Target`, setting, name, size, number of elements.
const TARGET_BYTES: usize = 274;
const NAME_BYTES: usize = 255;
const SUFFIX_BYTES: usize = 16;
/// `STMicroelectronics`' boot loader.
const VENDOR: u16 = 0x0483;
const PRODUCT: u16 = 0xDF11;
/// Any release of the device.
const DEVICE: u16 = 0xFFFF;
/// A suffix of this kind follows.
const DFUSE: u16 = 0x011A;

pub(crate) fn file(name: &str, pieces: &[Piece]) -> Vec<u8> {
    let elements: usize = pieces.iter().map(|piece| 8 + piece.bytes.len()).sum();
    let mut file = Vec::with_capacity(PREFIX_BYTES + TARGET_BYTES + elements + SUFFIX_BYTES);
    file.extend(b"DfuSe\x01");
    file.extend(((PREFIX_BYTES + TARGET_BYTES + elements) as u32).to_le_bytes());
    file.push(1);

    file.extend(b"Target\x00");
    file.extend(1_u32.to_le_bytes());
    let mut named = [0; NAME_BYTES];
    for (to, from) in named.iter_mut().zip(name.bytes().take(NAME_BYTES - 1)) {
        *to = from;
    }
    file.extend(named);
    file.extend((elements as u32).to_le_bytes());
    file.extend((pieces.len() as u32).to_le_bytes());
    for piece in pieces {
        file.extend(piece.address.to_le_bytes());
        file.extend((piece.bytes.len() as u32).to_le_bytes());
        file.extend(&piece.bytes);
    }

    for word in [DEVICE, PRODUCT, VENDOR, DFUSE] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"UFD");
    file.push(SUFFIX_BYTES as u8);
    file.extend(crc(&file).to_le_bytes());
    file
}

/// CRC-32 as everywhere, without the inversion at its end.
fn crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(file: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(file[at..at + 4].try_into().unwrap())
    }

    fn pieces() -> [Piece; 2] {
        [
            Piece { address: 0x0800_0000, bytes: vec![1; 392] },
            Piece { address: 0x0800_C000, bytes: vec![2; 1000] },
        ]
    }

    #[test]
    fn each_piece_is_an_element_with_its_address() {
        let file = file("hums-mate", &pieces());
        assert_eq!(&file[..6], b"DfuSe\x01");
        assert_eq!(word(&file, 6) as usize, file.len() - SUFFIX_BYTES);
        assert_eq!(&file[11..17], b"Target");
        assert_eq!(&file[22..31], b"hums-mate");
        assert_eq!(word(&file, 277), 392 + 1000 + 16);
        assert_eq!(word(&file, 281), 2);
        assert_eq!((word(&file, 285), word(&file, 289)), (0x0800_0000, 392));
        let second = 285 + 8 + 392;
        assert_eq!((word(&file, second), word(&file, second + 4)), (0x0800_C000, 1000));
        assert_eq!(file[second + 8..second + 1008], [2; 1000]);
    }

    #[test]
    fn the_suffix_names_the_boot_loader_and_its_crc_fits() {
        let file = file("hums", &pieces());
        let suffix = &file[file.len() - SUFFIX_BYTES..];
        assert_eq!(&suffix[..12], b"\xFF\xFF\x11\xDF\x83\x04\x1A\x01UFD\x10");
        assert_eq!(word(&file, file.len() - 4), crc(&file[..file.len() - 4]));
        assert_eq!(crc(b"123456789"), !0xCBF4_3926);
    }
}
