//! The update file on the card: storage looks at its header once for each card, and the monitor asks for the installation.
//!
//! The board then ends its log and restarts into the resident program (`hums_update`), which checks the whole file. Conditions:
//! * the vehicle is disarmed and on the ground for 10 s, or no frame has come in the first minute after power-on;
//! * the start was not one that may have come in flight, such as a reset by the watchdog;
//! * this image is confirmed, and the resident program has refused nothing since power-on, or since the card before.

use hums_core::clock::{Instant, Span};
use hums_recorder::shared::Shared;
use hums_recorder::{BLOCK_BYTES, CardDevice, CardState, CardStatus, Recorder};
use hums_update::header::{self, Header, NO_WISH, Refusal};
use hums_update::message::Message;
use hums_update::state::{State, Status};

use crate::ResetCause;
use crate::persist::EraseMoment;

/// Without a frame since power-on.
const SILENT: Span = Span::from_secs(60);
/// A new image records for so long before it is confirmed.
pub const TRIAL: Span = Span::from_secs(60);

/// The update file of the card, for the monitor.
pub type UpdateStatus = Shared<Option<UpdateOffer>>;

/// An update file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateOffer {
    /// Its header is good.
    Offered,
    /// It is not for this board now.
    Refused(Refusal),
}

/// The running image.
#[derive(Clone, Debug)]
pub struct RunningImage<'a> {
    /// Its board.
    pub board: &'a str,
    /// Its header; `None` if the image runs without one.
    pub header: Option<Header>,
    /// The trials.
    pub state: State,
}

impl RunningImage<'_> {
    fn id(&self) -> u32 {
        self.header.as_ref().map_or(0, Header::id)
    }

    /// Whether it must still show itself.
    pub fn is_on_trial(&self) -> bool {
        matches!(self.state.status(self.id()), Status::Trial { .. })
    }
}

/// Storage's part.
#[derive(Debug, Default)]
pub struct UpdateSearch {
    has_looked: bool,
    recording_since: Option<Instant>,
}

impl UpdateSearch {
    /// Looked at nothing yet.
    pub const fn new() -> Self {
        Self { has_looked: false, recording_since: None }
    }

    /// While nothing is to be written: looks at a new card's update file, one block.
    pub fn look<D: CardDevice>(
        &mut self,
        recorder: &mut Recorder<'_, D>,
        running: &RunningImage<'_>,
        status: &UpdateStatus,
    ) {
        let Some(card) = recorder.card() else {
            self.has_looked = false;
            status.change(|found| *found = None);
            return;
        };
        if core::mem::replace(&mut self.has_looked, true) {
            return;
        }
        let mut block = [0; BLOCK_BYTES];
        let offer =
            card.update().and_then(|(mut segment, bytes)| match card.read(&mut segment, 0, &mut block) {
                Ok(()) => judge(&block, bytes, running),
                Err(_) => Some(UpdateOffer::Refused(Refusal::NoFile)),
            });
        status.change(|found| *found = offer);
    }

    /// Whether the image has recorded for long enough to be confirmed.
    pub fn is_proved(&mut self, now: Instant, card: &CardStatus) -> bool {
        if card.read().state != CardState::Recording {
            self.recording_since = None;
            return false;
        }
        now.since(*self.recording_since.get_or_insert(now)) >= TRIAL
    }
}

/// `None` for the running image itself.
fn judge(block: &[u8], bytes: u32, running: &RunningImage<'_>) -> Option<UpdateOffer> {
    let Some(header) = Header::read(block) else { return Some(UpdateOffer::Refused(Refusal::Damaged)) };
    let id = header.id();
    let own = running.header.as_ref();
    if own.is_some_and(|own| own.has_image_of(&header)) {
        return None;
    }
    let mut floor = own.map_or(running.state.floor, |own| own.floor.max(running.state.floor));
    if header.wish == NO_WISH {
        floor = own.map_or(floor, |own| own.version.max(floor));
    }
    let checked = if running.state.has_failed(id) {
        Err(Refusal::FailedBefore)
    } else if running.state.was_confirmed(id) {
        Err(Refusal::Replaced)
    } else if bytes != header.image_bytes + header::BYTES as u32 {
        Err(Refusal::Damaged)
    } else {
        header.check(running.board, floor, hums_update::keys::ALL).map(drop)
    };
    Some(match checked {
        Ok(()) => UpdateOffer::Offered,
        Err(why) => UpdateOffer::Refused(why),
    })
}

/// The monitor's part.
#[derive(Debug)]
pub struct UpdateWatch {
    message: Option<Message>,
    cause: ResetCause,
    told: Option<UpdateOffer>,
    was_refused: bool,
}

