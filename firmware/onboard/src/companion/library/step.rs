//! The result of a look at the card's answer, and the way to the asker.

use hums_core::clock::Instant;
use hums_link::messages;
use hums_link::outlet::Class;
use hums_link::packet::Packet;
use hums_link::request::Reply;

use super::super::limiter::Requester;
use super::super::ways::Outlets;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JobStep {
    Wait,
    Next,
    /// All is sent.
    Done,
    /// It ends here, with a report to the ground station.
    End(Reply),
}

const FTP_FRAME: usize = 12 + 3 + hums_link::ftp::HEAD + 13;
/// Worth a message.
const FTP_DATA_MIN: usize = 20;

pub(super) struct JobOut<'o, 'q> {
    pub(super) now: Instant,
    pub(super) asker: Requester,
    pub(super) ways: &'o mut Outlets<'q>,
}

impl JobOut<'_, '_> {
    pub(super) fn say(&mut self, packet: &Packet, then: JobStep) -> JobStep {
        if self.ways.send(self.now, self.asker.port, Class::Bulk, packet) { then } else { JobStep::Wait }
    }

    pub(super) fn file(&mut self, payload: &[u8], then: JobStep) -> JobStep {
        let (system, component) = self.asker.by;
        self.say(&messages::file_transfer(system, component, payload), then)
    }

    pub(super) fn file_data_max(&mut self) -> usize {
        self.ways.bulk_frame_max(self.asker.port).saturating_sub(FTP_FRAME).max(FTP_DATA_MIN)
    }
}
