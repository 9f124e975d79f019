//! Properties of a card that do not change while it has power.

use crate::MS;
use crate::fault::{Fault, Plan};
use crate::medium::Medium;

/// The kinds of cards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Up to 2 GB, of before version 2 of the specification.
    Old,
    /// Up to 2 GB.
    Sdsc,
    /// 2 to 32 GB.
    Sdhc,
    /// 32 GB to 2 TB.
    Sdxc,
}

impl Kind {
    pub(crate) const fn by_bytes(self) -> bool {
        matches!(self, Self::Old | Self::Sdsc)
    }
}

/// A card without power.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its kind.
    pub kind: Kind,
    /// Its content.
    pub medium: Medium,
    /// Its serial number.
    pub serial: u32,
    /// Nanoseconds to start.
    pub start_ns: u64,
    /// Nanoseconds to find a block.
    pub read_ns: u64,
    /// Nanoseconds between two sent blocks of a row.
    pub read_next_ns: u64,
    /// Nanoseconds to take one block alone, and one of many.
    pub write_ns: (u64, u64),
    /// Write protection in its CSD: for now, for ever.
    pub locked: (bool, bool),
    /// Its faults.
    pub plans: Vec<Plan>,
}

impl Model {
    /// Faultless, with usual times.
    pub fn new(kind: Kind, medium: Medium) -> Self {
        Self {
            kind,
            medium,
            serial: 0x1234_5678,
            start_ns: 20 * MS,
            read_ns: MS / 2,
            read_next_ns: MS / 50,
            write_ns: (2 * MS, MS / 4),
            locked: (false, false),
            plans: Vec::new(),
        }
    }

    /// The card with a fault.
    pub fn with(mut self, plan: Plan) -> Self {
        self.plans.push(plan);
        self
    }

    /// The card without faults.
    pub fn healed(&self) -> Self {
        Self { plans: Vec::new(), ..self.clone() }
    }

    pub(crate) fn has(&mut self, now_ns: u64, wanted: impl Fn(Fault) -> bool) -> Option<Fault> {
        let mut plans = self.plans.iter_mut().filter(|plan| wanted(plan.fault));
        plans.find_map(|plan| plan.strikes(now_ns).then_some(plan.fault))
    }

    pub(crate) fn cid(&self) -> [u8; 16] {
        let mut cid = *b"\x03SDHUMS0\x10\0\0\0\0\x01\x6A\0";
        cid[9..13].copy_from_slice(&self.serial.to_be_bytes());
        cid[15] = crc7(&cid[..15]);
        cid
    }

    pub(crate) fn csd(&self) -> [u8; 16] {
        let size = self.medium.size();
        let mut csd = if self.kind.by_bytes() {
            // The CSD of this structure counts units of 512 blocks.
            let units = (size >> 9) - 1;
            [
                0x00,
                0x26,
                0x00,
                0x32,
                0x5F,
                0x59,
                0x80 | (units >> 10) as u8,
                (units >> 2) as u8,
                (units << 6) as u8,
            ]
            .into_iter()
            .chain([0x03, 0x80, 0, 0, 0x40, 0, 0])
            .collect::<Vec<_>>()
        } else {
            let units = (size >> 10) - 1;
            [0x40, 0x0E, 0x00, 0x32, 0x5B, 0x59, 0, (units >> 16) as u8, (units >> 8) as u8, units as u8]
                .into_iter()
                .chain([0x7F, 0x80, 0x0A, 0x40, 0, 0])
                .collect()
        };
        csd[14] = u8::from(self.locked.0) << 4 | u8::from(self.locked.1) << 5;
        csd[15] = crc7(&csd[..15]);
        csd.try_into().unwrap_or_default()
    }
}

pub(crate) fn crc7(bytes: &[u8]) -> u8 {
    let mut crc = 0_u8;
    for byte in bytes {
        for bit in (0..8).rev() {
            let carry = (crc >> 6) ^ (byte >> bit) & 1;
            crc = (crc << 1) & 0x7F;
            if carry & 1 == 1 {
                crc ^= 0x09;
            }
        }
    }
    crc << 1 | 1
}

/// The polynomial x^16 + x^12 + x^5 + 1 for each byte at once.
pub(crate) fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0_u16, |crc, byte| {
        let high = (crc >> 8) ^ u16::from(*byte);
        let high = high ^ high >> 4;
        crc << 8 ^ high << 12 ^ high << 5 ^ high
    })
}
