//! A log's blocks as groups of sectors: what belongs to the session, in order, each sector once.
//!
//! Around them a log holds what is no part of it: space set aside, sectors of earlier sessions that a segment was
//! written over, copies of a sector in progress. What is missing between two sectors is counted here; what that cost
//! in frames and time, the decoding tells.

use anyhow::Result;
use hums_blackbox::sector::{GROUP_SECTORS, Header, NotASector, Sector};

use super::places::{Blocks, Log};

/// One group: sectors that decode together, in order, without a hole.
#[derive(Clone, Debug)]
pub struct Group {
    /// The sectors with their headers; the first one begins the group unless `headless`.
    pub sectors: Vec<(Header, Sector)>,
    /// Sectors missing directly before it.
    pub missing_before: u64,
    /// Its beginning is missing, so nothing of it can be decoded.
    pub headless: bool,
}

/// What was seen of a log so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Sectors of the session that were used.
    pub sectors: u64,
    /// Blocks that begin as a sector does and whose check fails: torn or damaged.
    pub damaged: u64,
    /// Sectors that are missing between others.
    pub missing: u64,
    /// Sectors of this session that stand where newer ones should: copies, or out of order.
    pub repeated: u64,
    /// Sectors of other sessions: left over from an earlier file.
    pub stale: u64,
    /// Sectors of a format version that this program does not know.
    pub newer: u64,
    /// The session was ended in order.
    pub closed: bool,
}

/// Streams a log's groups.
pub struct Groups<'a> {
    blocks: Blocks<'a>,
    session: Option<u32>,
    tally: Tally,
    /// The next number that is expected.
    next: Option<u32>,
    /// The fullest copy of a sector in progress that no full sector superseded yet.
    partial: Option<(Header, Sector)>,
    /// Sectors in order, not yet handed on.
    group: Option<Group>,
    ready: Option<Group>,
    ended: bool,
}

impl<'a> Groups<'a> {
    /// The groups of a log.
    pub fn new(log: &'a Log) -> Self {
        Self {
            blocks: log.blocks(),
            session: log.session,
            tally: Tally::default(),
            next: None,
            partial: None,
            group: None,
            ready: None,
            ended: false,
        }
    }

    /// What was seen so far.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// The session that its sectors name, once one was seen.
    pub fn session(&self) -> Option<u32> {
        self.session
    }

    /// The next group; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Group>> {
        loop {
            if let Some(group) = self.ready.take() {
                return Ok(Some(group));
            }
            if self.ended {
                return Ok(self.group.take());
            }
            match self.blocks.next()? {
                Some(block) => self.block(&block),
                None => {
                    self.ended = true;
                    if let Some((header, sector)) = self.partial.take() {
                        self.sector(header, sector);
                    }
                }
            }
        }
    }

    fn block(&mut self, block: &[u8; 512]) {
        let header = match Header::read(block) {
            Ok(header) => header,
            Err(NotASector::Damaged) => return self.tally.damaged += 1,
            Err(NotASector::OtherVersion(_)) => return self.tally.newer += 1,
            Err(NotASector::Empty | NotASector::Foreign) => return,
        };
        if *self.session.get_or_insert(header.session) != header.session {
            self.tally.stale += 1;
            return;
        }
        if self.next.is_some_and(|next| header.number < next) {
            self.tally.repeated += u64::from(!header.partial);
            return;
        }
        let sector = Sector::from_bytes(*block);
        match self.partial.take() {
            // Of two copies in progress the fuller one; a full sector supersedes both.
            Some((held, copy)) if held.number == header.number => {
                if header.partial && held.entries() >= header.entries() {
                    self.partial = Some((held, copy));
                    return;
                }
            }
            Some((held, copy)) if held.number < header.number => self.sector(held, copy),
            // A copy of a later sector before a full earlier one: no writer does that, the full one counts.
            _ => {}
        }
        if header.partial {
            self.partial = Some((header, sector));
        } else {
            self.sector(header, sector);
        }
    }

    /// The next sector in order.
    fn sector(&mut self, header: Header, sector: Sector) {
        // A log whose beginning was overwritten or is missing begins with a number beyond 0.
        let missing = u64::from(header.number.saturating_sub(self.next.unwrap_or(0)));
        self.next = Some(header.number.saturating_add(1));
        self.tally.sectors += 1;
        self.tally.missing += missing;
        self.tally.closed = header.closed;
        let continues = missing == 0 && !header.starts_group();
        match &mut self.group {
            Some(group) if continues && group.sectors.len() < GROUP_SECTORS => group.sectors.push((header, sector)),
            _ => {
                let headless = !header.starts_group();
                let group = Group { sectors: vec![(header, sector)], missing_before: missing, headless };
                self.ready = self.group.replace(group);
            }
        }
    }
}
