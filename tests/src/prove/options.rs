//! What a campaign is asked for.

/// How much is tried.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// The short form, for every change; otherwise the long one.
    pub short: bool,
    /// Makes chance repeatable.
    pub seed: u64,
    /// How many cases instead of the campaign's own number.
    pub runs: Option<u64>,
}

impl Options {
    /// The number of cases: as asked, or one of these.
    pub(super) fn runs(&self, long: u64, short: u64) -> u64 {
        self.runs.unwrap_or(if self.short { short } else { long })
    }
}
