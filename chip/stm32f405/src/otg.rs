//! USB OTG FS as a device (RM0090, chapter 34), and the bus to a host: whole packets, each with its time at
//! 12 Mbit/s.
//!
//! Not modelled: host and OTG mode, DMA, isochronous and interrupt timing, remote wake-up, start of frame
//! interrupts, thresholds, damaged packets, the time that a switch to device mode takes (25 ms). A register
//! that is not modelled stops the machine.
//!
//! An OUT endpoint stays enabled at the end of a transfer, and only NAK stops the next packet. The manual
//! says that it is disabled; embassy's driver, which runs on boards, enables it once.

use std::collections::VecDeque;

use crate::time::{MS, NEVER, Ps, US};

/// A bit at 12 Mbit/s.
const BIT: Ps = 83_333;
/// Bytes of a transaction besides its data: token, synchronisation, checksums, handshake and gaps. 19 packets of 64 bytes fit a
/// millisecond (USB 2.0, table 5-9).
const OVERHEAD_BYTES: u64 = 14;
/// A token with NAK, STALL or nothing behind it.
const REFUSAL_BYTES: u64 = 8;
const RESET: Ps = 10 * MS;
const LOOK: Ps = MS;
const ENDPOINTS: usize = 4;
const FIFO_WORDS: usize = 320;
const PACKET_BYTES: usize = 64;
/// Words of the receive FIFO that are kept for SETUP packets (RM0090, 34.11.1).
const SETUP_WORDS: usize = 10;

/// Bits of `GINTSTS`.
const RXFLVL: u32 = 1 << 4;
const USBSUSP: u32 = 1 << 11;
const USBRST: u32 = 1 << 12;
const ENUMDNE: u32 = 1 << 13;
const IEPINT: u32 = 1 << 18;
const OEPINT: u32 = 1 << 19;
const WKUPINT: u32 = 1 << 31;
/// `GUSBCFG`: device mode.
const FDMOD: u32 = 1 << 30;
/// `GCCFG`: the transceiver is on.
const PWRDWN: u32 = 1 << 16;
const NOVBUSSENS: u32 = 1 << 21;
/// `DCTL`: disconnected by software.
const SDIS: u32 = 1 << 1;
/// Bits of `DIEPCTL` and `DOEPCTL`.
const USBAEP: u32 = 1 << 15;
const NAKSTS: u32 = 1 << 17;
const STALL: u32 = 1 << 21;
const CNAK: u32 = 1 << 26;
const SNAK: u32 = 1 << 27;
const SD0PID: u32 = 1 << 28;
const EPDIS: u32 = 1 << 30;
const EPENA: u32 = 1 << 31;
const KEPT: u32 = 0x7FF | 3 << 18 | 0xF << 22;
/// Bits of `DIEPINT` and `DOEPINT`.
const XFRC: u32 = 1;
const EPDISD: u32 = 1 << 1;
const STUP: u32 = 1 << 3;
const TXFE: u32 = 1 << 7;
/// Packet status of `GRXSTSP`.
const OUT_DATA: u32 = 2;
const OUT_DONE: u32 = 3;
const SETUP_DONE: u32 = 4;
const SETUP_DATA: u32 = 6;

/// The next action of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing for this long; the bus stays awake.
    Wait(Ps),
    /// Waits for a device on the bus.
    Attach,
    /// Resets the bus.
    Reset,
    /// Lets the bus sleep for this long.
    Sleep(Ps),
    /// A SETUP packet to this address.
    Setup(u8, [u8; 8]),
    /// A packet to an endpoint of this address; `true` is DATA1.
    Out(u8, u8, bool, Vec<u8>),
    /// Asks an endpoint of this address for a packet.
    In(u8, u8),
}

/// The device's reply to an action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// It took the packet; or the time is over.
    Done,
    /// Not now.
    Nak,
    /// Halted.
    Stalled,
    /// No answer: no device, or none of this address and endpoint.
    Nothing,
    /// A packet; `true` is DATA1.
    Data(bool, Vec<u8>),
}

/// A host on the other end of the bus.
pub trait Host: Send {
    /// The next action, after the reply to the one before. The first call has [`Reply::Nothing`].
    fn next(&mut self, now: Ps, reply: Reply) -> Action;
}

#[derive(Clone, Copy, Debug)]
struct Endpoint {
    control: u32,
    interrupts: u32,
    size: u32,
    /// The next packet is DATA1.
    data1: bool,
    /// The control endpoint is always active.
    is_first: bool,
}

