//! The card's side of the disk, and its lane to the bus.
//!
//! ```text
//! bus (class) -> packets -> Server -> Transport -> Disk -> card
//! host        <- bus     <- chunks <-
//! ```
//! The server is plain code that waits for the card and for room. All waits call the rest of the program (`meanwhile`), the
//! bus among it. So the card is read while the bus sends. Until the next command comes, the server reads the blocks behind the
//! last ones into a free chunk, and sleeps (`idle`).

use core::cell::Cell;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::{channel, zerocopy_channel};
use hums_core::clock::Instant;
use hums_recorder::{Block, CardDevice, WaitWork};

use crate::PACKET_BYTES;
use crate::guard::Link;
use crate::scsi::Disk;
use crate::transport::{Step, Transport};

/// Chunks: one is sent, one is read, one waits.
const CHUNKS: usize = 3;

/// Bytes for the host, in memory of blocks.
pub struct Chunk<'b> {
    pub(crate) blocks: &'b mut [Block],
    bytes: usize,
    pub(crate) ahead: Option<Ahead>,
}

/// Blocks of the card that no command has asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead {
    pub(crate) first: u32,
    pub(crate) count: usize,
    pub(crate) read: Instant,
}

impl<'b> Chunk<'b> {
    /// Equal parts of the memory, at least one block each.
    pub fn of(memory: &'b mut [Block]) -> [Self; CHUNKS] {
        let each = memory.len() / CHUNKS;
        let mut parts = memory.chunks_exact_mut(each.max(1));
        core::array::from_fn(|_| Self { blocks: parts.next().unwrap_or_default(), bytes: 0, ahead: None })
    }

    /// Its bytes.
    pub fn data(&self) -> &[u8] {
        self.blocks.as_flattened().get(..self.bytes).unwrap_or_default()
    }

    /// Takes these bytes.
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        self.ahead = None;
        if let Some(to) = self.blocks.as_flattened_mut().get_mut(..bytes.len()) {
            to.copy_from_slice(bytes);
        }
        self.bytes = bytes.len();
    }

    /// Has this many bytes of its blocks.
    pub(crate) const fn has(&mut self, bytes: u32) {
        self.bytes = bytes as usize;
    }
}

/// Chunks on their way to the host.
pub type Chunks<'a, 'b> = zerocopy_channel::Channel<'a, NoopRawMutex, Chunk<'b>>;
pub(crate) type Outgoing<'a, 'b> = zerocopy_channel::Receiver<'a, NoopRawMutex, Chunk<'b>>;
pub(crate) type Packet = ([u8; PACKET_BYTES], usize);

/// Packets of the host on their way to the card's side. Both sides run in turns, never at once.
pub struct Lane {
    pub(crate) packets: channel::Channel<NoopRawMutex, Packet, 1>,
    aborts: Cell<u32>,
}

impl Default for Lane {
    fn default() -> Self {
        Self { packets: channel::Channel::new(), aborts: Cell::new(0) }
    }
}

impl Lane {
    /// Ends the command in work: its bytes are dropped.
    pub(crate) fn abort(&self, chunks: &mut Outgoing<'_, '_>) {
        self.aborts.set(self.aborts.get().wrapping_add(1));
        self.packets.clear();
        chunks.clear();
    }
}

/// The host has reset class or bus.
struct Aborted;

/// The card's side.
pub struct Server<'a, 'b> {
    chunks: zerocopy_channel::Sender<'a, NoopRawMutex, Chunk<'b>>,
    lane: &'a Lane,
    link: &'a Link,
    idle: fn(),
    aborts: u32,
}

impl<'a, 'b> Server<'a, 'b> {
    /// The side that fills the chunks. Lane and link must be those of the class. `idle` returns after the next interrupt, or at
    /// once if one came since it returned.
    pub const fn new(
        chunks: zerocopy_channel::Sender<'a, NoopRawMutex, Chunk<'b>>,
        lane: &'a Lane,
        link: &'a Link,
        idle: fn(),
    ) -> Self {
        Self { chunks, lane, link, idle, aborts: 0 }
    }

    /// Serves the disk until the host has ejected it, and has the status of that command.
    pub fn run<C: CardDevice>(&mut self, disk: &mut Disk<C>, meanwhile: WaitWork<'_>) {
        while !disk.is_ejected() {
            let _ = self.command(disk, meanwhile);
        }
        let _ = self.wait(meanwhile, |server| server.chunks.is_empty().then_some(()));
    }

    fn command<C: CardDevice>(&mut self, disk: &mut Disk<C>, meanwhile: WaitWork<'_>) -> Result<(), Aborted> {
        let (packet, bytes) = loop {
            meanwhile();
            if let Ok(packet) = self.lane.packets.try_receive() {
                break packet;
            }
            if let Some(chunk) = self.chunks.try_send() {
                disk.read_ahead(chunk, meanwhile);
            }
            (self.idle)();
        };
        self.aborts = self.lane.aborts.get();
        let Ok(mut transport) = Transport::begin(packet.get(..bytes).unwrap_or_default(), disk) else {
            self.link.halt();
            return self.wait(meanwhile, |_| None::<()>);
        };
        loop {
            self.wait(meanwhile, |server| server.chunks.try_send().map(drop))?;
            let Some(chunk) = self.chunks.try_send() else { continue };
            let step = transport.step(disk, chunk, meanwhile);
            self.check()?;
            match step {
                Step::Send => self.chunks.send_done(),
                Step::Take => {
                    let (_, bytes) = self.wait(meanwhile, |server| server.lane.packets.try_receive().ok())?;
                    transport.taken(bytes);
                }
                Step::End => {
                    self.chunks.send_done();
                    return Ok(());
                }
            }
        }
    }

    const fn check(&self) -> Result<(), Aborted> {
        if self.lane.aborts.get() == self.aborts { Ok(()) } else { Err(Aborted) }
    }

    fn wait<T>(
        &mut self,
        meanwhile: WaitWork<'_>,
        mut look: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Aborted> {
        loop {
            meanwhile();
            self.check()?;
            if let Some(found) = look(self) {
                return Ok(found);
            }
        }
    }
}
