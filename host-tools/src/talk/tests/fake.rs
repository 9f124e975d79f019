//! A line with boards, for tests.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Write};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use hums_link::encode::{COMPONENT, Encoder, FRAME_BYTES_MAX};
use hums_link::messages;
use hums_link::packet::Packet;
use hums_link::{Frame, Framer};

use crate::duplex::{Duplex, Port};
use crate::mavlink::ids::HEARTBEAT;
use crate::talk::Client;

/// Answers to a frame: sender and packet.
pub(in crate::talk) type Answers = Vec<(u8, Packet)>;

struct Line {
    framer: Framer,
    systems: &'static [u8],
    answer: Box<dyn FnMut(&Frame<'_>) -> Answers + Send>,
    coming: VecDeque<u8>,
}

/// Boards of these systems answer heartbeats with their own. The addressed component gives the other answers, the autopilot
/// those to heartbeats.
pub(in crate::talk) fn client(
    systems: &'static [u8],
    answer: impl FnMut(&Frame<'_>) -> Answers + Send + 'static,
) -> Client {
    let (framer, coming) = (Framer::new(), VecDeque::new());
    let line = Arc::new(Mutex::new(Line { framer, systems, answer: Box::new(answer), coming }));
    let writer = Box::new(End(Arc::clone(&line)));
    Client::over(Duplex { reader: Box::new(End(line)), writer }, None)
}

/// Has found system 1.
pub(in crate::talk) fn found(
    systems: &'static [u8],
    answer: impl FnMut(&Frame<'_>) -> Answers + Send + 'static,
) -> Client {
    let mut client = client(systems, answer);
    client.find(&[COMPONENT], Some(1), Duration::ZERO).expect("it is heard");
    client
}

struct End(Arc<Mutex<Line>>);

impl Port for End {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let coming = &mut self.0.lock().expect("no panic").coming;
        if coming.is_empty() {
            std::thread::sleep(Duration::from_millis(1));
            return Err(ErrorKind::WouldBlock.into());
        }
        io::Read::read(coming, buffer)
    }
}

impl Write for End {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut line = self.0.lock().expect("no panic");
        let Line { framer, systems, answer, coming } = &mut *line;
        framer.push(bytes, &mut |frame| {
            let mut send = |component: u8, said: Answers| {
                for (system, packet) in said {
                    let mut buffer = [0; FRAME_BYTES_MAX];
                    coming.extend(Encoder::of(system, component).frame(&mut buffer, &packet));
                }
            };
            if frame.id() == HEARTBEAT {
                send(COMPONENT, systems.iter().map(|system| (*system, messages::heartbeat(4))).collect());
                // The autopilot's own one, if any.
                send(1, answer(&frame));
            } else {
                let component = frame.target().map_or(COMPONENT, |(_, component)| component);
                send(component, answer(&frame));
            }
        });
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
