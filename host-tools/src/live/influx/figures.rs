//! How writing to the database goes.

use serde::Serialize;

/// Points by their fate.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait.
    pub waiting: u64,
    /// Invalid points.
    pub rejected: u64,
    /// Last refusal.
    pub refusal: String,
    /// Part of a recording that the user stopped; else empty.
    pub left_out: String,
    /// Dropped points.
    pub lost: u64,
    /// Last reason for not taking a batch; else empty.
    pub trouble: String,
}
