//! `PARAMS.TXT` on the card: parameters for whoever has the card in hand, in the form that ground stations keep them.
//!
//! Read once when a card is found, unless the vehicle is armed by then; each line is set, recorded and kept as if a
//! ground station had set it, at every power-on as long as the file is there. A line that cannot be set is an event in
//! the record and a text for the ground station. [`BYTES_MAX`] of the file are read, [`LINE_MAX`] of a line.

use hums_core::time::Instant;
use hums_link::param_line::{self, Line};
use hums_recorder::CardState;

use crate::monitoring::Monitoring;
use crate::queues::{GsIn, SectorsIn};
use crate::shelf::{DATA_MAX, Want, What, Which};

/// All parameters, each in the longest line.
const BYTES_MAX: u32 = 16 * 1024;
/// A line without its comment.
const LINE_MAX: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is no card.
    NoCard,
    /// The bytes from here on are asked for.
    Reading(u32),
    /// It was read, or there is none.
    Done,
}

/// How far it is read.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    state: State,
    ticket: Option<u16>,
    line: heapless::Vec<u8, LINE_MAX>,
    /// The line is longer than there is room.
    long: bool,
    number: u16,
    refused: u16,
}

impl Settings {
    pub(crate) const fn new() -> Self {
        Self {
            state: State::NoCard,
            ticket: None,
            line: heapless::Vec::new(),
            long: false,
            number: 0,
            refused: 0,
        }
    }

    /// Whether what the card answers is ours.
    pub(crate) const fn is_reading(&self) -> bool {
        matches!(self.state, State::Reading(_))
    }

    /// A byte of the file; `true` at the end of a line.
    fn take(&mut self, byte: u8) -> bool {
        if byte != b'\n' {
            let comment = self.line.contains(&b'#');
            self.long |= !comment && self.line.push(byte).is_err();
        }
        byte == b'\n'
    }
}

impl Monitoring<'_> {
    /// Reads on, a piece at a tick.
    pub(crate) fn settings(&mut self, now: Instant, sectors: &mut SectorsIn, gs: &mut GsIn) {
        let has_card = self.card.read().state == CardState::Recording;
        let armed = self.monitor.vehicle().armed();
        let settings = &mut self.companion.settings;
        match settings.state {
            State::NoCard if has_card => {
                let state = if armed { State::Done } else { State::Reading(0) };
                *settings = Settings { state, ..Settings::new() };
            }
            State::Done if !has_card => settings.state = State::NoCard,
            State::Reading(offset) => self.read_on(now, offset, sectors, gs),
            State::NoCard | State::Done => {}
        }
    }

    fn read_on(&mut self, now: Instant, offset: u32, sectors: &mut SectorsIn, gs: &mut GsIn) {
        let Some(ticket) = self.companion.settings.ticket else {
            let ticket = self.companion.library.next_ticket();
            if gs.shelf.want(Want { ticket, which: Which::Settings, what: What::Data(offset) }) {
                self.companion.settings.ticket = Some(ticket);
            }
            return;
        };
        let mut piece = heapless::Vec::<u8, DATA_MAX>::new();
        let mut bytes = None;
        gs.shelf.answer(|answer, data| {
            if answer.ticket == ticket {
                bytes = Some(answer.bytes.min(BYTES_MAX));
                // Fits: an answer is never longer.
                let _ = piece.extend_from_slice(data);
            }
            true
        });
        let Some(bytes) = bytes else { return };
        self.companion.settings.ticket = None;
        for byte in &piece {
            if self.companion.settings.take(*byte) {
                self.line(now, sectors);
            }
        }
        let next = offset + piece.len() as u32;
        if !piece.is_empty() && next < bytes {
            self.companion.settings.state = State::Reading(next);
            return;
        }
        self.line(now, sectors);
        self.companion.settings.state = State::Done;
        if self.companion.settings.refused > 0 {
            self.note(now, 4, "HUMS: PARAMS.TXT has lines that are refused", sectors);
        }
    }

    /// Sets what a line says.
    fn line(&mut self, now: Instant, sectors: &mut SectorsIn) {
        let settings = &mut self.companion.settings;
        settings.number = settings.number.saturating_add(1);
        let (number, long) = (settings.number, core::mem::take(&mut settings.long));
        let line = core::mem::take(&mut settings.line);
        let set = match core::str::from_utf8(&line).map(param_line::read) {
            _ if long => false,
            Ok(Line::Nothing) => true,
            Ok(Line::Set(name, value)) => param_line::value(value)
                .is_some_and(|value| self.set_by_link(now, name, value, (0, 0), sectors)),
            Ok(Line::Wrong) | Err(_) => false,
        };
        if !set {
            self.companion.settings.refused = self.companion.settings.refused.saturating_add(1);
            self.tell_event(now, format_args!("PARAMS.TXT: line {number} is refused"), sectors);
        }
    }
}
