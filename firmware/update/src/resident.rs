//! The decisions of the resident program, and the installation.
//!
//! * The first word of the header in flash is written last and cleared first: with it the application is complete.
//! * An image is read from the card as a whole, and its signature checked, before anything is erased. It is read a second time to
//!   be programmed. The signature then has to fit the content of the flash, before the header is written.
//! * Power may go at any moment: the next start finds the application complete, or installs again from the card. Without an image
//!   it waits for a card.
//! * A new image is on trial ([`crate::state`]). After [`CRASHES_MAX`] starts that ended by a reset of its own, or
//!   [`STARTS_MAX`] starts of any kind without a confirmation, it counts as failed. Another image on the card takes its place.

use hums_recorder::{BLOCK_BYTES, CardDevice};

use crate::files::{File, Name};
use crate::header::{self, Header, Refusal, Version};
use crate::message::Message;
use crate::state::{RECORD_BYTES, Record, State, Status};
use crate::{PREVIOUS, UPDATE};

/// Trial starts that end by a reset of its own, after which an image counts as failed.
pub const CRASHES_MAX: u32 = 3;
/// Trial starts of any kind: a person may switch off within the first minute.
pub const STARTS_MAX: u32 = 10;
/// Records that must fit the state's sector before an installation begins: a trial with all its starts, and its end.
const ROOM: usize = (STARTS_MAX as usize + 6) * RECORD_BYTES;

/// The flash refused a word or an erase, or the supply is too low for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFailure;

/// A part of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// One sector.
    State,
    /// Sectors of the same size; the header is first.
    Application,
}

/// The flash of a board.
pub trait Flash {
    /// The content.
    fn read(&self, region: Region) -> &[u8];

    /// Bytes of each sector of the application's region.
    fn sector_bytes(&self) -> usize;

    /// Programs an aligned word. Bits go from one to zero.
    fn program(&mut self, region: Region, offset: usize, word: u32) -> Result<(), FlashFailure>;

    /// Sets all bits of a sector to one.
    fn erase(&mut self, region: Region, sector: usize) -> Result<(), FlashFailure>;

    /// Called for each block of work, for the LED and the watchdog.
    fn progress(&mut self);
}

/// The cause of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Power, the reset pin, or a restart that the application announced by [`Message::Planned`].
    Usual,
    /// Watchdog, or a reset by the program without a word.
    Crash,
    /// The application left [`Message::Install`].
    Asked,
}

/// The result of [`decide`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Start the application.
    Start {
        /// Under the watchdog from its first instruction on.
        on_trial: bool,
    },
    /// The card is needed.
    Work(Job),
}

/// Work with the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// The application asked for its update.
    Asked,
    /// The application failed on trial.
    Replace {
        /// Its id.
        failed: u32,
    },
    /// No application is complete.
    Restore,
}

/// The result of [`Resident::work`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkResult {
    /// Reset, with this message for the application.
    Restart(Message),
    /// Wait for a card, then do this work.
    Wait(Job),
}

/// The complete header of the application in flash.
pub fn application(flash: &impl Flash, board: &str) -> Option<Header> {
    Header::read(flash.read(Region::Application)).filter(|header| header.board() == board)
}

/// The way of a start, without the card.
pub fn decide(flash: &mut impl Flash, board: &str, cause: Cause) -> Decision {
    let Some(header) = application(flash, board) else { return Decision::Work(Job::Restore) };
    let id = header.id();
    let failed = Decision::Work(Job::Replace { failed: id });
    let state = State::read(flash.read(Region::State));
    match state.status(id) {
        Status::Confirmed if cause == Cause::Asked => Decision::Work(Job::Asked),
        Status::Confirmed => Decision::Start { on_trial: false },
        Status::Failed => failed,
        Status::Trial { starts, crashes } => {
            let crashed = starts > 0 && cause == Cause::Crash;
            if starts >= STARTS_MAX || crashes + u32::from(crashed) >= CRASHES_MAX {
                let _ = append(flash, Record::Failed, id);
                return failed;
            }
            // The image could never end its trial.
            if state.free + RECORD_BYTES > flash.read(Region::State).len() {
                return failed;
            }
            // A record that the flash refuses is missing later. The image is started all the same: it may be good.
            let _ = append(flash, Record::Start { crashed }, id);
            Decision::Start { on_trial: true }
        }
    }
}

