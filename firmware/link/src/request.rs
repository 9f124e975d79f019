//! Requests to us, and the queue of answers.

use heapless::Deque;
use hums_dialect::ids;

use crate::frame::{Check, Frame};
use crate::packet::Fields;
use crate::signing::Key;

/// Most waiting answers. Further requests are dropped; the sender repeats them.
const REPLIES_MAX: usize = 12;

/// Port of origin or destination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Port {
    /// The ground station's own.
    Gs = 0,
    /// The autopilot's, also for ground stations behind it.
    Autopilot = 1,
    /// The serial port on the board's USB plug: a second one for ground stations.
    Usb = 2,
}

impl Port {
    /// All, each at the place of its number.
    pub const ALL: [Self; 3] = [Self::Gs, Self::Autopilot, Self::Usb];
}

/// A request to us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request<'a> {
    /// `PARAM_REQUEST_LIST`
    ParamList,
    /// `PARAM_REQUEST_READ` by index.
    ParamAt(u16),
    /// `PARAM_REQUEST_READ` by name.
    ParamNamed(&'a str),
    /// `PARAM_SET`, its value as a number (`C_CAST`).
    ParamSet(&'a str, f32),
    /// `COMMAND_LONG` or `COMMAND_INT`: `MAV_CMD` and its parameters, all seven of `COMMAND_LONG`.
    Command(u16, [f32; 7]),
    /// `LOG_REQUEST_LIST`: first and last id.
    LogList(u16, u16),
    /// `LOG_REQUEST_DATA`: id, offset, bytes.
    LogData(u16, u32, u32),
    /// `LOG_ERASE`
    LogErase,
    /// `LOG_REQUEST_END`
    LogEnd,
    /// `FILE_TRANSFER_PROTOCOL` payload.
    File(&'a [u8]),
    /// `SETUP_SIGNING`: a key (all zeros: none), and the time that counts from now on.
    Key(Key, u64),
}

/// A request and its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AddressedRequest<'a> {
    /// System and component; 0 is all.
    pub target: (u8, u8),
    /// The request.
    pub request: Request<'a>,
}

/// The request in a frame, for any target; `None` if we have no answer to it.
pub fn read<'a>(frame: &Frame<'a>) -> Option<AddressedRequest<'a>> {
    if frame.check() != Check::Verified {
        return None;
    }
    let fields = Fields(frame.payload());
    let target = |at: usize| (fields.u8(at), fields.u8(at + 1));
    let (target, request) = match frame.id() {
        ids::PARAM_REQUEST_READ => match u16::try_from(i16::from_le_bytes(fields.bytes(0))) {
            Ok(index) => (target(2), Request::ParamAt(index)),
            Err(_) => (target(2), Request::ParamNamed(fields.text(4, 16)?)),
        },
        ids::PARAM_REQUEST_LIST => (target(0), Request::ParamList),
        ids::PARAM_SET => (target(4), Request::ParamSet(fields.text(6, 16)?, fields.f32(0))),
        // COMMAND_INT has whole numbers in its parameters 5 and 6.
        id @ (ids::COMMAND_INT | ids::COMMAND_LONG) => {
            let number = |at| {
                if id == ids::COMMAND_INT && matches!(at, 16 | 20) {
                    fields.u32(at).cast_signed() as f32
                } else {
                    fields.f32(at)
                }
            };
            (target(30), Request::Command(fields.u16(28), [0, 4, 8, 12, 16, 20, 24].map(number)))
        }
        ids::FILE_TRANSFER_PROTOCOL => {
            (target(1), Request::File(frame.payload().get(3..).unwrap_or_default()))
        }
        ids::LOG_REQUEST_LIST => (target(4), Request::LogList(fields.u16(0), fields.u16(2))),
        ids::LOG_REQUEST_DATA => (target(10), Request::LogData(fields.u16(8), fields.u32(0), fields.u32(4))),
        ids::LOG_ERASE => (target(0), Request::LogErase),
        ids::LOG_REQUEST_END => (target(0), Request::LogEnd),
        ids::SETUP_SIGNING => (target(8), Request::Key(Key(fields.bytes(10)), fields.u64(0))),
        _ => return None,
    };
    Some(AddressedRequest { target, request })
}

/// A queued answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// `PARAM_VALUE` of the parameter with this index.
    Param(u16),
    /// `COMMAND_ACK`: command, `MAV_RESULT`, system and component of the asker.
    Ack(u16, u8, (u8, u8)),
    /// `AUTOPILOT_VERSION`
    Version,
    /// `PROTOCOL_VERSION`
    Protocol,
    /// `COMPONENT_METADATA`
    Metadata,
    /// HEARTBEAT
    Heartbeat,
    /// Objections to a flight, as a text.
    Preflight,
    /// Recording was stopped, as a text.
    Stopped,
    /// The board restarts in card-reader mode, as a text.
    CardReader,
    /// Logs are being erased, as a text.
    Erased,
    /// Text: the downloaded log has left the card.
    LogGone,
    /// Text: the list of logs has changed since it was sent, so the request by list index is refused.
    LogsChanged,
    /// Text: the card could not read some of the logs, or the directory, for a list.
    LogsUnread,
    /// A signing key was set (or, `false`, removed), as a text.
    Keyed(bool),
}

