//! Decoding one group: sectors in, entries out. Groups are independent, so a host decodes many in parallel.

use hums_core::clock::Instant;

use crate::chain;
use crate::codec::{self, DecodedEntry, Frame, Kind, Model, Recall, SLOTS};
use crate::coder::{Decoder, LOOKAHEAD, SymbolReader};
use crate::layouts;
use crate::limits::ENTRY_BYTES_MAX;
use crate::preamble::{PREAMBLE_BYTES, Preamble};
use crate::record::Record;
use crate::sector::{BODY_BYTES, GROUP_SECTORS, Header, Sector};
use crate::zeros;

/// An entry of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entry<'a> {
    /// A frame as it was received.
    Frame {
        /// When, on the monitor's clock; whole milliseconds.
        at: Instant,
        /// The frame, from magic byte to checksum or signature.
        bytes: &'a [u8],
        /// The checksum matches the monitor's definition.
        verified: bool,
    },
    /// A record of the monitor's own.
    Record {
        /// When, on the monitor's clock; whole milliseconds.
        at: Instant,
        /// The record.
        record: Record<'a>,
    },
}

/// An entry without a frame's bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline<'a> {
    /// Its bytes were not put together.
    Frame {
        /// When, on the monitor's clock; whole milliseconds.
        at: Instant,
        /// Its message id.
        id: u32,
        /// The length, from magic byte to checksum or signature.
        bytes: usize,
        /// The checksum matches the monitor's definition.
        verified: bool,
    },
    /// The whole entry: a record, bytes outside frames, or a frame with unknown flags.
    Whole(Entry<'a>),
}

/// Why a group, or the rest of it, cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupError {
    /// The sector is not the next one of this group.
    OutOfOrder,
    /// It was written with layouts that this build does not know.
    UnknownLayouts(u32),
    /// Its sectors are sound, but their content is not a writer's.
    Corrupt,
    /// The entries that the last sector completes are not those that came: the recorder's memory had changed.
    Altered,
}

impl core::fmt::Display for GroupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::OutOfOrder => f.write_str("the sector is not the next one of its group"),
            Self::UnknownLayouts(hash) => {
                write!(f, "written with the message layouts {hash:08x}, which this program does not know")
            }
            Self::Corrupt => f.write_str("the sectors are sound, but their content is not"),
            Self::Altered => f.write_str("the entries are not those that came"),
        }
    }
}

impl core::error::Error for GroupError {}

/// The decoder of one group; `begin` makes it ready for the next one. It is large (see `size_of`): box it.
pub struct GroupDecoder {
    model: Model,
    recall: Recall,
    last_frames: [Frame; SLOTS],
    decoder: Decoder,
    input: [u8; GROUP_SECTORS * BODY_BYTES],
    filled: usize,
    last: Option<Header>,
    /// Entries that the sectors taken complete and that were not given out yet.
    due: u32,
    /// The check of the session's entries up to the last one given out; `None` where one was not given out whole.
    chain: Option<u32>,
    /// The last one is not in it yet.
    is_unchecked: bool,
    frames: u32,
    preamble: Preamble,
    entry: [u8; ENTRY_BYTES_MAX],
    decoded: DecodedEntry,
    apart: Option<usize>,
}

impl GroupDecoder {
    /// Waits for a group.
    #[expect(clippy::large_stack_arrays, reason = "it is boxed by whoever makes one")]
    pub fn new() -> Self {
        Self {
            model: zeros(),
            recall: Recall::new(),
            last_frames: zeros(),
            decoder: Decoder::new(&[], 0),
            input: [0; GROUP_SECTORS * BODY_BYTES],
            filled: 0,
            last: None,
            due: 0,
            chain: None,
            is_unchecked: false,
            frames: 0,
            preamble: Preamble::default(),
            entry: [0; ENTRY_BYTES_MAX],
            decoded: DecodedEntry { kind: Kind::Record, at_ms: 0, len: 0 },
            apart: None,
        }
    }

    /// Checked by `Header::read`; one that starts a group drops the rest of the previous one.
    pub fn push(&mut self, header: &Header, sector: &Sector) -> Result<(), GroupError> {
        if header.starts_group() {
            self.begin(header, sector)?;
        } else if !self.last.is_some_and(|last| follows(&last, header)) {
            self.last = None;
            return Err(GroupError::OutOfOrder);
        } else {
            self.fill(header, sector);
        }
        self.last = Some(*header);
        self.due += header.entries();
        Ok(())
    }

