//! The files of a run: none may be two things at once.

use std::path::Path;

use anyhow::Result;

use crate::cli::Run;
use crate::endpoint::Endpoint;
use crate::files::Inputs;

/// What of a run must not be written over: its inputs, and the card and the store, which are updated in place. Refuses
/// a run of which one file is named twice.
pub(super) fn inputs(run: &Run, tap: Option<&Path>, firmware: Option<&Path>) -> Result<Inputs> {
    let mut inputs = Inputs::of(run.params.as_deref().into_iter().chain(firmware));
    inputs.add_endpoint(&run.input);
    run.gs_input.iter().for_each(|input| inputs.add_endpoint(input));
    for in_place in std::iter::once(run.sd.as_path()).chain(run.store.as_deref()) {
        inputs.refuse(in_place)?;
        inputs.add(in_place);
    }
    let gs = match &run.gs {
        Some(Endpoint::File(path)) => Some(path.as_path()),
        _ => None,
    };
    let mut taken = inputs.clone();
    for output in gs.into_iter().chain(tap) {
        taken.refuse(output)?;
        taken.add(output);
    }
    Ok(inputs)
}
