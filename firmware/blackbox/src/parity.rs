//! Parity: sectors from which lost sectors are rebuilt.
//!
//! A file's sectors form *stretches* of [`STRETCH_SECTORS`], from its first one on. A stretch's sectors form
//! [`COLUMNS`] *columns*: sector `i` is in column `i mod 8`. So no run of eight sectors, from any beginning of a
//! page, has two of a column. Each column has two parity sectors, P and Q. One of them rebuilds one lost sector of
//! the column, both rebuild two: any two pages of 4 KiB of a stretch, or one of 8 KiB.
//!
//! P is the exclusive-or of the sectors. Q is their sum in GF(256), each sector times `2^n`, where `n` counts back
//! from the last one of the column (H. P. Anvin, "The mathematics of RAID-6"). Both cover the unknown part of a lost
//! sector: all but the magic byte and the version, the session, the number and the check.
//!
//! A parity sector may be written before its stretch is full: it names the last sector that it covers.

use crate::crc::crc32c;
use crate::sector::{Header, SECTOR_BYTES, Sector};

/// Sectors of a stretch: 252 KiB.
pub const STRETCH_SECTORS: u32 = 504;
/// Columns of a stretch: the sectors of a page of 4 KiB.
pub const COLUMNS: usize = 8;
/// Parity sectors of a stretch: P of each column, then Q of each.
pub const PARITY_SECTORS: u32 = 2 * COLUMNS as u32;

const _: () = assert!(STRETCH_SECTORS.is_multiple_of(COLUMNS as u32));

const MAGIC: u8 = b'H';
const CRC_AT: usize = SECTOR_BYTES - 4;
/// The polynomial x^8 + x^4 + x^3 + x^2 + 1, without its highest term.
const POLYNOMIAL: u8 = 0x1d;

/// How many of `blocks` of a file are for data sectors. The others, at its end, are for parity: those of stretch `n` begin at
/// block `blocks - 16 (n + 1)`.
pub const fn data_blocks(blocks: u32) -> u32 {
    blocks.saturating_sub(blocks.div_ceil(STRETCH_SECTORS + PARITY_SECTORS) * PARITY_SECTORS)
}

/// The block of a file of `blocks` at which the parity of its stretch `stretch` begins.
pub const fn parity_block(blocks: u32, stretch: u32) -> u32 {
    blocks.saturating_sub(stretch.saturating_add(1).saturating_mul(PARITY_SECTORS))
}

/// Which of the two sums of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sum {
    /// The exclusive-or.
    P,
    /// Weighted by powers of two.
    Q,
}

impl Sum {
    /// Both, in their order on the card.
    pub const ALL: [Self; 2] = [Self::P, Self::Q];

    const fn mark(self) -> u8 {
        match self {
            Self::P => 0xc0 | crate::VERSION,
            Self::Q => 0xd0 | crate::VERSION,
        }
    }

    /// Adds a sector to `block`, after those before it in its column.
    pub fn add(self, block: &mut [u8; SECTOR_BYTES], sector: &[u8; SECTOR_BYTES]) {
        if self == Self::Q {
            double(block);
        }
        add(block, sector, 1);
    }

    /// The same for a sector that is nowhere: it counts as zeros.
    pub fn pass(self, block: &mut [u8; SECTOR_BYTES]) {
        if self == Self::Q {
            double(block);
        }
    }

    /// Makes a parity sector from `block`: the last sector that it covers has the number `last`.
    pub fn seal(self, block: &mut [u8; SECTOR_BYTES], session: u32, last: u32) {
        (block[0], block[1]) = (MAGIC, self.mark());
        block[7..11].copy_from_slice(&session.to_le_bytes());
        block[11..15].copy_from_slice(&last.to_le_bytes());
        let crc = crc32c(&block[..CRC_AT]);
        block[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
    }
}

/// A parity sector's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parity {
    /// Which sum it is.
    pub sum: Sum,
    /// The session whose sectors it covers.
    pub session: u32,
    /// The number of the last sector that it covers. The others are every eighth before it, to the stretch's start.
    pub last: u32,
}

