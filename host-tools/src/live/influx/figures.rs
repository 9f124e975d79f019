//! How writing to the database goes.

use serde::Serialize;

/// What became of the points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait, in memory or in the file.
    pub waiting: u64,
    /// Bytes of them that are in the file.
    pub spilled_bytes: u64,
    /// The database refuses them for what they are.
    pub rejected: u64,
    /// Neither memory nor the file took them.
    pub lost: u64,
    /// What the database said last when it did not take a batch; empty while all is well.
    pub trouble: String,
}
