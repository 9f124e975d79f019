//! Options of a campaign.

/// A campaign's extent.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The short form, for every change.
    pub short: bool,
    /// Makes chance repeatable.
    pub seed: u64,
    /// A number of cases instead of the campaign's own.
    pub runs: Option<u64>,
}

impl Options {
    /// Requested, or one of these.
    pub(super) fn runs(&self, long: u64, short: u64) -> u64 {
        self.runs.unwrap_or(if self.short { short } else { long })
    }
}