impl Parity {
    /// Whether a block begins as a parity sector does.
    pub fn begins(block: &[u8; SECTOR_BYTES]) -> bool {
        block[0] == MAGIC && Sum::ALL.iter().any(|sum| sum.mark() == block[1])
    }

    /// Checks a block; `None` if it is not a valid parity sector.
    pub fn read(block: &[u8; SECTOR_BYTES]) -> Option<Self> {
        let sum = Sum::ALL.into_iter().find(|sum| block[..2] == [MAGIC, sum.mark()])?;
        let sector = Sector::from_bytes(*block);
        let (check, _) = block[CRC_AT..].split_first_chunk()?;
        let is_sound = crc32c(&block[..CRC_AT]) == u32::from_le_bytes(*check);
        is_sound.then(|| Self { sum, session: sector.session(), last: sector.number() })
    }
}

/// Compares the sums of one column with its sectors and rebuilds lost ones.
#[derive(Clone, Debug)]
pub struct Column {
    session: u32,
    sums: [Option<ParitySum>; 2],
}

/// An available sum.
#[derive(Clone, Copy, Debug)]
struct ParitySum {
    last: u32,
    block: [u8; SECTOR_BYTES],
    /// Sum of the taken sectors; the latest one has the factor 1.
    taken: [u8; SECTOR_BYTES],
    rows: Option<u32>,
}

impl Column {
    /// A column without sums.
    pub const fn new(session: u32) -> Self {
        Self { session, sums: [None, None] }
    }

    /// Takes a parity sector of the column, which [`Parity::read`] has checked, before any sector. That which covers more counts.
    pub fn sum(&mut self, parity: &Parity, block: &[u8; SECTOR_BYTES]) {
        let [p, q] = &mut self.sums;
        let held = if parity.sum == Sum::P { p } else { q };
        if held.as_ref().is_none_or(|held| held.last < parity.last) {
            *held =
                Some(ParitySum { last: parity.last, block: *block, taken: [0; SECTOR_BYTES], rows: None });
        }
    }

    /// The last number that any sum covers.
    pub fn last(&self) -> Option<u32> {
        self.sums.iter().flatten().map(|held| held.last).max()
    }

    /// Takes an existing sector of the column. The rest of each sum then belongs to the lost sectors. Ascending numbers are
    /// fastest.
    pub fn sector(&mut self, number: u32, bytes: &[u8; SECTOR_BYTES]) {
        for (sum, held) in Sum::ALL.into_iter().zip(&mut self.sums) {
            if let Some(held) = held {
                held.take(sum, number, bytes);
            }
        }
    }

    /// Whether the sums agree with the sectors and each other, as far as known. `lost` are the numbers of missing sectors,
    /// ascending, at least three if there are more. A sum without missing sectors must equal the sum of the others. A single
    /// missing sector must be the same by either sum.
    pub fn agrees(&self, lost: &[u32]) -> bool {
        let of = |index: usize| {
            let (sum, last, rest) = self.held(index)?;
            let mut covered = lost.iter().filter(|number| **number <= last);
            Some((sum, last, rest, covered.next().copied(), covered.next().is_none()))
        };
        let both = [of(0), of(1)];
        let is_left = both.iter().flatten().any(|(_, _, rest, first, _)| first.is_none() && !is_zero(rest));
        let is_other = match both {
            [Some((_, _, p, Some(one), true)), Some((sum, last, q, Some(_), true))] => {
                let mut both = q;
                add(&mut both, &p, weight(sum, last, one).unwrap_or(0));
                !is_zero(&both)
            }
            _ => false,
        };
        !is_left && !is_other
    }

