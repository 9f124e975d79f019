//! PX4's onboard logs (ULog): `.ulg`.

use anyhow::{Result, bail};

use super::input::Input;
use super::item::Reader;

/// The first bytes of every such log.
const MAGIC: &[u8] = &[0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35];

/// Whether these first bytes of a file (64 KiB of a longer one) are those of such a log.
pub fn detect(start: &[u8]) -> bool {
    start.starts_with(MAGIC)
}

/// The reader of such a log.
pub fn open(_input: Input) -> Result<Box<dyn Reader>> {
    bail!("is a ULog, which this version cannot read yet")
}
