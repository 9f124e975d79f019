//! A run's files: none may be two things at once.

use std::path::{self, Path};

use anyhow::Result;

use crate::cli::Sim;
use crate::endpoint::Endpoint;
use crate::files::{FileId, Inputs, Output, is_seekable, means_standard_output};
use crate::outcome::usage;

/// Files that must not be overwritten: inputs, card and store. Refuses a run that names one file twice.
pub(super) fn inputs(run: &Sim) -> Result<Inputs> {
    let tap = run.tap.as_deref();
    let mut inputs = Inputs::of(run.params.as_deref().into_iter().chain(run.firmware.as_deref()));
    inputs.add_endpoint(&run.input);
    run.gs_input.iter().for_each(|input| inputs.add_endpoint(input));
    if run.sd.metadata().is_ok_and(|about| is_seekable(&about) && !about.is_file()) {
        return Err(usage(format!(
            "--sd {}: is a disk or a card, and a run records into a file only; name an image file",
            run.sd.display()
        )));
    }
    for in_place in std::iter::once(run.sd.as_path()).chain(run.store.as_deref()) {
        inputs.refuse(in_place)?;
        inputs.add(in_place);
    }
    let gs = match &run.gs {
        Some(Endpoint::File(path)) => Some(path.as_path()),
        _ => None,
    };
    if run.gs == Some(Endpoint::Standard) && tap.is_some_and(means_standard_output) {
        return Err(usage("--gs - and --tap - both want standard output; give one of them a file"));
    }
    for output in gs.into_iter().chain(tap) {
        // Before the card changes.
        Output::check(output, &inputs)?;
    }
    if let (Some(gs), Some(tap)) = (gs, tap)
        && is_same(gs, tap)
        && !is_device(gs)
    {
        return Err(usage(format!(
            "--gs {} and --tap {}: are one file; name two",
            gs.display(),
            tap.display()
        )));
    }
    Ok(inputs)
}

/// Whether two paths are one file, which may not exist yet.
fn is_same(one: &Path, other: &Path) -> bool {
    match [one, other].map(FileId::of) {
        [Ok(one), Ok(other)] => one == other,
        [Err(_), Err(_)] => path::absolute(one).ok() == path::absolute(other).ok(),
        _ => false,
    }
}

/// Neither file nor folder: `/dev/null` may be written by both.
fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|about| !about.is_file() && !about.is_dir())
}