    /// Rebuilds the sectors of these numbers as far as possible. They must be all lost sectors of the column.
    pub fn solve(mut self, lost: &[u32]) -> [Option<Sector>; 2] {
        let mut found = [None, None];
        // A sum that lacks one sector rebuilds it. Then the other sum may lack only one, too.
        for _ in 0..lost.len().min(2) {
            for held in 0..self.sums.len() {
                let Some((place, number)) = self.alone(held, lost, &found) else { continue };
                let Some((sum, last, rest)) = self.held(held) else { continue };
                let Some(weight) = weight(sum, last, number) else { continue };
                let sector = self.sector_of(number, &rest, inverse(weight));
                if let Some(bytes) = &sector {
                    self.sector(number, bytes.bytes());
                }
                found[place] = sector;
            }
        }
        if let ([one, two], [None, None]) = (lost, &found)
            && let (Some((_, last_p, p)), Some((_, last_q, q))) = (self.held(0), self.held(1))
            && one.max(two) <= &last_p
            && let (Some(a), Some(b)) = (weight(Sum::Q, last_q, *one), weight(Sum::Q, last_q, *two))
        {
            // p = x + y, q = a x + b y: x = (q + b p) / (a + b).
            let mut x = [0; SECTOR_BYTES];
            add(&mut x, &q, inverse(a ^ b));
            add(&mut x, &p, product(b, inverse(a ^ b)));
            let mut y = p;
            add(&mut y, &x, 1);
            found = [self.sector_of(*one, &x, 1), self.sector_of(*two, &y, 1)];
        }
        found
    }

    fn held(&self, index: usize) -> Option<(Sum, u32, [u8; SECTOR_BYTES])> {
        let (held, sum) = (self.sums.get(index)?.as_ref()?, *Sum::ALL.get(index)?);
        let mut rest = held.block;
        add(&mut rest, &held.taken, power(sum, held.rows.unwrap_or(0)));
        Some((sum, held.last, rest))
    }

    fn alone(&self, index: usize, lost: &[u32], found: &[Option<Sector>; 2]) -> Option<(usize, u32)> {
        let (_, last, _) = self.held(index)?;
        let is_open = |place: usize| found.get(place).is_none_or(Option::is_none);
        let mut covered =
            lost.iter().enumerate().filter(|(place, number)| **number <= last && is_open(*place));
        let (place, number) = covered.next()?;
        (covered.next().is_none() && place < found.len()).then_some((place, *number))
    }

    fn sector_of(&self, number: u32, rest: &[u8; SECTOR_BYTES], weight: u8) -> Option<Sector> {
        let mut bytes = [0; SECTOR_BYTES];
        add(&mut bytes, rest, weight);
        let sector = Sector::made_again(&bytes, self.session, number);
        let header = Header::read(sector.bytes()).ok()?;
        let beyond = sector.body().get(header.body_bytes..)?;
        let is_nothing = header.starts_group() && header.body_bytes == 0;
        (!is_nothing && !header.partial && beyond.iter().all(|byte| *byte == 0)).then_some(sector)
    }
}

impl ParitySum {
    fn take(&mut self, sum: Sum, number: u32, bytes: &[u8; SECTOR_BYTES]) {
        let Some(left) = rows(self.last, number) else { return };
        let before = self.rows.map_or(0, |rows| rows.saturating_sub(left));
        if sum == Sum::Q {
            (0..before % ORDER).for_each(|_| double(&mut self.taken));
        }
        let rows = self.rows.map_or(left, |rows| rows.min(left));
        add(&mut self.taken, bytes, power(sum, left - rows));
        self.rows = Some(rows);
    }
}

const fn rows(last: u32, number: u32) -> Option<u32> {
    match last.checked_sub(number) {
        Some(numbers) => Some(numbers / COLUMNS as u32),
        None => None,
    }
}

/// Factor of a sector of this number in a sum that ends at number `last`; `None` if the sector is not covered.
fn weight(sum: Sum, last: u32, number: u32) -> Option<u8> {
    rows(last, number).map(|rows| power(sum, rows))
}

fn power(sum: Sum, rows: u32) -> u8 {
    match sum {
        Sum::P => 1,
        Sum::Q => (0..rows % ORDER).fold(1, |weight, _| product(weight, 2)),
    }
}

const ORDER: u32 = 255;

/// Summed part of a sector: all fields that its position and session do not determine.
const PARTS: [core::ops::Range<usize>; 2] = [2..7, 15..CRC_AT];

