//! Texts about the card's slot: the reason why recording stopped, and its resumption.

use hums_core::clock::{Instant, Span};
use hums_recorder::CardState;

use crate::journal::Logbook;
use crate::notices::Notice;

/// Minimum time between two texts, so that a card that comes and goes does not fill the line.
const QUIET: Span = Span::from_secs(5);
/// `MAV_SEVERITY`
const WARNING: u8 = 4;
const NOTICE: u8 = 5;
const CARD_IN: u8 = 6;
const CARD_OUT: u8 = 7;

#[derive(Clone, Copy, Debug)]
pub(super) struct CardNotices {
    told: CardState,
    told_at: Option<Instant>,
}

impl CardNotices {
    pub(super) const fn new() -> Self {
        Self { told: CardState::Unknown, told_at: None }
    }

    /// A good state at the beginning is not reported: the heartbeat has it.
    pub(super) fn tick(&mut self, now: Instant, book: &mut Logbook<'_>) {
        let state = book.card.read().state;
        if state == self.told || self.told_at.is_some_and(|at| now.since(at) < QUIET) {
            return;
        }
        let Some(text) = words(state) else { return };
        let is_first = self.told == CardState::Unknown && state == CardState::Recording;
        *self = Self { told: state, told_at: Some(now).filter(|_| !is_first) };
        let number = if state == CardState::Recording { CARD_IN } else { CARD_OUT };
        book.journal.event(now, number, text);
        if !is_first {
            let severity = if state == CardState::Recording { NOTICE } else { WARNING };
            // With a full queue the finding still reports that recording stopped.
            book.notices.push(Notice::Text(severity, text));
        }
    }
}

/// One STATUSTEXT each; `docs/cards.md` has the remedies. None advises to format a card: it may hold logs, which only
/// a search of all its blocks finds.
const fn words(state: CardState) -> Option<&'static str> {
    Some(match state {
        CardState::Unknown | CardState::Finished => return None,
        CardState::Recording => "HUMS: card: recording",
        CardState::Absent => "HUMS: card: none found, push one in",
        CardState::Foreign => "HUMS: card: not FAT32, look at it on a PC",
        CardState::ExFat => "HUMS: card: exFAT, look at it on a PC",
        CardState::Unpartitioned => "HUMS: card: unpartitioned, look at it on a PC",
        CardState::Damaged => "HUMS: card: FAT32 is damaged, copy it on a PC",
        CardState::Full => "HUMS: card: full of other files, delete some",
        CardState::Failing => "HUMS: card: fails, use another one",
        CardState::Locked => "HUMS: card: write protected, use another one",
        CardState::Formatting => "HUMS: card: is being formatted",
    })
}

#[cfg(test)]
mod tests {
    use hums_link::statustext::TEXT_BYTES_MAX;

    use super::*;

    const STATES: [CardState; 12] = [
        CardState::Unknown,
        CardState::Recording,
        CardState::Absent,
        CardState::Foreign,
        CardState::Full,
        CardState::Failing,
        CardState::Finished,
        CardState::Locked,
        CardState::ExFat,
        CardState::Unpartitioned,
        CardState::Damaged,
        CardState::Formatting,
    ];

    #[test]
    fn every_text_is_one_message() {
        for text in STATES.into_iter().filter_map(words) {
            assert!(text.len() <= TEXT_BYTES_MAX && text.starts_with("HUMS: card: "), "{text}");
        }
    }
}