const IDLE: Endpoint = Endpoint { control: 0, interrupts: 0, size: 0, data1: false, is_first: false };
const ENDPOINTS_AT_RESET: [Endpoint; ENDPOINTS] =
    [Endpoint { control: USBAEP, is_first: true, ..IDLE }, IDLE, IDLE, IDLE];

impl Endpoint {
    fn is(&self, bits: u32) -> bool {
        self.control & bits != 0
    }

    fn write_control(&mut self, value: u32) {
        let kept = if self.is_first { USBAEP } else { value & USBAEP };
        self.control = self.control & (NAKSTS | EPENA) | value & (KEPT | STALL) | kept;
        if value & CNAK != 0 {
            self.control &= !NAKSTS;
        }
        if value & SNAK != 0 {
            self.control |= NAKSTS;
        }
        if value & SD0PID != 0 {
            self.data1 = false;
        }
        if value & EPDIS != 0 && self.is(EPENA) {
            self.control &= !EPENA;
            self.interrupts |= EPDISD;
        } else if value & EPENA != 0 {
            self.control |= EPENA;
        }
    }

    fn read_control(&self) -> u32 {
        self.control | u32::from(self.data1) << 16
    }
}

#[derive(Clone, Debug)]
struct Received {
    endpoint: u32,
    status: u32,
    words: VecDeque<u32>,
    bytes: u32,
}

/// The port.
pub struct Otg {
    gahbcfg: u32,
    gusbcfg: u32,
    gintsts: u32,
    gintmsk: u32,
    grxfsiz: u32,
    fifos: [u32; ENDPOINTS],
    gccfg: u32,
    dcfg: u32,
    dctl: u32,
    masks: [u32; 2],
    daintmsk: u32,
    diepempmsk: u32,
    pcgcctl: u32,
    enumerated: bool,
    frame: u32,
    /// Its address on the bus: a new one counts from the end of the status stage on.
    address: u32,
    to_host: [Endpoint; ENDPOINTS],
    from_host: [Endpoint; ENDPOINTS],
    /// Words to the host.
    sending: [VecDeque<u32>; ENDPOINTS],
    received: VecDeque<Received>,
    /// Words of the packet with a read status.
    popped: VecDeque<u32>,
    host: Option<Box<dyn Host>>,
    action: Action,
    /// The device has refused the host's token, which it does at once.
    refused: Option<Reply>,
    over: Ps,
    /// The pins are the port's, and its clock is 48 MHz.
    pub(crate) is_wired: bool,
}

impl Default for Otg {
    fn default() -> Self {
        Self::new()
    }
}

fn words(bytes: &[u8]) -> VecDeque<u32> {
    let word = |chunk: &[u8]| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_le_bytes(word)
    };
    bytes.chunks(4).map(word).collect()
}

impl Otg {
    /// After a reset, without a host.
    pub fn new() -> Self {
        Self {
            gahbcfg: 0,
            gusbcfg: 0,
            gintsts: 0,
            gintmsk: 0,
            grxfsiz: 0x200,
            fifos: [0x0200_0200; ENDPOINTS],
            gccfg: 0,
            dcfg: 0,
            dctl: 0,
            masks: [0; 2],
            daintmsk: 0,
            diepempmsk: 0,
            pcgcctl: 0,
            enumerated: false,
            frame: 0,
            address: 0,
            to_host: ENDPOINTS_AT_RESET,
            from_host: ENDPOINTS_AT_RESET,
            sending: Default::default(),
            received: VecDeque::new(),
            popped: VecDeque::new(),
            host: None,
            action: Action::Wait(0),
            refused: None,
            over: NEVER,
            is_wired: false,
        }
    }

    /// A reset of the chip. The host stays.
    pub fn reset(&mut self) {
        let (host, action) = (self.host.take(), std::mem::replace(&mut self.action, Action::Wait(0)));
        *self = Self { host, action, over: self.over, ..Self::new() };
    }

    /// Plugs a host in.
    pub fn connect(&mut self, host: Box<dyn Host>, now: Ps) {
        (self.host, self.action, self.over) = (Some(host), Action::Wait(0), now);
    }

    /// Pulls the cable. The device gets no event, as if it had missed that of an idle bus.
    pub fn disconnect(&mut self) {
        (self.host, self.over) = (None, NEVER);
    }

    /// The bus's next moment.
    pub fn deadline(&self) -> Ps {
        if self.host.is_some() { self.over } else { NEVER }
    }

