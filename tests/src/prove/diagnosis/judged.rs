//! Sets of flights, judged.

use anyhow::{Context as _, Result};
use rayon::prelude::*;

use super::options::Known;
use super::outcome::{Outcome, judge};
use super::sets::Set;

#[derive(Debug)]
pub(super) struct Judged {
    pub(super) name: String,
    pub(super) known: Known,
    pub(super) is_labelled: bool,
    pub(super) outcomes: Vec<Outcome>,
}

pub(super) fn judge_all(set: &Set) -> Result<Judged> {
    let outcomes = set
        .flights
        .par_iter()
        .with_max_len(1)
        .map(|(place, label)| judge(place, label.as_ref()).with_context(|| place.title.clone()));
    Ok(Judged {
        name: set.name.clone(),
        known: set.known,
        is_labelled: set.is_labelled(),
        outcomes: outcomes.collect::<Result<_>>()?,
    })
}

pub(super) fn with_label(sets: &[Judged], labelled: bool) -> impl Iterator<Item = &Judged> {
    sets.iter().filter(move |judged| judged.is_labelled == labelled)
}