fn add(to: &mut [u8; SECTOR_BYTES], from: &[u8; SECTOR_BYTES], weight: u8) {
    for part in PARTS {
        let pairs = to[part.clone()].iter_mut().zip(&from[part]);
        if weight == 1 {
            pairs.for_each(|(to, from)| *to ^= *from);
        } else {
            pairs.for_each(|(to, from)| *to ^= product(weight, *from));
        }
    }
}

fn is_zero(rest: &[u8; SECTOR_BYTES]) -> bool {
    PARTS.into_iter().all(|part| rest[part].iter().all(|byte| *byte == 0))
}

fn double(block: &mut [u8; SECTOR_BYTES]) {
    for word in block.as_chunks_mut().0 {
        let bits = u32::from_le_bytes(*word);
        let carried = (bits >> 7) & 0x0101_0101;
        *word = (((bits & 0x7f7f_7f7f) << 1) ^ carried.wrapping_mul(POLYNOMIAL as u32)).to_le_bytes();
    }
}

const fn product(a: u8, b: u8) -> u8 {
    let (mut a, mut b, mut product) = (a, b, 0);
    while b != 0 {
        if b & 1 == 1 {
            product ^= a;
        }
        a = (a << 1) ^ if a & 0x80 == 0 { 0 } else { POLYNOMIAL };
        b >>= 1;
    }
    product
}

