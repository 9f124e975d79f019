//! A browser opens no links.

use std::io::Write;

use anyhow::{Result, bail};

use super::Source;
use crate::endpoint::Endpoint;

pub(super) fn open(endpoint: &Endpoint) -> Result<(Box<dyn Source>, Box<dyn Write + Send>)> {
    bail!("{endpoint}: a browser opens no links; use the program hums")
}
