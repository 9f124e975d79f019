//! `PARAMS.TXT` on the card: parameters in the form of ground stations, set by inserting the card.
//!
//! Nothing in it is set in flight. The file waits for a heartbeat that reports disarmed. It is not read, or not
//! further, once the vehicle is armed, or after a reset that may have come in flight
//! ([`ResetCause::may_be_in_flight`](crate::ResetCause::may_be_in_flight)). Only another card, with another volume's
//! serial number, ends that. If heartbeats stop, reading begins anew with the next one. The parameters that may be
//! set in flight follow one rule for the file and for ground stations ([`Logbook::set_parameter`]).
//!
//! A line may replace a part that is due, so the wear of parts is judged only after the file.
//!
//! Each line is set, recorded and stored like a setting by a ground station, at every power-on as long as the file is
//! there. A refused line is an event in the record and a text for the ground station. [`BYTES_MAX`] of the file are
//! read, [`LINE_MAX`] of a line. The last line is refused if the file's end was not read.

use hums_core::clock::{Instant, Span};
use hums_core::component::Label;
use hums_link::param_line::{self, Line};
use hums_recorder::CardState;

use super::library::Library;
use crate::journal::{Arming, Logbook};
use crate::records;
use crate::shelf::{LogRequest, Reader, RequestedLog, RequestedPart};

/// Enough for all parameters, each in the longest line.
const BYTES_MAX: u32 = 16 * 1024;
/// A card that is there is open by then; without one, no file replaces a part.
const CARD_COMES: Span = Span::from_secs(10);
const LINE_MAX: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting,
    Reading(u32),
    /// The file of this volume is read, or must not be.
    Done(u32),
}

/// Progress of reading.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    state: State,
    ticket: Option<u16>,
    line: heapless::Vec<u8, LINE_MAX>,
    /// The line is too long, or its end was not read.
    is_cut: bool,
    number: u16,
    refused: u16,
}

impl Settings {
    pub(crate) const fn new() -> Self {
        Self {
            state: State::Waiting,
            ticket: None,
            line: heapless::Vec::new(),
            is_cut: false,
            number: 0,
            refused: 0,
        }
    }

    pub(crate) const fn is_reading(&self) -> bool {
        matches!(self.state, State::Reading(_))
    }

    fn take(&mut self, byte: u8) -> bool {
        if byte != b'\n' {
            let comment = self.line.contains(&b'#');
            self.is_cut |= !comment && self.line.push(byte).is_err();
        }
        byte == b'\n'
    }

    pub(crate) fn tick(
        &mut self,
        now: Instant,
        library: &mut Library,
        book: &mut Logbook<'_>,
        shelf: &mut Reader<'_>,
    ) {
        let reading = book.card.read();
        let has_card = reading.state == CardState::Recording;
        let done = State::Done(reading.volume);
        let is_read = matches!(self.state, State::Done(_));
        book.monitor.set_parts_known(is_read || !has_card && now.since(Instant::ZERO) >= CARD_COMES);
        match (self.state, book.arming(now)) {
            (State::Done(_), _) if !has_card || self.state == done => {}
            _ if !has_card => self.state = State::Waiting,
            (_, Arming::Armed) => self.state = done,
            _ if book.cause.may_be_in_flight() => self.state = done,
            (_, Arming::Unknown) => self.state = State::Waiting,
            (State::Waiting | State::Done(_), Arming::Disarmed) => {
                *self = Self { state: State::Reading(0), ..Self::new() };
            }
            (State::Reading(offset), Arming::Disarmed) => {
                if !self.read_on(now, offset, library, book, shelf) {
                    return;
                }
                self.state = done;
                if self.refused > 0 {
                    let text = "HUMS: PARAMS.TXT: lines refused, correct them";
                    book.note(now, 4, text);
                }
            }
        }
    }

    fn read_on(
        &mut self,
        now: Instant,
        offset: u32,
        library: &mut Library,
        book: &mut Logbook<'_>,
        shelf: &mut Reader<'_>,
    ) -> bool {
        let Some(ticket) = self.ticket else {
            let ticket = library.next_ticket();
            if shelf.want(LogRequest {
                ticket,
                which: RequestedLog::Settings,
                what: RequestedPart::Data(offset),
            }) {
                self.ticket = Some(ticket);
            }
            return false;
        };
        let Some((answer, piece)) = shelf.answer(ticket) else { return false };
        let length = answer.bytes;
        self.ticket = None;
        for byte in piece {
            if self.take(*byte) {
                self.line(now, book);
            }
        }
        let count = piece.len() as u32;
        shelf.release();
        let next = offset + count;
        if count > 0 && next < length.min(BYTES_MAX) {
            self.state = State::Reading(next);
            return false;
        }
        self.is_cut |= next != length;
        self.line(now, book);
        true
    }

    fn line(&mut self, now: Instant, book: &mut Logbook<'_>) {
        self.number = self.number.saturating_add(1);
        let (number, is_cut) = (self.number, core::mem::take(&mut self.is_cut));
        let line = core::mem::take(&mut self.line);
        let set = match core::str::from_utf8(&line).map(param_line::read) {
            _ if is_cut => false,
            Ok(Line::Nothing) => true,
            Ok(Line::Set(name, value)) => match place_of_serial(name) {
                Some(place) => replace_old(place, value, now, book),
                None => {
                    param_line::value(value).is_some_and(|value| book.set_parameter(now, name, value, (0, 0)))
                }
            },
            Ok(Line::Wrong) | Err(_) => false,
        };
        if !set {
            self.refused = self.refused.saturating_add(1);
            book.journal.by_hand(now, format_args!("PARAMS.TXT: line {number} is refused"));
        }
    }
}

fn place_of_serial(name: &str) -> Option<usize> {
    let place = name.strip_prefix("CMP")?.strip_suffix("_SERIAL")?;
    place.parse::<usize>().ok()?.checked_sub(1).filter(|_| place.len() == 1)
}

/// `NEW<OLD` replaces the part with the serial number OLD, which may be empty, by the part NEW. The file is read at each power-on:
/// if the place has another part by then, the line is over.
fn replace_old(place: usize, value: &str, now: Instant, book: &mut Logbook<'_>) -> bool {
    let Some((new, old)) = value.split_once('<').filter(|(new, _)| !new.is_empty()) else { return false };
    // Its kind may stand in a line before.
    book.monitor.describe_component(place);
    let known = book.monitor.components().get(place).map(|part| part.serial);
    known != Some(Label::new(old)) || records::replace_component(now, place, new, (0, 0), book)
}

#[cfg(test)]
mod tests;
