//! The end of the previous session: found once for each card, when the new session has its first sector on it.
//!
//! A segment is allocated whole and written from its beginning, so bisection finds its last sector. A segment of 8
//! MiB takes some sixty reads, and at most as many again to count the frames of its last group. That is 0.1 s of a
//! usual card, in which frames wait in the sector queue.
//!
//! A reused file holds older sectors behind its own, and nothing else before its first own sector. The file before it
//! decides: sectors that continue that file's session have higher numbers.

use crate::{BLOCK_BYTES, Block, CardDevice};
use hums_blackbox::parity::data_blocks;
use hums_blackbox::record::{LastSession, PreviousEnd};
use hums_blackbox::{GROUP_SECTORS, Header, Sector};

use crate::card::{Card, CardError, LogEntry, Segment};
use crate::directory::Newest;

/// Blocks that are searched for one sound sector: a damaged page is not the end.
const PROBE_BLOCKS: u32 = 9;
/// The end of the newest log on the card. A segment without a sector (power failed when it was made) does not count;
/// the one before it does.
pub(super) fn look<D: CardDevice>(card: &Card<'_, D>, newest: &Newest) -> LastSession {
    let number = newest.first().map_or(0, |newest| newest.name.session);
    let unreadable = LastSession { found: PreviousEnd::Unreadable, number, ..LastSession::default() };
    search(card, newest).ok().flatten().unwrap_or(unreadable)
}

fn search<D: CardDevice>(
    card: &Card<'_, D>,
    newest: &Newest,
) -> Result<Option<LastSession>, CardError<D::Error>> {
    let mut older = newest.iter();
    while let Some(entry) = older.next() {
        if let Some(before) = end_of(card, entry, older.as_slice().first())? {
            return Ok(Some(before));
        }
    }
    Ok(None)
}

/// The end of this segment; `None` if it has no sector of its own. `older` is the segment before it.
fn end_of<D: CardDevice>(
    card: &Card<'_, D>,
    entry: &LogEntry,
    older: Option<&LogEntry>,
) -> Result<Option<LastSession>, CardError<D::Error>> {
    let mut segment = Segment::of(entry);
    let mut reader = Reader { card, segment: &mut segment, block: [0; BLOCK_BYTES] };
    let begin = match older.and_then(|older| Some((older, first(card, older).ok()??))) {
        None => reader.probe(0, |_| true)?,
        Some((older, before)) => {
            let goes_on =
                |header: &Header| header.session == before.session && is_later(header.number, before.number);
            match reader.probe(0, goes_on)? {
                // A further segment of a log has nothing else; a log's first one may be of another power-on.
                None if older.name.session != entry.name.session => {
                    reader.probe(0, |header| header.session != before.session)?
                }
                found => found,
            }
        }
    };
    let Some((mut last, mut header)) = begin else { return Ok(None) };
    let session = header.session;
    let base = header.number.wrapping_sub(last);
    let mut end = data_blocks(reader.segment.blocks());
    while last + 1 < end {
        let middle = last + (end - last) / 2;
        match reader.probe(middle, |header| header.session == session)? {
            // A partial copy may lie one place behind its own; a sector further away belongs to another segment.
            Some((at, found)) if at.wrapping_sub(found.number.wrapping_sub(base)) <= 1 && at < end => {
                (last, header) = (at, found);
            }
            _ => end = middle,
        }
    }
    let end = reader.end(base, last, &header)?;
    Ok(Some(LastSession {
        found: if end.is_some() { PreviousEnd::Frames } else { PreviousEnd::Sectors },
        number: entry.name.session,
        session,
        sectors: header.number.wrapping_add(1),
        frames: end.map_or(0, |(frames, _)| frames),
        check: end.map_or(0, |(_, check)| check),
    }))
}

fn first<D: CardDevice>(card: &Card<'_, D>, entry: &LogEntry) -> Result<Option<Header>, CardError<D::Error>> {
    let mut segment = Segment::of(entry);
    let mut reader = Reader { card, segment: &mut segment, block: [0; BLOCK_BYTES] };
    Ok(reader.probe(0, |_| true)?.map(|(_, header)| header))
}

/// Modulo 2^32.
const fn is_later(number: u32, than: u32) -> bool {
    let ahead = number.wrapping_sub(than);
    ahead > 0 && ahead < 1 << 31
}

/// Reads the blocks of a log one by one.
struct Reader<'r, 'a, D: CardDevice> {
    card: &'r Card<'a, D>,
    segment: &'r mut Segment,
    block: Block,
}

impl<D: CardDevice> Reader<'_, '_, D> {
    fn header(&mut self, at: u32) -> Result<Option<Header>, CardError<D::Error>> {
        self.card.read(self.segment, at, &mut self.block)?;
        Ok(Header::read(&self.block).ok())
    }

    fn probe(
        &mut self,
        from: u32,
        wanted: impl Fn(&Header) -> bool,
    ) -> Result<Option<(u32, Header)>, CardError<D::Error>> {
        let end = from.saturating_add(PROBE_BLOCKS).min(self.segment.blocks());
        for at in from..end {
            if let Some(header) = self.header(at)?.filter(&wanted) {
                return Ok(Some((at, header)));
            }
        }
        Ok(None)
    }

    /// Frames of the session up to its last sector, and that sector's check; `None` if a sector of the last group is
    /// missing.
    fn end(
        &mut self,
        base: u32,
        last: u32,
        header: &Header,
    ) -> Result<Option<(u32, u32)>, CardError<D::Error>> {
        let first = header.group().wrapping_sub(base);
        if first > last || last - first > GROUP_SECTORS as u32 {
            return Ok(None);
        }
        let Some(begin) = self.header(first)? else { return Ok(None) };
        let Some(preamble) = Sector::from_bytes(self.block).preamble() else { return Ok(None) };
        let (mut frames, mut sector) = (preamble.frames_before, begin);
        for at in first + 1..=last {
            let Some(next) = self.header(at)?.filter(|next| next.session == header.session) else {
                return Ok(None);
            };
            if next.number == sector.number {
                // Of several copies the whole sector counts, even if a copy has more: it ends within an entry.
                let is_fuller = !next.partial || next.entries() > sector.entries();
                if sector.partial && is_fuller {
                    sector = next;
                }
            } else if next.number == sector.number.wrapping_add(1) {
                frames = frames.wrapping_add(u32::from(sector.frames));
                sector = next;
            } else {
                return Ok(None);
            }
        }
        let frames = frames.wrapping_add(u32::from(sector.frames));
        Ok((sector.number == header.number).then_some((frames, sector.check)))
    }
}
