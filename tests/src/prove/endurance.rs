use super::{Figures, Options};
use anyhow::Result;
pub(super) fn run(_: &Options) -> Result<Figures> {
    Ok(Figures::default())
}