/// Answers in line, and lists of parameters under way.
#[derive(Clone, Debug, Default)]
pub struct Replies {
    line: Deque<(Port, Reply), REPLIES_MAX>,
    lists: [List; Port::ALL.len()],
}

/// A list of all parameters in progress. A new request meanwhile restarts the count from the present place, so that
/// an endless asker gets them all too.
#[derive(Clone, Copy, Debug, Default)]
struct List {
    next: u16,
    left: u16,
}

impl Replies {
    /// Nothing to answer.
    pub const fn new() -> Self {
        Self { line: Deque::new(), lists: [List { next: 0, left: 0 }; Port::ALL.len()] }
    }

    /// Queues an answer once; a full queue drops it.
    pub fn push(&mut self, port: Port, reply: Reply) {
        if !self.line.iter().any(|waiting| *waiting == (port, reply)) {
            let _ = self.line.push_back((port, reply));
        }
    }

    /// Begins a list of `count` parameters.
    pub fn list(&mut self, port: Port, count: u16) {
        let list = &mut self.lists[port as usize];
        if list.left == 0 {
            list.next = 0;
        }
        list.left = count;
    }

    /// The next queued answer.
    pub fn first(&self) -> Option<(Port, Reply)> {
        self.line.front().copied()
    }

    /// Sent; or, `sent` false, goes to the end of the line: a full port does not hold up the other.
    pub fn done(&mut self, sent: bool) {
        if let Some(reply) = self.line.pop_front()
            && !sent
        {
            let _ = self.line.push_back(reply);
        }
    }

    /// Answers in line.
    pub fn len(&self) -> usize {
        self.line.len()
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.line.is_empty()
    }

    /// Next in this port's list.
    pub fn listed(&self, port: Port) -> Option<u16> {
        let list = self.lists[port as usize];
        (list.left > 0).then_some(list.next)
    }

    /// Ends this port's list.
    pub fn end_list(&mut self, port: Port) {
        self.lists[port as usize].left = 0;
    }

    /// Sent; `count` in all.
    pub fn listed_done(&mut self, port: Port, count: u16) {
        let list = &mut self.lists[port as usize];
        list.left = list.left.saturating_sub(1);
        list.next = if list.next + 1 < count { list.next + 1 } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::{Encoder, FRAME_BYTES_MAX};
    use crate::packet::Packet;

    fn asked(packet: &Packet) -> Option<(Vec<u8>, bool)> {
        let mut buffer = [0; FRAME_BYTES_MAX];
        let bytes = Encoder::new().frame(&mut buffer, packet).to_vec();
        let some = read(&Frame::parse(&bytes)?).is_some();
        Some((bytes, some))
    }

    fn with(packet: &Packet, look: impl FnOnce(&AddressedRequest<'_>)) {
        let (bytes, some) = asked(packet).expect("a frame");
        assert!(some, "{}", packet.id());
        look(&read(&Frame::parse(&bytes).expect("a frame")).expect("a request"));
    }

    #[test]
    fn a_parameter_of_sixteen_letters_has_no_zero_at_its_end() {
        let set = Packet::new(23).f32(0, 2.5).u8(4, 1).u8(5, 191).text(6, 16, "SIXTEEN_LETTERS_").u8(22, 9);
        with(&set, |asked| {
            assert_eq!(asked.target, (1, 191));
            assert_eq!(asked.request, Request::ParamSet("SIXTEEN_LETTERS_", 2.5));
        });
        let read = Packet::new(20).u16(0, 0xffff).u8(2, 1).u8(3, 0).text(4, 16, "GS_BUDGET");
        with(&read, |asked| assert_eq!(asked.request, Request::ParamNamed("GS_BUDGET")));
        with(&Packet::new(20).u16(0, 7).u8(2, 1), |asked| assert_eq!(asked.request, Request::ParamAt(7)));
    }

    #[test]
    fn a_command_that_nobody_knows_is_a_command() {
        let command = Packet::new(76).u16(28, 65_535).u8(30, 1).u8(31, 191);
        with(&command, |asked| assert_eq!(asked.request, Request::Command(65_535, [0.0; 7])));
    }

    #[test]
    fn somebody_who_asks_for_the_list_again_and_again_gets_all_of_it() {
        let mut replies = Replies::new();
        let mut seen = [0; 10];
        for _ in 0..12 {
            replies.list(Port::Gs, 10);
            for _ in 0..3 {
                let index = replies.listed(Port::Gs).expect("a list is under way");
                seen[usize::from(index)] += 1;
                replies.listed_done(Port::Gs, 10);
            }
        }
        assert!(seen.iter().all(|count| *count >= 3), "{seen:?}");
        assert_eq!(replies.listed(Port::Autopilot), None);
        replies.end_list(Port::Gs);
        assert_eq!(replies.listed(Port::Gs), None);
    }

    #[test]
    fn a_flood_of_questions_fills_the_line_and_no_more() {
        let mut replies = Replies::new();
        for index in 0..1_000 {
            replies.push(Port::Gs, Reply::Param(index));
            replies.push(Port::Gs, Reply::Version);
        }
        assert_eq!(replies.len(), REPLIES_MAX);
    }
}