/// The inverse in GF(256), which is the 254th power; 0 of 0.
const fn inverse(a: u8) -> u8 {
    let (mut power, mut square, mut bit) = (1, a, 1);
    while bit < 8 {
        square = product(square, square);
        power = product(power, square);
        bit += 1;
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    const SESSION: u32 = 0x1234_5678;

    fn sector(number: u32) -> Sector {
        let mut bytes = [0; SECTOR_BYTES];
        for (index, byte) in bytes.iter_mut().enumerate() {
            *byte = (number.wrapping_mul(0x9e37_79b1).wrapping_add(index as u32 * 0x85eb) >> 11) as u8;
        }
        let header = Header {
            session: SESSION,
            number,
            since_first: (number % 64) as u8,
            partial: false,
            closed: false,
            body_bytes: crate::BODY_BYTES - (number % 5) as usize,
            frames: number as u16,
            records: (number % 3) as u8,
            check: number.wrapping_mul(0x9e37_79b1),
        };
        let mut sector = Sector::from_bytes(bytes);
        sector.set_header(&header);
        sector.seal(SESSION);
        sector
    }

    fn sums(first: u32, rows: u32, absent: Option<u32>) -> [[u8; SECTOR_BYTES]; 2] {
        Sum::ALL.map(|sum| {
            let mut block = [0; SECTOR_BYTES];
            for row in 0..rows {
                match first + 8 * row {
                    number if Some(number) == absent => sum.pass(&mut block),
                    number => sum.add(&mut block, sector(number).bytes()),
                }
            }
            sum.seal(&mut block, SESSION, first + 8 * (rows - 1));
            block
        })
    }

    fn column(sums: &[[u8; SECTOR_BYTES]], first: u32, rows: u32, lost: &[u32]) -> [Option<Sector>; 2] {
        let mut column = Column::new(SESSION);
        for block in sums {
            column.sum(&Parity::read(block).expect("it is sound"), block);
        }
        let numbers = (0..rows).map(|row| first + 8 * row).filter(|number| !lost.contains(number));
        numbers.for_each(|number| column.sector(number, sector(number).bytes()));
        column.solve(lost)
    }

    #[test]
    fn any_one_or_two_lost_sectors_of_a_column_are_made_again() {
        let (first, rows) = (70_003, STRETCH_SECTORS / 8);
        let [p, q] = sums(first, rows, None);
        for one in (0..rows).map(|row| first + 8 * row) {
            for sums in [&[p][..], &[q], &[p, q]] {
                assert_eq!(column(sums, first, rows, &[one]), [Some(sector(one)), None]);
            }
            for two in ((one + 8)..first + 8 * rows).step_by(8 * 9) {
                let both = [Some(sector(one)), Some(sector(two))];
                assert_eq!(column(&[p, q], first, rows, &[one, two]), both, "{one} {two}");
                assert_eq!(column(&[p], first, rows, &[one, two]), [None, None]);
            }
        }
        assert_eq!(column(&[p, q], first, rows, &[first, first + 8, first + 16]), [None, None]);
    }

    #[test]
    fn sums_of_different_age_give_what_each_of_them_covers() {
        let [_, q] = sums(3, 20, None);
        let [p, _] = sums(3, 30, None);
        let (early, late) = (3 + 8 * 5, 3 + 8 * 25);
        assert_eq!(column(&[p, q], 3, 30, &[early, late]), [Some(sector(early)), Some(sector(late))]);
        let both = [early, early + 8];
        assert_eq!(column(&[p, q], 3, 30, &both), both.map(|number| Some(sector(number))));
    }

    #[test]
    fn a_sector_that_never_was_there_counts_as_zeros_and_is_not_invented() {
        let sums = sums(0, 10, Some(16));
        assert_eq!(column(&sums, 0, 10, &[16, 40]), [None, Some(sector(40))]);
    }

    #[test]
    fn a_wrong_sum_makes_no_sector_of_what_cannot_be_one() {
        let [mut p, _] = sums(0, 10, None);
        p[3] ^= 0xff;
        Sum::P.seal(&mut p, SESSION, 72);
        assert_eq!(column(&[p], 0, 10, &[16]), [None, None]);
        p[20] ^= 1;
        assert_eq!(Parity::read(&p), None);
    }

    #[test]
    fn sums_are_held_against_the_sectors_and_against_each_other() {
        let (first, rows) = (3, 20);
        let numbers = || (0..rows).map(|row| first + 8 * row);
        let sums = sums(first, rows, None);
        // One bit of the named sum is wrong, with a valid check; these sectors are lost.
        let agrees = |sum: Option<usize>, wrong: Option<u32>, lost: &[u32], used: &[usize]| {
            let mut column = Column::new(SESSION);
            for index in used {
                let mut block = sums[*index];
                block[400] ^= u8::from(sum == Some(*index)) << 5;
                Sum::ALL[*index].seal(&mut block, SESSION, first + 8 * (rows - 1));
                column.sum(&Parity::read(&block).expect("it is sound"), &block);
            }
            for number in numbers().filter(|number| !lost.contains(number)) {
                let mut bytes = *sector(number).bytes();
                bytes[4] ^= u8::from(wrong == Some(number));
                column.sector(number, &bytes);
            }
            column.agrees(lost)
        };
        let (one, two) = (first + 8 * 7, first + 8 * 12);
        for lost in [&[][..], &[one], &[one, two], &[one, two, two + 8]] {
            assert!(agrees(None, None, lost, &[0, 1]) && agrees(None, None, lost, &[1]), "{lost:?}");
            let is_told = lost.len() < 2;
            for sum in [0, 1] {
                assert_eq!(!agrees(Some(sum), None, lost, &[0, 1]), is_told, "{lost:?}");
            }
            assert_eq!(!agrees(None, Some(first), lost, &[0, 1]), is_told, "{lost:?}");
            // With one sum alone, an error shows only if no sector is lost.
            assert_eq!(!agrees(None, Some(first), lost, &[0]), lost.is_empty(), "{lost:?}");
        }
        // In any order.
        let mut column = Column::new(SESSION);
        for block in &sums {
            column.sum(&Parity::read(block).expect("it is sound"), block);
        }
        numbers().rev().for_each(|number| column.sector(number, sector(number).bytes()));
        assert!(column.agrees(&[]));
    }

    #[test]
    fn every_number_but_zero_has_its_inverse_and_data_and_parity_share_a_file() {
        assert!((1..=255).all(|a| product(a, inverse(a)) == 1));
        for blocks in [0, 15, 16, 17, 512, 520, 521, 16_384] {
            let data = data_blocks(blocks);
            let stretches = data.div_ceil(STRETCH_SECTORS);
            assert!(
                data <= blocks && (stretches == 0 || parity_block(blocks, stretches - 1) >= data),
                "{blocks}"
            );
        }
        assert_eq!((data_blocks(512), data_blocks(520), data_blocks(16_384)), (496, 504, 15_872));
    }
}
