//! A power-on's empty memory, and the board's surroundings.

use std::io::Write;

use anyhow::Result;
use hums_blackbox::Writer;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::parameters::Params;
use hums_onboard::queues::Queues;
use hums_onboard::{Mailbox, PortStatus, StoreStatus};
use hums_recorder::status::CardReading;
use hums_recorder::{Block, Buffers, CardDevice, CardStatus, Trouble};

use crate::card::SimCard;
use crate::card::sim::CardError;
use crate::run::store::FileFlash;
use crate::source::told::Finding;

/// Everything static on the board.
pub(super) struct Memory {
    pub(super) card_status: CardStatus,
    pub(super) port_status: PortStatus,
    pub(super) store_status: StoreStatus,
    pub(super) mailbox: Mailbox,
    pub(super) held: Buffers,
    pub(super) queues: Box<Queues>,
    pub(super) writer: Box<Writer>,
    pub(super) monitor: Box<Monitor>,
}

impl Memory {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            card_status: CardStatus::new(),
            port_status: PortStatus::default(),
            store_status: StoreStatus::default(),
            mailbox: Mailbox::new(),
            held: Buffers::new(),
            queues: Box::new(Queues::new()),
            writer: Box::new(Writer::new()),
            monitor: Box::new(Monitor::new(*params)),
        }
    }

    pub(super) fn card_reading(&self) -> CardReading {
        self.card_status.read()
    }
}

pub(super) struct Outside<'a, 'w> {
    pub(super) slot: &'a Slot<'a>,
    pub(super) flash: &'a FileFlash,
    pub(super) gs: &'w mut (dyn Write + Send),
    pub(super) autopilot: &'w mut (dyn Write + Send),
    /// Changes of level.
    pub(super) findings: &'w mut dyn FnMut(Finding),
    /// Next short power cut, microseconds since the first input byte.
    pub(super) reboot_at_us: Option<u64>,
}

pub(super) struct Slot<'a> {
    pub(super) card: &'a SimCard,
    /// Microseconds since the first input byte.
    pub(super) power_on_us: u64,
}

impl CardDevice for Slot<'_> {
    type Error = CardError;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), CardError> {
        self.card.read(blocks, start)
    }

    fn write(&self, blocks: &[Block], start: u32) -> Result<(), CardError> {
        self.card.write(blocks, start)
    }

    fn num_blocks(&self) -> Result<u32, CardError> {
        self.card.num_blocks()
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.card.clock().saturating_sub(self.power_on_us))
    }

    fn keeps_logs(&self) -> bool {
        self.card.keeps_logs()
    }

    fn trouble(error: &CardError) -> Trouble {
        match error {
            CardError::PowerGone | CardError::Absent => Trouble::Gone,
            CardError::WriteRefused | CardError::OutOfRange | CardError::Image(_) => Trouble::Refusing,
        }
    }
}