/// Appends a record to the state.
pub fn append(flash: &mut impl Flash, record: Record, id: u32) -> Result<(), FlashFailure> {
    let at = State::read(flash.read(Region::State)).free;
    if at + RECORD_BYTES > flash.read(Region::State).len() {
        return Err(FlashFailure);
    }
    let bytes = record.bytes(id);
    for (index, word) in bytes.as_chunks::<4>().0.iter().enumerate() {
        flash.program(Region::State, at + 4 * index, u32::from_le_bytes(*word))?;
    }
    if flash.read(Region::State)[at..].starts_with(&bytes) { Ok(()) } else { Err(FlashFailure) }
}

/// The resident program at work.
pub struct Resident<'a, F, D> {
    /// Its flash.
    pub flash: &'a mut F,
    /// The card in the slot.
    pub card: &'a D,
    /// Name of the board.
    pub board: &'a str,
    /// Public keys.
    pub keys: &'a [[u8; 32]],
}

impl<'a, F: Flash, D: CardDevice> Resident<'a, F, D> {
    /// Does a job, once.
    pub fn work(&mut self, job: Job) -> WorkResult {
        let state = State::read(self.flash.read(Region::State));
        let done = match job {
            Job::Asked => self.install(UPDATE, &|id| !state.has_failed(id)).map(|()| Message::Installed),
            Job::Replace { failed } => {
                self.install_any(&|id| id != failed && !state.has_failed(id)).map(|()| Message::FellBack)
            }
            // A failed image is better than none: it gets a new trial.
            Job::Restore => self
                .install_any(&|id| !state.has_failed(id))
                .or_else(|_| self.install_any(&|_| true))
                .map(|()| Message::Installed),
        };
        match (done, job) {
            (Ok(message), _) => WorkResult::Restart(message),
            (Err(_), _) if application(self.flash, self.board).is_none() => WorkResult::Wait(Job::Restore),
            (Err(why), Job::Asked) => WorkResult::Restart(Message::Refused(why)),
            // A crashing recorder is better than none.
            (Err(_), Job::Replace { failed }) => {
                match self.make_room().and_then(|()| append(self.flash, Record::Trial, failed)) {
                    Ok(()) => WorkResult::Restart(Message::Retried),
                    Err(FlashFailure) => WorkResult::Wait(job),
                }
            }
            (Err(_), Job::Restore) => WorkResult::Wait(job),
        }
    }

    /// The update, or else the image before it.
    fn install_any(&mut self, wanted: &dyn Fn(u32) -> bool) -> Result<(), Refusal> {
        self.install(UPDATE, wanted).or_else(|_| self.install(PREVIOUS, wanted))
    }

    /// Installs a file.
    fn install(&mut self, name: &Name, wanted: &dyn Fn(u32) -> bool) -> Result<(), Refusal> {
        let mut file = File::open(self.card, name)?;
        let header = Header::read(&file.next_block()?).ok_or(Refusal::Damaged)?;
        if !wanted(header.id()) {
            return Err(Refusal::FailedBefore);
        }
        let key = header.check(self.board, self.floor(), self.keys)?;
        self.verify_file(&header, &key, file)?;
        self.program(&header, &key, name)
    }

    /// The oldest version that may be installed.
    fn floor(&self) -> Version {
        let state = State::read(self.flash.read(Region::State));
        let running = application(self.flash, self.board)
            .filter(|header| state.status(header.id()) == Status::Confirmed);
        running.map_or(state.floor, |header| header.floor.max(state.floor))
    }

