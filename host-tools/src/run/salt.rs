//! In place of a board's random number: two recordings have two, and the same run has the same again.

use anyhow::{Context as _, Result};
use sha2::{Digest as _, Sha256};

use super::arrivals::Arrivals;
use crate::cli::Sim;
use crate::endpoint::Endpoint;
use crate::files::{add_ends, short};

/// A run's random number: by input, parameters and faults; random for live input.
pub(super) fn salt(run: &Sim, arrivals: &mut Arrivals) -> Result<u32> {
    let mut hash = Sha256::new();
    hash.update(format!("{:?}", run.faults));
    if let Some(params) = &run.params {
        add_ends(&mut hash, params).with_context(|| format!("{}: cannot be read", params.display()))?;
    }
    match &run.input {
        Endpoint::File(path) if path.is_file() => {
            add_ends(&mut hash, path).with_context(|| format!("{}: cannot be read", path.display()))?;
        }
        input if input.is_live() => {
            let random = getrandom::u64().map_err(|error| anyhow::anyhow!("no random number: {error}"))?;
            hash.update(random.to_le_bytes());
        }
        // A pipe is read once: its first bytes.
        _ => {
            if let Some(first) = arrivals.next_arrival()? {
                hash.update(&first.bytes);
                arrivals.put_back(first);
            }
        }
    }
    Ok(short(hash))
}
