//! Where the session before this one ended: looked for once for each card, when the session has its first sector on it.
//!
//! A segment is allocated whole and written from its beginning, so its last sector is found by bisection: some sixty
//! reads of a segment of 8 MiB, and as many again at most to count the frames of its last group. That is 0.1 s of a usual
//! card, in which frames wait in the sector queue.

use embedded_sdmmc::Block;
use hums_blackbox::parity::data_blocks;
use hums_blackbox::record::{Before, Found};
use hums_blackbox::{GROUP_SECTORS, Header, Sector};

use crate::CardDevice;
use crate::card::{Card, CardError, Segment};
use crate::name::LogName;

/// Blocks that are looked at for one sound sector: a damaged page is not the end.
const PROBE_BLOCKS: u32 = 9;
/// Segments that are looked at, the newest first: one that was made when the power went has no sector yet.
const SEGMENTS_MAX: u32 = 3;

/// What the newest log on the card, whose last segment is `newest`, ended with.
pub(super) fn look<D: CardDevice>(card: &Card<'_, D>, newest: LogName) -> Before {
    let mut name = newest;
    let unreadable = Before { found: Found::Unreadable, number: name.session, ..Before::default() };
    for _ in 0..SEGMENTS_MAX {
        match end_of(card, name) {
            Ok(Some(before)) => return before,
            Ok(None) => {}
            Err(_) => return unreadable,
        }
        let Ok(Some(older)) = older(card, name) else { break };
        name = older;
    }
    unreadable
}

/// The newest segment that is older than this one.
fn older<D: CardDevice>(card: &Card<'_, D>, than: LogName) -> Result<Option<LogName>, CardError<D::Error>> {
    let mut older = None;
    card.logs(|entry| {
        if entry.name < than {
            older = older.max(Some(entry.name));
        }
    })?;
    Ok(older)
}

/// Where this segment ends; `None` where it has no sector.
fn end_of<D: CardDevice>(card: &Card<'_, D>, name: LogName) -> Result<Option<Before>, CardError<D::Error>> {
    let mut segment = card.segment(name)?;
    let mut reader = Reader { card, segment: &mut segment, block: Block::new() };
    let Some((mut last, mut header)) = reader.probe(0, None)? else { return Ok(None) };
    let session = header.session;
    // Number less place: that of the segment's first sector.
    let base = header.number.wrapping_sub(last);
    let mut end = data_blocks(reader.segment.blocks());
    while last + 1 < end {
        let middle = last + (end - last) / 2;
        match reader.probe(middle, Some(session))? {
            // A partial copy may lie one place further than its own; what is far from its place is another's.
            Some((at, found)) if at.wrapping_sub(found.number.wrapping_sub(base)) <= 1 && at < end => {
                (last, header) = (at, found);
            }
            _ => end = middle,
        }
    }
    let frames = reader.frames(base, last, &header)?;
    Ok(Some(Before {
        found: if frames.is_some() { Found::Frames } else { Found::Sectors },
        number: name.session,
        session,
        sectors: header.number.wrapping_add(1),
        frames: frames.unwrap_or(0),
    }))
}

/// Reads a segment's blocks one by one.
struct Reader<'r, 'a, D: CardDevice> {
    card: &'r Card<'a, D>,
    segment: &'r mut Segment,
    block: Block,
}

impl<D: CardDevice> Reader<'_, '_, D> {
    /// The sector in this block, if there is one.
    fn header(&mut self, at: u32) -> Result<Option<Header>, CardError<D::Error>> {
        self.card.read(self.segment, at, &mut self.block)?;
        Ok(Header::read(&self.block.contents).ok())
    }

    /// The first sound sector from this block on, of this session or of any.
    fn probe(
        &mut self,
        from: u32,
        session: Option<u32>,
    ) -> Result<Option<(u32, Header)>, CardError<D::Error>> {
        let end = from.saturating_add(PROBE_BLOCKS).min(self.segment.blocks());
        for at in from..end {
            if let Some(header) = self.header(at)?
                && session.is_none_or(|session| session == header.session)
            {
                return Ok(Some((at, header)));
            }
        }
        Ok(None)
    }

    /// Frames of the session up to its last sector; `None` where a sector of the last group is missing.
    fn frames(&mut self, base: u32, last: u32, header: &Header) -> Result<Option<u32>, CardError<D::Error>> {
        let first = header.group().wrapping_sub(base);
        if first > last || last - first > GROUP_SECTORS as u32 {
            return Ok(None);
        }
        let Some(begin) = self.header(first)? else { return Ok(None) };
        let Some(preamble) = Sector::from_bytes(self.block.contents).preamble() else { return Ok(None) };
        let mut frames = preamble.frames_before;
        let (mut number, mut fullest) = (begin.number, u32::from(begin.frames));
        for at in first + 1..=last {
            let Some(next) = self.header(at)?.filter(|next| next.session == header.session) else {
                return Ok(None);
            };
            if next.number == number {
                fullest = fullest.max(u32::from(next.frames));
            } else if next.number == number.wrapping_add(1) {
                frames = frames.wrapping_add(fullest);
                (number, fullest) = (next.number, u32::from(next.frames));
            } else {
                return Ok(None);
            }
        }
        Ok((number == header.number).then_some(frames.wrapping_add(fullest)))
    }
}