    fn verify_file(&mut self, header: &Header, key: &[u8; 32], mut file: File<'a, D>) -> Result<(), Refusal> {
        if file.bytes != header.image_bytes + header::BYTES as u32 {
            return Err(Refusal::Damaged);
        }
        let mut check = header.verify(key)?;
        let mut left = header.image_bytes as usize;
        while left > 0 {
            let block = file.next_block()?;
            let part = left.min(BLOCK_BYTES);
            check.absorb(&block[..part]);
            left -= part;
            self.flash.progress();
        }
        check.finish()
    }

    /// From here on the application is not complete, until the last word.
    fn program(&mut self, header: &Header, key: &[u8; 32], name: &Name) -> Result<(), Refusal> {
        let flash = |_: FlashFailure| Refusal::Flash;
        let id = header.id();
        let before = application(self.flash, self.board).map(|header| header.id());
        let state = State::read(self.flash.read(Region::State));
        // Without the records of its failure it would count as confirmed.
        if before.is_some_and(|before| state.status(before) != Status::Confirmed) {
            self.clear().map_err(flash)?;
        }
        let floor = self.floor();
        self.make_room().map_err(flash)?;
        let state = State::read(self.flash.read(Region::State));
        // Of an image that a cable loaded: it is asked for after a cut.
        if floor > state.floor {
            append(self.flash, Record::Confirmed(floor), 0).map_err(flash)?;
        }
        if state.status(id) != (Status::Trial { starts: 0, crashes: 0 }) {
            append(self.flash, Record::Trial, id).map_err(flash)?;
        }
        self.clear().map_err(flash)?;
        let end = header::BYTES + header.image_bytes as usize;
        for sector in 0..end.div_ceil(self.flash.sector_bytes()) {
            self.flash.progress();
            self.flash.erase(Region::Application, sector).map_err(flash)?;
        }
        let mut file = File::open(self.card, name)?;
        file.next_block()?;
        let mut at = header::BYTES;
        while at < end {
            let block = file.next_block()?;
            for word in block[..BLOCK_BYTES.min(end - at)].as_chunks::<4>().0 {
                self.flash.program(Region::Application, at, u32::from_le_bytes(*word)).map_err(flash)?;
                at += 4;
            }
            self.flash.progress();
        }
        // A card that gave another image at the second reading is caught here.
        let mut check = header.verify(key)?;
        for at in (header::BYTES..end).step_by(BLOCK_BYTES) {
            check.absorb(&self.flash.read(Region::Application)[at..end.min(at + BLOCK_BYTES)]);
            self.flash.progress();
        }
        check.finish()?;
        let block = header.bytes();
        for (index, word) in block.as_chunks::<4>().0.iter().enumerate().skip(1) {
            self.flash.program(Region::Application, 4 * index, u32::from_le_bytes(*word)).map_err(flash)?;
        }
        self.flash.program(Region::Application, 0, first_word(&block)).map_err(flash)?;
        if self.flash.read(Region::Application).starts_with(&block) { Ok(()) } else { Err(Refusal::Flash) }
    }

    /// Makes the application's header none.
    fn clear(&mut self) -> Result<(), FlashFailure> {
        match first_word(self.flash.read(Region::Application)) {
            0 | u32::MAX => Ok(()),
            _ => self.flash.program(Region::Application, 0, 0),
        }
    }

    /// Erases a state without room, and keeps the floor. Power that goes in this erase loses the floor: the one of the running
    /// image counts then.
    fn make_room(&mut self) -> Result<(), FlashFailure> {
        let State { free, .. } = State::read(self.flash.read(Region::State));
        if free + ROOM <= self.flash.read(Region::State).len() {
            return Ok(());
        }
        let floor = self.floor();
        self.flash.erase(Region::State, 0)?;
        append(self.flash, Record::Confirmed(floor), 0)
    }
}

fn first_word(bytes: &[u8]) -> u32 {
    bytes.first_chunk().map_or(0, |word| u32::from_le_bytes(*word))
}