impl UpdateWatch {
    /// `message`: of the resident program; `cause`: of this start.
    pub const fn new(message: Option<Message>, cause: ResetCause) -> Self {
        Self { message, cause, told: None, was_refused: matches!(message, Some(Message::Refused(_))) }
    }

    /// Whether an image is refused, for the LED.
    pub const fn is_refused(&self) -> bool {
        self.was_refused || matches!(self.told, Some(UpdateOffer::Refused(_)))
    }

    /// The next text with its `MAV_SEVERITY`.
    pub fn news(&mut self, status: &UpdateStatus) -> Option<(u8, &'static str)> {
        match self.message.take() {
            Some(Message::Installed) => return Some((5, "HUMS: update installed, on trial for a minute")),
            Some(Message::FellBack) => return Some((4, "HUMS: update failed, the version before is back")),
            Some(Message::Retried) => return Some((4, "HUMS: update failed, and has another trial")),
            Some(Message::Refused(why)) => return Some((4, text(why))),
            _ => {}
        }
        let found = status.read();
        if found == self.told {
            return None;
        }
        // Without a card nothing is found.
        self.was_refused &= found.is_some();
        self.told = found;
        let Some(UpdateOffer::Refused(why)) = found else { return None };
        Some((4, text(why)))
    }

    /// Whether the installation begins now. `frames`: received since the start.
    pub fn is_due(
        &self,
        now: Instant,
        status: &UpdateStatus,
        calm: EraseMoment,
        frames: u64,
        on_trial: bool,
    ) -> bool {
        let is_silent =
            self.cause == ResetCause::PowerOn && frames == 0 && now.since(Instant::ZERO) >= SILENT;
        let is_offered = status.read() == Some(UpdateOffer::Offered) && !self.was_refused;
        is_offered
            && !on_trial
            && !self.cause.may_be_in_flight()
            && (calm == EraseMoment::Grounded || is_silent)
    }
}

