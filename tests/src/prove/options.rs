//! Options of a campaign.

/// The extent of a campaign.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The short form, for every change; otherwise the long one.
    pub short: bool,
    /// Makes chance repeatable.
    pub seed: u64,
    /// A number of cases instead of the campaign's own.
    pub runs: Option<u64>,
}

impl Options {
    /// The number of cases: the requested one, or one of these.
    pub(super) fn runs(&self, long: u64, short: u64) -> u64 {
        self.runs.unwrap_or(if self.short { short } else { long })
    }
}
