//! What of the sectors belongs to no item: what power cut short, and damage.
//!
//! [`sequential_storage`] passes over an item whose checks do not hold, so that the value before it counts, and tells nobody.
//! Its items, as its `item.rs` (version 8) describes them: a CRC-32 of the data, their length in two bytes, a CRC-16 of the
//! length, the data, zeros up to a word.
//!
//! Power that went in the middle of a save leaves such a place too, and its old value is what is promised then. It is told
//! from damage by what stands around it: the next start counts itself behind it, or nothing is behind it; and its end is not
//! written, where a whole item ends with a zero. (The last item before a start whose end itself is damaged is taken for one that
//! power cut short.)

use crate::key::Key;
use crate::marks::{HEADER_BYTES, WORD};

/// Bytes of an item before its data.
const HEAD_BYTES: usize = 8;
/// What two starts in a row leave whose power went at the head of their first item.
const HEADS_BYTES: usize = 2 * HEAD_BYTES;

/// What a look found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Look {
    /// Items whose checks hold.
    pub(crate) items: u32,
    /// Places where there was one, or that are no longer erased.
    pub(crate) damaged: u32,
}

/// Looks through a sector: its items go on to `end`, and so many bytes before that are erased.
pub(crate) fn look_through<E>(
    end: usize,
    erased: usize,
    mut read: impl FnMut(usize, &mut [u8]) -> Result<(), E>,
    look: &mut Look,
) -> Result<(), E> {
    let mut at = HEADER_BYTES + WORD;
    // In a place that is no item: whether power may have left all of it, and the bytes that are no head of an item.
    let (mut place, mut no_head) = (None, 0);
    while at + HEAD_BYTES <= end {
        let mut head = [0; HEAD_BYTES];
        read(at, &mut head)?;
        if head == [0xFF; HEAD_BYTES] {
            break;
        }
        let [a, b, c, d, low, high, check @ ..] = head;
        let length = usize::from(u16::from_le_bytes([low, high]));
        let next = at + HEAD_BYTES + length.next_multiple_of(WORD);
        if crc_16(&[low, high]) != u16::from_le_bytes(check) || next > end {
            no_head += WORD;
            place = Some(place.unwrap_or(true) && no_head <= HEADS_BYTES);
            at += WORD;
            continue;
        }
        no_head = 0;
        let (key, check) = data(at + HEAD_BYTES, length, &mut read)?;
        if check == u32::from_le_bytes([a, b, c, d]) {
            look.items += 1;
            let may_be_cut = key == Key::MOUNTS;
            look.damaged += u32::from(place.take().is_some_and(|is_cut| !(is_cut && may_be_cut)));
        } else {
            place = Some(place.unwrap_or(true) && !is_ended(at + HEAD_BYTES, length, &mut read)?);
        }
        at = next;
    }
    look.damaged += u32::from(place == Some(false));
    if at + erased < end {
        // What is free is not erased.
        look.damaged += 1;
    }
    Ok(())
}

/// Whether an item's data was written to its end: the zero that ends it, and those up to the word.
fn is_ended<E>(
    at: usize,
    length: usize,
    read: &mut impl FnMut(usize, &mut [u8]) -> Result<(), E>,
) -> Result<bool, E> {
    let Some(last) = length.checked_sub(1) else { return Ok(true) };
    let mut end = [0; WORD];
    read(at + last / WORD * WORD, &mut end)?;
    Ok(end.iter().skip(last % WORD).all(|byte| *byte == 0))
}

/// The key and the check of an item's data.
fn data<E>(
    at: usize,
    length: usize,
    read: &mut impl FnMut(usize, &mut [u8]) -> Result<(), E>,
) -> Result<(Key, u32), E> {
    let (mut key, mut crc) = ([0xFF; WORD], CRC_32_BEGIN);
    for place in (0..length).step_by(WORD) {
        let mut word = [0; WORD];
        read(at + place, &mut word)?;
        if place == 0 {
            key = word;
        }
        crc = crc_32(crc, word.get(..WORD.min(length - place)).unwrap_or_default());
    }
    // A check is never 0, which stands for an item that was removed, and neither 0 nor erased in its first byte.
    let check = !crc;
    let first = check as u8;
    let check = if first == 0 || first == 0xFF { check ^ 1 } else { check };
    Ok((Key::from_stored(u32::from_le_bytes(key)), check))
}

/// CRC-16F/4.2 (Koopman), bits reflected, never all ones.
fn crc_16(bytes: &[u8]) -> u16 {
    let crc = !bytes.iter().fold(0xFFFF_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x1A2E } else { crc >> 1 })
    });
    if crc == 0xFFFF { 0xFFFE } else { crc }
}

/// What the check of data begins with.
const CRC_32_BEGIN: u32 = 0xEEEE_EEEE;

/// CRC-32C of more bytes, before it is inverted at the end.
fn crc_32(crc: u32, bytes: &[u8]) -> u32 {
    bytes.iter().fold(crc, |crc, byte| {
        (0..8).fold(
            crc ^ u32::from(*byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82F6_3B78 } else { crc >> 1 },
        )
    })
}