const fn text(why: Refusal) -> &'static str {
    match why {
        Refusal::NoFile => "HUMS: update refused: card cannot be read",
        Refusal::Damaged => "HUMS: update refused: damaged, copy it again",
        Refusal::OtherBoard => "HUMS: update refused: it is for another board",
        Refusal::TooOld => "HUMS: update refused: an older version",
        Refusal::ForeignKey => "HUMS: update refused: not signed by a known key",
        Refusal::BadSignature => "HUMS: update refused: its signature is wrong",
        Refusal::FailedBefore => "HUMS: update refused: it failed on trial",
        Refusal::Replaced => "HUMS: update refused: it was replaced before",
        Refusal::Flash => "HUMS: update refused: flash does not take it",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hums_update::header::Version;
    use hums_update::state::Record;

    fn header(board: &str, version: u32) -> Header {
        Header { key: *b"\0\0\0\0\0\0\0\0", ..Header::new(board, "", Version(version), Version(1), &[0; 8]) }
    }

    fn running() -> RunningImage<'static> {
        RunningImage { board: "matek", header: Some(header("matek", 5)), state: State::read(&[0xFF; 64]) }
    }

    #[test]
    fn the_header_of_an_update_is_judged_as_the_resident_program_does() {
        let running = running();
        let key = |header: Header| Header { key: *hums_update::keys::TEST.first_chunk().unwrap(), ..header };
        let judged = |header: &Header, bytes: u32| judge(&header.bytes(), bytes, &running);
        let good = key(header("matek", 6));
        assert_eq!(judged(&good, 520), Some(UpdateOffer::Offered));
        assert_eq!(judged(&header("matek", 5), 520), None);
        for (header, bytes, why) in [
            (good.clone(), 519, Refusal::Damaged),
            (key(header("other", 6)), 520, Refusal::OtherBoard),
            (key(header("matek", 0)), 520, Refusal::TooOld),
            (Header { key: *b"somebody", ..good.clone() }, 520, Refusal::ForeignKey),
        ] {
            assert_eq!(judged(&header, bytes), Some(UpdateOffer::Refused(why)));
        }
        assert_eq!(judge(&[0; 512], 520, &running), Some(UpdateOffer::Refused(Refusal::Damaged)));
    }

    #[test]
    fn an_older_or_a_replaced_image_is_offered_only_by_a_wish() {
        let key = |version, wish| Header {
            key: *hums_update::keys::TEST.first_chunk().unwrap(),
            wish,
            ..header("matek", version)
        };
        let (older, newer) = (key(4, NO_WISH), key(6, NO_WISH));
        let mut sector = vec![0xFF; 512];
        sector[..16].copy_from_slice(&Record::Confirmed(Version(0)).bytes(newer.id()));
        let running = RunningImage { state: State::read(&sector), ..running() };
        for (header, wanted) in [
            (older, UpdateOffer::Refused(Refusal::TooOld)),
            (key(4, 1), UpdateOffer::Offered),
            (key(0, 1), UpdateOffer::Refused(Refusal::TooOld)),
            (newer, UpdateOffer::Refused(Refusal::Replaced)),
            (key(6, 1), UpdateOffer::Offered),
            (key(7, NO_WISH), UpdateOffer::Offered),
        ] {
            assert_eq!(judge(&header.bytes(), 520, &running), Some(wanted), "{}", header.version.0);
        }
        // The same image, by another header: a cable loaded it.
        assert_eq!(judge(&key(5, 1).bytes(), 520, &running), None);
    }

    #[test]
    fn an_update_waits_for_the_ground_and_never_begins_after_a_start_that_may_be_in_flight() {
        let status = UpdateStatus::default();
        let due = |message, cause, secs: u64, calm, frames, trial| {
            UpdateWatch::new(message, cause).is_due(
                Instant::from_millis(secs * 1_000),
                &status,
                calm,
                frames,
                trial,
            )
        };
        let power = ResetCause::PowerOn;
        assert!(!due(None, power, 100, EraseMoment::Grounded, 9, false), "there is no file");
        status.change(|found| *found = Some(UpdateOffer::Offered));
        let refused = Some(Message::Refused(Refusal::BadSignature));
        for (message, cause, secs, calm, frames, trial, wanted) in [
            (None, power, 12, EraseMoment::Grounded, 9, false, true),
            (None, power, 12, EraseMoment::None, 9, false, false),
            (None, power, 100, EraseMoment::Silent, 9, false, false),
            (None, power, 59, EraseMoment::None, 0, false, false),
            (None, power, 60, EraseMoment::None, 0, false, true),
            (None, ResetCause::Pin, 60, EraseMoment::None, 0, false, false),
            (None, ResetCause::Watchdog, 100, EraseMoment::Grounded, 9, false, false),
            (None, ResetCause::Software, 100, EraseMoment::Grounded, 9, false, false),
            (None, ResetCause::Update, 100, EraseMoment::Grounded, 9, false, true),
            (None, ResetCause::Update, 100, EraseMoment::Grounded, 9, true, false),
            (refused, ResetCause::Update, 100, EraseMoment::Grounded, 9, false, false),
        ] {
            let is_due = due(message, cause, secs, calm, frames, trial);
            assert_eq!(is_due, wanted, "{message:?} {cause:?} {secs} s {calm:?} {frames} {trial}");
        }
    }

    #[test]
    fn each_result_is_told_once_and_a_text_fits_the_line() {
        let status = UpdateStatus::default();
        for why in Refusal::ALL {
            assert!(text(why).len() <= 50, "{}", text(why));
            let mut watch = UpdateWatch::new(Some(Message::Refused(why)), ResetCause::Update);
            assert_eq!(watch.news(&status), Some((4, text(why))));
            assert_eq!((watch.news(&status), watch.is_refused()), (None, true));
        }
        let mut watch = UpdateWatch::new(Some(Message::Installed), ResetCause::Update);
        assert_eq!(watch.news(&status), Some((5, "HUMS: update installed, on trial for a minute")));
        assert_eq!((watch.news(&status), watch.is_refused()), (None, false));
        for found in [UpdateOffer::Refused(Refusal::OtherBoard), UpdateOffer::Refused(Refusal::TooOld)] {
            status.change(|offer| *offer = Some(found));
            assert!(watch.news(&status).is_some());
            assert_eq!((watch.news(&status), watch.is_refused()), (None, true));
        }
    }

    #[test]
    fn another_card_ends_a_refusal() {
        let status = UpdateStatus::default();
        let refused = Some(Message::Refused(Refusal::BadSignature));
        let mut watch = UpdateWatch::new(refused, ResetCause::Update);
        let later = Instant::from_millis(100_000);
        let mut due = |found| {
            status.change(|offer| *offer = found);
            while watch.news(&status).is_some() {}
            (watch.is_due(later, &status, EraseMoment::Grounded, 9, false), watch.is_refused())
        };
        for (found, wanted) in [
            (None, (false, true)),
            (Some(UpdateOffer::Offered), (false, true)),
            (None, (false, false)),
            (Some(UpdateOffer::Refused(Refusal::TooOld)), (false, true)),
            (Some(UpdateOffer::Offered), (true, false)),
        ] {
            assert_eq!(due(found), wanted, "{found:?}");
        }
    }
}