    fn begin(&mut self, header: &Header, sector: &Sector) -> Result<(), GroupError> {
        self.last = None;
        self.filled = 0;
        self.due = 0;
        self.frames = 0;
        let body = sector.body().get(..header.body_bytes).unwrap_or_default();
        self.preamble = Preamble::read(body).ok_or(GroupError::Corrupt)?;
        (self.chain, self.is_unchecked) = (body.get(..PREAMBLE_BYTES).map(chain::begun), false);
        if self.preamble.layouts != layouts::CURRENT {
            return Err(GroupError::UnknownLayouts(self.preamble.layouts));
        }
        self.model.reset(self.preamble.start_ms);
        self.recall.reset();
        self.fill(header, sector);
        self.decoder = Decoder::new(self.stream(), PREAMBLE_BYTES);
        Ok(())
    }

    fn fill(&mut self, header: &Header, sector: &Sector) {
        let end = self.filled + header.body_bytes;
        if let (Some(place), Some(body)) =
            (self.input.get_mut(self.filled..end), sector.body().get(..header.body_bytes))
        {
            place.copy_from_slice(body);
            self.filled = end;
        }
    }

    fn stream(&self) -> &[u8] {
        self.input.get(..self.filled).unwrap_or_default()
    }

    /// The next entry in the sectors so far; `None`: it needs more sectors. After an error the group is over. After
    /// [`GroupError::Altered`] the entries of the last sector, already returned, may be wrong.
    pub fn next_entry(&mut self) -> Option<Result<Entry<'_>, GroupError>> {
        match self.advance()? {
            Ok(()) => Some(Ok(self.entry())),
            Err(error) => Some(Err(error)),
        }
    }

    /// The same for counting only: without reassembled frames and their checksums, an eighth of the work. After such
    /// an entry the rest of a group is not compared with its check.
    pub fn next_outline(&mut self) -> Option<Result<Outline<'_>, GroupError>> {
        if let Err(error) = self.advance()? {
            return Some(Err(error));
        }
        let DecodedEntry { kind, at_ms, len: bytes } = self.decoded;
        let frame = self.apart.and_then(|index| self.last_frames.get(index));
        if let (Kind::Frame { verified }, Some(id)) = (kind, frame.and_then(Frame::known_id)) {
            return Some(Ok(Outline::Frame { at: Instant::from_millis(at_ms), id, bytes, verified }));
        }
        Some(Ok(Outline::Whole(self.entry())))
    }

    fn advance(&mut self) -> Option<Result<(), GroupError>> {
        let last = self.last?;
        if core::mem::take(&mut self.is_unchecked) {
            // It was not given out whole.
            self.chain = None;
        }
        if self.due == 0 {
            let is_right = self.chain.is_none_or(|chain| chain == last.check);
            if is_right {
                return None;
            }
            self.last = None;
            return Some(Err(GroupError::Altered));
        }
        self.due -= 1;
        let input = self.input.get(..self.filled).unwrap_or_default();
        let mut coder = SymbolReader { decoder: &mut self.decoder, input, recall: &mut self.recall };
        match self.model.decode(&mut coder, &mut self.last_frames, &mut self.entry) {
            // Reading on beyond the end is only right where the stream ends.
            Ok((decoded, apart)) if self.decoder.position() <= input.len() + LOOKAHEAD => {
                self.frames += u32::from(decoded.kind != Kind::Record);
                (self.decoded, self.apart) = (decoded, apart);
                self.is_unchecked = true;
                Some(Ok(()))
            }
            _ => {
                self.last = None;
                Some(Err(GroupError::Corrupt))
            }
        }
    }

    fn entry(&mut self) -> Entry<'_> {
        if let Some(frame) = self.apart.take().and_then(|index| self.last_frames.get_mut(index)) {
            frame.assemble(self.recall.seed, &mut self.entry);
        }
        let at = Instant::from_millis(self.decoded.at_ms);
        let bytes = self.entry.get(..self.decoded.len).unwrap_or_default();
        if core::mem::take(&mut self.is_unchecked)
            && let Some(chain) = &mut self.chain
        {
            let DecodedEntry { kind, at_ms, .. } = self.decoded;
            *chain = chain::after(*chain, chain::value_of(&codec::CodedEntry { kind, at_ms, bytes }));
        }
        match self.decoded.kind {
            Kind::Frame { verified } => Entry::Frame { at, bytes, verified },
            Kind::Record => Entry::Record { at, record: Record::read(bytes) },
        }
    }

    /// Returned from this group so far.
    pub const fn frames(&self) -> u32 {
        self.frames
    }

    /// Preamble of the group.
    pub const fn preamble(&self) -> Preamble {
        self.preamble
    }
}

fn follows(last: &Header, next: &Header) -> bool {
    last.session == next.session
        && last.number.wrapping_add(1) == next.number
        && last.since_first + 1 == next.since_first
        && !last.partial
        && !last.closed
}
