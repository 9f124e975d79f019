//! The image: ELF, `DfuSe` (ST's UM0391) or raw for the flash's beginning.

use std::fmt;

use crate::memory::{CCM, FLASH, SRAM};

/// The reason that a file cannot be flashed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// Bytes present, bytes expected.
    Truncated(usize, usize),
    /// Checksum or structure.
    Damaged(&'static str),
    /// It is for another processor.
    OtherProcessor,
    /// Address, bytes.
    Outside(u32, u32),
    /// Vectors not this chip's: initial stack pointer, reset vector.
    Vectors(u32, u32),
    /// Nothing is in it.
    Empty,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refused::Truncated(has, wants) => write!(f, "the image is truncated: {has} of {wants} bytes"),
            Refused::Damaged(what) => write!(f, "the image is damaged: {what}"),
            Refused::OtherProcessor => f.write_str("the image is not for a 32-bit Arm processor"),
            Refused::Outside(at, bytes) => {
                write!(f, "{bytes} bytes at {at:#010x} are outside the flash of an STM32F405xG")
            }
            Refused::Vectors(stack, entry) => write!(
                f,
                "not an image of an STM32F405: its stack would begin at {stack:#010x}, its program at {entry:#010x}"
            ),
            Refused::Empty => f.write_str("the image is empty"),
        }
    }
}

impl std::error::Error for Refused {}

/// Address, size, name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Its address.
    pub address: u32,
    /// How long it is.
    pub bytes: u32,
    /// How it is called.
    pub name: String,
}

/// A program for the flash.
#[derive(Clone, Debug, Default)]
pub struct Image {
    /// Its pieces, by addresses.
    pub pieces: Vec<(u32, Vec<u8>)>,
    /// Its symbols by address, if the file has names.
    pub symbols: Vec<Symbol>,
}

impl Image {
    /// Any kind of file.
    pub fn parse(file: &[u8]) -> Result<Self, Refused> {
        let mut image = if file.starts_with(b"\x7fELF") {
            elf(file)?
        } else if file.starts_with(b"DfuSe") {
            dfu(file)?
        } else {
            Self { pieces: vec![(FLASH.0, file.to_vec())], symbols: Vec::new() }
        };
        image.pieces.retain(|(_, bytes)| !bytes.is_empty());
        image.check()?;
        Ok(image)
    }

    fn check(&self) -> Result<(), Refused> {
        if self.pieces.is_empty() {
            return Err(Refused::Empty);
        }
        for (address, bytes) in &self.pieces {
            let end = u64::from(*address) + bytes.len() as u64;
            if *address < FLASH.0 || end > u64::from(FLASH.0 + FLASH.1) {
                return Err(Refused::Outside(*address, bytes.len() as u32));
            }
        }
        let word = |at: u32| {
            self.pieces.iter().find_map(|(address, bytes)| {
                let offset = at.checked_sub(*address)? as usize;
                Some(u32::from_le_bytes(bytes.get(offset..offset + 4)?.try_into().ok()?))
            })
        };
        let (stack, entry) = (word(FLASH.0).unwrap_or(0), word(FLASH.0 + 4).unwrap_or(0));
        let is_stack = [SRAM, CCM].iter().any(|(from, bytes)| stack > *from && stack <= from + bytes);
        let is_entry = entry & 1 == 1 && word(entry & !3).is_some();
        if is_stack && stack % 4 == 0 && is_entry { Ok(()) } else { Err(Refused::Vectors(stack, entry)) }
    }

    /// Symbol at an address, and the distance from its beginning.
    pub fn symbol(&self, address: u32) -> Option<(&str, u32)> {
        let behind = self.symbols.partition_point(|symbol| symbol.address <= address);
        let symbol = self.symbols.get(behind.checked_sub(1)?)?;
        (address - symbol.address < symbol.bytes.max(2))
            .then(|| (symbol.name.as_str(), address - symbol.address))
    }

    /// Symbol by name, or part of it.
    pub fn find(&self, name: &str) -> Option<&Symbol> {
        let exact = self.symbols.iter().find(|symbol| symbol.name == name);
        exact.or_else(|| self.symbols.iter().find(|symbol| symbol.name.contains(name)))
    }
}

struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn bytes(&self, at: usize, count: usize) -> Result<&[u8], Refused> {
        let end = at.saturating_add(count);
        self.0.get(at..end).ok_or(Refused::Truncated(self.0.len(), end))
    }

    fn half(&self, at: usize) -> Result<usize, Refused> {
        let bytes = self.bytes(at, 2)?;
        Ok(usize::from(bytes[0]) | usize::from(bytes[1]) << 8)
    }

    fn word(&self, at: usize) -> Result<u32, Refused> {
        let bytes = self.bytes(at, 4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }
}

fn elf(file: &[u8]) -> Result<Image, Refused> {
    let numbers = Numbers(file);
    let kind = numbers.bytes(4, 2)?;
    // 32 bits, little-endian, Arm.
    if kind != [1, 1] || numbers.half(18)? != 40 {
        return Err(Refused::OtherProcessor);
    }
    let (headers, size, count) = (numbers.word(28)? as usize, numbers.half(42)?, numbers.half(44)?);
    let mut image = Image::default();
    for number in 0..count {
        let at = headers + number * size;
        let (kind, offset, address, bytes) =
            (numbers.word(at)?, numbers.word(at + 4)?, numbers.word(at + 12)?, numbers.word(at + 16)?);
        if kind == 1 && bytes > 0 {
            image.pieces.push((address, numbers.bytes(offset as usize, bytes as usize)?.to_vec()));
        }
    }
    image.symbols = symbols(&numbers)?;
    Ok(image)
}