    fn is_attached(&self) -> bool {
        self.is_wired
            && self.gusbcfg & FDMOD != 0
            && self.gccfg & (PWRDWN | NOVBUSSENS) == PWRDWN | NOVBUSSENS
            && self.dctl & SDIS == 0
    }

    /// The action of the host is over.
    pub fn happen(&mut self, now: Ps) {
        let action = std::mem::replace(&mut self.action, Action::Wait(0));
        let reply = match action {
            Action::Attach if !self.is_attached() => {
                (self.action, self.over) = (Action::Attach, now + LOOK);
                return;
            }
            Action::Wait(_) | Action::Attach => Reply::Done,
            _ if !self.is_attached() => Reply::Nothing,
            Action::Reset => {
                self.gintsts |= ENUMDNE;
                self.enumerated = true;
                Reply::Done
            }
            Action::Sleep(_) => {
                self.gintsts |= WKUPINT;
                Reply::Done
            }
            Action::Setup(address, data) if self.has(address) => self.take_setup(&data),
            Action::Out(address, endpoint, data1, bytes) if self.has(address) => {
                self.take(endpoint, data1, &bytes)
            }
            Action::In(..) if self.refused.is_some() => self.refused.take().unwrap_or(Reply::Nak),
            Action::In(address, endpoint) if self.has(address) => self.give(endpoint),
            Action::Setup(..) | Action::Out(..) | Action::In(..) => Reply::Nothing,
        };
        let Some(host) = &mut self.host else { return };
        self.action = host.next(now, reply);
        self.begin(now);
    }

    fn begin(&mut self, now: Ps) {
        let transfer = |bytes: u64| 8 * bytes * BIT;
        let lasts = match &self.action {
            Action::Wait(ps) => (*ps).max(US),
            Action::Attach => LOOK,
            Action::Reset => {
                if self.is_attached() {
                    self.bus_reset();
                }
                RESET
            }
            Action::Sleep(ps) => {
                if self.is_attached() {
                    self.gintsts |= USBSUSP;
                }
                *ps
            }
            Action::Setup(..) => transfer(8 + OVERHEAD_BYTES),
            Action::Out(_, _, _, bytes) => transfer(bytes.len() as u64 + OVERHEAD_BYTES),
            Action::In(address, endpoint) => {
                let (address, endpoint) = (*address, *endpoint);
                let ready = if self.has(address) { self.ready(endpoint) } else { Err(Reply::Nothing) };
                let bytes = ready.as_ref().map_or(REFUSAL_BYTES, |bytes| *bytes as u64 + OVERHEAD_BYTES);
                self.refused = ready.err();
                transfer(bytes)
            }
        };
        self.over = now.saturating_add(lasts);
    }

    fn frame(&mut self, now: Ps) -> u32 {
        let is_awake = !matches!(self.action, Action::Attach | Action::Reset | Action::Sleep(_));
        if self.host.is_some() && self.enumerated && is_awake {
            self.frame = (now / MS) as u32 & 0x7FF;
        }
        self.frame
    }

    fn bus_reset(&mut self) {
        self.gintsts |= USBRST;
        self.enumerated = false;
        for number in 0..ENDPOINTS {
            for endpoint in [&mut self.to_host[number], &mut self.from_host[number]] {
                endpoint.control &= !STALL;
                endpoint.data1 = false;
                if !endpoint.is_first {
                    endpoint.control &= !USBAEP;
                }
            }
        }
    }

    /// Of `DCFG`.
    fn set_address(&self) -> u32 {
        self.dcfg >> 4 & 0x7F
    }

    fn has(&self, address: u8) -> bool {
        self.enumerated && self.address == u32::from(address)
    }

    fn taken(&self) -> usize {
        self.received.iter().map(|packet| 1 + packet.words.len()).sum::<usize>() + self.popped.len()
    }

    fn push(&mut self, endpoint: u32, status: u32, bytes: &[u8]) {
        let bytes_len = bytes.len() as u32;
        self.received.push_back(Received { endpoint, status, words: words(bytes), bytes: bytes_len });
    }

    fn take_setup(&mut self, data: &[u8; 8]) -> Reply {
        if self.taken() + 4 > self.grxfsiz as usize {
            return Reply::Nothing;
        }
        self.push(0, SETUP_DATA, data);
        self.push(0, SETUP_DONE, &[]);
        for endpoint in [&mut self.to_host[0], &mut self.from_host[0]] {
            endpoint.control = endpoint.control & !STALL | NAKSTS;
            // The data stage begins with DATA1 (USB 2.0, 8.5.3).
            endpoint.data1 = true;
        }
        Reply::Done
    }

