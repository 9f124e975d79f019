//! A USB host for the board's plug: plain code in a thread. Both sides take turns, so that runs repeat.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use anyhow::{Context as _, Result, bail, ensure};
use stm32f405_model::otg::{Action, Host, Reply};
use stm32f405_model::time::{MS, Ps, SECOND};

const PACKET_BYTES: usize = 64;
/// A device that takes or gives no packet for so long counts as hung.
const HUNG: Ps = 10 * SECOND;
/// Class of the interface with a serial port's data (CDC 1.2, table 7).
const SERIAL_DATA: u8 = 0x0A;
/// Of a card reader.
const MASS_STORAGE: [u8; 3] = [0x08, 0x06, 0x50];

struct Turns {
    replies: Sender<(Ps, Reply)>,
    actions: Receiver<Action>,
}

impl Host for Turns {
    fn next(&mut self, now: Ps, reply: Reply) -> Action {
        let _ = self.replies.send((now, reply));
        self.actions.recv().unwrap_or(Action::Wait(1_000 * SECOND))
    }
}

/// A host with this program for [`stm32f405_model::machine::Machine::plug`], and the program's result.
pub fn host<T: Send + 'static>(
    program: impl FnOnce(&mut Bus) -> Result<T> + Send + 'static,
) -> (Box<dyn Host>, JoinHandle<Result<T>>) {
    let ((replies, from_bus), (actions, to_bus)) = (channel(), channel());
    let thread = std::thread::spawn(move || {
        let mut bus = Bus { actions, replies: from_bus, now: 0, address: 0, toggles: [[false; 16]; 2] };
        bus.now = bus.replies.recv()?.0;
        program(&mut bus)
    });
    (Box::new(Turns { replies, actions: to_bus }), thread)
}

/// The host's side of the bus.
#[derive(Debug)]
pub struct Bus {
    actions: Sender<Action>,
    replies: Receiver<(Ps, Reply)>,
    /// The time on the bus.
    pub now: Ps,
    /// The device's address.
    pub address: u8,
    /// Next packet is DATA1: from the host, to the host.
    toggles: [[bool; 16]; 2],
}

impl Bus {
    /// One action on the bus.
    pub fn act(&mut self, action: Action) -> Result<Reply> {
        self.actions.send(action).ok().context("the machine has ended")?;
        let (now, reply) = self.replies.recv().context("the machine has ended")?;
        self.now = now;
        Ok(reply)
    }

    fn packet(&mut self, action: &Action) -> Result<Reply> {
        let end = self.now + HUNG;
        loop {
            match self.act(action.clone())? {
                Reply::Nak => ensure!(self.now < end, "not ready for 10 s: {action:?}"),
                Reply::Nothing => bail!("no answer to {action:?}"),
                reply => return Ok(reply),
            }
        }
    }

    /// Sends bytes to an endpoint, in packets. `false`: it is halted.
    pub fn write(&mut self, endpoint: u8, bytes: &[u8]) -> Result<bool> {
        for packet in bytes.chunks(PACKET_BYTES) {
            let data1 = self.toggles[0][usize::from(endpoint)];
            match self.packet(&Action::Out(self.address, endpoint, data1, packet.to_vec()))? {
                Reply::Done => self.toggles[0][usize::from(endpoint)] = !data1,
                Reply::Stalled => return Ok(false),
                reply => bail!("{reply:?}"),
            }
        }
        Ok(true)
    }

    /// Reads up to this many bytes, or up to a short packet. `None`: the endpoint is halted.
    pub fn read(&mut self, endpoint: u8, bytes: usize) -> Result<Option<Vec<u8>>> {
        let mut data = Vec::new();
        while data.len() < bytes {
            match self.packet(&Action::In(self.address, endpoint))? {
                Reply::Data(data1, packet) => {
                    let toggle = &mut self.toggles[1][usize::from(endpoint)];
                    ensure!(*toggle == data1, "endpoint {endpoint}: DATA0 and DATA1 are not in turn");
                    *toggle = !data1;
                    data.extend_from_slice(&packet);
                    ensure!(data.len() <= bytes, "babble: {} bytes of {bytes}", data.len());
                    if packet.len() < PACKET_BYTES {
                        break;
                    }
                }
                Reply::Stalled => return Ok(None),
                reply => bail!("{reply:?}"),
            }
        }
        Ok(Some(data))
    }

    /// A SETUP packet: the first stage of a request.
    pub fn setup(&mut self, kind: u8, request: u8, value: u16, index: u16, length: u16) -> Result<()> {
        let ([v0, v1], [i0, i1], [l0, l1]) = (value.to_le_bytes(), index.to_le_bytes(), length.to_le_bytes());
        let packet = [kind, request, v0, v1, i0, i1, l0, l1];
        let reply = self.packet(&Action::Setup(self.address, packet))?;
        ensure!(reply == Reply::Done, "SETUP: {reply:?}");
        (self.toggles[0][0], self.toggles[1][0]) = (true, true);
        Ok(())
    }