fn symbols(numbers: &Numbers) -> Result<Vec<Symbol>, Refused> {
    let (headers, size, count) = (numbers.word(32)? as usize, numbers.half(46)?, numbers.half(48)?);
    let mut found = Vec::new();
    for number in 0..count {
        let at = headers + number * size;
        if numbers.word(at + 4)? != 2 {
            continue;
        }
        let (from, bytes, link) = (
            numbers.word(at + 16)? as usize,
            numbers.word(at + 20)? as usize,
            numbers.word(at + 24)? as usize,
        );
        let names = numbers.word(headers + link * size + 16)? as usize;
        for entry in (from..from + bytes).step_by(16) {
            let kind = numbers.bytes(entry + 12, 1)?[0] & 0xF;
            if kind != 1 && kind != 2 {
                continue;
            }
            let name = names + numbers.word(entry)? as usize;
            let text = numbers.0.get(name..).unwrap_or(&[]);
            let text = text.split(|byte| *byte == 0).next().unwrap_or(&[]);
            found.push(Symbol {
                address: numbers.word(entry + 4)? & if kind == 2 { !1 } else { u32::MAX },
                bytes: numbers.word(entry + 8)?,
                name: String::from_utf8_lossy(text).into_owned(),
            });
        }
    }
    found.sort_by_key(|symbol| symbol.address);
    Ok(found)
}

fn dfu(file: &[u8]) -> Result<Image, Refused> {
    let numbers = Numbers(file);
    let wanted = numbers.word(6)? as usize + 16;
    if file.len() < wanted {
        return Err(Refused::Truncated(file.len(), wanted));
    }
    let (rest, sum) = file[..wanted].split_at(wanted - 4);
    let crc = rest.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ 0xEDB8_8320 & (crc & 1).wrapping_neg())
    });
    if sum != crc.to_le_bytes() {
        return Err(Refused::Damaged("its checksum is wrong"));
    }
    if &file[11..17] != b"Target" {
        return Err(Refused::Damaged("no target is in it"));
    }
    let mut image = Image::default();
    let (count, mut at) = (numbers.word(11 + 270)?, 11 + 274);
    for _ in 0..count {
        let (address, bytes) = (numbers.word(at)?, numbers.word(at + 4)? as usize);
        image.pieces.push((address, numbers.bytes(at + 8, bytes)?.to_vec()));
        at += 8 + bytes;
    }
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(stack: u32, entry: u32, bytes: usize) -> Vec<u8> {
        let mut file = [stack.to_le_bytes(), entry.to_le_bytes()].concat();
        file.resize(bytes, 0);
        file
    }

    fn elf_file(machine: u16, address: u32, bytes: &[u8]) -> Vec<u8> {
        let mut file = vec![0; 84];
        file[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        file[18..20].copy_from_slice(&machine.to_le_bytes());
        for (at, value) in [(28, 52), (52, 1), (56, 84), (64, address), (68, bytes.len() as u32)] {
            file[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        file[42] = 32;
        file[44] = 1;
        file.extend(bytes);
        file
    }

    #[test]
    fn what_is_not_for_this_chip_is_refused_with_a_reason() {
        let good = raw(0x2002_0000, 0x0800_0101, 1_024);
        let whole = elf_file(40, 0x0800_0000, &good);
        assert!(Image::parse(&good).is_ok());
        assert!(Image::parse(&whole).is_ok());
        let cases: [(Vec<u8>, &str); 8] = [
            (Vec::new(), "empty"),
            (good[..100].to_vec(), "its program at 0x08000101"),
            (raw(0x2003_0000, 0x0800_0101, 1_024), "its stack would begin at 0x20030000"),
            (raw(0x2002_0000, 0x0800_0100, 1_024), "its program at 0x08000100"),
            (whole[..500].to_vec(), "truncated: 500 of 1108 bytes"),
            (elf_file(243, 0x0800_0000, &good), "not for a 32-bit Arm"),
            (elf_file(40, 0x0810_0000, &good), "1024 bytes at 0x08100000 are outside"),
            (vec![0; 2_000_000], "outside"),
        ];
        for (file, reason) in cases {
            let refused = Image::parse(&file).expect_err(reason).to_string();
            assert!(refused.contains(reason), "{refused}, not {reason}");
        }
    }

    #[test]
    fn symbols_are_found_by_address_and_by_name() {
        let symbol = |address, bytes, name: &str| Symbol { address, bytes, name: name.to_owned() };
        let image = Image {
            pieces: Vec::new(),
            symbols: vec![symbol(0x100, 16, "first"), symbol(0x110, 4, "second"), symbol(0x2000, 0, "third")],
        };
        for (address, found) in [
            (0xFF, None),
            (0x100, Some(("first", 0))),
            (0x10E, Some(("first", 14))),
            (0x112, Some(("second", 2))),
            (0x114, None),
            (0x2000, Some(("third", 0))),
        ] {
            assert_eq!(image.symbol(address), found, "{address:#x}");
        }
        assert_eq!(image.find("econ").map(|symbol| symbol.address), Some(0x110));
    }
}