    fn active(endpoints: &[Endpoint; ENDPOINTS], number: u8) -> Option<Endpoint> {
        endpoints.get(usize::from(number)).copied().filter(|endpoint| endpoint.is(USBAEP))
    }

    fn take(&mut self, number: u8, data1: bool, bytes: &[u8]) -> Reply {
        let Some(endpoint) = Self::active(&self.from_host, number) else { return Reply::Nothing };
        let has_room = self.taken() + 2 + bytes.len().div_ceil(4) + SETUP_WORDS <= self.grxfsiz as usize;
        if endpoint.is(STALL) {
            return Reply::Stalled;
        }
        if endpoint.is(NAKSTS) || !has_room || bytes.len() > PACKET_BYTES {
            return Reply::Nak;
        }
        if number > 0 && data1 != endpoint.data1 {
            return Reply::Done;
        }
        let index = usize::from(number);
        self.from_host[index].data1 = !data1;
        self.from_host[index].control |= NAKSTS;
        self.push(number.into(), OUT_DATA, bytes);
        self.push(number.into(), OUT_DONE, &[]);
        Reply::Done
    }

    fn ready(&self, number: u8) -> Result<usize, Reply> {
        let endpoint = Self::active(&self.to_host, number).ok_or(Reply::Nothing)?;
        let bytes = (endpoint.size & 0x7_FFFF) as usize;
        let is_there = self.sending[usize::from(number)].len() >= bytes.div_ceil(4);
        match endpoint {
            _ if endpoint.is(STALL) => Err(Reply::Stalled),
            _ if endpoint.is(EPENA) && !endpoint.is(NAKSTS) && is_there => Ok(bytes),
            _ => Err(Reply::Nak),
        }
    }

    fn give(&mut self, number: u8) -> Reply {
        let bytes = match self.ready(number) {
            Ok(bytes) => bytes,
            Err(refused) => return refused,
        };
        let index = usize::from(number);
        let mut data: Vec<u8> =
            self.sending[index].drain(..bytes.div_ceil(4)).flat_map(u32::to_le_bytes).collect();
        data.truncate(bytes);
        if number == 0 {
            self.address = self.set_address();
        }
        let endpoint = &mut self.to_host[index];
        let data1 = endpoint.data1;
        endpoint.data1 = !data1;
        endpoint.control &= !EPENA;
        endpoint.interrupts |= XFRC;
        endpoint.size = 0;
        Reply::Data(data1, data)
    }

    fn room(&self, number: usize) -> u32 {
        (self.fifos[number] >> 16).saturating_sub(self.sending[number].len() as u32)
    }

    fn endpoint_interrupts(&self) -> u32 {
        let to_host = |number: usize| {
            let empty = if self.sending[number].is_empty() { TXFE } else { 0 };
            let asked = if self.diepempmsk >> number & 1 == 1 { TXFE } else { 0 };
            (self.to_host[number].interrupts & self.masks[0] | empty & asked) != 0
        };
        let from_host = |number: usize| self.from_host[number].interrupts & self.masks[1] != 0;
        (0..ENDPOINTS).fold(0, |all, number| {
            all | u32::from(to_host(number)) << number | u32::from(from_host(number)) << (16 + number)
        })
    }

    fn status(&self) -> u32 {
        let endpoints = self.endpoint_interrupts() & self.daintmsk;
        let bit = |is_so: bool, bit: u32| if is_so { bit } else { 0 };
        self.gintsts
            | bit(!self.received.is_empty(), RXFLVL)
            | bit(endpoints & 0xFFFF != 0, IEPINT)
            | bit(endpoints >> 16 != 0, OEPINT)
            | bit(self.gusbcfg & FDMOD == 0, 1)
    }

    /// Whether the port's interrupt is raised.
    pub fn interrupts(&self) -> bool {
        self.gahbcfg & 1 == 1 && self.status() & self.gintmsk != 0
    }

    fn pop(&mut self) -> Option<u32> {
        // The words of a packet must be read before the next status.
        if !self.popped.is_empty() {
            return None;
        }
        let Received { endpoint, status, words, bytes } = self.received.pop_front()?;
        self.popped = words;
        let done = &mut self.from_host[endpoint as usize].interrupts;
        match status {
            OUT_DONE => *done |= XFRC,
            SETUP_DONE => *done |= STUP,
            _ => {}
        }
        Some(endpoint | bytes << 4 | status << 17)
    }