    /// A request with data for the host; `None`: refused.
    pub fn control_in(
        &mut self,
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        length: u16,
    ) -> Result<Option<Vec<u8>>> {
        self.setup(kind | 0x80, request, value, index, length)?;
        let Some(data) = self.read(0, length.into())? else { return Ok(None) };
        let reply = self.packet(&Action::Out(self.address, 0, true, Vec::new()))?;
        ensure!(reply == Reply::Done, "status: {reply:?}");
        Ok(Some(data))
    }

    /// A request without data; whether it was accepted.
    pub fn control(&mut self, kind: u8, request: u8, value: u16, index: u16) -> Result<bool> {
        self.setup(kind, request, value, index, 0)?;
        let status = self.read(0, 1)?;
        ensure!(status.as_ref().is_none_or(Vec::is_empty), "status: {status:?}");
        Ok(status.is_some())
    }

    /// Waits for the device, resets it, and gives it address and configuration. Returns its descriptors.
    pub fn enumerate(&mut self) -> Result<(Vec<u8>, Vec<u8>)> {
        self.act(Action::Attach)?;
        // USB 2.0, 7.1.7.3: 100 ms for contacts to settle. The bus sleeps before the reset.
        self.act(Action::Sleep(100 * MS))?;
        self.reset()?;
        let device = self.control_in(0, 6, 0x0100, 0, 64)?.context("no descriptor")?;
        self.reset()?;
        ensure!(self.control(0, 5, 7, 0)?, "no address");
        self.address = 7;
        self.act(Action::Wait(2 * MS))?;
        let head = self.control_in(0, 6, 0x0200, 0, 9)?.context("no configuration")?;
        let length = u16::from_le_bytes([head[2], head[3]]);
        let configuration = self.control_in(0, 6, 0x0200, 0, length)?.context("no configuration")?;
        ensure!(self.control(0, 9, 1, 0)?, "no configuration");
        Ok((device, configuration))
    }

    /// Resets the bus.
    pub fn reset(&mut self) -> Result<()> {
        self.act(Action::Reset)?;
        (self.address, self.toggles) = (0, [[false; 16]; 2]);
        self.act(Action::Wait(10 * MS)).map(drop)
    }

    /// A request that begins a configuration: endpoints go on with DATA0 (USB 2.0, 9.1.1.5).
    pub fn configure(&mut self, kind: u8, request: u8, value: u16) -> Result<()> {
        ensure!(self.control(kind, request, value, 0)?, "no configuration");
        self.toggles = [[false; 16]; 2];
        Ok(())
    }

    /// Clears an endpoint's halt. `address` has the direction as its highest bit.
    pub fn clear_halt(&mut self, address: u8) -> Result<()> {
        ensure!(self.control(2, 1, 0, address.into())?, "the halt stays");
        self.toggles[usize::from(address >> 7)][usize::from(address & 15)] = false;
        Ok(())
    }
}

/// A disk on the bus.
#[derive(Debug)]
pub struct Disk<'a> {
    /// The bus.
    pub bus: &'a mut Bus,
    /// Endpoints to the disk and from it, without the direction.
    pub endpoints: (u8, u8),
    tag: u32,
}

/// Result of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Done {
    /// Data of the disk.
    pub data: Vec<u8>,
    /// Passed, failed, phase error.
    pub status: u8,
    /// Bytes that were expected and did not come.
    pub residue: u32,
}

impl<'a> Disk<'a> {
    /// Enumerates the device, which must be a disk.
    pub fn attach(bus: &'a mut Bus) -> Result<Self> {
        let (device, configuration) = bus.enumerate()?;
        ensure!(device.len() == 18 && device[4..7] == [0; 3], "device descriptor {device:x?}");
        let (mut to, mut from, mut rest) = (0, 0, &configuration[..]);
        while let [length, kind, ..] = *rest {
            let (one, others) = rest.split_at_checked(length.into()).context("a descriptor is cut")?;
            match kind {
                4 => ensure!(one[5..8] == MASS_STORAGE, "interface {one:x?}"),
                5 if one[2] & 0x80 != 0 => from = one[2] & 15,
                5 => to = one[2] & 15,
                _ => {}
            }
            rest = others;
        }
        ensure!(to > 0 && from > 0, "no endpoints");
        let units = bus.control_in(0x21, 0xFE, 0, 0, 1)?.context("no number of units")?;
        ensure!(units == [0], "units: {units:?}");
        Ok(Self { bus, endpoints: (to, from), tag: 0 })
    }

    /// A command with data from the disk.
    pub fn command(&mut self, block: &[u8], expected: u32) -> Result<Done> {
        self.transfer(block, expected, None)
    }

    /// A command with data to the disk.
    pub fn write(&mut self, block: &[u8], data: &[u8]) -> Result<Done> {
        self.transfer(block, data.len() as u32, Some(data))
    }