    /// The register at this offset.
    pub fn read(&mut self, offset: u32, now: Ps) -> Option<u32> {
        let number = (offset >> 5 & 0x1F) as usize;
        Some(match offset {
            // Nothing of OTG; a register of later versions.
            0x004 | 0x050 => 0,
            0x008 => self.gahbcfg,
            0x00C => self.gusbcfg,
            // The bus to the memories is idle; flushes are done.
            0x010 => 1 << 31,
            0x014 => self.status(),
            0x018 => self.gintmsk,
            0x020 => self.pop()?,
            0x024 => self.grxfsiz,
            0x028 => self.fifos[0],
            0x038 => self.gccfg,
            0x03C => 0x1200,
            0x104 | 0x108 | 0x10C => self.fifos[(offset as usize - 0x100) / 4],
            0x800 => self.dcfg,
            0x804 => self.dctl,
            // Full speed.
            0x808 => 3 << 1 | self.frame(now) << 8,
            0x810 => self.masks[0],
            0x814 => self.masks[1],
            0x818 => self.endpoint_interrupts(),
            0x81C => self.daintmsk,
            0x834 => self.diepempmsk,
            0x900..0x980 => match offset & 0x1F {
                0x00 => self.to_host[number & 7].read_control(),
                0x08 => {
                    let empty = if self.sending[number & 7].is_empty() { TXFE } else { 0 };
                    self.to_host[number & 7].interrupts | empty
                }
                0x10 => self.to_host[number & 7].size,
                0x18 => self.room(number & 7),
                _ => return None,
            },
            0xB00..0xB80 => match offset & 0x1F {
                0x00 => self.from_host[number & 7].read_control(),
                0x08 => self.from_host[number & 7].interrupts,
                0x10 => self.from_host[number & 7].size,
                _ => return None,
            },
            0xE00 => self.pcgcctl,
            0x1000..0x5000 => self.popped.pop_front()?,
            _ => return None,
        })
    }

    /// Writes the register at this offset.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        let number = (offset >> 5 & 0x1F) as usize;
        match offset {
            0x004 => {}
            0x008 if value & !1 == 0 => self.gahbcfg = value,
            0x00C if value & (1 << 29) == 0 => self.gusbcfg = value,
            0x010 => self.flush(value)?,
            // Flags are cleared by a one.
            0x014 => self.gintsts &= !value,
            0x018 => self.gintmsk = value,
            0x024 => self.grxfsiz = Some(value).filter(|words| *words as usize <= FIFO_WORDS)?,
            0x028 | 0x104 | 0x108 | 0x10C => {
                let end = (value & 0xFFFF) + (value >> 16);
                let index = if offset == 0x028 { 0 } else { (offset as usize - 0x100) / 4 };
                self.fifos[index] = Some(value).filter(|_| end as usize <= FIFO_WORDS)?;
            }
            0x038 => self.gccfg = value,
            0x800 => {
                self.dcfg = value;
                if self.set_address() == 0 {
                    self.address = 0;
                }
            }
            0x804 if value & !SDIS == 0 => self.dctl = value,
            0x810 => self.masks[0] = value,
            0x814 => self.masks[1] = value,
            0x81C => self.daintmsk = value,
            0x834 => self.diepempmsk = value,
            0x900..0x980 => {
                let endpoint = &mut self.to_host[number & 7];
                match offset & 0x1F {
                    0x00 => endpoint.write_control(value),
                    0x08 => endpoint.interrupts &= !value,
                    0x10 => endpoint.size = value,
                    _ => return None,
                }
            }
            0xB00..0xB80 => {
                let endpoint = &mut self.from_host[number & 7];
                match offset & 0x1F {
                    0x00 => endpoint.write_control(value),
                    0x08 => endpoint.interrupts &= !value,
                    0x10 => endpoint.size = value,
                    _ => return None,
                }
            }
            0xE00 => self.pcgcctl = value,
            0x1000..0x5000 => {
                let number = (offset as usize >> 12) - 1;
                if self.room(number) == 0 {
                    return None;
                }
                self.sending[number].push_back(value);
            }
            _ => return None,
        }
        Some(())
    }

    fn flush(&mut self, value: u32) -> Option<()> {
        if value & 1 == 1 {
            return None;
        }
        if value & 1 << 4 != 0 {
            self.received.clear();
            self.popped.clear();
        }
        if value & 1 << 5 != 0 {
            match (value >> 6 & 0x1F) as usize {
                0x10 => self.sending.iter_mut().for_each(VecDeque::clear),
                number => self.sending.get_mut(number)?.clear(),
            }
        }
        Some(())
    }
}