    fn transfer(&mut self, block: &[u8], expected: u32, data: Option<&[u8]>) -> Result<Done> {
        self.tag += 1;
        let mut wrapper = b"USBC".to_vec();
        wrapper.extend(self.tag.to_le_bytes());
        wrapper.extend(expected.to_le_bytes());
        wrapper.extend([if data.is_some() { 0 } else { 0x80 }, 0, block.len() as u8]);
        wrapper.extend(block);
        wrapper.resize(31, 0);
        let (to, from) = self.endpoints;
        ensure!(self.bus.write(to, &wrapper)?, "halted before the command");
        let mut got = Vec::new();
        if let Some(data) = data {
            ensure!(self.bus.write(to, data)?, "halted in the data");
        } else if expected > 0 {
            got = self.bus.read(from, expected as usize)?.context("halted in the data")?;
        }
        let status = self.bus.read(from, 13)?.context("halted before the status")?;
        ensure!(status.len() == 13 && status.starts_with(b"USBS"), "status {status:x?}");
        ensure!(status[4..8] == self.tag.to_le_bytes(), "status of another command");
        let residue = u32::from_le_bytes([status[8], status[9], status[10], status[11]]);
        Ok(Done { data: got, status: status[12], residue })
    }

    /// Number of blocks.
    pub fn blocks(&mut self) -> Result<u32> {
        let done = self.command(&[0x25, 0, 0, 0, 0, 0, 0, 0, 0, 0], 8)?;
        let [a, b, c, d, 0, 0, 2, 0] = done.data[..] else { bail!("capacity {done:?}") };
        Ok(u32::from_be_bytes([a, b, c, d]) + 1)
    }

    /// Reads blocks.
    pub fn read(&mut self, first: u32, count: u16) -> Result<Done> {
        let mut block = [0x28, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        block[2..6].copy_from_slice(&first.to_be_bytes());
        block[7..9].copy_from_slice(&count.to_be_bytes());
        self.command(&block, u32::from(count) * 512)
    }

    /// Sense key and additional code of the last refusal.
    pub fn sense(&mut self) -> Result<(u8, u8)> {
        let done = self.command(&[3, 0, 0, 0, 18, 0], 18)?;
        ensure!(done.status == 0 && done.data.len() == 18, "sense {done:?}");
        Ok((done.data[2], done.data[12]))
    }

    /// Ejects the disk.
    pub fn eject(&mut self) -> Result<()> {
        let done = self.command(&[0x1B, 0, 0, 0, 2, 0], 0)?;
        ensure!(done.status == 0, "eject {done:?}");
        Ok(())
    }
}

/// A serial port on the bus.
#[derive(Debug)]
pub struct Serial<'a> {
    /// The bus.
    pub bus: &'a mut Bus,
    /// Endpoints to the device and from it, without the direction.
    pub endpoints: (u8, u8),
}

impl<'a> Serial<'a> {
    /// Enumerates the device, which must be a serial port, and opens it as Linux does.
    pub fn attach(bus: &'a mut Bus) -> Result<Self> {
        let (device, configuration) = bus.enumerate()?;
        ensure!(device.len() == 18 && device[4..7] == [0xEF, 2, 1], "device descriptor {device:x?}");
        let (mut to, mut from, mut is_data, mut rest) = (0, 0, false, &configuration[..]);
        while let [length, kind, ..] = *rest {
            let (one, others) = rest.split_at_checked(length.into()).context("a descriptor is cut")?;
            match kind {
                4 => is_data = one[5] == SERIAL_DATA,
                5 if is_data && one[2] & 0x80 != 0 => from = one[2] & 15,
                5 if is_data => to = one[2] & 15,
                _ => {}
            }
            rest = others;
        }
        ensure!(to > 0 && from > 0, "no endpoints");
        // SET_CONTROL_LINE_STATE: DTR and RTS.
        ensure!(bus.control(0x21, 0x22, 3, 0)?, "no line state");
        Ok(Self { bus, endpoints: (to, from) })
    }

    /// Bytes of the device for this long.
    pub fn listen(&mut self, long: Ps) -> Result<Vec<u8>> {
        let (end, from) = (self.bus.now + long, self.endpoints.1);
        let mut bytes = Vec::new();
        while self.bus.now < end {
            match self.bus.act(Action::In(self.bus.address, from))? {
                Reply::Nak => drop(self.bus.act(Action::Wait(MS))?),
                Reply::Data(data1, packet) => {
                    let toggle = &mut self.bus.toggles[1][usize::from(from)];
                    ensure!(*toggle == data1, "DATA0 and DATA1 are not in turn");
                    *toggle = !data1;
                    bytes.extend_from_slice(&packet);
                }
                reply => bail!("{reply:?}"),
            }
        }
        Ok(bytes)
    }

    /// Sends bytes.
    pub fn send(&mut self, bytes: &[u8]) -> Result<()> {
        ensure!(self.bus.write(self.endpoints.0, bytes)?, "halted");
        Ok(())
    }
}
